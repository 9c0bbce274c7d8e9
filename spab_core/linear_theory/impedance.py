"""The linear bearing at one operating point: its dynamic stiffness at any complex frequency.

The linearised film is s' = A s + D q with the journal's displacement q, its force on the journal B
s + E q. At the complex frequency p (per unit tau) the film states are eliminated exactly,

    F = -Z(p) q,   Z(p) = -E - p G - B (p I - A)^-1 D

(a Schur complement; where the wall stores gas its columns are eliminated before, node by node,
:class:`spab_core.linear_theory.spectrum.GasSystem`). G is the damping of the asperities, zero where
the journal is clear of the wall. A, B, D, E come from the compiled tangent of the very equations
that are integrated in time, so the rotor on Z(p) has the eigenvalues of
:func:`spab_core.linear_theory.whirl.linear_spectrum`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from spab_core.common.threads import one_thread
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import (
    AxialStopError,
    Equilibrium,
    contact_load_share,
    dense_system,
    find_equilibrium,
)
from spab_core.linear_theory.spectrum import GasSystem
from spab_core.solver.film import AUTO, Mesh, film_size, gas_size
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import System


@dataclass(frozen=True)
class Impedance:
    """The linear bearing at one operating point.

    Attributes
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    system : System
        Without unbalance.
    equilibrium : Equilibrium
        What it is linearised about.
    film, drive, pickup : ndarray
        A (n, n), D (n, 2), B (2, n): per unit tau, lengths over C, forces over p_a R².
    direct, wall_damping : ndarray, (2, 2)
        E and G.
    """

    design: Design
    rotor_mass: float
    bearing_number: float
    system: System
    equilibrium: Equilibrium
    film: np.ndarray
    drive: np.ndarray
    pickup: np.ndarray
    direct: np.ndarray
    wall_damping: np.ndarray

    @functools.cached_property
    def _gas(self) -> GasSystem:
        return GasSystem(self.film, film_size(self.system.film))

    def _answer(self, p: complex | float, right: np.ndarray) -> np.ndarray:
        """Solve (p I - A) x = right."""
        if self.system.film.depth:
            return self._gas.solve(p, right)
        return np.linalg.solve(p * np.eye(len(self.film)) - self.film, right)

    def at(self, p: complex | float) -> np.ndarray:
        """Z(p) (2, 2) over p_a R² / C at the complex frequency p per unit tau; force: -Z q."""
        states = self._answer(p, self.drive)
        return np.asarray(-self.direct - p * self.wall_damping - self.pickup @ states)

    def coefficients(self, p: complex) -> tuple[np.ndarray, np.ndarray]:
        """Real stiffness K and damping C with K + p C = Z(p), both (2, 2).

        K is over p_a R² / C, C that per unit tau. A whirl that grows or decays as exp(p tau) feels
        exactly these; on the imaginary axis they are the usual K + i nu C. At a real p, where one
        equation is left for the two, C is the limit of a slow whirl, dZ/dp.
        """
        z = self.at(p)
        if p.imag:
            damping = z.imag / p.imag
        else:
            twice = self._answer(p.real, self._answer(p.real, self.drive))
            damping = self.pickup @ twice - self.wall_damping
        return np.asarray(z.real - p.real * damping), np.asarray(damping)

    @property
    def contact_load_share(self) -> float:
        """Share of the weight that the asperities carry at rest."""
        return contact_load_share(
            self.design,
            self.rotor_mass,
            self.equilibrium.eccentricity,
            self.system.film.room,
        )


@one_thread
def impedance(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
    guess: np.ndarray | None = None,
) -> Impedance | None:
    """Linearise the bearing about its static equilibrium.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing: the load.
    bearing_number : float
    mesh : Mesh
    guess : ndarray, optional
        State to start from, such as that of a neighbouring point.

    Returns
    -------
    Impedance or None
        None where no equilibrium was found.
    """
    try:
        system = dense_system(design, rotor_mass, bearing_number, mesh)
    except AxialStopError:
        return None
    equilibrium = find_equilibrium(system, guess)
    if equilibrium is None and guess is not None:
        equilibrium = find_equilibrium(system)
    if equilibrium is None:
        return None
    rotor, n = system.rotor, gas_size(system.film)
    journal = n + np.array([0, 1, 4, 5])
    _, jacobian = slope_and_jacobian(
        system, equilibrium.state, np.concatenate([np.arange(n), journal])
    )
    force = jacobian[n + 4 : n + 6] / rotor.inverse_mass
    shaft = rotor.coupling_journal / rotor.inverse_mass
    return Impedance(
        design,
        float(rotor_mass),
        float(bearing_number),
        system,
        equilibrium,
        film=jacobian[:n, :n],
        drive=jacobian[:n, n : n + 2],
        pickup=force[:, :n],
        direct=force[:, n : n + 2] + shaft * np.eye(2),
        wall_damping=force[:, n + 2 :],
    )
