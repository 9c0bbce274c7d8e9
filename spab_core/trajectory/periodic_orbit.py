"""When a run has settled on a periodic orbit: its leading Floquet multiplier, which is its exponent
for all time.

Near a periodic orbit of n revolutions a tangent n revolutions later is the image of the first by
one and the same monodromy matrix. Arnoldi's process (Saad, Numerical Methods for Large Eigenvalue
Problems, chapter 6) finds that matrix's leading multiplier from a few products with it: it starts
from a generic vector, so that no mode is hidden, however small the run has left it, and its
residual bounds the error. An orbit that repeats and whose multipliers lie inside the unit circle
attracts: running on cannot change the answer, so the run may stop. One with a multiplier outside
is unstable: no rotor stays there, and a run that came close is pushed off (:func:`push`).

Vibrations far faster than the rotation (:func:`swift_mode`) are damped by long implicit steps;
their rates are those of the linearised system as it stands, which such a vibration outruns."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spab_core.solver.film import least_gap

MAX_PERIOD = 16
CHECK_EVERY = 6  # revolutions
REPEATS = 12  # revolutions, at least, over which an orbit must repeat
SECTION = 80  # last section points that tell an orbit that repeats
NEAR = 5e-4  # mismatch of the section, over C, within which an orbit repeats
REACH = 5e-3  # distance, over C, within which Newton's method is led to the orbit
DISTANCE = 1e-3  # largest distance of a settled run from its own limit, over C
UNSTABLE = 0.001  # rate per revolution from which on a repeating orbit is called unstable
PUSH = 0.05  # off an unstable orbit: displacement over C, and relative change of the gas content
SWIFT = 10.0  # over the shaft speed: frequency from which on steps need not follow a vibration
_FEWEST, _MOST = 3, 16  # products with the monodromy matrix
# share of a multiplier by which it may be off when the process ends
_RESIDUAL = 1e-3
# of what the process has left out, beside the direction found, in the start of a second look
_DOUBT = 0.1


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
        Of ``rate``: residual of Arnoldi's process, and a quarter of the change by shorter steps.
    history : tuple of float
        Estimates of ``rate`` after one, two, ... products with the monodromy matrix.
    """

    period: int
    rate: float
    error: float
    history: tuple[float, ...] = ()


@dataclass(frozen=True)
class Multiplier:
    """The leading multiplier of a monodromy matrix.

    Attributes
    ----------
    value : complex
        One of the pair where it is complex.
    direction : ndarray, (n,)
        Real part of its eigenvector.
    error : float
        Bound to first order of ``value``'s error by the residual, over its magnitude.
    history : tuple of float
        Natural log of its magnitude after one, two, ... products.
    basis, hessenberg : ndarray, (m, n), (m, m)
        Orthonormal vectors, and the matrix between them.
    fresh : ndarray, (n,)
        A start for a second look: ``direction``, and a tenth of what the process has left out, so
        that a mode that the first start hardly held comes to the fore.
    """

    value: complex
    direction: np.ndarray
    error: float
    history: tuple[float, ...]
    basis: np.ndarray
    hessenberg: np.ndarray
    fresh: np.ndarray

    def to_limit(self, gap: np.ndarray) -> np.ndarray:
        """Vector to the orbit's limit from a state that moves by ``gap`` in a period.

        Newton's step in the modes that the process has seen; the others die within a period
        (Shroff and Keller, SIAM J. Numer. Anal. 30, 1993)."""
        h = self.hessenberg
        share = np.einsum("ij,j->i", h, np.einsum("ij,j->i", self.basis, gap))
        seen = np.linalg.solve(np.eye(len(h)) - h, share)
        moved: np.ndarray = gap + np.einsum("i,ij->j", seen, self.basis)
        return moved


Product = Callable[[np.ndarray], "np.ndarray | None"]


