"""Compiled kernels of the film and rotor equations: slope, tangent slope, curvature, and the linear solver of a step.

Each computes a readable formula named in its docstring. ``system`` is (Film, RotorCoefficients); a state is the flat
vector [S by column of latitudes, padded to eights; 8 rotor states]. The integrator (:mod:`spab_core.integrate`) knows a
system only through ``slope``, ``slope_tangent``, ``time_slope``, ``linearise``, ``solve``, ``prepare_curvature``,
``add_curvature`` and ``error_norm``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spab_core.film import Film, film_size
from spab_core.rotor import ROTOR_STATES
from spab_core.simd import WIDTH, aligned_zeros, inner, kernel, next_rows, previous_rows, splat, vload, vmin, vstore, vsum

CENTRE = 1e-9  # below this eccentricity the direction of the contact force has no meaning; the force is left out


class Work(NamedTuple):
    """Scratch memory of one trajectory (all float64).

    ``y``, ``p`` hold 1/H and P at the point of linearisation and ``q``, ``dq`` its Q and the derivative along the tangent;
    ``tq``, ``tdq`` are the same of a stage. ``by_gas`` is dQ/dS, ``by_gap`` dQ per displacement towards the column;
    ``by_gas2``, ``by_gap2`` and ``push`` to ``bend_y`` belong to :func:`prepare_curvature`. ``diagonal``, ``over``, ``under``
    are the film matrix within a column, ``lower``, ``upper`` its couplings around, ``inverse``, ``fill`` the blocks of its
    elimination, ``border`` its two columns for the journal's position and ``small`` the 2 x 2 remainder for the journal's
    velocity and other single numbers.
    """

    y: np.ndarray
    p: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    tq: np.ndarray
    tdq: np.ndarray
    by_gas: np.ndarray
    by_gas2: np.ndarray
    by_gap: np.ndarray
    by_gap2: np.ndarray
    push: np.ndarray
    own: np.ndarray
    east: np.ndarray
    west: np.ndarray
    above: np.ndarray
    below: np.ndarray
    bend_x: np.ndarray
    bend_y: np.ndarray
    diagonal: np.ndarray
    over: np.ndarray
    under: np.ndarray
    inverse: np.ndarray
    fill: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    border: np.ndarray
    scratch: np.ndarray
    small: np.ndarray


def build_work(film: Film) -> Work:
    """Allocate the scratch memory of one trajectory."""
    n, blocks = film_size(film), film.columns * film.padded**2
    ghosted = film.columns * (film.padded + WIDTH) + 2 * WIDTH
    sizes = dict.fromkeys(("q", "tq", "dq", "tdq", "by_gas", "by_gas2", "by_gap", "by_gap2"), ghosted)
    sizes |= {"inverse": blocks, "fill": blocks,
             "border": 2 * (n + ROTOR_STATES), "scratch": 6 * film.padded, "small": 32}
    work = Work(*(aligned_zeros(sizes.get(name, n)) for name in Work._fields))
    for q in (work.q, work.tq):
        q[:] = 1.0  # Q = 1 beyond the edge; the derivatives there stay 0
    return work


@kernel
def _ramp(rotor, t):
    return min(t / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0


@kernel
def contact(rotor, x, y, vx, vy, a, b):
    """rotor.contact_force with its derivatives along ``a`` and ``b`` (x, y, vx, vy) and the mixed second one.

    The force is -(A + B) (x, y) - mu_f A (-y, x) with A = f/e, B = d f (x vx + y vy)/e². Returns eight floats:
    F, dF[a], dF[b], d²F[a, b], x and y of each.
    """
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
    return (-s * x + mu * big_a * y, -s * y - mu * big_a * x,
            -sa * x - s * a[0] + mu * (da * y + big_a * a[1]), -sa * y - s * a[1] - mu * (da * x + big_a * a[0]),
            -sb * x - s * b[0] + mu * (db * y + big_a * b[1]), -sb * y - s * b[1] - mu * (db * x + big_a * b[0]),
            -sab * x - sa * b[0] - sb * a[0] + mu * (dab * y + da * b[1] + db * a[1]),
            -sab * y - sa * b[1] - sb * a[1] - mu * (dab * x + da * b[0] + db * a[0]))


@kernel
def _rotor_linear(rotor, n, u, fx, fy, out):
    """The linear part of rotor.rotor_slope, with (fx, fy) the sum of film and contact forces."""
    dx, dy = u[n + 2] - u[n], u[n + 3] - u[n + 1]
    out[n], out[n + 1], out[n + 2], out[n + 3] = u[n + 4], u[n + 5], u[n + 6], u[n + 7]
    out[n + 4] = rotor.coupling_journal * dx + rotor.inverse_mass * fx
    out[n + 5] = rotor.coupling_journal * dy + rotor.inverse_mass * fy
    out[n + 6] = -rotor.coupling_disc * dx
    out[n + 7] = -rotor.coupling_disc * dy


@kernel
def _load(rotor, n, t, out):
    """Add unbalance and gravity, both ramped."""
    ramp = _ramp(rotor, t)
    c, s = ramp * math.cos(t), ramp * math.sin(t)
    out[n + 4] += rotor.unbalance_journal * c
    out[n + 5] += rotor.unbalance_journal * s - ramp * rotor.gravity_journal
    out[n + 6] += rotor.unbalance_disc * c
    out[n + 7] += rotor.unbalance_disc * s - ramp * rotor.gravity_disc


@kernel
def time_slope(system, t, out):
    """Partial derivative of the slope with respect to tau: unbalance, and the ramp while it lasts."""
    film, rotor = system
    n = film.columns * film.padded
    ramp = _ramp(rotor, t)
    rate = 1.0 / rotor.ramp if rotor.ramp > 0.0 and t < rotor.ramp else 0.0
    c = rate * math.cos(t) - ramp * math.sin(t)
    s = rate * math.sin(t) + ramp * math.cos(t)
    out[:] = 0.0
    out[n + 4] = rotor.unbalance_journal * c
    out[n + 5] = rotor.unbalance_journal * s - rate * rotor.gravity_journal
    out[n + 6] = rotor.unbalance_disc * c
    out[n + 7] = rotor.unbalance_disc * s - rate * rotor.gravity_disc


@inner
def slope(system, t, u, work, out):
    """film.film_slope, film.film_force and rotor.rotor_slope. False where the journal is outside the clearance."""
    film, rotor = system
    mp, columns = film.padded, film.columns
    n, stride = columns * mp, mp + WIDTH
    x, y = u[n], u[n + 1]
    if not x * x + y * y < 1.0:
        return False
    q = work.tq
    fx, fy = splat(0.0), splat(0.0)
    for j in range(columns):
        g = x * film.cos[j] + y * film.sin[j]
        for i in range(0, mp, WIDTH):
            p = vload(u, j * mp + i) / (1.0 - vload(film.cos_centre, i) * g)
            vstore(q, WIDTH + j * stride + i, p * p)
            excess = (p - 1.0) * vload(film.weight, i)
            fx = fx - excess * film.cos[j]
            fy = fy - excess * film.sin[j]
    for i in range(0, mp, WIDTH):
        centre, up, down = vload(film.cos_centre, i), vload(film.cos_up, i), vload(film.cos_down, i)
        k_up, k_down, k_around = vload(film.flux_up, i), vload(film.flux_down, i), vload(film.flux_around, i)
        couette, feed = vload(film.couette, i), vload(film.feed, i)
        last = columns - 1
        h = 1.0 - centre * (x * film.cos_face[last] + y * film.sin_face[last])
        west = k_around * (h * h * h) * (vload(q, WIDTH + i) - vload(q, WIDTH + last * stride + i))
        for j in range(columns):
            je, jw = (j + 1 if j < last else 0), (j - 1 if j > 0 else last)
            o = WIDTH + j * stride + i
            qc = vload(q, o)
            g = x * film.cos[j] + y * film.sin[j]
            h = 1.0 - up * g
            total = k_up * (h * h * h) * (vload(q, o + 1) - qc)
            h = 1.0 - down * g
            total = total - k_down * (h * h * h) * (qc - vload(q, o - 1))
            h = 1.0 - centre * (x * film.cos_face[j] + y * film.sin_face[j])
            east = k_around * (h * h * h) * (vload(q, WIDTH + je * stride + i) - qc)
            total = total + (east - west) + feed * (film.supply - qc)
            total = total - couette * (vload(u, je * mp + i) - vload(u, jw * mp + i))
            vstore(out, j * mp + i, total)
            west = east
    zero = (0.0, 0.0, 0.0, 0.0)
    c = contact(rotor, x, y, u[n + 4], u[n + 5], zero, zero)
    _rotor_linear(rotor, n, u, vsum(fx) + c[0], vsum(fy) + c[1], out)
    _load(rotor, n, t, out)
    return True


@inner
def slope_tangent(system, t, u, v, work, out, out_v):
    """:func:`slope` at ``u`` and its derivative along ``v``, in one pass over memory."""
    film, rotor = system
    mp, columns = film.padded, film.columns
    n, stride = columns * mp, mp + WIDTH
    x, y, dx, dy = u[n], u[n + 1], v[n], v[n + 1]
    if not x * x + y * y < 1.0:
        return False
    q, dq = work.tq, work.tdq
    fx, fy, dfx, dfy = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for j in range(columns):
        c, s = film.cos[j], film.sin[j]
        g, dg = x * c + y * s, dx * c + dy * s
        for i in range(0, mp, WIDTH):
            centre, weight = vload(film.cos_centre, i), vload(film.weight, i)
            inverse = 1.0 / (1.0 - centre * g)
            p = vload(u, j * mp + i) * inverse
            dp = (vload(v, j * mp + i) + p * (centre * dg)) * inverse
            o = WIDTH + j * stride + i
            vstore(q, o, p * p)
            vstore(dq, o, (p + p) * dp)
            excess, dexcess = (p - 1.0) * weight, dp * weight
            fx, fy = fx - excess * c, fy - excess * s
            dfx, dfy = dfx - dexcess * c, dfy - dexcess * s
    for i in range(0, mp, WIDTH):
        centre, up, down = vload(film.cos_centre, i), vload(film.cos_up, i), vload(film.cos_down, i)
        k_up, k_down, k_around = vload(film.flux_up, i), vload(film.flux_down, i), vload(film.flux_around, i)
        couette, feed = vload(film.couette, i), vload(film.feed, i)
        last = columns - 1
        h = 1.0 - centre * (x * film.cos_face[last] + y * film.sin_face[last])
        dh = -3.0 * centre * (dx * film.cos_face[last] + dy * film.sin_face[last])
        ol = WIDTH + last * stride + i
        d = vload(q, WIDTH + i) - vload(q, ol)
        k = k_around * (h * h)
        west, dwest = k * h * d, k * (dh * d + h * (vload(dq, WIDTH + i) - vload(dq, ol)))
        for j in range(columns):
            je, jw = (j + 1 if j < last else 0), (j - 1 if j > 0 else last)
            o, oe = WIDTH + j * stride + i, WIDTH + je * stride + i
            qc, dqc = vload(q, o), vload(dq, o)
            g = x * film.cos[j] + y * film.sin[j]
            dg = -3.0 * (dx * film.cos[j] + dy * film.sin[j])
            h = 1.0 - up * g
            k, d = k_up * (h * h), vload(q, o + 1) - qc
            total = k * h * d
            dtotal = k * (up * dg * d + h * (vload(dq, o + 1) - dqc))
            h = 1.0 - down * g
            k, d = k_down * (h * h), qc - vload(q, o - 1)
            total = total - k * h * d
            dtotal = dtotal - k * (down * dg * d + h * (dqc - vload(dq, o - 1)))
            h = 1.0 - centre * (x * film.cos_face[j] + y * film.sin_face[j])
            dh = -3.0 * centre * (dx * film.cos_face[j] + dy * film.sin_face[j])
            k, d = k_around * (h * h), vload(q, oe) - qc
            east, deast = k * h * d, k * (dh * d + h * (vload(dq, oe) - dqc))
            total = total + (east - west) + feed * (film.supply - qc)
            dtotal = dtotal + (deast - dwest) - feed * dqc
            total = total - couette * (vload(u, je * mp + i) - vload(u, jw * mp + i))
            dtotal = dtotal - couette * (vload(v, je * mp + i) - vload(v, jw * mp + i))
            vstore(out, j * mp + i, total)
            vstore(out_v, j * mp + i, dtotal)
            west, dwest = east, deast
    a = (dx, dy, v[n + 4], v[n + 5])
    c = contact(rotor, x, y, u[n + 4], u[n + 5], a, (0.0, 0.0, 0.0, 0.0))
    _rotor_linear(rotor, n, u, vsum(fx) + c[0], vsum(fy) + c[1], out)
    _rotor_linear(rotor, n, v, vsum(dfx) + c[2], vsum(dfy) + c[3], out_v)
    _load(rotor, n, t, out)
    return True


@inner
def prepare_curvature(system, u, v, work):
    """Form the derivative of the Jacobian along ``v`` at the point of linearisation ``u``, for :func:`add_curvature`.

    It has the stencil of the Jacobian. With P = S/H and one direction v fixed, dQ[w] = a w + b dH and d²Q[v, w] = e w + f dH
    in a cell, where a = 2P/H, b = -aP, e = 2 (dvP - P dvH/H)/H, f = -Pe - a dvP; a face adds k [6 H dvH dwH DQ
    + 3 H² (dvH D dwQ + dwH D dvQ) + H³ D d²Q]. The journal's displacement makes two columns of their own, and the force's
    part is d²P[v, w] = -(dwH dvP + dvH dwP)/H.
    """
    film, _ = system
    mp, columns = film.padded, film.columns
    n, stride = columns * mp, mp + WIDTH
    x, y, vx, vy = u[n], u[n + 1], v[n], v[n + 1]
    q, dq, a, e, b, f = work.q, work.dq, work.by_gas, work.by_gas2, work.by_gap, work.by_gap2
    fxx, fxy, fyy = splat(0.0), splat(0.0), splat(0.0)
    for j in range(columns):
        c, s = film.cos[j], film.sin[j]
        vg = vx * c + vy * s
        for i in range(0, mp, WIDTH):
            o = WIDTH + j * stride + i
            centre, inverse, p = vload(film.cos_centre, i), vload(work.y, j * mp + i), vload(work.p, j * mp + i)
            turn = centre * inverse  # -dH/H of a unit displacement towards the column
            vp = vload(v, j * mp + i) * inverse + p * turn * vg
            first = vload(a, o)
            second = 2.0 * inverse * (vp + p * turn * vg)
            vstore(dq, o, (p + p) * vp)
            vstore(e, o, second)
            vstore(f, o, (second * p + first * vp) * centre)
            push = vload(film.weight, i) * turn
            vstore(work.push, j * mp + i, push * inverse * vg)
            push = push * (vp + p * turn * vg)
            fxx, fxy, fyy = fxx + push * (c * c), fxy + push * (c * s), fyy + push * (s * s)
    work.small[20], work.small[21], work.small[22] = vsum(fxx), vsum(fxy), vsum(fyy)
    last = columns - 1
    for i in range(0, mp, WIDTH):
        centre, up, down = vload(film.cos_centre, i), vload(film.cos_up, i), vload(film.cos_down, i)
        k_up, k_down, k_around = vload(film.flux_up, i), vload(film.flux_down, i), vload(film.flux_around, i)
        feed = vload(film.feed, i)
        west, west_x, west_y = splat(0.0), splat(0.0), splat(0.0)
        for jj in range(columns + 1):
            j = jj - 1 if jj > 0 else last  # the face west of column 0 first
            je = j + 1 if j < last else 0
            o, oe = WIDTH + j * stride + i, WIDTH + je * stride + i
            here, there = j * mp + i, je * mp + i
            cf, sf = film.cos_face[j], film.sin_face[j]
            h, vh = 1.0 - centre * (x * cf + y * sf), -centre * (vx * cf + vy * sf)
            k0, k1 = k_around * (h * h * h), 3.0 * k_around * (h * h) * vh
            k2 = -3.0 * centre * (k_around * h) * (2.0 * vh * (vload(q, oe) - vload(q, o)) + h * (vload(dq, oe) - vload(dq, o)))
            east, back = k1 * vload(a, oe) + k0 * vload(e, oe), k1 * vload(a, o) + k0 * vload(e, o)
            gap_e, gap = k1 * vload(b, oe) + k0 * vload(f, oe), k1 * vload(b, o) + k0 * vload(f, o)
            ce, se = film.cos[je], film.sin[je]
            c, s = film.cos[j], film.sin[j]
            east_x, east_y = k2 * cf + gap_e * ce - gap * c, k2 * sf + gap_e * se - gap * s
            vstore(work.east, here, east)
            vstore(work.west, there, back)
            if jj > 0:
                g, vg = x * c + y * s, vx * c + vy * s
                h, vh = 1.0 - up * g, -up * vg
                k0, k1 = k_up * (h * h * h), 3.0 * k_up * (h * h) * vh
                k2 = -3.0 * up * (k_up * h) * (2.0 * vh * (vload(q, o + 1) - vload(q, o))
                                               + h * (vload(dq, o + 1) - vload(dq, o)))
                total = k2 + k1 * (vload(b, o + 1) - vload(b, o)) + k0 * (vload(f, o + 1) - vload(f, o))
                own = -1.0 * (k1 * vload(a, o) + k0 * vload(e, o))
                vstore(work.above, here, k1 * vload(a, o + 1) + k0 * vload(e, o + 1))
                h, vh = 1.0 - down * g, -down * vg
                k0, k1 = k_down * (h * h * h), 3.0 * k_down * (h * h) * vh
                k2 = -3.0 * down * (k_down * h) * (2.0 * vh * (vload(q, o) - vload(q, o - 1))
                                                   + h * (vload(dq, o) - vload(dq, o - 1)))
                total = total - k2 - k1 * (vload(b, o) - vload(b, o - 1)) - k0 * (vload(f, o) - vload(f, o - 1))
                total = total - feed * vload(f, o)
                vstore(work.below, here, k1 * vload(a, o - 1) + k0 * vload(e, o - 1))
                vstore(work.own, here, own - k1 * vload(a, o) - k0 * vload(e, o) - back - west - feed * vload(e, o))
                vstore(work.bend_x, here, total * c + (east_x - west_x))
                vstore(work.bend_y, here, total * s + (east_y - west_y))
            west, west_x, west_y = east, east_x, east_y


@inner
def add_curvature(system, u, v, w, scale, work, out):
    """out += scale * d²f(u)[v, w], the second derivative of the slope, after :func:`prepare_curvature` for ``v``."""
    film, rotor = system
    mp, columns = film.padded, film.columns
    n = columns * mp
    fx, fy = splat(0.0), splat(0.0)
    wx, wy = w[n], w[n + 1]
    last = columns - 1
    for j in range(columns):
        je, jw = (j + 1 if j < last else 0), (j - 1 if j > 0 else last)
        for i in range(0, mp, WIDTH):
            k = j * mp + i
            here = vload(w, k)
            # the first and last cell of a column have no neighbour: there the coefficient is zero
            over, under = next_rows(here, vload(w, k + WIDTH)), previous_rows(vload(w, max(k - WIDTH, 0)), here)
            total = vload(work.own, k) * here + vload(work.bend_x, k) * wx + vload(work.bend_y, k) * wy
            total = total + vload(work.east, k) * vload(w, je * mp + i) + vload(work.west, k) * vload(w, jw * mp + i)
            total = total + vload(work.above, k) * over + vload(work.below, k) * under
            vstore(out, k, vload(out, k) + scale * total)
            push = vload(work.push, k) * here
            fx, fy = fx - push * film.cos[j], fy - push * film.sin[j]
    small = work.small
    gx, gy = small[20] * wx + small[21] * wy, small[21] * wx + small[22] * wy
    a, b = (v[n], v[n + 1], v[n + 4], v[n + 5]), (w[n], w[n + 1], w[n + 4], w[n + 5])
    c = contact(rotor, u[n], u[n + 1], u[n + 4], u[n + 5], a, b)
    out[n + 4] += scale * rotor.inverse_mass * (vsum(fx) - gx + c[6])
    out[n + 5] += scale * rotor.inverse_mass * (vsum(fy) - gy + c[7])


@kernel
def error_norm(system, work, new, error):
    """Size of a step's error: the worst of journal and disc position (over C), velocity (over 1 + speed) and film (rms)."""
    film, _ = system
    n = film.columns * film.padded
    total, least = splat(0.0), splat(math.inf)
    for k in range(0, n, WIDTH):
        gas = vload(new, k)
        scaled = vload(error, k) / (1.0 + gas)
        total, least = total + scaled * scaled, vmin(least, gas)
    worst = math.sqrt(vsum(total) / (film.columns * film.cells))
    vstore(work.scratch, 0, least)
    for k in range(WIDTH):
        if not work.scratch[k] > 0.0:
            return math.inf  # gas content must stay positive
    if not math.isfinite(worst):
        return math.inf
    speed = 1.0
    for k in range(n + 4, n + 8):
        speed = max(speed, abs(new[k]))
    for k in range(n, n + 4):
        worst = max(worst, abs(error[k]), abs(error[k + 4]) / speed)
    if not new[n] * new[n] + new[n + 1] * new[n + 1] < 1.0:
        return math.inf
    return worst
