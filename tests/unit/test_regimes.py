"""Regimes from made-up sections with known answers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.trajectory.lyapunov import Exponent, exponent
from spab_core.trajectory.regimes import MAX_PERIOD, Regime, classify, section_period


def _section(function, revolutions=300):
    k = np.arange(revolutions)
    section = np.zeros((revolutions, 8))
    section[:, 0], section[:, 1] = function(k)
    return section


def _mle(value, error=0.001, revolutions=300):
    return Exponent(value, error, np.full(revolutions, value))


@given(st.integers(1, MAX_PERIOD), st.integers(0, 2**32 - 1))
def test_cycles_are_counted(period, seed):
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (2, period))
    section = _section(lambda k: (points[0, k % period], points[1, k % period]))
    assert section_period(section) == period
    assert classify(section, _mle(-0.3)) == Regime("periodic", period)


def test_a_cycle_longer_than_sixteen_is_not_called_periodic():
    section = _section(lambda k: (np.cos(2 * np.pi * k / 17), np.sin(2 * np.pi * k / 17)))
    assert section_period(section) == 0
    assert classify(section, _mle(0.0)).text == "quasi-periodic"


def test_torus_and_chaos_are_told_by_the_exponent():
    golden = _section(
        lambda k: (0.3 * np.cos(1.618 * k * 2 * np.pi), 0.3 * np.sin(1.618 * k * 2 * np.pi))
    )
    assert classify(golden, _mle(0.003)).text == "quasi-periodic"
    assert classify(golden, _mle(0.3, 0.02)).text == "chaotic"
    assert classify(golden, _mle(0.009, 0.001)).text == "quasi-periodic"  # under 0.01
    assert classify(golden, _mle(-0.009, 0.02)).text == "quasi-periodic"


@pytest.mark.parametrize(
    "value, error, revolutions",
    [
        (0.3, 0.2, 300),  # not three standard errors
        (0.15, 0.09, 300),
        (-0.05, 0.001, 300),  # decays, yet towards no cycle
        (0.018, 0.001, 300),  # a torus' tangent may grow by ln(301) in 300 revolutions: 0.019
        (0.3, 0.01, 99),  # too short a run
        (0.0, 0.001, 99),
    ],
)
def test_what_is_neither_clearly_zero_nor_clearly_positive_is_undecided(value, error, revolutions):
    golden = _section(lambda k: (0.3 * np.cos(1.618 * k * 2 * np.pi), 0.0 * k), revolutions)
    assert classify(golden, _mle(value, error, revolutions)) == Regime("undecided")


def test_a_rate_that_fades_is_not_chaos():
    """The mean of the first half alone is over the limit."""
    golden = _section(lambda k: (0.3 * np.cos(1.618 * k * 2 * np.pi), 0.0 * k))
    trace = np.cumsum(np.where(np.arange(300) < 150, 0.08, 0.005)) / np.arange(1, 301)
    assert classify(golden, Exponent(trace[-1], 0.001, trace)) == Regime("undecided")


def test_a_cycle_still_approached_is_periodic():
    section = _section(
        lambda k: (0.2 * (-1.0) ** k + 0.1 * np.exp(-0.01 * k) * np.cos(2.4 * k), 0.0 * k)
    )
    assert section_period(section) == 0
    assert classify(section, _mle(-0.02, 0.001)) == Regime("periodic", 2)
    assert classify(section, _mle(0.0, 0.001)).text == "quasi-periodic"


def test_regime_text():
    assert [Regime("periodic", 4).text, Regime("chaotic").text] == ["periodic-4", "chaotic"]


def test_exponent_of_white_noise_has_the_textbook_error():
    growth = np.random.default_rng(3).normal(0.5, 1.0, 4800)
    found = exponent(growth)
    assert found.value == pytest.approx(0.5, abs=0.05)
    assert found.standard_error == pytest.approx(1.0 / math.sqrt(4800), rel=0.35)
    assert found.trace[-1] == found.value and len(found.trace) == 4800


def test_exponent_of_a_cycle_has_no_error_and_of_nothing_is_none():
    assert exponent(np.tile([0.3, -0.5, 0.1, -0.4], 100)).standard_error < 1e-12
    assert exponent(np.array([1.0])) is None
    assert exponent(np.array([1.0, np.nan, 1.0])) is None
