"""The paper's hybrid scheme: differential transformation in time over the film mesh (its eqs.

(4) to (7)).

The differential transform of order k of a function is its k-th Taylor coefficient in tau; products
become Cauchy sums. All transforms up to :data:`DTM_ORDER` follow one from the other, then the step
sums the series. The tangent carries a second set of transforms, obtained by differentiating each
recurrence. Explicit: the step is limited by diffusion in the film, and controlled by the last term
of the series."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from spab_core.solver.film import Film, film_size
from spab_core.solver.rotor import CENTRE
from spab_core.solver.row_ops import apply, following, opposite, preceding, span, turned
from spab_core.solver.simd import WIDTH, aligned_zeros, inner, kernel, splat, vload, vstore, vsum
from spab_core.solver.slope import error_norm

DTM_ORDER = 6
_K = DTM_ORDER + 1
# rows of the series, one for each order: gas S, pressure P, Q = P² - 1, its gradient across the
# band, H³ at the flux nodes and at the faces around, flux across; then the same for the tangent
_S, _P, _Q, _GRADIENT, _CUBE, _AROUND, _FLUX, _ROWS = 0, 1, 2, 3, 4, 5, 6, 7


def build_series(film: Film) -> np.ndarray:
    """Memory for the transforms, shape (2 * 7 * (order + 1), size of the film)."""
    size, rows = film_size(film), 2 * _ROWS * _K
    return aligned_zeros(rows * size).reshape(rows, size)


@kernel
def _contact_series(rotor, r, d, k, c, dual):
    """Order k of the contact force from orders 0..k of the rotor state ``r`` and its tangent ``d``.

    Columns of ``c``: e², e, f, A = f/e, m = x·v, B = damping f m / e², x, y of the force, 1/e;
    ``c[_K:]`` the tangent's."""
    for part in range(2 if dual else 1):
        o = part * _K + k
        s = m = 0.0
        for l in range(k + 1):
            for i in range(2):
                if part == 0:
                    s += r[l, i] * r[k - l, i]
                    m += r[l, i] * r[k - l, 4 + i]
                else:
                    s += 2.0 * r[l, i] * d[k - l, i]
                    m += r[l, i] * d[k - l, 4 + i] + d[l, i] * r[k - l, 4 + i]
        c[o, 0], c[o, 4] = s, m
    if c[0, 0] < CENTRE**2 or (c[0, 0] < 1.0 and 1.0 - math.sqrt(c[0, 0]) > 40.0 * rotor.roughness):
        for part in range(2 if dual else 1):
            c[part * _K + k, 6] = c[part * _K + k, 7] = 0.0
        return
    # e from e e = e², i = 1/e from i e = 1, f from f' = f e'/s
    if k == 0:
        e = math.sqrt(c[0, 0])
        c[0, 1], c[0, 8] = e, 1.0 / e
        c[0, 2] = rotor.contact_force * math.exp((e - 1.0) / rotor.roughness)
        if dual:
            c[_K, 1] = 0.5 * c[_K, 0] / e
            c[_K, 8] = -c[_K, 1] / (e * e)
            c[_K, 2] = c[0, 2] * c[_K, 1] / rotor.roughness
    else:
        e0 = c[0, 1]
        s = c[k, 0]
        inverse = f = 0.0
        for l in range(1, k):
            s -= c[l, 1] * c[k - l, 1]
        c[k, 1] = 0.5 * s / e0
        for l in range(1, k + 1):
            inverse -= c[l, 1] * c[k - l, 8]
            f += l * c[l, 1] * c[k - l, 2]
        c[k, 8], c[k, 2] = inverse / e0, f / (k * rotor.roughness)
        if dual:
            s = c[_K + k, 0]
            for l in range(k):
                s -= 2.0 * c[_K + l, 1] * c[k - l, 1]
            c[_K + k, 1] = 0.5 * s / e0
            inverse = -c[_K, 1] * c[k, 8]
            for l in range(1, k + 1):
                inverse -= c[l, 1] * c[_K + k - l, 8] + c[_K + l, 1] * c[k - l, 8]
            c[_K + k, 8] = inverse / e0
            f = 0.0
            for l in range(1, k + 1):
                f += l * (c[_K + l, 1] * c[k - l, 2] + c[l, 1] * c[_K + k - l, 2])
            c[_K + k, 2] = f / (k * rotor.roughness)
    for part in range(2 if dual else 1):
        o = part * _K
        a = 0.0
        for l in range(k + 1):
            a += (
                c[l, 2] * c[k - l, 8]
                if part == 0
                else c[l, 2] * c[_K + k - l, 8] + c[_K + l, 2] * c[k - l, 8]
            )
        c[o + k, 3] = a
        p = 0.0
        for l in range(k + 1):
            p += (
                c[l, 3] * c[k - l, 8]
                if part == 0
                else c[l, 3] * c[_K + k - l, 8] + c[_K + l, 3] * c[k - l, 8]
            )
        c[o + k, 9] = p
        b = 0.0
        for l in range(k + 1):
            b += (
                c[l, 9] * c[k - l, 4]
                if part == 0
                else c[l, 9] * c[_K + k - l, 4] + c[_K + l, 9] * c[k - l, 4]
            )
        c[o + k, 5] = rotor.damping * b
        fx = fy = 0.0
        mu = rotor.friction
        for l in range(k + 1):
            if part == 0:
                n = c[l, 3] + c[l, 5]
                fx += -n * r[k - l, 0] + mu * c[l, 3] * r[k - l, 1]
                fy += -n * r[k - l, 1] - mu * c[l, 3] * r[k - l, 0]
            else:
                n, dn = c[l, 3] + c[l, 5], c[_K + l, 3] + c[_K + l, 5]
                fx += (
                    -dn * r[k - l, 0]
                    - n * d[k - l, 0]
                    + mu * (c[_K + l, 3] * r[k - l, 1] + c[l, 3] * d[k - l, 1])
                )
                fy += (
                    -dn * r[k - l, 1]
                    - n * d[k - l, 1]
                    - mu * (c[_K + l, 3] * r[k - l, 0] + c[l, 3] * d[k - l, 0])
                )
        c[o + k, 6], c[o + k, 7] = fx, fy


