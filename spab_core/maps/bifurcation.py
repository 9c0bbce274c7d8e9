"""Bifurcation diagrams: Poincaré sections and exponents along a line of operating points.

Three sweeps: ``cold`` starts every point at rest; ``up`` and ``down`` start each point from the
final state of its neighbour, which shows coexisting motions (hysteresis).
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.common.validation import check_choice
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.maps.checkpoints import Checkpoint, Chunk, run_plan
from spab_core.maps.compute import cell_values
from spab_core.maps.parallel import executor
from spab_core.maps.stability_map import CELLS, FIELDS, StabilityMap, check_axis, unsolved
from spab_core.trajectory.assessment import (
    CHAOTIC,
    DEFAULT_LIMITS,
    GRADE_WORDS,
    GRADES,
    KINDS,
    Limits,
    Motion,
    gravest,
)
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

VARY = ("rotor-mass", "bearing-number")
SWEEPS = ("cold", "up", "down")
SECTION_POINTS = 60
MAX_POINTS = 20_000
_LATER = (  # which lines of earlier versions lack: nan there
    "max_eccentricity",
    "orbit_amplitude",
    "thin_film_share",
    "peak_contact_force",
)
_FIRST = ("mle", "mle_standard_error", "regime", "period", "status", "contact_share")
_COLUMNS = _FIRST + _LATER
_ARRAYS = {  # of a Branch
    "section": Array(np.float32, ("point", SECTION_POINTS, 4)),
    **{name: CELLS[name].along("point") for name in _COLUMNS},
}
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
CHUNK_POINTS = 5  # points solved between two checkpoints


def _unknown() -> np.ndarray:
    return np.array(np.nan)


@dataclass(frozen=True)
class Branch:
    """One sweep along the line, in the order of the line's values.

    Attributes
    ----------
    section : ndarray of float32, (n, SECTION_POINTS, 4)
        Journal X2, Y2 and disc X1, Y1 over C at tau = 2 pi k of the last revolutions, rounded to
        0.0001; nan if the run failed.
    mle, mle_standard_error : ndarray, (n,)
        Per revolution; nan if the run failed.
    regime, period, status, contact_share : ndarray, (n,)
        As in a map.
    max_eccentricity, orbit_amplitude, thin_film_share, peak_contact_force : ndarray, (n,)
        As in a map; nan where they are not known.
    """

    section: np.ndarray
    mle: np.ndarray
    mle_standard_error: np.ndarray
    regime: np.ndarray
    period: np.ndarray
    status: np.ndarray
    contact_share: np.ndarray
    max_eccentricity: np.ndarray = field(default_factory=_unknown)
    orbit_amplitude: np.ndarray = field(default_factory=_unknown)
    thin_film_share: np.ndarray = field(default_factory=_unknown)
    peak_contact_force: np.ndarray = field(default_factory=_unknown)

    def __post_init__(self) -> None:
        for name in _LATER:
            if not getattr(self, name).ndim:
                object.__setattr__(self, name, np.full(self.mle.shape, np.nan))


@dataclass(frozen=True)
class Bifurcation:
    """A line of operating points.

    Attributes
    ----------
    vary : str
        One of :data:`VARY`.
    at : float
        Value of the parameter that is held: bearing number, or rotor mass in kg.
    values : ndarray, (n,)
    branches : dict
        :class:`Branch` by sweep.
    metadata : dict
        As in a map.
    limits : Limits
        By which points are judged; of whoever reads the line, not kept with it.
    """

    vary: str
    at: float
    values: np.ndarray
    branches: dict[str, Branch]
    metadata: dict[str, Any]
    limits: Limits = DEFAULT_LIMITS

    @property
    def design(self) -> Design:
        """The design that the line was computed for."""
        return Design.from_dict(self.metadata["design"])

    def least_film(self, sweep: str) -> np.ndarray:
        """Return the least film thickness of each point of a sweep, m, (n,); nan where the largest
        eccentricity is not known.
        """
        largest = self.branches[sweep].max_eccentricity
        return np.asarray(self.design.bearing.clearance * (1.0 - largest))

    def judged(self, sweep: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the assessment of each point of a sweep by its motion alone, and the kind of its
        gravest trouble; (n,) of str each
        (:func:`spab_core.trajectory.assessment.gravest`).
        """
        branch = self.branches[sweep]
        motions = Motion(*(getattr(branch, name) for name in Motion._fields))
        return gravest(self.design, motions, self.limits)


