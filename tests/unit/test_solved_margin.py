"""Solved margins: kinds of trouble against the assessment, limits that are known otherwise, motions
beside the one from rest.
"""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from spab_core.common.errors import InputError
from spab_core.common.units import from_rpm
from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import reference_design
from spab_core.linear_theory.summary import derive
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.maps.solved_margin import (
    KINDS,
    PRECISION,
    ROUGH,
    Limit,
    SolvedMargin,
    _carry_on,
    _look,
    solve_margin,
    troubles_at_rest,
    troubles_of_motion,
)
from spab_core.plotting.margin import stretches
from spab_core.trajectory.assessment import GRADES, Limits, Motion, grades, rest_rules
from spab_core.trajectory.periodic_orbit import UNSTABLE
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings
from spab_core.trajectory.starts import whirling_start

# R 40 mm, C 25 µm, fed with 6 bar gauge, the rest of the reference
WHIRLS = {"quasi-periodic", "subharmonic", "undecided"}
MACHINE = reference_design().replace(
    bearing__radius=0.04, bearing__clearance=25e-6, bearing__supply_pressure_ratio=7.01325 / 1.01325
)
COARSE = 4.0 * PRECISION
SHARES = some.floats(0.0, 1.0)


@given(
    some.sampled_from(["periodic", "quasi-periodic", "chaotic", "undecided", ""]),
    some.integers(1, 16),
    some.tuples(SHARES, SHARES, SHARES, some.floats(0.0, 1.0)),
    some.floats(0.0, 12e-6),
)
def test_the_kinds_of_a_motion_are_as_grave_as_its_assessment(regime, period, shares, film):
    """The assessment's own rules say how grave a motion is; a kind must stand for each of them."""
    contact, eccentricity, orbit, thin = shares
    status = "ok" if regime else "touchdown"
    period = period if regime == "periodic" else 0
    motion = Motion(regime, period, status, contact, eccentricity, orbit, thin)
    limits = Limits(least_film=film)
    found = troubles_of_motion(MACHINE, motion, limits)
    assert found.keys() <= KINDS.keys()
    worst = max((GRADES.index(grade) for grade in found.values()), default=0)
    judged = grades(MACHINE, Motion(*(np.array([value]) for value in motion)), limits)
    assert GRADES[worst] == judged[0]


@pytest.mark.parametrize(
    ("mass", "number"), [(4.0, 5.87), (25.0, 0.17), (1.0, 0.5), (4.52, 3.45), (12.0, 5.87)]
)
@pytest.mark.parametrize("design", [MACHINE, reference_design()])
def test_the_kinds_at_rest_are_those_of_the_assessment(design, mass, number):
    rest = solve_point(design, mass, number, Settings(transient=30, revolutions=20)).rest
    told = " ".join(str(rule.words()) for rule in rest_rules(rest) if rule.holds)
    found = troubles_at_rest(rest)
    for kind, words in (
        ("resonance", "resonance: "),
        ("not lifted off", "not lifted off"),
        ("unstable at rest", "unstable at rest"),
        ("lightly damped at rest", "lightly damped at rest"),
    ):
        nested = kind == "lightly damped at rest" and "unstable at rest" in found
        assert (kind in found) == (words in told or nested), kind
    worst = max((GRADES.index(grade) for grade in found.values()), default=0)
    assert worst == max((rule.grade for rule in rest_rules(rest) if rule.holds), default=0)


def test_where_trouble_becomes_grave_is_a_limit_too():
    """A resonance is to be watched from further away than it is to be avoided: both distances are
    told, each between two speeds of which linear theory says so.
    """
    spindle = MACHINE.replace(
        bearing__radius=0.03, bearing__clearance=18e-6, rotor__unbalance_eccentricity=0.85e-6
    )
    at = spindle.bearing_number(from_rpm(32_000.0))
    some_way = {"points": 4, "span": (0.7, 1.05), "precision": COARSE}
    found = solve_margin(spindle, 2.5, at, axes=("speed",), **some_way)
    limits = [x for x in found.limits if (x.what, x.direction) == ("resonance", "down")]
    assert [(x.grade, x.after, x.begins) for x in limits] == [
        ("watch", "watch", True),
        ("avoid", "avoid", True),
    ]
    ranks = []
    for limit in limits:
        kinds = [
            troubles_at_rest(derive(spindle, 2.5, spindle.bearing_number(from_rpm(rpm))))
            for rpm in (limit.high, limit.low)
        ]
        ranks.append([GRADES.index(k.get("resonance", "good")) for k in kinds])
    assert ranks == [[0, 1], [1, 2]]
    assert found.nearest("avoid").what == "resonance"
    assert "resonance (not recommended) from" in found.headline()
    grades_down = [grade for low, high, grade, _ in stretches(found, "speed") if high < 32_000.0]
    assert grades_down[0] == "avoid" and "avoid" not in grades_down[1:]


