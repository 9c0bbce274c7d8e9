"""When a run has settled on a periodic orbit: its leading Floquet multiplier, which is its exponent
for all time.

Near a periodic orbit of n revolutions the tangents a period apart obey v[k + 1] = A v[k] with one
and the same monodromy A. After some revolutions few modes are left, and consecutive tangents
satisfy a linear recurrence whose roots are the leading multipliers (Krylov, 1931: the same idea as
Arnoldi's method and dynamic mode decomposition). An orbit that repeats and whose multipliers lie
inside the unit circle attracts: running on cannot change the answer, so the run may stop. One with
a multiplier outside is unstable: no rotor stays there, and a run that came close is pushed off
(:func:`push`).

Vibrations far faster than the rotation (:func:`swift_mode`) are damped by long implicit steps;
their rates are those of the linearised system as it stands, which such a vibration outruns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.common.threads import one_thread

MAX_PERIOD = 16
CHECK_EVERY = 12  # revolutions
NEAR = 3e-3  # mismatch of the section, over C, from which on the tangent is worth its cost
DISTANCE = 5e-4  # largest distance of a settled orbit from its limit, over C
_RESIDUAL = 2e-3  # of the recurrence
UNSTABLE = 0.001  # rate per revolution from which on a repeating orbit is called unstable
PUSH = 0.05  # off an unstable orbit: displacement over C, and relative change of the gas content
_ORDERS = 4  # most modes told apart
_FITS = 4  # successive tangents that must obey the same recurrence
SWIFT = 10.0  # over the shaft speed: frequency from which on steps need not follow a vibration
MEMORY = MAX_PERIOD * (_FITS + 1)  # tangents worth keeping


@dataclass(frozen=True)
class Settled:
    """A periodic orbit that a run has reached: an attractor if ``rate`` is negative, else unstable.

    Attributes
    ----------
    period : int
        Revolutions after which the orbit repeats.
    rate : float
        Natural log of the leading multiplier's magnitude, per revolution: the maximum Lyapunov
        exponent.
    error : float
        Change of ``rate`` since the check before.
    """

    period: int
    rate: float
    error: float


def window(period: int) -> int:
    """Revolutions, whole periods, over which an orbit must repeat."""
    return period * max(2, -(-CHECK_EVERY // period))


def repeat_distances(section: np.ndarray, period: int) -> np.ndarray:
    """Distance, over C, of each section point from its image ``period`` revolutions later, shape
    (revolutions - period,).

    The largest difference of the first four columns, the positions of journal and disc.
    """
    points = section[:, :4]
    return np.abs(points[period:] - points[:-period]).max(axis=1)


def mismatch(section: np.ndarray, period: int) -> float:
    """Largest distance, over C, between section points ``period`` revolutions apart, in the last
    :func:`window` points.

    Parameters
    ----------
    section : ndarray, (revolutions, >= 4)
        Rotor states at tau = 2 pi k.
    period : int

    Returns
    -------
    float
        inf where there are too few points.
    """
    count = window(period)
    if len(section) < count + period:
        return math.inf
    return float(repeat_distances(section[len(section) - count - period :], period).max())


def possible_periods(section: np.ndarray, limit: float) -> list[int]:
    """Periods whose last section point repeats within ``limit``, over C: the only ones whose
    :func:`mismatch` can.
    """
    before = section[-1 - MAX_PERIOD : -1, :4]
    distance = np.abs(before - section[-1, :4]).max(axis=1)
    return [int(period) for period in np.flatnonzero(distance[::-1] <= limit) + 1]


def is_near(section: np.ndarray) -> bool:
    """Whether the section comes close to repeating after at most 16 revolutions."""
    return any(mismatch(section, period) < NEAR for period in possible_periods(section, NEAR))


def leading_rate(tangent: np.ndarray, growth: np.ndarray, period: int) -> float | None:
    """Log of the leading multiplier's magnitude, per revolution.

    Parameters
    ----------
    tangent : ndarray, (revolutions, n)
        Unit tangents at the ends of consecutive revolutions.
    growth : ndarray, (revolutions,)
        Natural log of the tangent's growth in each revolution.
    period : int

    Returns
    -------
    float or None
        None where no recurrence of order 4 or less holds yet.
    """
    log_size = np.cumsum(growth)
    for order in range(1, _ORDERS + 1):
        count = _FITS + order
        if len(tangent) < (count - 1) * period + 1:
            return None
        at = len(tangent) - 1 - period * np.arange(count)[::-1]
        rows, right = [], []
        for k in range(_FITS):
            chosen = at[k : k + order + 1]
            sizes = np.exp(np.clip(log_size[chosen] - log_size[chosen[-1]], -300.0, 300.0))
            rows.append((tangent[chosen[:-1]] * sizes[:-1, None]).T)
            right.append(tangent[chosen[-1]])
        # normal equations by einsum: the same bits whatever number of threads the linear algebra
        # library takes
        a, b = np.concatenate(rows), np.concatenate(right)
        scale = np.sqrt(np.einsum("ik,ik->k", a, a))
        if not (np.isfinite(scale).all() and scale.all()):
            return None
        a /= scale
        gram, moment = np.einsum("ik,il->kl", a, a), np.einsum("ik,i->k", a, b)
        try:
            x = np.linalg.solve(gram, moment)
        except np.linalg.LinAlgError:
            return None
        wrong = b - np.einsum("ik,k->i", a, x)
        if np.einsum("i,i", wrong, wrong) < _RESIDUAL**2 * np.einsum("i,i", b, b):
            roots = np.roots(np.concatenate([[1.0], -(x / scale)[::-1]]))
            largest = float(np.abs(roots).max()) if len(roots) else 0.0
            return math.log(largest) / period if largest > 0.0 else None
    return None


def find_settled(
    section: np.ndarray, tangent: np.ndarray, growth: np.ndarray, rates: dict[int, float]
) -> Settled | None:
    """The periodic orbit that a run has reached, if it has.

    The smallest period whose section mismatch, divided by one less the leading multiplier, the
    distance to the limit, is under :data:`DISTANCE`, with a negative rate that has not changed by
    more than 1 % and 0.001 since the check before; or one as close with a rate over
    :data:`UNSTABLE`.

    Parameters
    ----------
    section, tangent, growth : ndarray
        Of the last revolutions, all ending at the same one.
    rates : dict
        Rates by period at the check before; replaced by those found now.

    Returns
    -------
    Settled or None
    """
    before = dict(rates)
    rates.clear()
    for period in possible_periods(section, DISTANCE):
        gap = mismatch(section, period)
        if gap > DISTANCE:
            continue
        rate = leading_rate(tangent, growth, period)
        if rate is None:
            continue
        rates[period] = rate
        if (
            period not in before
            or (rate < 0.0 and gap > -math.expm1(period * rate) * DISTANCE)
            or 0.0 <= rate < UNSTABLE
        ):
            continue
        change = abs(rate - before[period])
        if change < 0.001 + 0.01 * abs(rate):
            return Settled(period, rate, change)
    return None


def repeating_period(section: np.ndarray) -> int | None:
    """The smallest period after which the section repeats within :data:`DISTANCE`; None where it
    does not.
    """
    return next(
        (p for p in possible_periods(section, DISTANCE) if mismatch(section, p) <= DISTANCE), None
    )


def strong_rate(tangent: np.ndarray, growth: np.ndarray, period: int) -> Settled:
    """The rate of a strongly damped orbit, from tangents on fine steps of which the first half
    aligns.

    The leading multiplier where successive tangents obey a recurrence, else the mean growth in the
    second half.

    Parameters
    ----------
    tangent : ndarray, (revolutions, n)
    growth : ndarray, (revolutions,)
    period : int
    """
    mean = float(growth[len(growth) // 2 :].mean())
    rate, before = (
        leading_rate(tangent, growth, period),
        leading_rate(tangent[:-1], growth[:-1], period),
    )
    if rate is None or before is None or abs(rate - mean) > 0.1 * abs(mean):
        return Settled(
            period, mean, float(growth[len(growth) // 2 :].std(ddof=1) / math.sqrt(len(growth) / 2))
        )
    return Settled(period, rate, abs(rate - before))


@one_thread
def swift_mode(jacobian: np.ndarray) -> complex | None:
    """The least damped eigenvalue, per unit tau, of those more than :data:`SWIFT` times as fast as
    the shaft turns.

    It vibrates, or falls to the wall where a suction draws the journal.

    Parameters
    ----------
    jacobian : ndarray, (n, n)
        Of the whole system at one instant (:func:`spab_core.solver.slope.slope_and_jacobian`).

    Returns
    -------
    complex or None
        None where there is none.
    """
    values = np.linalg.eigvals(jacobian)
    swift = values[np.abs(values) > SWIFT]
    return complex(swift[swift.real.argmax()]) if len(swift) else None


def push(state: np.ndarray, tangent: np.ndarray) -> None:
    """Displace a state along the direction in which it leaves an unstable orbit, in place.

    By :data:`PUSH`, less where the journal is so close to the wall that this would take it more
    than half the way there.

    Parameters
    ----------
    state, tangent : ndarray, (n + 8,)
        Gas content of the film, then the rotor (:mod:`spab_core.solver.slope`).
    """
    gas, journal = state[:-8], tangent[-8:-6]
    room = 0.5 * (1.0 - np.hypot(*state[-8:-6]))
    largest = max(
        np.abs(tangent[:-8][gas > 0.0] / gas[gas > 0.0]).max(), np.abs(tangent[-8:]).max()
    )
    state += min(PUSH / largest, room / max(np.hypot(*journal), 1e-300)) * tangent
