"""Eigenvalues of film, wall and rotor, where the wall stores gas: of a system too large for dense
linear algebra in which every node's column of the wall is eliminated exactly.

At a complex frequency p the columns leave a system of the film's own size (:class:`GasSystem`).
What the film answers to the journal's displacement at many frequencies spans a space in which the
whole system has a few dozen unknowns (rational Krylov space; Ruhe, Linear Algebra Appl. 58, 1984,
391): it has the dynamic stiffness of the whole at these frequencies. Some vectors of inverse
iteration add the slowest flows in the wall. Every eigenvalue found there is then taken to one of
the whole system by inverse iteration; one that does not come to rest is dropped, unless it
grows."""

from __future__ import annotations

import math

import numpy as np

from spab_core.common.threads import one_thread
from spab_core.solver.film import film_array, film_size, gas_array, gas_size, placed, thickness
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import System

SLOWEST, SHIFTS_A_DECADE = 0.01, 6  # frequencies over the shaft speed of the space
FASTEST = 30.0  # the last of them, unless a faster one is asked for
_INVERSE_ITERATIONS = 12
# as many eigenvalues are taken to the whole system's; within this share of their size
_MOST, _DECAYS, _AT_REST, _STEPS = 16, 3, 1e-9, 8
_SAME = 1e-6


class GasSystem:
    """Solves (p I - A) x = r for the linearised film and wall, A their Jacobian.

    Every node's column of the wall is taken to its own modes, once for all p. The flow between its
    planes is tridiagonal with positive off-diagonals: scaled, it is symmetric, and its modes only
    decay.

    Parameters
    ----------
    jacobian : ndarray, (n, n)
        A: the film's M N entries, then the wall's, plane by plane.
    nodes : int
        M N.
    """

    def __init__(self, jacobian: np.ndarray, nodes: int) -> None:
        self.film, self.nodes = jacobian[:nodes, :nodes], nodes
        parts = len(jacobian) // nodes
        columns = np.einsum("aibi->iab", jacobian.reshape(parts, nodes, parts, nodes))
        self.wall, self.inward = columns[:, 1:, 1:], columns[:, 0, 1:]
        self.outward = columns[:, 1:, 0]
        upper, lower = (np.diagonal(self.wall, k, 1, 2) for k in (1, -1))
        scale = np.ones((nodes, parts - 1, 1))
        scale[:, 1:, 0] = np.cumprod(np.sqrt(lower / upper), axis=1)
        across = scale.transpose(0, 2, 1)
        self._rates, vectors = np.linalg.eigh(self.wall / scale * across)
        self._modes, self._into_modes = scale * vectors, vectors.transpose(0, 2, 1) / across
        self._mode_inward = (self.inward[:, None, :] @ self._modes)[:, 0]
        self._mode_outward = (self._into_modes @ self.outward[:, :, None])[:, :, 0]

    @property
    def size(self) -> int:
        """Entries of film and wall, n."""
        return int(self.nodes * (1 + self.wall.shape[1]))

    def apply(self, vectors: np.ndarray) -> np.ndarray:
        """Return A x, (n, c), of vectors x (n, c)."""
        film, columns = vectors[: self.nodes], self._by_column(vectors)
        flow = self.film @ film + (self.inward[:, None, :] @ columns)[:, 0]
        return self._joined(flow, self.wall @ columns + self.outward[:, :, None] * film[:, None, :])

    def solve(self, p: complex, right: np.ndarray) -> np.ndarray:
        """Return x, (n, c), for the right-hand sides (n, c)."""
        answer = 1.0 / (p - self._rates)
        matrix = p * np.eye(self.nodes) - self.film
        driven = self._mode_outward * answer
        matrix[np.diag_indices(self.nodes)] -= (self._mode_inward * driven).sum(axis=1)
        alone = answer[:, :, None] * (self._into_modes @ self._by_column(right))
        sides = right[: self.nodes] + (self._mode_inward[:, None, :] @ alone)[:, 0]
        film = np.linalg.solve(matrix, sides)
        return self._joined(film, self._modes @ (alone + driven[:, :, None] * film[:, None, :]))

    def _by_column(self, vectors: np.ndarray) -> np.ndarray:
        """Return the wall's entries of vectors (n, c), by node and plane, (M N, planes, c)."""
        planes = vectors[self.nodes :].reshape(-1, self.nodes, vectors.shape[1])
        return np.ascontiguousarray(planes.transpose(1, 0, 2))

    def _joined(self, film: np.ndarray, columns: np.ndarray) -> np.ndarray:
        wall = columns.transpose(1, 0, 2).reshape(-1, columns.shape[2])
        return np.concatenate([film, wall])


def _weights(system: System, state: np.ndarray) -> np.ndarray:
    """Return the root of each gas entry's share of a norm in which flow only dissipates: area and
    capacity times dQ over the change of the entry.
    """
    film = system.film
    gas = gas_array(film, state)
    h = thickness(placed(film, state), *state[gas_size(film) :][:2])
    shares = [2.0 * film_array(film, state) / h**2]
    shares += [2.0 * c * p for c, p in zip(film.capacity, gas[1:], strict=True)]
    whole = np.concatenate([(film.area[:, None] * share).ravel() for share in shares])
    return np.asarray(np.sqrt(whole))


