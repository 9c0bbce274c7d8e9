"""The second derivative of the slope along a direction, for the exact derivative of a Rosenbrock
step.

With P = S/H, Q = P² and directions v, w: dP[w] = (w - P dH[w]) / H, d²P[v, w] = -(dH[v] dP[w] +
dH[w] dP[v]) / H, dQ = 2 P dP, d²Q = 2 (dP[v] dP[w] + P d²P). A flux k H³ DQ, D a derivative, adds
k [6 H dH[v] dH[w] DQ + 3 H² (dH[v] D dQ[w] + dH[w] D dQ[v]) + H³ D d²Q].
"""

from __future__ import annotations

from spab_core.solver.axial import (
    axial,
    axial_curvature,
    base_at,
    closing_at,
    direction,
)
from spab_core.solver.ring import width
from spab_core.solver.simd import at, inlined, inner, load, splat, store, total, turn
from spab_core.solver.slope import across, displace, diverge, wall_force
from spab_core.solver.wall import add_flow, gas_entries, wall_change


@inlined
def prepare_curvature(system, u, v, work):
    """Form what :func:`add_curvature` needs of the direction ``v`` at the point of linearisation
    ``u``.
    """
    film, _ = system
    n, m, ring = width(film.ring), film.latitudes, film.ring
    size, q_v = gas_entries(film.latitudes, film.ring, film.depth), work.dq
    displace(film, v[size], v[size + 1], work.reach_v)
    reach_v, v_z = load(work.reach_v, 0, ring), axial(film.slide, v)
    for row in range(m):
        o = row * n
        p = load(work.pressure, o, ring)
        p_v = load(v, o, ring) + p * closing_at(
            film.slide, 1.0, film.node, film.sine, v_z, row, reach_v
        )
        p_v = p_v * load(work.inverse_gap, o, ring)
        store(work.pressure_v, o, p_v)
        store(q_v, o, (p + p) * p_v)
        store(work.gradient_face_v, o, turn(film.to_face, (p + p) * p_v))
    for row in range(film.fluxes):
        store(work.gradient_v, row * n, across(film, film.gradient, row, q_v))


@inner
def _bent(h, h_v, h_w, g, g_v, g_w, g_vw):
    """Return the second derivative of H³ g along v and w from those of its factors."""
    return h * (6.0 * h_v * h_w * g + 3.0 * h * (h_v * g_w + h_w * g_v) + h * h * g_vw)


@inlined
def add_curvature(system, u, v, w, scale, work, out):
    """out += scale * d²f(u)[v, w], the second derivative of the slope, after
    :func:`prepare_curvature` for ``v``.
    """
    film, rotor = system
    n, m, ring = width(film.ring), film.latitudes, film.ring
    size = gas_entries(film.latitudes, film.ring, film.depth)
    wx, wy = w[size], w[size + 1]
    z, v_z, w_z = axial(film.slide, u), axial(film.slide, v), axial(film.slide, w)
    q_w, q_vw, flux, face = work.q, work.dq, work.flux, work.face
    displace(film, wx, wy, work.reach_w)
    reach, reach_face = load(work.reach_u, 0, ring), load(work.reach_u, n, ring)
    reach_v, face_v = load(work.reach_v, 0, ring), load(work.reach_v, n, ring)
    reach_w, face_w = load(work.reach_w, 0, ring), load(work.reach_w, n, ring)
    push = splat(0.0, ring)
    for row in range(m):
        node, o = at(film.node, row), row * n
        inverse, p = load(work.inverse_gap, o, ring), load(work.pressure, o, ring)
        p_v = load(work.pressure_v, o, ring)
        h_v = closing_at(film.slide, -1.0, film.node, film.sine, v_z, row, reach_v)
        h_w = closing_at(film.slide, -1.0, film.node, film.sine, w_z, row, reach_w)
        p_w = (load(w, o, ring) - p * h_w) * inverse
        p_vw = (h_v * p_w + h_w * p_v) * (-1.0 * inverse)
        one, two = (p + p) * p_w, 2.0 * (p_v * p_w + p * p_vw)
        store(q_w, o, one)
        store(q_vw, o, two)
        push = push + at(film.weight, row) * p_vw
        bent = _bent(
            base_at(film.slide, film.base, film.sine, z, row) - node * reach_face,
            closing_at(film.slide, -1.0, film.node, film.sine, v_z, row, face_v),
            closing_at(film.slide, -1.0, film.node, film.sine, w_z, row, face_w),
            load(work.gradient_face, o, ring),
            load(work.gradient_face_v, o, ring),
            turn(film.to_face, one),
            turn(film.to_face, two),
        )
        store(face, o, at(film.around, row) * bent)
    for row in range(film.fluxes):
        node, o = at(film.flux_node, row), row * n
        bent = _bent(
            base_at(film.slide, film.flux_base, film.flux_sine, z, row) - node * reach,
            closing_at(film.slide, -1.0, film.flux_node, film.flux_sine, v_z, row, reach_v),
            closing_at(film.slide, -1.0, film.flux_node, film.flux_sine, w_z, row, reach_w),
            load(work.gradient, o, ring),
            load(work.gradient_v, o, ring),
            across(film, film.gradient, row, q_w),
            across(film, film.gradient, row, q_vw),
        )
        store(flux, o, bent)
    for row in range(m):
        o = row * n
        gain = diverge(film, flux, face, row) - film.feed * load(q_vw, o, ring)
        gain = add_flow(film, gain, v, w, 2.0, row)
        store(out, o, load(out, o, ring) + scale * gain)
        wall_change(film, v, w, 2.0, q_vw, row, True, scale, out)
    fx, fy = -total(push * load(film.cos, 0, ring)), -total(push * load(film.sin, 0, ring))
    c = wall_force(
        film.slide,
        film.edge_cosine,
        film.edge_sine,
        rotor,
        u,
        size,
        direction(film.slide, v, size),
        direction(film.slide, w, size),
    )
    out[size + 4] += scale * rotor.inverse_mass * (fx + c[6])
    out[size + 5] += scale * rotor.inverse_mass * (fy + c[7])
    axial_curvature(film, rotor, v, w, reach_v, reach_w, scale, c, work, out)
