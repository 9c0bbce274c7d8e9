"""Static equilibrium of the journal, and the stiffness of the concentric film."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.solver.film import AUTO, Mesh, film_size, suitable_mesh
from spab_core.solver.rotor import CENTRE
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import System, build_system

LIFTED = 0.1  # largest share of the weight that the wall carries under a rotor that has lifted off
AZIMUTHS = 32  # of a mesh that is not asked for: they cost little at rest
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
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> System:
    """Build the system without unbalance, whose Jacobian may be dense."""
    if mesh == AUTO:
        mesh = suitable_mesh(design, AZIMUTHS)
    return build_system(design, rotor_mass, bearing_number, mesh).without_unbalance()


def concentric_state(system: System) -> np.ndarray:
    """Return the state of the centred, unloaded journal, its film steady: Newton's method from
    P = 1.

    Raises
    ------
    InputError
        Where it does not converge.
    """
    state, cells = np.zeros(system.size), np.arange(film_size(system.film))
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
    design: Design, bearing_number: float, mesh: Mesh = AUTO
) -> tuple[float, float]:
    """Static stiffness of the film about the centre: F_x = -K_xx X - K_xy Y, F_y = -K_yx X -
    K_yy Y.

    Parameters
    ----------
    design : Design
    bearing_number : float
    mesh : Mesh

    Returns
    -------
    kxx, kxy : float
        Over p_a R² per clearance; times ``design.stiffness_unit`` in N/m. K_yy = K_xx, K_yx = -K_xy
        by symmetry.
    """
    system = dense_system(design.replace(rotor__gravity=0.0), 1.0, bearing_number, mesh)
    rotor = system.rotor._replace(contact_force=0.0)
    system = system._replace(rotor=rotor)
    state = concentric_state(system)
    n = film_size(system.film)
    _, jacobian = slope_and_jacobian(system, state, np.arange(n + 1))
    response = np.linalg.solve(jacobian[:n, :-1], -jacobian[:n, -1])
    force = (
        jacobian[n + 4 : n + 6, :-1] @ response + jacobian[n + 4 : n + 6, -1]
    ) / rotor.inverse_mass
    shaft = rotor.coupling_journal / rotor.inverse_mass
    return float(-force[0] - shaft), float(force[1])


def static_equilibrium(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
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


def contact_load_share(design: Design, rotor_mass: float, eccentricity: float) -> float:
    """Share of the weight that the asperities carry where the journal rests.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    eccentricity : float
        Of the static equilibrium, over C.

    Returns
    -------
    float
        Normal force f0 exp(-(1 - e)/s) over the weight, at most 1; 0 without gravity.
    """
    weight, contact = design.load_number(rotor_mass), design.contact
    if weight == 0.0 or eccentricity < CENTRE:
        return 0.0
    force = contact.force_at_closure * math.exp(-(1.0 - eccentricity) / contact.roughness)
    return min(force / weight, 1.0)


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
