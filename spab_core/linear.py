"""The linear system of a step, (I - g J) x = r, solved exactly.

J is the Jacobian of :func:`spab_core.kernels.slope`. Its film part couples a column of latitudes to itself (tridiagonal)
and to the columns east and west (diagonal), periodically: block elimination of the columns with one separating
column, then the journal as a border of two columns, then 2 x 2 for its velocity. No pivoting: the film part of I - g J is
an M-matrix plus a skew part.
"""

from __future__ import annotations

from spab_core.kernels import contact
from spab_core.simd import WIDTH, block_times, inner, invert_two, splat, spread, vload, vstore, vsum

NEGLIGIBLE = 1e-9  # couplings dropped in the elimination, relative to the unit matrix


@inner
def _pivot(b, o, k, m, eye):
    """Step k of Gauss-Jordan inversion in place of the m x m block at b[o:], no pivoting."""
    ok = o + k * m
    pivot = 1.0 / spread(b, ok + k)
    for v in range(0, m, WIDTH):
        vstore(b, ok + v, vload(b, ok + v) * pivot + pivot * vload(eye, (k + 1) * m + v))
    for i in range(m):
        if i != k:
            factor = spread(b, o + i * m + k)
            for v in range(0, m, WIDTH):
                vstore(b, o + i * m + v, vload(b, o + i * m + v) - factor * vload(b, ok + v))
    for v in range(0, m, WIDTH):
        vstore(b, ok + v, vload(b, ok + v) - vload(eye, (k + 1) * m + v))


@inner
def _columns(a, oa):
    """The eight columns of an 8 x 8 block: held in registers, which stores to other blocks would otherwise forbid."""
    return (vload(a, oa), vload(a, oa + 8), vload(a, oa + 16), vload(a, oa + 24), vload(a, oa + 32), vload(a, oa + 40),
            vload(a, oa + 48), vload(a, oa + 56))


@inner
def _times(a, x, ox):
    """An 8 x 8 block, as :func:`_columns`, times the vector at x[ox:]."""
    even = a[0] * spread(x, ox) + a[2] * spread(x, ox + 2) + a[4] * spread(x, ox + 4) + a[6] * spread(x, ox + 6)
    odd = a[1] * spread(x, ox + 1) + a[3] * spread(x, ox + 3) + a[5] * spread(x, ox + 5) + a[7] * spread(x, ox + 7)
    return even + odd


@inner
def _multiply(a, oa, b, ob, c, oc, m):
    """c = a b for m x m blocks stored by columns."""
    if m == WIDTH:
        block = _columns(a, oa)
        for col in range(m):
            vstore(c, oc + col * m, _times(block, b, ob + col * m))
        return
    for v in range(0, m, WIDTH):
        for col in range(m):
            total = vload(a, oa + v) * spread(b, ob + col * m)
            for k in range(1, m):
                total = total + vload(a, oa + k * m + v) * spread(b, ob + col * m + k)
            vstore(c, oc + col * m + v, total)


@inner
def _apply(a, oa, x, ox, v, m):
    """Eight rows, from v on, of the product of the block at a[oa:] and the vector at x[ox:]; two sums for latency."""
    even, odd = vload(a, oa + v) * spread(x, ox), vload(a, oa + m + v) * spread(x, ox + 1)
    for k in range(2, m, 2):
        even = even + vload(a, oa + k * m + v) * spread(x, ox + k)
        odd = odd + vload(a, oa + (k + 1) * m + v) * spread(x, ox + k + 1)
    return even + odd


