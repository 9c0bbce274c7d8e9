"""What a motion is worth: each rule alone, its limits, points and maps alike."""

import dataclasses
import math

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.common.errors import DesignError
from spab_core.linear_theory.modes import Mode
from spab_core.linear_theory.summary import Whirl, derive
from spab_core.maps.compute import compute_map
from spab_core.trajectory.assessment import (
    DEFAULT_LIMITS,
    GRADES,
    Limits,
    Motion,
    assess,
    grades,
    separation_margin,
)
from spab_core.trajectory.regimes import Regime

CALM = Motion("periodic", 1, "ok", 0.0, 0.2, 0.1, 0.0)
CASES = [  # change to a calm motion, grade, words in the first reason
    ({}, "good", None),
    ({"status": "touchdown", "regime": "", "period": 0}, "avoid", "the journal touched the wall"),
    ({"status": "too-many-steps", "regime": "", "period": 0}, "avoid", "too many steps"),
    ({"contact_share": 0.0011}, "avoid", "contact share 0.11 %, limit 0.1 %"),
    ({"contact_share": 0.0009}, "good", None),
    ({"regime": "chaotic", "period": 0}, "avoid", "chaotic"),
    ({"regime": "quasi-periodic", "period": 0, "orbit_amplitude": 0.51}, "avoid", "51 % of the"),
    ({"regime": "quasi-periodic", "period": 0}, "watch", "whirl of its own frequency"),
    ({"period": 2, "orbit_amplitude": 0.51}, "avoid", "half-speed whirl, locked"),
    ({"period": 2}, "watch", "half-speed whirl, locked"),
    ({"period": 5}, "watch", "every 5 revolutions"),
    ({"regime": "undecided", "period": 0}, "watch", "undecided"),
    ({"orbit_amplitude": 0.51}, "watch", "large orbit: 51 % of the clearance, limit 50 %"),
    # the wall of the reference bearing has 0.7 um: the limit is 3.5 um of 35
    ({"max_eccentricity": 0.91}, "avoid", "least film 3.1 µm, limit 3.5 µm"),
    ({"max_eccentricity": 0.81}, "avoid", "largest eccentricity 0.810, limit 0.80"),
    ({"max_eccentricity": 0.79}, "watch", "largest eccentricity 0.790, limit 0.50"),
    ({"max_eccentricity": 0.51}, "watch", "largest eccentricity 0.510, limit 0.50"),
    ({"max_eccentricity": 0.5}, "good", None),
    ({"contact_share": math.nan}, "watch", "not known"),
    # an orbit that is not known may be as large as the eccentricity
    ({"orbit_amplitude": math.nan}, "good", None),
    ({"orbit_amplitude": math.nan, "period": 2, "max_eccentricity": 0.6}, "avoid", "at most 60 %"),
]


@pytest.fixture(scope="module")
def calm_rest(design):
    """A static equilibrium to which nothing objects."""
    found = derive(design, 4.0, 3.0)
    return dataclasses.replace(
        found, whirl=Whirl(0.5, 5000.0, -1.0), modes=(), contact_load_share=0.0
    )


@pytest.mark.parametrize("change, grade, words", CASES)
def test_each_rule_of_a_motion(design, calm_rest, change, grade, words):
    motion = CALM._replace(**change)
    found = assess(design, motion, calm_rest)
    assert found.grade == grade
    assert (words is None) == (not found.reasons)
    assert words is None or words in found.reasons[0]
    assert str(grades(design, motion)) == grade


def test_a_map_has_the_grades_of_its_points(design):
    motions = [CALM._replace(**change) for change, _, _ in CASES]
    columns = Motion(*(np.array(column).reshape(3, -1) for column in zip(*motions, strict=True)))
    found = grades(design, columns)
    assert found.shape == (3, 7)
    assert found.ravel().tolist() == [grade for _, grade, _ in CASES]


def test_the_gravest_reason_comes_first(design, calm_rest):
    motion = CALM._replace(
        regime="quasi-periodic",
        period=0,
        contact_share=0.3,
        max_eccentricity=0.92,
        orbit_amplitude=0.2,
        thin_film_share=0.25,
    )
    found = assess(design, motion, calm_rest)
    first = [reason.split()[0] for reason in found.reasons]
    assert first == ["contact", "least", "largest", "whirl"]
    assert "over 0.9 in 25.0 % of the time" in found.reasons[2]


