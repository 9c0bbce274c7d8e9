"""Disc and journal on an elastic shaft, asperity contact at the wall (docs/model.md).

Rotor state: [X2, Y2, X1, Y1, X2', Y2', X1', Y1'], journal (2) before disc (1). A rigid rotor is its
journal alone; the disc entries of its state then stay zero and mean nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from spab_core.design.model import Design

ROTOR_STATES = 8
# eccentricity under which no asperity is in reach: a force there, however small, would turn with
# the direction
CENTRE = 0.1
RAMP_REVOLUTIONS = 30.0
# contact: the asperities carry more than this share of the load, weight and unbalance together; of
# a load that is at least so much over p_a R², lest a weightless rotor rub on nothing
CONTACT_SHARE, LEAST_LOAD = 0.1, 1e-3


class RotorCoefficients(NamedTuple):
    """The rotor's equations, divided by its masses.

    Attributes
    ----------
    coupling_disc, coupling_journal : float
        K/M1 and K/M2 (0, 0 for the rigid rotor).
    inverse_mass : float
        1/M2: film and contact act on the journal (1/M for the rigid rotor).
    unbalance_disc, unbalance_journal : float
        Accelerations rho on the disc; (1 - mu_j) rho on the rigid rotor as a whole.
    gravity_disc, gravity_journal : float
        W/M, along -Y.
    contact_force, roughness, friction, damping : float
        f0, s, mu_f, d of the asperity law.
    ramp : float
        Load and unbalance rise linearly from zero over this much tau.
    contact_eccentricity : float
        From where on the asperities carry more than a tenth of the load
        (:func:`contact_eccentricity`).
    axial_inverse_mass : float
        1/M of the whole rotor: disc and journal move as one along the axis.
    axial_gravity : float
        W_z/M, the axial load's acceleration, along +Z.
    """

    coupling_disc: float
    coupling_journal: float
    inverse_mass: float
    unbalance_disc: float
    unbalance_journal: float
    gravity_disc: float
    gravity_journal: float
    contact_force: float
    roughness: float
    friction: float
    damping: float
    ramp: float
    contact_eccentricity: float
    axial_inverse_mass: float
    axial_gravity: float

    @property
    def rigid(self) -> bool:
        """Whether the disc is the journal."""
        return self.coupling_disc == 0.0


def build_rotor(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    ramp_revolutions: float = RAMP_REVOLUTIONS,
    room: float = 1.0,
) -> RotorCoefficients:
    """Coefficients of the rotor's equations.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        Whole mass on one bearing, kg.
    bearing_number : float
        Lambda.
    ramp_revolutions : float
        Length of the start-up ramp; 0 for none.
    room : float
        Radial eccentricity at which the journal would touch
        (:func:`~spab_core.solver.film.radial_room`), from which the asperities' gap is counted.

    Returns
    -------
    RotorCoefficients
    """
    mass = design.mass_number(rotor_mass, bearing_number)
    fraction = design.rotor.journal_mass_fraction
    rho, weight = design.unbalance_number, design.load_number(rotor_mass) / mass
    contact = design.contact
    if design.rigid:
        k_disc = k_journal = unbalance_disc = gravity_disc = 0.0
        inverse_mass, unbalance_journal = 1.0 / mass, (1.0 - fraction) * rho
    else:
        k = design.shaft_stiffness_number
        k_disc, k_journal = k / ((1.0 - fraction) * mass), k / (fraction * mass)
        inverse_mass, unbalance_disc, unbalance_journal, gravity_disc = (
            1.0 / (fraction * mass),
            rho,
            0.0,
            weight,
        )
    return RotorCoefficients(
        k_disc,
        k_journal,
        inverse_mass,
        unbalance_disc,
        unbalance_journal,
        gravity_disc,
        weight,
        contact.force_at_closure * _nearer(contact.roughness, room),
        contact.roughness,
        contact.friction,
        contact.damping,
        2.0 * math.pi * ramp_revolutions,
        max(contact_eccentricity(design, rotor_mass, bearing_number) - (1.0 - room), CENTRE),
        1.0 / mass,
        design.axial_load_number / mass,
    )


def _nearer(roughness: float, room: float) -> float:
    """How much larger f0 exp(-(1 - e)/s) is where the gap is ``room`` - e."""
    return math.exp(min((1.0 - room) / roughness, 500.0))


def contact_eccentricity(design: Design, rotor_mass: float, bearing_number: float) -> float:
    """Eccentricity from which on the rotor is in contact with the wall.

    There the asperities' spring, f0 exp(-(1 - e)/s), carries :data:`CONTACT_SHARE` of the load: the
    weight and the unbalance's rotating force, at least :data:`LEAST_LOAD` of p_a R².

    Parameters
    ----------
    design : Design
    rotor_mass : float
        Whole mass on one bearing, kg.
    bearing_number : float
        Lambda.

    Returns
    -------
    float
        Over C; 1 where the asperities never carry so much.
    """
    contact = design.contact
    mass = design.mass_number(rotor_mass, bearing_number)
    unbalance = (1.0 - design.rotor.journal_mass_fraction) * mass * design.unbalance_number
    least = CONTACT_SHARE * max(design.load_number(rotor_mass) + unbalance, LEAST_LOAD)
    if contact.force_at_closure <= least:
        return 1.0
    return max(1.0 - contact.roughness * math.log(contact.force_at_closure / least), CENTRE)


def contact_force(
    rotor: RotorCoefficients, x: float, y: float, vx: float, vy: float
) -> tuple[float, float]:
    """Force of the wall on the journal, over p_a R²: -f (1 + d v_r) n - mu_f f t, f = f0 exp(-(1 -
    e)/s); none under CENTRE.
    """
    e = math.hypot(x, y)
    if e < CENTRE:
        return 0.0, 0.0
    nx, ny = x / e, y / e
    f = rotor.contact_force * math.exp(-(1.0 - e) / rotor.roughness)
    normal = f * (1.0 + rotor.damping * (vx * nx + vy * ny))
    return -normal * nx + rotor.friction * f * ny, -normal * ny - rotor.friction * f * nx


def wall_force(
    rotor: RotorCoefficients, edge: float, place: Sequence[float], speed: Sequence[float]
) -> tuple[float, float, float]:
    """Force of the wall on a journal that moves along the axis, over p_a R².

    The law of :func:`contact_force` for the least gap g of the band, met at the latitude l: f = f0
    exp(-g/s) along the normal n there, -f (1 + d v.n) n - mu_f f t, with t around the axis. With
    e = sqrt(X² + Y² + s²) in place of the eccentricity: a journal in the middle is met all around
    the edge, by no force across.

    Parameters
    ----------
    rotor : RotorCoefficients
    edge : float
        Latitude of the edge, rad.
    place, speed : sequence of 3 floats
        X, Y, Z over C, and their derivatives.
    """
    x, y, z = place
    e = math.sqrt(x * x + y * y + rotor.roughness**2)
    latitude = max(min(math.atan2(z, e), edge), -edge)
    c, s = math.cos(latitude), math.sin(latitude)
    f = rotor.contact_force * math.exp((e * c + z * s - 1.0) / rotor.roughness)
    n = (c * x / e, c * y / e, s)
    normal = f * (1.0 + rotor.damping * sum(a * b for a, b in zip(n, speed, strict=True)))
    rub = rotor.friction * f / e
    return -normal * n[0] + rub * y, -normal * n[1] - rub * x, -normal * n[2]


def rotor_slope(
    rotor: RotorCoefficients, tau: float, q: Sequence[float], force: tuple[float, float]
) -> list[float]:
    """d/dtau of the eight rotor states, the readable formula.

    Parameters
    ----------
    rotor : RotorCoefficients
    tau : float
        Shaft angle since the start.
    q : sequence of 8 floats
        Rotor state.
    force : tuple of 2 floats
        Film force over p_a R².
    """
    x2, y2, x1, y1, vx2, vy2, vx1, vy1 = q
    ramp = min(tau / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0
    cx, cy = contact_force(rotor, x2, y2, vx2, vy2)
    c, s = ramp * math.cos(tau), ramp * math.sin(tau)
    return [
        vx2,
        vy2,
        vx1,
        vy1,
        rotor.coupling_journal * (x1 - x2)
        + rotor.inverse_mass * (force[0] + cx)
        + rotor.unbalance_journal * c,
        rotor.coupling_journal * (y1 - y2)
        + rotor.inverse_mass * (force[1] + cy)
        + rotor.unbalance_journal * s
        - ramp * rotor.gravity_journal,
        -rotor.coupling_disc * (x1 - x2) + rotor.unbalance_disc * c,
        -rotor.coupling_disc * (y1 - y2) + rotor.unbalance_disc * s - ramp * rotor.gravity_disc,
    ]
