"""What a motion is worth to a designer: good, to be watched, or to be avoided, and why
(docs/assessment.md).

The rules of a motion are written once, on arrays: a point has single values, a map many."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from spab_core.common.validation import check_number
from spab_core.common.words import small
from spab_core.design.model import Design
from spab_core.linear_theory.assumptions import Assumption
from spab_core.linear_theory.modes import LEAST_AMPLIFICATION
from spab_core.linear_theory.summary import Derived, grows_words
from spab_core.solver.stepping import STATUS_TEXT

GRADES = ("good", "watch", "avoid")  # by rising gravity
GOOD, WATCH, AVOID = range(len(GRADES))
GRADE_WORDS = {"good": "good", "watch": "to be watched", "avoid": "not recommended"}
# kinds of trouble: of the motion, then at rest, then what is not known
FAILED, RUBBING, CHAOTIC, UNDECIDED = "failed run", "contact", "chaotic", "undecided"
QUASI_PERIODIC, SUBHARMONIC = "quasi-periodic", "subharmonic"
LEAST_FILM, NEAR_FILM = "least film", "film near its limit"
LARGE_ECCENTRICITY, RAISED_ECCENTRICITY = "large eccentricity", "raised eccentricity"
LARGE_ORBIT = "large orbit"
NOT_LIFTED, RESONANCE = "not lifted off", "resonance"
UNSTABLE, LIGHTLY_DAMPED = "unstable at rest", "lightly damped at rest"
OUTSIDE = "outside the theory"
COEXISTING = "another motion"
UNKNOWN = "not known"
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
    OUTSIDE: "conditions outside the theory",
    COEXISTING: "another motion beside the one from rest",
    UNKNOWN: "something that is not known",
}
CONTACT = 0.001  # largest share of the time in contact
NEAR = 1.5  # a film is watched up to this many times its limit
FEWEST_MICRONS, ASPERITIES = 3e-6, 5.0  # of the usual limit of the film: m, roughness lengths
LIGHT = 0.1  # logarithmic decrement under which a whirl is lightly damped
RESONANT = 8.0  # amplification from which on a speed near the mode is avoided


# allowed for what a designer allows: µm; over the clearance; times the margin of API 617
LEAST_FILMS, ECCENTRICITIES = (0.0, 1000.0), (0.05, 1.0)
ORBITS, SEPARATIONS = (0.01, 1.0), (0.0, 5.0)


@dataclass(frozen=True)
class Limits:
    """What a designer allows.

    Attributes
    ----------
    least_film : float or None
        Thinnest film, m; None: the larger of 3 µm and five roughness lengths of the wall.
    eccentricity : float
        Largest eccentricity, over C, that is not to be avoided.
    calm_eccentricity : float
        Largest eccentricity that needs no watching; at most ``eccentricity``.
    orbit : float
        Largest orbit, half the longer side of the rectangle around it over C: of a subharmonic or
        quasi-periodic whirl, which is avoided beyond it, and of a period 1, which is watched.
    separation : float
        Of a lightly damped vibration from the shaft speed, in times API 617's separation margin;
        0: resonance is not judged.

    Raises
    ------
    DesignError
        For a value out of range.
    """

    least_film: float | None = None
    eccentricity: float = 0.8
    calm_eccentricity: float = 0.5
    orbit: float = 0.5
    separation: float = 1.0

    def __post_init__(self) -> None:
        if self.least_film is not None:
            check_number("least film", 1e6 * self.least_film, *LEAST_FILMS, "µm")
        check_number("largest eccentricity", self.eccentricity, *ECCENTRICITIES)
        check_number("calm eccentricity", self.calm_eccentricity, 0.0, self.eccentricity)
        check_number("largest orbit", self.orbit, *ORBITS)
        check_number("separation", self.separation, *SEPARATIONS)

    def film(self, design: Design) -> float:
        """Return the thinnest film allowed in a design, m."""
        if self.least_film is not None:
            return self.least_film
        b = design.bearing
        return max(FEWEST_MICRONS, ASPERITIES * design.contact.roughness * b.clearance)


DEFAULT_LIMITS = Limits()


@dataclass(frozen=True)
class Assessment:
    """A grade and why.

    Attributes
    ----------
    grade : str
        One of :data:`GRADES`.
    reasons : tuple of str
        By falling gravity, with number and limit; each begins small and has no full stop. Empty
        where everything is good.
    kinds : tuple of str
        Kind of trouble of each reason.
    motion, rest : str
        What the rotor does with unbalance, and at rest on its film without it, in a sentence each.
    """

    grade: str
    reasons: tuple[str, ...]
    kinds: tuple[str, ...]
    motion: str
    rest: str

    @property
    def words(self) -> str:
        """The grade in words."""
        return GRADE_WORDS[self.grade]


class Rule(NamedTuple):
    """A rule that may hold: what kind of trouble it finds, how grave that is, where it holds, what
    to say there.
    """

    kind: str
    grade: int
    holds: np.ndarray | bool
    words: Callable[[], str]


class Motion(NamedTuple):
    """What the rules look at: single values, or arrays of one shape, by the names of a map's."""

    regime: np.ndarray | str
    period: np.ndarray | int
    status: np.ndarray | str
    contact_share: np.ndarray | float
    max_eccentricity: np.ndarray | float
    orbit_amplitude: np.ndarray | float
    thin_film_share: np.ndarray | float


