"""What the rotor does: regime from stroboscopic section and exponent."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.trajectory.lyapunov import Exponent
from spab_core.trajectory.periodic_orbit import MAX_PERIOD, Settled, repeat_distances

REGIMES = ("periodic", "quasi-periodic", "chaotic", "undecided")
NO_EXPONENT = "no exponent"  # what is told in place of a regime where a run failed; "" in arrays
SECTION_TOLERANCE = 1e-3  # over C
_WINDOW = 60  # last section points looked at
_CHAOS = 0.01  # largest exponent of a torus, smallest called chaotic, per revolution
# measured revolutions without which a motion that does not repeat is undecided
FEWEST_REVOLUTIONS = 100


@dataclass(frozen=True)
class Regime:
    """A regime: ``name`` of :data:`REGIMES`, ``period`` in revolutions (0 unless periodic)."""

    name: str
    period: int = 0

    @property
    def text(self) -> str:
        """Such as "periodic-2"."""
        return f"{self.name}-{self.period}" if self.period else self.name


def section_period(section: np.ndarray, tolerance: float = SECTION_TOLERANCE) -> int:
    """Smallest n <= 16 after which the last section points repeat, 0 if none.

    Parameters
    ----------
    section : ndarray, (revolutions, >= 2)
        Rotor states at tau = 2 pi k; journal and disc positions (the first four columns) are
        compared.
    tolerance : float
        Largest distance between a point and its image, over C.
    """
    points = section[-_WINDOW:]
    for n in range(1, min(MAX_PERIOD, len(points) // 2) + 1):
        if repeat_distances(points, n).max() < tolerance:
            return n
    return 0


def _settling_period(section: np.ndarray) -> int:
    """Period of a section that still contracts towards its cycle: the smallest n whose mismatch
    halves over the run.
    """
    for n in range(1, MAX_PERIOD + 1):
        if len(section) < 4 * n + 40:
            return 0
        mismatch = repeat_distances(section, n)
        early, late = mismatch[: len(mismatch) // 4].max(), mismatch[-len(mismatch) // 4 :].max()
        if late < 0.5 * early and late < 0.02:
            return n
    return 0


def classify(section: np.ndarray, mle: Exponent, settled: Settled | None = None) -> Regime:
    """Regime of a completed run (docs/model.md).

    Chaotic where the exponent exceeds 0.01 per revolution, three standard errors and what a torus
    feigns: there the tangent grows like the time, by ln(1 + n) in n revolutions; in the second half
    of the measurement it must exceed 0.01 too. Periodic-n where the section repeats after n <= 16
    revolutions, or still contracts to such a cycle with a clearly negative exponent.
    Quasi-periodic where the exponent is within 0.01 of zero. Else undecided, as is whatever does
    not repeat in fewer than 100 measured revolutions. A run that settled is periodic.

    Parameters
    ----------
    section : ndarray, (revolutions, 8)
    mle : Exponent
    settled : Settled
        The periodic orbit on which the run stopped.
    """
    if settled is not None:
        return Regime("periodic", settled.period)
    n = len(mle.trace)
    torus = math.log1p(n) / n
    if (
        n >= FEWEST_REVOLUTIONS
        and min(mle.value, mle.late) > _CHAOS
        and mle.value > max(3.0 * mle.standard_error, torus)
    ):
        return Regime("chaotic")
    period = section_period(section)
    if not period and mle.value < -3.0 * mle.standard_error:
        period = _settling_period(section)
    if period:
        return Regime("periodic", period)
    zero = n >= FEWEST_REVOLUTIONS and abs(mle.value) <= _CHAOS
    return Regime("quasi-periodic" if zero else "undecided")
