"""Motion of the journal along the axis of a sphere: what the kernels do more where it may move.

Such a state has eight entries more behind the rotor's: Z, Z' and six zeros. The film's thickness,
held at ``film.base`` else, follows Z, its axial force drives the whole mass (journal and disc move
as one along the axis), and the wall is met where the gap is least, at any latitude
(:func:`wall_contact`).

Each function here has two bodies; ``film.slide`` tells the compiler which one, so that a journal
that is held pays nothing. They belong to loops over latitudes in
:mod:`spab_core.solver.slope`, :mod:`~spab_core.solver.linear_solve`,
:mod:`~spab_core.solver.curvature` and :mod:`~spab_core.solver.stepping`."""

from __future__ import annotations

import math

from spab_core.solver.ring import width
from spab_core.solver.simd import at, chosen, inner, kernel, load, splat, total

# where Z and Z' are, counted from the rotor's first entry
PLACE, SPEED = 8, 9


def moves(film):
    """Whether a film type is that of a journal that moves along the axis."""
    return len(film.types[film.fields.index("slide")]) > 0


def axial(slide, u):
    """Return Z of a state; 0 where the journal is held."""
    raise NotImplementedError  # compiled only


@chosen(axial)
def _axial(slide, u):
    if len(slide):
        return lambda slide, u: u[u.size - 8]
    return lambda slide, u: 0.0


def base_at(slide, base, sine, z, row):
    """Return the thickness under a centred journal at a latitude, ``base`` and ``sine`` those of
    the nodes or of the flux nodes.
    """
    raise NotImplementedError  # compiled only


@chosen(base_at)
def _base_at(slide, base, sine, z, row):
    if len(slide):
        return lambda slide, base, sine, z, row: 1.0 - z * at(sine, row)
    return lambda slide, base, sine, z, row: at(base, row)


def closing_at(slide, factor, cosine, sine, z, row, reach):
    """Return ``factor`` times how much a displacement, Z and its reach towards the azimuths, takes
    of the thickness at a latitude.
    """
    raise NotImplementedError  # compiled only


@chosen(closing_at)
def _closing_at(slide, factor, cosine, sine, z, row, reach):
    if len(slide):
        return lambda slide, factor, cosine, sine, z, row, reach: (
            (factor * at(cosine, row)) * reach + factor * z * at(sine, row)
        )
    return lambda slide, factor, cosine, sine, z, row, reach: (factor * at(cosine, row)) * reach


def form_across(film, z, work):
    """Form what ``film.across`` is for a journal at Z, where it moves."""
    raise NotImplementedError  # compiled only


@chosen(form_across)
def _form_across(film, z, work):
    if not moves(film):
        return lambda film, z, work: None

    def formed(film, z, work):
        m, square = film.latitudes, film.latitudes * film.latitudes
        for row in range(m):
            for column in range(m):
                zeroth = first = second = third = 0.0
                for k in range(film.fluxes):
                    pair = at(film.divergence, row * film.fluxes + k)
                    pair *= at(film.gradient, k * m + column)
                    b, c = 1.0 - z * at(film.flux_sine, k), at(film.flux_node, k)
                    zeroth += pair * b * b * b
                    first -= 3.0 * pair * b * b * c
                    second += 3.0 * pair * b * c * c
                    third -= pair * c * c * c
                o = row * m + column
                work.across[o], work.across[square + o] = zeroth, first
                work.across[2 * square + o], work.across[3 * square + o] = second, third

    return formed


def across_at(slide, held, formed, k):
    """Return an element of ``film.across``, or of what :func:`form_across` has formed."""
    raise NotImplementedError  # compiled only


@chosen(across_at)
def _across_at(slide, held, formed, k):
    if len(slide):
        return lambda slide, held, formed, k: at(formed, k)
    return lambda slide, held, formed, k: at(held, k)


@inner
def nearness(cosine, sine, x, y, z):
    """Return 1 less the least gap of the band (:func:`~spab_core.solver.film.least_gap`), cosine and
    sine those of its edge.
    """
    e, z = math.sqrt(x * x + y * y), abs(z)
    if z * cosine <= e * sine:
        return math.sqrt(e * e + z * z)
    return e * cosine + z * sine


def inside(slide, room, cosine, sine, x, y, z):
    """Whether the journal is inside the clearance."""
    raise NotImplementedError  # compiled only


@chosen(inside)
def _inside(slide, room, cosine, sine, x, y, z):
    if len(slide):
        return lambda slide, room, cosine, sine, x, y, z: nearness(cosine, sine, x, y, z) < 1.0
    return lambda slide, room, cosine, sine, x, y, z: x * x + y * y < room * room