@inner
def _film_per_displacement(film, work, x, y):
    """The two columns of J_SX, the film's slope per journal displacement at the point of linearisation, into ``border``."""
    mp, columns = film.padded, film.columns
    n, stride, last = columns * mp, mp + WIDTH, columns - 1
    q, b = work.q, work.by_gap  # Q, and its change per displacement towards the column
    for j in range(columns):
        for i in range(0, mp, WIDTH):
            o = WIDTH + j * stride + i
            vstore(b, o, vload(work.by_gas, o) * vload(work.p, j * mp + i) * vload(film.cos_centre, i))
    for i in range(0, mp, WIDTH):
        centre, up, down = vload(film.cos_centre, i), vload(film.cos_up, i), vload(film.cos_down, i)
        k_up, k_down, k_around = vload(film.flux_up, i), vload(film.flux_down, i), vload(film.flux_around, i)
        feed = vload(film.feed, i)
        west_x, west_y = splat(0.0), splat(0.0)
        for jj in range(columns + 1):
            j = jj - 1 if jj > 0 else last  # the face west of column 0 first
            je = j + 1 if j < last else 0
            o, oe = WIDTH + j * stride + i, WIDTH + je * stride + i
            c, s, cf, sf = film.cos[j], film.sin[j], film.cos_face[j], film.sin_face[j]
            h = 1.0 - centre * (x * cf + y * sf)
            k = k_around * (h * h)
            gap, there, here = -3.0 * centre * (k * (vload(q, oe) - vload(q, o))), k * h * vload(b, oe), k * h * vload(b, o)
            east_x = gap * cf + there * film.cos[je] - here * c
            east_y = gap * sf + there * film.sin[je] - here * s
            if jj > 0:
                g = x * c + y * s
                h = 1.0 - up * g
                total = k_up * (h * h) * (h * (vload(b, o + 1) - vload(b, o)) - 3.0 * up * (vload(q, o + 1) - vload(q, o)))
                h = 1.0 - down * g
                total = total - k_down * (h * h) * (h * (vload(b, o) - vload(b, o - 1))
                                                    - 3.0 * down * (vload(q, o) - vload(q, o - 1)))
                total = total - feed * vload(b, o)
                vstore(work.border, j * mp + i, total * c + (east_x - west_x))
                vstore(work.border, n + j * mp + i, total * s + (east_y - west_y))
            west_x, west_y = east_x, east_y


@inner
def _assemble(film, work, x, y, step):
    """The entries of I - step J_SS: ``diagonal``, ``over``, ``under`` within a column, ``lower``, ``upper`` around."""
    mp, columns = film.padded, film.columns
    stride, last = mp + WIDTH, film.columns - 1
    s = work.by_gas  # dQ/dS
    for j in range(columns):
        je, jw = (j + 1 if j < last else 0), (j - 1 if j > 0 else last)
        g = x * film.cos[j] + y * film.sin[j]
        ge = x * film.cos_face[j] + y * film.sin_face[j]
        gw = x * film.cos_face[jw] + y * film.sin_face[jw]
        for i in range(0, mp, WIDTH):
            centre, couette = vload(film.cos_centre, i), vload(film.couette, i) * step
            k_around = vload(film.flux_around, i) * step
            h = 1.0 - centre * ge
            east = k_around * (h * h * h)
            h = 1.0 - centre * gw
            west = k_around * (h * h * h)
            h = 1.0 - vload(film.cos_up, i) * g
            up = step * vload(film.flux_up, i) * (h * h * h)
            h = 1.0 - vload(film.cos_down, i) * g
            down = step * vload(film.flux_down, i) * (h * h * h)
            o, k = WIDTH + j * stride + i, j * mp + i
            vstore(work.upper, k, couette - east * vload(s, WIDTH + je * stride + i))
            vstore(work.lower, k, -1.0 * couette - west * vload(s, WIDTH + jw * stride + i))
            here = up + down + east + west + step * vload(film.feed, i)
            vstore(work.diagonal, k, 1.0 + here * vload(s, o))
            vstore(work.over, k, -1.0 * up * vload(s, o + 1))
            vstore(work.under, k, -1.0 * down * vload(s, o - 1))


@inner
def _block_column(film, work, j, c, v, m):
    """Eight rows, from v on, of column c of the tridiagonal block j."""
    unit, k = c * m + v, j * m + v
    return (vload(film.eye, unit + m) * vload(work.diagonal, k) + vload(film.eye, unit) * vload(work.over, k)
            + vload(film.eye, unit + 2 * m) * vload(work.under, k))


@inner
def _form(film, work, j, m):
    """Write the tridiagonal block j."""
    for v in range(0, m, WIDTH):
        for c in range(m):
            vstore(work.inverse, (j * m + c) * m + v, _block_column(film, work, j, c, v, m))


@inner
def _eliminate(film, work, j, target, towards, back, coupled, fresh, m):
    """Eliminate column j (its block is inverted already) from the column ``target``, with its coupling to the last column.

    ``towards`` couples column j to ``target``, ``back`` the other way. ``fresh``: the target's block is not formed yet, and it
    has no coupling to the last column. Returns whether the target's coupling to the last column matters.
    """
    size = m * m
    d, fill = work.inverse, work.fill
    o, t, free = j * size, target * size, (film.columns - 1) * size
    for v in range(0, m, WIDTH):
        b = vload(back, target * m + v)
        for c in range(m):
            k = c * m + v
            block = _block_column(film, work, target, c, v, m) if fresh else vload(d, t + k)
            vstore(d, t + k, block - b * vload(d, o + k) * spread(towards, j * m + c))
    if not coupled:
        return False
    _multiply(d, o, fill, o, fill, free, m)
    total = splat(0.0)
    for v in range(0, m, WIDTH):
        b = vload(back, target * m + v)
        for c in range(m):
            k = c * m + v
            own = vload(fill, free + k)
            vstore(fill, o + k, own)
            passed = b * own
            total = total + passed * passed
            vstore(fill, t + k, splat(0.0) - passed if fresh else vload(fill, t + k) - passed)
    return vsum(total) > NEGLIGIBLE**2