@one_thread
def leading_eigenpairs(
    system: System, state: np.ndarray, slowest: float = SLOWEST, fastest: float = FASTEST
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of the whole system linearised about a state, those whose real part is largest.

    Parameters
    ----------
    system : System
        Whose wall stores gas.
    state : ndarray
    slowest, fastest : float
        Frequencies over the shaft speed between which the rotor's vibrations are sought.

    Returns
    -------
    values : ndarray of complex, (k,)
        Per unit tau, real part falling, imaginary part at least 0: of a pair one.
    vectors : ndarray of complex, (unknowns, k)
    """
    places = system.unknowns
    _, jacobian = slope_and_jacobian(system, state, places)
    whole = np.ascontiguousarray(jacobian[places])
    return coupled_eigenpairs(whole, system, state, slowest, fastest)


def coupled_eigenpairs(
    whole: np.ndarray,
    system: System,
    state: np.ndarray,
    slowest: float = SLOWEST,
    fastest: float = FASTEST,
) -> tuple[np.ndarray, np.ndarray]:
    """:func:`leading_eigenpairs` of a system's film and wall with any rotor: ``whole`` is the
    Jacobian, the gas before the rotor's unknowns.
    """
    n = gas_size(system.film)
    gas = GasSystem(whole[:n, :n], film_size(system.film))
    drive = whole[:n, n:]
    drive = np.ascontiguousarray(drive[:, drive.any(axis=0)])  # by displacements in the film
    # springs over masses bound the frequency of whatever vibrates on them
    fastest = max(fastest, 2.0 * math.sqrt(np.abs(whole[n:, n:]).max()))
    weights = _weights(system, state)
    space = _space(gas, drive, slowest, fastest) * weights[:, None]
    left, sizes, _ = np.linalg.svd(space / np.linalg.norm(space, axis=0), full_matrices=False)
    basis = left[:, sizes > 1e-10 * sizes[0]]
    # the small system: coordinates in the space, then the rotor as it is
    lifted = basis / weights[:, None]
    inside = basis.T * weights
    small = np.block(
        [
            [inside @ gas.apply(lifted), inside @ whole[:n, n:]],
            [whole[n:, :n] @ lifted, whole[n:, n:]],
        ]
    )
    values, vectors = np.linalg.eig(small)
    found: list[tuple[complex, np.ndarray]] = []
    r = basis.shape[1]
    for k in _wanted(values):
        guess = np.concatenate([lifted @ vectors[:r, k], vectors[r:, k]])
        pair = _refined(gas, whole, complex(values[k]), guess)
        if pair is None and values[k].real > 0.0:  # rather a growth in doubt than none
            pair = complex(values[k]), guess
        if pair and not any(abs(pair[0] - other) < _SAME * abs(other) for other, _ in found):
            found.append(pair)
    found.sort(key=lambda pair: -pair[0].real)
    return np.array([value for value, _ in found]), np.array([v for _, v in found]).T


def _wanted(values: np.ndarray) -> list[int]:
    """Return the places of what may swing or grow, and of the slowest decays."""
    order = [k for k in np.argsort(-values.real) if values[k].imag >= 0.0]
    swings = [k for k in order if -values[k].real < values[k].imag]
    return [*swings[:_MOST], *[k for k in order if k not in swings][:_DECAYS]]


@one_thread
def eigenvalues(
    system: System, state: np.ndarray, slowest: float = SLOWEST, fastest: float = FASTEST
) -> np.ndarray:
    """Eigenvalues of the whole system linearised about a state.

    Parameters are those of :func:`leading_eigenpairs`.

    Returns
    -------
    ndarray of complex
        Per unit tau: all of them, or, where the wall stores gas, those of
        :func:`leading_eigenpairs`.
    """
    if system.film.depth:
        return leading_eigenpairs(system, state, slowest, fastest)[0]
    unknowns = system.unknowns
    return np.linalg.eigvals(slope_and_jacobian(system, state, unknowns)[1][unknowns])


def _space(gas: GasSystem, drive: np.ndarray, slowest: float, fastest: float) -> np.ndarray:
    """Return vectors, by columns, that span the space."""
    count = 2 + math.ceil(SHIFTS_A_DECADE * math.log10(fastest / slowest))
    answers = [gas.solve(1j * nu, drive) for nu in np.geomspace(slowest, fastest, count)]
    columns = [part for answer in answers for part in (answer.real, answer.imag)]
    vector = np.random.default_rng(0).standard_normal((len(drive), 1))
    for _ in range(_INVERSE_ITERATIONS):
        vector = gas.solve(0.0, vector)
        vector = vector / np.linalg.norm(vector)
        columns.append(vector)
    return np.concatenate([gas.solve(0.0, drive), *columns], axis=1)


def _refined(
    gas: GasSystem, whole: np.ndarray, value: complex, vector: np.ndarray
) -> tuple[complex, np.ndarray] | None:
    """Take an eigenpair to one of the whole system by inverse iteration; None where it does not
    come to rest near by.
    """
    n, start = gas.size, value
    rotor = whole[n:, n:]
    vector = vector / np.linalg.norm(vector)
    for _ in range(_STEPS):
        sides = np.concatenate([vector[:n, None], whole[:n, n:]], axis=1)
        answers = gas.solve(value, sides)
        own, driven = answers[:, :1], answers[:, 1:]
        border = value * np.eye(len(rotor)) - rotor - whole[n:, :n] @ driven
        try:
            moved = np.linalg.solve(border, vector[n:, None] + whole[n:, :n] @ own)
        except np.linalg.LinAlgError:  # it is one to the last bit
            return value, vector
        image = np.concatenate([own + driven @ moved, moved])[:, 0]
        change = -1.0 / np.vdot(vector, image)
        # (value I - J) image = vector: the eigenvalue lies at value - 1 / <vector, image>
        value, vector = value + change, image / np.linalg.norm(image)
        if not np.isfinite(value) or abs(value - start) > 0.1 * max(abs(start), 1e-3):
            return None
        if abs(change) < _AT_REST * abs(value):
            if abs(value.imag) < _SAME * abs(value):
                value = complex(value.real)
            return (value, vector) if value.imag >= 0.0 else None
    return None
