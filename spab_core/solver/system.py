"""The equations of film and rotor at one operating point, on one mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spab_core.design.model import Design
from spab_core.solver.axial import PLACE, SPEED
from spab_core.solver.film import (
    AUTO,
    Film,
    Mesh,
    build_film,
    gas_size,
    radial_room,
    rotor_size,
    without_storage,
)
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
        """Nodes of the film, in latitude of half the band."""
        film = self.film
        return Mesh(film.latitudes // 2 if film.whole else film.latitudes, film.columns)

    @property
    def size(self) -> int:
        """Length of the state vector."""
        return gas_size(self.film) + rotor_size(self.film)

    @property
    def unknowns(self) -> np.ndarray:
        """Positions of all unknowns: film and wall, then the rotor, without the disc if it is
        rigid, then Z and Z' where the journal moves along the axis.
        """
        n = gas_size(self.film)
        rotor = [0, 1, 4, 5] if self.rotor.rigid else [*range(ROTOR_STATES)]
        rotor += [PLACE, SPEED] * len(self.film.slide)
        return np.concatenate([np.arange(n), n + np.array(rotor)])

    def without_unbalance(self) -> System:
        """Return the system that may rest: full load from the start, no unbalance."""
        rotor = self.rotor._replace(unbalance_disc=0.0, unbalance_journal=0.0, ramp=0.0)
        return self._replace(rotor=rotor)

    def held(self) -> System:
        """Return the system whose journal is held along the axis where this one rests."""
        film = self.film
        room = radial_room(film.edge, film.offset) if film.offset else 1.0
        return self._replace(film=film._replace(slide=(), room=room))

    def without_storage(self) -> System:
        """Return the system whose wall stores no gas: it rests where this one does."""
        return self._replace(film=without_storage(self.film))


def build_system(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
    axial_offset: float | None = None,
    *,
    moving: bool = False,
) -> System:
    """Build film (:func:`~spab_core.solver.film.build_film`) and rotor
    (:func:`~spab_core.solver.rotor.build_rotor`) of an operating point; with an axial offset, over
    C, of the whole band, and of a journal that moves along the axis about it where asked for.
    """
    film = build_film(design, bearing_number, mesh, axial_offset, moving=moving)
    return System(film, build_rotor(design, rotor_mass, bearing_number, room=film.room))
