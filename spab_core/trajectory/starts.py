"""States to start a run from instead of from rest, to find motions that exist beside the one that
rest leads to.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.solver.film import AUTO, Mesh, film_size, thickness
from spab_core.solver.system import build_system
from spab_core.trajectory.point_file import load_point

WHIRLING = "whirling"  # the start that is no file
ECCENTRICITY = 0.8  # of the large orbit, over C
WHIRL_RATIO = 0.5  # its frequency over the shaft speed: that of a film whirl


def whirling_start(
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> np.ndarray:
    """Return a state on a large circular orbit: 80 % of the clearance at half the shaft speed,
    forward, journal and disc together, the film at ambient pressure.

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
    system = build_system(design, rotor_mass, bearing_number, mesh)
    n = film_size(system.film)
    state = np.zeros(system.size)
    # S = P H with P = 1
    state[:n] = thickness(system.film, ECCENTRICITY, 0.0).ravel()
    across = ECCENTRICITY * WHIRL_RATIO  # dY/dtau of a forward orbit that stands at Y = 0
    state[n:] = [ECCENTRICITY, 0.0, ECCENTRICITY, 0.0, 0.0, across, 0.0, across]
    return state


def start_of(
    text: str, design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> np.ndarray:
    """Return the state that ``text`` names.

    Parameters
    ----------
    text : str
        "whirling" (:func:`whirling_start`), or a point file
        (:func:`~spab_core.trajectory.point_file.save_point`), whose last state it is.
    design, rotor_mass, bearing_number, mesh
        Those of the run to start.

    Raises
    ------
    InputError
        For a file that cannot be read or whose run failed.
    """
    if text == WHIRLING:
        return whirling_start(design, rotor_mass, bearing_number, mesh)
    point = load_point(Path(text))
    if point.trajectory.status != "ok":
        raise InputError(
            f"the run in {text[:200]!r} failed ({point.trajectory.status}): its last state is no "
            "start"
        )
    return point.trajectory.final