def limit_of(found, axis, direction, what):
    # the first, where the trouble begins or ends in whatever grade; one more where that changes
    limit, *graver = (
        x for x in found.limits if (x.axis, x.direction, x.what) == (axis, direction, what)
    )
    assert all(x.grade != limit.grade or x.after != limit.after for x in graver)
    assert len(graver) <= 1
    return limit


@pytest.fixture(scope="module")
def machine():
    number = MACHINE.bearing_number(from_rpm(20000.0))
    return solve_margin(MACHINE, 4.0, number, points=6, precision=COARSE)


@pytest.mark.slow
def test_the_limits_of_a_fed_machine(machine):
    """4 kg at 20,000 rpm: single solved points rub from +11 to +19 % in speed, and at 5 but not at
    4 kg; its equilibrium is unstable from 40,170 rpm.
    """
    speed = limit_of(machine, "speed", "up", "contact")
    assert speed.begins and speed.grade == "avoid"
    assert 22_133.0 <= speed.low < speed.high <= 23_835.0
    mass = limit_of(machine, "mass", "up", "contact")
    assert 4.5 < mass.low < mass.high < 5.0
    assert limit_of(machine, "speed", "up", "unstable at rest").value == pytest.approx(
        40_170.0, rel=0.01
    )
    assert machine.here.keys() >= {"resonance", "large orbit"}
    assert not limit_of(machine, "speed", "down", "resonance").begins
    troubles = [x for x in machine.limits if x.begins and x.grade == "avoid"]
    nearest = min(troubles, key=lambda limit: limit.distance)
    assert machine.headline().startswith(
        "Solved margin: none, the point itself is to be avoided (resonance); further on, going "
        f"{nearest.towards()}, an eccentricity over"
    )
    assert "going up" in machine.headline() and "±" in machine.headline()
    up = next(text for text in machine.sentences() if text.startswith("Up in speed"))
    assert "rubbing from 22," in up and "looked at to 60,000 rpm" in up
    assert any("can be missed" in text for text in machine.sentences())


@pytest.mark.slow
def test_some_axes_alone_say_what_they_say_among_all():
    """At 2 kg, Λ 1.5, a short way: what the others find does not reach into their limits."""
    where = MACHINE, 2.0, 1.5
    short = {"points": 2, "span": (0.8, 1.25), "precision": COARSE}
    some, all_of_them = (
        solve_margin(*where, **short, **more) for more in ({"axes": ("speed", "mass")}, {})
    )
    assert some.limits == tuple(x for x in all_of_them.limits if x.axis != "both")
    assert {line.axis for line in some.lines} == {"speed", "mass"}
    assert {line.axis for line in all_of_them.lines} == {"speed", "mass", "both"}


@pytest.mark.parametrize("axes, told", [((), "give at least one axis"), (("rpm",), "axis = 'rpm'")])
def test_an_axis_that_there_is_not_is_refused(axes, told):
    with pytest.raises(InputError, match=told):
        solve_margin(MACHINE, 2.0, 1.5, axes=axes)


@pytest.mark.slow
def test_both_ends_of_a_bracket_are_what_they_are_said_to_be(machine):
    """Solved again on their own, without the margin's bookkeeping."""
    for axis, what in (("speed", "contact"), ("mass", "contact"), ("mass", "large eccentricity")):
        limit = limit_of(machine, axis, "up", what)
        assert limit.high - limit.low <= COARSE * limit.high
        for value, there in ((limit.low, False), (limit.high, True)):
            mass, rpm = (value, 20000.0) if axis == "mass" else (4.0, value)
            point = solve_point(MACHINE, mass, MACHINE.bearing_number(from_rpm(rpm)))
            assert (what in troubles_of_motion(MACHINE, point.motion)) == there
    for limit in machine.limits:
        assert limit.low < limit.value < limit.high
        assert limit.high - limit.low <= ROUGH * COARSE * limit.high


@pytest.mark.slow
def test_a_whirl_begins_at_the_linear_threshold():
    """A rigid, balanced, unloaded rotor in a fed bearing stays at the centre until its whirl grows:
    at the mass that the eigenvalues give.
    """
    design = MACHINE.replace(
        rotor__shaft_stiffness=math.inf, rotor__unbalance_eccentricity=0.0, rotor__gravity=0.0
    )
    (exact,) = whirl_thresholds(design, 4.0)
    assert exact.stable_side == "below"
    mass = 0.7 * exact.critical_mass
    found = solve_margin(design, mass, 4.0, points=2, precision=COARSE, axes=("mass",))
    assert not found.here.keys() & (WHIRLS | {"contact"})
    near = limit_of(found, "mass", "up", "unstable at rest")
    assert near.low <= exact.critical_mass <= near.high
    # nothing but rounding disturbs the centre: a run leaves it where its rate reaches UNSTABLE
    first = min(
        x.low
        for x in found.limits
        if (x.axis, x.direction) == ("mass", "up") and x.what in WHIRLS | {"contact"}
    )
    rate = derive(design, first, 4.0).whirl.growth
    assert first >= near.low and 0.0 <= rate < UNSTABLE


