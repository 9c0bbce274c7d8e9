"""Trajectories as a user meets them: statuses, paths, settings, repeatability."""

import dataclasses
import math

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.common.errors import DesignError
from spab_core.solver.film import Mesh
from spab_core.solver.stepping import STATUS, build_record
from spab_core.trajectory.run import MOST_MEASURED, Run, path_angle

SHORT = Settings(mesh=Mesh(3, 16), transient=30, revolutions=30)


def test_touchdown_is_a_status(design):
    """Without asperities nothing holds a heavy rotor at low speed: it falls to the wall."""
    bare = design.replace(contact__force_at_closure=0.0)
    point = solve_point(bare, 25.0, 0.5, SHORT)
    assert point.trajectory.status == "touchdown"
    assert point.mle is None and point.regime is None
    assert "touched the wall" in point.verdict()
    assert point.record()["regime"] is None and point.record()["mle_per_revolution"] is None
    assert point.trajectory.completed < 60


def test_film_without_gas_is_a_status(design):
    """A wall that sucks: a node of the film loses all gas, and the step shrinks to nothing."""
    sucked = design.replace(bearing__supply_pressure_ratio=0.1, bearing__permeability=1e-13)
    point = solve_point(sucked, 5.0, 2.0, Settings("3x16", transient=40, revolutions=20))
    assert point.trajectory.status == "step-too-small"
    assert point.mle is None and "finer mesh" in point.verdict()


def test_too_many_steps_is_a_status(make_run):
    run = make_run(4.0, 3.0)
    assert STATUS[run.go(2, 1e-9, max_steps=20)[0]] == "too-many-steps"


def test_steps_are_as_many_as_measured(design):
    """A wrong Jacobian still gives right answers, by far more steps: hold their number."""
    whole = dataclasses.replace(SHORT, early_stop=False)
    steps = [
        solve_point(design, m, b, whole).trajectory.steps / 60
        for m, b in ((7.0, 6.0), (18.0, 4.5), (10.0, 0.25))
    ]
    assert max(steps) < 80.0 and min(steps) < 20.0, steps


@pytest.mark.parametrize(
    ("late", "total", "goes_on"), [(0.0, 330, False), (0.2, 330, True), (0.2, 1230, False)]
)
def test_a_regime_that_hangs_on_the_last_revolutions_is_none_yet(design, late, total, goes_on):
    """A section that never repeats, of exponent 0 until its last 50 revolutions: measured on, up to
    the limit."""
    run = Run(design, (4.0, 3.0), Settings("3x16", transient=30, revolutions=300))
    record = build_record(total, 0)
    record.growth[:] = 0.0
    record.growth[-50:] = np.resize([late + 0.9, late - 0.9], 50)
    angle = np.sqrt(2.0) * np.arange(total)
    record.section[:] = np.cos(angle[:, None] + np.arange(record.section.shape[1]))
    run.records.append(record)
    run.done = run.total = total
    assert run.measured in (300, MOST_MEASURED * 300)
    assert run._is_undecided() == goes_on


def test_a_recorded_path_changes_nothing(design):
    """A torus, measured on as its few revolutions tell nothing, and an orbit that settles."""
    for mass, number, settings in (
        (4.1, 2.4, Settings("3x16", transient=30, revolutions=60)),
        (4.0, 3.0, Settings("3x16", transient=60, revolutions=300)),
    ):
        alone, kept = (
            solve_point(design, mass, number, settings, path_revolutions=n) for n in (0, 55)
        )
        assert kept.regime == alone.regime and len(kept.trajectory.path) == 55
        before = -55 if kept.trajectory.settled else None
        section = kept.trajectory.section[:before]
        count = min(len(section), len(alone.trajectory.section))
        assert count > 10
        assert np.abs(section[-count:] - alone.trajectory.section[-count:]).max() < 1e-3


def test_paths_pass_through_the_section(design):
    point = solve_point(design, 4.0, 3.0, SHORT, path_revolutions=5)
    path = point.trajectory.path
    assert path.shape == (5, 96, 8)
    assert np.abs(path[1:, 0] - point.trajectory.section[-5:-1]).max() < 1e-12
    angle = path_angle(point.trajectory)
    assert angle[0] == pytest.approx(2.0 * math.pi * 55) and len(angle) == 5 * 96


