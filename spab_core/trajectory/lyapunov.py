"""Maximum Lyapunov exponent from the growth of the tangent, per revolution, natural logarithm.

The tangent-linear flow of the whole state, film and rotor, is integrated with the trajectory and
renormalised at every step (:func:`spab_core.solver.stepping.advance`). For a forced rotor the phase
is no state: a periodic orbit has a negative exponent, a torus zero, chaos a positive one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.trajectory.periodic_orbit import Settled

BATCHES = 20
_CYCLE = 12  # batches of a multiple of 12 revolutions see whole cycles of periods 2, 3, 4, 6 and 12


@dataclass(frozen=True)
class Exponent:
    """A maximum Lyapunov exponent.

    Attributes
    ----------
    value : float
        Per revolution, natural log; divide by 2 pi for per unit tau, multiply by omega / 2 pi for
        per second.
    standard_error : float
        Of the mean, by batch means.
    trace : ndarray, (revolutions,)
        Running estimate after each measured revolution; of a settled orbit, after each product with
        its monodromy matrix.
    """

    value: float
    standard_error: float
    trace: np.ndarray

    @property
    def late(self) -> float:
        """Mean growth in the second half of the measurement."""
        n, half = len(self.trace), len(self.trace) // 2
        return (
            float((n * self.trace[-1] - half * self.trace[half - 1]) / (n - half))
            if half
            else self.value
        )


def exponent(growth: np.ndarray, settled: Settled | None = None) -> Exponent | None:
    """Mean growth with its standard error, or the leading Floquet multiplier's where the run
    settled on a periodic orbit.

    Parameters
    ----------
    growth : ndarray, (revolutions,)
        Natural log of the tangent's growth in each revolution.
    settled : Settled
        The periodic orbit on which the run stopped.

    Returns
    -------
    Exponent or None
        None for fewer than two revolutions or growth that is not finite.

    Notes
    -----
    The error is that of the means of about :data:`BATCHES` consecutive batches, which keeps its
    meaning where successive revolutions are correlated (Law and Kelton, Simulation Modeling and
    Analysis, section 9.5.3)."""
    if settled is not None:
        return Exponent(settled.rate, settled.error, np.array(settled.history or (settled.rate,)))
    n = len(growth)
    if n < 2 or not np.all(np.isfinite(growth)):
        return None
    trace = np.cumsum(growth) / np.arange(1, n + 1)
    size = max(n // BATCHES, 1)
    if n >= 5 * _CYCLE:
        size = max(size - size % _CYCLE, _CYCLE)
    batches = n // size
    means = growth[n - batches * size :].reshape(batches, size).mean(axis=1)
    return Exponent(float(trace[-1]), float(means.std(ddof=1) / math.sqrt(batches)), trace)
