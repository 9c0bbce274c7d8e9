"""The linear system of a step, (I - g J) x = r, solved exactly.

J is the Jacobian of :func:`spab_core.solver.slope.slope`. Its film part couples the latitudes of a
column with each other (dense) and with the columns east and west (diagonal), periodically. A row of
the state holds two opposite columns, so that the ring of N columns is two equal chains side by
side, eliminated at once from both ends towards their middles, and the last row as their separator:
its two columns lie between the chains. Then the journal as a border of two columns, then 2 x 2 for
its velocity. No pivoting: the film part of I - g J is strong on its diagonal for the steps that
occur (tests/unit/test_kernels.py tries g = 10)."""

from __future__ import annotations

from numba.extending import overload

from spab_core.solver.row_ops import (
    apply,
    chosen,
    following,
    near,
    opposite,
    preceding,
    span,
    turned,
)
from spab_core.solver.simd import (
    HALF,
    WIDTH,
    block_times,
    halves_times,
    inlined,
    inner,
    invert_blocks,
    invert_halves,
    splat,
    spread,
    vload,
    vstore,
    vsum,
)
from spab_core.solver.slope import contact

NEGLIGIBLE = 1e-11  # couplings dropped in the elimination, relative to the unit matrix


@inner
def _pivot(b, o, k, span, width, unit):
    """Step k of Gauss-Jordan inversion in place, no pivoting, of the blocks of ``span`` side by
    side at b[o:].
    """
    ok, other = o + k * width, width - span
    first, second = 1.0 / spread(b, ok + k), 1.0 / spread(b, ok + other + k)
    for v in range(0, width, WIDTH):
        pivot = first if v < span else second
        vstore(b, ok + v, vload(b, ok + v) * pivot + pivot * vload(unit, k * width + v))
    for i in range(span):
        if i != k:
            first, second = spread(b, o + i * width + k), spread(b, o + i * width + other + k)
            for v in range(0, width, WIDTH):
                factor = first if v < span else second
                vstore(
                    b, o + i * width + v, vload(b, o + i * width + v) - factor * vload(b, ok + v)
                )
    for v in range(0, width, WIDTH):
        vstore(b, ok + v, vload(b, ok + v) - vload(unit, k * width + v))


@inner
def _invert(film, work, j, other):
    """Invert the blocks of the rows j and other, which may be the same."""
    half = span(film.row)
    size = 2 * half * half
    if half == HALF:
        invert_halves(work.inverse, j * size, other * size)
    for k in range(half if half > HALF else 0):
        _pivot(work.inverse, j * size, k, half, 2 * half, film.unit)
        if other != j:
            _pivot(work.inverse, other * size, k, half, 2 * half, film.unit)


@inner
def _film_per_displacement(film, work, x, y):
    """The two columns of J_SX, the film's slope per journal displacement at the point of
    linearisation, into ``border``.
    """
    half = span(film.row)
    rows, width = film.rows, 2 * half
    n = rows * width
    q, b, flux = work.q, work.by_gap, work.flux
    for r in range(rows):
        g = x * film.cos[r] + y * film.sin[r]
        for v in range(0, width, WIDTH):
            k, node = r * width + v, vload(film.flux_node, v)
            h = 1.0 - node * g
            vstore(
                flux,
                k,
                h
                * h
                * (
                    h * apply(film.gradient, 0, b, r * width, v, film.row)
                    - 3.0 * node * vload(work.gq, k)
                ),
            )
    for v in range(0, width, WIDTH):
        around, feed, o = vload(film.flux_around, v), vload(film.feed, v), opposite(v, film.row)
        west_x, west_y = _pushed_face(film, vload(film.node, o), around, x, y, q, b, rows - 1, o)
        west_x, west_y = turned(west_x, film.row), turned(west_y, film.row)
        for r in range(rows):
            k = r * width + v
            east_x, east_y = _pushed_face(film, vload(film.node, v), around, x, y, q, b, r, v)
            total = apply(film.divergence, 0, flux, r * width, v, film.row) - feed * vload(b, k)
            vstore(work.border, k, total * film.cos[r] + (east_x - west_x))
            vstore(work.border, n + k, total * film.sin[r] + (east_y - west_y))
            west_x, west_y = east_x, east_y


