"""The integrators against scipy's Radau on the same semi-discrete equations, against each other,
and in order.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spab_core.solver.film import Mesh
from spab_core.solver.slope import slope, slope_tangent

POINTS = {"periodic": (7.0, 6.0), "torus": (2.0, 5.0), "chaotic": (18.0, 4.5)}
SETTLE = 40
TINY = Mesh(3, 16)


def _spun_up(make_run, point, **options):
    run = make_run(*POINTS[point], mesh=TINY, **options)
    status, _ = run.go(SETTLE, 1e-6, tangent=True)
    assert status == 0
    return run


def _radau(run, revolutions):
    """States at the end of each revolution by scipy's Radau, rtol 1e-10, with the analytic
    Jacobian.
    """
    unknowns = run.unknowns
    state = run.memory.state.copy()
    work, out, out_v = run.memory.work, np.zeros_like(state), np.zeros_like(state)

    def f(tau, y):
        state[unknowns] = y
        if not slope(run.system, tau, state, work, out):
            return np.full_like(y, np.nan)
        return out[unknowns].copy()

    def jacobian(tau, y):
        state[unknowns] = y
        columns = np.empty((len(y), len(y)))
        direction = np.zeros_like(state)
        for k, u in enumerate(unknowns):
            direction[u] = 1.0
            slope_tangent(run.system, tau, state, direction, work, out, out_v)
            direction[u] = 0.0
            columns[:, k] = out_v[unknowns]
        return columns

    ends = 2.0 * np.pi * (run.done + np.arange(revolutions + 1))
    answer = solve_ivp(
        f,
        (ends[0], ends[-1]),
        run.memory.state[unknowns],
        "Radau",
        ends[1:],
        rtol=1e-10,
        atol=1e-11,
        jac=jacobian,
    )
    assert answer.success
    return answer.y[-8:].T


@pytest.mark.slow
@pytest.mark.parametrize("point", POINTS)
def test_default_and_small_steps_agree_with_radau_over_five_revolutions(make_run, point):
    start = _spun_up(make_run, point)
    expected = _radau(start, 5)
    run = make_run(*POINTS[point], mesh=TINY).start_from(start)
    _, record = run.go(5)
    # the chaotic orbit doubles its error every two revolutions: compare before it has diverged
    rows = 3 if point == "chaotic" else 5
    assert np.abs(record.section[:rows, :4] - expected[:rows, :4]).max() < 1e-4
    for method, tolerance in (("rodas", 1e-10), ("dtm", 1e-9)):
        exact = make_run(*POINTS[point], mesh=TINY, method=method).start_from(start)
        _, record = exact.go(5, tolerance)
        assert np.abs(record.section[:, :4] - expected[:, :4]).max() < 1e-6, method


@pytest.mark.parametrize("point", POINTS)
def test_dtm_agrees_with_rodas_at_small_steps(make_run, point):
    start = _spun_up(make_run, point)
    implicit = make_run(*POINTS[point], mesh=TINY).start_from(start)
    _, a = implicit.go(3, 1e-10, tangent=True)
    taylor = make_run(*POINTS[point], mesh=TINY, method="dtm").start_from(start)
    _, b = taylor.go(3, 1e-8, tangent=True)
    assert np.abs(a.section - b.section).max() < 1e-6
    # two tangent flows that share no formula: derivative of the implicit step, and Taylor
    # recurrences
    assert np.abs(a.growth - b.growth).max() < 1e-6


def _order(make_run, method, steps, tangent=False, point=(4.52, 3.0), mesh=TINY):
    start = make_run(*point, mesh=mesh)
    start.go(60, 1e-8, tangent=True)

    def end(**options):
        run = make_run(*point, mesh=mesh, method=method).start_from(start)
        status, record = run.go(1, restart=True, tangent=True, **options)
        assert status == 0
        return record.growth if tangent else run.memory.state.copy()

    reference = end(max_step=2.0 * np.pi / (8 * steps[-1]), fixed=True)
    errors = [np.abs(end(max_step=2.0 * np.pi / n, fixed=True) - reference).max() for n in steps]
    print(method, steps, errors)
    return np.log(np.array(errors[:-1]) / errors[1:]) / np.log(np.array(steps[1:]) / steps[:-1])


def test_rodas_is_of_order_four(make_run):
    assert _order(make_run, "rodas", (32, 64, 128))[-1] == pytest.approx(4.0, abs=0.3)


def test_tangent_of_rodas_is_of_order_four(make_run):
    assert _order(make_run, "rodas", (64, 128, 256), tangent=True, point=(4.0, 8.0))[
        -1
    ] == pytest.approx(4.0, abs=0.4)


@pytest.mark.slow
def test_dtm_is_of_its_order(make_run):
    """Order 6; seen on a coarse film at high speed, where the stability limit leaves room for an
    error.
    """
    order = _order(make_run, "dtm", (80, 100, 120), point=(4.0, 8.0), mesh=Mesh(2, 16))
    assert order[-1] == pytest.approx(6.0, abs=0.4), order


def test_tangent_is_the_derivative_of_the_step(make_run):
    """Steps from u + e v and u - e v: the difference is the tangent step, also in contact."""
    run = make_run(18.0, 4.5, mesh=Mesh(3, 16))
    run.go(60)
    state, v = run.memory.state.copy(), run.memory.tangent.copy()
    one = {"max_step": 2.0 * np.pi / 24, "fixed": True, "period": 2.0 * np.pi / 24}
    results = []
    for sign in (1.0, -1.0, 0.0):
        run.memory.state[:], run.memory.tangent[:] = state + sign * 1e-6 * v, v
        run.go(1, tangent=True, **one)
        run.done -= 1
        results.append(run.memory.state.copy())
    difference = (results[0] - results[1]) / 2e-6
    direction = run.memory.tangent
    assert np.abs(difference / np.linalg.norm(difference) - direction).max() < 1e-6