def _point_at(vary: str, at: float, value: float) -> tuple[float, float]:
    """Return (rotor mass, bearing number) of a value of the line."""
    return (value, at) if vary == "rotor-mass" else (at, value)


def check_line(vary: str, at: float, values: np.ndarray, sweeps: Sequence[str]) -> None:
    """Raise :class:`InputError` for a line out of range, an unknown parameter or sweep."""
    check_choice("--vary", vary, VARY)
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
    check_axis("--range", values)
    for value in (values.min(), values.max()):
        check_point(*_point_at(vary, at, float(value)))


def _row(point: OperatingPoint) -> dict[str, Any]:
    section = point.trajectory.section[-SECTION_POINTS:, :4]
    kept = np.full((SECTION_POINTS, 4), np.nan, np.float32)
    if point.regime and len(section):
        # a run that settled kept whole periods: they repeat
        kept[:] = np.round(section[np.arange(-SECTION_POINTS, 0) % len(section)], 4)
    return cell_values(point) | {"section": kept}


class _Chunk(NamedTuple):
    """Neighbouring points of a sweep, solved one after the other.

    Attributes
    ----------
    cells : ndarray of int, (k,)
        Their indices in the checkpoint's arrays, which hold one sweep after the other.
    points : list of tuple
        (rotor mass, bearing number) of each.
    carry : bool
        Whether each point starts from the final state of the one before.
    after : str, optional
        Name of the chunk whose final state is the start of the first point.
    """

    cells: np.ndarray
    points: list[tuple[float, float]]
    carry: bool
    after: str | None


def _chunks(sweeps: Sequence[str], points: Sequence[tuple[float, float]]) -> dict[str, _Chunk]:
    """Return the chunks of all sweeps by name, in the order to solve them."""
    found = {}
    for place, sweep in enumerate(sweeps):
        order = np.arange(len(points))[:: -1 if sweep == "down" else 1]
        after = None
        for k in range(0, len(points), CHUNK_POINTS):
            indices = order[k : k + CHUNK_POINTS]
            name, carry = f"{sweep}-{k // CHUNK_POINTS:06d}", sweep != "cold"
            found[name] = _Chunk(
                place * len(points) + indices, [points[i] for i in indices], carry, after
            )
            after = name if carry else None
    return found