def motion_words(regime: str, period: int, status: str = "ok") -> str:
    """Return a motion in words that a designer has for it; without a full stop."""
    if not regime:
        return f"The run failed ({STATUS_TEXT[status]})"
    if period == 2:
        return "Half-speed whirl, locked to the rotation"
    if period > 2:
        return f"Whirl locked to the rotation, which repeats every {period} revolutions"
    return {
        "periodic": "Repeats every revolution",
        "quasi-periodic": "Whirl of its own frequency (quasi-periodic)",
        "chaotic": "Chaotic: never repeats, and its loads are not predictable",
        "undecided": "Undecided: it does not repeat, and its exponent is neither clearly zero nor "
        "clearly positive (measure more revolutions)",
    }[regime]


def motion_rules(design: Design, motion: Motion, limits: Limits = DEFAULT_LIMITS) -> Iterator[Rule]:
    """Yield the rules of a motion, the gravest first.

    Parameters
    ----------
    design : Design
    motion : Motion
        nan stands for what is not known; an unknown orbit counts as large as its eccentricity,
        which it cannot exceed.
    limits : Limits
    """
    m = motion
    contact, eccentricity = np.asarray(m.contact_share), np.asarray(m.max_eccentricity)
    orbit = np.where(np.isnan(m.orbit_amplitude), eccentricity, m.orbit_amplitude)
    thin = np.asarray(m.thin_film_share)
    regime, period = np.asarray(m.regime), np.asarray(m.period)
    ok = np.asarray(m.status) == "ok"
    subharmonic = ok & (regime == "periodic") & (period != 1)
    torus = ok & (regime == "quasi-periodic")
    whirls, large = {QUASI_PERIODIC: torus, SUBHARMONIC: subharmonic}, orbit > limits.orbit
    clearance, least = design.bearing.clearance, limits.film(design)
    film = clearance * (1.0 - eccentricity)

    def told() -> str:
        words = motion_words(str(m.regime), int(m.period), str(m.status))
        return small(words)

    def orbit_words() -> str:
        known = "" if not np.isnan(m.orbit_amplitude) else "at most "
        return f"{known}{100 * orbit:.0f} % of the clearance, limit {100 * limits.orbit:.0f} %"

    def whirl_words() -> str:
        return f"{told()}: {orbit_words()}"

    def eccentricity_words(limit: float) -> str:
        often = f", over 0.9 in {100 * thin:.1f} % of the time" if thin > 0.0005 else ""
        return f"largest eccentricity {eccentricity:.3f}, limit {limit:.2f}{often}"

    yield Rule(FAILED, AVOID, ~ok, told)
    yield Rule(CHAOTIC, AVOID, ok & (regime == "chaotic"), told)
    yield Rule(
        RUBBING,
        AVOID,
        ok & (contact > CONTACT),
        lambda: f"contact share {100 * contact:.3g} %, limit {100 * CONTACT:g} %",
    )
    for kind, where in whirls.items():
        yield Rule(kind, AVOID, where & large, whirl_words)
    yield Rule(
        LEAST_FILM,
        AVOID,
        ok & (film < least),
        lambda: f"least film {1e6 * film:.1f} µm, limit {1e6 * least:.1f} µm",
    )
    yield Rule(
        LARGE_ECCENTRICITY,
        AVOID,
        ok & (eccentricity > limits.eccentricity),
        lambda: eccentricity_words(limits.eccentricity),
    )
    yield Rule(UNDECIDED, WATCH, ok & (regime == "undecided"), told)
    for kind, where in whirls.items():
        yield Rule(kind, WATCH, where & ~large, whirl_words)
    yield Rule(
        LARGE_ORBIT,
        WATCH,
        ok & (regime == "periodic") & (period == 1) & large,
        lambda: f"large orbit: {orbit_words()}",
    )
    yield Rule(
        NEAR_FILM,
        WATCH,
        ok & (film >= least) & (film < NEAR * least),
        lambda: (
            f"least film {1e6 * film:.1f} µm, within {NEAR:g} of the limit {1e6 * least:.1f} µm"
        ),
    )
    yield Rule(
        RAISED_ECCENTRICITY,
        WATCH,
        ok & (eccentricity > limits.calm_eccentricity) & (eccentricity <= limits.eccentricity),
        lambda: eccentricity_words(limits.calm_eccentricity),
    )
    yield Rule(
        UNKNOWN,
        WATCH,
        ok & (np.isnan(contact) | np.isnan(eccentricity)),
        lambda: "contact and eccentricity are not known",
    )


