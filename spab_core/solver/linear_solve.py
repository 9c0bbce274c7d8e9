"""The linear system of a step, (I - g J) x = r, solved exactly.

J is the Jacobian of :func:`spab_core.solver.slope.slope`. Its film part couples the azimuths of a
latitude with each other (dense) and with the same azimuths of the other latitudes (diagonal), so it
is eliminated latitude by latitude, in blocks of N x N; before it the wall behind each node, which
changes the node's own entry alone (:mod:`spab_core.solver.wall`). Then the journal as a border of two columns,
then 2 x 2 for its velocity; three and 3 x 3 where it moves along the axis. No pivoting: the film part of I - g J is strong on its diagonal for the
steps that occur (tests/unit/test_kernels.py tries g = 10)."""

from __future__ import annotations

from spab_core.solver.axial import (
    across_at,
    axial,
    base_at,
    closing_at,
    form_across,
    inside,
    moves,
    wall_contact,
)
from spab_core.solver.ring import invert, matrix_product, subtract_product, width
from spab_core.solver.simd import (
    at,
    chosen,
    inlined,
    inner,
    load,
    product,
    splat,
    store,
    total,
    turn,
)
from spab_core.solver.slope import across, contact, displace, diverge
from spab_core.solver.wall import factorise_wall, feed_of, gas_entries, reduce_wall, restore_wall


@inner
def _point(film, u, work):
    """Fill in 1/H, P, dQ/dS and the gradients of Q at the point of linearisation; return how the
    film's force changes with the journal's displacement, xx, xy and yy.
    """
    n, m, ring = width(film.ring), film.latitudes, film.ring
    size, q = gas_entries(film.latitudes, film.ring, film.depth), work.q
    displace(film, u[size], u[size + 1], work.reach_u)
    reach, z = load(work.reach_u, 0, ring), axial(film.slide, u)
    push = splat(0.0, ring)
    for row in range(m):
        node, o = at(film.node, row), row * n
        inverse = 1.0 / (base_at(film.slide, film.base, film.sine, z, row) - node * reach)
        p = load(u, o, ring) * inverse
        store(work.inverse_gap, o, inverse)
        store(work.pressure, o, p)
        store(work.by_gas, o, (p + p) * inverse)
        store(q, o, p * p - 1.0)
        store(work.gradient_face, o, turn(film.to_face, p * p - 1.0))
        push = push + (at(film.weight, row) * node) * (p * inverse)
    for row in range(film.fluxes):
        store(work.gradient, row * n, across(film, film.gradient, row, q))
    c, s = load(film.cos, 0, ring), load(film.sin, 0, ring)
    return -total(push * (c * c)), -total(push * (c * s)), -total(push * (s * s))


@inner
def _displaced(film, u, x, y, z, work, out, o):
    """The film's slope per displacement of the journal by (x, y, z), at constant gas, to out[o:]."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    dq, flux, face = work.dq, work.dflux, work.dface
    displace(film, x, y, work.reach_w)
    reach, reach_face = load(work.reach_u, 0, ring), load(work.reach_u, n, ring)
    reach_w, face_w = load(work.reach_w, 0, ring), load(work.reach_w, n, ring)
    at_z = axial(film.slide, u)
    for row in range(m):
        k, closing = row * n, closing_at(film.slide, 1.0, film.node, film.sine, z, row, reach_w)
        change = load(work.by_gas, k, ring) * load(work.pressure, k, ring) * closing
        store(dq, k, change)
        h = base_at(film.slide, film.base, film.sine, at_z, row) - at(film.node, row) * reach_face
        dh = closing_at(film.slide, -3.0, film.node, film.sine, z, row, face_w)
        gradient = h * turn(film.to_face, change) + dh * load(work.gradient_face, k, ring)
        store(face, k, at(film.around, row) * (h * h) * gradient)
    for row in range(film.fluxes):
        k = row * n
        h = (
            base_at(film.slide, film.flux_base, film.flux_sine, at_z, row)
            - at(film.flux_node, row) * reach
        )
        dh = closing_at(film.slide, -3.0, film.flux_node, film.flux_sine, z, row, reach_w)
        gradient = h * across(film, film.gradient, row, dq) + dh * load(work.gradient, k, ring)
        store(flux, k, (h * h) * gradient)
    for row in range(m):
        k = row * n
        store(
            out,
            o + k,
            diverge(film, flux, face, row)
            - feed_of(film.depth, film.feed, work.feed, row, ring) * load(dq, k, ring),
        )


@inner
def _assemble(film, x, y, z, step, work):
    """The blocks of I - step J_SS within latitudes, at ``block`` by rows and columns of blocks."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    matrix, square = film.harmonics, n * n
    r2 = x * x + y * y
    for row in range(m):
        # H³ = (b - c (x cos t + y sin t))³ as a sum of harmonics
        b = base_at(film.slide, film.base, film.sine, z, row)
        c, scale = at(film.node, row), -step * at(film.around, row)
        c2, c3 = c * c, c * c * c
        f0 = scale * (b * b * b + 1.5 * b * c2 * r2)
        first = -scale * (3.0 * b * b * c + 0.75 * c3 * r2)
        f1, g1 = first * x, first * y
        f2, g2 = scale * 1.5 * b * c2 * (x * x - y * y), scale * 3.0 * b * c2 * x * y
        third = -0.25 * scale * c3
        f3, g3 = third * x * (x * x - 3.0 * y * y), third * y * (3.0 * x * x - y * y)
        o = (row * m + row) * square
        for k in range(n):
            here = k * n
            column = f0 * load(matrix, here, ring) + f1 * load(matrix, square + here, ring)
            column = column + g1 * load(matrix, 2 * square + here, ring)
            column = column + f2 * load(matrix, 3 * square + here, ring)
            column = column + g2 * load(matrix, 4 * square + here, ring)
            column = column + f3 * load(matrix, 5 * square + here, ring)
            column = column + g3 * load(matrix, 6 * square + here, ring)
            column = at(work.by_gas, row * n + k) * column - step * load(
                matrix, 7 * square + here, ring
            )
            store(work.block, o + here, column)