@inner
def _pushed_face(film, node, around, x, y, q, b, r, v):
    """Flux through the faces east of row r per journal displacement along x and y."""
    half = span(film.row)
    rows, k = film.rows, r * 2 * half + v
    re = r + 1 if r + 1 < rows else 0
    cf, sf = film.cos_face[r], film.sin_face[r]
    h = 1.0 - node * (x * cf + y * sf)
    scale = around * (h * h)
    gap = -3.0 * node * (scale * (following(q, r, v, rows, film.row) - vload(q, k)))
    # by_gap of the row after the last, whose halves are exchanged, still goes with the cosine of
    # row 0
    there, here = scale * h * following(b, r, v, rows, film.row), scale * h * vload(b, k)
    return gap * cf + there * film.cos[re] - here * film.cos[r], gap * sf + there * film.sin[
        re
    ] - here * film.sin[r]


@inner
def _assemble(film, work, x, y, step):
    """The entries of I - step J_SS: ``inverse``, its blocks within columns, and ``lower``,
    ``upper`` around.
    """
    half = span(film.row)
    rows, width = film.rows, 2 * half
    size = half * width
    s = work.by_gas  # dQ/dS
    for v in range(0, width, WIDTH):
        node, around, o = (
            vload(film.node, v),
            vload(film.flux_around, v) * step,
            opposite(v, film.row),
        )
        couette, feed = vload(film.couette, v) * step, vload(film.feed, v) * step
        h = 1.0 - vload(film.node, o) * (x * film.cos_face[rows - 1] + y * film.sin_face[rows - 1])
        west = turned(around * (h * h * h), film.row)
        for r in range(rows):
            k, g = r * width + v, x * film.cos[r] + y * film.sin[r]
            h = 1.0 - node * (x * film.cos_face[r] + y * film.sin_face[r])
            east = around * (h * h * h)
            vstore(work.upper, k, couette - east * following(s, r, v, rows, film.row))
            vstore(work.lower, k, -1.0 * couette - west * preceding(s, r, v, rows, film.row))
            diagonal = 1.0 + (east + west + feed) * vload(s, k)
            for c in range(half):
                m = c * width + v
                across = vload(film.across, m) + g * (
                    vload(film.across, size + m)
                    + g * (vload(film.across, 2 * size + m) + g * vload(film.across, 3 * size + m))
                )
                vstore(
                    work.inverse,
                    r * size + m,
                    diagonal * vload(film.unit, m)
                    - (step * across) * near(s, r * width, c, v, film.row),
                )
            west = east


@inner
def _eliminate(work, j, target, towards, back, side, coupled, row):
    """Eliminate row j (its blocks are inverted already) from the row ``target``.

    ``towards`` couples row j to ``target``, ``back`` the other way. ``coupled``: row j answers to
    the separator, whose columns of ``fill`` are those of ``side`` (0: the separator's own halves,
    1: exchanged). Returns whether the target does."""
    half = span(row)
    width = 2 * half
    size = half * width
    d, fill, t = work.inverse, work.fill, work.scratch
    for c in range(half):
        for v in range(0, width, WIDTH):
            k = c * width + v
            passed = (
                vload(back, target * width + v)
                * vload(d, j * size + k)
                * near(towards, j * width, c, v, row)
            )
            vstore(d, target * size + k, vload(d, target * size + k) - passed)
    if not coupled:
        return False
    o, to = (2 * j + side) * size, (2 * target + side) * size
    total = splat(0.0)
    for c in range(half):
        for v in range(0, width, WIDTH):
            vstore(t, v, apply(d, j * size, fill, o + c * width, v, row))
        for v in range(0, width, WIDTH):
            own = vload(t, v)
            passed = splat(0.0) - vload(back, target * width + v) * own
            total = total + passed * passed
            vstore(fill, o + c * width + v, own)
            vstore(fill, to + c * width + v, passed)
    return vsum(total) > NEGLIGIBLE**2