def rest_rules(rest: Derived | None, limits: Limits = DEFAULT_LIMITS) -> Iterator[Rule]:
    """Yield the rules of linear theory about the static equilibrium, the gravest first; ``rest`` is
    None where nothing is known of it.
    """
    if rest is None:
        words = "resonance is not judged: no result of linear theory"
        yield Rule(UNKNOWN, WATCH, True, lambda: words)
        return
    if rest.status != "ok":
        yield Rule(UNKNOWN, WATCH, True, lambda: f"resonance is not judged: {rest.status}")
        return
    yield Rule(NOT_LIFTED, AVOID, rest.lies_on_wall, rest.lift_words)
    both = [("a whirl", m) for m in rest.modes]
    both += [("a conical whirl", m) for m in rest.conical_modes]
    forward = [(name, m) for name, m in both if m.forward and m.log_decrement > 0.0]
    along = [m for m in rest.axial_modes if m.log_decrement > 0.0]
    driven = [(name, m, m.amplification) for name, m in forward]
    driven += [("a vibration along the axis", m, m.axial_amplification) for m in along]
    for name, mode, factor in driven:
        away = abs(mode.ratio - 1.0)
        margin = limits.separation * separation_margin(mode.ratio, factor)
        yield Rule(
            RESONANCE,
            AVOID if factor > RESONANT and away < margin / 3.0 else WATCH,
            away < margin,
            partial(_resonance_words, name, mode.ratio, factor, margin, rest.speed_rpm),
        )
    if rest.leading and not rest.leading[1].stable:
        words = f"unstable at rest: {grows_words(*rest.leading)}"
        yield Rule(UNSTABLE, WATCH, True, lambda: words)
    for one in rest.assumptions:
        yield Rule(OUTSIDE, WATCH, one.watched and not one.holds, partial(_words_of, one))
    # only what is slower than the shaft can be fed by its rotation; the supply may feed what moves
    # along the axis
    slow = [m.log_decrement for _, m in forward if m.ratio < 1.0]
    slow += [m.log_decrement for m in along]
    if slow and min(slow) < LIGHT:
        yield Rule(
            LIGHTLY_DAMPED,
            WATCH,
            True,
            lambda: (
                f"lightly damped at rest: logarithmic decrement {min(slow):.3f}, limit {LIGHT:g}"
            ),
        )


def _words_of(assumption: Assumption) -> str:
    return f"outside the theory: {assumption.words}"


