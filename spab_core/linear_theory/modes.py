"""Vibrations of the rotor on its film, about the static equilibrium: frequency, damping, direction
of whirl, shape and name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from spab_core.linear_theory.spectrum import eigenvalues, leading_eigenpairs
from spab_core.solver.film import gas_size
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import System

# API 617, chapter 1: a vibration whose amplification factor is less is critically damped
LEAST_AMPLIFICATION = 2.5
SLOWEST_WHIRL = 1e-6  # frequency over the shaft speed; below it nothing oscillates
NEUTRAL = 1e-9  # per radian: a rate under it is none
FILM_MODE, SHAFT_MODE, AXIAL_MODE = "film whirl", "shaft bending", "axial vibration"


@dataclass(frozen=True)
class Mode:
    """A vibration that oscillates.

    Attributes
    ----------
    ratio : float
        Frequency over the shaft speed.
    growth : float
        Natural logarithm per revolution; negative: it decays.
    forward : bool
        Whether it whirls with the rotation.
    shape : ndarray of complex, (4,) or (5,), or None
        Journal x, y, disc x, y, and z where the journal moves along the axis; of length 1. None
        where it was not kept.
    """

    ratio: float
    growth: float
    forward: bool
    shape: np.ndarray | None = field(default=None, compare=False, repr=False)

    @property
    def root(self) -> complex:
        """Eigenvalue per unit tau."""
        return complex(self.growth / (2.0 * math.pi), self.ratio)

    @property
    def name(self) -> str:
        """:data:`AXIAL_MODE` where the journal moves along the axis more than across, of the others
        :data:`SHAFT_MODE` where the shaft is deflected by more than the journal moves in its film,
        else :data:`FILM_MODE`.
        """
        assert self.shape is not None
        journal, disc = self.shape[:2], self.shape[2:4]
        if len(self.shape) > 4 and abs(self.shape[4]) > np.linalg.norm(journal):
            return AXIAL_MODE
        bends = np.linalg.norm(disc - journal) > np.linalg.norm(journal)
        return SHAFT_MODE if bends else FILM_MODE

    def likeness(self, other: Mode) -> float:
        """Modal assurance criterion of the two shapes, 0 to 1."""
        assert self.shape is not None and other.shape is not None
        return float(abs(np.vdot(self.shape, other.shape)) ** 2)

    @property
    def log_decrement(self) -> float:
        """Natural logarithm of the ratio of successive amplitudes, one period apart."""
        return -self.growth / self.ratio

    @property
    def amplification(self) -> float:
        """Amplification factor pi / log decrement, 1/(2 D) of the damping ratio D; inf where it
        does not decay.
        """
        return math.pi / self.log_decrement if self.log_decrement > 0.0 else math.inf

    @property
    def axial_amplification(self) -> float:
        """Amplitude along the axis over the unbalance eccentricity, at most, where the speed is
        that of a vibration along the axis: the amplification times the share with which the disc
        moves across, 0 where film and wall are the same on both sides.
        """
        assert self.shape is not None
        across = float(np.linalg.norm(self.shape[2:4]))
        share = across / math.hypot(across, abs(self.shape[4]))
        return share * self.amplification if share > 0.0 else 0.0

    def record(self) -> dict[str, Any]:
        """Return plain values; no amplification where it does not decay."""
        factor = self.amplification
        return {
            "whirl_ratio": self.ratio,
            "log_decrement": self.log_decrement,
            "amplification": factor if math.isfinite(factor) else None,
            "forward": self.forward,
        }


def rotor_modes(system: System, state: np.ndarray) -> list[Mode]:
    """Find all vibrations of film and rotor, the least stable first; where the wall stores gas
    those with a damping ratio under 0.7, since flows in the wall hardly swing.

    Parameters
    ----------
    system : System
        Without unbalance.
    state : ndarray
        Its static equilibrium.
    """
    unknowns, n = system.unknowns, gas_size(system.film)
    if system.film.depth:
        values, vectors = leading_eigenpairs(system, state)
    else:
        _, jacobian = slope_and_jacobian(system, state, unknowns)
        values, vectors = np.linalg.eig(jacobian[unknowns])
    journal = vectors[n : n + 2]
    disc = journal if system.rotor.rigid else vectors[n + 2 : n + 4]
    shapes = np.concatenate([journal, disc])
    if system.film.slide:
        shapes = np.concatenate([shapes, vectors[-2:-1]])
    swings: np.ndarray = np.any(shapes, axis=0)
    if system.film.depth:
        swings &= values.imag > -values.real
    return modes_of(values, shapes, swings)


def modes_of(values: np.ndarray, shapes: np.ndarray, swings: np.ndarray) -> list[Mode]:
    """Return the vibrations among eigenpairs, the least stable first.

    Parameters
    ----------
    values : ndarray of complex, (m,)
    shapes : ndarray of complex, (4, m) or (5, m)
        As :attr:`Mode.shape`, of any length.
    swings : ndarray of bool, (m,)
        Which of them may count; besides, their frequency is at least :data:`SLOWEST_WHIRL`.
    """
    x, y = shapes[0:4:2], shapes[1:4:2]
    # with the rotation, from X to Y, the motion along Y follows a quarter of a turn later
    forward = (np.abs(x + 1j * y) ** 2).sum(0) > (np.abs(x - 1j * y) ** 2).sum(0)
    return [
        Mode(
            float(values[k].imag),
            2.0 * math.pi * float(values[k].real),
            bool(forward[k]),
            shapes[:, k] / np.linalg.norm(shapes[:, k]),
        )
        for k in np.argsort(-values.real)
        if swings[k] and values[k].imag > SLOWEST_WHIRL
    ]


def axial_drift(system: System, state: np.ndarray) -> float | None:
    """Return the fastest growth per revolution that does not oscillate, None where nothing grows
    so: a journal that moves along the axis may drift off where its film does not hold it. A
    journal that nothing holds or pushes has 0, whatever rounding makes of it.

    Parameters
    ----------
    system, state
        Those of :func:`rotor_modes`.
    """
    values = eigenvalues(system, state)
    still = values[(values.real > -NEUTRAL) & (np.abs(values.imag) <= SLOWEST_WHIRL)]
    if not len(still):
        return None
    growth = float(still.real.max())
    return 2.0 * math.pi * growth if growth > NEUTRAL else 0.0


def lightly_damped(modes: Iterable[Mode]) -> tuple[Mode, ...]:
    """Return the vibrations whose amplification factor is at least :data:`LEAST_AMPLIFICATION`, by
    rising logarithmic decrement.
    """
    light = [mode for mode in modes if mode.amplification >= LEAST_AMPLIFICATION]
    return tuple(sorted(light, key=lambda mode: mode.log_decrement))
