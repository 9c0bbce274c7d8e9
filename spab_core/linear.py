"""The linear system of a step, (I - g J) x = r, solved exactly.

J is the Jacobian of :func:`spab_core.kernels.slope`. Its film part couples a column of latitudes to itself (tridiagonal)
and to the columns east and west (diagonal), periodically: block elimination around the sphere with one separating
column, then the journal as a border of two columns, then 2 x 2 for its velocity. No pivoting: the film part of I - g J is
an M-matrix plus a skew part.
"""

from __future__ import annotations

from numba import njit

from spab_core.kernels import contact
from spab_core.simd import WIDTH, splat, vload, vstore, vsum


@njit(cache=True, nogil=True, forceinline=True)
def _invert(b, o, m, eye):
    """Invert in place the m x m block at b[o:], Gauss-Jordan without pivoting."""
    for k in range(m):
        ok = o + k * m
        pivot = 1.0 / b[ok + k]
        for v in range(0, m, WIDTH):
            vstore(b, ok + v, vload(b, ok + v) * pivot + pivot * vload(eye, k * m + v))
        for i in range(m):
            if i != k:
                factor = b[o + i * m + k]
                for v in range(0, m, WIDTH):
                    vstore(b, o + i * m + v, vload(b, o + i * m + v) - factor * vload(b, ok + v))
        for v in range(0, m, WIDTH):
            vstore(b, ok + v, vload(b, ok + v) - vload(eye, k * m + v))


@njit(cache=True, nogil=True, forceinline=True)
def _multiply(a, oa, b, ob, c, oc, m):
    """c = a b for m x m blocks stored by columns."""
    for v in range(0, m, WIDTH):
        for col in range(m):
            total = vload(a, oa + v) * b[ob + col * m]
            for k in range(1, m):
                total = total + vload(a, oa + k * m + v) * b[ob + col * m + k]
            vstore(c, oc + col * m + v, total)


@njit(cache=True, nogil=True, forceinline=True)
def _apply(a, oa, x, ox, v, m):
    """Eight rows, from v on, of the product of the block at a[oa:] and the vector at x[ox:]; two sums for latency."""
    even, odd = vload(a, oa + v) * x[ox], vload(a, oa + m + v) * x[ox + 1]
    for k in range(2, m, 2):
        even = even + vload(a, oa + k * m + v) * x[ox + k]
        odd = odd + vload(a, oa + (k + 1) * m + v) * x[ox + k + 1]
    return even + odd


@njit(cache=True, nogil=True)
def film_jacobian_times(film, work, x, y, dx, dy, out, o):
    """out[o:] = J_SX (dx, dy): the film's slope per journal displacement at the point of linearisation."""
    mp, columns = film.padded, film.columns
    stride = mp + WIDTH
    q, dq = work.q, work.tdq
    for j in range(columns):
        dg = dx * film.cos[j] + dy * film.sin[j]
        for i in range(0, mp, WIDTH):
            p = vload(work.p, j * mp + i)
            dp = p * (vload(film.cos_centre, i) * dg) * vload(work.y, j * mp + i)
            vstore(dq, WIDTH + j * stride + i, (p + p) * dp)
    last = columns - 1
    for i in range(0, mp, WIDTH):
        centre, up, down = vload(film.cos_centre, i), vload(film.cos_up, i), vload(film.cos_down, i)
        k_up, k_down, k_around = vload(film.flux_up, i), vload(film.flux_down, i), vload(film.flux_around, i)
        feed = vload(film.feed, i)
        west = splat(0.0)
        for jj in range(columns + 1):
            j = jj - 1 if jj > 0 else last
            a, ae = WIDTH + j * stride + i, WIDTH + (j + 1 if j < last else 0) * stride + i
            h = 1.0 - centre * (x * film.cos_face[j] + y * film.sin_face[j])
            dh = -3.0 * centre * (dx * film.cos_face[j] + dy * film.sin_face[j])
            east = k_around * (h * h) * (dh * (vload(q, ae) - vload(q, a)) + h * (vload(dq, ae) - vload(dq, a)))
            if jj > 0:
                g = x * film.cos[j] + y * film.sin[j]
                dg = -3.0 * (dx * film.cos[j] + dy * film.sin[j])
                h = 1.0 - up * g
                total = k_up * (h * h) * (up * dg * (vload(q, a + 1) - vload(q, a))
                                          + h * (vload(dq, a + 1) - vload(dq, a)))
                h = 1.0 - down * g
                total = total - k_down * (h * h) * (down * dg * (vload(q, a) - vload(q, a - 1))
                                                    + h * (vload(dq, a) - vload(dq, a - 1)))
                vstore(out, o + j * mp + i, total + (east - west) - feed * vload(dq, a))
            west = east


