"""Early stop: the leading Floquet multiplier against the eigenvalues of a dense monodromy matrix,
and against full runs.

Source: Floquet theory; the monodromy matrix is built column by column from the integrator's tangent
at a tight tolerance, its eigenvalues by LAPACK. It shares no projection with the early stop."""

import dataclasses
import math

import numpy as np
import pytest

from spab_core.linear_theory.whirl import linear_spectrum
from spab_core.shipped.manifest import load_reference_map
from spab_core.solver.film import Mesh
from spab_core.solver.stepping import REVOLUTION, Options, advance, build_memory, build_record
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

TINY = Mesh(3, 16)


@pytest.mark.slow
@pytest.mark.parametrize("mass, number, period", [(20.0, 2.0, 1), (7.0, 6.0, 2), (10.0, 0.5, 1)])
def test_rate_is_the_largest_eigenvalue_of_the_monodromy_matrix(
    design, make_run, mass, number, period
):
    settings = Settings(mesh=TINY, tolerance=1e-5)
    point = solve_point(design, mass, number, settings)
    assert point.trajectory.settled is not None and point.trajectory.settled.period == period
    run = make_run(mass, number, mesh=TINY)
    run.memory.state[:] = point.trajectory.final
    unknowns = run.unknowns
    columns = np.empty((len(unknowns), len(unknowns)))
    for k, u in enumerate(unknowns):
        memory = build_memory(run.film)
        memory.state[:] = point.trajectory.final
        memory.tangent[:] = 0.0
        memory.tangent[u] = 1.0
        record = build_record(period, 0)
        options = Options(tolerance=1e-7, tangent=True, max_step=REVOLUTION / 64)
        status, _ = advance(run.system, memory, options, point.trajectory.completed, period, record)
        assert status == 0
        columns[:, k] = memory.tangent[unknowns] * math.exp(record.growth.sum())
    expected = math.log(np.abs(np.linalg.eigvals(columns)).max()) / period
    assert point.mle.value == pytest.approx(expected, abs=0.003 + 0.005 * abs(expected))


@pytest.mark.slow
@pytest.mark.parametrize(
    "mass, number", [(4.52, 1.5), (20.0, 2.0), (7.0, 6.0), (12.0, 8.0), (11.5, 7.5)]
)
def test_early_stop_gives_the_answer_of_the_full_run(design, mass, number):
    settings = Settings(revolutions=300)
    early = solve_point(design, mass, number, settings)
    full = solve_point(design, mass, number, dataclasses.replace(settings, early_stop=False))
    assert (
        early.trajectory.settled is not None
        and early.trajectory.completed < 0.7 * full.trajectory.completed
    )
    assert full.trajectory.settled is None and full.trajectory.completed == 600
    assert early.regime == full.regime
    assert abs(early.mle.value - full.mle.value) < 0.003 + 3.0 * full.mle.standard_error
    # contact time is counted in quarters of a step, some eighty to a revolution
    assert early.contact_share == pytest.approx(full.contact_share, abs=3e-3)
    assert early.max_eccentricity == pytest.approx(full.max_eccentricity, abs=2e-3)


@pytest.mark.slow
def test_a_slow_mode_that_the_run_has_left_small_is_found(design):
    """15.2 kg, Lambda 1.5: two real multipliers, and a run whose own tangent holds nearly nothing
    of the slower mode for dozens of revolutions. 14.5 kg, Lambda 0.5: a pair that swings fast."""
    for mass, number in ((15.2, 1.5), (14.5, 0.5)):
        full = solve_point(
            design, mass, number, Settings(early_stop=False, transient=1000, revolutions=1000)
        )
        point = solve_point(design, mass, number)
        assert point.trajectory.completed < 100
        error = 3.0 * np.hypot(point.mle.standard_error, full.mle.standard_error) + 0.001
        assert abs(point.mle.value - full.mle.value) < min(error, 0.02)


@pytest.mark.slow
def test_a_push_onto_another_attractor_is_told(design):
    """19.2 kg, Lambda 6.5: the run nears a periodic orbit with a multiplier out of the circle."""
    point = solve_point(design, 19.2, 6.5)
    pushed = point.trajectory.pushed
    assert 30 < pushed <= 150 and point.record()["pushed"] == pushed
    assert f"at revolution {pushed}" in point.verdict()
    full = dataclasses.replace(point.settings, early_stop=False)
    assert solve_point(design, 19.2, 6.5, full).trajectory.pushed == 0


