"""Solve how far an operating point is from the first trouble: cold starts along lines through it
(speed at fixed mass, mass at fixed speed, both by the same factor, and one against the other), then
bisection of each first change. States are carried on along each line, up and down, to find motions
that exist beside those from rest.

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
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent import futures
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from spab_core.common.errors import DesignError
from spab_core.common.validation import check_choice, check_number, check_whole
from spab_core.common.words import capital, small
from spab_core.design.form import nearest_bearing_number
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE, check_point
from spab_core.design.model import Design
from spab_core.linear_theory.summary import Derived
from spab_core.maps.parallel import executor
from spab_core.trajectory.assessment import (
    AVOID,
    CHAOTIC,
    COEXISTING,
    DEFAULT_LIMITS,
    FAILED,
    GRADE_WORDS,
    GRADES,
    KINDS,
    LARGE_ECCENTRICITY,
    LARGE_ORBIT,
    LEAST_FILM,
    LIGHTLY_DAMPED,
    NEAR_FILM,
    NOT_LIFTED,
    OUTSIDE,
    QUASI_PERIODIC,
    RAISED_ECCENTRICITY,
    RESONANCE,
    RUBBING,
    SUBHARMONIC,
    UNDECIDED,
    UNKNOWN,
    UNSTABLE,
    WATCH,
    Assessment,
    Limits,
    Motion,
    Rule,
    assess,
    motion_rules,
    motion_words,
    rest_rules,
)
from spab_core.trajectory.point import OperatingPoint, beside_words, solve_point
from spab_core.trajectory.settings import Settings

DIRECTIONS = {  # by axis, the first ones down: powers of a factor by which mass and speed change
    "speed": {"down": (0, 1), "up": (0, 1)},
    "mass": {"down": (1, 0), "up": (1, 0)},
    "both": {"down": (1, 1), "up": (1, 1), "speed up": (1, -1), "mass up": (1, -1)},
}
_DOWN = ("down", "speed up")  # directions in which the factor falls below 1
_TOLD = {
    ("both", "down"): "down in mass and speed together",
    ("both", "up"): "up in mass and speed together",
    ("both", "speed up"): "up in speed and down in mass as much",
    ("both", "mass up"): "up in mass and down in speed as much",
}
SPAN, SPAN_BOTH = (0.25, 3.0), (0.5, 2.0)  # of the point's value; factors of both
POINTS, POINTS_RANGE = 12, (2, 200)  # of a line on each side of the point, and allowed
PRECISION, PRECISION_RANGE = 0.005, (1e-5, 0.1)  # width of a bracket over its value, and allowed
ROUGH = 10.0  # times the precision: of a bracket between two points that rub or fail
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
_OF_REST = frozenset({RESONANCE, NOT_LIFTED, UNSTABLE, LIGHTLY_DAMPED, OUTSIDE})
_TWO_GRADES = frozenset({RESONANCE, QUASI_PERIODIC, SUBHARMONIC})  # which may have either
_ROUGH = _REGIMES | _OF_REST | {UNDECIDED, LARGE_ORBIT}
Progress = Callable[[int], None]
_Runs = list["futures.Future[Found]"]


class Found(NamedTuple):
    """What is wrong at a solved point.

    Attributes
    ----------
    kinds : dict
        Grade, "watch" or "avoid", by kind of :data:`KINDS`.
    unknown : frozenset of str
        Kinds that the point says nothing about, such as those of a motion where the run failed.
    point : OperatingPoint
        From the cold start.
    beside : OperatingPoint or None
        Another motion; not looked for where something is to be avoided.
    """

    kinds: dict[str, str]
    unknown: frozenset[str]
    point: OperatingPoint
    beside: OperatingPoint | None = None

    @property
    def is_bad(self) -> bool:
        """Whether something is to be avoided."""
        return GRADES[AVOID] in self.kinds.values()

    def with_beside(self, other: OperatingPoint | None) -> Found:
        """Return the same with another motion, if there is one."""
        if other is None:
            return self
        return self._replace(kinds=self.kinds | {COEXISTING: GRADES[WATCH]}, beside=other)


@dataclass(frozen=True)
class Limit:
    """The first change of a kind of trouble along a line, between two solved points: where it
    begins or ends, or where what is to be watched becomes to be avoided or the other way round.

    Attributes
    ----------
    axis, direction : str
        Of :data:`DIRECTIONS`, from the operating point.
    what : str
        Of :data:`KINDS`.
    value, low, high : float
        Middle and ends of the bracket: rpm, kg, or on the axis "both" the factor of the mass.
    begins : bool
        Whether the trouble begins there, or becomes to be avoided; False: the operating point has
        it, and it ends there, or is to be watched from there on.
    grade : str
        "watch" or "avoid": of the trouble on its side of the bracket, the worse one.
    change : float
        Of the value, relative to the operating point's.
    rotor_mass, speed_rpm : float
        Where the value is, kg and rpm.
    distance : float
        Root of the sum of squares of the relative changes of mass and speed.
    detail : str
        Which other motion there is, or which assumption does not hold, where that is the trouble.
    after : str
        Grade of the trouble beyond the limit; "" where it is gone.
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
    rotor_mass: float
    speed_rpm: float
    distance: float
    detail: str = ""
    after: str = ""

    def towards(self) -> str:
        """Return the direction in words."""
        return _towards(self.axis, self.direction)

    def words(self) -> str:
        """Return such as "rubbing from 23,200 ± 100 rpm (+16 %)"."""
        half = 0.5 * (self.high - self.low)
        digits = -math.floor(math.log10(half * (1.0 + 1e-9))) if half > 0.0 else 3
        spread = math.ceil(half * 10.0**digits - 1e-9) / 10.0**digits  # never narrower
        shown = max(digits, 0)
        if self.axis == "both":
            unit = "times the mass"
            where = f"{self.rotor_mass:.4g} kg and {self.speed_rpm:,.0f} rpm"
        else:
            unit = "rpm" if self.axis == "speed" else "kg"
            where = f"{100.0 * self.change:+,.{0 if abs(self.change) >= 0.1 else 1}f} %"
        about = [self.detail] if self.detail else []
        if self.what in _TWO_GRADES and self.begins:
            about.append(GRADE_WORDS[self.grade])
        told = f" ({', '.join(about)})" if about else ""
        verb = "from" if self.begins else "ends at"
        if self.after and not self.begins:
            verb = f"no worse than {GRADE_WORDS[self.after]} from"
        return (
            f"{KINDS[self.what]}{told} "
            f"{verb} {round(self.value, digits):,.{shown}f} ± "
            f"{spread:,.{shown}f} {unit} ({where})"
        )


