"""Static equilibrium of the journal, and the stiffness of the concentric film."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.solver.film import DEFAULT_MESH, Mesh, film_size
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import System, build_system

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


def dense_system(
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = DEFAULT_MESH
) -> System:
    """Build the system without unbalance, on a mesh small enough for dense linear algebra.

    Raises
    ------
    InputError
        For a mesh of more than :data:`MAX_DENSE_CELLS` cells.
    """
    cells = mesh[0] * mesh[1]
    if cells > MAX_DENSE_CELLS:
        raise InputError(
            f"mesh = {mesh[0]}x{mesh[1]} has {cells} cells: linear stability allows at most "
            f"{MAX_DENSE_CELLS}"
        )
    return build_system(design, rotor_mass, bearing_number, mesh).without_unbalance()


def concentric_state(system: System) -> np.ndarray:
    """Return the state of the centred, unloaded journal, its film steady: Newton's method from
    P = 1.

    Raises
    ------
    InputError
        Where it does not converge.
    """
    state, cells = np.zeros(system.size), system.cells
    state[: film_size(system.film)] = 1.0
    for _ in range(_NEWTON_STEPS):
        value, jacobian = slope_and_jacobian(system, state, cells)
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
    system = dense_system(design.replace(rotor__gravity=0.0), 1.0, bearing_number, mesh)
    rotor = system.rotor._replace(contact_force=0.0)
    system = system._replace(rotor=rotor)
    state = concentric_state(system)
    cells, n = system.cells, film_size(system.film)
    _, jacobian = slope_and_jacobian(system, state, np.append(cells, n))
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
    return find_equilibrium(dense_system(design, rotor_mass, bearing_number, mesh), guess)


def find_equilibrium(system: System, guess: np.ndarray | None = None) -> Equilibrium | None:
    """:func:`static_equilibrium` of a system without unbalance."""
    rotor, n = system.rotor, film_size(system.film)

    def loaded(share: float) -> System:
        return system._replace(
            rotor=rotor._replace(
                gravity_disc=share * rotor.gravity_disc,
                gravity_journal=share * rotor.gravity_journal,
            )
        )

    load, done, step = (1.0, 0.0, 1.0) if guess is not None else (0.25, 0.0, 0.25)
    state = guess if guess is not None else concentric_state(loaded(0.0))
    while True:
        found = _newton(loaded(load), state)
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


def _newton(system: System, state: np.ndarray) -> np.ndarray | None:
    """Damped Newton iteration to f = 0; None where it does not converge."""
    state = state.copy()
    n, unknowns = film_size(system.film), system.unknowns
    for _ in range(_NEWTON_STEPS):
        value, jacobian = slope_and_jacobian(system, state, unknowns)
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
