"""Compiled kernels of the film and rotor equations: slope and tangent slope.

Each computes a readable formula named in its docstring. ``system`` is a
:class:`~spab_core.solver.system.System`; a state is the flat vector [S by latitudes
(:class:`spab_core.solver.film.Film`); 8 rotor states; those of axial motion
(:mod:`spab_core.solver.axial`), if any]. The integrator
(:mod:`spab_core.solver.stepping`) knows a system only through ``slope``, ``slope_tangent``,
``time_slope``, ``linearise``, ``solve``, ``prepare_curvature``, ``add_curvature`` and
``error_norm``."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from spab_core.solver.axial import (
    axial,
    axial_error,
    axial_slope,
    axial_tangent,
    axial_time_slope,
    base_at,
    closing_at,
    direction,
    inside,
    nowhere,
    wall_contact,
)
from spab_core.solver.film import Film, film_size, gas_size
from spab_core.solver.ring import width
from spab_core.solver.rotor import CENTRE, ROTOR_STATES
from spab_core.solver.simd import (
    aligned_zeros,
    at,
    chosen,
    inlined,
    inner,
    kernel,
    load,
    smaller,
    splat,
    store,
    total,
    turn,
)
from spab_core.solver.system import System
from spab_core.solver.wall import add_flow, cells, gas_entries, supplied, wall_change, wall_slope


class Work(NamedTuple):
    """Scratch memory of one trajectory (all float64); sizes by :func:`build_work`.

    Attributes
    ----------
    reach, along : ndarray
        How far the journal's displacement reaches towards each azimuth, then towards each face: H =
        1 - cos(latitude) reach; and the same of the tangent's displacement. Of a stage.
    reach_u, reach_v, reach_w : ndarray
        The same at the point of linearisation, of the tangent there and of a third direction.
    inverse_gap, pressure, by_gas : ndarray
        1/H, P and dQ/dS at the point of linearisation.
    gradient, gradient_face : ndarray
        Gradient of Q across the band and derivative around, there.
    pressure_v, gradient_v, gradient_face_v : ndarray
        Derivatives of these along the tangent (:func:`~spab_core.solver.curvature.
        prepare_curvature`).
    q, dq : ndarray
        Q - 1 of a stage, and its derivative.
    flux, dflux, face, dface : ndarray
        Fluxes across the band and around, and their derivatives.
    block, answer, coupling : ndarray
        I - step J between the azimuths of two latitudes, eliminated
        (:mod:`spab_core.solver.linear_solve`).
    border : ndarray
        Columns for the journal's position: two, or three where it moves along the axis.
    small : ndarray
        The remainder for the journal's velocity and other single numbers.
    spare : ndarray
        Room for whoever needs it.
    feed, wall_feed : ndarray
        What a node gains less for its own Q, its column of the wall included, and what it takes of
        the column's right-hand side (:func:`~spab_core.solver.wall.factorise_wall`).
    wall_inverse, wall_outward, wall_inward : ndarray
        The columns' cells, eliminated: inverse pivots, and what a cell takes of its neighbours.
    across : ndarray
        ``Film.across`` where the journal is; empty where it is held along the axis.
    """

    reach: np.ndarray
    along: np.ndarray
    reach_u: np.ndarray
    reach_v: np.ndarray
    reach_w: np.ndarray
    inverse_gap: np.ndarray
    pressure: np.ndarray
    by_gas: np.ndarray
    gradient: np.ndarray
    gradient_face: np.ndarray
    pressure_v: np.ndarray
    gradient_v: np.ndarray
    gradient_face_v: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    flux: np.ndarray
    dflux: np.ndarray
    face: np.ndarray
    dface: np.ndarray
    block: np.ndarray
    answer: np.ndarray
    coupling: np.ndarray
    border: np.ndarray
    small: np.ndarray
    spare: np.ndarray
    feed: np.ndarray
    wall_feed: np.ndarray
    wall_inverse: np.ndarray
    wall_outward: np.ndarray
    wall_inward: np.ndarray
    across: np.ndarray


def build_work(film: Film) -> Work:
    """Allocate the scratch memory of one trajectory."""
    n = film_size(film)
    sizes = {
        **dict.fromkeys(("reach", "along", "reach_u", "reach_v", "reach_w"), 2 * film.columns),
        "block": n * n,
        "answer": n * n,
        "coupling": n * film.latitudes,
        **dict.fromkeys(("gradient", "gradient_v", "flux", "dflux"), film.fluxes * film.columns),
        "border": (2 + len(film.slide)) * (n + ROTOR_STATES),
        "across": 4 * film.latitudes**2 * len(film.slide),
        "small": 32,
        "spare": film.columns,
        **dict.fromkeys(("wall_inverse", "wall_outward", "wall_inward"), gas_size(film) - n),
    }
    return Work(*(aligned_zeros(sizes.get(name, n)) for name in Work._fields))


@inner
def _ramp(rotor, t):
    return min(t / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0


@kernel
def contact(rotor, x, y, vx, vy, a, b):
    """rotor.contact_force with its derivatives along ``a`` and ``b`` (x, y, vx, vy) and the mixed
    second one.

    The force is -(A + B) (x, y) - mu_f A (-y, x) with A = f/e, B = d f (x vx + y vy)/e². Returns
    eight floats: F, dF[a], dF[b], d²F[a, b], x and y of each."""
    e2 = x * x + y * y
    # under e^-40 of its value at closure the force is below rounding of any film force
    if e2 < CENTRE**2 or (e2 < 1.0 and (1.0 - math.sqrt(e2)) > 40.0 * rotor.roughness):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    e = math.sqrt(e2)
    f = rotor.contact_force * math.exp((e - 1.0) / rotor.roughness)
    k, i = 1.0 / rotor.roughness, 1.0 / e
    big_a, big_c = f * i, rotor.damping * f * i * i
    a1, a2 = big_a * (k - i), big_a * ((k - i) * (k - i) + i * i)
    c1, c2 = big_c * (k - 2.0 * i), big_c * ((k - 2.0 * i) * (k - 2.0 * i) + 2.0 * i * i)
    m = x * vx + y * vy
    ea, eb = (x * a[0] + y * a[1]) * i, (x * b[0] + y * b[1]) * i
    eab = (a[0] * b[0] + a[1] * b[1] - ea * eb) * i
    ma = a[0] * vx + a[1] * vy + x * a[2] + y * a[3]
    mb = b[0] * vx + b[1] * vy + x * b[2] + y * b[3]
    mab = a[0] * b[2] + a[1] * b[3] + b[0] * a[2] + b[1] * a[3]
    da, db, dab = a1 * ea, a1 * eb, a2 * ea * eb + a1 * eab
    s = big_a + big_c * m
    sa, sb = da + c1 * ea * m + big_c * ma, db + c1 * eb * m + big_c * mb
    sab = dab + (c2 * ea * eb + c1 * eab) * m + c1 * (ea * mb + eb * ma) + big_c * mab
    mu = rotor.friction
    return (
        -s * x + mu * big_a * y,
        -s * y - mu * big_a * x,
        -sa * x - s * a[0] + mu * (da * y + big_a * a[1]),
        -sa * y - s * a[1] - mu * (da * x + big_a * a[0]),
        -sb * x - s * b[0] + mu * (db * y + big_a * b[1]),
        -sb * y - s * b[1] - mu * (db * x + big_a * b[0]),
        -sab * x - sa * b[0] - sb * a[0] + mu * (dab * y + da * b[1] + db * a[1]),
        -sab * y - sa * b[1] - sb * a[1] - mu * (dab * x + da * b[0] + db * a[0]),
    )


def wall_force(slide, cosine, sine, rotor, u, n, a, b):
    """Return :func:`contact`, or :func:`~spab_core.solver.axial.wall_contact` where the journal
    moves along the axis; the rotor's entries are those from ``n`` on.
    """
    raise NotImplementedError  # compiled only


@chosen(wall_force)
def _wall_force(slide, cosine, sine, rotor, u, n, a, b):
    if len(slide):
        return lambda slide, cosine, sine, rotor, u, n, a, b: wall_contact(
            cosine, sine, rotor, direction(slide, u, n), a, b
        )
    return lambda slide, cosine, sine, rotor, u, n, a, b: contact(
        rotor, u[n], u[n + 1], u[n + 4], u[n + 5], a, b
    )


@inner
def _rotor_linear(rotor, n, u, fx, fy, out):
    """The linear part of rotor.rotor_slope, with (fx, fy) the sum of film and contact forces."""
    dx, dy = u[n + 2] - u[n], u[n + 3] - u[n + 1]
    out[n], out[n + 1], out[n + 2], out[n + 3] = u[n + 4], u[n + 5], u[n + 6], u[n + 7]
    out[n + 4] = rotor.coupling_journal * dx + rotor.inverse_mass * fx
    out[n + 5] = rotor.coupling_journal * dy + rotor.inverse_mass * fy
    out[n + 6] = -rotor.coupling_disc * dx
    out[n + 7] = -rotor.coupling_disc * dy


@inner
def _load(rotor, n, t, out):
    """Add unbalance and gravity, both ramped."""
    ramp = _ramp(rotor, t)
    c, s = ramp * math.cos(t), ramp * math.sin(t)
    out[n + 4] += rotor.unbalance_journal * c
    out[n + 5] += rotor.unbalance_journal * s - ramp * rotor.gravity_journal
    out[n + 6] += rotor.unbalance_disc * c
    out[n + 7] += rotor.unbalance_disc * s - ramp * rotor.gravity_disc


@inlined
def time_slope(system, t, out):
    """Partial derivative of the slope with respect to tau: unbalance, and the ramp while it lasts."""
    film, rotor = system
    n = gas_entries(film.latitudes, film.ring, film.depth)
    ramp = _ramp(rotor, t)
    rate = 1.0 / rotor.ramp if rotor.ramp > 0.0 and t < rotor.ramp else 0.0
    c = rate * math.cos(t) - ramp * math.sin(t)
    s = rate * math.sin(t) + ramp * math.cos(t)
    out[:] = 0.0
    out[n + 4] = rotor.unbalance_journal * c
    out[n + 5] = rotor.unbalance_journal * s - rate * rotor.gravity_journal
    out[n + 6] = rotor.unbalance_disc * c
    out[n + 7] = rotor.unbalance_disc * s - rate * rotor.gravity_disc
    axial_time_slope(film, rate, rotor, out)


@inner
def displace(film, x, y, out):
    """Fill in how far a displacement (x, y) reaches towards the azimuths, then the faces."""
    ring = film.ring
    store(out, 0, load(film.cos, 0, ring) * x + load(film.sin, 0, ring) * y)
    face = load(film.cos_face, 0, ring) * x + load(film.sin_face, 0, ring) * y
    store(out, width(ring), face)


@inner
def _times(ring, matrix, row, field, m):
    """Return one row of a matrix of ``m`` columns times a field over so many latitudes."""
    n = width(ring)
    result = at(matrix, row * m) * load(field, 0, ring)
    for k in range(1, m):
        result = result + at(matrix, row * m + k) * load(field, k * n, ring)
    return result


@inner
def across(film, matrix, row, field):
    """Return one row of a matrix over latitudes times a field over the film."""
    return _times(film.ring, matrix, row, field, film.latitudes)


@inner
def diverge(film, flux, face, row):
    """Return what a latitude gains from the fluxes across and around."""
    around = load(face, row * width(film.ring), film.ring)
    gain = _times(film.ring, film.divergence, row, flux, film.fluxes)
    return gain + turn(film.from_face, around)


@inlined
def slope(system, t, u, work, out):
    """film.film_slope, film.film_force and rotor.rotor_slope.

    False where the journal is outside the clearance.
    """
    film, rotor = system
    n, m, ring = width(film.ring), film.latitudes, film.ring
    size = gas_entries(film.latitudes, film.ring, film.depth)
    x, y, z = u[size], u[size + 1], axial(film.slide, u)
    if not inside(film.slide, film.room, film.edge_cosine, film.edge_sine, x, y, z):
        return False
    q, flux, face = work.q, work.flux, work.face
    displace(film, x, y, work.reach)
    reach, reach_face = load(work.reach, 0, ring), load(work.reach, n, ring)
    push = splat(0.0, ring)
    for row in range(m):
        p = load(u, row * n, ring) / (
            base_at(film.slide, film.base, film.sine, z, row) - at(film.node, row) * reach
        )
        store(q, row * n, p * p - 1.0)
        push = push + at(film.weight, row) * (p - 1.0)
        h = base_at(film.slide, film.base, film.sine, z, row) - at(film.node, row) * reach_face
        gradient = turn(film.to_face, p * p - 1.0)
        store(face, row * n, at(film.around, row) * (h * h * h) * gradient)
    for row in range(film.fluxes):
        h = (
            base_at(film.slide, film.flux_base, film.flux_sine, z, row)
            - at(film.flux_node, row) * reach
        )
        store(flux, row * n, (h * h * h) * across(film, film.gradient, row, q))
    for row in range(m):
        gain = diverge(film, flux, face, row)
        gain = gain + film.feed * (
            supplied(film.depth, film.supply, u, film.latitudes, row, ring) - load(q, row * n, ring)
        )
        store(out, row * n, gain + turn(film.couette, load(u, row * n, ring)))
        wall_slope(film, u, q, row, out)
    fx, fy = -total(push * load(film.cos, 0, ring)), -total(push * load(film.sin, 0, ring))
    c = wall_force(
        film.slide,
        film.edge_cosine,
        film.edge_sine,
        rotor,
        u,
        size,
        nowhere(film.slide),
        nowhere(film.slide),
    )
    _rotor_linear(rotor, size, u, fx + c[0], fy + c[1], out)
    _load(rotor, size, t, out)
    axial_slope(film, rotor, u, reach, _ramp(rotor, t), c, out)
    return True


@inlined
def slope_tangent(system, t, u, v, work, out, out_v):
    """:func:`slope` at ``u`` and its derivative along ``v``, in one pass over memory."""
    film, rotor = system
    n, m, ring = width(film.ring), film.latitudes, film.ring
    size = gas_entries(film.latitudes, film.ring, film.depth)
    x, y, dx, dy = u[size], u[size + 1], v[size], v[size + 1]
    z, dz = axial(film.slide, u), axial(film.slide, v)
    if not inside(film.slide, film.room, film.edge_cosine, film.edge_sine, x, y, z):
        return False
    q, dq, flux, dflux, face, dface = (
        work.q,
        work.dq,
        work.flux,
        work.dflux,
        work.face,
        work.dface,
    )
    displace(film, x, y, work.reach)
    displace(film, dx, dy, work.along)
    reach, reach_face = load(work.reach, 0, ring), load(work.reach, n, ring)
    along, along_face = load(work.along, 0, ring), load(work.along, n, ring)
    push, dpush = splat(0.0, ring), splat(0.0, ring)
    for row in range(m):
        node, weight = at(film.node, row), at(film.weight, row)
        inverse = 1.0 / (base_at(film.slide, film.base, film.sine, z, row) - node * reach)
        p = load(u, row * n, ring) * inverse
        dp = (
            load(v, row * n, ring)
            + p * closing_at(film.slide, 1.0, film.node, film.sine, dz, row, along)
        ) * inverse
        store(q, row * n, p * p - 1.0)
        store(dq, row * n, (p + p) * dp)
        push, dpush = push + weight * (p - 1.0), dpush + weight * dp
        h = base_at(film.slide, film.base, film.sine, z, row) - node * reach_face
        dh = closing_at(film.slide, -3.0, film.node, film.sine, dz, row, along_face)
        gradient = turn(film.to_face, p * p - 1.0)
        dgradient = turn(film.to_face, (p + p) * dp)
        scale = at(film.around, row) * (h * h)
        store(face, row * n, scale * h * gradient)
        store(dface, row * n, scale * (h * dgradient + dh * gradient))
    for row in range(film.fluxes):
        h = (
            base_at(film.slide, film.flux_base, film.flux_sine, z, row)
            - at(film.flux_node, row) * reach
        )
        dh = closing_at(film.slide, -3.0, film.flux_node, film.flux_sine, dz, row, along)
        gradient = across(film, film.gradient, row, q)
        dgradient = across(film, film.gradient, row, dq)
        store(flux, row * n, (h * h * h) * gradient)
        store(dflux, row * n, (h * h) * (h * dgradient + dh * gradient))
    for row in range(m):
        gain = diverge(film, flux, face, row)
        gain = gain + film.feed * (
            supplied(film.depth, film.supply, u, film.latitudes, row, ring) - load(q, row * n, ring)
        )
        store(out, row * n, gain + turn(film.couette, load(u, row * n, ring)))
        gain = diverge(film, dflux, dface, row) - film.feed * load(dq, row * n, ring)
        gain = add_flow(film, gain, u, v, 2.0, row)
        store(out_v, row * n, gain + turn(film.couette, load(v, row * n, ring)))
        wall_slope(film, u, q, row, out)
        wall_change(film, u, v, 2.0, dq, row, False, 1.0, out_v)
    cos, sin = load(film.cos, 0, ring), load(film.sin, 0, ring)
    c = wall_force(
        film.slide,
        film.edge_cosine,
        film.edge_sine,
        rotor,
        u,
        size,
        direction(film.slide, v, size),
        nowhere(film.slide),
    )
    _rotor_linear(rotor, size, u, c[0] - total(push * cos), c[1] - total(push * sin), out)
    _rotor_linear(rotor, size, v, c[2] - total(dpush * cos), c[3] - total(dpush * sin), out_v)
    _load(rotor, size, t, out)
    axial_tangent(film, rotor, u, v, reach, along, _ramp(rotor, t), c, out, out_v)
    return True


@inlined
def error_norm(system, work, new, error):
    """Size of a step's error: the worst of journal and disc position (over C), velocity (over 1 +
    speed), film (rms) and the wall's cells (rms of those at one depth).
    """
    film, _ = system
    n, m, ring = width(film.ring), film.latitudes, film.ring
    nodes, size = m * n, gas_entries(film.latitudes, film.ring, film.depth)
    least, worst = splat(math.inf, ring), 0.0
    for part in range(1 + cells(film.depth)):
        squares = splat(0.0, ring)
        for k in range(part * nodes, (part + 1) * nodes, n):
            gas = load(new, k, ring)
            scaled = load(error, k, ring) / (1.0 + gas)
            squares, least = squares + scaled * scaled, smaller(least, gas)
        rms = math.sqrt(total(squares) / nodes)
        if not math.isfinite(rms):
            return math.inf
        worst = max(worst, rms)
    store(work.spare, 0, least)
    for k in range(n):
        if not work.spare[k] > 0.0:
            return math.inf  # gas content must stay positive
    speed = 1.0
    for k in range(size + 4, size + 8):
        speed = max(speed, abs(new[k]))
    for k in range(size, size + 4):
        worst = max(worst, abs(error[k]), abs(error[k + 4]) / speed)
    if not inside(
        film.slide,
        film.room,
        film.edge_cosine,
        film.edge_sine,
        new[size],
        new[size + 1],
        axial(film.slide, new),
    ):
        return math.inf
    return axial_error(film, worst, speed, new, error)


def slope_and_jacobian(
    system: System, state: np.ndarray, columns: np.ndarray, work: Work | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Slope and its derivative with respect to the states at ``columns``, by the compiled tangent.

    ``work`` saves a new one of :func:`build_work` to who calls often.

    Returns
    -------
    slope : ndarray, (n,)
    jacobian : ndarray, (n, len(columns))

    Raises
    ------
    ValueError
        Where the journal is outside the clearance.
    """
    n = len(state)
    out, transposed = np.zeros(n), np.empty((len(columns), n))
    if not fill_jacobian(system, state, columns, work or build_work(system.film), out, transposed):
        raise ValueError("the journal is outside the clearance")
    return out, transposed.T


@njit(cache=True, nogil=True)
def fill_jacobian(system, state, columns, work, out, transposed):
    """Slope, and one row of ``transposed`` for each column of the Jacobian asked for."""
    direction = np.zeros(state.size)
    for k in range(columns.size):
        direction[columns[k]] = 1.0
        if not slope_tangent(system, 0.0, state, direction, work, out, transposed[k]):
            return False
        direction[columns[k]] = 0.0
    return True