@inner
def _gap_order(cosine, g, k, j):
    """Order k of H = 1 - cosine g in row j."""
    h = -cosine * g[k, j]
    return 1.0 + h if k == 0 else h


@kernel
def _pressure_order(film, z, g, k, dual):
    """Order k of P = S/H, of Q = P² and of its gradient; returns its share of the force, (fx, fy,
    dfx, dfy).
    """
    width = 2 * span(film.row)
    tangent = _ROWS * _K
    fx, fy, dfx, dfy = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for j in range(film.rows):
        for i in range(0, width, WIDTH):
            o = j * width + i
            node = vload(film.node, i)
            inverse = 1.0 / (1.0 - node * g[0, j])
            p = vload(z[_S * _K + k], o)
            for l in range(1, k + 1):
                p = p + node * g[l, j] * vload(z[_P * _K + k - l], o)
            p = p * inverse
            vstore(z[_P * _K + k], o, p)
            q = splat(-1.0 if k == 0 else 0.0)
            for l in range(k + 1):
                q = q + vload(z[_P * _K + l], o) * vload(z[_P * _K + k - l], o)
            vstore(z[_Q * _K + k], o, q)
            weight = vload(film.weight, i)
            excess = weight * (p - 1.0) if k == 0 else weight * p
            fx, fy = fx - excess * film.cos[j], fy - excess * film.sin[j]
            if dual:
                dp = vload(z[tangent + _S * _K + k], o)
                for l in range(1, k + 1):
                    dp = dp + node * g[l, j] * vload(z[tangent + _P * _K + k - l], o)
                for l in range(k + 1):
                    dp = dp + node * g[_K + l, j] * vload(z[_P * _K + k - l], o)
                dp = dp * inverse
                vstore(z[tangent + _P * _K + k], o, dp)
                dq = splat(0.0)
                for l in range(k + 1):
                    dq = dq + vload(z[_P * _K + l], o) * vload(z[tangent + _P * _K + k - l], o)
                vstore(z[tangent + _Q * _K + k], o, dq + dq)
                dexcess = weight * dp
                dfx, dfy = dfx - dexcess * film.cos[j], dfy - dexcess * film.sin[j]
        for part in range(2 if dual else 1):
            t = part * tangent
            for i in range(0, width, WIDTH):
                vstore(
                    z[t + _GRADIENT * _K + k],
                    j * width + i,
                    apply(film.gradient, 0, z[t + _Q * _K + k], j * width, i, film.row),
                )
    return vsum(fx), vsum(fy), vsum(dfx), vsum(dfy)