@njit(cache=True, nogil=True)
def _assemble(film, work, x, y, step):
    """Blocks of I - step J_SS: diagonal blocks in ``inverse``, couplings west and east in ``lower`` and ``upper``."""
    mp, columns = film.padded, film.columns
    last = columns - 1
    t = work.scratch
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
            s, se, sw = j * mp + i, je * mp + i, jw * mp + i
            slope_here = 2.0 * vload(work.p, s) * vload(work.y, s)  # dQ/dS
            vstore(work.upper, s, couette - east * (2.0 * vload(work.p, se) * vload(work.y, se)))
            vstore(work.lower, s, -1.0 * couette - west * (2.0 * vload(work.p, sw) * vload(work.y, sw)))
            vstore(t, i, 1.0 + slope_here * (up + down + east + west + step * vload(film.feed, i)))
            vstore(t, mp + i, up)
            vstore(t, 2 * mp + i, down)
            vstore(t, 3 * mp + i, slope_here)
        o = j * mp * mp
        for k in range(0, mp * mp, WIDTH):
            vstore(work.inverse, o + k, splat(0.0))
        for i in range(mp):
            work.inverse[o + i * mp + i] = t[i]
            if i + 1 < mp:
                work.inverse[o + (i + 1) * mp + i] = -t[mp + i] * t[3 * mp + i + 1]
                work.inverse[o + i * mp + i + 1] = -t[2 * mp + i + 1] * t[3 * mp + i]


@njit(cache=True, nogil=True, forceinline=True)
def _factorise_blocks(film, work, mp):
    """Eliminate the columns one after the other; ``fill`` couples each to the last column, ``row`` the last to each."""
    columns = film.columns
    last, size = columns - 1, mp * mp
    d, fill, row, lower, upper = work.inverse, work.fill, work.row, work.lower, work.upper
    separator = last * size
    for k in range(0, size, WIDTH):
        vstore(fill, k, splat(0.0))
        vstore(row, k, splat(0.0))
    for i in range(mp):
        fill[i * mp + i] = lower[i]
        row[i * mp + i] = upper[last * mp + i]
    for j in range(last):
        o, nxt = j * size, (j + 1) * size
        _invert(d, o, mp, film.eye)
        product = fill  # D^-1 fill, built in the separator's slot of fill and copied back
        _multiply(d, o, fill, o, product, separator, mp)
        for k in range(0, size, WIDTH):
            vstore(fill, o + k, vload(product, separator + k))
        for v in range(0, mp, WIDTH):
            for c in range(mp):
                total = vload(d, separator + c * mp + v)
                for k in range(mp):
                    total = total - vload(row, o + k * mp + v) * fill[o + c * mp + k]
                vstore(d, separator + c * mp + v, total)
        if j + 1 < last:
            _multiply(row, o, d, o, row, nxt, mp)
            for v in range(0, mp, WIDTH):
                l = vload(lower, (j + 1) * mp + v)
                for c in range(mp):
                    u = upper[j * mp + c]
                    k = c * mp + v
                    vstore(d, nxt + k, vload(d, nxt + k) - l * vload(d, o + k) * u)
                    vstore(fill, nxt + k, -1.0 * (l * vload(fill, o + k)))
                    vstore(row, nxt + k, vload(row, nxt + k) * (-u))
            if j + 1 == last - 1:
                for i in range(mp):
                    fill[nxt + i * mp + i] += upper[(j + 1) * mp + i]
                    row[nxt + i * mp + i] += lower[last * mp + i]
    _invert(d, separator, mp, film.eye)