def _resonance_words(
    name: str, ratio: float, factor: float, margin: float, speed_rpm: float
) -> str:
    return (
        f"resonance: {name} at {ratio * speed_rpm:,.0f} cycles/min with the amplification "
        f"{factor:.1f} is {100 * abs(ratio - 1.0):.1f} % from the speed, limit "
        f"{100 * margin:.0f} %"
    )


def separation_margin(ratio: float, factor: float) -> float:
    """Return the separation of a vibration from the shaft speed that API 617 (chapter 1,
    unbalance response) asks for, over the speed.

    With the amplification AF it is 17 % (1 - 1/(AF - 1.5)) where the vibration is slower, 10 % more
    where it is faster, nothing where AF < 2.5.

    Parameters
    ----------
    ratio : float
        The vibration's frequency over the shaft speed.
    factor : float
        Its amplification AF.
    """
    if factor < LEAST_AMPLIFICATION:
        return 0.0
    margin = 0.17 * (1.0 - 1.0 / (factor - 1.5))
    return margin if ratio < 1.0 else 0.10 + margin


def assess(
    design: Design,
    motion: Motion | None,
    rest: Derived | None = None,
    limits: Limits = DEFAULT_LIMITS,
    beside: str = "",
) -> Assessment:
    """Judge an operating point.

    Parameters
    ----------
    design : Design
    motion : Motion or None
        Of single values; None where it is not solved.
    rest : Derived or None
        Of the static equilibrium; None where nothing is known of it. What is not known is said, and
        never good.
    limits : Limits
    beside : str
        What another motion of the same point is, as a clause: two motions are to be watched.

    Returns
    -------
    Assessment
    """
    if motion is None:
        rules = [Rule(UNKNOWN, WATCH, True, lambda: "the motion with unbalance is not solved")]
        if rest is not None and rest.status != "ok":
            rules.insert(0, Rule(FAILED, AVOID, True, lambda: rest.status))
    else:
        rules = list(motion_rules(design, motion, limits))
    rules += rest_rules(rest, limits)
    rules.append(Rule(COEXISTING, WATCH, bool(beside), lambda: beside))
    found = sorted((r for r in rules if r.holds), key=lambda r: -r.grade)
    grade = GRADES[max((r.grade for r in found), default=GOOD)]
    return Assessment(
        grade,
        tuple(r.words() for r in found),
        tuple(r.kind for r in found),
        _motion_line(design, motion, grade),
        rest.verdict() if rest else "At rest: not known.",
    )


def _motion_line(design: Design, motion: Motion | None, grade: str) -> str:
    if motion is None:
        return f"The motion with unbalance is not solved: {GRADE_WORDS[grade]}."
    words = motion_words(str(motion.regime), int(motion.period), str(motion.status))
    e = float(motion.max_eccentricity)
    if motion.regime and not math.isnan(e):
        film = 1e6 * design.bearing.clearance * (1.0 - e)
        words += f"; {100 * e:.0f} % of the clearance, least film {film:.1f} µm"
    return f"{words}: {GRADE_WORDS[grade]}."


def grades(design: Design, motions: Motion, limits: Limits = DEFAULT_LIMITS) -> np.ndarray:
    """Judge many motions by their own rules alone, without linear theory.

    Parameters
    ----------
    design : Design
    motions : Motion
        Arrays of one shape.
    limits : Limits

    Returns
    -------
    ndarray of str
        Of :data:`GRADES`, in the same shape.
    """
    return gravest(design, motions, limits)[0]


def gravest(
    design: Design, motions: Motion, limits: Limits = DEFAULT_LIMITS
) -> tuple[np.ndarray, np.ndarray]:
    """Judge many motions by their own rules alone, and name the gravest trouble of each.

    Parameters are those of :func:`grades`.

    Returns
    -------
    grades : ndarray of str
        Of :data:`GRADES`, in the motions' shape.
    kinds : ndarray of str
        The kind of the gravest rule that holds, likewise; "" where everything is good.
    """
    shape = np.shape(motions.regime)
    worst, kinds = np.full(shape, GOOD), np.full(shape, "", "<U32")
    for rule in motion_rules(design, motions, limits):
        graver = rule.holds & (worst < rule.grade)
        kinds = np.where(graver, rule.kind, kinds)
        worst = np.where(graver, rule.grade, worst)
    return np.array(GRADES)[worst], kinds