def test_the_headline_names_the_nearest_trouble_to_be_avoided_and_what_comes_before():
    def limit(what, value, grade, begins=True):
        change = value / 4.0 - 1.0
        half = 0.01
        ends = (value, value - half, value + half)
        place = (value, 4_000.0, abs(change))
        return Limit("mass", "up", what, *ends, begins, grade, change, *place)

    point = solve_point(reference_design(), 1.0, 0.5, Settings(transient=30, revolutions=20))
    far, near = limit("contact", 6.0, "avoid"), limit("raised eccentricity", 5.0, "watch")
    ends = limit("resonance", 4.5, "avoid", begins=False)
    for limits, words in (
        (
            (ends, near, far),
            "Solved margin: going up in mass, rubbing from 6.00 ± 0.01 kg (+50 %); to be watched "
            "before: going up in mass, a raised eccentricity from 5.00 ± 0.01 kg (+25 %).",
        ),
        (
            (limit("contact", 4.8, "avoid"), near),
            "Solved margin: going up in mass, rubbing from 4.80 ± 0.01 kg (+20 %).",
        ),
        (
            (near,),
            "Solved margin: going up in mass, a raised eccentricity from 5.00 ± 0.01 kg (+25 %).",
        ),
        ((ends,), "Solved margin: no further trouble where it was looked for."),
    ):
        assert SolvedMargin(point, {}, limits, ()).headline() == words
        assert SolvedMargin(point, {"large orbit": "watch"}, limits, ()).headline() == words
        here = "none, the point itself is to be avoided (a quasi-periodic whirl); further on, "
        there = words.replace("margin: ", f"margin: {here}")
        avoided = {"large orbit": "watch", "quasi-periodic": "avoid"}
        assert SolvedMargin(point, avoided, limits, ()).headline() == there


def test_the_headline_of_a_bad_point_tells_where_that_ends():
    """Kinds that end at one place in one clause; what becomes less grave in its own."""
    point = solve_point(reference_design(), 4.0, 1.0, Settings(transient=30, revolutions=20))

    def end(what, mass, after=""):
        change = mass / 4.0 - 1.0
        place = (mass, mass - 0.01, mass + 0.01, False, "avoid", change, mass, 2966.0, abs(change))
        return Limit("mass", "down", what, *place, after=after)

    here = {"contact": "avoid", "chaotic": "avoid", "resonance": "avoid", "large orbit": "watch"}
    limits = end("resonance", 3.4, "watch"), end("contact", 3.0), end("chaotic", 3.0)
    told = SolvedMargin(point, here, limits, ()).headline()
    assert told.endswith(
        "; going down in mass, rubbing and chaos end at 3.00 ± 0.01 kg (-25 %); going down in "
        "mass, resonance no worse than to be watched from 3.40 ± 0.01 kg (-15 %)."
    ), told
    watched = SolvedMargin(point, {"large orbit": "watch"}, (end("large orbit", 3.0),), ())
    assert "end" not in watched.headline()


@pytest.mark.slow
def test_a_whirl_exists_beside_period_1():
    """At 4.52 kg and Lambda 1.4 rest leads to period 1, a large orbit to a whirl of 0.83."""
    where = reference_design(), 4.52, 1.4
    found = solve_margin(*where, points=6, precision=0.002, axes=("speed",))
    assert found.point.regime.period == 1 and found.point.max_eccentricity < 0.5
    assert found.beside.max_eccentricity == pytest.approx(0.83, abs=0.02)
    assert found.assessment.grade == "watch" and "to be watched" in found.assessment.motion
    assert "83 % of the clearance exists beside it" in found.assessment.reasons[-1]
    # it ends going down in speed: runs on both sides of the limit, without the margin's bookkeeping
    ends = limit_of(found, "speed", "down", "another motion")
    assert not ends.begins and "83 % of the clearance" in ends.words()
    design = reference_design()
    for rpm, there in ((ends.low, False), (ends.high, True)):
        number = design.bearing_number(from_rpm(rpm))
        run = solve_point(design, 4.52, number, start=found.beside.trajectory.final)
        assert (run.max_eccentricity > 0.8) == there
    assert found.record()["coexisting"] == found.assessment.reasons[-1]