@inner
def _back_fill(work, j, source, towards, m):
    """fill[j] -= D[j]^-1 diag(towards[j]) fill[source]."""
    size = m * m
    d, fill, t = work.inverse, work.fill, work.scratch
    o, s = j * size, source * size
    if m == WIDTH:
        a, w = _columns(d, o), j * m
        scaled = (a[0] * spread(towards, w), a[1] * spread(towards, w + 1), a[2] * spread(towards, w + 2),
                  a[3] * spread(towards, w + 3), a[4] * spread(towards, w + 4), a[5] * spread(towards, w + 5),
                  a[6] * spread(towards, w + 6), a[7] * spread(towards, w + 7))
        for c in range(m):
            vstore(fill, o + c * m, vload(fill, o + c * m) - _times(scaled, fill, s + c * m))
    for c in range(m if m > WIDTH else 0):
        for v in range(0, m, WIDTH):
            vstore(t, v, vload(towards, j * m + v) * vload(fill, s + c * m + v))
        for v in range(0, m, WIDTH):
            vstore(fill, o + c * m + v, vload(fill, o + c * m + v) - _apply(d, o, t, 0, v, m))


@inner
def _invert(film, work, j, other, m):
    """Invert the blocks j and other, which may be the same."""
    d, size = work.inverse, m * m
    if m == WIDTH:
        invert_two(d, j * size, other * size)
    for k in range(m if m > WIDTH else 0):
        _pivot(d, j * size, k, m, film.eye)
        if other != j:
            _pivot(d, other * size, k, m, film.eye)


@inner
def _factorise_blocks(film, work, m):
    """Factorise the ring: a chain of columns, and the last column as its separator.

    The chain is eliminated from both ends towards its middle, two columns at a time, so that one hides the other's latency.
    ``fill`` becomes what each column answers to the separator. It decays from column to column (gas diffuses a few columns
    far in one step); where it falls below :data:`NEGLIGIBLE` it is dropped. ``small`` keeps how many columns at each end,
    and whether the middle one, answer.
    """
    chain, size = film.columns - 1, m * m
    middle = chain // 2
    d, fill, lower, upper = work.inverse, work.fill, work.lower, work.upper
    for j in (0, middle, chain - 1, chain):
        _form(film, work, j, m)
        for k in range(0, size, WIDTH):
            vstore(fill, j * size + k, splat(0.0))
    end = (chain - 1) * size
    for i in range(m):
        fill[i * m + i] = lower[i]
        fill[end + i * m + i] = upper[(chain - 1) * m + i]
    first, second, centre = True, True, False
    count_first, count_second = 0, 0
    for j in range(middle + 1):
        other = chain - 1 - j
        pair = other > middle
        _invert(film, work, j, other if pair else j, m)
        if j < middle:
            count_first += first
            first = _eliminate(film, work, j, j + 1, upper, lower, first, j + 1 < middle, m)
            centre = centre or (first and j + 1 == middle)
        if pair:
            count_second += second
            second = _eliminate(film, work, other, other - 1, lower, upper, second, other - 1 > middle, m)
            centre = centre or (second and other - 1 == middle)
    if centre:
        free = chain * size
        _multiply(d, middle * size, fill, middle * size, fill, free, m)
        for k in range(0, size, WIDTH):
            vstore(fill, middle * size + k, vload(fill, free + k))
    for j in range(count_first - 1, -1, -1):
        if j + 1 < count_first or (j + 1 == middle and centre):
            _back_fill(work, j, j + 1, upper, m)
    for k in range(count_second - 1, -1, -1):
        other = chain - 1 - k
        if k + 1 < count_second or (other - 1 == middle and centre):
            _back_fill(work, other, other - 1, lower, m)
    for v in range(0, m, WIDTH):
        west, east = vload(lower, chain * m + v), vload(upper, chain * m + v)
        for c in range(m):
            k = c * m + v
            vstore(d, chain * size + k, vload(d, chain * size + k) - west * vload(fill, end + k) - east * vload(fill, k))
    _invert(film, work, chain, chain, m)
    work.small[14], work.small[15], work.small[16] = count_first, count_second, 1.0 if centre else 0.0