@kernel
def _cube_order(film, z, cosine, g, row, k, dual):
    """Order k of H³ at one kind of place, H = 1 - cosine g linear in the journal's position."""
    width = 2 * span(film.row)
    tangent = _ROWS * _K
    for j in range(film.rows):
        for i in range(0, width, WIDTH):
            o = j * width + i
            c = vload(cosine, i)
            total, dtotal = splat(0.0), splat(0.0)
            for l in range(k + 1):
                square, dsquare = splat(0.0), splat(0.0)
                for m in range(l + 1):
                    a, b = _gap_order(c, g, m, j), _gap_order(c, g, l - m, j)
                    square = square + a * b
                    dsquare = dsquare - 2.0 * (a * (c * g[_K + l - m, j]))
                h = _gap_order(c, g, k - l, j)
                total = total + square * h
                dtotal = dtotal + dsquare * h - square * (c * g[_K + k - l, j])
            vstore(z[row * _K + k], o, total)
            if dual:
                vstore(z[tangent + row * _K + k], o, dtotal)


@inner
def _east_order(film, z, k, part, j, i):
    """Order k of H³ times the difference of Q at the faces east of row j; ``part`` 1: its
    derivative.
    """
    t, rows, half = _ROWS * _K, film.rows, span(film.row)
    o = j * 2 * half + i
    total = splat(0.0)
    for l in range(k + 1):
        q, h = z[part * t + _Q * _K + k - l], vload(z[_AROUND * _K + l], o)
        total = total + h * (following(q, j, i, rows, film.row) - vload(q, o))
        if part == 1:
            q, dh = z[_Q * _K + k - l], vload(z[t + _AROUND * _K + l], o)
            total = total + dh * (following(q, j, i, rows, film.row) - vload(q, o))
    return total


@kernel
def _gas_order(film, z, k, part):
    """Order k + 1 of S from the fluxes of order k; ``part`` 0 the state, 1 the tangent."""
    rows, half = film.rows, span(film.row)
    width, t = 2 * half, part * _ROWS * _K
    flux, s = z[t + _FLUX * _K + k], z[t + _S * _K + k]
    for j in range(rows):
        for i in range(0, width, WIDTH):
            o = j * width + i
            total = splat(0.0)
            for l in range(k + 1):
                total = total + vload(z[_CUBE * _K + l], o) * vload(
                    z[t + _GRADIENT * _K + k - l], o
                )
                if part == 1:
                    total = total + vload(z[t + _CUBE * _K + l], o) * vload(
                        z[_GRADIENT * _K + k - l], o
                    )
            vstore(flux, o, total)
    supply = film.supply - 1.0 if k == 0 and part == 0 else 0.0
    for i in range(0, width, WIDTH):
        west = turned(_east_order(film, z, k, part, rows - 1, opposite(i, film.row)), film.row)
        for j in range(rows):
            o = j * width + i
            east = _east_order(film, z, k, part, j, i)
            total = apply(film.divergence, 0, flux, j * width, i, film.row) + vload(
                film.flux_around, i
            ) * (east - west)
            total = total + vload(film.feed, i) * (supply - vload(z[t + _Q * _K + k], o))
            total = total - vload(film.couette, i) * (
                following(s, j, i, rows, film.row) - preceding(s, j, i, rows, film.row)
            )
            vstore(z[t + _S * _K + k + 1], o, total * (1.0 / (k + 1)))
            west = east


