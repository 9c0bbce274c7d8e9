"""Bifurcation diagrams: Poincaré sections and exponents along a line of operating points.

Three sweeps: ``cold``, every point from its own cold start; ``up`` and ``down``, each point from
the state in which its neighbour ended, so that coexisting motions (hysteresis) show."""

from __future__ import annotations

import contextlib
import json
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from joblib.externals.loky import ProcessPoolExecutor

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.common.processes import end_with_parent
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.maps.checkpoints import locked, open_run, read_part
from spab_core.maps.compute import cell_values
from spab_core.maps.stability_map import CELLS, StabilityMap
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings

VARY = ("rotor-mass", "bearing-number")
SWEEPS = ("cold", "up", "down")
SECTION_POINTS = 60
MAX_POINTS = 20_000
_COLUMNS = ("mle", "mle_standard_error", "regime", "period", "status", "contact_share")
_ARRAYS = {  # of a Branch
    "section": Array(np.float32, ("point", SECTION_POINTS, 4)),
    **{name: CELLS[name].along("point") for name in _COLUMNS},
}
_PIECE = _ARRAYS | {"start": Array(np.float64, ("state",), finite=True)}  # in a checkpoint
_SCHEMA = Schema(
    "bifurcation diagram",
    {"values": Array(np.float64, ("point",), rising=True)}
    | {
        f"{sweep}.{name}": array.along(*array.shape, required=False)
        for sweep in SWEEPS
        for name, array in _ARRAYS.items()
    },
    {"metadata": ("vary", "at", "sweeps")},
)
PIECE = 5  # points solved between two checkpoints


