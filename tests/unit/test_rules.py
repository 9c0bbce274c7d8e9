"""Every rule of docs/assessment.md, in all places that judge: a verdict at rest, a live point, a
map, a line and its table, the margin; and the numbers that the document says."""

import dataclasses
import math
import re

import numpy as np
import pytest

from spab_core import Settings
from spab_core.design.model import save_design
from spab_core.linear_theory.assumptions import Assumption
from spab_core.linear_theory.modes import Mode
from spab_core.linear_theory.summary import Whirl, derive
from spab_core.maps.bifurcation import Bifurcation, Branch, interval_table, line_table
from spab_core.maps.solved_margin import _look, troubles_at_rest, troubles_of_motion
from spab_core.maps.stability_map import StabilityMap
from spab_core.solver.film import AUTO
from spab_core.trajectory import assessment
from spab_core.trajectory.assessment import DEFAULT_LIMITS, KINDS, Limits, Motion, assess
from spab_core.trajectory.lyapunov import Exponent
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.regimes import Regime
from spab_core.trajectory.run import Trajectory
from tests.commands import answer
from tests.conftest import ROOT

DOCUMENT = (ROOT / "docs" / "assessment.md").read_text("utf-8")
CALM = Motion("periodic", 1, "ok", 0.0, 0.2, 0.1, 0.0)
# what a calm motion is changed by, the kind of trouble that is, its grade
OF_MOTION = [
    ({"status": "touchdown", "regime": "", "period": 0}, "failed run", "avoid"),
    ({"contact_share": 0.0011}, "contact", "avoid"),
    ({"regime": "chaotic", "period": 0}, "chaotic", "avoid"),
    ({"regime": "quasi-periodic", "period": 0, "orbit_amplitude": 0.51}, "quasi-periodic", "avoid"),
    ({"regime": "quasi-periodic", "period": 0}, "quasi-periodic", "watch"),
    ({"period": 2, "orbit_amplitude": 0.51}, "subharmonic", "avoid"),
    ({"period": 2}, "subharmonic", "watch"),
    ({"regime": "undecided", "period": 0}, "undecided", "watch"),
    ({"orbit_amplitude": 0.51}, "large orbit", "watch"),
    ({"max_eccentricity": 0.901}, "least film", "avoid"),  # 3.465 of 35 um
    ({"max_eccentricity": 0.81}, "large eccentricity", "avoid"),
    ({"max_eccentricity": 0.51}, "raised eccentricity", "watch"),
    ({}, "", "good"),
]
FAST = Assumption("Mach number of the surface", 0.6, 0.5, "", "the film is not isothermal")
AT_REST = [
    ({"contact_load_share": 0.11}, "not lifted off", "avoid"),
    ({"modes": (Mode(1.02, -math.pi / 18.0 * 1.02, True),)}, "resonance", "avoid"),
    ({"modes": (Mode(1.2, -math.pi / 18.0 * 1.2, True),)}, "resonance", "watch"),
    ({"modes": (Mode(0.5, -0.09 * 0.5, True),)}, "lightly damped at rest", "watch"),
    ({"whirl": Whirl(0.48, 4947.0, 0.326)}, "unstable at rest", "watch"),
    ({"assumptions": (FAST,)}, "outside the theory", "watch"),
    ({"status": "no static equilibrium"}, "not known", "watch"),
    ({}, "", "good"),
]


@pytest.fixture(scope="module")
def calm_rest(design):
    found = derive(design, 4.0, 3.0)
    return dataclasses.replace(
        found, whirl=Whirl(0.5, 5000.0, -1.0), modes=(), contact_load_share=0.0
    )


