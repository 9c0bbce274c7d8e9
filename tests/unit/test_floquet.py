"""Periodic orbits of made-up maps with known multipliers."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.trajectory import shooting
from spab_core.trajectory.periodic_orbit import (
    NEAR,
    PUSH,
    REACH,
    leading_multiplier,
    mismatch,
    push,
    repeating_period,
    shortest_period,
    window,
)
from spab_core.trajectory.shooting import Shooting


def with_eigenvalues(values):
    """A matrix that is not normal, with these eigenvalues (complex ones stand for a pair)."""
    random = np.random.default_rng(2)
    blocks = [
        np.array([[z.real, -z.imag], [z.imag, z.real]])
        if isinstance(z, complex)
        else np.array([[z]])
        for z in values
    ]
    n = sum(len(b) for b in blocks)
    d, k = np.zeros((n, n)), 0
    for b in blocks:
        d[k : k + len(b), k : k + len(b)] = b
        k += len(b)
    basis = np.eye(n) + 0.4 * random.standard_normal((n, n))
    return basis @ d @ np.linalg.inv(basis)


def found_by(matrix, start=None):
    """The process on a matrix, from a generic vector."""
    generic = np.random.default_rng(4).standard_normal(len(matrix))
    return leading_multiplier(lambda v: matrix @ v, generic if start is None else start)


LISTS = [
    (0.8, 0.2, -0.1),
    (-0.7, 0.3, 0.1),
    (0.5 + 0.6j, 0.3, 0.05),
    (0.9, -0.85, 0.2, 0.1),
    (0.1 + 0.88j, 0.85, 0.1),
    (1.1, 0.2),
    (0.52, 0.45, 0.07 + 0.01j, 0.05, 0.05j, 0.045),
    tuple(0.6 * 0.7**k for k in range(30)),
]


@pytest.mark.parametrize("values", LISTS)
def test_the_largest_multiplier_within_its_error(values):
    found, largest = found_by(with_eigenvalues(values)), max(abs(z) for z in values)
    assert abs(abs(found.value) / largest - 1.0) < max(3.0 * found.error, 1e-9)
    assert found.error < 1e-3 and found.history[-1] == math.log(abs(found.value))


@given(st.floats(0.3, 0.97), st.floats(0.05, math.pi - 0.05), st.floats(0.0, 0.5))
def test_a_pair_with_any_angle(size, angle, rest):
    values = (size * complex(math.cos(angle), math.sin(angle)), size * rest, -0.4 * size * rest)
    found = found_by(with_eigenvalues(values))
    assert found is not None and abs(found.value) == pytest.approx(size, rel=1e-3)


@pytest.mark.parametrize("part", [1e-2, 1e-3, 1e-4, 1e-5])
def test_a_slow_mode_that_the_start_hardly_holds_is_found(part):
    """The multipliers of 15.2 kg, Lambda 1.5: a start with nearly nothing of the leading mode. The
    second look finds it, if the first does not."""
    values = (0.519, 0.453, 0.0739, -0.06, 0.05, 0.0488, 0.04, -0.03)
    matrix = with_eigenvalues(values)
    size, vectors = np.linalg.eig(matrix)
    weights = np.where(np.isclose(size, 0.519), part, 1.0)
    found = found_by(matrix, found_by(matrix, (vectors @ weights).real).fresh)
    assert abs(found.value) == pytest.approx(0.519, rel=1e-3)


def test_a_defective_pair():
    """Two multipliers with one eigenvector: the rate holds, to the root of rounding."""
    random = np.random.default_rng(2)
    basis = np.eye(5) + 0.4 * random.standard_normal((5, 5))
    block = np.diag((0.7, 0.7, 0.2, 0.1, 0.05))
    block[0, 1] = 0.3
    matrix = basis @ block @ np.linalg.inv(basis)
    found = found_by(matrix)
    assert found is not None and abs(found.value) == pytest.approx(0.7, rel=1e-5)


def test_no_multiplier_where_products_fail_vanish_or_never_agree():
    start = np.random.default_rng(0).standard_normal(40)
    assert leading_multiplier(lambda v: None, start) is None
    assert leading_multiplier(lambda v: 0.0 * v, start) is None
    random = np.random.default_rng(1)
    assert leading_multiplier(lambda v: random.standard_normal(40), start) is None


def test_newton_step_leads_to_the_fixed_point():
    matrix = with_eigenvalues((0.95, 0.5 + 0.6j, 0.3, 1e-9, -1e-9))
    found, away = found_by(matrix), np.arange(1.0, 7.0)
    assert np.abs(found.to_limit(matrix @ away - away) + away).max() < 1e-5


class Map(NamedTuple):
    """What :class:`Shooting` takes of a run: a state of gas and rotor, and a tangent."""

    state: np.ndarray
    tangent: np.ndarray
    control: np.ndarray


def shoot(monkeypatch, values, period=1, away=3e-4, bend=0.0):
    """Shoot for the fixed point 0 of x -> A x + bend x^2, once a period; other revolutions turn the
    state about another point. Multipliers depend on the number of steps as those of a method of
    fourth order.
    """
    matrix = with_eigenvalues(values)
    size = len(matrix)
    memory = Map(np.full(size, away), np.zeros(size), np.zeros(5))

    def advance(system, memory, options, first, revolutions, record):
        x, v = memory.state, memory.tangent
        record.growth[:] = 0.0
        for k in range(revolutions):
            if (k + 1) % period == 0:
                a = matrix * (1.0 + 0.02 * (options.max_step * 32.0 / (2.0 * math.pi)) ** 4)
                new_v = a @ v + 2.0 * bend * x * v
                x[:] = a @ x + bend * x * x
                if options.tangent:
                    record.growth[k] = math.log(np.linalg.norm(new_v))
                    v[:] = new_v / np.linalg.norm(new_v)
            record.section[k] = x[-8:] + 0.1 * ((k + 1) % period)
        return 0, revolutions

    monkeypatch.setattr(shooting, "advance", advance)
    start = memory.state.copy()
    orbit = Shooting(None, memory, 60, period, shooting.Options(), implicit=True)
    found = orbit.find(np.random.default_rng(3).standard_normal(size), 8.0)
    assert np.array_equal(memory.state, start) and not memory.tangent.any()
    return found


NINE = (0.05, -0.04, 0.03, 0.02, 0.01, 0.005, -0.002)


@pytest.mark.parametrize("period", [1, 2, 3])
@pytest.mark.parametrize("lead", [(0.8, 0.75), (-0.8, 0.7), (0.6 + 0.5j,)])
def test_the_rate_is_the_orbits_own(monkeypatch, period, lead):
    """The map bends, so that its monodromy away from the orbit is another."""
    found = shoot(monkeypatch, lead + NINE, period, bend=5.0)
    rate = math.log(abs(lead[0])) / period
    assert abs(found.settled.rate - rate) < 3.0 * found.settled.error + 1e-4
    assert found.settled.error < 0.002 + 0.002 * abs(rate) and found.settled.period == period
    assert 0.0 < found.far <= REACH


def test_an_orbit_out_of_reach_and_an_unstable_one_are_told(monkeypatch):
    assert shoot(monkeypatch, (0.9, 0.5, *NINE), away=0.02).far > REACH
    found = shoot(monkeypatch, (1.1, 0.5, *NINE), away=1e-5)
    assert found.settled.rate == pytest.approx(math.log(1.1), abs=0.002)
    assert abs(np.linalg.norm(found.direction)) > 0.1


def section_of(points, revolutions, approach=0.0, rate=-0.3):
    k = np.arange(revolutions)
    section = np.zeros((revolutions, 8))
    section[:, :4] = points[k % len(points)] + approach * np.exp(rate * k)[:, None]
    return section


def test_a_section_repeats_after_its_shortest_period():
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (2, 4))
    good = section_of(points, 100)
    assert repeating_period(good) == 2 and mismatch(good, 2) == 0.0
    assert repeating_period(section_of(points, 100, 0.08, -0.01)) is None
    # approached from alternating sides it repeats sooner in the limit
    assert shortest_period(good[:2]) == 2 and shortest_period(good[:6]) == 2
    assert shortest_period(good[:1]) == 1
    assert shortest_period(section_of(points[:1], 4) + 0.1 * NEAR) == 1


@given(st.floats(0.0, 0.999), st.floats(-math.pi, math.pi), st.integers(0, 99))
def test_a_push_keeps_gas_and_clearance(eccentricity, angle, seed):
    random = np.random.default_rng(seed)
    state, tangent = random.uniform(0.01, 3.0, 40), random.standard_normal(40)
    state[4] = tangent[4] = 0.0  # a padded cell
    state[-8:-6] = eccentricity * math.cos(angle), eccentricity * math.sin(angle)
    pushed = state.copy()
    push(pushed, tangent)
    change = pushed - state
    assert (
        np.hypot(*pushed[-8:-6]) < 1.0
        and (pushed[:4] > 0.0).all()
        and (pushed[5:-8] > 0.0).all()
        and pushed[4] == 0.0
    )
    assert np.abs(change[-8:]).max() <= PUSH * (1.0 + 1e-9)
    assert np.linalg.matrix_rank(np.array([change, tangent]), tol=1e-12) == 1  # along the tangent


def test_a_torus_does_not_repeat():
    k = np.arange(200)
    section = np.zeros((200, 8))
    section[:, 0], section[:, 1] = 0.3 * np.cos(1.618 * k), 0.3 * np.sin(1.618 * k)
    assert repeating_period(section) is None
    assert math.isinf(mismatch(section[:10], 1))


@given(st.integers(1, 16))
def test_window_is_whole_periods(period):
    assert window(period) % period == 0 and window(period) >= max(12, 2 * period)