@dataclass(frozen=True)
class Branch:
    """One sweep along the line, in the order of the line's values.

    Attributes
    ----------
    section : ndarray of float32, (n, SECTION_POINTS, 4)
        Journal X2, Y2 and disc X1, Y1 over C at tau = 2 pi k, the last revolutions; to 0.0001; nan
        where the run failed.
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
        raise InputError(
            f"--sweeps = {','.join(map(str, sweeps))[:60]!r} is not allowed: any of "
            f"{', '.join(SWEEPS)}"
        )
    if not 1 <= len(values) <= MAX_POINTS:
        raise InputError(
            f"--range: {len(values)} points are out of range: allowed is from 1 to {MAX_POINTS}"
        )
    for value in (values.min(), values.max()):
        check_point(*_point_at(vary, at, float(value)))


def _row(point: OperatingPoint) -> dict:
    section = point.trajectory.section[-SECTION_POINTS:, :4]
    kept = np.full((SECTION_POINTS, 4), np.nan, np.float32)
    if point.regime and len(section):
        # a run that settled kept whole periods: they repeat
        kept[:] = np.round(section[np.arange(-SECTION_POINTS, 0) % len(section)], 4)
    return cell_values(point) | {"section": kept}


def _solve_piece(
    design: Design,
    points: Sequence[tuple[float, float]],
    settings: Settings,
    carry: bool,
    start: np.ndarray | None,
) -> dict[str, np.ndarray]:
    """Arrays of operating points solved one after the other; with ``carry`` each from where the one
    before ended.

    ``start`` is the state to begin from; the one to go on from is returned under that name, empty
    where there is none."""
    rows = []
    for mass, number in points:
        point = solve_point(design, mass, number, settings, start=start)
        if point.trajectory.status != "ok" and start is not None:
            point = solve_point(design, mass, number, settings)
        start = point.trajectory.final if carry and point.trajectory.status == "ok" else None
        rows.append(_row(point))
    return {
        name: np.array([row[name] for row in rows], array.dtype) for name, array in _ARRAYS.items()
    } | {"start": np.empty(0) if start is None else start}


class _Here(futures.Executor):
    """Runs what is submitted at once, in this process."""

    def submit(self, fn, /, *args, **kwargs):
        future: futures.Future = futures.Future()
        future.set_result(fn(*args, **kwargs))
        return future


@contextlib.contextmanager
def _executor(workers: int) -> Iterator[futures.Executor]:
    if workers == 1:
        yield _Here()
        return
    compile_once()
    processes = ProcessPoolExecutor(
        max_workers=workers, initializer=end_with_parent, initargs=(os.getpid(),)
    )
    done = False
    try:
        yield processes
        done = True
    finally:
        processes.shutdown(wait=done, kill_workers=not done)


def compute_bifurcation(
    design: Design,
    vary: str,
    at: float,
    values: np.ndarray,
    settings: Settings | None = None,
    *,
    sweeps: Sequence[str] = SWEEPS,
    workers: int = 1,
    parts: Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> Bifurcation:
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
        Processes. Sweeps up and down use one each at a time.
    parts : Path, optional
        Folder for finished pieces. A run that finds its own pieces there goes on from them, to the
        same bits.
    progress : callable
        Called with the number of points done since the last call; first with those found in
        ``parts``, 0 too.

    Returns
    -------
    Bifurcation

    Raises
    ------
    InputError
        For a line out of range, an unknown parameter or sweep, or parts of another run or in use.
    """
    settings = settings or Settings(revolutions=300)
    values = np.asarray(values, float)
    check_line(vary, at, values, sweeps)
    points = [_point_at(vary, at, float(v)) for v in values]
    orders, run_hash = {}, ""
    for sweep in sorted(
        set(sweeps), key=("up", "down", "cold").index
    ):  # the two that cannot be shared out first
        indices = np.arange(len(points))[:: -1 if sweep == "down" else 1]
        orders[sweep] = [indices[k : k + PIECE] for k in range(0, len(points), PIECE)]
    if parts:
        other = np.array([at], float)
        number, mass = (other, values) if vary == "rotor-mass" else (values, other)
        run_hash = open_run(
            parts, design, number, mass, settings, line=[vary, *orders], piece_points=PIECE
        )
    with locked(parts), _executor(workers) as executor:
        found = {sweep: _kept_pieces(parts, sweep, orders[sweep], run_hash) for sweep in orders}
        if progress:
            progress(sum(len(orders[sweep][k]) for sweep in found for k in found[sweep]))
        ready: deque[tuple[str, int]] = deque()  # pieces that can be solved now
        for sweep, order in orders.items():
            missing = [k for k in range(len(order)) if k not in found[sweep]]
            ready += [(sweep, k) for k in (missing if sweep == "cold" else missing[:1])]
        waiting: dict[futures.Future, tuple[str, int]] = {}
        while ready or waiting:
            while ready and len(waiting) < workers:
                sweep, k = ready.popleft()
                start = found[sweep][k - 1]["start"] if sweep != "cold" and k else np.empty(0)
                waiting[
                    executor.submit(
                        _solve_piece,
                        design,
                        [points[i] for i in orders[sweep][k]],
                        settings,
                        sweep != "cold",
                        start if start.size else None,
                    )
                ] = sweep, k
            for future in futures.wait(waiting, return_when=futures.FIRST_COMPLETED).done:
                sweep, k = waiting.pop(future)
                piece = found[sweep][k] = future.result()
                if parts:
                    write_atomically(
                        _part(parts, sweep, k), npz_bytes(piece | {"run": np.array(run_hash)})
                    )
                if sweep != "cold" and k + 1 < len(orders[sweep]):
                    ready.appendleft((sweep, k + 1))
                if progress:
                    progress(len(orders[sweep][k]))
    branches = {}
    for sweep in SWEEPS:
        if sweep in found:
            back = np.argsort(np.concatenate(orders[sweep]))
            branches[sweep] = Branch(
                **{
                    name: np.concatenate([found[sweep][k][name] for k in sorted(found[sweep])])[
                        back
                    ]
                    for name in _ARRAYS
                }
            )
    return Bifurcation(
        vary, float(at), values, branches, map_metadata(design, settings, (len(values),))
    )


def _part(parts: Path, sweep: str, k: int) -> Path:
    return parts / f"chunk-{sweep}-{k:06d}.npz"


def _kept_pieces(
    parts: Path | None, sweep: str, order: Sequence[np.ndarray], run_hash: str
) -> dict[int, dict]:
    """The pieces of an earlier run, by number; of a sweep that carries its state those before the
    first that is missing.
    """
    found = {}
    for k, indices in enumerate(order):
        path = _part(parts, sweep, k) if parts else None
        if path and path.exists():
            found[k] = read_part(path, _PIECE, run_hash, len(indices))
        elif sweep != "cold":
            break
    return found


