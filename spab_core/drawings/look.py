"""One machine as a row of numbers: its grade, and how far its speed or mass can rise before
trouble to be avoided begins. Many machines in parallel, kept chunk by chunk.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from spab_core.common.validation import check_choice, check_number
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.design.tolerances import Machine
from spab_core.linear_theory.equilibrium import static_equilibrium
from spab_core.maps.checkpoints import Checkpoint
from spab_core.maps.compute import chunk_solver
from spab_core.maps.solved_margin import troubles_at_rest, troubles_of_motion
from spab_core.solver.cache import solver_hash
from spab_core.trajectory.assessment import AVOID, DEFAULT_LIMITS, GRADES, Limits
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.settings import Settings

AXES = ("speed", "mass")  # of a margin
REACH, REACHES = 1.5, (1.01, 10.0)  # of the short line, over the machine's own value
SPACING, SPACINGS = 1.08, (1.001, 2.0)  # of its points
PRECISION = 0.01  # width of the bracket, over the value there
OVERLOADED = "load not carried"  # a kind of trouble besides those of the assessment
CHUNK = 8  # machines solved between two checkpoints
ROW: dict[str, Any] = {  # of a machine
    "grade": np.int8,  # 0 good, 1 to be watched, 2 to be avoided; -1: not solved
    "trouble": "<U24",  # the gravest kind at the machine itself; "": none
    "least_film": np.float64,  # m
    "eccentricity": np.float64,
    "orbit": np.float64,
    "peak_contact_force": np.float64,  # largest normal force of the asperities, N
    "gas_flow": np.float64,  # normal litres a minute; nan without an equilibrium
    "stiffness": np.float64,  # static, of the softest direction, N/m
    "margin": np.float64,  # largest rise solved without trouble to be avoided, relative
    "ends": np.float64,  # smallest rise solved with it; inf: none up to the line's end
    "meets": "<U24",  # the gravest kind there
    "points": np.int64,  # solved
    "seconds": np.float64,
}
_LATER = ("peak_contact_force",)  # which files of earlier versions lack: nan there
Rows = dict[str, np.ndarray]
Progress = Callable[[int], None]


@dataclass(frozen=True)
class Look:
    """How machines are solved and judged.

    Attributes
    ----------
    axis : str
        Of the margin, "speed" or "mass"; "": the machine alone, without a line.
    reach : float
        End of the line over the machine's own value.
    load : float
        Times its own mass that a machine must carry at rest, within the largest eccentricity
        allowed; 1: its own alone.
    precision : float
        Largest width of the bracket of the line's end, over the value there.
    spacing : float
        Largest ratio of one point of the line to the one before it.
    limits : Limits
    settings : Settings
    """

    axis: str = AXES[0]
    reach: float = REACH
    load: float = 1.0
    precision: float = PRECISION
    spacing: float = SPACING
    limits: Limits = DEFAULT_LIMITS
    settings: Settings = dataclasses.field(default_factory=Settings)

    def check(self) -> None:
        """Raise :class:`InputError` for a value that is not allowed."""
        if self.axis:
            check_choice("axis", self.axis, AXES)
        check_number("reach", self.reach, *REACHES)
        check_number("load", self.load, 1.0, 100.0)
        check_number("precision", self.precision, 1e-4, 0.1)
        check_number("spacing", self.spacing, *SPACINGS)
        self.settings.check_cold_start()

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return dataclasses.asdict(self) | {"settings": self.settings.to_dict()}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Look:
        """Read what :meth:`to_dict` returns."""
        limits, settings = Limits(**data["limits"]), Settings(**data["settings"])
        spacing = data.get("spacing", SPACING)  # which files of earlier versions lack
        line = data["axis"], data["reach"], data["load"], data["precision"], spacing
        return cls(*line, limits, settings)

    def carries(self, machine: Machine) -> bool:
        """Whether a machine carries :attr:`load` times its mass at rest."""
        if self.load <= 1.0:
            return True
        mass = min(machine.rotor_mass * self.load, ROTOR_MASS_RANGE[1])
        found = static_equilibrium(machine.design, mass, machine.bearing_number)
        return found is not None and 1.0 - found.gap <= self.limits.eccentricity


def _troubles(point: OperatingPoint, limits: Limits) -> dict[str, str]:
    """Return the grade of each kind of trouble that a point has."""
    kinds = troubles_of_motion(point.design, point.motion, limits)
    if point.rest is not None and point.rest.status == "ok":
        kinds |= troubles_at_rest(point.rest, limits)
    return kinds


def _gravest(kinds: dict[str, str]) -> str:
    """Return the gravest kind, the motion's before those at rest."""
    return max(kinds, key=lambda kind: GRADES.index(kinds[kind]), default="")


def look_at(machine: Machine, look: Look) -> dict[str, Any]:
    """Solve a machine and the short line from it upwards.

    The line is solved from rest at points :attr:`Look.spacing` apart until trouble to be avoided
    begins, which is then bisected. A machine that is to be avoided itself has the margin 0 and no
    line.

    Parameters
    ----------
    machine : Machine
    look : Look

    Returns
    -------
    dict
        By the names of :data:`ROW`.
    """
    began = time.perf_counter()
    point = _solve(machine, 1.0, look)
    judged, kinds, rest = point.assessment(look.limits), _troubles(point, look.limits), point.rest
    c, flow = (rest.coefficients, rest.gas_flow) if rest else (None, None)
    row: dict[str, Any] = {
        "grade": GRADES.index(judged.grade),
        "trouble": _gravest(kinds),
        "least_film": point.least_film,
        "eccentricity": point.max_eccentricity,
        "orbit": point.orbit_amplitude,
        "peak_contact_force": point.peak_contact_force,
        "gas_flow": flow.normal_litres if flow else math.nan,
        "stiffness": softest(c.stiffness[0]) if c else math.nan,
        "margin": 0.0,
        "ends": math.inf,
        "meets": "",
        "points": 1,
    }
    if not look.carries(machine):
        row |= {"grade": AVOID, "trouble": OVERLOADED}
    if row["grade"] == AVOID:
        row |= {"ends": 0.0, "meets": row["trouble"]}
    elif look.axis:
        row |= _line(machine, look)
    return row | {"seconds": time.perf_counter() - began}


