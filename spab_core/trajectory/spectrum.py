"""What a signal swings at: amplitudes over orders of the running speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks
from scipy.signal.windows import hann

from spab_core.common.errors import InputError
from spab_core.common.validation import check_choice

WINDOWS = ("hann", "rectangular")
_FLOOR = 1e-3  # lines under this share of the strongest one are not told


@dataclass(frozen=True)
class Spectrum:
    """One-sided amplitude spectrum.

    Attributes
    ----------
    order : ndarray, (F,)
        Frequency over the running speed, from 0 to half the samples a revolution.
    amplitude : ndarray, (F,)
        Peak amplitude of the sine at that order, in the signal's unit; the mean is taken out
        beforehand.
    resolution : float
        Distance of two orders that are told apart.
    """

    order: np.ndarray
    amplitude: np.ndarray
    resolution: float

    def lines(self, count: int = 3) -> list[tuple[float, float]]:
        """The strongest lines as (order, amplitude), strongest first."""
        peaks, _ = find_peaks(
            np.pad(self.amplitude, 1), height=max(_FLOOR * self.amplitude.max(initial=0.0), 1e-12)
        )
        peaks = peaks - 1
        strongest = peaks[np.argsort(-self.amplitude[peaks])][:count]
        return [(float(self.order[k]), float(self.amplitude[k])) for k in strongest]


def spectrum(signal: np.ndarray, samples_per_revolution: int, window: str = "hann") -> Spectrum:
    """Amplitude spectrum of a signal sampled at equal shaft angles.

    Parameters
    ----------
    signal : ndarray, (n,)
    samples_per_revolution : int
    window : str
        ``hann``: lines between two orders leak little; ``rectangular``: exact for whole periods.

    Returns
    -------
    Spectrum
        A sine at an order of the spectrum has its own amplitude there: twice the transform over the
        window's sum (Heinzel, Ruediger and Schilling, Spectrum and spectral density estimation by
        the DFT, 2002, section 9).

    Raises
    ------
    InputError
        For fewer than 16 samples, values that are not finite, or an unknown window.
    """
    x = np.asarray(signal, float)
    n = len(x)
    check_choice("window", window, WINDOWS)
    if n < 16 or not np.isfinite(x).all():
        raise InputError(
            f"a spectrum needs at least 16 finite samples: {int(np.isfinite(x).sum())} of {n} are "
            "finite"
        )
    w = hann(n, sym=False) if window == "hann" else np.ones(n)
    amplitude = 2.0 * np.abs(np.fft.rfft((x - x.mean()) * w)) / w.sum()
    amplitude[0] /= 2.0
    if n % 2 == 0:
        amplitude[-1] /= 2.0  # the highest order has no mirror image either
    width = 2.0 if window == "hann" else 1.0
    return Spectrum(
        np.fft.rfftfreq(n, 1.0 / samples_per_revolution),
        amplitude,
        width * samples_per_revolution / n,
    )