def test_a_motion_is_carried_on_along_a_line():
    """At 4.52 kg a whirl of 0.84 at Lambda 1.5 lives down to 1.35 where rest leads to period 1;
    nothing tells the points below 1.5 of it but their neighbour.
    """
    design, line = reference_design(), []
    for number in (1.28, 1.36, 1.4, 1.5):
        point = solve_point(design, 4.52, number)
        assert point.regime.period == 1 and point.max_eccentricity < 0.5
        if number < 1.5:
            vars(point)["beside"] = None
        line.append(_look(point, Limits()))
    assert [here.beside is not None for here in line] == [False, False, False, True]
    carried = _carry_on(line)
    assert [here.beside is not None for here in carried] == [False, True, True, True]
    assert all(here.kinds["another motion"] == "watch" for here in carried[1:])
    for here, size in zip(carried[1:], (0.820, 0.828, 0.838), strict=True):
        assert here.beside.max_eccentricity == pytest.approx(size, abs=0.01)


def test_next_to_where_a_period_doubles_there_is_one_motion():
    """At 4.52 kg period 2 goes over into period 1 near Lambda 5.52, without a jump."""
    design = reference_design()
    one, two = (solve_point(design, 4.52, number) for number in (5.55, 5.5))
    assert (one.regime.period, two.regime.period) == (1, 2)
    assert not one.is_apart(two) and not two.is_apart(one)
    assert one.is_apart(solve_point(design, 4.52, 3.45))  # period 2 of 0.87


@pytest.mark.slow
def test_mass_and_speed_at_once(machine):
    """Limits on the diagonals are where single runs have them, and nearer than along the axes."""
    limit = limit_of(machine, "both", "up", "contact")
    for factor, there in ((limit.low, False), (limit.high, True)):
        number = MACHINE.bearing_number(from_rpm(20000.0 * factor))
        point = solve_point(MACHINE, 4.0 * factor, number)
        assert ("contact" in troubles_of_motion(MACHINE, point.motion)) == there
    assert limit.rotor_mass == pytest.approx(4.0 * limit.value)
    assert limit.speed_rpm == pytest.approx(20000.0 * limit.value)
    assert limit.distance == pytest.approx(math.sqrt(2.0) * (limit.value - 1.0))
    assert limit.value - 1.0 < limit_of(machine, "speed", "up", "contact").change
    other = limit_of(machine, "both", "speed up", "contact")
    assert other.rotor_mass < 4.0 and other.rotor_mass * other.speed_rpm == pytest.approx(80000.0)
    assert [x.distance for x in machine.limits] == sorted(x.distance for x in machine.limits)


def test_a_point_at_the_end_of_what_is_allowed():
    found = solve_margin(
        reference_design(),
        1e-3,
        BEARING_NUMBER_RANGE[0],
        Settings(transient=30, revolutions=20),
        points=2,
        precision=0.1,
    )
    assert [line.points for line in found.lines] == [0, 2, 0, 2, 0, 1, 0, 0]
    assert any(
        text.startswith("Down in mass: nothing beyond 0.001 kg") for text in found.sentences()
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": 1}, "points = 1 is out of range"),
        ({"precision": 0.5}, "precision = 0.5 is out of range"),
        ({"rotor_mass": -1.0}, "rotor mass = -1 kg"),
        ({"bearing_number": math.nan}, "bearing number = nan"),
        ({"settings": Settings(transient=10)}, "too short"),
    ],
)
def test_wrong_numbers_are_refused(change, words):
    given = {"design": MACHINE, "rotor_mass": 4.0, "bearing_number": 5.0}
    with pytest.raises(InputError, match=words):
        solve_margin(**given | change)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (23100.0, 23300.0, "rubbing from 23,200 ± 100 rpm (+16 %)"),
        (23160.0, 23240.0, "rubbing from 23,200 ± 40 rpm (+16 %)"),
        (20100.0, 20104.4, "rubbing from 20,102 ± 3 rpm (+0.5 %)"),
    ],
)
def test_words_of_a_limit(low, high, words):
    middle = 0.5 * (low + high)
    change = middle / 20000.0 - 1.0
    limit = Limit(
        *("speed", "up", "contact", middle, low, high, True, "avoid"), change, 4.0, middle, change
    )
    assert limit.words() == words
    ends = dataclasses.replace(limit, begins=False)
    assert ends.words().startswith("rubbing ends at")


def test_a_large_orbit_starts_as_it_is_said_to():
    state = whirling_start(reference_design(), 4.52, 1.4)
    x2, y2, x1, y1, vx2, vy2, vx1, vy1 = state[-8:]
    assert math.hypot(x2, y2) == math.hypot(x1, y1) == 0.8
    assert (vx2, vx1) == (0.0, 0.0) and vy2 == vy1 == 0.4  # forward, at half the shaft speed
    assert state[:-8].min() == pytest.approx(0.2, abs=0.05)  # S = P H with P = 1 in the gap