@inner
def _factorise(film, work):
    # the constant lets the compiler unroll the blocks of eight latitudes or fewer
    if film.padded == WIDTH:
        _factorise_blocks(film, work, WIDTH)
    else:
        _factorise_blocks(film, work, film.padded)


@inner
def _solve_blocks(film, work, r, o, m):
    """Solve the film part in place for the right-hand side at r[o:]: the chain alone, the separator, what it changes."""
    chain, size = film.columns - 1, m * m
    middle = chain // 2
    first, second, centre = int(work.small[14]), int(work.small[15]), work.small[16] > 0.0
    d, fill, lower, upper = work.inverse, work.fill, work.lower, work.upper
    t, last = work.scratch, o + chain * m
    for j in range(middle):
        other = chain - 1 - j
        for v in range(0, m, WIDTH):
            k = (j + 1) * m + v
            vstore(r, o + k, vload(r, o + k) - vload(lower, k) * _apply(d, j * size, r, o + j * m, v, m))
        if other > middle:
            for v in range(0, m, WIDTH):
                k = (other - 1) * m + v
                vstore(r, o + k, vload(r, o + k) - vload(upper, k) * _apply(d, other * size, r, o + other * m, v, m))
    for step in range(middle + 1):
        j, other = middle - step, middle + step
        here, there = o + j * m, o + other * m
        pair = 0 < step and other < chain
        for v in range(0, m, WIDTH):
            if step > 0:
                vstore(r, here + v, vload(r, here + v) - vload(upper, j * m + v) * vload(r, here + m + v))
            if pair:
                vstore(r, there + v, vload(r, there + v) - vload(lower, other * m + v) * vload(r, there - m + v))
        for v in range(0, m, WIDTH):
            vstore(t, v, _apply(d, j * size, r, here, v, m))
            if pair:
                vstore(t, m + v, _apply(d, other * size, r, there, v, m))
        for v in range(0, m, WIDTH):
            vstore(r, here + v, vload(t, v))
            if pair:
                vstore(r, there + v, vload(t, m + v))
    for v in range(0, m, WIDTH):
        k = chain * m + v
        vstore(r, o + k, vload(r, o + k) - vload(lower, k) * vload(r, last - m + v) - vload(upper, k) * vload(r, o + v))
    for v in range(0, m, WIDTH):
        vstore(t, v, _apply(d, chain * size, r, last, v, m))
    for v in range(0, m, WIDTH):
        vstore(r, last + v, vload(t, v))
    for j in range(chain):
        if j < first or chain - 1 - j < second or (j == middle and centre):
            for v in range(0, m, WIDTH):
                k = o + j * m + v
                vstore(r, k, vload(r, k) - _apply(fill, j * size, t, 0, v, m))


@inner
def _solve_eight(film, work, r, o):
    """:func:`_solve_blocks` for columns of eight, which stay in their registers."""
    m, size = WIDTH, WIDTH * WIDTH
    chain = film.columns - 1
    middle = chain // 2
    first, second, centre = int(work.small[14]), int(work.small[15]), work.small[16] > 0.0
    d, fill, lower, upper = work.inverse, work.fill, work.lower, work.upper
    left, right = vload(r, o), vload(r, o + (chain - 1) * m)
    for j in range(middle):
        other = chain - 1 - j
        k = (j + 1) * m
        left = vload(r, o + k) - vload(lower, k) * block_times(d, j * size, left)
        vstore(r, o + k, left)
        if other > middle:
            k = (other - 1) * m
            right = vload(r, o + k) - vload(upper, k) * block_times(d, other * size, right)
            vstore(r, o + k, right)
    k = middle * m
    left = block_times(d, middle * size, vload(r, o + k))
    vstore(r, o + k, left)
    right = left
    for step in range(1, middle + 1):
        j, other = middle - step, middle + step
        k = j * m
        left = block_times(d, j * size, vload(r, o + k) - vload(upper, k) * left)
        vstore(r, o + k, left)
        if other < chain:
            k = other * m
            right = block_times(d, other * size, vload(r, o + k) - vload(lower, k) * right)
            vstore(r, o + k, right)
    k = chain * m
    last = vload(r, o + k) - vload(lower, k) * right - vload(upper, k) * left
    last = block_times(d, chain * size, last)
    vstore(r, o + k, last)
    for j in range(chain):
        if j < first or chain - 1 - j < second or (j == middle and centre):
            k = o + j * m
            vstore(r, k, vload(r, k) - block_times(fill, j * size, last))