@inner
def _couple(film, z, step, work):
    """The diagonals of I - step J_SS between latitudes, and what joins the diagonal within one."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    square, reach = m * m, load(work.reach_u, 0, ring)
    form_across(film, z, work)
    for row in range(m):
        for column in range(m):
            k = row * m + column
            higher = across_at(film.slide, film.across, work.across, 2 * square + k)
            higher = (
                higher + across_at(film.slide, film.across, work.across, 3 * square + k) * reach
            )
            cubic = across_at(film.slide, film.across, work.across, square + k) + reach * higher
            cubic = across_at(film.slide, film.across, work.across, k) + reach * cubic
            if row == column:
                cubic = cubic - feed_of(film.depth, film.feed, work.feed, row, ring)
            value = (-step) * cubic * load(work.by_gas, column * n, ring)
            store(work.coupling, k * n, value + 1.0 if row == column else value)


@inner
def _add_diagonal(work, block, diagonal, ring):
    """Add a diagonal of ``coupling`` to a block."""
    n = width(ring)
    for k in range(n):
        work.block[block * n * n + k * n + k] += work.coupling[diagonal * n + k]


@inner
def _factorise(film, work):
    """Eliminate latitude after latitude: ``block`` becomes the inverses on its diagonal and what is
    left of the couplings below, ``answer`` what each latitude answers to the later ones.

    The couplings of the first are diagonal, so that it takes no products of matrices."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    square, block, answer, coupling = n * n, work.block, work.answer, work.coupling
    _add_diagonal(work, 0, 0, ring)
    invert(block, 0, ring)
    for row in range(1, m):
        left = load(coupling, row * m * n, ring)
        for column in range(1, m):
            o = (row * m + column) * square
            for k in range(n):
                passed = left * (at(coupling, column * n + k) * load(block, k * n, ring))
                before = load(block, o + k * n, ring) if row == column else splat(0.0, ring)
                store(block, o + k * n, before - passed)
            _add_diagonal(work, row * m + column, row * m + column, ring)
    for k in range(1, m):
        own = (k * m + k) * square
        invert(block, own, ring)
        for column in range(k + 1, m):
            o = (k * m + column) * square
            matrix_product(block, own, block, o, answer, o, ring)
            for row in range(k + 1, m):
                below, there = (row * m + k) * square, (row * m + column) * square
                subtract_product(block, below, answer, o, block, there, ring)


