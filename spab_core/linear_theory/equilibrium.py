"""Static equilibrium of the journal, and the stiffness of the concentric film."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.solver.film import DEFAULT_MESH, Film, Mesh, build_film, film_size
from spab_core.solver.rotor import ROTOR_STATES, RotorCoefficients, build_rotor
from spab_core.solver.slope import slope_and_jacobian, unknown_places

MAX_DENSE_CELLS = 2500  # cells of a mesh that dense linear algebra takes in seconds
_NEWTON_STEPS = 60


@dataclass(frozen=True)
class Equilibrium:
    """Static equilibrium under gravity, without unbalance.

    Attributes
    ----------
    eccentricity : float
        Over C.
    attitude_angle : float
        Between the load (-Y) and the journal's displacement, deg, positive with the rotation.
    state : ndarray
        Full state vector.
    """

    eccentricity: float
    attitude_angle: float
    state: np.ndarray


def _dense_film(design: Design, bearing_number: float, mesh: Mesh) -> Film:
    """The film, where its mesh is small enough for dense linear algebra; raises :class:`InputError`
    otherwise.
    """
    cells = mesh[0] * mesh[1]
    if cells > MAX_DENSE_CELLS:
        raise InputError(
            f"mesh = {mesh[0]}x{mesh[1]} has {cells} cells: linear stability allows at most "
            f"{MAX_DENSE_CELLS}"
        )
    return build_film(design, bearing_number, mesh)


def _without_unbalance(rotor: RotorCoefficients) -> RotorCoefficients:
    return rotor._replace(unbalance_disc=0.0, unbalance_journal=0.0, ramp=0.0)


def _concentric(film: Film) -> np.ndarray:
    state = np.zeros(film_size(film) + ROTOR_STATES)
    state[: film_size(film)] = 1.0
    return state


def concentric_state(film: Film, rotor: RotorCoefficients) -> np.ndarray:
    """Steady film of the centred, unloaded journal: Newton's method from P = 1."""
    state = _concentric(film)
    cells = unknown_places(film, True)[:-4]
    for _ in range(_NEWTON_STEPS):
        value, jacobian = slope_and_jacobian(film, rotor, state, cells)
        step = np.linalg.solve(jacobian[cells], value[cells])
        fraction = 1.0
        while (state[cells] - fraction * step).min() <= 0.0:
            fraction *= 0.5
        state[cells] -= fraction * step
        if np.abs(step).max() < 1e-12:
            return state
    raise InputError("no steady film of the centred journal was found; try a finer mesh")


def concentric_stiffness(
    design: Design, bearing_number: float, mesh: Mesh = DEFAULT_MESH
) -> tuple[float, float]:
    """Static stiffness of the film about the centre: F_x = -K_xx X, F_y = +K_yx X.

    Parameters
    ----------
    design : Design
    bearing_number : float
    mesh : Mesh

    Returns
    -------
    kxx, kyx : float
        Over p_a R² per clearance; times ``design.stiffness_unit`` in N/m. K_xx = K_yy, K_xy = -K_yx
        by symmetry.
    """
    film = _dense_film(design, bearing_number, mesh)
    rotor = _without_unbalance(build_rotor(design.replace(rotor__gravity=0.0), 1.0, bearing_number))
    rotor = rotor._replace(contact_force=0.0)
    state = concentric_state(film, rotor)
    cells, n = unknown_places(film, True)[:-4], film_size(film)
    _, jacobian = slope_and_jacobian(film, rotor, state, np.append(cells, n))
    response = np.linalg.solve(jacobian[cells][:, :-1], -jacobian[cells, -1])
    force = (
        jacobian[n + 4 : n + 6, :-1] @ response + jacobian[n + 4 : n + 6, -1]
    ) / rotor.inverse_mass
    shaft = rotor.coupling_journal / rotor.inverse_mass
    return float(-force[0] - shaft), float(force[1])


def static_equilibrium(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = DEFAULT_MESH,
    guess: np.ndarray | None = None,
) -> Equilibrium | None:
    """Where the journal rests under gravity, without unbalance, at speed.

    Newton's method on the whole discrete system, the load raised in steps from a concentric start.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    mesh : Mesh
    guess : ndarray, optional
        State to start from, such as that of a neighbouring point.

    Returns
    -------
    Equilibrium or None
        None where no equilibrium was found.
    """
    film = _dense_film(design, bearing_number, mesh)
    rotor = _without_unbalance(build_rotor(design, rotor_mass, bearing_number))
    unknowns, n = unknown_places(film, design.rigid), film_size(film)
    load, done, step = (1.0, 0.0, 1.0) if guess is not None else (0.25, 0.0, 0.25)
    state = (
        guess
        if guess is not None
        else concentric_state(film, rotor._replace(gravity_disc=0.0, gravity_journal=0.0))
    )
    while True:
        loaded = rotor._replace(
            gravity_disc=load * rotor.gravity_disc, gravity_journal=load * rotor.gravity_journal
        )
        found = _newton(film, loaded, state, unknowns)
        if found is None:
            step *= 0.5
            if step < 1e-3:
                return None
        else:
            state, done = found, load
            if done >= 1.0:
                break
        load = min(1.0, done + step)
    x, y = state[n], state[n + 1]
    return Equilibrium(math.hypot(x, y), math.degrees(math.atan2(x, -y)), state)


def _newton(film, rotor, state, unknowns):
    """Damped Newton iteration to f = 0; None where it does not converge."""
    state = state.copy()
    n = film_size(film)
    for _ in range(_NEWTON_STEPS):
        value, jacobian = slope_and_jacobian(film, rotor, state, unknowns)
        try:
            step = np.linalg.solve(jacobian[unknowns], value[unknowns])
        except np.linalg.LinAlgError:
            return None
        fraction = 1.0
        for _ in range(12):
            trial = state.copy()
            trial[unknowns] -= fraction * step
            if math.hypot(trial[n], trial[n + 1]) < 0.9995 and trial[:n].min() > 0.0:
                break
            fraction *= 0.5
        else:
            return None
        state = trial
        if np.abs(step).max() < 1e-10:
            return state
    return None
