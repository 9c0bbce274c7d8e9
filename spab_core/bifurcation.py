"""Bifurcation diagrams: Poincaré sections and exponents along a line of operating points.

Three sweeps: ``cold``, every point from its own cold start; ``up`` and ``down``, each point from the state in which its
neighbour ended, so that coexisting motions (hysteresis) show.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import joblib
import numpy as np

from spab_core.design import Design, InputError, write_atomically
from spab_core.map_engine import cell_values, cluster_or_processes
from spab_core.point import OperatingPoint, solve_point
from spab_core.simulate import Settings, check_point
from spab_core.stability_map import FIELDS, UNREADABLE, map_metadata, npz_bytes

VARY = ("rotor-mass", "bearing-number")
SWEEPS = ("cold", "up", "down")
SECTION_POINTS = 60
MAX_POINTS = 20_000
_COLUMNS: dict[str, type | str] = {name: FIELDS[name] for name in (
    "mle", "mle_standard_error", "regime", "period", "status", "contact_share")}
_COLD_CHUNK = 10


@dataclass(frozen=True)
class Branch:
    """One sweep along the line, in the order of the line's values.

    Attributes
    ----------
    section : ndarray of float32, (n, SECTION_POINTS, 4)
        Journal X2, Y2 and disc X1, Y1 over C at tau = 2 pi k, the last revolutions; to 0.0001; nan where the run failed.
    mle, mle_standard_error : ndarray, (n,)
        Per revolution; nan where the run failed.
    regime, period, status, contact_share : ndarray, (n,)
        As in a map.
    """

    section: np.ndarray
    mle: np.ndarray
    mle_standard_error: np.ndarray
    regime: np.ndarray
    period: np.ndarray
    status: np.ndarray
    contact_share: np.ndarray


@dataclass(frozen=True)
class Bifurcation:
    """A line of operating points.

    Attributes
    ----------
    vary : str
        One of :data:`VARY`.
    at : float
        The other one's value: bearing number, or rotor mass in kg.
    values : ndarray, (n,)
    branches : dict
        :class:`Branch` by sweep.
    metadata : dict
        As in a map.
    """

    vary: str
    at: float
    values: np.ndarray
    branches: dict[str, Branch]
    metadata: dict


def _point_at(vary: str, at: float, value: float) -> tuple[float, float]:
    """(rotor mass, bearing number)."""
    return (value, at) if vary == "rotor-mass" else (at, value)


def check_line(vary: str, at: float, values: np.ndarray, sweeps: Sequence[str]) -> None:
    """Raise :class:`InputError` for a line out of range, an unknown parameter or sweep."""
    if vary not in VARY:
        raise InputError(f"--vary = {str(vary)[:40]!r} is not allowed: choose {' or '.join(VARY)}")
    unknown = [s for s in sweeps if s not in SWEEPS]
    if unknown or not sweeps:
        raise InputError(f"--sweeps = {','.join(map(str, sweeps))[:60]!r} is not allowed: any of {', '.join(SWEEPS)}")
    if not 1 <= len(values) <= MAX_POINTS:
        raise InputError(f"--range: {len(values)} points are out of range: allowed is from 1 to {MAX_POINTS}")
    for value in (values.min(), values.max()):
        check_point(*_point_at(vary, at, float(value)))


def _row(point: OperatingPoint) -> dict:
    section = point.trajectory.section[-SECTION_POINTS:, :4]
    kept = np.full((SECTION_POINTS, 4), np.nan, np.float32)
    if point.regime and len(section):
        # a run that settled kept whole periods: they repeat
        kept[:] = np.round(section[np.arange(-SECTION_POINTS, 0) % len(section)], 4)
    return cell_values(point) | {"section": kept}


def _sweep(design: Design, points: Sequence[tuple[float, float]], settings: Settings, carry: bool) -> list[dict]:
    """Rows of operating points, one after the other; with ``carry`` each from where the one before ended."""
    rows = []
    start = None
    for mass, number in points:
        point = solve_point(design, mass, number, settings, start=start if carry else None)
        if carry and point.trajectory.status != "ok" and start is not None:
            point = solve_point(design, mass, number, settings)
        start = point.trajectory.final if point.trajectory.status == "ok" else None
        rows.append(_row(point))
    return rows


def compute_bifurcation(design: Design, vary: str, at: float, values: np.ndarray, settings: Settings | None = None, *,
                        sweeps: Sequence[str] = SWEEPS, workers: int = 1,
                        progress: Callable[[int], None] | None = None) -> Bifurcation:
    """Solve a line of operating points.

    Parameters
    ----------
    design : Design
    vary : str
        ``rotor-mass`` (kg) or ``bearing-number``.
    at : float
        Value of the other one.
    values : ndarray, (n,)
        Increasing.
    settings : Settings
        For every point of every sweep.
    sweeps : sequence of str
        Of :data:`SWEEPS`.
    workers : int
        Processes. Sweeps up and down are one task each.
    progress : callable
        Called with the number of points done since the last call.

    Returns
    -------
    Bifurcation

    Raises
    ------
    InputError
        For a line out of range, an unknown parameter or sweep.
    """
    settings = settings or Settings(revolutions=300)
    values = np.asarray(values, float)
    check_line(vary, at, values, sweeps)
    points = [_point_at(vary, at, float(v)) for v in values]
    tasks = []
    for sweep in sorted(set(sweeps), key=("up", "down", "cold").index):  # the two long ones first
        size = _COLD_CHUNK if sweep == "cold" else len(points)
        order = np.arange(len(points))[::-1 if sweep == "down" else 1]
        tasks += [(sweep, order[k:k + size]) for k in range(0, len(points), size)]
    found: dict[str, dict[int, dict]] = {sweep: {} for sweep in sweeps}
    with cluster_or_processes(workers) as run:
        jobs = (joblib.delayed(_numbered)(k, design, [points[i] for i in order], settings, sweep != "cold")
                for k, (sweep, order) in enumerate(tasks))
        for k, rows in run(jobs):
            sweep, order = tasks[k]
            found[sweep].update(zip(order.tolist(), rows, strict=True))
            if progress:
                progress(len(rows))
    branches = {}
    for sweep in SWEEPS:
        if sweep in found:
            rows = [found[sweep][i] for i in range(len(points))]
            columns = {name: np.array([row[name] for row in rows], dtype) for name, dtype in _COLUMNS.items()}
            branches[sweep] = Branch(np.stack([row["section"] for row in rows]), **columns)
    return Bifurcation(vary, float(at), values, branches, map_metadata(design, settings, (len(values),)))


def _numbered(number, *arguments):
    return number, _sweep(*arguments)


def chaotic_intervals(values: np.ndarray, regime: np.ndarray) -> list[tuple[float, float]]:
    """Intervals of a line whose points are chaotic, first and last chaotic value of each.

    Parameters
    ----------
    values : ndarray, (n,)
    regime : ndarray of str, (n,)
    """
    chaotic = np.concatenate([[False], regime == "chaotic", [False]])
    first, behind = np.flatnonzero(np.diff(chaotic.astype(int)) == 1), np.flatnonzero(np.diff(chaotic.astype(int)) == -1)
    return [(float(values[a]), float(values[b - 1])) for a, b in zip(first, behind, strict=True)]


def save_bifurcation(result: Bifurcation, path: str | Path) -> None:
    """Write a line as NPZ, atomically: ``values``, ``SWEEP.section``, ``SWEEP.mle`` and so on, ``metadata`` as JSON text."""
    arrays = {"values": result.values}
    for sweep, branch in result.branches.items():
        arrays |= {f"{sweep}.section": branch.section} | {f"{sweep}.{name}": getattr(branch, name) for name in _COLUMNS}
    about = result.metadata | {"vary": result.vary, "at": result.at, "sweeps": list(result.branches)}
    write_atomically(path, npz_bytes(arrays | {"metadata": np.array(json.dumps(about))}))


def load_bifurcation(path: str | Path) -> Bifurcation:
    """Read what :func:`save_bifurcation` wrote; nothing in it is ever unpickled.

    Raises
    ------
    InputError
        For a file that is none.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
            about = json.loads(str(data["metadata"]))
            values = np.asarray(data["values"], float)
            n = len(values)
            branches = {}
            for sweep in about["sweeps"]:
                columns = {name: data[f"{sweep}.{name}"].astype(dtype) for name, dtype in _COLUMNS.items()}
                section = data[f"{sweep}.section"].astype(np.float32)
                if section.shape != (n, SECTION_POINTS, 4) or any(c.shape != (n,) for c in columns.values()):
                    raise InputError(f"{path} is no bifurcation diagram: its arrays do not fit together")
                branches[str(sweep)] = Branch(section, **columns)
            if values.ndim != 1 or about["vary"] not in VARY or not set(branches) <= set(SWEEPS):
                raise InputError(f"{path} is no bifurcation diagram: its metadata are not those of one")
            return Bifurcation(str(about["vary"]), float(about["at"]), values, branches, about)
    except InputError:
        raise
    except (*UNREADABLE, TypeError, AttributeError) as error:
        raise InputError(f"cannot read the bifurcation diagram {str(path)!r}: {error}") from None
