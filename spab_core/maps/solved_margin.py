"""Solve how far an operating point is from the first trouble: cold starts along both lines through
it, speed at fixed mass and mass at fixed speed, then bisection of each first change.

Trouble is what the assessment calls to be avoided or to be watched
(:mod:`spab_core.trajectory.assessment`), each kind by its name. Every limit is a bracket between
two solved points. What lies between two neighbouring points of the lines that are alike is not
looked at: a window narrower than their spacing can be missed.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from collections.abc import Callable, Iterable
from concurrent import futures
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from spab_core.common.validation import check_number
from spab_core.design.form import nearest_bearing_number
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE, check_point
from spab_core.design.model import Design
from spab_core.linear_theory.summary import Derived
from spab_core.maps.parallel import executor
from spab_core.trajectory.assessment import (
    CHAOTIC,
    DEFAULT_LIMITS,
    FAILED,
    GRADE_WORDS,
    GRADES,
    LARGE_ECCENTRICITY,
    LARGE_ORBIT,
    LEAST_FILM,
    LIGHTLY_DAMPED,
    NEAR_FILM,
    NOT_LIFTED,
    QUASI_PERIODIC,
    RAISED_ECCENTRICITY,
    RESONANCE,
    RUBBING,
    SUBHARMONIC,
    UNDECIDED,
    UNSTABLE,
    WATCH,
    Assessment,
    Limits,
    Motion,
    Rule,
    motion_rules,
    motion_words,
    rest_rules,
)
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.settings import Settings
from spab_core.trajectory.starts import whirling_start

AXES = ("speed", "mass")
DIRECTIONS = ("down", "up")
SPAN = (0.25, 3.0)  # of the point's value
POINTS, POINTS_RANGE = 12, (2, 200)  # of a line on each side of the point, and allowed
PRECISION, PRECISION_RANGE = 0.005, (1e-5, 0.1)  # width of a bracket over its value, and allowed
ROUGH = 10.0  # times the precision: of a bracket between two points that rub or fail
APART = 0.05  # by how much the largest eccentricities of two motions differ at least, over C
_STILL = 1e-9  # relative: a point at the end of what is allowed
_REGIMES = frozenset({CHAOTIC, QUASI_PERIODIC, SUBHARMONIC})
_OF_MOTION = _REGIMES | {
    UNDECIDED,
    RUBBING,
    LEAST_FILM,
    LARGE_ECCENTRICITY,
    LARGE_ORBIT,
    NEAR_FILM,
    RAISED_ECCENTRICITY,
}
_OF_REST = frozenset({RESONANCE, NOT_LIFTED, UNSTABLE, LIGHTLY_DAMPED})
_ROUGH = _REGIMES | _OF_REST | {UNDECIDED, LARGE_ORBIT}
KINDS = {  # of trouble: what it is called in a sentence
    FAILED: "a failed run (touchdown)",
    RUBBING: "rubbing",
    CHAOTIC: "chaos",
    QUASI_PERIODIC: "a quasi-periodic whirl",
    SUBHARMONIC: "a whirl locked to the rotation",
    LEAST_FILM: "a film under its limit",
    LARGE_ECCENTRICITY: "an eccentricity over its limit",
    NOT_LIFTED: "a rotor that lies on the wall at rest",
    RESONANCE: "resonance",
    UNDECIDED: "an undecided motion",
    LARGE_ORBIT: "a large orbit",
    NEAR_FILM: "a film near its limit",
    RAISED_ECCENTRICITY: "a raised eccentricity",
    UNSTABLE: "instability at rest",
    LIGHTLY_DAMPED: "light damping at rest",
}
Progress = Callable[[int], None]


class Found(NamedTuple):
    """What is wrong at a solved point.

    Attributes
    ----------
    kinds : dict
        Grade, "watch" or "avoid", by kind of :data:`KINDS`.
    unknown : frozenset of str
        Kinds that the point says nothing about, such as those of a motion where the run failed.
    """

    kinds: dict[str, str]
    unknown: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Limit:
    """The first change of a kind of trouble along a line, between two solved points.

    Attributes
    ----------
    axis : str
        Of :data:`AXES`.
    direction : str
        Of :data:`DIRECTIONS`, from the operating point.
    what : str
        Of :data:`KINDS`.
    value, low, high : float
        Middle and ends of the bracket, rpm or kg.
    begins : bool
        Whether the trouble begins there; False: the operating point has it, and it ends there.
    grade : str
        "watch" or "avoid": of the trouble on its side of the bracket.
    change : float
        Of the value, relative to the operating point's.
    """

    axis: str
    direction: str
    what: str
    value: float
    low: float
    high: float
    begins: bool
    grade: str
    change: float

    def words(self) -> str:
        """Return such as "rubbing from 23,200 ± 100 rpm (+16 %)"."""
        half = 0.5 * (self.high - self.low)
        digits = -math.floor(math.log10(half * (1.0 + 1e-9))) if half > 0.0 else 3
        spread = math.ceil(half * 10.0**digits - 1e-9) / 10.0**digits  # never narrower
        shown = max(digits, 0)
        unit = "rpm" if self.axis == "speed" else "kg"
        return (
            f"{KINDS[self.what]} {'from' if self.begins else 'ends at'} "
            f"{round(self.value, digits):,.{shown}f} ± {spread:,.{shown}f} {unit} "
            f"({100.0 * self.change:+,.{0 if abs(self.change) >= 0.1 else 1}f} %)"
        )


@dataclass(frozen=True)
class Line:
    """What was looked at from the operating point in one direction.

    Attributes
    ----------
    axis, direction : str
        Of :data:`AXES` and :data:`DIRECTIONS`.
    end : float
        Last value solved, rpm or kg.
    points : int
        Solved from the operating point to there before any bisection, equally spaced in the
        logarithm; 0 where the operating point is at the end of what is allowed.
    spacing : float
        Of neighbouring points, relative: narrower windows can be missed.
    """

    axis: str
    direction: str
    end: float
    points: int
    spacing: float


@dataclass(frozen=True)
class SolvedMargin:
    """Limits around an operating point, all solved.

    Attributes
    ----------
    point : OperatingPoint
        From the cold start.
    here : dict
        Grade by kind of the trouble that the point has.
    limits : tuple of Limit
        The nearest of each kind on each side, by rising relative change.
    lines : tuple of Line
    beside : OperatingPoint or None
        Another motion at the same point, reached from a large orbit.
    judged_by : Limits
    solved : int
        Points solved.
    seconds : float
    """

    point: OperatingPoint
    here: dict[str, str]
    limits: tuple[Limit, ...]
    lines: tuple[Line, ...]
    beside: OperatingPoint | None = None
    judged_by: Limits = DEFAULT_LIMITS
    solved: int = 0
    seconds: float = field(default=0.0, compare=False)

    @property
    def assessment(self) -> Assessment:
        """What the point is worth; a motion beside its own is a reason to watch it."""
        found = self.point.assessment(self.judged_by)
        if self.beside is None:
            return found
        grade = "watch" if found.grade == "good" else found.grade
        return dataclasses.replace(
            found,
            grade=grade,
            reasons=(*found.reasons, self.beside_words()),
            motion=found.motion.replace(f": {found.words}.", f": {GRADE_WORDS[grade]}."),
        )

    def beside_words(self) -> str:
        """Return what exists beside the motion from rest, as a clause; nothing where nothing was
        found.
        """
        other = self.beside
        if other is None:
            return ""
        if other.regime is None:
            return f"started on a large orbit, the run fails ({other.trajectory.status})"
        words = motion_words(other.regime.name, other.regime.period)
        return (
            f"another motion of {100.0 * other.max_eccentricity:.0f} % of the clearance exists "
            f"beside it, reached from a large orbit: {words[0].lower()}{words[1:]}"
        )

    def nearest(self, grade: str) -> Limit | None:
        """Return the nearest trouble to come of a grade, "watch" or "avoid"."""
        return next((x for x in self.limits if x.begins and x.grade == grade), None)

    def headline(self) -> str:
        """Return the margin in one sentence: the nearest trouble to be avoided, and the nearest to
        be watched if that is nearer.
        """
        avoid, watch = self.nearest("avoid"), self.nearest("watch")
        if watch and avoid and abs(watch.change) >= abs(avoid.change):
            watch = None
        told = [f"going {x.direction} in {x.axis}, {x.words()}" for x in (avoid, watch) if x]
        if avoid and watch:
            told[1] = f"to be watched before: {told[1]}"
        return f"Solved margin: {'; '.join(told) or 'no further trouble where it was looked for'}."

    def sentences(self) -> list[str]:
        """Describe what the point has, the limits in each direction and what was not looked at."""
        told = [f"Here already: {', '.join(KINDS[k] for k in self.here)}."] if self.here else []
        if _not_judged(self.point.rest):
            told.append("Resonance and stability at rest are not judged: no equilibrium is known.")
        if self.beside:
            words = self.beside_words()
            told.append(f"{words[0].upper()}{words[1:]}.")
        told += [self._along(line) for line in self.lines]
        spacing = max((line.spacing for line in self.lines), default=0.0)
        told.append(
            f"Each limit lies between two of {self.solved} solved points, started from rest; a "
            f"window narrower than {100.0 * spacing:.0f} % of the value, the spacing of the lines, "
            "can be missed."
        )
        return told

    def _along(self, line: Line) -> str:
        begin = f"{line.direction.capitalize()} in {line.axis}"
        unit = "rpm" if line.axis == "speed" else "kg"
        end = f"{line.end:,.0f} {unit}" if line.axis == "speed" else f"{line.end:.4g} {unit}"
        if not line.points:
            return f"{begin}: nothing beyond {end} is allowed."
        told = [
            limit.words()
            for limit in self.limits
            if (limit.axis, limit.direction) == (line.axis, line.direction)
        ]
        return f"{begin}, looked at to {end}: {'; '.join(told) or 'nothing begins or ends'}."

    def record(self) -> dict[str, Any]:
        """Return plain values: the keys of ``spab simulate --json``, and those of the margin."""
        judged = self.assessment
        return self.point.record(self.judged_by) | {
            "assessment": judged.grade,
            "assessment_reasons": list(judged.reasons),
            "headline": self.headline(),
            "sentences": self.sentences(),
            "here": dict(self.here),
            "limits": [dataclasses.asdict(limit) | {"predicted": False} for limit in self.limits],
            "lines": [dataclasses.asdict(line) for line in self.lines],
            "beside": self.beside.record(self.judged_by) if self.beside else None,
            "points_solved": self.solved,
            "margin_seconds": self.seconds,
        }


def troubles_of_motion(
    design: Design, motion: Motion, limits: Limits = DEFAULT_LIMITS
) -> dict[str, str]:
    """Name what the assessment finds wrong with a motion.

    Parameters
    ----------
    design : Design
    motion : Motion
        Of single values.
    limits : Limits

    Returns
    -------
    dict
        Grade, "watch" or "avoid", by kind of :data:`KINDS`.
    """
    found = _by_kind(motion_rules(design, motion, limits))
    # what is under a limit is near it as well: along a line that trouble does not end there
    for grave, mild in ((LEAST_FILM, NEAR_FILM), (LARGE_ECCENTRICITY, RAISED_ECCENTRICITY)):
        if grave in found:
            found.setdefault(mild, GRADES[WATCH])
    return found


def troubles_at_rest(rest: Derived, limits: Limits = DEFAULT_LIMITS) -> dict[str, str]:
    """Name what the assessment finds wrong with a static equilibrium; as
    :func:`troubles_of_motion`.
    """
    return _by_kind(rest_rules(rest, limits))


def _by_kind(rules: Iterable[Rule]) -> dict[str, str]:
    """Return the worst grade of each kind of :data:`KINDS` among the rules that hold."""
    worst: dict[str, int] = {}
    for rule in rules:
        if rule.holds and rule.kind in KINDS:
            worst[rule.kind] = max(worst.get(rule.kind, rule.grade), rule.grade)
    return {kind: GRADES[grade] for kind, grade in worst.items()}


def _not_judged(rest: Derived | None) -> bool:
    return rest is None or rest.status != "ok"


def _look(point: OperatingPoint, limits: Limits) -> Found:
    rest = point.rest
    kinds, unknown = troubles_of_motion(point.design, point.motion, limits), frozenset[str]()
    if FAILED in kinds:
        unknown |= _OF_MOTION
    if UNDECIDED in kinds:
        unknown |= _REGIMES
    if _not_judged(rest):
        unknown |= _OF_REST
    elif rest:
        kinds |= troubles_at_rest(rest, limits)
    return Found({name: kinds[name] for name in KINDS if name in kinds}, unknown)


def _look_at(
    design: Design, rotor_mass: float, bearing_number: float, settings: Settings, limits: Limits
) -> Found:
    return _look(solve_point(design, rotor_mass, bearing_number, settings), limits)


class Side:
    """A line on one side of the operating point.

    Parameters
    ----------
    line : Line
    at : float
        The operating point's value, rpm or kg.
    here : Found
    """

    def __init__(self, line: Line, at: float, here: Found) -> None:
        self.line, self.at, self.here = line, at, here
        self.found = {at: here}  # by value

    def grid(self) -> list[float]:
        """Return the values to be solved first."""
        n = self.line.points
        ratio = (self.line.end / self.at) ** (1.0 / max(n, 1))
        return [self.at * ratio**k for k in range(1, n)] + [self.line.end] * (n > 0)

    def brackets(self) -> dict[str, tuple[float, float]]:
        """Return the solved values, the nearer first, between which each kind first changes."""
        values = sorted(self.found, key=lambda value: abs(value - self.at))
        changes = {
            kind: next(
                (pair for pair in itertools.pairwise(values) if self._changed(kind, pair[1])), None
            )
            for kind in KINDS
        }
        return {kind: pair for kind, pair in changes.items() if pair is not None}

    def _changed(self, kind: str, value: float) -> bool:
        found = self.found[value]
        return kind not in found.unknown and (kind in found.kinds) != (kind in self.here.kinds)

    def middles(self, precision: float) -> list[float]:
        """Return the middles of the brackets that are still too wide."""
        pairs = {
            pair
            for kind, pair in self.brackets().items()
            if max(pair) - min(pair) > precision * min(pair) * self._roughness(kind, pair)
        }
        return sorted(0.5 * (near + far) for near, far in pairs)

    def _roughness(self, kind: str, values: tuple[float, float]) -> float:
        """Return times the precision: where all of them rub or fail it is of little use which
        motion does so or how the rotor would rest, and runs take 50 times as long.
        """
        rub = all(self.found[value].kinds.keys() & {RUBBING, FAILED} for value in values)
        return ROUGH if rub and kind in _ROUGH else 1.0

    def limits(self) -> list[Limit]:
        """Return the first change of each kind."""
        told = []
        for kind, (near, far) in self.brackets().items():
            begins = kind not in self.here.kinds
            value = 0.5 * (near + far)
            told.append(
                Limit(
                    self.line.axis,
                    self.line.direction,
                    kind,
                    value,
                    min(near, far),
                    max(near, far),
                    begins,
                    (self.found[far] if begins else self.here).kinds[kind],
                    value / self.at - 1.0,
                )
            )
        return told


def check_solved_margin(points: int, precision: float) -> None:
    """Raise :class:`InputError` for numbers of :func:`solve_margin` out of range."""
    check_number("points", points, *POINTS_RANGE)
    check_number("precision", precision, *PRECISION_RANGE)


def solve_margin(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings | None = None,
    limits: Limits = DEFAULT_LIMITS,
    *,
    points: int = POINTS,
    precision: float = PRECISION,
    workers: int = 1,
    progress: Progress | None = None,
) -> SolvedMargin:
    """Solve the limits of an operating point in speed and mass.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    settings : Settings
        Of every run.
    limits : Limits
        By which every point is judged.
    points : int
        On each side of the point, from a quarter of its value to three times it, within what is
        allowed.
    precision : float
        Largest width of a limit's bracket, over its value; ten times that for regimes, orbits and
        trouble at rest between two points that rub or fail.
    workers : int
        Processes.
    progress : callable
        Called with the number of points solved since the last call, from whatever thread.

    Returns
    -------
    SolvedMargin

    Raises
    ------
    InputError
        For an operating point or a number out of range.
    """
    began = time.perf_counter()
    check_point(rotor_mass, bearing_number)
    check_solved_margin(points, precision)
    settings = settings or Settings()
    point = solve_point(design, rotor_mass, bearing_number, settings)
    here = _look(point, limits)
    sides = _sides(design, rotor_mass, bearing_number, points, here)

    def place(axis: str, value: float) -> tuple[float, float]:
        if axis == "mass":
            return value, bearing_number
        return rotor_mass, nearest_bearing_number(design, value)

    with executor(workers, settings) as pool:

        def start(side: Side, value: float) -> futures.Future[Found]:
            run = pool.submit(_look_at, design, *place(side.line.axis, value), settings, limits)
            if progress:
                run.add_done_callback(lambda _: progress(1))
            return run

        wanted = [(side, value) for side in sides for value in side.grid()]
        while wanted:
            runs = [(side, value, start(side, value)) for side, value in wanted]
            for side, value, run in runs:
                side.found[value] = run.result()
            wanted = [(side, value) for side in sides for value in side.middles(precision)]
    return SolvedMargin(
        point,
        here.kinds,
        tuple(sorted((x for side in sides for x in side.limits()), key=lambda x: abs(x.change))),
        tuple(side.line for side in sides),
        _beside(point),
        limits,
        sum(len(side.found) - 1 for side in sides) + 1,
        time.perf_counter() - began,
    )


def _sides(
    design: Design, rotor_mass: float, bearing_number: float, points: int, here: Found
) -> list[Side]:
    rpm, sides = design.speed_rpm(1.0), []
    low, high = BEARING_NUMBER_RANGE
    for axis, at, allowed in (
        ("speed", bearing_number * rpm, (low * rpm, high * rpm)),
        ("mass", float(rotor_mass), ROTOR_MASS_RANGE),
    ):
        for direction, factor in zip(DIRECTIONS, SPAN, strict=True):
            end = min(max(at * factor, allowed[0]), allowed[1])
            spacing = abs((end / at) ** (1.0 / points) - 1.0)
            moves = spacing > _STILL
            line = Line(axis, direction, end, points if moves else 0, spacing if moves else 0.0)
            sides.append(Side(line, at, here))
    return sides


def _beside(point: OperatingPoint) -> OperatingPoint | None:
    """Start the point on a large orbit; return what it comes to if that is another motion."""
    start = whirling_start(
        point.design, point.rotor_mass, point.bearing_number, point.settings.mesh
    )
    other = solve_point(
        point.design, point.rotor_mass, point.bearing_number, point.settings, start=start
    )
    return other if _differ(point, other) else None


def _differ(point: OperatingPoint, other: OperatingPoint) -> bool:
    """Whether two runs came to two motions; where one does not repeat, its regime may be a matter
    of where it was looked at, so only how large they are counts.
    """
    if point.regime is None or other.regime is None:
        return point.regime != other.regime
    apart = abs(point.max_eccentricity - other.max_eccentricity) > APART
    names = {point.regime.name, other.regime.name}
    if names == {"periodic"}:
        return apart or point.regime.period != other.regime.period
    return apart and names != {"chaotic"}
