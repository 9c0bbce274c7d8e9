"""Results as files for others: figures as HTML and PNG, maps as NetCDF and CSV."""

from __future__ import annotations

import functools
import io
import json

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from choreographer.browsers.chromium import Chromium
from choreographer.errors import ChromeNotFoundError
from scipy.io import netcdf_file, netcdf_variable

from spab_core.common.errors import InputError
from spab_core.maps.stability_map import FIELDS, StabilityMap
from spab_core.solver.stepping import STATUS
from spab_core.surrogates.models import PredictedMap
from spab_core.trajectory.assessment import GRADES
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES

PNG_SIZE = (1200, 750)
# text arrays become numbers whose meanings are listed: NetCDF 3 has no strings
_CODES = {"regime": (NO_EXPONENT, *REGIMES), "status": STATUS, "assessment": GRADES}
_NUMBERS = {
    "mle": ("maximum Lyapunov exponent, natural logarithm", "per revolution"),
    "mle_standard_error": ("standard error of the exponent", "per revolution"),
    "contact_share": ("share of the time in which the wall carries over a tenth of the load", "1"),
    "max_eccentricity": ("largest eccentricity of the journal over the clearance", "1"),
    "period": ("period of the orbit, 0 unless periodic", "revolutions"),
    "revolutions": ("revolutions integrated", "revolutions"),
    "orbit_amplitude": (
        "half the longer side of the box around the orbit, over the clearance",
        "1",
    ),
    "thin_film_share": ("share of the time at an eccentricity above 0.9", "1"),
    "peak_contact_force": ("largest normal force of the asperities", "N"),
}


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


def map_table(m: StabilityMap) -> pd.DataFrame:
    """Return a map as a table of B M rows, one a cell, in the order of ``mle.ravel()``."""
    columns: dict[str, np.ndarray] = {
        "bearing_number": np.repeat(m.bearing_number, len(m.rotor_mass)),
        "speed_rpm": np.repeat(m.design.speed_rpm(1.0) * m.bearing_number, len(m.rotor_mass)),
        "rotor_mass_kg": np.tile(m.rotor_mass, len(m.bearing_number)),
    }
    cells = {name: getattr(m, name).ravel() for name in FIELDS}
    return pd.DataFrame(columns | cells | {"assessment": m.grades().ravel()})


def prediction_table(m: StabilityMap, predicted: PredictedMap) -> pd.DataFrame:
    """Return a predicted map beside the solved one, one row a cell as in :func:`map_table`."""
    return map_table(m)[["bearing_number", "speed_rpm", "rotor_mass_kg", "mle"]].assign(
        predicted_mle=predicted.mle.ravel(), trained=predicted.trained.ravel()
    )


def map_netcdf(m: StabilityMap) -> bytes:
    """Return a map as a NetCDF file (classic format) with units; regime and status are flags by
    the CF conventions, section 3.5.
    """
    buffer = io.BytesIO()
    file = netcdf_file(buffer, "w")
    file.title, file.Conventions = (
        "Stability map of a rotor on spherical porous gas bearings",
        "CF-1.11",
    )
    file.metadata = json.dumps(m.metadata)
    axes = {
        "bearing_number": (m.bearing_number, "bearing number", "1"),
        "rotor_mass": (m.rotor_mass, "rotor mass on one bearing", "kg"),
    }
    for name, (values, text, unit) in axes.items():
        file.createDimension(name, len(values))
        _variable(file, name, values.astype(float), (name,), text, unit)
    for name, (text, unit) in _NUMBERS.items():
        _variable(file, name, getattr(m, name), tuple(axes), text, unit)
    words = {
        "regime": np.where(m.regime == "", NO_EXPONENT, m.regime),
        "status": m.status,
        "assessment": m.grades(),
    }
    for name, meanings in _CODES.items():
        code = np.argmax(words[name][..., None] == np.array(meanings), -1).astype(np.int8)
        variable = _variable(file, name, code, tuple(axes), name, "1")
        variable.flag_values = np.arange(len(meanings), dtype=np.int8)
        variable.flag_meanings = " ".join(word.replace(" ", "_") for word in meanings)
    file.flush()
    return buffer.getvalue()


def _variable(
    file: netcdf_file,
    name: str,
    values: np.ndarray,
    dimensions: tuple[str, ...],
    text: str,
    unit: str,
) -> netcdf_variable:
    variable = file.createVariable(name, values.dtype, dimensions)
    variable[:] = values
    variable.long_name, variable.units = text, unit
    return variable