@njit(cache=True, nogil=True)
def _factorise(film, work):
    # the constant lets the compiler unroll the blocks of eight latitudes or fewer
    if film.padded == WIDTH:
        _factorise_blocks(film, work, WIDTH)
    else:
        _factorise_blocks(film, work, film.padded)


@njit(cache=True, nogil=True, forceinline=True)
def _solve_blocks(film, work, r, o, mp):
    """Solve the film part in place for the right-hand side at r[o:]."""
    columns = film.columns
    last, size = columns - 1, mp * mp
    d, fill, row, lower, upper = work.inverse, work.fill, work.row, work.lower, work.upper
    t = work.scratch
    for j in range(last):
        here = o + j * mp
        for v in range(0, mp, WIDTH):
            product = _apply(d, j * size, r, here, v, mp)
            vstore(t, v, product)
            if j + 1 < last:
                vstore(r, here + mp + v, vload(r, here + mp + v) - vload(lower, (j + 1) * mp + v) * product)
        for v in range(0, mp, WIDTH):
            vstore(r, o + last * mp + v, vload(r, o + last * mp + v) - _apply(row, j * size, t, 0, v, mp))
    for v in range(0, mp, WIDTH):
        vstore(t, v, _apply(d, last * size, r, o + last * mp, v, mp))
    for v in range(0, mp, WIDTH):
        vstore(r, o + last * mp + v, vload(t, v))
    for j in range(last - 1, -1, -1):
        here = o + j * mp
        if j + 1 < last:
            for v in range(0, mp, WIDTH):
                vstore(r, here + v, vload(r, here + v) - vload(upper, j * mp + v) * vload(r, here + mp + v))
        for v in range(0, mp, WIDTH):
            vstore(t, v, _apply(d, j * size, r, here, v, mp) - _apply(fill, j * size, r, o + last * mp, v, mp))
        for v in range(0, mp, WIDTH):
            vstore(r, here + v, vload(t, v))


@njit(cache=True, nogil=True)
def _solve_film(film, work, r, o):
    if film.padded == WIDTH:
        _solve_blocks(film, work, r, o, WIDTH)
    else:
        _solve_blocks(film, work, r, o, film.padded)


@njit(cache=True, nogil=True)
def _force_of(film, work, r, o):
    """Force of the film per change of gas content: F_S . r[o:]."""
    mp = film.padded
    fx, fy = splat(0.0), splat(0.0)
    for j in range(film.columns):
        for i in range(0, mp, WIDTH):
            excess = vload(film.weight, i) * vload(work.y, j * mp + i) * vload(r, o + j * mp + i)
            fx, fy = fx - excess * film.cos[j], fy - excess * film.sin[j]
    return vsum(fx), vsum(fy)


@njit(cache=True, nogil=True)
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
            push = push + vload(film.weight, i) * (p * inverse) * centre
        total = vsum(push)
        fxx, fxy, fyx, fyy = fxx - total * c * c, fxy - total * c * s, fyx - total * s * c, fyy - total * s * s
    _assemble(film, work, x, y, step)
    _factorise(film, work)
    film_jacobian_times(film, work, x, y, 1.0, 0.0, work.border, 0)
    film_jacobian_times(film, work, x, y, 0.0, 1.0, work.border, n)
    _solve_film(film, work, work.border, 0)
    _solve_film(film, work, work.border, n)
    gxx, gyx = _force_of(film, work, work.border, 0)
    gxy, gyy = _force_of(film, work, work.border, n)
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


@njit(cache=True, nogil=True)
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