@inner
def _answer(work, j, source, towards, side, fresh, row):
    """fill[j] -= D[j]^-1 diag(towards[j]) fill[source]; ``fresh``: from zero.

    Returns whether it matters.
    """
    half = span(row)
    width = 2 * half
    size = half * width
    d, fill, t = work.inverse, work.fill, work.scratch
    o, start = (2 * j + side) * size, (2 * source + side) * size
    total = splat(0.0)
    for c in range(half):
        for v in range(0, width, WIDTH):
            vstore(t, v, vload(towards, j * width + v) * vload(fill, start + c * width + v))
        for v in range(0, width, WIDTH):
            before = splat(0.0) if fresh else vload(fill, o + c * width + v)
            now = before - apply(d, j * size, t, 0, v, row)
            total = total + now * now
            vstore(fill, o + c * width + v, now)
    return vsum(total) > NEGLIGIBLE**2


@inner
def _factorise(film, work):
    """Factorise the two chains and their separator.

    ``fill`` becomes what each row answers to the separator. It decays from row to row (gas diffuses
    a few columns far in one step); where it falls below :data:`NEGLIGIBLE` it is dropped. ``small``
    keeps the last row that answers to the separator at the chains' beginning, and the first one
    that answers to the one at their end."""
    half = span(film.row)
    rows, width = film.rows, 2 * half
    chain, size = rows - 1, half * width
    middle, end = chain // 2, chain - 1
    d, fill, lower, upper = work.inverse, work.fill, work.lower, work.upper
    t = work.scratch
    for c in range(half):
        for v in range(0, width, WIDTH):
            k = c * width + v
            vstore(fill, size + k, vload(film.unit, k) * vload(lower, v))
            vstore(fill, 2 * end * size + k, vload(film.unit, k) * vload(upper, end * width + v))
    first, second = True, True
    last_first, first_second = 0, end
    for j in range(middle):
        other = end - j
        pair = other > middle
        _invert(film, work, j, other if pair else j)
        last_first, first_second = (
            j if first else last_first,
            other if second and pair else first_second,
        )
        first = _eliminate(work, j, j + 1, upper, lower, 1, first, film.row)
        if pair:
            second = _eliminate(work, other, other - 1, lower, upper, 0, second, film.row)
    _invert(film, work, middle, middle)
    for side in range(2):
        if first if side == 1 else second:
            o = (2 * middle + side) * size
            for c in range(half):
                for v in range(0, width, WIDTH):
                    vstore(t, v, apply(d, middle * size, fill, o + c * width, v, film.row))
                for v in range(0, width, WIDTH):
                    vstore(fill, o + c * width + v, vload(t, v))
    if first:
        last_first = middle
    if second:
        first_second = middle
    for j in range(last_first - 1, -1, -1):
        _answer(work, j, j + 1, upper, 1, False, film.row)
    for j in range(first_second + 1, chain):
        _answer(work, j, j - 1, lower, 0, False, film.row)
    while first and last_first < end:  # past the middle
        first = _answer(work, last_first + 1, last_first, lower, 1, True, film.row)
        last_first += 1
    while second and first_second > 0:
        second = _answer(work, first_second - 1, first_second, upper, 0, True, film.row)
        first_second -= 1
    _separate(film, work, last_first == end, first_second == 0)
    work.small[14], work.small[15] = last_first, first_second


@inner
def _separate(film, work, reaches_end, reaches_start):
    """Form and invert the separator's dense block: both of its columns, coupled through the chains."""
    half = span(film.row)
    rows, width = film.rows, 2 * half
    chain, size = rows - 1, half * width
    d, fill, lower, upper, dense = work.inverse, work.fill, work.lower, work.upper, work.separator
    end = 2 * (chain - 1) * size
    for c in range(half):
        for v in range(0, width, WIDTH):
            k, m, o = chain * width + v, c * width + v, c * width + opposite(v, film.row)
            west, east = vload(lower, k), vload(upper, k)
            same = (
                vload(d, chain * size + m)
                - west * vload(fill, end + m)
                - east * turned(vload(fill, size + o), film.row)
            )
            cross = splat(0.0)
            if reaches_end:
                cross = cross - west * vload(fill, end + size + m)
            if reaches_start:
                cross = cross - east * turned(vload(fill, o), film.row)
            vstore(dense, m, chosen(v, same, cross, film.row))
            vstore(dense, size + m, chosen(v, cross, same, film.row))
    if half == HALF:
        invert_blocks(dense, 0, 0)
    for k in range(width if half > HALF else 0):
        _pivot(dense, 0, k, width, width, film.eye)


