"""What if the drawing changes: how the margin of a machine moves.

The machine keeps its rotor mass and speed when its bearing is changed, so margins are in kg and
rpm, and the bearing number is computed for each design.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd

from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import UNREADABLE
from spab_core.common.units import from_rpm
from spab_core.common.validation import check_choice, check_number
from spab_core.common.words import capital
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE, check_point
from spab_core.design.model import Design
from spab_core.maps.parallel import cluster_or_processes
from spab_core.trajectory.assessment import (
    AVOID,
    DEFAULT_LIMITS,
    GRADE_WORDS,
    GRADES,
    KINDS,
    Limits,
    assess,
)
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

SETTINGS = Settings(transient=200, revolutions=200)
REACH = 2.0  # margins are sought from 1/REACH to REACH times the operating point
SCAN = 16  # points to each side, equally spaced in the logarithm
BISECTIONS = 4  # of the step in which the assessment changes: the border to 0.3 %
STEP, STEPS = 0.1, (1e-3, 0.5)  # relative change of each value of the design; allowed
VALUES = {  # what a designer can still change, and its name
    "bearing__clearance": "clearance",
    "bearing__supply_pressure_ratio": "supply pressure",
    "bearing__porosity": "wall porosity",
    "bearing__layer_permeability": "layer permeability",
    "rotor__unbalance_eccentricity": "unbalance",
    "rotor__shaft_stiffness": "shaft stiffness",
}
AXES = ("speed", "mass")
_MAX_BYTES = 1_000_000  # of a file of these
_COLUMNS = {
    "value": str,
    "factor": float,
    "assessment": str,
    "why": str,
    "below": float,
    "below_what": str,
    "above": float,
    "above_what": str,
    "distance": float,
    "change": float,
}


@dataclass(frozen=True)
class MachineMargin:
    """How far a machine is, along one axis, from the nearest change between what is to be avoided
    and what is not.

    Attributes
    ----------
    axis : str
        ``speed`` or ``mass``.
    grade : str
        Of the operating point, of :data:`~spab_core.trajectory.assessment.GRADES`.
    why : str
        Kind of its gravest trouble, of :data:`~spab_core.trajectory.assessment.KINDS`; "" where it
        is good.
    at : float
        Speed in rpm, or rotor mass in kg, of the operating point.
    below, above : float
        The nearest change to each side, in the same unit; nan if the scan finds none.
    below_what, above_what : str
        Kind of the gravest trouble that begins there, or, where the operating point itself is to be
        avoided, ends there; "" where there is none.
    low, high : float
        Ends of the scan.
    """

    axis: str
    grade: str
    why: str
    at: float
    below: float
    above: float
    below_what: str
    above_what: str
    low: float
    high: float

    @property
    def is_avoided(self) -> bool:
        """Whether the operating point itself is to be avoided."""
        return self.grade == GRADES[AVOID]

    @property
    def distance(self) -> float:
        """Relative distance to the nearer change, negative where the operating point itself is to
        be avoided.

        Without a change within the scan: the distance to its end, a lower bound.
        """
        borders = [border for border in (self.below, self.above) if not np.isnan(border)]
        nearest = min(abs(end - self.at) for end in borders or (self.low, self.high))
        return (-1.0 if self.is_avoided else 1.0) * nearest / self.at

    def verdict(self) -> str:
        """Return what the point is worth and where that changes, in a sentence."""
        unit = "rpm" if self.axis == "speed" else "kg"

        def told(value: float) -> str:
            return f"{value:,.0f} rpm" if self.axis == "speed" else f"{value:.4g} kg"

        words = GRADE_WORDS[self.grade]
        begin = f"{capital(words)} at {told(self.at)}"
        if self.why:
            begin += f" ({KINDS[self.why]})"
        changes = [
            f"{KINDS.get(what, what)} {'ends' if self.is_avoided else 'begins'} at {told(value)}, "
            f"going {way}"
            for way, value, what in (
                ("down", self.below, self.below_what),
                ("up", self.above, self.above_what),
            )
            if not math.isnan(value)
        ]
        none = f"{'everything' if self.is_avoided else 'nothing'} is to be avoided"
        sought = f"searched from {told(self.low).removesuffix(f' {unit}')} to {told(self.high)}"
        return f"{begin}; {'; '.join(changes) or none}, {sought}."


def judge(
    design: Design,
    rotor_mass: float,
    speed_rpm: float,
    settings: Settings = SETTINGS,
    limits: Limits = DEFAULT_LIMITS,
) -> tuple[str, str]:
    """Return the assessment of the motion from the cold start and of the equilibrium, and the kind
    of the gravest trouble, "" where there is none; ``rotor_mass`` in kg.
    """
    point = solve_point(design, rotor_mass, _number(design, speed_rpm), settings)
    found = assess(design, point.motion, point.rest, limits)
    return found.grade, next(iter(found.kinds), "")


def _number(design: Design, speed_rpm: float) -> float:
    return design.bearing_number(from_rpm(speed_rpm))


def check_margin(
    design: Design, rotor_mass: float, speed_rpm: float, axis: str, scan: int = SCAN
) -> None:
    """Raise :class:`InputError` for a machine, an axis or a scan out of range."""
    check_choice("axis", axis, AXES)
    check_number("scan", scan, 2, 1000)
    low, high = (limit / _number(design, 1.0) for limit in BEARING_NUMBER_RANGE)
    check_number("speed", speed_rpm, low, high, "rpm")
    check_point(rotor_mass, _number(design, speed_rpm))


def machine_margin(
    design: Design,
    rotor_mass: float,
    speed_rpm: float,
    axis: str,
    settings: Settings = SETTINGS,
    limits: Limits = DEFAULT_LIMITS,
    *,
    scan: int = SCAN,
) -> MachineMargin:
    """Find where what is to be avoided begins or ends along an axis, by cold starts outward from
    the operating point, then bisection.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    speed_rpm : float
    axis : str
        Of :data:`AXES`.
    settings : Settings
    limits : Limits
        By which points are judged.
    scan : int
        Points to each side; bands narrower than their spacing, ``REACH**(1/scan)``, can be missed.

    Returns
    -------
    MachineMargin

    Raises
    ------
    InputError
        For an operating point or axis out of range.
    """
    check_margin(design, rotor_mass, speed_rpm, axis, scan)
    at = speed_rpm if axis == "speed" else rotor_mass
    ends = (
        [r / _number(design, 1.0) for r in BEARING_NUMBER_RANGE]
        if axis == "speed"
        else ROTOR_MASS_RANGE
    )

    def judged(value: float) -> tuple[str, str]:
        mass, speed = (rotor_mass, value) if axis == "speed" else (value, speed_rpm)
        return judge(design, mass, speed, settings, limits)

    grade, why = here = judged(at)
    low, high = (float(np.clip(at * factor, *ends)) for factor in (1.0 / REACH, REACH))
    (below, under), (above, over) = (_border(judged, here, at, end, scan) for end in (low, high))
    return MachineMargin(axis, grade, why, float(at), below, above, under, over, low, high)


def _border(
    judged: Callable[[float], tuple[str, str]],
    here: tuple[str, str],
    at: float,
    end: float,
    scan: int,
) -> tuple[float, str]:
    """Return the first value from ``at`` to ``end`` at which what is to be avoided begins, or ends
    if ``here`` it is, and its kind; nan and "" if there is none.
    """
    avoid = GRADES[AVOID]
    near, last = at, here
    for value in np.geomspace(at, end, scan + 1)[1:].tolist() if end != at else ():
        found = judged(value)
        if (found[0] == avoid) == (here[0] == avoid):
            near, last = value, found
            continue
        far = value  # bisected by hand: each end costs a run, scipy's would solve both again
        for _ in range(BISECTIONS):
            middle = float(np.sqrt(near * far))
            between = judged(middle)
            if (between[0] == avoid) == (here[0] == avoid):
                near, last = middle, between
            else:
                far, found = middle, between
        return float(np.sqrt(near * far)), (last if here[0] == avoid else found)[1]
    return math.nan, ""


def variations(design: Design, step: float = STEP) -> list[tuple[str, float, Design]]:
    """Return the designs with one value lower and higher by ``step``: (name of the value, factor,
    design).

    Values that are 0 or infinite (no unbalance, a rigid shaft) and designs out of range are left
    out.
    """
    found = []
    for key, name in VALUES.items():
        part, _, field = key.partition("__")
        value = getattr(getattr(design, part), field)
        if not 0.0 < value < float("inf"):
            continue
        for factor in (1.0 - step, 1.0 + step):
            try:
                found.append((name, factor, design.replace(**{key: factor * value})))
            except InputError:
                continue
    return found


def sensitivity(
    design: Design,
    rotor_mass: float,
    speed_rpm: float,
    axis: str = "speed",
    settings: Settings = SETTINGS,
    *,
    limits: Limits = DEFAULT_LIMITS,
    step: float = STEP,
    scan: int = SCAN,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> tuple[MachineMargin, pd.DataFrame]:
    """Compute how the margin of a machine moves with each value of its design, for a tornado chart.

    Parameters
    ----------
    design, rotor_mass, speed_rpm, axis, settings, limits, scan
        As in :func:`machine_margin`.
    step : float
        Relative change of each value, from 0.001 to 0.5.
    workers : int
        Processes.
    progress : callable
        Called with the number of margins found since the last call, ``1 + len(variations(design))``
        in total.

    Returns
    -------
    MachineMargin
        Of the design as it is.
    DataFrame
        A row for each value and direction: ``value``, ``factor``, ``assessment`` and its ``why``,
        ``below``, ``above`` (rpm or kg) with ``below_what``, ``above_what``, ``distance``
        (relative), ``change`` (of the distance); the value with the largest change first.

    Raises
    ------
    InputError
        For an operating point, axis or step out of range.
    """
    check_number("step", step, *STEPS)
    check_margin(design, rotor_mass, speed_rpm, axis, scan)
    cases = [("", 1.0, design), *variations(design, step)]
    margins: dict[int, MachineMargin] = {}
    with cluster_or_processes(workers, settings, design) as run:
        jobs = (
            joblib.delayed(_numbered_margin)(
                k, case[2], rotor_mass, speed_rpm, axis, settings, limits, scan=scan
            )
            for k, case in enumerate(cases)
        )
        for k, margin in run(jobs):
            margins[k] = margin
            if progress:
                progress(1)
    base = margins[0]
    rows = [
        {
            "value": name,
            "factor": factor,
            "assessment": margins[k].grade,
            "why": margins[k].why,
            "below": margins[k].below,
            "below_what": margins[k].below_what,
            "above": margins[k].above,
            "above_what": margins[k].above_what,
            "distance": margins[k].distance,
            "change": margins[k].distance - base.distance,
        }
        for k, (name, factor, _) in enumerate(cases)
        if k
    ]
    table = pd.DataFrame(rows, columns=list(_COLUMNS)).astype(_COLUMNS)
    largest = table.groupby("value")["change"].transform(lambda c: c.abs().max())
    order = (
        table.assign(largest=largest)
        .sort_values(["largest", "value", "factor"], ascending=[False, True, True])
        .index
    )
    return base, table.loc[order].reset_index(drop=True)


def _numbered_margin(number: int, *arguments: Any, scan: int) -> tuple[int, MachineMargin]:
    return number, machine_margin(*arguments, scan=scan)


def save_sensitivity(base: MachineMargin, table: pd.DataFrame, path: Path) -> None:
    """Write a result of :func:`sensitivity` as JSON, atomically."""
    rows = table.astype(object).where(table.notna(), None).to_dict("list")
    numbers = {
        name: None if value != value else value for name, value in dataclasses.asdict(base).items()
    }
    write_atomically(path, json.dumps({"base": numbers, "rows": rows}).encode())


def load_sensitivity(path: Path) -> tuple[MachineMargin, pd.DataFrame]:
    """Read a file of :func:`save_sensitivity`. Raises ``InputError`` for any other file."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"it has more than {_MAX_BYTES:,} bytes")
        data = json.loads(path.read_text("utf-8"))
        numbers: dict[str, Any] = {
            name: float("nan") if value is None else value for name, value in data["base"].items()
        }
        base = MachineMargin(**numbers)
        places = [float(number) for number in (base.low, base.at, base.high)]
        if (
            base.axis not in AXES
            or base.grade not in GRADES
            or not {base.why, base.below_what, base.above_what} <= {"", *KINDS}
            or not 0.0 < places[0] <= places[1] <= places[2] < math.inf
        ):
            raise ValueError("its margin is damaged")
        if (
            any(not isinstance(border, float) for border in (base.below, base.above))
            or data["rows"].keys() != _COLUMNS.keys()
        ):
            raise ValueError("its borders or its table are damaged")
        table = pd.DataFrame(data["rows"], columns=list(_COLUMNS)).astype(_COLUMNS)
    except UNREADABLE as error:
        raise InputError(f"cannot read the sensitivity {str(path)!r}: {str(error)[:200]}") from None
    return base, table
