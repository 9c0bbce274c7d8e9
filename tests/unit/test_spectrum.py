"""Amplitudes of known sines, Parseval's theorem, lines between two orders."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spab_core.common.errors import InputError
from spab_core.trajectory.spectrum import WINDOWS, spectrum

SAMPLES, REVOLUTIONS = 96, 48
ANGLE = np.arange(SAMPLES * REVOLUTIONS) / SAMPLES  # revolutions


def made(*lines, mean=0.0):
    return mean + sum(a * np.cos(2 * np.pi * order * ANGLE + phase) for order, a, phase in lines)


@pytest.mark.parametrize("window", WINDOWS)
def test_a_sum_of_sines_gives_its_amplitudes(window):
    lines = [(0.5, 0.3, 0.1), (1.0, 0.12, 1.0), (2.0, 0.05, -2.0)]
    found = spectrum(made(*lines, mean=0.4), SAMPLES, window)
    for order, amplitude, _ in lines:
        assert found.amplitude[np.argmin(abs(found.order - order))] == pytest.approx(
            amplitude, rel=1e-9
        )
    assert [round(o, 9) for o, _ in found.lines()] == [0.5, 1.0, 2.0]
    assert (
        found.order[-1] == SAMPLES / 2 and found.amplitude[0] < 1e-3
    )  # the mean does not drown slow lines


def test_a_line_between_two_orders_is_seen_at_most_15_percent_low():
    """Scalloping of the Hann window: cos(pi/2)/(1 - 1/4) times 2/pi, 0.8488 half way (Harris, Proc.

    IEEE 66, 1978, table 1).
    """
    found = spectrum(made((1.0 + 0.5 / REVOLUTIONS, 0.2, 0.7)), SAMPLES)
    assert found.amplitude.max() == pytest.approx(0.2 * 0.8488, rel=2e-3)


@settings(max_examples=30)
@given(st.integers(16, 501), st.sampled_from(WINDOWS), st.integers(0, 1000))
def test_parseval(n, window, seed):
    """The windowed signal's mean square is that of the amplitudes: half of each square, the whole
    one of unpaired lines.
    """
    x = np.random.default_rng(seed).standard_normal(n)
    w = np.ones(n) if window == "rectangular" else 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    a = spectrum(x, 10, window).amplitude * w.mean()
    power = 0.5 * (a**2).sum() + 0.5 * a[0] ** 2 + (0.5 * a[-1] ** 2 if n % 2 == 0 else 0.0)
    assert power == pytest.approx((((x - x.mean()) * w) ** 2).mean(), rel=1e-9)


def test_nothing_swings():
    assert spectrum(np.full(64, 0.3), 16).lines() == []


@pytest.mark.parametrize(
    "signal, window, text",
    [
        (np.zeros(15), "hann", "at least 16"),
        (np.full(32, np.nan), "hann", "finite"),
        (np.zeros(32), "flat", "hann"),
    ],
)
def test_wrong_values_are_said_in_words(signal, window, text):
    with pytest.raises(InputError, match=text):
        spectrum(signal, 8, window)
