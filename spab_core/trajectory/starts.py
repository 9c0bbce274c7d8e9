"""States to start a run from instead of from rest, to find motions that exist beside the one that
rest leads to.
"""

from __future__ import annotations

import numpy as np

from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import running_system
from spab_core.solver.film import (
    AUTO,
    MOTION_STATES,
    Mesh,
    film_size,
    radial_room,
    rotor_size,
    thickness,
    with_wall,
)

WHIRLING = "whirling"  # the start that is no file
ECCENTRICITY = 0.8  # of the large orbit, over C
WHIRL_RATIO = 0.5  # its frequency over the shaft speed: that of a film whirl


def whirling_start(
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> np.ndarray:
    """Return a state on a large circular orbit: 80 % of the clearance at half the shaft speed,
    forward (of a journal displaced along the axis 80 % of the room that is left), journal and disc
    together, the film at ambient pressure, the wall as steady flow into
    it leaves it; along the axis at rest.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    mesh : Mesh

    Returns
    -------
    ndarray
        State vector for ``start`` of :func:`~spab_core.trajectory.run.simulate` on this mesh.
    """
    system = running_system(design, rotor_mass, bearing_number, mesh)
    n = film_size(system.film)
    state = np.zeros(n + rotor_size(system.film))
    if system.film.slide:
        state[-MOTION_STATES] = system.film.offset
    offset, eccentricity = system.film.offset, ECCENTRICITY
    if offset:
        eccentricity *= radial_room(system.film.edge, offset)
    # S = P H with P = 1
    state[:n] = thickness(system.film, eccentricity, 0.0).ravel()
    across = eccentricity * WHIRL_RATIO  # dY/dtau of a forward orbit that stands at Y = 0
    state[n : n + 8] = [eccentricity, 0.0, eccentricity, 0.0, 0.0, across, 0.0, across]
    return with_wall(system.film, state)