def chaotic_intervals(values: np.ndarray, regime: np.ndarray) -> list[tuple[float, float]]:
    """Intervals of a line whose points are chaotic, first and last chaotic value of each.

    Parameters
    ----------
    values : ndarray, (n,)
    regime : ndarray of str, (n,)
    """
    chaotic = np.concatenate([[False], regime == "chaotic", [False]])
    first, behind = (
        np.flatnonzero(np.diff(chaotic.astype(int)) == 1),
        np.flatnonzero(np.diff(chaotic.astype(int)) == -1),
    )
    return [(float(values[a]), float(values[b - 1])) for a, b in zip(first, behind, strict=True)]


def interval_table(line: Bifurcation, sweeps: Sequence[str]) -> pd.DataFrame:
    """Chaotic intervals of a line: ``sweep``, ``first`` and ``last`` chaotic value, over bearing
    numbers both in rpm too.
    """
    rows = [
        (name, *ends)
        for name, branch in line.branches.items()
        if name in sweeps
        for ends in chaotic_intervals(line.values, branch.regime)
    ]
    table = pd.DataFrame(rows, columns=["sweep", "first", "last"])
    if line.vary == "bearing-number":
        speed = Design.from_dict(line.metadata["design"]).speed_rpm(1.0)
        table = table.assign(
            first_rpm=table["first"].astype(float) * speed,
            last_rpm=table["last"].astype(float) * speed,
        )
    return table


def line_table(line: Bifurcation) -> pd.DataFrame:
    """A line as one row a sweep and point: where it is, exponent, regime and so on."""
    speed = Design.from_dict(line.metadata["design"]).speed_rpm(1.0)
    mass, number = (line.values, line.at) if line.vary == "rotor-mass" else (line.at, line.values)
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "sweep": name,
                    "rotor_mass_kg": mass,
                    "bearing_number": number,
                    "speed_rpm": speed * number,
                }
                | {column: getattr(branch, column) for column in _COLUMNS},
                index=range(len(line.values)),
            )
            for name, branch in line.branches.items()
        ],
        ignore_index=True,
    )


def line_of_map(m: StabilityMap, vary: str, at: float) -> Bifurcation:
    """The row or column of a map nearest to a line, as a cold sweep whose section is not known
    (nan).
    """
    row, column = m.nearest(at, at)
    cells, at, values = (
        ((row, slice(None)), m.bearing_number[row], m.rotor_mass)
        if vary == "rotor-mass"
        else ((slice(None), column), m.rotor_mass[column], m.bearing_number)
    )
    branch = Branch(
        np.full((len(values), SECTION_POINTS, 4), np.nan, np.float32),
        **{name: getattr(m, name)[cells] for name in _COLUMNS},
    )
    return Bifurcation(vary, float(at), values, {"cold": branch}, m.metadata)


def save_bifurcation(result: Bifurcation, path: str | Path) -> None:
    """Write a line as NPZ, atomically: ``values``, ``SWEEP.section``, ``SWEEP.mle`` and so on,
    ``metadata`` as JSON text.
    """
    arrays = {"values": result.values}
    for sweep, branch in result.branches.items():
        arrays |= {f"{sweep}.section": branch.section} | {
            f"{sweep}.{name}": getattr(branch, name) for name in _COLUMNS
        }
    about = result.metadata | {
        "vary": result.vary,
        "at": result.at,
        "sweeps": list(result.branches),
    }
    write_atomically(path, npz_bytes(arrays | {"metadata": np.array(json.dumps(about))}))


def load_bifurcation(path: str | Path) -> Bifurcation:
    """Read what :func:`save_bifurcation` wrote; nothing in it is ever unpickled.

    Raises
    ------
    InputError
        For a file that is none.
    """
    found = load(path, _SCHEMA)
    about = found["metadata"]
    with _SCHEMA.reading(path):
        if about["vary"] not in VARY or not set(about["sweeps"]) <= set(SWEEPS):
            raise ValueError(
                f"its metadata must name one of {', '.join(VARY)} to vary, and as sweeps "
                f"{', '.join(SWEEPS)}"
            )
        branches = {
            sweep: Branch(**{name: found[f"{sweep}.{name}"] for name in _ARRAYS})
            for sweep in about["sweeps"]
        }
        return Bifurcation(about["vary"], float(about["at"]), found["values"], branches, about)
