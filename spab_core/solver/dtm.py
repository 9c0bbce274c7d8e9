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

# columns of the contact's series: e², e, f, A = f/e, m = x·v, B = damping f m / e², x and y of the
# force, 1/e, A/e
_E2, _E, _NORMAL, _SPRING, _RADIAL, _DAMPING, _FX, _FY, _INVERSE, _PER_E2 = range(10)


def build_series(film: Film) -> np.ndarray:
    """Memory for the transforms, shape (2 * 7 * (order + 1), size of the film)."""
    size, rows = film_size(film), 2 * _ROWS * _K
    return aligned_zeros(rows * size).reshape(rows, size)


@inner
def _product_order(c, first, second, k, part):
    """Order k of the product of two columns of ``c``; ``part`` 1: of its tangent."""
    total = 0.0
    for l in range(k + 1):
        if part == 0:
            total += c[l, first] * c[k - l, second]
        else:
            total += c[l, first] * c[_K + k - l, second] + c[_K + l, first] * c[k - l, second]
    return total


@kernel
def _eccentricity_order(rotor, c, k, dual):
    """Order k of e from e e = e², of 1/e from e (1/e) = 1 and of f from f' = f e'/s, with s the
    roughness.
    """
    if k == 0:
        e = math.sqrt(c[0, _E2])
        c[0, _E], c[0, _INVERSE] = e, 1.0 / e
        c[0, _NORMAL] = rotor.contact_force * math.exp((e - 1.0) / rotor.roughness)
        if dual:
            c[_K, _E] = 0.5 * c[_K, _E2] / e
            c[_K, _INVERSE] = -c[_K, _E] / (e * e)
            c[_K, _NORMAL] = c[0, _NORMAL] * c[_K, _E] / rotor.roughness
    else:
        e0 = c[0, _E]
        rest = c[k, _E2]
        inverse = normal = 0.0
        for l in range(1, k):
            rest -= c[l, _E] * c[k - l, _E]
        c[k, _E] = 0.5 * rest / e0
        for l in range(1, k + 1):
            inverse -= c[l, _E] * c[k - l, _INVERSE]
            normal += l * c[l, _E] * c[k - l, _NORMAL]
        c[k, _INVERSE], c[k, _NORMAL] = inverse / e0, normal / (k * rotor.roughness)
        if dual:
            rest = c[_K + k, _E2]
            for l in range(k):
                rest -= 2.0 * c[_K + l, _E] * c[k - l, _E]
            c[_K + k, _E] = 0.5 * rest / e0
            inverse = -c[_K, _E] * c[k, _INVERSE]
            for l in range(1, k + 1):
                inverse -= c[l, _E] * c[_K + k - l, _INVERSE] + c[_K + l, _E] * c[k - l, _INVERSE]
            c[_K + k, _INVERSE] = inverse / e0
            normal = 0.0
            for l in range(1, k + 1):
                normal += l * (
                    c[_K + l, _E] * c[k - l, _NORMAL] + c[l, _E] * c[_K + k - l, _NORMAL]
                )
            c[_K + k, _NORMAL] = normal / (k * rotor.roughness)