@inner
def _solve_film(film, work, r, o):
    """Solve the film part in place for the right-hand side at r[o:]."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    square, block, coupling = n * n, work.block, work.coupling
    first = product(block, 0, load(r, o, ring))
    for row in range(1, m):
        passed = load(coupling, row * m * n, ring) * first
        store(r, o + row * n, load(r, o + row * n, ring) - passed)
    for k in range(1, m):
        x = product(block, (k * m + k) * square, load(r, o + k * n, ring))
        store(r, o + k * n, x)
        for row in range(k + 1, m):
            passed = product(block, (row * m + k) * square, x)
            store(r, o + row * n, load(r, o + row * n, ring) - passed)
    for k in range(m - 2, 0, -1):
        x = load(r, o + k * n, ring)
        for column in range(k + 1, m):
            x = x - product(work.answer, (k * m + column) * square, load(r, o + column * n, ring))
        store(r, o + k * n, x)
    back = splat(0.0, ring)
    for column in range(1, m):
        back = back + load(coupling, column * n, ring) * load(r, o + column * n, ring)
    store(r, o, first - product(block, 0, back))


@inner
def _force_of(film, work, r, o):
    """Force of the film per change of gas content: F_S . r[o:]."""
    n, ring = width(film.ring), film.ring
    push = splat(0.0, ring)
    for row in range(film.latitudes):
        k = row * n
        push = push + at(film.weight, row) * (
            load(work.inverse_gap, k, ring) * load(r, o + k, ring)
        )
    return -total(push * load(film.cos, 0, ring)), -total(push * load(film.sin, 0, ring))


@inlined
def linearise(system, step, u, work):
    """Form and factorise I - step J at ``u``. False where the journal is outside the clearance."""
    film, rotor = system
    n, size = gas_entries(film.latitudes, film.ring, film.depth), film.latitudes * width(film.ring)
    x, y, z = u[n], u[n + 1], axial(film.slide, u)
    if not inside(film.slide, film.room, film.edge_cosine, film.edge_sine, x, y, z):
        return False
    pxx, pxy, pyy = _point(film, u, work)
    factorise_wall(film, step, u, work)
    _assemble(film, x, y, z, step, work)
    _couple(film, z, step, work)
    _factorise(film, work)
    _displaced(film, u, 1.0, 0.0, 0.0, work, work.border, 0)
    _displaced(film, u, 0.0, 1.0, 0.0, work, work.border, size)
    _solve_film(film, work, work.border, 0)
    _solve_film(film, work, work.border, size)
    _reduce_rotor(film, rotor, u, step, pxx, pxy, pyy, work)
    return True


def _reduce_rotor(film, rotor, u, step, pxx, pxy, pyy, work):
    """Eliminate the rotor down to the journal's velocity, and invert what is left."""
    raise NotImplementedError  # compiled only


@chosen(_reduce_rotor)
def _reduce_rotor_of(film, rotor, u, step, pxx, pxy, pyy, work):
    return _reduce_moving if moves(film) else _reduce_held