def test_limits_are_the_designers(design, calm_rest):
    def grade(motion, **limits):
        return assess(design, motion, calm_rest, Limits(**limits)).grade

    thin = CALM._replace(max_eccentricity=0.4)  # 21 um
    assert [grade(thin, least_film=f) for f in (13e-6, 15e-6, 22e-6)] == ["good", "watch", "avoid"]
    far = CALM._replace(max_eccentricity=0.7)
    assert grade(far) == "watch" and grade(far, eccentricity=0.6) == "avoid"
    assert grade(far, calm_eccentricity=0.75) == "good"
    whirl = CALM._replace(period=2, orbit_amplitude=0.4, max_eccentricity=0.4)
    assert grade(whirl) == "watch" and grade(whirl, orbit=0.3) == "avoid"
    rough = design.replace(contact__roughness=0.03, bearing__clearance=50e-6)
    assert Limits().film(rough) == pytest.approx(7.5e-6)
    assert Limits().film(design.replace(bearing__clearance=20e-6)) == pytest.approx(3e-6)


@pytest.mark.parametrize(
    "limits, words",
    [
        ({"least_film": -1e-6}, "least film = -1 µm is out of range: allowed is from 0 to 1000 µm"),
        ({"least_film": math.nan}, "least film"),
        ({"eccentricity": 1.2}, "largest eccentricity = 1.2"),
        ({"calm_eccentricity": 0.9}, "calm eccentricity = 0.9 is out of range: allowed is from 0"),
        ({"orbit": 0.0}, "largest orbit = 0"),
        ({"separation": 6.0}, "separation = 6"),
    ],
)
def test_a_limit_out_of_range_is_refused(limits, words):
    with pytest.raises(DesignError, match=words):
        Limits(**limits)


def test_what_is_not_known_is_said_and_never_good(design, calm_rest):
    found = assess(design, CALM)
    assert found.grade == "watch" and "resonance is not judged" in found.reasons[0]
    assert found.rest == "At rest: not known."
    found = assess(design, None, calm_rest)
    assert found.grade == "watch" and "not solved" in found.reasons[0] + found.motion
    none = derive(design.replace(contact__force_at_closure=0.0), 25.0, 0.2)
    assert assess(design, CALM, none).grade == "watch"
    assert assess(design, None, none).grade == "avoid"


def _mode(ratio, amplification, forward=True):
    return Mode(ratio, -math.pi / amplification * ratio, forward)


def test_separation_margin_is_that_of_the_standard():
    """API 617: AF 2.5 asks for nothing below the speed and 10 % above it."""
    assert _mode(0.9, 8.0).amplification == pytest.approx(8.0)
    assert separation_margin(0.9, 2.4) == 0.0
    assert separation_margin(0.9, 2.5000001) == pytest.approx(0.0, abs=1e-6)
    assert separation_margin(1.1, 2.5000001) == pytest.approx(0.1, abs=1e-6)
    assert separation_margin(0.9, 8.0) == pytest.approx(0.17 * (1.0 - 1.0 / 6.5))
    assert separation_margin(1.1, 8.0) == pytest.approx(0.10 + 0.17 * (1.0 - 1.0 / 6.5))


@pytest.mark.parametrize(
    "mode, grade",
    [
        (_mode(1.02, 18.0), "avoid"),  # within a third of 26 %
        (_mode(1.2, 18.0), "watch"),
        (_mode(1.3, 18.0), "good"),
        (_mode(0.9, 18.0), "watch"),
        (_mode(0.8, 18.0), "good"),
        (_mode(1.02, 5.0), "watch"),  # near, yet damped
        (_mode(1.02, 18.0, forward=False), "good"),  # unbalance does not drive it
        (Mode(1.02, 0.3, True), "good"),  # it grows: the motion tells
        (_mode(0.5, math.pi / 0.09), "watch"),  # log decrement 0.09
        (_mode(5.0, math.pi / 0.09), "good"),  # a bending mode far above the speed
    ],
)
def test_each_rule_of_the_equilibrium(design, calm_rest, mode, grade):
    found = assess(design, CALM, dataclasses.replace(calm_rest, modes=(mode,)))
    assert found.grade == grade and len(found.reasons) == (grade != "good")
    unjudged = Limits(separation=0.0)
    if grade != "good" and mode.ratio > 0.6:
        assert "resonance" in found.reasons[0] and "limit" in found.reasons[0]
        rest = dataclasses.replace(calm_rest, modes=(mode,))
        assert assess(design, CALM, rest, unjudged).grade == "good"


def test_a_whirl_that_grows_at_rest_is_watched(design, calm_rest):
    rest = dataclasses.replace(calm_rest, whirl=Whirl(0.48, 4947.0, 0.326))
    found = assess(design, CALM, rest)
    assert found.grade == "watch" and "grows by 0.326" in found.reasons[0]
    assert found.rest.startswith("Unstable at rest: a whirl at 4,947 cycles/min grows")