@dataclass(frozen=True)
class Line:
    """What was looked at from the operating point in one direction.

    Attributes
    ----------
    axis, direction : str
        Of :data:`DIRECTIONS`.
    end : float
        Last value solved: rpm, kg or factor of the mass.
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
        The nearest of each kind on each side, by rising distance.
    lines : tuple of Line
    beside : OperatingPoint or None
        Another motion at the same point, reached from a large orbit or from a neighbour.
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
        p, words = self.point, beside_words(self.beside) if self.beside else ""
        return assess(p.design, p.motion, p.rest, self.judged_by, words)

    def nearest(self, grade: str) -> Limit | None:
        """Return the nearest trouble to come of a grade, "watch" or "avoid"."""
        return next((x for x in self.limits if x.begins and x.grade == grade), None)

    def headline(self) -> str:
        """Return the margin in one sentence: that there is none where the point itself is to be
        avoided, the nearest trouble to be avoided, and the nearest to be watched if that is nearer.
        """
        avoid, watch = self.nearest("avoid"), self.nearest("watch")
        if watch and avoid and watch.distance >= avoid.distance:
            watch = None
        told = [f"going {x.towards()}, {x.words()}" for x in (avoid, watch) if x]
        if avoid and watch:
            told[1] = f"to be watched before: {told[1]}"
        further = "; ".join(told) or "no further trouble where it was looked for"
        here = ", ".join(KINDS[kind] for kind, grade in self.here.items() if grade == "avoid")
        none = f"none, the point itself is to be avoided ({here}); further on, " if here else ""
        told = [f"{none}{further}", *self._ends()]
        rest = self.point.rest
        if OUTSIDE in self.here and rest:
            broken = [a.name for a in rest.assumptions if a.watched and not a.holds]
            told.append(f"all of it outside the theory here ({', '.join(broken)})")
        return f"Solved margin: {'; '.join(told)}."

    def _ends(self) -> list[str]:
        """Return where each trouble that is to be avoided here is left nearest, in words."""
        places: dict[tuple[object, ...], list[Limit]] = {}
        for kind, grade in self.here.items():
            ends = (x for x in self.limits if x.what == kind and not x.begins)
            if grade == GRADES[AVOID] and (found := next(ends, None)):
                key = found.axis, found.direction, found.value, found.after
                places.setdefault(key, []).append(found)
        told = []
        for *others, last in places.values():
            words = last.words()
            if others:
                names = ", ".join(KINDS[x.what] for x in others)
                words = f"{names} and {words.replace(' ends at ', ' end at ')}"
            told.append(f"going {last.towards()}, {words}")
        return told

    def sentences(self) -> list[str]:
        """Describe what the point has, the limits in each direction and what was not looked at."""
        told = [f"Here already: {', '.join(KINDS[k] for k in self.here)}."] if self.here else []
        if _not_judged(self.point.rest):
            told.append("Resonance and stability at rest are not judged: no equilibrium is known.")
        if not self.point.design.rotor.conical:
            told.append("Conical motion is not judged: its moments of inertia are not given.")
        if self.beside:
            words = beside_words(self.beside)
            told.append(f"{capital(words)}.")
        told += [self._along(line) for line in self.lines]
        spacing = max((line.spacing for line in self.lines), default=0.0)
        told.append(
            f"Each limit lies between two of {self.solved} points solved from rest, those without "
            "anything to be avoided once more from a large orbit and from their neighbours' "
            "motions; a "
            f"window narrower than {100.0 * spacing:.0f} % of the value, the spacing of the lines, "
            "can be missed."
        )
        return told

    def _along(self, line: Line) -> str:
        begin = _towards(line.axis, line.direction).capitalize()
        end = {
            "speed": f"{line.end:,.0f} rpm",
            "mass": f"{line.end:.4g} kg",
            "both": f"{line.end:.3g} times the mass",
        }[line.axis]
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

        def limits(some: Iterable[Limit]) -> list[dict[str, Any]]:
            return [dataclasses.asdict(limit) | {"predicted": False} for limit in some]

        return self.point.record(self.judged_by) | {
            "assessment": judged.grade,
            "assessment_reasons": list(judged.reasons),
            "headline": self.headline(),
            "sentences": self.sentences(),
            "here": dict(self.here),
            "limits": limits(x for x in self.limits if x.axis != "both"),
            "limits_both": limits(x for x in self.limits if x.axis == "both"),
            "coexisting": beside_words(self.beside) if self.beside else None,
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
    return _nested(found, (LEAST_FILM, NEAR_FILM), (LARGE_ECCENTRICITY, RAISED_ECCENTRICITY))


def troubles_at_rest(rest: Derived, limits: Limits = DEFAULT_LIMITS) -> dict[str, str]:
    """Name what the assessment finds wrong with a static equilibrium; as
    :func:`troubles_of_motion`.
    """
    # a whirl that grows is damped less than lightly
    return _nested(_by_kind(rest_rules(rest, limits)), (UNSTABLE, LIGHTLY_DAMPED))


def _nested(found: dict[str, str], *pairs: tuple[str, str]) -> dict[str, str]:
    """Return the kinds with the second of each pair wherever its first is."""
    for grave, mild in pairs:
        if grave in found:
            found.setdefault(mild, GRADES[WATCH])
    return found


def _by_kind(rules: Iterable[Rule]) -> dict[str, str]:
    """Return the worst grade of each kind of :data:`KINDS` among the rules that hold."""
    worst: dict[str, int] = {}
    for rule in rules:
        if rule.holds and rule.kind != UNKNOWN:
            worst[rule.kind] = max(worst.get(rule.kind, rule.grade), rule.grade)
    return {kind: GRADES[grade] for kind, grade in worst.items()}


def _not_judged(rest: Derived | None) -> bool:
    return rest is None or rest.status != "ok"


def _towards(axis: str, direction: str) -> str:
    return _TOLD.get((axis, direction), f"{direction} in {axis}")


def _look(point: OperatingPoint, limits: Limits, starts: Iterable[np.ndarray] = ()) -> Found:
    """Judge a point, and look for another motion of it from a large orbit and from states given."""
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
    found = Found({name: kinds[name] for name in KINDS if name in kinds}, unknown, point)
    if found.is_bad:
        return found._replace(unknown=unknown | {COEXISTING})
    other = point.beside
    for start in starts:
        other = other or _carried(point, start)
    return found.with_beside(other)


def _carried(point: OperatingPoint, start: np.ndarray) -> OperatingPoint | None:
    """Go on from another state; return what it comes to if that is another motion."""
    where = point.design, point.rotor_mass, point.bearing_number
    return point.kept_beside(solve_point(*where, point.settings, start=start))


def _look_at(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings,
    limits: Limits,
    starts: Iterable[np.ndarray] = (),
) -> Found:
    return _look(solve_point(design, rotor_mass, bearing_number, settings), limits, starts)


def _look_here(
    design: Design, rotor_mass: float, bearing_number: float, settings: Settings, limits: Limits
) -> Found:
    """Judge the operating point itself: its other motion counts even where it is to be avoided."""
    found = _look_at(design, rotor_mass, bearing_number, settings, limits)
    return found.with_beside(found.point.beside)


def _ends(found: Found) -> list[np.ndarray]:
    """Return the last states of the motions of a point, that beside the one from rest first."""
    runs = (found.beside, found.point)
    return [p.trajectory.final for p in runs if p and p.trajectory.status == "ok"]


def _carry_on(line: list[Found]) -> list[Found]:
    """Carry states on along a line of points, in their order and back: where nothing is to be
    avoided, a run from what the neighbour does may lead to another motion than rest.
    """
    line = list(line)
    for order in (range(len(line)), range(len(line) - 1, -1, -1)):
        state: np.ndarray | None = None
        for k in order:
            if not line[k].is_bad and line[k].beside is None and state is not None:
                line[k] = line[k].with_beside(_carried(line[k].point, state))
            state = next(iter(_ends(line[k])), None)
    return line


class Side:
    """A line on one side of the operating point.

    Parameters
    ----------
    line : Line
    at : float
        The operating point's value: rpm, kg, or the factor 1.
    point : tuple
        The operating point: design, rotor mass in kg and bearing number.

    Attributes
    ----------
    found : dict of Found
        By value; the operating point's own belongs there before anything is asked.
    """

    def __init__(self, line: Line, at: float, point: tuple[Design, float, float]) -> None:
        self.line, self.at, self.point = line, at, point
        self.found: dict[float, Found] = {}

    @property
    def here(self) -> Found:
        """What is known of the operating point."""
        return self.found[self.at]

    def grid(self) -> list[float]:
        """Return the values to be solved first."""
        n = self.line.points
        ratio = (self.line.end / self.at) ** (1.0 / max(n, 1))
        return [self.at * ratio**k for k in range(1, n)] + [self.line.end] * (n > 0)

    def outward(self) -> list[float]:
        """Return the solved values, from the operating point on."""
        return sorted(self.found, key=lambda value: abs(value - self.at))

    def place(self, value: float) -> tuple[float, float]:
        """Return rotor mass and bearing number of a value."""
        design, rotor_mass, number = self.point
        axis, direction = self.line.axis, self.line.direction
        if axis == "mass":
            return value, number
        if axis == "speed":
            return rotor_mass, nearest_bearing_number(design, value)
        mass, speed = DIRECTIONS[axis][direction]
        return (
            _within(rotor_mass * value**mass, ROTOR_MASS_RANGE),
            _within(number * value**speed, BEARING_NUMBER_RANGE),
        )

    def starts(self, value: float) -> list[np.ndarray]:
        """Return the last states of the solved neighbours of a value."""
        near = [v for v in self.outward() if abs(v - self.at) < abs(value - self.at)][-1:]
        far = [v for v in self.outward() if abs(v - self.at) > abs(value - self.at)][:1]
        return [state for v in (*near, *far) for state in _ends(self.found[v])]

    def brackets(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Return the solved values, the nearer first, between which each kind first begins or ends,
        by (kind, "watch"), and those where it begins or ends to be avoided, by (kind, "avoid"),
        where these are others.
        """
        pairs = list(itertools.pairwise(self.outward()))
        found: dict[tuple[str, str], tuple[float, float]] = {}
        for kind in KINDS:
            for grade in GRADES[WATCH:]:
                pair = next((p for p in pairs if self._changed(kind, grade, p[1])), None)
                if pair is not None and found.get((kind, GRADES[WATCH])) != pair:
                    found[kind, grade] = pair
        return found

    def _changed(self, kind: str, grade: str, value: float) -> bool:
        """Whether a kind is there in that grade or a worse one at one of value and operating point
        alone.
        """
        found, least = self.found[value], GRADES.index(grade)
        there, here = (
            kind in kinds and GRADES.index(kinds[kind]) >= least
            for kinds in (found.kinds, self.here.kinds)
        )
        return kind not in found.unknown and there != here

    def middles(self, precision: float) -> list[float]:
        """Return the middles of the brackets that are still too wide."""
        pairs = {
            pair
            for (kind, _), pair in self.brackets().items()
            if max(pair) - min(pair) > precision * min(pair) * self._roughness(kind, pair)
        }
        return sorted(0.5 * (near + far) for near, far in pairs)

    def _roughness(self, kind: str, values: tuple[float, float]) -> float:
        """Return times the precision: where all of them rub or fail it is of little use which
        motion does so or how the rotor would rest, and runs take 50 times as long; so do those of
        another motion that rubs.
        """
        if kind == COEXISTING:
            return ROUGH
        rub = all(self.found[value].kinds.keys() & {RUBBING, FAILED} for value in values)
        return ROUGH if rub and kind in _ROUGH else 1.0

    def limits(self) -> list[Limit]:
        """Return the first change of each kind."""
        told = []
        design, rotor_mass, bearing_number = self.point
        for (kind, grade), (near, far) in self.brackets().items():
            before, beyond = (
                found.kinds.get(kind, GRADES[0]) for found in (self.here, self.found[far])
            )
            begins = GRADES.index(before) < GRADES.index(grade)
            value = 0.5 * (near + far)
            there = self.found[far] if begins else self.here
            mass, number = self.place(value)
            changes = mass / rotor_mass - 1.0, number / bearing_number - 1.0
            told.append(
                Limit(
                    self.line.axis,
                    self.line.direction,
                    kind,
                    value,
                    min(near, far),
                    max(near, far),
                    begins,
                    there.kinds[kind],
                    value / self.at - 1.0,
                    mass,
                    design.speed_rpm(number),
                    math.hypot(*changes),
                    _detail(kind, there),
                    "" if beyond == GRADES[0] else beyond,
                )
            )
        return told