@kernel
def _contact_series(rotor, r, d, k, c, dual):
    """Order k of the contact force from orders 0..k of the rotor state ``r`` and its tangent ``d``.

    Columns of ``c`` by :data:`_E2` to :data:`_PER_E2`; rows from ``_K`` on are the tangent's."""
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
        c[o, _E2], c[o, _RADIAL] = s, m
    if c[0, _E2] < CENTRE**2 or (
        c[0, _E2] < 1.0 and 1.0 - math.sqrt(c[0, _E2]) > 40.0 * rotor.roughness
    ):
        for part in range(2 if dual else 1):
            c[part * _K + k, _FX] = c[part * _K + k, _FY] = 0.0
        return
    _eccentricity_order(rotor, c, k, dual)
    for part in range(2 if dual else 1):
        o = part * _K
        c[o + k, _SPRING] = _product_order(c, _NORMAL, _INVERSE, k, part)
        c[o + k, _PER_E2] = _product_order(c, _SPRING, _INVERSE, k, part)
        c[o + k, _DAMPING] = rotor.damping * _product_order(c, _PER_E2, _RADIAL, k, part)
        fx = fy = 0.0
        mu = rotor.friction
        for l in range(k + 1):
            if part == 0:
                n = c[l, _SPRING] + c[l, _DAMPING]
                fx += -n * r[k - l, 0] + mu * c[l, _SPRING] * r[k - l, 1]
                fy += -n * r[k - l, 1] - mu * c[l, _SPRING] * r[k - l, 0]
            else:
                n, dn = c[l, _SPRING] + c[l, _DAMPING], c[_K + l, _SPRING] + c[_K + l, _DAMPING]
                fx += (
                    -dn * r[k - l, 0]
                    - n * d[k - l, 0]
                    + mu * (c[_K + l, _SPRING] * r[k - l, 1] + c[l, _SPRING] * d[k - l, 1])
                )
                fy += (
                    -dn * r[k - l, 1]
                    - n * d[k - l, 1]
                    - mu * (c[_K + l, _SPRING] * r[k - l, 0] + c[l, _SPRING] * d[k - l, 0])
                )
        c[o + k, _FX], c[o + k, _FY] = fx, fy


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
    new, new_v, last_term = stages.new, stages.new_tangent, stages.state[5]
    tangent = _ROWS * _K
    rotor_u, rotor_v = np.zeros((_K + 1, 8)), np.zeros((_K + 1, 8))
    contact = np.zeros((2 * _K, 10))
    shift, shift_face = np.zeros((2 * _K, film.rows)), np.zeros((2 * _K, film.rows))
    for k in range(0, n, WIDTH):
        vstore(series[_S * _K], k, vload(u, k))
        vstore(series[tangent + _S * _K], k, vload(v, k))
    for i in range(8):
        rotor_u[0, i], rotor_v[0, i] = u[n + i], v[n + i]
    ramp = min(t / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0
    ramp_rate = 1.0 / rotor.ramp if rotor.ramp > 0.0 and t < rotor.ramp else 0.0
    cos_k, sin_k, cos_before, sin_before = (
        math.cos(t),
        math.sin(t),
        0.0,
        0.0,
    )  # orders of cos and sin of tau
    for k in range(DTM_ORDER):
        for j in range(film.rows):
            shift[k, j] = rotor_u[k, 0] * film.cos[j] + rotor_u[k, 1] * film.sin[j]
            shift_face[k, j] = rotor_u[k, 0] * film.cos_face[j] + rotor_u[k, 1] * film.sin_face[j]
            shift[_K + k, j] = rotor_v[k, 0] * film.cos[j] + rotor_v[k, 1] * film.sin[j]
            shift_face[_K + k, j] = (
                rotor_v[k, 0] * film.cos_face[j] + rotor_v[k, 1] * film.sin_face[j]
            )
        fx, fy, dfx, dfy = _pressure_order(film, series, shift, k, with_tangent)
        _cube_order(film, series, film.flux_node, shift, _CUBE, k, with_tangent)
        _cube_order(film, series, film.node, shift_face, _AROUND, k, with_tangent)
        _gas_order(film, series, k, 0)
        if with_tangent:
            _gas_order(film, series, k, 1)
        _contact_series(rotor, rotor_u, rotor_v, k, contact, with_tangent)
        cos_load, sin_load = (
            ramp * cos_k + ramp_rate * cos_before,
            ramp * sin_k + ramp_rate * sin_before,
        )
        down = ramp if k == 0 else (ramp_rate if k == 1 else 0.0)
        for part in range(2 if with_tangent else 1):
            order = rotor_u if part == 0 else rotor_v
            forced = 1.0 if part == 0 else 0.0
            px, py = (fx, fy) if part == 0 else (dfx, dfy)
            px, py = px + contact[part * _K + k, _FX], py + contact[part * _K + k, _FY]
            dx, dy = order[k, 2] - order[k, 0], order[k, 3] - order[k, 1]
            share = 1.0 / (k + 1)
            for i in range(4):
                order[k + 1, i] = share * order[k, 4 + i]
            order[k + 1, 4] = share * (
                rotor.coupling_journal * dx
                + rotor.inverse_mass * px
                + forced * rotor.unbalance_journal * cos_load
            )
            order[k + 1, 5] = share * (
                rotor.coupling_journal * dy
                + rotor.inverse_mass * py
                + forced * (rotor.unbalance_journal * sin_load - down * rotor.gravity_journal)
            )
            order[k + 1, 6] = share * (
                -rotor.coupling_disc * dx + forced * rotor.unbalance_disc * cos_load
            )
            order[k + 1, 7] = share * (
                -rotor.coupling_disc * dy
                + forced * (rotor.unbalance_disc * sin_load - down * rotor.gravity_disc)
            )
        cos_before, sin_before = cos_k, sin_k
        cos_k, sin_k = -sin_before / (k + 1), cos_before / (k + 1)
    power = h**DTM_ORDER
    size, last_size = splat(0.0), splat(0.0)
    for i in range(0, n, WIDTH):
        total, dtotal = splat(0.0), splat(0.0)
        for k in range(DTM_ORDER, -1, -1):
            total = total * h + vload(series[_S * _K + k], i)
            dtotal = dtotal * h + vload(series[tangent + _S * _K + k], i)
        vstore(new, i, total)
        vstore(new_v, i, dtotal)
        vstore(last_term, i, vload(series[_S * _K + DTM_ORDER], i) * power)
        dlast = vload(series[tangent + _S * _K + DTM_ORDER], i) * power
        size, last_size = size + dtotal * dtotal, last_size + dlast * dlast
    tangent_size, tangent_last = vsum(size), vsum(last_size)
    for i in range(8):
        total = dtotal = 0.0
        for k in range(DTM_ORDER, -1, -1):
            total, dtotal = total * h + rotor_u[k, i], dtotal * h + rotor_v[k, i]
        new[n + i], new_v[n + i], last_term[n + i] = total, dtotal, rotor_u[DTM_ORDER, i] * power
        tangent_size, tangent_last = (
            tangent_size + dtotal * dtotal,
            tangent_last + (rotor_v[DTM_ORDER, i] * power) ** 2,
        )
    error = error_norm(system, work, new, last_term)
    # an explicit step too long for stiffness shows in the tangent long before it shows in the state
    if with_tangent:
        error = max(error, math.sqrt(tangent_last / tangent_size))
    return error