def test_the_rotor_on_its_wall_is_said_to_lie_there(design):
    """25 kg at 600 rpm: asperity force over weight by hand."""
    rest = derive(design, 25.0, 0.2023)
    force = 100.0 * math.exp(-(1.0 - rest.eccentricity) / 0.02) * 101325.0 * 0.06**2
    assert rest.contact_load_share == pytest.approx(force / (25.0 * 9.81), rel=1e-9)
    assert rest.contact_load_share == pytest.approx(0.975, abs=0.005)
    found = assess(design, CALM, rest)
    assert found.grade == "avoid"
    assert found.reasons[0] == "not lifted off: the wall carries 97 % of the weight"
    assert found.rest.startswith("Not lifted off: the wall carries 97 % of the weight. ")
    assert derive(design.replace(rotor__gravity=0.0), 4.0, 3.0).contact_load_share == 0.0
    assert not derive(design, 4.0, 3.0).lies_on_wall


def test_the_default_point_reads_as_a_designer_needs(design):
    point = solve_point(design, 4.52, 3.45, Settings(transient=200, revolutions=200))
    assert point.verdict() == (
        "Half-speed whirl, locked to the rotation; 87 % of the clearance, least film 4.6 µm: not "
        "recommended."
    )
    record = point.record()
    assert record["assessment"] == "avoid" and record["assessment_reasons"][0].startswith("contact")


def test_a_machine_on_its_resonance_is_avoided(design):
    """4 kg at 20,000 rpm on 6 bar gauge: a forward whirl 2 % over the speed, amplification 18."""
    machine = design.replace(
        bearing__radius=0.040,
        bearing__clearance=25e-6,
        bearing__supply_pressure_ratio=7.01325 / 1.01325,
    )
    number = machine.bearing_number(20000.0 * math.pi / 30.0)
    rest = derive(machine, 4.0, number)
    (near,) = [m for m in rest.modes if m.forward and m.ratio < 2.0]
    assert near.ratio == pytest.approx(1.020, abs=0.005)
    assert near.amplification == pytest.approx(18.0, abs=1.0)
    found = solve_point(machine, 4.0, number, Settings(transient=200, revolutions=200)).assessment()
    assert found.grade == "avoid" and found.reasons[0].startswith("resonance: a whirl at 20,4")


def test_modes_whirl_with_and_against_the_rotation(design):
    """Of the concentric rigid rotor in a slow bearing: one forward and one backward, as fast."""
    fed = design.replace(
        bearing__supply_pressure_ratio=6.0,
        bearing__permeability=1e-13,
        rotor__gravity=0.0,
        rotor__shaft_stiffness=math.inf,
    )
    modes = derive(fed, 4.0, 0.05).modes
    assert sorted(m.forward for m in modes) == [False, True]
    assert modes[0].ratio == pytest.approx(modes[1].ratio, rel=0.05)


def test_a_run_too_short_to_tell_is_undecided(design):
    """2 kg, Lambda 1.5: a torus, whose tangent still grows after 60 + 60 revolutions."""
    short = solve_point(design, 2.0, 1.5, Settings(transient=30, revolutions=20))
    assert short.regime.name == "undecided" and short.trajectory.completed == 50
    assert short.assessment().grade != "good"
    for mass, number, transient in ((2.0, 1.5, 60), (2.0, 1.5, 200), (4.1, 2.4, 200)):
        settings = Settings(transient=transient, revolutions=transient)
        point = solve_point(design, mass, number, settings)
        assert point.regime.name in ("quasi-periodic", "undecided")


def test_an_undecided_run_is_measured_on_unless_it_may_not(design, monkeypatch):
    monkeypatch.setattr("spab_core.trajectory.run.classify", lambda *_: Regime("undecided"))
    settings = Settings(transient=30, revolutions=100)
    point = solve_point(design, 2.0, 5.0, settings, path_revolutions=3)
    assert point.trajectory.completed == 30 + 400 and point.settings == settings
    assert len(point.trajectory.section) == 400 and len(point.trajectory.path) == 3
    for other in ({"early_stop": False}, {"revolutions": 50}):
        asked = dataclasses.replace(settings, **other)
        point = solve_point(design, 2.0, 5.0, asked)
        assert point.trajectory.completed == 30 + asked.revolutions


def test_new_maps_hold_what_the_grades_need(design):
    m = compute_map(design, np.array([0.5, 3.45]), np.array([1.0, 4.52]), Settings(revolutions=100))
    assert np.isfinite(m.orbit_amplitude).all() and np.isfinite(m.peak_contact_force).all()
    assert np.all(m.orbit_amplitude <= m.max_eccentricity + 1e-9)
    found = m.grades()
    assert set(found.ravel()) <= set(GRADES) and found[0, 0] == "good" and found[1, 1] == "avoid"
    for row, column in np.ndindex(2, 2):
        point = solve_point(
            design, m.rotor_mass[column], m.bearing_number[row], Settings(revolutions=100)
        )
        alone = assess(design, None, point.rest, DEFAULT_LIMITS)
        judged = point.assessment()
        assert GRADES.index(judged.grade) >= GRADES.index(str(found[row, column]))
        assert alone.grade != "good"