def _reduce_held(film, rotor, u, step, pxx, pxy, pyy, work):
    n, size = gas_entries(film.latitudes, film.ring, film.depth), film.latitudes * width(film.ring)
    x, y = u[n], u[n + 1]
    gxx, gyx = _force_of(film, work, work.border, 0)
    gxy, gyy = _force_of(film, work, work.border, size)
    vx, vy = u[n + 4], u[n + 5]
    c0 = contact(rotor, x, y, vx, vy, (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0))
    c1 = contact(rotor, x, y, vx, vy, (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    k1, k2, m = rotor.coupling_disc, rotor.coupling_journal, rotor.inverse_mass
    disc = 1.0 + step * step * k1
    spring = k2 * (step * step * k1 / disc - 1.0)
    small = work.small
    axx, axy = m * (pxx + step * gxx + c0[2]) + spring, m * (pxy + step * gxy + c0[4])
    ayx, ayy = m * (pxy + step * gyx + c0[3]), m * (pyy + step * gyy + c0[5]) + spring
    bxx, bxy = 1.0 - step * step * axx - step * m * c1[2], -step * step * axy - step * m * c1[4]
    byx, byy = -step * step * ayx - step * m * c1[3], 1.0 - step * step * ayy - step * m * c1[5]
    determinant = bxx * byy - bxy * byx
    small[0], small[1], small[2], small[3] = axx, axy, ayx, ayy
    small[4], small[5] = byy / determinant, -bxy / determinant
    small[6], small[7] = -byx / determinant, bxx / determinant
    small[8], small[9] = disc, step


@inner
def _axial_force_of(film, work, r, o):
    """Axial force of the film per change of gas content."""
    n, ring = width(film.ring), film.ring
    push = splat(0.0, ring)
    for row in range(film.latitudes):
        k = row * n
        gas = load(work.inverse_gap, k, ring) * load(r, o + k, ring)
        push = push + at(film.axial, row) * gas
    return -total(push)


@inner
def _axial_point(film, work):
    """How the film's force changes with the journal's displacement, xz (and zx), yz, zz."""
    n, ring = width(film.ring), film.ring
    push, along = splat(0.0, ring), splat(0.0, ring)
    for row in range(film.latitudes):
        k = row * n
        stiff = load(work.pressure, k, ring) * load(work.inverse_gap, k, ring)
        push = push + (at(film.axial, row) * at(film.node, row)) * stiff
        along = along + (at(film.axial, row) * at(film.sine, row)) * stiff
    c, s = load(film.cos, 0, ring), load(film.sin, 0, ring)
    return -total(push * c), -total(push * s), -total(along)


# of ``small`` where the journal moves along the axis: slope of its velocity by its displacement and
# its inverse remainder, by rows, then the disc's pivot and the step
_BY_PLACE, _REMAINDER, _DISC, _STEP = 0, 9, 18, 19


def _reduce_moving(film, rotor, u, step, pxx, pxy, pyy, work):
    n, size, small = (
        gas_entries(film.latitudes, film.ring, film.depth),
        film.latitudes * width(film.ring),
        work.small,
    )
    _displaced(film, u, 0.0, 0.0, 1.0, work, work.border, 2 * size)
    _solve_film(film, work, work.border, 2 * size)
    q = (u[n], u[n + 1], u[n + 8], u[n + 4], u[n + 5], u[n + 9])
    none = 0.0
    c0 = wall_contact(
        film.edge_cosine,
        film.edge_sine,
        rotor,
        q,
        (1.0, none, none, none, none, none),
        (none, 1.0, none, none, none, none),
    )
    c1 = wall_contact(
        film.edge_cosine,
        film.edge_sine,
        rotor,
        q,
        (none, none, 1.0, none, none, none),
        (none, none, none, 1.0, none, none),
    )
    c2 = wall_contact(
        film.edge_cosine,
        film.edge_sine,
        rotor,
        q,
        (none, none, none, none, 1.0, none),
        (none, none, none, none, none, 1.0),
    )
    pxz, pyz, pzz = _axial_point(film, work)
    by_place = (
        (pxx + c0[2], pxy + c0[4], pxz + c1[2]),
        (pxy + c0[3], pyy + c0[5], pyz + c1[3]),
        (pxz + c0[9], pyz + c0[10], pzz + c1[9]),
    )
    by_speed = (
        (c1[4], c2[2], c2[4]),
        (c1[5], c2[3], c2[5]),
        (c1[10], c2[9], c2[10]),
    )
    k1, k2 = rotor.coupling_disc, rotor.coupling_journal
    disc = 1.0 + step * step * k1
    spring = k2 * (step * step * k1 / disc - 1.0)
    for j in range(3):
        gx, gy = _force_of(film, work, work.border, j * size)
        gas = (gx, gy, _axial_force_of(film, work, work.border, j * size))
        for i in range(3):
            m = rotor.inverse_mass if i < 2 else rotor.axial_inverse_mass
            own = m * (by_place[i][j] + step * gas[i])
            own += spring if i == j and i < 2 else 0.0
            small[_BY_PLACE + 3 * i + j] = own
            rest = -step * step * own - step * m * by_speed[i][j]
            small[_REMAINDER + 3 * i + j] = rest + (1.0 if i == j else 0.0)
    a, b, c = small[_REMAINDER], small[_REMAINDER + 1], small[_REMAINDER + 2]
    d, e, f = small[_REMAINDER + 3], small[_REMAINDER + 4], small[_REMAINDER + 5]
    g, h, i = small[_REMAINDER + 6], small[_REMAINDER + 7], small[_REMAINDER + 8]
    aa, bb, cc = e * i - f * h, f * g - d * i, d * h - e * g
    share = 1.0 / (a * aa + b * bb + c * cc)
    small[_REMAINDER], small[_REMAINDER + 3], small[_REMAINDER + 6] = (
        share * aa,
        share * bb,
        share * cc,
    )
    small[_REMAINDER + 1], small[_REMAINDER + 2] = share * (c * h - b * i), share * (b * f - c * e)
    small[_REMAINDER + 4], small[_REMAINDER + 5] = share * (a * i - c * g), share * (c * d - a * f)
    small[_REMAINDER + 7], small[_REMAINDER + 8] = share * (b * g - a * h), share * (a * e - b * d)
    small[_DISC], small[_STEP] = disc, step


@inlined
def solve(system, work, r):
    """Solve (I - step J) x = r in place, after :func:`linearise`."""
    film, rotor = system
    reduce_wall(film, work, r)
    _solve_film(film, work, r, 0)
    _restore(film, rotor, work, r)


def _restore(film, rotor, work, r):
    """Solve for the rotor, then for gas and wall, the film's own answer being in ``r``."""
    raise NotImplementedError  # compiled only


@chosen(_restore)
def _restore_of(film, rotor, work, r):
    return _restore_moving if moves(film) else _restore_held


def _restore_moving(film, rotor, work, r):
    n, size, ring = (
        gas_entries(film.latitudes, film.ring, film.depth),
        film.latitudes * width(film.ring),
        film.ring,
    )
    small = work.small
    step, disc, k1 = small[_STEP], small[_DISC], rotor.coupling_disc
    fx, fy = _force_of(film, work, r, 0)
    fz = _axial_force_of(film, work, r, 0)
    k2, m = rotor.coupling_journal, rotor.inverse_mass
    ax = r[n + 2] + step * (r[n + 6] - step * k1 * r[n + 2]) / disc
    ay = r[n + 3] + step * (r[n + 7] - step * k1 * r[n + 3]) / disc
    push = (k2 * ax + m * fx, k2 * ay + m * fy, rotor.axial_inverse_mass * fz)
    before, rest = (r[n], r[n + 1], r[n + 8]), (r[n + 4], r[n + 5], r[n + 9])
    vx = vy = vz = 0.0
    for i in range(3):
        value, o = push[i], _BY_PLACE + 3 * i
        value += small[o] * before[0] + small[o + 1] * before[1] + small[o + 2] * before[2]
        value = rest[i] + step * value
        vx += small[_REMAINDER + i] * value
        vy += small[_REMAINDER + 3 + i] * value
        vz += small[_REMAINDER + 6 + i] * value
    x, y, z = before[0] + step * vx, before[1] + step * vy, before[2] + step * vz
    v1x = (r[n + 6] - step * k1 * (r[n + 2] - x)) / disc
    v1y = (r[n + 7] - step * k1 * (r[n + 3] - y)) / disc
    for k in range(0, size, width(ring)):
        answer = (step * x) * load(work.border, k, ring)
        answer = answer + (step * y) * load(work.border, size + k, ring)
        answer = answer + (step * z) * load(work.border, 2 * size + k, ring)
        store(r, k, load(r, k, ring) + answer)
    restore_wall(film, work, x, y, z, r)
    r[n + 2] += step * v1x
    r[n + 3] += step * v1y
    r[n], r[n + 1], r[n + 4], r[n + 5], r[n + 6], r[n + 7] = x, y, vx, vy, v1x, v1y
    r[n + 8], r[n + 9] = z, vz


def _restore_held(film, rotor, work, r):
    n, size = gas_entries(film.latitudes, film.ring, film.depth), film.latitudes * width(film.ring)
    small = work.small
    step, disc = small[9], small[8]
    k1, k2, m = rotor.coupling_disc, rotor.coupling_journal, rotor.inverse_mass
    fx, fy = _force_of(film, work, r, 0)
    # disc displacement = a + (step² k1 / disc) journal displacement
    ax = r[n + 2] + step * (r[n + 6] - step * k1 * r[n + 2]) / disc
    ay = r[n + 3] + step * (r[n + 7] - step * k1 * r[n + 3]) / disc
    rx = r[n + 4] + step * (k2 * ax + m * fx + small[0] * r[n] + small[1] * r[n + 1])
    ry = r[n + 5] + step * (k2 * ay + m * fy + small[2] * r[n] + small[3] * r[n + 1])
    vx, vy = small[4] * rx + small[5] * ry, small[6] * rx + small[7] * ry
    x, y = r[n] + step * vx, r[n + 1] + step * vy
    v1x = (r[n + 6] - step * k1 * (r[n + 2] - x)) / disc
    v1y = (r[n + 7] - step * k1 * (r[n + 3] - y)) / disc
    ring = film.ring
    for k in range(0, size, width(ring)):
        answer = (step * x) * load(work.border, k, ring) + (step * y) * load(
            work.border, size + k, ring
        )
        store(r, k, load(r, k, ring) + answer)
    restore_wall(film, work, x, y, 0.0, r)
    r[n + 2] += step * v1x
    r[n + 3] += step * v1y
    r[n], r[n + 1], r[n + 4], r[n + 5], r[n + 6], r[n + 7] = x, y, vx, vy, v1x, v1y
