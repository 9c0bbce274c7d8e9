"""Maps, lines and points as named arrays with units; such a dataset as NetCDF or MATLAB file."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import netcdf_file, savemat

from spab_core.design.model import Design
from spab_core.maps.bifurcation import Bifurcation, line_table
from spab_core.maps.map_netcdf import CODES
from spab_core.maps.stability_map import FIELDS, StabilityMap
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.point_file import point_arrays
from spab_core.trajectory.run import ALONG, STATE

_NUMBERS = {
    "mle": ("maximum Lyapunov exponent, natural logarithm", "per revolution"),
    "mle_standard_error": ("standard error of the exponent", "per revolution"),
    "contact_share": ("share of the time in which the wall carries over a tenth of the load", "1"),
    "max_eccentricity": ("largest eccentricity of the journal over the clearance", "1"),
    "least_film": ("least film thickness of the motion", "m"),
    "period": ("period of the orbit, 0 unless periodic", "revolutions"),
    "revolutions": ("revolutions integrated", "revolutions"),
    "orbit_amplitude": (
        "half the longer side of the box around the orbit, over the clearance",
        "1",
    ),
    "thin_film_share": ("share of the time at an eccentricity above 0.9", "1"),
    "peak_contact_force": ("largest normal force of the asperities", "N"),
}
_OF_LINES = (
    "mle",
    "mle_standard_error",
    "period",
    "contact_share",
    "max_eccentricity",
    "peak_contact_force",
)
_AXES = {
    "bearing_number": ("bearing number", "1"),
    "rotor_mass": ("rotor mass on one bearing", "kg"),
}
_STATE = "journal X2, Y2 and disc X1, Y1 over the clearance, then their velocities per radian"


@dataclass(frozen=True)
class Variable:
    """One array of a dataset.

    Attributes
    ----------
    dimensions : tuple of str
    values : ndarray
        Numbers, or words of which ``meanings`` lists all that there can be.
    text, unit : str
    meanings : tuple of str
        Empty for numbers.
    """

    dimensions: tuple[str, ...]
    values: np.ndarray
    text: str
    unit: str = "1"
    meanings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Dataset:
    """Named arrays of one result.

    Attributes
    ----------
    title : str
    variables : dict of Variable
    metadata : dict
        Design, settings, versions.
    table : DataFrame
        What of it a table holds.
    """

    title: str
    variables: dict[str, Variable]
    metadata: dict[str, Any]
    table: pd.DataFrame


def bearings_words(design: Design) -> str:
    """Return what a design's bearings are, such as "cylindrical porous gas bearings"."""
    shape = "cylindrical" if design.bearing.cylindrical else "spherical"
    return f"{shape} porous gas bearings"


def map_table(m: StabilityMap) -> pd.DataFrame:
    """Return a map as a table of B M rows, one a cell, in the order of ``mle.ravel()``."""
    columns: dict[str, np.ndarray] = {
        "bearing_number": np.repeat(m.bearing_number, len(m.rotor_mass)),
        "speed_rpm": np.repeat(m.design.speed_rpm(1.0) * m.bearing_number, len(m.rotor_mass)),
        "rotor_mass_kg": np.tile(m.rotor_mass, len(m.bearing_number)),
    }
    cells = {name: getattr(m, name).ravel() for name in FIELDS}
    judged = {"least_film_m": m.least_film.ravel(), "assessment": m.grades().ravel()}
    return pd.DataFrame(columns | cells | judged)


def _words(name: str, words: np.ndarray, dimensions: tuple[str, ...]) -> Variable:
    meanings = CODES[name]
    return Variable(dimensions, np.where(words == "", meanings[0], words), name, "1", meanings)


def map_dataset(m: StabilityMap) -> Dataset:
    """Return a map over (bearing_number, rotor_mass)."""
    axes = tuple(_AXES)
    found = {name: Variable((name,), getattr(m, name).astype(float), *_AXES[name]) for name in axes}
    found |= {name: Variable(axes, getattr(m, name), *about) for name, about in _NUMBERS.items()}
    for name, words in (("regime", m.regime), ("status", m.status), ("assessment", m.grades())):
        found[name] = _words(name, words, axes)
    title = f"Stability map of a rotor on {bearings_words(m.design)}"
    return Dataset(title, found, m.metadata, map_table(m))


def line_dataset(line: Bifurcation) -> Dataset:
    """Return a line over what it varies; arrays of a sweep begin with its name, such as
    ``cold_mle``.
    """
    axis = line.vary.replace("-", "_")
    held = next(name for name in _AXES if name != axis)
    found = {
        axis: Variable((axis,), line.values.astype(float), *_AXES[axis]),
        held: Variable((), np.array(float(line.at)), *_AXES[held]),
    }
    for sweep, branch in line.branches.items():
        found[f"{sweep}_section"] = Variable(
            (axis, "section_point", "coordinate"),
            branch.section,
            "X2, Y2, X1, Y1 over the clearance, once a revolution",
        )
        for name in _OF_LINES:
            found[f"{sweep}_{name}"] = Variable((axis,), getattr(branch, name), *_NUMBERS[name])
        film = Variable((axis,), line.least_film(sweep), *_NUMBERS["least_film"])
        found[f"{sweep}_least_film"] = film
        for name in ("regime", "status"):
            found[f"{sweep}_{name}"] = _words(name, getattr(branch, name), (axis,))
    title = f"Line of operating points of a rotor on {bearings_words(line.design)}"
    return Dataset(title, found, line.metadata, line_table(line))


