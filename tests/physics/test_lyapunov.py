"""The exponent's machinery on systems whose exponents are known; the code path is the rotor's own (``integrate.bind``).

Values in natural logarithm: Lorenz 0.9056 per unit time, Hénon 0.4192 per step (Sprott, Chaos and Time-Series Analysis,
2003, appendix A); Duffing and Ueda as in docs/model.md.
"""

import math

import numpy as np
import pytest
from numba import njit

from spab_core.integrate import Memory, Options, advance, bind, build_record
from spab_core.lyapunov import exponent

SIZE = 8  # states are padded to whole registers; the rest stays zero


@njit
def no_touchdown(u, new, h, row, record):
    return False


@njit
def largest(system, work, new, error):
    return np.abs(error).max()


@njit
def nothing(system, u, v, work):
    return


@njit
def dense_solve(system, work, r):
    n = work.shape[0]
    r[:n] = work @ np.ascontiguousarray(r[:n])


def system_of(slope, jacobian, curvature, force_rate):
    """Compiled advance() for a small dense system.

    slope(t, u), jacobian(t, u) and curvature(t, u, v, w) return arrays; force_rate(t) is the partial time derivative.
    """
    slope, jacobian, curvature, force_rate = map(njit, (slope, jacobian, curvature, force_rate))

    @njit
    def plain(system, t, u, work, out):
        out[:] = 0.0
        d = slope(t, u)
        out[: d.size] = d
        return True

    @njit
    def both(system, t, u, v, work, out, out_v):
        plain(system, t, u, work, out)
        out_v[:] = 0.0
        j = jacobian(t, u)
        out_v[: j.shape[0]] = j @ np.ascontiguousarray(v[: j.shape[0]])
        return True

    @njit
    def rate(system, t, out):
        out[:] = 0.0
        d = force_rate(t)
        out[: d.size] = d

    @njit
    def matrix(system, step, u, work):
        j = jacobian(0.0, u)
        work[:, :] = np.linalg.inv(np.eye(j.shape[0]) - step * j)
        return True

    @njit
    def bend(system, u, v, w, scale, work, out):
        d = curvature(u, v, w)
        out[: d.size] += scale * d

    return bind(advance, slope=plain, slope_tangent=both, time_slope=rate, linearise=matrix, solve=dense_solve,
                prepare_curvature=nothing, add_curvature=bend, error_norm=largest, observe=no_touchdown)


def growth(advance, start, periods, discard, period, tolerance=1e-6):
    n = len(start)
    state, tangent = np.zeros(SIZE), np.zeros(SIZE)
    state[:n], tangent[:n] = start, 1.0 / math.sqrt(n)
    memory = Memory(np.zeros((n, n)), np.zeros((20, SIZE)), None, state, tangent, np.zeros(5))
    options = Options(tolerance, max_step=period / 4.0, tangent=True, period=period)
    system = 0.0
    assert advance(system, memory, options, 0, discard, build_record(discard, 0))[0] == 0
    record = build_record(periods, 0)
    assert advance(system, memory, options, discard, periods, record)[0] == 0
    return exponent(record.growth)


def test_lorenz():
    def slope(t, u):
        return np.array([10.0 * (u[1] - u[0]), u[0] * (28.0 - u[2]) - u[1], u[0] * u[1] - 8.0 / 3.0 * u[2]])

    def jacobian(t, u):
        return np.array([[-10.0, 10.0, 0.0], [28.0 - u[2], -1.0, -u[0]], [u[1], u[0], -8.0 / 3.0]])

    def curvature(u, v, w):
        return np.array([0.0, -v[0] * w[2] - v[2] * w[0], v[0] * w[1] + v[1] * w[0]])

    found = growth(system_of(slope, jacobian, curvature, lambda t: np.zeros(3)), [1.0, 1.0, 20.0], 3000, 50, 1.0, 1e-5)
    assert found.value == pytest.approx(0.9056, abs=max(0.005, 3.0 * found.standard_error))
    assert found.standard_error < 0.005


