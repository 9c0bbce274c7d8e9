"""A stability map: a plane of operating points, saved as NPZ without pickles (computed by
:mod:`spab_core.maps.compute`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.maps.map_netcdf import as_npz, is_netcdf
from spab_core.solver.stepping import STATUS
from spab_core.trajectory.assessment import DEFAULT_LIMITS, Limits, Motion, grades
from spab_core.trajectory.periodic_orbit import MAX_PERIOD
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES, Regime

MAX_CELLS = 2_000_000
_CELL = ("bearing_number", "rotor_mass")
CELLS = {  # the arrays with one value a cell, in the file's order
    "mle": Array(np.float64, _CELL),
    "mle_standard_error": Array(np.float64, _CELL, low=0.0, high=1e6),
    "regime": Array("<U14", _CELL, texts=(*REGIMES, "")),
    "period": Array(np.int16, _CELL, low=0, high=MAX_PERIOD),
    "contact_share": Array(np.float64, _CELL, low=0.0, high=1.0 + 1e-9),
    "max_eccentricity": Array(np.float64, _CELL, low=0.0, high=1e6),
    "status": Array("<U16", _CELL, texts=STATUS),
    "revolutions": Array(np.int32, _CELL, low=0, high=1e6),
    # which maps of earlier versions lack: nan there
    "orbit_amplitude": Array(np.float64, _CELL, low=0.0, high=1e6, required=False),
    "thin_film_share": Array(np.float64, _CELL, low=0.0, high=1.0 + 1e-9, required=False),
    "peak_contact_force": Array(np.float64, _CELL, low=0.0, required=False),
}
OPTIONAL = tuple(name for name, array in CELLS.items() if not array.required)
FIELDS: dict[str, Any] = {name: array.dtype for name, array in CELLS.items()}
AXES = {
    "bearing_number": Array(np.float64, ("bearing_number",), rising=True),
    "rotor_mass": Array(np.float64, ("rotor_mass",), rising=True),
}


def unsolved(dtype: Any, shape: int | tuple[int, ...]) -> np.ndarray:
    """Return an array of a dtype filled with what stands for "not solved": nan, "" or 0."""
    kind = np.dtype(dtype).kind
    return np.full(shape, np.nan if kind == "f" else "" if kind == "U" else 0, dtype)


def with_unknown(found: dict[str, Any], shape: tuple[int, ...]) -> dict[str, Any]:
    """Return the arrays of a file with nan for those of :data:`CELLS` that it lacks."""
    lacking = (name for name in CELLS if name not in found)
    return found | {name: unsolved(CELLS[name].dtype, shape) for name in lacking}


class MapError(InputError):
    """A map file cannot be read, or a run cannot be resumed; the message says why."""


_SCHEMA = Schema(
    "map",
    AXES | CELLS,
    {"metadata": ("design", "mesh", "transient", "revolutions")},
    error=MapError,
)


def _unknown() -> np.ndarray:
    return np.array(np.nan)


@dataclass(frozen=True)
class StabilityMap:
    """A map over bearing number and rotor mass.

    Attributes
    ----------
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    mle, mle_standard_error : ndarray, (B, M)
        Per revolution; nan if the run failed.
    regime : ndarray of str, (B, M)
        One of ``regimes.REGIMES``, "" if the run failed.
    period : ndarray of int, (B, M)
        Revolutions; 0 unless periodic.
    contact_share, max_eccentricity : ndarray, (B, M)
        Share of the time in contact by force (:attr:`OperatingPoint.contact_share`), and over C.
    status : ndarray of str, (B, M)
        One of ``stepping.STATUS``.
    revolutions : ndarray of int, (B, M)
        Number integrated, less than requested if a run settled early or failed.
    metadata : dict
        Design, mesh, settings, versions, date, wall seconds.
    orbit_amplitude, thin_film_share, peak_contact_force : ndarray, (B, M)
        As the attributes of :class:`OperatingPoint` of these names, the force in N; nan where they
        are not known.
    limits : Limits
        By which cells are judged; of whoever reads the map, not kept with it.
    """

    bearing_number: np.ndarray
    rotor_mass: np.ndarray
    mle: np.ndarray
    mle_standard_error: np.ndarray
    regime: np.ndarray
    period: np.ndarray
    contact_share: np.ndarray
    max_eccentricity: np.ndarray
    status: np.ndarray
    revolutions: np.ndarray
    metadata: dict[str, Any] = field(default_factory=dict)
    orbit_amplitude: np.ndarray = field(default_factory=_unknown)
    thin_film_share: np.ndarray = field(default_factory=_unknown)
    peak_contact_force: np.ndarray = field(default_factory=_unknown)
    limits: Limits = DEFAULT_LIMITS

    def __post_init__(self) -> None:
        for name in OPTIONAL:
            if not getattr(self, name).ndim:
                object.__setattr__(self, name, np.full(self.shape, np.nan))

    @property
    def shape(self) -> tuple[int, int]:
        """(bearing numbers, rotor masses)."""
        return self.mle.shape

    @property
    def design(self) -> Design:
        """The design that the map was computed for."""
        return Design.from_dict(self.metadata["design"])

    @property
    def least_film(self) -> np.ndarray:
        """Least film thickness of each cell's motion, m, (B, M); nan where that is not known."""
        return np.asarray(self.design.bearing.clearance * (1.0 - self.max_eccentricity))

    def grades(self) -> np.ndarray:
        """Return the assessment of each cell by its motion alone, (B, M) of str
        (:func:`spab_core.trajectory.assessment.grades`).
        """
        motions = Motion(*(getattr(self, name) for name in Motion._fields))
        return grades(self.design, motions, self.limits)

    def motion(self, row: int, column: int) -> Motion:
        """Return what the rules look at in a cell, as single values."""
        return Motion(*(getattr(self, name)[row, column].item() for name in Motion._fields))

    def nearest(self, rotor_mass: float, bearing_number: float) -> tuple[int, int]:
        """Return the indices (bearing number, rotor mass) of the nearest cell."""
        return (
            int(np.abs(self.bearing_number - bearing_number).argmin()),
            int(np.abs(self.rotor_mass - rotor_mass).argmin()),
        )

    def cell_text(self, row: int, column: int) -> str:
        """Describe a cell: regime with period and exponent, or the status of a failed run."""
        if not self.regime[row, column]:
            return f"{NO_EXPONENT} ({self.status[row, column]})"
        name = Regime(str(self.regime[row, column]), int(self.period[row, column])).text
        return (
            f"{name}, MLE {self.mle[row, column]:+.3f} ± {self.mle_standard_error[row, column]:.3f}"
        )