@inner
def _solve_film(film, work, r, o):
    """Solve the film part in place for the right-hand side at r[o:]: the chains alone, the
    separator, what it changes.
    """
    half = span(film.row)
    rows, width = film.rows, 2 * half
    chain, size = rows - 1, half * width
    middle, end = chain // 2, chain - 1
    last_first, first_second = int(work.small[14]), int(work.small[15])
    d, fill, lower, upper, t = work.inverse, work.fill, work.lower, work.upper, work.scratch
    for j in range(middle):
        other = end - j
        for v in range(0, width, WIDTH):
            k = (j + 1) * width + v
            vstore(
                r,
                o + k,
                vload(r, o + k)
                - vload(lower, k) * apply(d, j * size, r, o + j * width, v, film.row),
            )
        if other > middle:
            for v in range(0, width, WIDTH):
                k = (other - 1) * width + v
                vstore(
                    r,
                    o + k,
                    vload(r, o + k)
                    - vload(upper, k) * apply(d, other * size, r, o + other * width, v, film.row),
                )
    for step in range(middle + 1):
        j, other = middle - step, middle + step
        here, there = o + j * width, o + other * width
        pair = 0 < step and other < chain
        for v in range(0, width, WIDTH):
            if step > 0:
                vstore(
                    r,
                    here + v,
                    vload(r, here + v) - vload(upper, j * width + v) * vload(r, here + width + v),
                )
            if pair:
                vstore(
                    r,
                    there + v,
                    vload(r, there + v)
                    - vload(lower, other * width + v) * vload(r, there - width + v),
                )
        for v in range(0, width, WIDTH):
            vstore(t, v, apply(d, j * size, r, here, v, film.row))
            if pair:
                vstore(t, width + v, apply(d, other * size, r, there, v, film.row))
        for v in range(0, width, WIDTH):
            vstore(r, here + v, vload(t, v))
            if pair:
                vstore(r, there + v, vload(t, width + v))
    last = o + chain * width
    for v in range(0, width, WIDTH):
        k = chain * width + v
        east = turned(vload(r, o + opposite(v, film.row)), film.row)
        vstore(
            t,
            v,
            vload(r, last + v)
            - vload(lower, k) * vload(r, last - width + v)
            - vload(upper, k) * east,
        )
    for v in range(0, width, WIDTH):
        answer = splat(0.0)
        for c in range(width):
            answer = answer + vload(work.separator, c * width + v) * spread(t, c)
        vstore(r, last + v, answer)
    for v in range(0, width, WIDTH):
        vstore(t, v, turned(vload(r, last + opposite(v, film.row)), film.row))
    for j in range(chain):
        for v in range(0, width, WIDTH):
            k = o + j * width + v
            total = vload(r, k)
            if j <= last_first:
                total = total - apply(fill, (2 * j + 1) * size, t, 0, v, film.row)
            if j >= first_second:
                total = total - apply(fill, 2 * j * size, r, last, v, film.row)
            vstore(r, k, total)


@inner
def _solve_halves(film, work, r, o):
    """:func:`_solve_film` for rows of one register, which stay there from row to row."""
    chain, size = film.rows - 1, 2 * HALF * HALF
    middle, end = chain // 2, chain - 1
    last_first, first_second = int(work.small[14]), int(work.small[15])
    d, fill, lower, upper = work.inverse, work.fill, work.lower, work.upper
    left, right = vload(r, o), vload(r, o + end * WIDTH)
    for j in range(middle):
        other, k = end - j, (j + 1) * WIDTH
        left = vload(r, o + k) - vload(lower, k) * halves_times(d, j * size, left)
        vstore(r, o + k, left)
        if other > middle:
            k = (other - 1) * WIDTH
            right = vload(r, o + k) - vload(upper, k) * halves_times(d, other * size, right)
            vstore(r, o + k, right)
    k = middle * WIDTH
    left = halves_times(d, middle * size, vload(r, o + k))
    vstore(r, o + k, left)
    right = left
    for step in range(1, middle + 1):
        j, other = middle - step, middle + step
        k = j * WIDTH
        left = halves_times(d, j * size, vload(r, o + k) - vload(upper, k) * left)
        vstore(r, o + k, left)
        if other < chain:
            k = other * WIDTH
            right = halves_times(d, other * size, vload(r, o + k) - vload(lower, k) * right)
            vstore(r, o + k, right)
    k = chain * WIDTH
    last = vload(r, o + k) - vload(lower, k) * right - vload(upper, k) * turned(left, film.row)
    last = block_times(work.separator, 0, last)
    vstore(r, o + k, last)
    start = turned(last, film.row)
    for j in range(chain):
        k = o + j * WIDTH
        total = vload(r, k)
        if j <= last_first:
            total = total - halves_times(fill, (2 * j + 1) * size, start)
        if j >= first_second:
            total = total - halves_times(fill, 2 * j * size, last)
        vstore(r, k, total)