def _oscillator(linear, cubic, damping, force, frequency):
    def slope(t, u):
        return np.array([u[1], -linear * u[0] - cubic * u[0] ** 3 - damping * u[1] + force * math.sin(frequency * t)])

    def jacobian(t, u):
        return np.array([[0.0, 1.0], [-linear - 3.0 * cubic * u[0] ** 2, -damping]])

    def curvature(u, v, w):
        return np.array([0.0, -6.0 * cubic * u[0] * v[0] * w[0]])

    def force_rate(t):
        return np.array([0.0, force * frequency * math.cos(frequency * t)])

    return system_of(slope, jacobian, curvature, force_rate)


@pytest.mark.parametrize("name, parameters, expected, band", [
    ("Duffing x'' = x - x³ - 0.25 x' + 0.4 sin t", (-1.0, 1.0, 0.25, 0.4, 1.0), 0.156, 0.002),
    ("Ueda x'' = -x³ - 0.05 x' + 7.5 sin t", (0.0, 1.0, 0.05, 7.5, 1.0), 0.104, 0.001),
], ids=["Duffing", "Ueda"])
def test_forced_oscillators(name, parameters, expected, band):
    found = growth(_oscillator(*parameters), [0.1, 0.1], 40_000, 100, 2.0 * math.pi, 1e-6)
    value, error = found.value / (2.0 * math.pi), found.standard_error / (2.0 * math.pi)
    assert error < band
    assert value == pytest.approx(expected, abs=band + error)


def test_linear_system_with_known_exponent():
    """A damped forced linear oscillator: both exponents are half the divergence, -damping/2."""
    found = growth(_oscillator(2.0, 0.0, 0.3, 1.0, 1.0), [0.1, 0.1], 1000, 20, 2.0 * math.pi, 1e-8)
    assert found.value / (2.0 * math.pi) == pytest.approx(-0.15, abs=1e-4)


def test_unforced_limit_cycle_has_exponent_zero():
    """Van der Pol: the phase along the cycle neither grows nor shrinks."""
    def slope(t, u):
        return np.array([u[1], (1.0 - u[0] ** 2) * u[1] - u[0]])

    def jacobian(t, u):
        return np.array([[0.0, 1.0], [-2.0 * u[0] * u[1] - 1.0, 1.0 - u[0] ** 2]])

    def curvature(u, v, w):
        return np.array([0.0, -2.0 * (u[1] * v[0] * w[0] + u[0] * (v[0] * w[1] + v[1] * w[0]))])

    found = growth(system_of(slope, jacobian, curvature, lambda t: np.zeros(2)), [1.0, 0.0], 500, 50, 2.0 * math.pi)
    assert found.value == pytest.approx(0.0, abs=0.002)


def test_henon_map():
    """A map through the same driver: one step a period replaces the Rosenbrock step."""
    @njit
    def henon(system, work, stages, t, h, u, v, with_tangent):
        stages[12, 0], stages[12, 1] = 1.0 - 1.4 * u[0] ** 2 + u[1], 0.3 * u[0]
        stages[13, 0], stages[13, 1] = -2.8 * u[0] * v[0] + v[1], 0.3 * v[0]
        return 0.0

    run = bind(advance, rodas_step=henon, observe=no_touchdown)
    state, tangent = np.zeros(SIZE), np.zeros(SIZE)
    state[:2], tangent[0] = (0.1, 0.1), 1.0
    memory = Memory(np.zeros((2, 2)), np.zeros((20, SIZE)), None, state, tangent, np.zeros(5))
    record = build_record(200_000, 0)
    options = Options(1.0, max_step=1.0, fixed=True, tangent=True, period=1.0)
    assert run(0.0, memory, options, 0, 200_000, record)[0] == 0
    found = exponent(record.growth[100:])
    assert found.value == pytest.approx(0.4192, abs=0.003)
    assert abs(found.value - 0.4192) < 4.0 * found.standard_error + 1e-4
