"""Results as files for others: figures as HTML and PNG; maps, lines and points as CSV, NetCDF and
MATLAB files.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import plotly.graph_objects as go
from choreographer.browsers.chromium import Chromium
from choreographer.errors import ChromeNotFoundError

from spab_core.active_learning.quick_map import as_map
from spab_core.active_learning.refine import load_refinement
from spab_core.common.errors import InputError
from spab_core.common.files import csv_bytes
from spab_core.common.npz import UNREADABLE, open_npz
from spab_core.maps.bifurcation import load_bifurcation
from spab_core.maps.stability_map import StabilityMap, load_map
from spab_core.reporting.datasets import (
    Dataset,
    line_dataset,
    map_dataset,
    map_table,
    matlab_bytes,
    netcdf_bytes,
    point_dataset,
)
from spab_core.surrogates.models import PredictedMap
from spab_core.trajectory.point_file import load_point

__all__ = [
    "PNG_SIZE",
    "WRITERS",
    "browser_path",
    "figure_html",
    "figure_png",
    "map_netcdf",
    "map_table",
    "prediction_table",
    "result_dataset",
]

PNG_SIZE = (1200, 750)


@functools.cache
def browser_path() -> str | None:
    """Return the path of Chromium or Chrome, which draws PNG and prints PDF; None without one."""
    try:
        return Chromium.find_browser(skip_local=False)
    except (ChromeNotFoundError, OSError):
        return None


def figure_html(figure: go.Figure) -> bytes:
    """Return a figure as one HTML file that needs no network."""
    page: str = figure.to_html(include_plotlyjs=True, config={"displaylogo": False})
    return page.encode()


def figure_png(figure: go.Figure, width: int = PNG_SIZE[0], height: int = PNG_SIZE[1]) -> bytes:
    """Draw a figure as PNG of twice ``width`` x ``height`` pixels with a browser of this machine.

    Raises
    ------
    InputError
        Where there is no browser, or it fails.
    """
    if browser_path() is None:
        raise InputError(
            "a PNG is drawn by Chromium or Chrome, and none is found on this machine: take the "
            "HTML instead"
        )
    try:
        drawn = go.Figure(figure, layout_template="plotly_white")
        png: bytes = drawn.to_image(format="png", width=width, height=height, scale=2)
        return png
    except (RuntimeError, OSError, ValueError) as error:
        raise InputError(
            f"the browser did not draw the figure: {' '.join(str(error).split())[:200]}"
        ) from None


def prediction_table(m: StabilityMap, predicted: PredictedMap) -> pd.DataFrame:
    """Return a predicted map beside the solved one, one row a cell as in :func:`map_table`."""
    return map_table(m)[["bearing_number", "speed_rpm", "rotor_mass_kg", "mle"]].assign(
        predicted_mle=predicted.mle.ravel(), trained=predicted.trained.ravel()
    )


def map_netcdf(m: StabilityMap) -> bytes:
    """Return a map as a NetCDF file (:func:`spab_core.reporting.datasets.netcdf_bytes`), which
    ``load_map`` reads.
    """
    return netcdf_bytes(map_dataset(m))


def result_dataset(path: str | Path) -> Dataset:
    """Return the map, line, operating point or refinement in a file, as a dataset; of a refinement
    the map of its solved and predicted cells.

    Raises
    ------
    InputError
        For any other file.
    """
    found = ""
    with contextlib.suppress(*UNREADABLE), open_npz(path) as file:
        found = next((name for name in ("values", "trace", "batch", "trained") if name in file), "")
    if found == "values":
        return line_dataset(load_bifurcation(path))
    if found == "trace":
        return point_dataset(load_point(path))
    if found == "batch":
        return map_dataset(as_map(load_refinement(path)))
    if found == "trained":
        raise InputError(
            f"{str(path)[:200]!r} is a predicted map, exponents alone: load it with numpy.load"
        )
    return map_dataset(load_map(path))


WRITERS: dict[str, Callable[[Dataset], bytes]] = {
    ".nc": netcdf_bytes,
    ".csv": lambda data: csv_bytes(data.table),
    ".mat": matlab_bytes,
}