@inner
def _solve_film(film, work, r, o):
    if film.padded == WIDTH:
        _solve_eight(film, work, r, o)
    else:
        _solve_blocks(film, work, r, o, film.padded)


@inner
def _force_of(film, work, r, o):
    """Force of the film per change of gas content: F_S . r[o:]."""
    mp = film.padded
    fx, fy = splat(0.0), splat(0.0)
    for j in range(film.columns):
        for i in range(0, mp, WIDTH):
            excess = vload(film.weight, i) * vload(work.y, j * mp + i) * vload(r, o + j * mp + i)
            fx, fy = fx - excess * film.cos[j], fy - excess * film.sin[j]
    return vsum(fx), vsum(fy)


@inner
def linearise(system, step, u, work):
    """Form and factorise I - step J at ``u``. False where the journal is outside the clearance."""
    film, rotor = system
    mp, columns = film.padded, film.columns
    n, stride = columns * mp, mp + WIDTH
    x, y = u[n], u[n + 1]
    if not x * x + y * y < 1.0:
        return False
    fxx, fxy, fyx, fyy = 0.0, 0.0, 0.0, 0.0
    for j in range(columns):
        c, s = film.cos[j], film.sin[j]
        g = x * c + y * s
        push = splat(0.0)
        for i in range(0, mp, WIDTH):
            centre = vload(film.cos_centre, i)
            inverse = 1.0 / (1.0 - centre * g)
            p = vload(u, j * mp + i) * inverse
            vstore(work.y, j * mp + i, inverse)
            vstore(work.p, j * mp + i, p)
            vstore(work.q, WIDTH + j * stride + i, p * p)
            vstore(work.by_gas, WIDTH + j * stride + i, 2.0 * p * inverse)
            push = push + vload(film.weight, i) * (p * inverse) * centre
        total = vsum(push)
        fxx, fxy, fyx, fyy = fxx - total * c * c, fxy - total * c * s, fyx - total * s * c, fyy - total * s * s
    _assemble(film, work, x, y, step)
    _factorise(film, work)
    _film_per_displacement(film, work, x, y)
    for k in range(2):
        _solve_film(film, work, work.border, k * n)
        work.small[10 + 2 * k], work.small[11 + 2 * k] = _force_of(film, work, work.border, k * n)
    gxx, gyx, gxy, gyy = work.small[10], work.small[11], work.small[12], work.small[13]
    vx, vy = u[n + 4], u[n + 5]
    c0 = contact(rotor, x, y, vx, vy, (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0))
    c1 = contact(rotor, x, y, vx, vy, (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    k1, k2, m = rotor.coupling_disc, rotor.coupling_journal, rotor.inverse_mass
    disc = 1.0 + step * step * k1
    spring = k2 * (step * step * k1 / disc - 1.0)
    small = work.small
    axx, axy = m * (fxx + step * gxx + c0[2]) + spring, m * (fxy + step * gxy + c0[4])
    ayx, ayy = m * (fyx + step * gyx + c0[3]), m * (fyy + step * gyy + c0[5]) + spring
    bxx, bxy = 1.0 - step * step * axx - step * m * c1[2], -step * step * axy - step * m * c1[4]
    byx, byy = -step * step * ayx - step * m * c1[3], 1.0 - step * step * ayy - step * m * c1[5]
    determinant = bxx * byy - bxy * byx
    small[0], small[1], small[2], small[3] = axx, axy, ayx, ayy
    small[4], small[5] = byy / determinant, -bxy / determinant
    small[6], small[7] = -byx / determinant, bxx / determinant
    small[8], small[9] = disc, step
    return True


@inner
def solve(system, work, r):
    """Solve (I - step J) x = r in place, after :func:`linearise`."""
    film, rotor = system
    n = film.columns * film.padded
    small = work.small
    step, disc = small[9], small[8]
    k1, k2, m = rotor.coupling_disc, rotor.coupling_journal, rotor.inverse_mass
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
    for k in range(0, n, WIDTH):
        vstore(r, k, vload(r, k) + (step * x) * vload(work.border, k) + (step * y) * vload(work.border, n + k))
    r[n + 2] += step * v1x
    r[n + 3] += step * v1y
    r[n], r[n + 1], r[n + 4], r[n + 5], r[n + 6], r[n + 7] = x, y, vx, vy, v1x, v1y
