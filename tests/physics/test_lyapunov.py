"""The exponent's machinery on systems whose exponents are known; the code path is the rotor's own
(``stepping.bind``).

Values in natural logarithm: Lorenz 0.9056 per unit time, Hénon 0.4192 per step (Sprott, Chaos and
Time-Series Analysis, 2003, appendix A); Duffing and Ueda as in docs/model.md."""

import functools
import math

import numpy as np
import pytest
from numba import njit

from spab_core.solver.rodas import build_stages
from spab_core.solver.stepping import Memory, Options, advance, bind, build_record
from spab_core.trajectory.lyapunov import exponent

SIZE = 8  # states are padded to whole registers; the rest stays zero
N = 3  # unknowns of the systems here, the last without any slope where there are two


@njit
def no_touchdown(system, u, new, h, row, record):
    return False


@njit
def largest(system, work, new, error):
    return np.abs(error).max()


@njit
def nothing(system, u, v, work):
    return


@njit
def inverse(a, out):
    """Of three by three, by cofactors: nothing is allocated, as in the rotor's own kernels."""
    for i in range(N):
        j, k = (i + 1) % N, (i + 2) % N
        for l in range(N):
            m, n = (l + 1) % N, (l + 2) % N
            out[l, i] = a[j, m] * a[k, n] - a[j, n] * a[k, m]
    determinant = a[0, 0] * out[0, 0] + a[0, 1] * out[1, 0] + a[0, 2] * out[2, 0]
    for i in range(N):
        for l in range(N):
            out[i, l] /= determinant


@njit
def times(a, v, out):
    x, y, z = v[0], v[1], v[2]
    for i in range(N):
        out[i] = a[i, 0] * x + a[i, 1] * y + a[i, 2] * z


@njit
def dense_solve(system, work, r):
    times(work[0], r, r)


def system_of(slope, jacobian, curvature, force_rate):
    """Compiled advance() for a small dense system.

    slope(p, t, u, out), jacobian(p, u, out), curvature(p, u, v, w, out) and force_rate(p, t, out),
    the partial time derivative, fill ``out``, which holds zeros; p is what ``growth`` hands on."""
    slope, jacobian, curvature, force_rate = map(njit, (slope, jacobian, curvature, force_rate))

    @njit
    def plain(system, t, u, work, out):
        out[:] = 0.0
        slope(system, t, u, out)
        return True

    @njit
    def both(system, t, u, v, work, out, out_v):
        plain(system, t, u, work, out)
        out_v[:] = 0.0
        work[1, :, :] = 0.0
        jacobian(system, u, work[1])
        times(work[1], v, out_v)
        return True

    @njit
    def rate(system, t, out):
        out[:] = 0.0
        force_rate(system, t, out)

    @njit
    def matrix(system, step, u, work):
        work[1, :, :] = 0.0
        jacobian(system, u, work[1])
        for i in range(N):
            for j in range(N):
                work[1, i, j] = (i == j) - step * work[1, i, j]
        inverse(work[1], work[0])
        return True

    @njit
    def bend(system, u, v, w, scale, work, out):
        work[2, 0, :] = 0.0
        curvature(system, u, v, w, work[2, 0])
        for i in range(N):
            out[i] += scale * work[2, 0, i]

    return bind(
        advance,
        slope=plain,
        slope_tangent=both,
        time_slope=rate,
        linearise=matrix,
        solve=dense_solve,
        prepare_curvature=nothing,
        add_curvature=bend,
        error_norm=largest,
        observe=no_touchdown,
    )


def growth(advance, start, periods, discard, period, tolerance=1e-6, system=(0.0,)):
    n = len(start)
    state, tangent = np.zeros(SIZE), np.zeros(SIZE)
    state[:n], tangent[:n] = start, 1.0 / math.sqrt(n)
    memory = Memory(np.zeros((3, N, N)), build_stages(SIZE), None, state, tangent, np.zeros(5))
    options = Options(tolerance, max_step=period / 4.0, tangent=True, period=period)
    assert advance(system, memory, options, 0, discard, build_record(discard, 0))[0] == 0
    record = build_record(periods, 0)
    assert advance(system, memory, options, discard, periods, record)[0] == 0
    return exponent(record.growth)


@pytest.mark.slow
def test_lorenz():
    def slope(p, t, u, out):
        out[0], out[1], out[2] = (
            10.0 * (u[1] - u[0]),
            u[0] * (28.0 - u[2]) - u[1],
            u[0] * u[1] - 8.0 / 3.0 * u[2],
        )

    def jacobian(p, u, out):
        out[0, 0], out[0, 1] = -10.0, 10.0
        out[1, 0], out[1, 1], out[1, 2] = 28.0 - u[2], -1.0, -u[0]
        out[2, 0], out[2, 1], out[2, 2] = u[1], u[0], -8.0 / 3.0

    def curvature(p, u, v, w, out):
        out[1], out[2] = -v[0] * w[2] - v[2] * w[0], v[0] * w[1] + v[1] * w[0]

    def force_rate(p, t, out):
        return

    found = growth(
        system_of(slope, jacobian, curvature, force_rate), [1.0, 1.0, 20.0], 3000, 50, 1.0, 1e-5
    )
    assert found.value == pytest.approx(0.9056, abs=max(0.005, 3.0 * found.standard_error))
    assert found.standard_error < 0.005