@pytest.mark.slow
def test_chaos_and_tori_are_never_stopped_early(design):
    for mass, number in ((18.0, 4.5), (24.0, 4.0), (2.0, 5.0)):
        point = solve_point(design, mass, number, Settings(transient=150, revolutions=100))
        assert point.trajectory.settled is None and point.trajectory.completed >= 250


@pytest.mark.slow
@pytest.mark.parametrize("mass, number", [(0.2, 3.45), (0.3, 5.0)])
def test_an_unstable_orbit_is_left(design, mass, number):
    """A light rotor starts almost on the small orbit of its unbalance, which is unstable, but so
    weakly that hundreds of revolutions may still lie on it. The long run, left alone, shows the
    attractor: a whirl."""
    left_alone = solve_point(
        design, mass, number, Settings(early_stop=False, transient=30, revolutions=30)
    )
    long = solve_point(
        design, mass, number, Settings(early_stop=False, transient=3000, revolutions=200)
    )
    point = solve_point(design, mass, number, Settings(revolutions=300))
    assert left_alone.max_eccentricity < 0.05 and long.max_eccentricity > 0.7
    assert point.max_eccentricity == pytest.approx(long.max_eccentricity, abs=0.02)
    assert abs(point.mle.value) < 0.005


@pytest.mark.slow
def test_a_light_mode_that_the_orbit_does_not_excite_is_resolved(design):
    """18.69 kg, Lambda 0.388: the shaft swings many times a revolution while the orbit stands
    still. Steps for the orbit alone damp that mode (-1.83 at 16 steps a revolution); the limit of
    small steps is -1.292."""
    fine = solve_point(design, 18.69, 0.388, Settings(tolerance=1e-5))
    assert fine.mle.value == pytest.approx(-1.292, abs=0.003)
    assert solve_point(design, 18.69, 0.388).mle.value == pytest.approx(fine.mle.value, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mass, number", [(11.5, 0.05), (12.5, 0.05), (20.0, 0.05), (10.0, 0.1), (20.0, 0.2)]
)
def test_a_strongly_damped_orbit_decays_as_linear_theory_says(design, mass, number):
    """The orbit is the static equilibrium but for a small unbalance, so its exponent is 2 pi times
    the largest real part of the eigenvalues about it, which share nothing with time integration.
    The leading mode swings up to 110 times a revolution."""
    point = solve_point(design, mass, number, Settings(revolutions=300))
    mesh = point.trajectory.mesh
    linear = 2.0 * math.pi * linear_spectrum(design, mass, number, mesh)[0][0].real
    assert linear < -3.0 and point.regime.text == "periodic-1"
    error = 3.0 * point.mle.standard_error + 0.003 * abs(linear)
    assert abs(point.mle.value - linear) < error < 0.01 * abs(linear)


@pytest.mark.slow
def test_strongly_damped_cells_of_the_shipped_map_decay_as_linear_theory_says():
    """Sixteen random cells with exponents under -2 against the eigenvalues about the static
    equilibrium.
    """
    m = load_reference_map()
    damped = np.argwhere(m.mle < -2.0)
    for row, column in np.random.default_rng(3).choice(damped, 16, replace=False):
        linear = linear_spectrum(
            m.design, float(m.rotor_mass[column]), float(m.bearing_number[row])
        )[0][0].real
        assert m.mle[row, column] == pytest.approx(2.0 * math.pi * linear, rel=0.01)


@pytest.mark.slow
def test_a_run_goes_on_from_a_neighbour(design):
    first = solve_point(design, 7.0, 6.0)
    again = solve_point(design, 7.0, 6.0, start=first.trajectory.final)
    assert again.regime == first.regime and again.mle.value == pytest.approx(
        first.mle.value, abs=2e-3
    )
    assert again.trajectory.completed < first.trajectory.completed
    near = (
        np.abs(again.trajectory.section[:, None, :4] - first.trajectory.section[None, -2:, :4])
        .max(axis=2)
        .min(axis=1)
    )
    assert near.max() < 1e-3