def direction(slide, v, n):
    """Return displacement and velocity of the journal in a direction of states, the rotor's entries
    from ``n`` on, as the contact takes them.
    """
    raise NotImplementedError  # compiled only


@chosen(direction)
def _direction(slide, v, n):
    if len(slide):
        return lambda slide, v, n: (v[n], v[n + 1], v[n + 8], v[n + 4], v[n + 5], v[n + 9])
    return lambda slide, v, n: (v[n], v[n + 1], v[n + 4], v[n + 5])


def nowhere(slide):
    """Return no direction."""
    raise NotImplementedError  # compiled only


@chosen(nowhere)
def _nowhere(slide):
    if len(slide):
        return lambda slide: (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return lambda slide: (0.0, 0.0, 0.0, 0.0)


# a number with its derivatives along two directions and the mixed second one


@inner
def _of(value, f, f1, f2):
    """A function of such a number, from its value and derivatives there."""
    return (f, f1 * value[1], f1 * value[2], f1 * value[3] + f2 * value[1] * value[2])


@inner
def _times(p, q):
    return (
        p[0] * q[0],
        p[1] * q[0] + p[0] * q[1],
        p[2] * q[0] + p[0] * q[2],
        p[3] * q[0] + p[1] * q[2] + p[2] * q[1] + p[0] * q[3],
    )


@inner
def _sum(p, q, share):
    """p + share q."""
    return (p[0] + share * q[0], p[1] + share * q[1], p[2] + share * q[2], p[3] + share * q[3])


@inner
def _scaled(p, share):
    return (share * p[0], share * p[1], share * p[2], share * p[3])


@inner
def _root(value):
    root = math.sqrt(value[0])
    return _of(value, root, 0.5 / root, -0.25 / (root * value[0]))


@inner
def _inverse(value):
    inverse = 1.0 / value[0]
    return _of(value, inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse)


@kernel
def wall_contact(cosine, sine, rotor, q, a, b):
    """rotor.wall_force with its derivatives along ``a`` and ``b`` (x, y, z, vx, vy, vz) and the
    mixed second one.

    Returns twelve floats: F, dF[a], dF[b], d²F[a, b], x and y of each; then z of each."""
    s = rotor.roughness
    if (
        1.0 - nearness(cosine, sine, math.sqrt(q[0] * q[0] + q[1] * q[1] + s * s), 0.0, q[2])
        > 40.0 * s
    ):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x, y, z = (q[0], a[0], b[0], 0.0), (q[1], a[1], b[1], 0.0), (q[2], a[2], b[2], 0.0)
    vx, vy, vz = (q[3], a[3], b[3], 0.0), (q[4], a[4], b[4], 0.0), (q[5], a[5], b[5], 0.0)
    square = _sum(_times(x, x), _times(y, y), 1.0)
    square = (square[0] + s * s, square[1], square[2], square[3])
    radius = _root(square)
    per_radius = _inverse(radius)
    side = 1.0 if q[2] >= 0.0 else -1.0
    if abs(q[2]) * cosine <= radius[0] * sine:
        near = _root(_sum(square, _times(z, z), 1.0))
        lever = _inverse(near)
        upward = _times(z, lever)
    else:
        near = _sum(_scaled(radius, cosine), z, side * sine)
        lever = _scaled(per_radius, cosine)
        upward = (side * sine, 0.0, 0.0, 0.0)
    nx, ny = _times(x, lever), _times(y, lever)
    force = rotor.contact_force * math.exp((near[0] - 1.0) / s)
    spring = _of(near, force, force / s, force / (s * s))
    closing = _sum(_sum(_times(vx, nx), _times(vy, ny), 1.0), _times(vz, upward), 1.0)
    normal = _sum(spring, _times(spring, closing), rotor.damping)
    rub = _scaled(_times(spring, per_radius), rotor.friction)
    fx, fy = _sum(_times(rub, y), _times(normal, nx), -1.0), _times(rub, x)
    fy, fz = _scaled(_sum(fy, _times(normal, ny), 1.0), -1.0), _scaled(_times(normal, upward), -1.0)
    return (
        fx[0],
        fy[0],
        fx[1],
        fy[1],
        fx[2],
        fy[2],
        fx[3],
        fy[3],
        fz[0],
        fz[1],
        fz[2],
        fz[3],
    )


def axial_slope(film, rotor, u, reach, ramp, c, out):
    """Fill in dZ/dtau and dZ'/dtau of :func:`spab_core.solver.slope.slope`, ``c`` the contact's
    forces.
    """
    raise NotImplementedError  # compiled only


@chosen(axial_slope)
def _axial_slope(film, rotor, u, reach, ramp, c, out):
    if not moves(film):
        return lambda film, rotor, u, reach, ramp, c, out: None

    def moving(film, rotor, u, reach, ramp, c, out):
        n, ring, k = width(film.ring), film.ring, u.size - 8
        push = splat(0.0, ring)
        for row in range(film.latitudes):
            gap = base_at(film.slide, film.base, film.sine, u[k], row) - at(film.node, row) * reach
            push = push + at(film.axial, row) * (load(u, row * n, ring) / gap - 1.0)
        out[k:] = 0.0
        out[k] = u[k + 1]
        out[k + 1] = rotor.axial_inverse_mass * (c[8] - total(push)) + ramp * rotor.axial_gravity

    return moving


def axial_tangent(film, rotor, u, v, reach, along, ramp, c, out, out_v):
    """Fill in :func:`axial_slope` and its derivative along ``v``."""
    raise NotImplementedError  # compiled only


@chosen(axial_tangent)
def _axial_tangent(film, rotor, u, v, reach, along, ramp, c, out, out_v):
    if not moves(film):
        return lambda film, rotor, u, v, reach, along, ramp, c, out, out_v: None

    def moving(film, rotor, u, v, reach, along, ramp, c, out, out_v):
        n, ring, k = width(film.ring), film.ring, u.size - 8
        push = splat(0.0, ring)
        for row in range(film.latitudes):
            inverse = 1.0 / (
                base_at(film.slide, film.base, film.sine, u[k], row) - at(film.node, row) * reach
            )
            p = load(u, row * n, ring) * inverse
            closing = closing_at(film.slide, 1.0, film.node, film.sine, v[k], row, along)
            push = push + at(film.axial, row) * ((load(v, row * n, ring) + p * closing) * inverse)
        axial_slope(film, rotor, u, reach, ramp, c, out)
        out_v[k:] = 0.0
        out_v[k] = v[k + 1]
        out_v[k + 1] = rotor.axial_inverse_mass * (c[9] - total(push))

    return moving


def axial_curvature(film, rotor, v, w, reach_v, reach_w, scale, c, work, out):
    """Add to Z' what :func:`spab_core.solver.curvature.add_curvature` adds to the others."""
    raise NotImplementedError  # compiled only


@chosen(axial_curvature)
def _axial_curvature(film, rotor, v, w, reach_v, reach_w, scale, c, work, out):
    if not moves(film):
        return lambda film, rotor, v, w, reach_v, reach_w, scale, c, work, out: None

    def moving(film, rotor, v, w, reach_v, reach_w, scale, c, work, out):
        n, ring, k = width(film.ring), film.ring, out.size - 8
        push = splat(0.0, ring)
        for row in range(film.latitudes):
            o = row * n
            inverse, p = load(work.inverse_gap, o, ring), load(work.pressure, o, ring)
            h_v = closing_at(film.slide, -1.0, film.node, film.sine, v[k], row, reach_v)
            h_w = closing_at(film.slide, -1.0, film.node, film.sine, w[k], row, reach_w)
            p_w = (load(w, o, ring) - p * h_w) * inverse
            bent = h_v * p_w + h_w * load(work.pressure_v, o, ring)
            push = push - at(film.axial, row) * (bent * inverse)
        out[k + 1] += scale * rotor.axial_inverse_mass * (c[11] - total(push))

    return moving


def axial_time_slope(film, rate, rotor, out):
    """Fill in the partial derivative of Z' with respect to tau while the load is raised."""
    raise NotImplementedError  # compiled only


@chosen(axial_time_slope)
def _axial_time_slope(film, rate, rotor, out):
    if not moves(film):
        return lambda film, rate, rotor, out: None

    def moving(film, rate, rotor, out):
        out[out.size - 7] = rate * rotor.axial_gravity

    return moving


def axial_error(film, worst, speed, new, error):
    """Return the size of a step's error, that of Z and Z' included."""
    raise NotImplementedError  # compiled only


@chosen(axial_error)
def _axial_error(film, worst, speed, new, error):
    if not moves(film):
        return lambda film, worst, speed, new, error: worst

    def moving(film, worst, speed, new, error):
        k = new.size - 8
        return max(worst, abs(error[k]), abs(error[k + 1]) / max(speed, abs(new[k + 1])))

    return moving


__all__ = [
    "PLACE",
    "SPEED",
    "across_at",
    "axial",
    "axial_curvature",
    "axial_error",
    "axial_slope",
    "axial_tangent",
    "axial_time_slope",
    "base_at",
    "closing_at",
    "direction",
    "form_across",
    "inside",
    "moves",
    "nearness",
    "nowhere",
    "wall_contact",
]