def axis(text: str, name: str) -> np.ndarray:
    """Parse "start:stop:count", both ends included.

    Raises
    ------
    InputError
        The message names the axis and what is allowed.
    """
    parts = str(text).split(":")
    try:
        if len(parts) != 3:
            raise ValueError
        start, stop, count = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise InputError(
            f"{name} = {str(text)[:60]!r} is not start:stop:count, such as 0.25:8.5:34"
            f"{_range_hint(parts)}"
        ) from None
    if not 1 <= count <= 100_000:
        raise InputError(f"{name}: count = {count} is out of range: allowed is from 1 to 100000")
    if not (np.isfinite(start) and np.isfinite(stop)) or (count > 1 and not stop > start):
        raise InputError(
            f"{name} = {str(text)[:60]!r}: start and stop must be finite numbers, start before stop"
            f"{_range_hint(parts)}"
        )
    return np.linspace(start, stop, count)


def _range_hint(parts: list[str]) -> str:
    """Return what a range that is refused was meant as, where it is start:step:stop or has decimal
    commas.
    """
    if any("," in part for part in parts):
        return "; the decimal sign is a point"
    try:
        found = steps_as_count(*map(float, parts))
    except (TypeError, ValueError):
        return ""
    return f"; for steps of {float(parts[1]):g} write {found}" if found else ""


def steps_as_count(start: float, step: float, stop: float) -> str:
    """Return start:step:stop as start:stop:count; "" where it is no such range."""
    if not (np.isfinite([start, step, stop]).all() and step > 0.0 and stop > start + step):
        return ""
    count = int(min((stop - start) / step + 1e-9, 1e6)) + 1
    return f"{start:g}:{start + step * (count - 1):.6g}:{count}"


def check_axis(name: str, values: np.ndarray) -> None:
    """Raise :class:`InputError` unless values are numbers (n,) that rise."""
    a = np.asarray(values)
    if a.ndim != 1 or a.dtype.kind not in "fiu":
        raise InputError(f"{name} = {str(values)[:40]!r} must be an array (n,) of numbers")
    if not (np.diff(a) > 0).all():
        at = int((np.diff(a) <= 0).argmax())
        raise InputError(
            f"{name}: {a[at + 1]:g} follows {a[at]:g}; its values must be numbers that rise"
        )


def check_plane(bearing_number: np.ndarray, rotor_mass: np.ndarray) -> int:
    """Return the number of cells of a plane.

    Raises :class:`InputError` if there are too many, one is out of range, or values do not rise.
    """
    check_axis("bearing number", bearing_number)
    check_axis("rotor mass", rotor_mass)
    count = len(bearing_number) * len(rotor_mass)
    if not 1 <= count <= MAX_CELLS:
        raise InputError(
            f"a map of {count} cells is out of range: allowed is from 1 to {MAX_CELLS} cells"
        )
    for b in (bearing_number.min(), bearing_number.max()):
        for m in (rotor_mass.min(), rotor_mass.max()):
            check_point(float(m), float(b))
    return count


def map_bytes(result: StabilityMap) -> bytes:
    """Return a map as an NPZ file.

    Keys: those of :class:`StabilityMap`, ``metadata`` as JSON text.
    """
    arrays = {"bearing_number": result.bearing_number, "rotor_mass": result.rotor_mass}
    arrays |= {name: getattr(result, name) for name in FIELDS}
    return npz_bytes(arrays | {"metadata": np.array(json.dumps(result.metadata))})


def save_map(result: StabilityMap, path: str | Path) -> None:
    """Write a map as NPZ (:func:`map_bytes`), atomically."""
    write_atomically(path, map_bytes(result))


def load_map(path: str | Path) -> StabilityMap:
    """Read a map file and check it, NPZ or the NetCDF that was exported from it; nothing is
    unpickled.

    Raises
    ------
    MapError
        For a file that is no map.
    InputError
        For a plane or design out of range.
    """
    source: str | Path | bytes = path
    if is_netcdf(path):
        with _SCHEMA.reading(path):
            source = as_npz(path)
    found = load(source, _SCHEMA)
    check_plane(found["bearing_number"], found["rotor_mass"])
    if np.any(np.isfinite(found["mle"]) != (found["status"] == "ok")):
        raise _SCHEMA.refusal(path, 'mle must be finite where status is "ok", and nowhere else')
    Design.from_dict(found["metadata"]["design"])
    return StabilityMap(**with_unknown(found, found["mle"].shape))