def test_path_is_close_to_a_finely_resolved_one(design):
    coarse = solve_point(
        design, 4.0, 3.0, dataclasses.replace(SHORT, tolerance=2e-4), path_revolutions=3
    )
    fine = solve_point(
        design,
        4.0,
        3.0,
        Settings(mesh=Mesh(3, 16), transient=30, revolutions=30, tolerance=1e-9),
        path_revolutions=3,
    )
    assert np.abs(coarse.trajectory.path - fine.trajectory.path)[..., :4].max() < 2e-3


def test_runs_repeat_bit_for_bit_and_do_not_depend_on_recording(design):
    a = solve_point(design, 18.0, 4.5, SHORT)
    b = solve_point(design, 18.0, 4.5, SHORT, path_revolutions=10, progress=lambda n: None)
    assert np.array_equal(a.trajectory.section, b.trajectory.section)
    c = solve_point(design, 18.0, 4.5, SHORT)
    assert np.array_equal(a.trajectory.growth, c.trajectory.growth)


def test_rigid_rotor_is_the_stiff_limit_of_the_elastic_one(design):
    rigid = solve_point(
        design.replace(rotor__shaft_stiffness=math.inf), 6.0, 2.0, SHORT, path_revolutions=2
    )
    stiff = solve_point(
        design.replace(rotor__shaft_stiffness=1e11), 6.0, 2.0, SHORT, path_revolutions=2
    )
    assert np.abs(rigid.trajectory.section[:, :4] - stiff.trajectory.section[:, :4]).max() < 2e-3
    assert np.array_equal(rigid.trajectory.path[..., 0:2], rigid.trajectory.path[..., 2:4])
    assert rigid.mle.value == pytest.approx(stiff.mle.value, abs=0.05)


def test_the_whole_plane_of_the_map_runs(design):
    """Corners and edges of the plane, where film, journal and contact are stiffest: finite
    exponents, status ok.
    """
    for mass in (0.1, 5.0, 25.0):
        for bearing_number in (0.05, 0.5, 8.5):
            point = solve_point(
                design, mass, bearing_number, Settings(transient=40, revolutions=20)
            )
            assert point.trajectory.status == "ok", (mass, bearing_number)
            assert math.isfinite(point.mle.value)


@pytest.mark.parametrize(
    "options, word",
    [
        ({"method": "euler"}, "rodas, dtm"),
        ({"transient": -1}, "transient"),
        ({"revolutions": 3}, "revolutions"),
        ({"revolutions": 20.5}, "whole"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": math.nan}, "tolerance"),
        ({"mesh": "2x2"}, "mesh"),
    ],
)
def test_wrong_settings_are_refused(options, word):
    with pytest.raises(DesignError, match=word):
        Settings(**options)


@pytest.mark.parametrize(
    "mass, bearing_number, word",
    [
        (0.0, 1.0, "rotor mass"),
        (math.nan, 1.0, "rotor mass"),
        (1.0, 0.0, "bearing number"),
        (1.0, 1e9, "bearing number"),
    ],
)
def test_points_out_of_range_are_refused(design, mass, bearing_number, word):
    with pytest.raises(DesignError, match=word):
        solve_point(design, mass, bearing_number, SHORT)


def test_dtm_gives_the_same_answer(design):
    settings = {"mesh": Mesh(3, 16), "transient": 40, "revolutions": 40}
    a = solve_point(design, 7.0, 6.0, Settings(**settings))
    b = solve_point(design, 7.0, 6.0, Settings(**settings, method="dtm"))
    assert a.regime == b.regime
    assert a.mle.value == pytest.approx(b.mle.value, abs=0.002)


def test_a_motion_on_one_circle_is_called_a_limit_cycle(design):
    balanced = design.replace(rotor__unbalance_eccentricity=0.0)
    weightless = balanced.replace(rotor__gravity=0.0)
    circle, loaded = (
        solve_point(d, 4.52, 3.45, Settings("3x16", transient=200, revolutions=100))
        for d in (weightless, balanced)
    )
    assert circle.on_circle and "limit cycle" in circle.assessment().motion
    assert circle.assessment().motion in circle.verdict()
    assert not loaded.on_circle