def softest(stiffness: np.ndarray) -> float:
    """Return the smallest principal stiffness of a matrix (2, 2): that of its symmetric part."""
    return float(np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[0])


def _solve(machine: Machine, factor: float, look: Look) -> OperatingPoint:
    mass, number = machine.rotor_mass, machine.bearing_number
    if look.axis == "mass":
        mass = min(mass * factor, ROTOR_MASS_RANGE[1])
    else:
        number = min(number * factor, BEARING_NUMBER_RANGE[1])
    return solve_point(machine.design, mass, number, look.settings)


def _line(machine: Machine, look: Look) -> dict[str, Any]:
    """Return the bracket of the first trouble to be avoided on the way up."""
    at, top = (
        (machine.rotor_mass, ROTOR_MASS_RANGE[1])
        if look.axis == "mass"
        else (machine.bearing_number, BEARING_NUMBER_RANGE[1])
    )
    end = min(look.reach, top / at)
    near, far, meets, solved = 1.0, math.inf, "", 1

    def avoided(factor: float) -> str:
        nonlocal solved
        solved += 1
        kinds = _troubles(_solve(machine, factor, look), look.limits)
        return _gravest({k: g for k, g in kinds.items() if g == GRADES[AVOID]})

    count = max(math.ceil(math.log(end) / math.log(look.spacing) - 1e-9), 0)
    for k in range(1, count + 1):
        factor = end ** (k / count)
        meets = avoided(factor)
        if meets:
            far = factor
            break
        near = factor
    while math.isfinite(far) and far - near > look.precision * near:
        middle = 0.5 * (near + far)
        if kind := avoided(middle):
            far, meets = middle, kind
        else:
            near = middle
    return {"margin": near - 1.0, "ends": far - 1.0, "meets": meets, "points": solved}


def read_row(data: dict[str, Any]) -> dict[str, Any]:
    """Return a machine's row out of the plain values of a file."""
    return {name: data.get(name, math.nan) if name in _LATER else data[name] for name in ROW}


def read_rows(data: dict[str, Any]) -> Rows:
    """Return machines' rows out of the plain values of a file, lists by the names of
    :data:`ROW`.
    """
    unknown = dict.fromkeys(_LATER, [math.nan] * len(data["grade"]))
    return {name: np.array((unknown | data)[name], dtype) for name, dtype in ROW.items()}


def empty_rows(count: int) -> Rows:
    """Return rows of machines that are not solved."""
    rows = {name: np.zeros(count, dtype) for name, dtype in ROW.items()}
    rows["grade"][:] = -1
    return rows


def look_at_chunk(name: str, machines: Sequence[Machine], look: Look) -> tuple[str, Rows]:
    """Solve machines one after the other; runs in a worker.

    Returns
    -------
    name : str
    rows : dict of ndarray
        By the names of :data:`ROW`; ``solver``, the hash of the worker's solver.
    """
    found = [look_at(machine, look) for machine in machines]
    rows = {key: np.array([row[key] for row in found], dtype) for key, dtype in ROW.items()}
    return name, rows | {"solver": np.array(solver_hash())}


@contextlib.contextmanager
def looker(
    look: Look,
    design: Design,
    most: int,
    plan: dict[str, Any],
    *,
    chunk: int = CHUNK,
    checkpoint: Path | None = None,
    workers: int = 1,
    cluster: str | None = None,
    progress: Progress | None = None,
) -> Iterator[Callable[[Sequence[Machine]], Rows]]:
    """Yield a function that solves the next machines of a run and returns their rows.

    A run that asks for the same machines in the same order goes on from its checkpoint.

    Parameters
    ----------
    look : Look
    design : Design
        One like those of the machines, for which the solver is compiled.
    most : int
        Machines of the run.
    plan : dict
        Plain values that must agree to go on from the checkpoint.
    chunk : int
        Machines solved between two checkpoints.
    checkpoint : Path, optional
        Folder of the checkpoint.
    workers : int
        Processes; the rows do not depend on it.
    cluster : str, optional
        Address of a Dask scheduler whose workers solve instead.
    progress : callable
        Called with the number of machines done since the last call.

    Raises
    ------
    InputError
        For a checkpoint of another run or a cluster that does not answer.
    """
    look.check()
    first, asked = 0, list[Machine]()
    same = {"solver": solver_hash(), "look": look.to_dict()} | plan

    def job(name: str, cells: np.ndarray) -> Any:
        return joblib.delayed(look_at_chunk)(name, [asked[k - first] for k in cells], look)

    with Checkpoint(checkpoint, same, empty_rows(most)).resume() as run:
        solve = chunk_solver(
            run,
            job,
            design,
            look.settings,
            chunk_cells=chunk,
            workers=workers,
            cluster=cluster,
            progress=progress,
        )

        def look_at_next(machines: Sequence[Machine]) -> Rows:
            nonlocal first, asked
            first, asked = first + len(asked), list(machines)
            return solve(np.arange(first, first + len(asked)))

        yield look_at_next