def live(design, motion, rest):
    """An operating point that does so, with no other motion beside it."""
    rows = 20 * (motion.status == "ok")

    def of(value):
        return np.full(rows, value)

    half = motion.orbit_amplitude
    trajectory = Trajectory(
        motion.status,
        40,
        np.zeros((rows, 8)),
        of(0.0),
        of(motion.contact_share),
        of(motion.thin_film_share),
        of(motion.max_eccentricity),
        of(0.0),
        np.tile([-half, half, 0.0, 0.0], (rows, 1)),
        np.zeros((0, 96, 8)),
        AUTO,
        1,
        0.0,
        np.zeros(8),
    )
    regime = Regime(motion.regime, motion.period) if motion.regime else None
    mle = Exponent(0.0, 0.0, np.zeros(1)) if regime else None
    point = OperatingPoint(design, 4.0, 3.0, Settings(), trajectory, mle, regime)
    vars(point).update(rest=rest, beside=None)
    return point


def cells(motion, shape):
    names = Motion._fields
    return {name: np.full(shape, getattr(motion, name)) for name in names} | {
        "mle": np.full(shape, np.nan if motion.status != "ok" else 0.0),
        "mle_standard_error": np.zeros(shape),
        "peak_contact_force": np.zeros(shape),
    }


@pytest.mark.parametrize(("change", "kind", "grade"), OF_MOTION)
def test_a_rule_of_the_motion_holds_wherever_motions_are_judged(
    design, calm_rest, change, kind, grade
):
    motion = CALM._replace(**change)
    found = assess(design, motion, calm_rest)
    assert found.grade == grade and next(iter(found.kinds), "") == kind
    point = live(design, motion, calm_rest)
    assert point.assessment() == found
    record = point.record()
    assert record["assessment"] == grade and record["regime"] == (motion.regime or None)
    about = {"design": design.to_dict()}
    m = StabilityMap(
        np.array([3.0]),
        np.array([4.0]),
        **cells(motion, (1, 1)),
        revolutions=np.ones((1, 1), int),
        metadata=about,
    )
    assert m.grades() == grade
    branch = Branch(section=np.zeros((2, 60, 4), np.float32), **cells(motion, 2))
    line = Bifurcation("bearing-number", 4.0, np.array([3.0, 3.1]), {"up": branch}, about)
    assert set(line_table(line)["why"]) == {kind}
    (band,) = interval_table(line, ["up"]).to_dict("records")
    assert band["assessment"] == grade and band["why"] == KINDS.get(kind, "")
    assert troubles_of_motion(design, motion).get(kind, "good") == grade
    assert _look(point, DEFAULT_LIMITS).kinds.get(kind, "good") == grade


@pytest.mark.parametrize(("change", "kind", "grade"), AT_REST)
def test_a_rule_at_rest_holds_wherever_equilibria_are_judged(
    design, calm_rest, change, kind, grade
):
    rest = dataclasses.replace(calm_rest, **change)
    found = assess(design, CALM, rest)
    assert found.grade == grade and next(iter(found.kinds), "") == kind
    assert live(design, CALM, rest).assessment() == found
    if kind != "not known":
        assert troubles_at_rest(rest).get(kind, "good") == grade
        assert _look(live(design, CALM, rest), DEFAULT_LIMITS).kinds.get(kind, "good") == grade
    else:  # the margin does not know what is not there
        looked = _look(live(design, CALM, rest), DEFAULT_LIMITS)
        assert {"resonance", "not lifted off"} <= looked.unknown


def test_a_film_near_its_limit_is_watched_everywhere(design, calm_rest):
    """At a limit of 20 um, e 0.4 leaves 21 of 35 um."""
    limits, motion = Limits(least_film=20e-6), CALM._replace(max_eccentricity=0.4)
    found = assess(design, motion, calm_rest, limits)
    assert (found.grade, found.kinds) == ("watch", ("film near its limit",))
    assert troubles_of_motion(design, motion, limits) == {"film near its limit": "watch"}