def _solve_chunk(
    design: Design,
    points: Sequence[tuple[float, float]],
    settings: Settings,
    carry: bool,
    start: np.ndarray,
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Solve operating points one after the other; runs in a worker.

    ``start`` is the state of the first one, empty for a cold start. Returns the points' values by
    the names of a :class:`Branch`, and the final state, empty without ``carry`` or if the last run
    failed.
    """
    rows, state = [], start if start.size else None
    for mass, number in points:
        point = solve_point(design, mass, number, settings, start=state)
        if point.trajectory.status != "ok" and state is not None:
            point = solve_point(design, mass, number, settings)
        state = point.trajectory.final if carry and point.trajectory.status == "ok" else None
        rows.append(_row(point))
    values = {
        name: np.array([row[name] for row in rows], array.dtype) for name, array in _ARRAYS.items()
    }
    return values, np.empty(0) if state is None else state


def compute_bifurcation(
    design: Design,
    vary: str,
    at: float,
    values: np.ndarray,
    settings: Settings | None = None,
    *,
    sweeps: Sequence[str] = SWEEPS,
    workers: int = 1,
    checkpoint: Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> Bifurcation:
    """Solve a line of operating points.

    Parameters
    ----------
    design : Design
    vary : str
        ``rotor-mass`` (kg) or ``bearing-number``.
    at : float
        Value of the parameter that is held.
    values : ndarray, (n,)
        Increasing.
    settings : Settings
        For every point of every sweep.
    sweeps : sequence of str
        Of :data:`SWEEPS`.
    workers : int
        Processes. Sweeps up and down use one each at a time.
    checkpoint : Path, optional
        Folder of the checkpoint, from which a run with the same plan resumes, to the same bits.
    progress : callable
        Called with the number of points done since the last call; first with those found in
        ``checkpoint``, 0 too.

    Returns
    -------
    Bifurcation

    Raises
    ------
    InputError
        For a line out of range, an unknown parameter or sweep, or a checkpoint that is in use or of
        another run.
    """
    settings = settings or Settings(revolutions=300)
    values = np.asarray(values, float)
    check_line(vary, at, values, sweeps)
    settings.check_cold_start()  # sweeps begin cold too
    # the two that cannot be shared out among processes first
    ordered = [sweep for sweep in ("up", "down", "cold") if sweep in sweeps]
    chunks = _chunks(ordered, [_point_at(vary, at, float(v)) for v in values])
    other = np.array([at], float)
    number, mass = (other, values) if vary == "rotor-mass" else (values, other)
    plan = run_plan(
        design, number, mass, settings, line=[vary, *ordered], chunk_points=CHUNK_POINTS
    )
    arrays = {name: unsolved(FIELDS[name], len(ordered) * len(values)) for name in _COLUMNS}
    arrays["section"] = np.full((len(ordered) * len(values), SECTION_POINTS, 4), np.nan, np.float32)
    with Checkpoint(checkpoint, plan, arrays).resume() as run:
        if progress:
            progress(int(run.solved.sum()))
        for cells in _solve(design, settings, chunks, run, workers):
            if progress:
                progress(len(cells))
    branches = {}
    for sweep in SWEEPS:
        if sweep in ordered:
            first = ordered.index(sweep) * len(values)
            branches[sweep] = Branch(
                **{name: array[first : first + len(values)] for name, array in arrays.items()}
            )
    return Bifurcation(
        vary, float(at), values, branches, map_metadata(design, settings, (len(values),))
    )


def _solve(
    design: Design,
    settings: Settings,
    chunks: dict[str, _Chunk],
    checkpoint: Checkpoint,
    workers: int,
) -> Iterator[np.ndarray]:
    """Solve and save the missing chunks, each as soon as its start is known; yield the cells of
    each.
    """
    waiting = [name for name, c in chunks.items() if checkpoint.missing(c.cells).size]
    running: dict[futures.Future[tuple[Chunk, np.ndarray]], str] = {}
    with executor(workers, settings, design) as processes:
        while waiting or running:
            ready = (
                n
                for n in waiting
                if chunks[n].after is None or chunks[n].after in checkpoint.states
            )
            for name in list(itertools.islice(ready, workers - len(running))):
                waiting.remove(name)
                chunk = chunks[name]
                start = checkpoint.states[chunk.after] if chunk.after else np.empty(0)
                future = processes.submit(
                    _solve_chunk, design, chunk.points, settings, chunk.carry, start
                )
                running[future] = name
            for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                name = running.pop(future)
                checkpoint.save(name, chunks[name].cells, *future.result())
                yield chunks[name].cells


def chaotic_intervals(values: np.ndarray, regime: np.ndarray) -> list[tuple[float, float]]:
    """Return the intervals of a line whose points are chaotic: first and last chaotic value of
    each.

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


class Band(NamedTuple):
    """Neighbouring points of a line with one grade, all chaotic or none.

    Attributes
    ----------
    grade : str
        Of :data:`~spab_core.trajectory.assessment.GRADES`.
    kinds : tuple of str
        Of the gravest trouble of each point, in the order of the line, each once.
    first, last : int
        Indices of its ends.
    """

    grade: str
    kinds: tuple[str, ...]
    first: int
    last: int

    @property
    def why(self) -> str:
        """What is wrong, in words; nothing where all is good."""
        return "; ".join(KINDS[kind] for kind in self.kinds)


def bands(grades: np.ndarray, kinds: np.ndarray) -> list[Band]:
    """Return the runs of equal grades along a line, chaos apart.

    Parameters
    ----------
    grades, kinds : ndarray of str, (n,)
        Those of :meth:`Bifurcation.judged`.
    """
    if not len(grades):
        return []
    chaos = kinds == CHAOTIC
    changes = (grades[1:] != grades[:-1]) | (chaos[1:] != chaos[:-1])
    first = np.flatnonzero(np.concatenate([[True], changes]))
    found = []
    for a, b in zip(first, [*first[1:], len(grades)], strict=True):
        named = dict.fromkeys(str(kind) for kind in kinds[a:b] if kind)
        found.append(Band(str(grades[a]), tuple(named), int(a), int(b) - 1))
    return found


def line_verdict(line: Bifurcation, sweep: str) -> tuple[str, str]:
    """Return the worst grade of a sweep, and the verdict on it in a sentence."""
    grades, kinds = line.judged(sweep)
    shares = {grade: float((grades == grade).mean()) for grade in GRADES[::-1]}
    worst = next(grade for grade, share in shares.items() if share)
    told = []
    for grade, share in shares.items():
        named = list(dict.fromkeys(str(kind) for kind in kinds[(grades == grade) & (kinds != "")]))
        why = f" ({', '.join(KINDS[kind] for kind in named)})" if named else ""
        if share:
            told.append(f"{GRADE_WORDS[grade]} {100.0 * share:.3g} % of the points{why}")
    words = "; ".join(told)
    return worst, f"By the motion alone: {words}."


def interval_table(line: Bifurcation, sweeps: Sequence[str]) -> pd.DataFrame:
    """Return the bands of a line by what the motion is worth.

    Parameters
    ----------
    line : Bifurcation
    sweeps : sequence of str
        Of those of the line.

    Returns
    -------
    DataFrame
        A row a band: ``sweep``, ``assessment``, ``why``, ``first`` and ``last`` value; over bearing
        numbers in rpm too.
    """
    import pandas as pd  # a third of a second to load

    rows = [
        (name, band.grade, band.why, line.values[band.first], line.values[band.last])
        for name in line.branches
        if name in sweeps
        for band in bands(*line.judged(name))
    ]
    table = pd.DataFrame(rows, columns=["sweep", "assessment", "why", "first", "last"])
    if line.vary == "bearing-number":
        speed = line.design.speed_rpm(1.0)
        table = table.assign(
            first_rpm=table["first"].astype(float) * speed,
            last_rpm=table["last"].astype(float) * speed,
        )
    return table


def line_table(line: Bifurcation) -> pd.DataFrame:
    """Return a line as a table: for each sweep and point its place, exponent, regime and so on."""
    import pandas as pd

    speed = line.design.speed_rpm(1.0)
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
                | {column: getattr(branch, column) for column in _COLUMNS}
                | {"least_film_m": line.least_film(name)}
                | dict(zip(("assessment", "why"), line.judged(name), strict=True)),
                index=range(len(line.values)),
            )
            for name, branch in line.branches.items()
        ],
        ignore_index=True,
    )


def line_of_map(m: StabilityMap, vary: str, at: float) -> Bifurcation:
    """Return the row or column of a map nearest to a line, as a cold sweep.

    Parameters
    ----------
    m : StabilityMap
    vary, at
        As those of :class:`Bifurcation`.

    Returns
    -------
    Bifurcation
        Its section is nan: a map keeps none.
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
    """Read a file of :func:`save_bifurcation`; nothing is unpickled.

    Raises
    ------
    InputError
        For any other file.
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
            sweep: Branch(**{k: found[f"{sweep}.{k}"] for k in _ARRAYS if f"{sweep}.{k}" in found})
            for sweep in about["sweeps"]
        }
        return Bifurcation(about["vary"], float(about["at"]), found["values"], branches, about)
