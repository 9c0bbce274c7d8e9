"""The equations of film and rotor at one operating point, on one mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spab_core.design.model import Design
from spab_core.solver.film import AUTO, Film, Mesh, build_film, film_size
from spab_core.solver.rotor import ROTOR_STATES, RotorCoefficients, build_rotor


class System(NamedTuple):
    """What every kernel takes: built once for an operating point, then handed on.

    Attributes
    ----------
    film : Film
    rotor : RotorCoefficients
    """

    film: Film
    rotor: RotorCoefficients

    @property
    def mesh(self) -> Mesh:
        """Nodes of the film."""
        return Mesh(self.film.latitudes, self.film.columns)

    @property
    def size(self) -> int:
        """Length of the state vector."""
        return film_size(self.film) + ROTOR_STATES

    @property
    def unknowns(self) -> np.ndarray:
        """Positions of all unknowns: the film, then the rotor, without the disc if it is rigid."""
        n = film_size(self.film)
        rotor = [0, 1, 4, 5] if self.rotor.rigid else range(ROTOR_STATES)
        return np.concatenate([np.arange(n), n + np.array(rotor)])

    def without_unbalance(self) -> System:
        """Return the system that may rest: full load from the start, no unbalance."""
        rotor = self.rotor._replace(unbalance_disc=0.0, unbalance_journal=0.0, ramp=0.0)
        return self._replace(rotor=rotor)


def build_system(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
) -> System:
    """Build film (:func:`~spab_core.solver.film.build_film`) and rotor
    (:func:`~spab_core.solver.rotor.build_rotor`) of an operating point.
    """
    return System(
        build_film(design, bearing_number, mesh),
        build_rotor(design, rotor_mass, bearing_number),
    )