@njit(cache=True, nogil=True, error_model="numpy", _nrt=True)  # allocates its short series
def dtm_step(system, work, stages, series, t, h, u, v, with_tangent):
    """One step of differential transformation of order :data:`DTM_ORDER`; same interface as
    ``rodas_step``.
    """
    film, rotor = system
    n = film.rows * 2 * span(film.row)
    if not u[n] * u[n] + u[n + 1] * u[n + 1] < 1.0:
        return math.inf
    z = series
    new, new_v, last_term = stages.new, stages.new_tangent, stages.state[5]
    tangent = _ROWS * _K
    r, d = np.zeros((_K + 1, 8)), np.zeros((_K + 1, 8))
    c = np.zeros((2 * _K, 10))
    g, gf = np.zeros((2 * _K, film.rows)), np.zeros((2 * _K, film.rows))
    for k in range(0, n, WIDTH):
        vstore(z[_S * _K], k, vload(u, k))
        vstore(z[tangent + _S * _K], k, vload(v, k))
    for i in range(8):
        r[0, i], d[0, i] = u[n + i], v[n + i]
    ramp0 = min(t / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0
    ramp1 = 1.0 / rotor.ramp if rotor.ramp > 0.0 and t < rotor.ramp else 0.0
    ck, sk, ck_before, sk_before = (
        math.cos(t),
        math.sin(t),
        0.0,
        0.0,
    )  # orders of cos and sin of tau
    for k in range(DTM_ORDER):
        for j in range(film.rows):
            g[k, j] = r[k, 0] * film.cos[j] + r[k, 1] * film.sin[j]
            gf[k, j] = r[k, 0] * film.cos_face[j] + r[k, 1] * film.sin_face[j]
            g[_K + k, j] = d[k, 0] * film.cos[j] + d[k, 1] * film.sin[j]
            gf[_K + k, j] = d[k, 0] * film.cos_face[j] + d[k, 1] * film.sin_face[j]
        fx, fy, dfx, dfy = _pressure_order(film, z, g, k, with_tangent)
        _cube_order(film, z, film.flux_node, g, _CUBE, k, with_tangent)
        _cube_order(film, z, film.node, gf, _AROUND, k, with_tangent)
        _gas_order(film, z, k, 0)
        if with_tangent:
            _gas_order(film, z, k, 1)
        _contact_series(rotor, r, d, k, c, with_tangent)
        cos_load, sin_load = ramp0 * ck + ramp1 * ck_before, ramp0 * sk + ramp1 * sk_before
        down = ramp0 if k == 0 else (ramp1 if k == 1 else 0.0)
        for part in range(2 if with_tangent else 1):
            a = r if part == 0 else d
            on = 1.0 if part == 0 else 0.0
            px, py = (fx, fy) if part == 0 else (dfx, dfy)
            px, py = px + c[part * _K + k, 6], py + c[part * _K + k, 7]
            dx, dy = a[k, 2] - a[k, 0], a[k, 3] - a[k, 1]
            s = 1.0 / (k + 1)
            for i in range(4):
                a[k + 1, i] = s * a[k, 4 + i]
            a[k + 1, 4] = s * (
                rotor.coupling_journal * dx
                + rotor.inverse_mass * px
                + on * rotor.unbalance_journal * cos_load
            )
            a[k + 1, 5] = s * (
                rotor.coupling_journal * dy
                + rotor.inverse_mass * py
                + on * (rotor.unbalance_journal * sin_load - down * rotor.gravity_journal)
            )
            a[k + 1, 6] = s * (-rotor.coupling_disc * dx + on * rotor.unbalance_disc * cos_load)
            a[k + 1, 7] = s * (
                -rotor.coupling_disc * dy
                + on * (rotor.unbalance_disc * sin_load - down * rotor.gravity_disc)
            )
        ck_before, sk_before = ck, sk
        ck, sk = -sk_before / (k + 1), ck_before / (k + 1)
    power = h**DTM_ORDER
    size, last_size = splat(0.0), splat(0.0)
    for i in range(0, n, WIDTH):
        total, dtotal = splat(0.0), splat(0.0)
        for k in range(DTM_ORDER, -1, -1):
            total = total * h + vload(z[_S * _K + k], i)
            dtotal = dtotal * h + vload(z[tangent + _S * _K + k], i)
        vstore(new, i, total)
        vstore(new_v, i, dtotal)
        vstore(last_term, i, vload(z[_S * _K + DTM_ORDER], i) * power)
        dlast = vload(z[tangent + _S * _K + DTM_ORDER], i) * power
        size, last_size = size + dtotal * dtotal, last_size + dlast * dlast
    tangent_size, tangent_last = vsum(size), vsum(last_size)
    for i in range(8):
        total = dtotal = 0.0
        for k in range(DTM_ORDER, -1, -1):
            total, dtotal = total * h + r[k, i], dtotal * h + d[k, i]
        new[n + i], new_v[n + i], last_term[n + i] = total, dtotal, r[DTM_ORDER, i] * power
        tangent_size, tangent_last = (
            tangent_size + dtotal * dtotal,
            tangent_last + (d[DTM_ORDER, i] * power) ** 2,
        )
    error = error_norm(system, work, new, last_term)
    # an explicit step too long for stiffness shows in the tangent long before it shows in the state
    if with_tangent:
        error = max(error, math.sqrt(tangent_last / tangent_size))
    return error