def window(period: int) -> int:
    """Revolutions, whole periods, over which an orbit must repeat."""
    return period * max(2, -(-REPEATS // period))


def positions(section: np.ndarray) -> np.ndarray:
    """Return the positions in rotor states: the first four columns, journal and disc, and of states
    with axial motion the ninth, Z.
    """
    return section[:, :4] if section.shape[1] < 9 else section[:, [0, 1, 2, 3, 8]]


def repeat_distances(section: np.ndarray, period: int) -> np.ndarray:
    """Distance, over C, of each section point from its image ``period`` revolutions later, shape
    (revolutions - period,).

    The largest difference of the :func:`positions`.
    """
    points = positions(section)
    farthest: np.ndarray = np.abs(points[period:] - points[:-period]).max(axis=1)
    return farthest


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
    points = positions(section)
    distance = np.abs(points[-1 - MAX_PERIOD : -1] - points[-1]).max(axis=1)
    return [int(period) for period in np.flatnonzero(distance[::-1] <= limit) + 1]


def distance(gap: float, rate: float, period: int) -> float:
    """Distance to its limit of a run that moves by ``gap`` in a period and decays at ``rate``, a
    negative one, per revolution.
    """
    return gap / -math.expm1(period * rate)


def repeating_period(section: np.ndarray) -> int | None:
    """The smallest period after which the section repeats within :data:`NEAR`; None where it
    does not.
    """
    return next((p for p in possible_periods(section, NEAR) if mismatch(section, p) <= NEAR), None)


def shortest_period(section: np.ndarray) -> int:
    """The smallest period of an orbit that repeats after as many revolutions as ``section`` has
    points: one that is approached from alternating sides repeats sooner in the limit.
    """
    count, points = len(section), positions(section)
    return next(
        d
        for d in range(1, count + 1)
        if count % d == 0 and np.abs(np.roll(points, d, axis=0) - points).max() <= NEAR
    )


def leading_multiplier(product: Product, start: np.ndarray) -> Multiplier | None:
    """Find the leading eigenvalue of a matrix by Arnoldi's process, each vector orthogonalised
    twice.

    Parameters
    ----------
    product : callable
        Multiplies a vector by the matrix; None where that fails.
    start : ndarray, (n,)
        Generic: with a part along every eigenvector.

    Returns
    -------
    Multiplier or None
        None where a product fails or vanishes, or the eigenvalue has not come to rest after 16.
    """
    basis = (start / _norm(start))[None]
    hessenberg = np.zeros((_MOST + 1, _MOST))
    history: list[float] = []
    for k in range(_MOST):
        image = product(basis[k])
        if image is None:
            return None
        for _ in range(2):  # by einsum: the same bits whatever number of threads
            share = np.einsum("ij,j->i", basis, image)
            image = image - np.einsum("i,ij->j", share, basis)
            hessenberg[: k + 1, k] += share
        rest = hessenberg[k + 1, k] = _norm(image)
        found = _leading(hessenberg[: k + 1, : k + 1], rest)
        if found is None:
            return None
        value, vector, error = found
        history.append(math.log(abs(value)))
        settled = k + 1 >= _FEWEST and abs(history[-1] - history[-2]) <= 10.0 * _RESIDUAL
        if rest == 0.0 or (settled and error <= _RESIDUAL):
            direction = np.einsum("i,ij->j", vector.real, basis)
            h = hessenberg[: k + 1, : k + 1]
            fresh = direction / _norm(direction) + _DOUBT * image / max(rest, 1e-300)
            return Multiplier(value, direction, error, tuple(history), basis, h, fresh)
        basis = np.concatenate([basis, (image / rest)[None]])
    return None


def _norm(vector: np.ndarray) -> float:
    return math.sqrt(np.einsum("i,i", vector, vector))


def _leading(h: np.ndarray, rest: float) -> tuple[complex, np.ndarray, float] | None:
    """Return the largest eigenvalue of ``h`` with its eigenvector and relative error,
    the length ``rest`` of the next vector being left out; None where all vanish.
    """
    values, vectors = np.linalg.eig(h)
    first = np.abs(values).argmax()
    if not abs(values[first]) > 0.0:
        return None
    try:
        condition = float(np.linalg.norm(np.linalg.inv(vectors)[first]))
    except np.linalg.LinAlgError:  # two eigenvectors are one
        condition = math.inf
    error = rest * abs(vectors[-1, first]) * condition / abs(values[first])
    return complex(values[first]), vectors[:, first], error


def swift_mode(values: np.ndarray) -> complex | None:
    """The least damped eigenvalue, per unit tau, of those more than :data:`SWIFT` times as fast as
    the shaft turns.

    It vibrates, or falls to the wall where a suction draws the journal.

    Parameters
    ----------
    values : ndarray of complex, (n,)
        Eigenvalues of the whole system at one instant
        (:func:`spab_core.linear_theory.spectrum.eigenvalues`).

    Returns
    -------
    complex or None
        None where there is none.
    """
    swift = values[np.abs(values) > SWIFT]
    return complex(swift[swift.real.argmax()]) if len(swift) else None


def push(state: np.ndarray, tangent: np.ndarray, edge: float | None = None) -> None:
    """Displace a state along the direction in which it leaves an unstable orbit, in place.

    By :data:`PUSH`, less where the journal is so close to the wall that this would take it more
    than half the way there.

    Parameters
    ----------
    state, tangent : ndarray, (n + 8,)
        Gas content of the film, then the rotor (:mod:`spab_core.solver.slope`).
    edge : float, optional
        Latitude of the edge, rad, where states of axial motion follow.
    """
    n = len(state) - (8 if edge is None else 16)
    gas, eccentricity = state[:n], float(np.hypot(*state[n : n + 2]))
    gap, moves = 1.0 - eccentricity, float(np.hypot(*tangent[n : n + 2]))
    if edge is not None:
        gap, moves = least_gap(edge, state[-8], eccentricity), math.hypot(moves, tangent[-8])
    largest = max(np.abs(tangent[:n][gas > 0.0] / gas[gas > 0.0]).max(), np.abs(tangent[n:]).max())
    state += min(PUSH / largest, 0.5 * gap / max(moves, 1e-300)) * tangent
