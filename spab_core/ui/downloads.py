"""One button for everything that a view can be taken away as."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import plotly.graph_objects as go
import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.common.files import csv_bytes
from spab_core.design.model import design_toml
from spab_core.reporting.export import browser_path, figure_html, figure_png
from spab_core.ui.view import chosen_design, is_reference

_LABELS = {"npz": "Data, NPZ", "nc": "Data, NetCDF"}
_TYPES = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".nc": "application/x-netcdf",
    ".npz": "application/octet-stream",
    ".json": "application/json",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".toml": "application/toml",
    ".xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
}

_PNG_HELP = "Drawn by Chromium or Chrome on the server; the camera above each figure works without"


def file_button(
    label: str,
    make: Callable[[], bytes | str] | str,
    file: str,
    key: str = "",
    place: DeltaGenerator | None = None,
    **options: Any,
) -> None:
    """Offer a file; what a function gives is made on the click.

    Parameters
    ----------
    label : str
    make : callable or str
        Gives the content, on another thread without a session; or the content.
    file : str
        Its name, whose ending says its type.
    key : str
        Left out: the name of the file.
    place : DeltaGenerator, optional
    options
        Of ``st.download_button``.
    """
    button = place.download_button if place else st.download_button
    button(
        label,
        make,
        file,
        _TYPES[Path(file).suffix],
        key=key or file.replace(".", "_"),
        on_click="ignore",
        **{"width": "stretch"} | options,
    )


def downloads(
    name: str,
    figures: Mapping[str, go.Figure | Callable[[], go.Figure]],
    tables: Mapping[str, Callable[[], pd.DataFrame]] | None = None,
    files: Mapping[str, Callable[[], bytes]] | None = None,
    command: str = "",
) -> None:
    """A popover with the view's figures (HTML; PNG where a browser is found), data and the command
    that gives them.

    Parameters
    ----------
    name : str
        Beginning of the files' names; also of the keys, so once on a page.
    figures : dict
        Figure, or a function that gives it, by a short title.
    tables : dict
        Function that gives a table, by a short title: CSV.
    files : dict
        Function that gives a file's bytes, by its ending, ``npz`` or ``nc``.
    command : str
        Command line that computes the same.

    Notes
    -----
    Files are made on the click, not before.
    """
    with st.popover("Download", icon=":material/download:", key=f"{name}_downloads"):
        for title, figure in figures.items():
            stem = _stem(name, title)
            html, png = st.columns(2)
            file_button(
                f"{title}, HTML", partial(_figure, figure_html, figure), f"{stem}.html", place=html
            )
            file_button(
                f"{title}, PNG",
                partial(_figure, figure_png, figure),
                f"{stem}.png",
                place=png,
                disabled=browser_path() is None,
                help=_PNG_HELP,
            )
        semicolons = bool(tables) and st.toggle(
            "CSV with semicolons and decimal commas",
            key=f"{name}_semicolons",
            help="As Excel reads it where a comma is the decimal sign",
        )
        for title, table in (tables or {}).items():
            file_button(
                f"{title}, CSV", partial(_csv, table, semicolons), f"{_stem(name, title)}.csv"
            )
        for ending, make in (files or {}).items():
            file_button(_LABELS[ending], make, f"{name}.{ending}")
        if not is_reference():
            make_toml = partial(design_toml, chosen_design())
            file_button("Design, TOML", make_toml, "my.toml", f"{name}_toml")
        if command:
            st.caption("The same on the command line:")
            st.code(command, language=None, wrap_lines=True)


def _stem(name: str, title: str) -> str:
    return f"{name}_{title}".replace(" ", "_").lower()


def _figure(
    write: Callable[[go.Figure], bytes], figure: go.Figure | Callable[[], go.Figure]
) -> bytes:
    taken = figure() if callable(figure) else figure
    return write(
        go.Figure(taken.to_dict())
    )  # what is shown: one drawn before (ui/drawn.py) has nothing else


def _csv(table: Callable[[], pd.DataFrame], semicolons: bool) -> bytes:
    return csv_bytes(table(), semicolons)
