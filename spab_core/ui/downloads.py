"""One button for everything that a view can be taken away as."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pandas as pd
import plotly.graph_objects as go
import streamlit as st

from spab_core.common.files import csv_bytes
from spab_core.design.model import Design, design_toml
from spab_core.reporting.export import browser_path, figure_html, figure_png
from spab_core.ui.view import chosen_design, is_reference

_KINDS = {
    "npz": ("Data, NPZ", "application/octet-stream"),
    "nc": ("Data, NetCDF", "application/x-netcdf"),
    "toml": ("Design, TOML", "application/toml"),
}

_PNG_HELP = "Drawn by Chromium or Chrome on the server; the camera above each figure works without"


def downloads(
    name: str,
    figures: dict[str, go.Figure | Callable[[], go.Figure]],
    tables: dict[str, Callable[[], pd.DataFrame]] | None = None,
    files: dict[str, Callable[[], bytes]] | None = None,
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
    design = chosen_design()  # now: a file is made on another thread, without a session
    made = dict(files or {})
    if not is_reference():
        made["toml"] = partial(_toml, design)
    with st.popover("Download", icon=":material/download:", key=f"{name}_downloads"):
        for title, figure in figures.items():
            stem = _stem(name, title)
            html, png = st.columns(2)
            html.download_button(
                f"{title}, HTML",
                partial(_figure, figure_html, figure),
                f"{stem}.html",
                "text/html",
                key=f"{stem}_html",
                on_click="ignore",
                width="stretch",
            )
            png.download_button(
                f"{title}, PNG",
                partial(_figure, figure_png, figure),
                f"{stem}.png",
                "image/png",
                key=f"{stem}_png",
                on_click="ignore",
                width="stretch",
                disabled=browser_path() is None,
                help=_PNG_HELP,
            )
        for title, table in (tables or {}).items():
            stem = _stem(name, title)
            st.download_button(
                f"{title}, CSV",
                partial(_csv, table),
                f"{stem}.csv",
                "text/csv",
                key=f"{stem}_csv",
                on_click="ignore",
                width="stretch",
            )
        for ending, make in made.items():
            label, mime = _KINDS[ending]
            st.download_button(
                label,
                make,
                f"{'my' if ending == 'toml' else name}.{ending}",
                mime,
                key=f"{name}_{ending}",
                on_click="ignore",
                width="stretch",
            )
        if command:
            st.caption("The same on the command line:")
            st.code(command, language="bash", wrap_lines=True)


def _stem(name: str, title: str) -> str:
    return f"{name}_{title}".replace(" ", "_").lower()


def _figure(
    write: Callable[[go.Figure], bytes], figure: go.Figure | Callable[[], go.Figure]
) -> bytes:
    taken = figure() if callable(figure) else figure
    return write(
        go.Figure(taken.to_dict())
    )  # what is shown: one drawn before (ui/drawn.py) has nothing else


def _csv(table: Callable[[], pd.DataFrame]) -> bytes:
    return csv_bytes(table())


def _toml(design: Design) -> bytes:
    return design_toml(design).encode()