def point_dataset(point: OperatingPoint) -> Dataset:
    """Return an operating point: its revolutions as a table; besides, the orbit and the final
    state.
    """
    t, each = point.trajectory, ("revolution",)
    force = point.design.force_unit
    about: dict[str, Variable] = {
        "rotor_mass": Variable((), np.array(point.rotor_mass), *_AXES["rotor_mass"]),
        "bearing_number": Variable((), np.array(point.bearing_number), *_AXES["bearing_number"]),
        "section": Variable((*each, "coordinate"), t.section, f"{_STATE}; once a revolution"),
        "contact_share": Variable(each, t.contact, *_NUMBERS["contact_share"]),
        "thin_film_share": Variable(each, t.thin, *_NUMBERS["thin_film_share"]),
        "max_eccentricity": Variable(each, t.peak, *_NUMBERS["max_eccentricity"]),
        "peak_contact_force": Variable(each, force * t.force, *_NUMBERS["peak_contact_force"]),
        "box": Variable((*each, "side"), t.box, "least, largest X2, least, largest Y2"),
        "growth": Variable(
            ("tangent_revolution",), t.growth, "growth of the tangent", "per revolution"
        ),
        "path": Variable(("path_revolution", "sample", "coordinate"), t.path, _STATE),
        "final": Variable(("state",), t.final, "state at the end: gas, rotor and what else moves"),
    }
    along = {}
    if len(t.axial):
        along = dict(zip((*ALONG, "Z_least", "Z_largest"), t.axial.T, strict=True))
        words = "Z and its derivative once a revolution, least and largest Z, over C"
        about["axial"] = Variable((*each, "axial_value"), t.axial, words)
    if t.axial_path.size:
        words = "Z over C and its derivative per radian, with path"
        dimensions = ("path_revolution", "sample", "axial_coordinate")
        about["axial_path"] = Variable(dimensions, t.axial_path, words)
    if point.mle:
        for name in ("value", "standard_error"):
            full = "mle" if name == "value" else f"mle_{name}"
            about[full] = Variable((), np.array(getattr(point.mle, name)), *_NUMBERS[full])
    metadata = json.loads(str(point_arrays(point)["metadata"]))
    table = pd.DataFrame({"revolution": np.arange(1, len(t.section) + 1)}).assign(
        **dict(zip(STATE, t.section.T, strict=True)),
        contact_share=t.contact,
        thin_film_share=t.thin,
        max_eccentricity=t.peak,
        peak_contact_force_n=force * t.force,
        **along,
    )
    title = f"Motion of a rotor on {bearings_words(point.design)}"
    return Dataset(title, about, metadata, table)


def netcdf_bytes(data: Dataset) -> bytes:
    """Return a dataset as a NetCDF file (classic format) with units; words are flags by the CF
    conventions, section 3.5.
    """
    buffer = io.BytesIO()
    file = netcdf_file(buffer, "w")
    file.title, file.Conventions = data.title, "CF-1.11"
    file.metadata = json.dumps(data.metadata)
    there: set[str] = set()
    for name, v in data.variables.items():
        if v.values.size == 0:
            continue  # a dimension of no length is one without an end
        for dimension, length in zip(v.dimensions, v.values.shape, strict=True):
            if dimension not in there:
                file.createDimension(dimension, length)
                there.add(dimension)
        values = v.values
        if v.meanings:
            values = np.argmax(values[..., None] == np.array(v.meanings), -1).astype(np.int8)
        if values.dtype.kind in "iu" and values.dtype.itemsize > 4:
            values = values.astype(np.int32)  # the longest of NetCDF 3
        variable = file.createVariable(name, values.dtype, v.dimensions)
        variable[...] = values
        variable.long_name, variable.units = v.text, v.unit
        if v.meanings:
            variable.flag_values = np.arange(len(v.meanings), dtype=np.int8)
            variable.flag_meanings = " ".join(word.replace(" ", "_") for word in v.meanings)
    file.flush()
    return buffer.getvalue()


def matlab_bytes(data: Dataset) -> bytes:
    """Return a dataset as a MATLAB file (version 5): its arrays, words as cells of text, ``units``
    and ``text`` of each, ``metadata`` as JSON; the same bytes for the same data.
    """
    arrays: dict[str, Any] = {
        name: v.values.astype(object) if v.meanings else v.values
        for name, v in data.variables.items()
    }
    buffer = io.BytesIO()
    savemat(
        buffer,
        arrays
        | {
            "units": {name: v.unit for name, v in data.variables.items()},
            "text": {name: v.text for name, v in data.variables.items()},
            "title": data.title,
            "metadata": json.dumps(data.metadata),
        },
        long_field_names=True,
        oned_as="column",
    )
    # not the time of writing
    return (
        f"MATLAB 5.0 MAT-file, {data.title}".ljust(116).encode("ascii")[:116]
        + (buffer.getvalue()[116:])
    )