def _solve_ring(film, work, r, o, row):
    """Solve the film part in place for the right-hand side at r[o:]."""
    raise NotImplementedError  # compiled only: see _choose_solver


@overload(_solve_ring, jit_options={"error_model": "numpy", "nogil": True})
def _choose_solver(film, work, r, o, row):
    if len(row) == 0:
        return lambda film, work, r, o, row: _solve_halves(film, work, r, o)
    return lambda film, work, r, o, row: _solve_film(film, work, r, o)


@inner
def _force_of(film, work, r, o):
    """Force of the film per change of gas content: F_S . r[o:]."""
    half = span(film.row)
    width = 2 * half
    fx, fy = splat(0.0), splat(0.0)
    for j in range(film.rows):
        for v in range(0, width, WIDTH):
            excess = (
                vload(film.weight, v) * vload(work.y, j * width + v) * vload(r, o + j * width + v)
            )
            fx, fy = fx - excess * film.cos[j], fy - excess * film.sin[j]
    return vsum(fx), vsum(fy)


@inlined
def linearise(system, step, u, work):
    """Form and factorise I - step J at ``u``. False where the journal is outside the clearance."""
    film, rotor = system
    half = span(film.row)
    rows, width = film.rows, 2 * half
    n = rows * width
    x, y = u[n], u[n + 1]
    if not x * x + y * y < 1.0:
        return False
    fxx, fxy, fyy = splat(0.0), splat(0.0), splat(0.0)
    for r in range(rows):
        c, s = film.cos[r], film.sin[r]
        g = x * c + y * s
        for i in range(0, width, WIDTH):
            k, node = r * width + i, vload(film.node, i)
            inverse = 1.0 / (1.0 - node * g)
            p = vload(u, k) * inverse
            by_gas = 2.0 * p * inverse
            vstore(work.y, k, inverse)
            vstore(work.p, k, p)
            vstore(work.q, k, p * p - 1.0)
            vstore(work.by_gas, k, by_gas)
            vstore(work.by_gap, k, by_gas * p * node)
            push = vload(film.weight, i) * (p * inverse) * node
            fxx, fxy, fyy = fxx - push * (c * c), fxy - push * (c * s), fyy - push * (s * s)
        for i in range(0, width, WIDTH):
            vstore(work.gq, r * width + i, apply(film.gradient, 0, work.q, r * width, i, film.row))
    _assemble(film, work, x, y, step)
    _factorise(film, work)
    _film_per_displacement(film, work, x, y)
    for k in range(2):
        _solve_ring(film, work, work.border, k * n, film.row)
        work.small[10 + 2 * k], work.small[11 + 2 * k] = _force_of(film, work, work.border, k * n)
    pxx, pxy, pyy = vsum(fxx), vsum(fxy), vsum(fyy)
    gxx, gyx, gxy, gyy = work.small[10], work.small[11], work.small[12], work.small[13]
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
    n = film.rows * 2 * span(film.row)
    small = work.small
    step, disc = small[9], small[8]
    k1, k2, m = rotor.coupling_disc, rotor.coupling_journal, rotor.inverse_mass
    _solve_ring(film, work, r, 0, film.row)
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
    for k in range(0, n, WIDTH):
        vstore(
            r,
            k,
            vload(r, k)
            + (step * x) * vload(work.border, k)
            + (step * y) * vload(work.border, n + k),
        )
    r[n + 2] += step * v1x
    r[n + 3] += step * v1y
    r[n], r[n + 1], r[n + 4], r[n + 5], r[n + 6], r[n + 7] = x, y, vx, vy, v1x, v1y
