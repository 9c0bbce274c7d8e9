"""Settled orbits from made-up linear maps with known multipliers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spab_core.trajectory.periodic_orbit import (
    PUSH,
    find_settled,
    is_near,
    leading_rate,
    mismatch,
    push,
    window,
)


def tangents(monodromy, count, period=1):
    """Unit tangents and their growth when every ``period``-th revolution applies the monodromy and
    the others a rotation.
    """
    random = np.random.default_rng(4)
    n = len(monodromy)
    turns = [np.linalg.qr(random.standard_normal((n, n)))[0] for _ in range(period - 1)]
    back = (
        np.linalg.inv(np.linalg.multi_dot(turns[::-1]))
        if len(turns) > 1
        else (turns[0].T if turns else np.eye(n))
    )
    steps = [*turns, monodromy @ back] if turns else [monodromy]
    v = random.standard_normal(n)
    found, growth = [], []
    for k in range(count):
        v = steps[k % period] @ v
        growth.append(math.log(np.linalg.norm(v)))
        v /= np.linalg.norm(v)
        found.append(v)
    return np.array(found), np.array(growth)


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


@pytest.mark.parametrize("period", [1, 2, 3])
@pytest.mark.parametrize(
    "values",
    [
        (0.8, 0.2, -0.1),
        (-0.7, 0.3, 0.1),
        (0.5 + 0.6j, 0.3, 0.05),
        (0.9, -0.85, 0.2, 0.1),
        (0.1 + 0.88j, 0.85, 0.1),
    ],
)
def test_rate_is_that_of_the_largest_multiplier(values, period):
    found = leading_rate(*tangents(with_eigenvalues(values), 40 * period, period), period)
    assert found == pytest.approx(math.log(max(abs(z) for z in values)) / period, abs=2e-4)


@settings(deadline=None)
@given(st.floats(0.3, 0.97), st.floats(0.05, math.pi - 0.05), st.floats(0.0, 0.5))
def test_rate_of_a_pair_with_any_angle(size, angle, rest):
    values = (size * complex(math.cos(angle), math.sin(angle)), size * rest, -0.4 * size * rest)
    found = leading_rate(*tangents(with_eigenvalues(values), 60), 1)
    assert found is not None and found == pytest.approx(math.log(size), abs=2e-3)


def test_no_rate_for_noise_or_too_few_tangents():
    random = np.random.default_rng(0)
    noise = random.standard_normal((60, 30))
    noise /= np.linalg.norm(noise, axis=1, keepdims=True)
    assert leading_rate(noise, random.standard_normal(60), 1) is None
    assert leading_rate(*tangents(with_eigenvalues((0.8, 0.2)), 3), 1) is None


def section_of(points, revolutions, approach=0.0, rate=-0.3):
    k = np.arange(revolutions)
    section = np.zeros((revolutions, 8))
    section[:, :4] = points[k % len(points)] + approach * np.exp(rate * k)[:, None]
    return section


def test_settled_needs_a_repeating_section_a_negative_rate_and_two_checks():
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (2, 4))
    tangent, growth = tangents(with_eigenvalues((0.8, 0.2, 0.1)), 60, 2)
    rates = {}
    good = section_of(points, 100)
    assert (
        find_settled(good, tangent, growth, rates) is None and 2 in rates
    )  # the first check only remembers
    settled = find_settled(good, tangent, growth, rates)
    assert (
        settled.period == 2
        and settled.rate == pytest.approx(0.5 * math.log(0.8), abs=1e-6)
        and settled.error < 1e-9
    )
    # too far from its limit for its slow approach: 1e-4 a period at a multiplier of 0.8 is 5e-4
    # away, and more is refused
    far = section_of(points, 100, 0.04, -0.02)
    assert 1e-4 < mismatch(far, 2) < 5e-4 and is_near(far)
    assert find_settled(far, tangent, growth, dict(rates)) is None
    # an unstable orbit is told by its positive rate; a neutral one is nothing
    for multiplier in (1.1, 1.0005):
        tangent, growth = tangents(with_eigenvalues((multiplier, 0.2, 0.1)), 60, 2)
        rates = {}
        assert find_settled(good, tangent, growth, rates) is None
        found = find_settled(good, tangent, growth, rates)
        assert rates[2] == pytest.approx(0.5 * math.log(multiplier), abs=1e-6)
        assert (found.rate == rates[2]) if multiplier == 1.1 else (found is None)


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


def test_a_torus_is_neither_near_nor_settled():
    k = np.arange(200)
    section = np.zeros((200, 8))
    section[:, 0], section[:, 1] = 0.3 * np.cos(1.618 * k), 0.3 * np.sin(1.618 * k)
    assert not is_near(section)
    assert math.isinf(mismatch(section[:10], 1))


@given(st.integers(1, 16))
def test_window_is_whole_periods(period):
    assert window(period) % period == 0 and window(period) >= max(12, 2 * period)
