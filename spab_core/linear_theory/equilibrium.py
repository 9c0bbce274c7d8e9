"""Static equilibrium of the journal, and the stiffness of the concentric film."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.design.limits import check_linear_point
from spab_core.design.model import Design
from spab_core.solver.film import (
    AUTO,
    MOTION_STATES,
    Mesh,
    axial_force,
    film_array,
    film_size,
    gas_size,
    least_gap,
    suitable_mesh,
    thickness,
    with_wall,
)
from spab_core.solver.rotor import CENTRE
from spab_core.solver.slope import build_work, slope_and_jacobian
from spab_core.solver.system import System, build_system

LIFTED = 0.1  # largest share of the weight that the wall carries under a rotor that has lifted off
AZIMUTHS = 32  # of a mesh that is not asked for: what a thin film needs at rest
_NEWTON_STEPS = 60
# the axial stop: how far the gap at the edge may close; steps on the way there
CLOSED, AXIAL_STEPS = 0.95, 20
_SMALL = 1e-4  # of the clearance, for the axial stiffness


@dataclass(frozen=True)
class Equilibrium:
    """Static equilibrium under gravity, without unbalance.

    Attributes
    ----------
    eccentricity : float
        Over C.
    attitude_angle : float
        Between the load (-Y) and the journal's displacement, deg, positive with the rotation.
    gap : float
        Least film over C, wherever the journal is along the axis.
    state : ndarray
        Full state vector.
    """

    eccentricity: float
    attitude_angle: float
    gap: float
    state: np.ndarray


class AxialStopError(InputError):
    """The film does not carry the axial load.

    Attributes
    ----------
    load, capacity : float
        The axial load and the largest axial force that was found, N.
    """

    def __init__(self, load: float, capacity: float) -> None:
        super().__init__(
            f"at its axial stop: the film carries at most {capacity:.4g} N along the axis under "
            f"this radial load, rotor.axial_load is {load:g} N"
        )
        self.load, self.capacity = load, capacity

    def __reduce__(self) -> tuple[type, tuple[float, float]]:
        """Let it pass from a worker process with what it says."""
        return type(self), (self.load, self.capacity)


def dense_system(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
    axial_offset: float | None = None,
    *,
    moving: bool = False,
) -> System:
    """Build the system without unbalance, whose Jacobian may be dense.

    Parameters
    ----------
    axial_offset : float, optional
        Over C; left out: that of the static equilibrium of a design with an axial load, and half
        the band of one without.
    moving : bool
        Whether the journal moves along the axis, about that offset.

    Raises
    ------
    AxialStopError
        Where that equilibrium does not exist.
    """
    if axial_offset is None:
        axial_offset = axial_position(design, rotor_mass, bearing_number)
    if mesh == AUTO:
        mesh = suitable_mesh(design, AZIMUTHS)
    if moving:
        axial_offset = axial_offset or 0.0
    system = build_system(design, rotor_mass, bearing_number, mesh, axial_offset, moving=moving)
    return system.without_unbalance()


def resting_system(
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> System:
    """:func:`dense_system` with a journal that moves along the axis where the design lets it: its
    eigenvalues are those of the whole.
    """
    moving = design.rotor.axial_motion
    return dense_system(design, rotor_mass, bearing_number, mesh, moving=moving)


def running_system(
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> System:
    """Build the system that is integrated in time, the journal held at its static axial position,
    or moving along the axis where the design lets it.

    Raises
    ------
    AxialStopError
        Where there is no such position.
    """
    offset, moving = axial_position(design, rotor_mass, bearing_number), design.rotor.axial_motion
    if moving:
        offset = offset or 0.0
    return build_system(design, rotor_mass, bearing_number, mesh, offset, moving=moving)


@functools.lru_cache(maxsize=4096)
@one_thread
def axial_position(design: Design, rotor_mass: float, bearing_number: float) -> float | None:
    """Static axial displacement under the design's axial load, the journal at rest under gravity.

    From the middle outwards in steps, then by bracketing; at each step the radial equilibrium.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float

    Returns
    -------
    float or None
        Over C; None without an axial load.

    Raises
    ------
    AxialStopError
        Where the film does not carry the load before the gap at the edge is down to a twentieth,
        or the journal does not rest on its film any more.
    """
    from scipy.optimize import brentq  # a quarter of a second to load, for an axial load alone

    if not design.rotor.axial_load:
        return None
    load = design.axial_load_number
    end = math.copysign(CLOSED / math.sin(design.bearing.edge), load)
    state: np.ndarray | None = None

    def missing(offset: float) -> float:
        nonlocal state
        system = dense_system(
            design, rotor_mass, bearing_number, axial_offset=offset
        ).without_storage()
        found = find_equilibrium(system, state) if state is not None else None
        found = found or find_equilibrium(system)
        if found is None:
            raise AxialStopError(design.rotor.axial_load, held * design.force_unit)
        state = found.state
        n = film_size(system.film)
        force = axial_force(system.film, film_array(system.film, state), *state[n : n + 2])
        return force + load

    held, before = 0.0, 0.0
    for offset in np.linspace(0.0, end, AXIAL_STEPS + 1)[1:]:
        rest = missing(float(offset))
        if rest * load <= 0.0:
            found = brentq(missing, before, float(offset), xtol=1e-11, rtol=1e-11)
            return float(found)
        held, before = max(held, abs(load - rest)), float(offset)
    raise AxialStopError(design.rotor.axial_load, held * design.force_unit)


@one_thread
def axial_stiffness(
    design: Design,
    bearing_number: float,
    x: float = 0.0,
    y: float = 0.0,
    offset: float = 0.0,
    mesh: Mesh = AUTO,
) -> float:
    """Static axial stiffness of a sphere's film: what its force changes by along the axis, the film
    following steadily.

    Parameters
    ----------
    design : Design
    bearing_number : float
    x, y : float
        Where the journal is held radially, over C.
    offset : float
        About where it is held along the axis, over C.
    mesh : Mesh

    Returns
    -------
    float
        -dF_z/dZ over p_a R² / C.

    Raises
    ------
    InputError
        Where no steady film was found.
    """
    behind, system, ahead = (
        dense_system(design, 1.0, bearing_number, mesh, offset + shift).without_storage()
        for shift in (-_SMALL, 0.0, _SMALL)
    )
    n = film_size(system.film)
    cells, start = np.arange(n), np.zeros(system.size)
    start[n : n + 2] = x, y
    start[:n] = thickness(system.film, x, y).ravel()
    state = steady_film(system, start)
    if state is None:
        raise InputError("no steady film was found at the axial position; try a finer mesh")
    # the steady film beside it, to first order: one step of Newton's method for both sides
    change = [slope_and_jacobian(side, state, cells[:1])[0][:n] for side in (behind, ahead)]
    jacobian = slope_and_jacobian(system, state, cells)[1][:n]
    follow = np.zeros(system.size)
    follow[:n] = np.linalg.solve(jacobian, 0.5 * (change[0] - change[1]))
    before, after = (
        axial_force(side.film, film_array(side.film, moved), x, y)
        for side, moved in ((behind, state - follow), (ahead, state + follow))
    )
    return (before - after) / (2.0 * _SMALL)


def concentric_state(system: System) -> np.ndarray:
    """Return the state of the centred, unloaded journal, film and wall steady: Newton's method from
    P = 1.

    Raises
    ------
    InputError
        Where it does not converge.
    """
    if system.film.depth:  # pores store nothing of what does not change
        return with_wall(system.film, concentric_state(system.without_storage()))
    state = np.zeros(system.size)
    state[: film_size(system.film)] = np.repeat(system.film.base, system.film.columns)
    if system.film.slide:
        state[-MOTION_STATES] = system.film.offset
    found = steady_film(system, state)
    if found is None:
        raise InputError("no steady film of the centred journal was found; try a finer mesh")
    return found


def steady_film(system: System, state: np.ndarray) -> np.ndarray | None:
    """Return a state with its film steady, the journal held where it is: Newton's method on the
    film; None where it does not converge.
    """
    state, cells = state.copy(), np.arange(film_size(system.film))
    work = build_work(system.film)
    for _ in range(_NEWTON_STEPS):
        value, jacobian = slope_and_jacobian(system, state, cells, work)
        step = np.linalg.solve(jacobian[cells], value[cells])
        fraction = 1.0
        while (state[cells] - fraction * step).min() <= 0.0:
            fraction *= 0.5
            if fraction < 1e-6:
                return None
        state[cells] -= fraction * step
        if np.abs(step).max() < 1e-12:
            return state
    return None


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

    Raises
    ------
    DesignError
        For a bearing number out of range.
    """
    check_linear_point(1.0, bearing_number)
    weightless = design.replace(rotor__gravity=0.0)
    system = dense_system(weightless, 1.0, bearing_number, mesh).without_storage()
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

    Raises
    ------
    DesignError
        For a point out of range.
    """
    check_linear_point(rotor_mass, bearing_number)
    try:
        system = resting_system(design, rotor_mass, bearing_number, mesh)
    except AxialStopError:
        return None
    return find_equilibrium(system, guess)


def find_equilibrium(system: System, guess: np.ndarray | None = None) -> Equilibrium | None:
    """:func:`static_equilibrium` of a system without unbalance."""
    if system.film.slide and (guess is None or len(guess) != system.size):
        held = find_equilibrium(system.held(), guess)
        if held is None:
            return None
        guess = np.concatenate([held.state, np.zeros(MOTION_STATES)])
        guess[-MOTION_STATES] = system.film.offset
    if system.film.depth:
        if guess is not None and len(guess) == system.size:
            guess = np.delete(guess, np.s_[film_size(system.film) : gas_size(system.film)])
        quiet = find_equilibrium(system.without_storage(), guess)
        return quiet and replace(quiet, state=with_wall(system.film, quiet.state))
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
    film, x, y = system.film, state[n], state[n + 1]
    eccentricity = math.hypot(x, y)
    gap = least_gap(film.edge, state[-MOTION_STATES] if film.slide else film.offset, eccentricity)
    return Equilibrium(eccentricity, math.degrees(math.atan2(x, -y)), gap, state)


def contact_load_share(
    design: Design, rotor_mass: float, eccentricity: float, room: float = 1.0
) -> float:
    """Share of the weight that the asperities carry where the journal rests.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    eccentricity : float
        Of the static equilibrium, over C.
    room : float
        Eccentricity at which the journal would touch
        (:func:`~spab_core.solver.film.radial_room`).

    Returns
    -------
    float
        Normal force f0 exp(-(1 - e)/s) over the weight, at most 1; 0 without gravity.
    """
    weight, contact = design.load_number(rotor_mass), design.contact
    if weight == 0.0 or eccentricity < CENTRE:
        return 0.0
    force = contact.force_at_closure * math.exp(-(room - eccentricity) / contact.roughness)
    return min(force / weight, 1.0)


def _is_inside(system: System, state: np.ndarray) -> bool:
    """Whether the journal is inside the clearance, by a little."""
    film, n = system.film, gas_size(system.film)
    eccentricity = math.hypot(state[n], state[n + 1])
    if film.slide:
        return least_gap(film.edge, state[-MOTION_STATES], eccentricity) > 5e-4
    return eccentricity < 0.9995 * film.room


def _newton(system: System, state: np.ndarray) -> np.ndarray | None:
    """Damped Newton iteration to f = 0; None where it does not converge."""
    state = state.copy()
    n, unknowns = film_size(system.film), system.unknowns
    if system.film.slide and not system.rotor.axial_gravity:
        # the middle, by symmetry: the film may not hold the journal there, and Z is not to be found
        unknowns = unknowns[:-2]
    work = build_work(system.film)
    for _ in range(_NEWTON_STEPS):
        value, jacobian = slope_and_jacobian(system, state, unknowns, work)
        try:
            step = np.linalg.solve(jacobian[unknowns], value[unknowns])
        except np.linalg.LinAlgError:
            return None
        fraction = 1.0
        for _ in range(12):
            trial = state.copy()
            trial[unknowns] -= fraction * step
            if _is_inside(system, trial) and trial[:n].min() > 0.0:
                break
            fraction *= 0.5
        else:
            return None
        state = trial
        if np.abs(step).max() < 1e-10:
            return state
    return None