def _within(value: float, ends: tuple[float, float]) -> float:
    """Return a value on the edge of a range that rounding took out of it."""
    return min(max(value, ends[0]), ends[1])


def _detail(kind: str, found: Found) -> str:
    """Return which assumption does not hold, or what another motion is, in a few words."""
    rest, other = found.point.rest, found.beside
    if kind == OUTSIDE and rest:
        return next((a.name for a in rest.assumptions if a.watched and not a.holds), "")
    if kind != COEXISTING:
        return ""
    if other is None or other.regime is None:
        return "a failed run"
    words = motion_words(other.regime.name, other.regime.period)
    return f"{100.0 * other.max_eccentricity:.0f} % of the clearance, {small(words)}"


def check_solved_margin(points: int, precision: float) -> None:
    """Raise :class:`InputError` for numbers of :func:`solve_margin` out of range."""
    check_whole("points", points, *POINTS_RANGE)
    check_number("precision", precision, *PRECISION_RANGE)


def solve_margin(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings | None = None,
    limits: Limits = DEFAULT_LIMITS,
    *,
    points: int = POINTS,
    span: tuple[float, float] = SPAN,
    precision: float = PRECISION,
    axes: Collection[str] = tuple(DIRECTIONS),
    workers: int = 1,
    pool: futures.Executor | None = None,
    progress: Progress | None = None,
) -> SolvedMargin:
    """Solve the limits of an operating point in speed, in mass and in both.

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
        On each side of the point; half as many on the axis "both".
    span : tuple of float
        Ends of the lines over the point's value, below and above one; within what is allowed, and
        on the axis "both" within :data:`SPAN_BOTH`.
    precision : float
        Largest width of a limit's bracket, over its value; ten times that for regimes, orbits and
        trouble at rest between two points that rub or fail.
    axes : collection of str
        Of :data:`DIRECTIONS`: along which to look.
    workers : int
        Processes.
    pool : Executor, optional
        Solves the points instead; what its ``submit`` raises ends the search.
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
    if not axes:
        raise DesignError(f"give at least one axis of {', '.join(DIRECTIONS)}")
    for axis in axes:
        check_choice("axis", axis, DIRECTIONS)
    settings = settings or Settings()
    where = design, rotor_mass, bearing_number
    sides = [side for side in _sides(where, points, span) if side.line.axis in axes]

    with executor(workers, settings, design) if pool is None else nullcontext(pool) as solvers:
        opening = solvers.submit(_look_here, *where, settings, limits)

        def start(side: Side, value: float, starts: Iterable[np.ndarray]) -> futures.Future[Found]:
            place = side.place(value)
            run = solvers.submit(_look_at, design, *place, settings, limits, tuple(starts))
            if progress:
                run.add_done_callback(lambda _: progress(1))
            return run

        def solve(side: Side, values: list[float], carried: bool) -> Iterator[_Runs]:
            """Solve the values, then middles of brackets until they are narrow."""
            while values:
                runs = [start(side, v, side.starts(v) if carried else ()) for v in values]
                yield [opening, *runs]
                side.found.setdefault(side.at, opening.result())
                side.found.update(zip(values, (run.result() for run in runs), strict=True))
                values = side.middles(precision)
            side.found.setdefault(side.at, opening.result())

        # each line goes on as its own points are there: a slow one elsewhere keeps none waiting
        _together(solve(side, side.grid(), False) for side in sides)
        here = _carry_on_all(solvers, sides)
        _together(solve(side, side.middles(precision), True) for side in sides)
    return SolvedMargin(
        here.point,
        here.kinds,
        tuple(sorted((x for side in sides for x in side.limits()), key=lambda x: x.distance)),
        tuple(side.line for side in sides),
        here.beside,
        limits,
        sum(len(side.found) - 1 for side in sides) + 1,
        time.perf_counter() - began,
    )


def _together(tasks: Iterable[Iterator[_Runs]]) -> None:
    """Run tasks side by side, each of which yields the runs that it waits for."""
    waiting: list[tuple[Iterator[_Runs], _Runs]] = [(task, []) for task in tasks]
    while waiting:
        left = []
        for task, runs in waiting:
            waits_for: _Runs | None = runs
            while waits_for is not None and all(run.done() for run in waits_for):
                waits_for = next(task, None)
            if waits_for is not None:
                left.append((task, waits_for))
        waiting = left
        undone = [run for _, runs in waiting for run in runs if not run.done()]
        futures.wait(undone, return_when=futures.FIRST_COMPLETED)


def _sides(
    where: tuple[Design, float, float], points: int, span: tuple[float, float]
) -> list[Side]:
    design, mass, number = where
    rpm = design.speed_rpm(1.0)
    speed = number * rpm
    speeds = (BEARING_NUMBER_RANGE[0] * rpm, BEARING_NUMBER_RANGE[1] * rpm)
    both = max(span[0], SPAN_BOTH[0]), min(span[1], SPAN_BOTH[1])
    sides = []
    for axis, directions in DIRECTIONS.items():
        at = {"speed": speed, "mass": mass, "both": 1.0}[axis]
        for direction, powers in directions.items():
            ends, count = (both, max(points // 2, 1)) if axis == "both" else (span, points)
            factor = ends[direction not in _DOWN]
            for value, power, allowed in zip(
                (mass, speed), powers, (ROTOR_MASS_RANGE, speeds), strict=True
            ):
                if power:  # up to the edge of what is allowed
                    edges = sorted((end / value) ** power for end in allowed)
                    factor = min(max(factor, edges[0]), edges[1])
            spacing = abs(factor ** (1.0 / count) - 1.0)
            moves = spacing > _STILL
            line = Line(
                axis, direction, at * factor, count if moves else 0, spacing if moves else 0.0
            )
            sides.append(Side(line, at, where))
    return sides


def _carry_on_all(pool: futures.Executor, sides: list[Side]) -> Found:
    """Carry states on along every line, each of two sides; return what is known of the operating
    point then.
    """
    here, runs = sides[0].here, []
    pairs = [(a, b) for a, b in itertools.pairwise(sides) if a.line.direction in _DOWN]
    for down, up in pairs:
        below, above = down.outward()[:0:-1], up.outward()[1:]
        line = [*(down.found[v] for v in below), here, *(up.found[v] for v in above)]
        runs.append((down, below, up, above, pool.submit(_carry_on, line)))
    for down, below, up, above, run in runs:
        line = run.result()
        for side, values, found in (
            (down, below, line[: len(below)]),
            (up, above, line[len(below) + 1 :]),
        ):
            side.found.update(zip(values, found, strict=True))
        here = here if here.beside else here.with_beside(line[len(below)].beside)
    for side in sides:
        side.found[side.at] = here
    return here