def test_another_motion_is_watched_and_named(design, calm_rest):
    point = live(design, CALM, calm_rest)
    whirl = CALM._replace(regime="quasi-periodic", period=0, max_eccentricity=0.83)
    other = dataclasses.replace(live(design, whirl, calm_rest), from_rest=False)
    vars(point)["beside"] = other
    found = point.assessment()
    assert (found.grade, found.kinds) == ("watch", ("another motion",))
    assert "83 % of the clearance exists beside it, reached from a large orbit" in found.reasons[0]
    assert found.motion.endswith(": to be watched.")
    assert point.record()["coexisting"] == found.reasons[0]
    assert _look(point, DEFAULT_LIMITS).kinds == {"another motion": "watch"}


def test_every_kind_has_a_test():
    told = {kind for _, kind, _ in [*OF_MOTION, *AT_REST]} - {""}
    assert told | {"film near its limit", "another motion"} == set(KINDS)


def test_the_document_says_the_numbers_of_the_code():
    for words, number in (
        (r"in more than ([\d.]+) % of the time", 100.0 * assessment.CONTACT),
        (r"within ([\d.]+) of the limit", assessment.NEAR),
        (r"the larger of ([\d.]+) µm and five", 1e6 * assessment.FEWEST_MICRONS),
        (r"whose orbit is larger than ([\d.]+) C", DEFAULT_LIMITS.orbit),
        (r"\| over ([\d.]+) \| over [\d.]+ \|", DEFAULT_LIMITS.calm_eccentricity),
        (r"\| over [\d.]+ \| over ([\d.]+) \|", DEFAULT_LIMITS.eccentricity),
        (r"its amplification is over ([\d.]+)", assessment.RESONANT),
        (r"a logarithmic decrement under ([\d.]+)", assessment.LIGHT),
        (r"nothing for an amplification under ([\d.]+)", assessment.LEAST_AMPLIFICATION),
    ):
        (found,) = set(re.findall(words, DOCUMENT))
        assert float(found) == pytest.approx(number), words
    assert assessment.ASPERITIES == 5.0


KEYS = {
    "assessment",
    "assessment_reasons",
    "least_film_m",
    "contact_share",
    "thin_film_share",
    "peak_contact_force_n",
    "regime",
    "coexisting",
}
BARE = {"contact__force_at_closure": 0.0}
FLOATS = {"rotor__gravity": 0.0}


@pytest.mark.parametrize(
    ("change", "mass", "number", "share", "regime"),
    [
        ({}, 25.0, 0.2023, 0.975, "periodic"),  # not lifted off
        (BARE, 25.0, 0.5, None, None),  # touches down, and has no equilibrium
        (FLOATS, 4.0, 3.0, 0.0, "quasi-periodic"),  # weightless
    ],
)
def test_commands_answer_with_every_key(
    capsys, design, tmp_path, change, mass, number, share, regime
):
    file = str(tmp_path / "d.toml")
    save_design(design.replace(**change), file)
    given = ("--design", file, "--rotor-mass", str(mass), "--bearing-number", str(number))
    shown = answer(capsys, "design", "show", *given)
    short = ("--transient", "100", "--revolutions", "100")
    solved = answer(capsys, "simulate", *given, *short)
    line = ("--points", "2", "--precision", "0.1", "--transient", "30", "--revolutions", "20")
    margin = answer(capsys, "margin", *given, *line)
    for found in (shown, solved, margin):
        assert found.keys() >= KEYS and found["assessment"] == "avoid"
        assert found["assessment_reasons"] and all(found["assessment_reasons"])
    assert shown["contact_load_share"] == (share and pytest.approx(share, abs=2e-3))
    assert shown["regime"] == solved["regime"] == regime
    for found in (solved, margin):
        assert (found["least_film_m"] is None) == (found["contact_share"] is None)
        assert (found["regime"] is None) == (found["least_film_m"] is None)
    assert {limit["axis"] for limit in margin["limits"]} <= {"speed", "mass"}
    for limit in margin["limits"] + margin["limits_both"]:
        assert limit["axis"] in ("speed", "mass", "both") and limit["what"] in KINDS
        assert limit["low"] <= limit["value"] <= limit["high"] and not limit["predicted"]
