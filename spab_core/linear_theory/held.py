"""The steady film of a journal that is held where it is, and its force: what a bearing carries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import concentric_state, dense_system, steady_film
from spab_core.solver.film import (
    AUTO,
    Mesh,
    axial_force,
    film_array,
    film_force,
    film_size,
    with_wall,
)
from spab_core.solver.system import System

_FIRST, _LEAST = (
    0.2,
    1e-3,
)  # of the way from the centre: first step, and the smallest before giving up


def held_state(system: System, x: float, y: float) -> np.ndarray:
    """Return the state of a journal held at (x, y) over C, its film steady.

    Newton's method, the journal taken from the centre outwards in steps.

    Parameters
    ----------
    system : System
        Without unbalance.
    x, y : float
        Over C, inside the clearance.

    Raises
    ------
    InputError
        Where no steady film was found.
    """
    if system.film.depth:  # pores store nothing of what does not change
        return with_wall(system.film, held_state(system.without_storage(), x, y))
    state, n = concentric_state(system), film_size(system.film)
    done, step = 0.0, _FIRST
    while done < 1.0:
        share = min(1.0, done + step)
        trial = state.copy()
        trial[n : n + 2] = share * x, share * y
        found = steady_film(system, trial)
        if found is not None:
            state, done, step = found, share, 1.5 * step
        elif step < _LEAST:
            raise InputError(
                f"no steady film was found at an eccentricity of {math.hypot(x, y):.4g}; try a "
                "finer mesh"
            )
        else:
            step *= 0.5
    return state


@one_thread
def held_force(
    design: Design,
    bearing_number: float,
    eccentricity: float,
    attitude_angle: float = 0.0,
    mesh: Mesh = AUTO,
) -> tuple[float, float]:
    """Force of the steady film on a journal held off the centre.

    Parameters
    ----------
    design : Design
    bearing_number : float
    eccentricity : float
        Over C.
    attitude_angle : float
        Direction of the displacement, rad from +X.
    mesh : Mesh

    Returns
    -------
    radial, tangential : float
        Over p_a R²: along the displacement (negative: towards the centre), and a quarter of a turn
        on with the rotation.
    """
    system = dense_system(design, 1.0, bearing_number, mesh)
    cos, sin = math.cos(attitude_angle), math.sin(attitude_angle)
    x, y = eccentricity * cos, eccentricity * sin
    state = held_state(system, x, y)
    fx, fy = film_force(system.film, film_array(system.film, state), x, y)
    return fx * cos + fy * sin, fy * cos - fx * sin


@dataclass(frozen=True)
class LoadCurves:
    """What a bearing carries against how far its journal is displaced, over C.

    Attributes
    ----------
    radial, radial_force : ndarray
        Radial eccentricity, the axial position that of the middle; force against the displacement,
        N.
    axial, axial_force : ndarray
        Axial displacement of a journal in the middle radially, and the force against it, N; empty
        for a cylinder.
    """

    radial: np.ndarray
    radial_force: np.ndarray
    axial: np.ndarray
    axial_force: np.ndarray


CURVE_POINTS = 12
_REACH = 0.9  # eccentricity up to which curves go; axially, how far the gap at the edge closes


@one_thread
def load_curves(design: Design, bearing_number: float, mesh: Mesh = AUTO) -> LoadCurves:
    """Radial force over radial eccentricity and axial force over axial displacement, the shaft at
    speed.

    Parameters
    ----------
    design : Design
        Its axial load counts for nothing here.
    bearing_number : float
    mesh : Mesh

    Returns
    -------
    LoadCurves
        Up to the first displacement at which no steady film was found.
    """
    shares = np.linspace(0.0, _REACH, CURVE_POINTS)
    system = dense_system(design.replace(rotor__axial_load=0.0), 1.0, bearing_number, mesh)
    system, unit = system.without_storage(), design.force_unit
    n, radial = film_size(system.film), []
    for share in shares:
        try:
            state = held_state(system, float(share), 0.0)
        except InputError:
            break
        force = film_force(system.film, film_array(system.film, state), *state[n : n + 2])
        radial.append(math.hypot(*force) * unit)
    along = np.zeros(0)
    axial: list[float] = []
    if not design.bearing.cylindrical:
        along = shares / math.sin(design.bearing.edge)
        for offset in along:
            at = dense_system(
                design, 1.0, bearing_number, mesh, axial_offset=float(offset)
            ).without_storage()
            try:
                state = concentric_state(at)
            except InputError:
                break
            gas = film_array(at.film, state)
            axial.append(-axial_force(at.film, gas, 0.0, 0.0) * unit)
    return LoadCurves(shares[: len(radial)], np.array(radial), along[: len(axial)], np.array(axial))
