"""The linear system of a step, (I - g J) x = r, solved exactly.

J is the Jacobian of :func:`spab_core.solver.slope.slope`. Its film part couples the azimuths of a
latitude with each other (dense) and with the same azimuths of the other latitudes (diagonal), so it
is eliminated latitude by latitude, in blocks of N x N; before it the wall behind each node, which
changes the node's own entry alone (:mod:`spab_core.solver.wall`). Then the journal as a border of two columns,
then 2 x 2 for its velocity. No pivoting: the film part of I - g J is strong on its diagonal for the
steps that occur (tests/unit/test_kernels.py tries g = 10)."""

from __future__ import annotations

from spab_core.solver.ring import invert, matrix_product, subtract_product, width
from spab_core.solver.simd import at, inlined, inner, load, product, splat, store, total, turn
from spab_core.solver.slope import across, contact, displace, diverge
from spab_core.solver.wall import factorise_wall, feed_of, gas_entries, reduce_wall, restore_wall


@inner
def _point(film, u, work):
    """Fill in 1/H, P, dQ/dS and the gradients of Q at the point of linearisation; return how the
    film's force changes with the journal's displacement, xx, xy and yy.
    """
    n, m, ring = width(film.ring), film.latitudes, film.ring
    size, q = gas_entries(film), work.q
    displace(film, u[size], u[size + 1], work.reach_u)
    reach = load(work.reach_u, 0, ring)
    push = splat(0.0, ring)
    for row in range(m):
        node, o = at(film.node, row), row * n
        inverse = 1.0 / (at(film.base, row) - node * reach)
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
def _displaced(film, x, y, work, out, o):
    """The film's slope per displacement of the journal by (x, y), at constant gas, to out[o:]."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    dq, flux, face = work.dq, work.dflux, work.dface
    displace(film, x, y, work.reach_w)
    reach, reach_face = load(work.reach_u, 0, ring), load(work.reach_u, n, ring)
    reach_w, face_w = load(work.reach_w, 0, ring), load(work.reach_w, n, ring)
    for row in range(m):
        node, k = at(film.node, row), row * n
        change = load(work.by_gas, k, ring) * load(work.pressure, k, ring) * (node * reach_w)
        store(dq, k, change)
        h, dh = at(film.base, row) - node * reach_face, (-3.0 * node) * face_w
        gradient = h * turn(film.to_face, change) + dh * load(work.gradient_face, k, ring)
        store(face, k, at(film.around, row) * (h * h) * gradient)
    for row in range(film.fluxes):
        node, k = at(film.flux_node, row), row * n
        h, dh = at(film.flux_base, row) - node * reach, (-3.0 * node) * reach_w
        gradient = h * across(film, film.gradient, row, dq) + dh * load(work.gradient, k, ring)
        store(flux, k, (h * h) * gradient)
    for row in range(m):
        k = row * n
        store(
            out,
            o + k,
            diverge(film, flux, face, row) - feed_of(film, work, row) * load(dq, k, ring),
        )


@inner
def _assemble(film, x, y, step, work):
    """The blocks of I - step J_SS within latitudes, at ``block`` by rows and columns of blocks."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    matrix, square = film.harmonics, n * n
    r2 = x * x + y * y
    for row in range(m):
        # H³ = (b - c (x cos t + y sin t))³ as a sum of harmonics
        b = at(film.base, row)
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
def _couple(film, step, work):
    """The diagonals of I - step J_SS between latitudes, and what joins the diagonal within one."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    square, reach = m * m, load(work.reach_u, 0, ring)
    for row in range(m):
        for column in range(m):
            k = row * m + column
            cubic = at(film.across, 2 * square + k) + at(film.across, 3 * square + k) * reach
            cubic = at(film.across, k) + reach * (at(film.across, square + k) + reach * cubic)
            if row == column:
                cubic = cubic - feed_of(film, work, row)
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
    n, size = gas_entries(film), film.latitudes * width(film.ring)
    x, y = u[n], u[n + 1]
    if not x * x + y * y < film.room * film.room:
        return False
    pxx, pxy, pyy = _point(film, u, work)
    factorise_wall(film, step, u, work)
    _assemble(film, x, y, step, work)
    _couple(film, step, work)
    _factorise(film, work)
    _displaced(film, 1.0, 0.0, work, work.border, 0)
    _displaced(film, 0.0, 1.0, work, work.border, size)
    _solve_film(film, work, work.border, 0)
    _solve_film(film, work, work.border, size)
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
    return True


@inlined
def solve(system, work, r):
    """Solve (I - step J) x = r in place, after :func:`linearise`."""
    film, rotor = system
    n, size = gas_entries(film), film.latitudes * width(film.ring)
    small = work.small
    step, disc = small[9], small[8]
    k1, k2, m = rotor.coupling_disc, rotor.coupling_journal, rotor.inverse_mass
    reduce_wall(film, work, r)
    _solve_film(film, work, r, 0)
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
    restore_wall(film, work, x, y, r)
    r[n + 2] += step * v1x
    r[n + 3] += step * v1y
    r[n], r[n + 1], r[n + 4], r[n + 5], r[n + 6], r[n + 7] = x, y, vx, vy, v1x, v1y