@functools.cache
def oscillator():
    """x'' = -linear x - cubic x³ - damping x' + force sin(frequency t), compiled once for all
    values.
    """

    def slope(p, t, u, out):
        linear, cubic, damping, force, frequency = p
        out[0], out[1] = (
            u[1],
            -linear * u[0] - cubic * u[0] ** 3 - damping * u[1] + force * math.sin(frequency * t),
        )

    def jacobian(p, u, out):
        out[0, 1], out[1, 0], out[1, 1] = 1.0, -p[0] - 3.0 * p[1] * u[0] ** 2, -p[2]

    def curvature(p, u, v, w, out):
        out[1] = -6.0 * p[1] * u[0] * v[0] * w[0]

    def force_rate(p, t, out):
        out[1] = p[3] * p[4] * math.cos(p[4] * t)

    return system_of(slope, jacobian, curvature, force_rate)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, parameters, expected, band",
    [
        ("Duffing x'' = x - x³ - 0.25 x' + 0.4 sin t", (-1.0, 1.0, 0.25, 0.4, 1.0), 0.156, 0.002),
        ("Ueda x'' = -x³ - 0.05 x' + 7.5 sin t", (0.0, 1.0, 0.05, 7.5, 1.0), 0.104, 0.001),
    ],
    ids=["Duffing", "Ueda"],
)
def test_forced_oscillators(name, parameters, expected, band):
    found = growth(oscillator(), [0.1, 0.1], 40_000, 100, 2.0 * math.pi, 1e-6, parameters)
    value, error = found.value / (2.0 * math.pi), found.standard_error / (2.0 * math.pi)
    assert error < band
    assert value == pytest.approx(expected, abs=band + error)


@pytest.mark.slow
def test_linear_system_with_known_exponent():
    """A damped forced linear oscillator: both exponents are half the divergence, -damping/2."""
    found = growth(
        oscillator(), [0.1, 0.1], 1000, 20, 2.0 * math.pi, 1e-8, (2.0, 0.0, 0.3, 1.0, 1.0)
    )
    assert found.value / (2.0 * math.pi) == pytest.approx(-0.15, abs=1e-4)


@pytest.mark.slow
def test_unforced_limit_cycle_has_exponent_zero():
    """Van der Pol: the phase along the cycle neither grows nor shrinks."""

    def slope(p, t, u, out):
        out[0], out[1] = u[1], (1.0 - u[0] ** 2) * u[1] - u[0]

    def jacobian(p, u, out):
        out[0, 1], out[1, 0], out[1, 1] = 1.0, -2.0 * u[0] * u[1] - 1.0, 1.0 - u[0] ** 2

    def curvature(p, u, v, w, out):
        out[1] = -2.0 * (u[1] * v[0] * w[0] + u[0] * (v[0] * w[1] + v[1] * w[0]))

    def force_rate(p, t, out):
        return

    found = growth(
        system_of(slope, jacobian, curvature, force_rate), [1.0, 0.0], 500, 50, 2.0 * math.pi
    )
    assert found.value == pytest.approx(0.0, abs=0.002)


def test_henon_map():
    """A map through the same driver: one step a period replaces the Rosenbrock step."""

    @njit
    def henon(system, work, stages, t, h, u, v, with_tangent):
        stages.new[0], stages.new[1] = 1.0 - 1.4 * u[0] ** 2 + u[1], 0.3 * u[0]
        stages.new_tangent[0], stages.new_tangent[1] = -2.8 * u[0] * v[0] + v[1], 0.3 * v[0]
        return 0.0

    run = bind(advance, rodas_step=henon, observe=no_touchdown)
    state, tangent = np.zeros(SIZE), np.zeros(SIZE)
    state[:2], tangent[0] = (0.1, 0.1), 1.0
    memory = Memory(np.zeros((2, 2)), build_stages(SIZE), None, state, tangent, np.zeros(5))
    record = build_record(200_000, 0)
    options = Options(1.0, max_step=1.0, fixed=True, tangent=True, period=1.0)
    assert run(0.0, memory, options, 0, 200_000, record)[0] == 0
    found = exponent(record.growth[100:])
    assert found.value == pytest.approx(0.4192, abs=0.003)
    assert abs(found.value - 0.4192) < 4.0 * found.standard_error + 1e-4
