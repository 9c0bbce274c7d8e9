"""Compiled kernels of the film and rotor equations: slope, tangent slope, curvature, and the linear
solver of a step.

Each computes a readable formula named in its docstring. ``system`` is a
:class:`~spab_core.solver.system.System`; a
state is the flat vector [S by rows of two opposite columns, padded
(:class:`spab_core.solver.film.Film`); 8 rotor states]. The integrator
(:mod:`spab_core.solver.stepping`) knows a system only through ``slope``, ``slope_tangent``,
``time_slope``, ``linearise``, ``solve``, ``prepare_curvature``, ``add_curvature`` and
``error_norm``."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from spab_core.solver.film import Film, film_size
from spab_core.solver.rotor import CENTRE, ROTOR_STATES
from spab_core.solver.row_ops import apply, following, opposite, preceding, span, turned
from spab_core.solver.simd import (
    WIDTH,
    aligned_zeros,
    inlined,
    inner,
    kernel,
    splat,
    vload,
    vmin,
    vstore,
    vsum,
)
from spab_core.solver.system import System


class Work(NamedTuple):
    """Scratch memory of one trajectory (all float64).

    ``y``, ``p``, ``q`` hold 1/H, P and Q - 1 at the point of linearisation, ``gq`` the gradient of
    Q across the band there and ``dq`` the derivative of Q along the tangent; ``tq``, ``tdq``,
    ``flux``, ``dflux`` are Q - 1, its derivative and the fluxes across the band of a stage.
    ``by_gas`` is dQ/dS, ``by_gap`` dQ per displacement towards the row's first column; ``by_gas2``,
    ``by_gap2`` and ``push`` to ``bend_y`` belong to :func:`prepare_curvature`. ``lower``, ``upper``
    are the couplings of I - step J around, ``inverse``, ``fill``, ``separator`` the blocks of its
    elimination, ``border`` its two columns for the journal's position and ``small`` the 2 x 2
    remainder for the journal's velocity and other single numbers."""

    y: np.ndarray
    p: np.ndarray
    q: np.ndarray
    gq: np.ndarray
    dq: np.ndarray
    tq: np.ndarray
    tdq: np.ndarray
    flux: np.ndarray
    dflux: np.ndarray
    by_gas: np.ndarray
    by_gas2: np.ndarray
    by_gap: np.ndarray
    by_gap2: np.ndarray
    push: np.ndarray
    own: np.ndarray
    east: np.ndarray
    west: np.ndarray
    bend_x: np.ndarray
    bend_y: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    inverse: np.ndarray
    fill: np.ndarray
    separator: np.ndarray
    border: np.ndarray
    scratch: np.ndarray
    small: np.ndarray


def build_work(film: Film) -> Work:
    """Allocate the scratch memory of one trajectory."""
    n, blocks = film_size(film), film_size(film) * film.padded_latitudes
    sizes = {
        "own": blocks,
        "inverse": blocks,
        "fill": 2 * blocks,
        "separator": (2 * film.padded_latitudes) ** 2,
        "border": 2 * (n + ROTOR_STATES),
        "scratch": 8 * film.padded_latitudes,
        "small": 32,
    }
    return Work(*(aligned_zeros(sizes.get(name, n)) for name in Work._fields))


@kernel
def _ramp(rotor, t):
    return min(t / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0


@kernel
def contact(rotor, x, y, vx, vy, a, b):
    """rotor.contact_force with its derivatives along ``a`` and ``b`` (x, y, vx, vy) and the mixed
    second one.

    The force is -(A + B) (x, y) - mu_f A (-y, x) with A = f/e, B = d f (x vx + y vy)/e². Returns
    eight floats: F, dF[a], dF[b], d²F[a, b], x and y of each."""
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
    return (
        -s * x + mu * big_a * y,
        -s * y - mu * big_a * x,
        -sa * x - s * a[0] + mu * (da * y + big_a * a[1]),
        -sa * y - s * a[1] - mu * (da * x + big_a * a[0]),
        -sb * x - s * b[0] + mu * (db * y + big_a * b[1]),
        -sb * y - s * b[1] - mu * (db * x + big_a * b[0]),
        -sab * x - sa * b[0] - sb * a[0] + mu * (dab * y + da * b[1] + db * a[1]),
        -sab * y - sa * b[1] - sb * a[1] - mu * (dab * x + da * b[0] + db * a[0]),
    )


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
    n = film.rows * 2 * span(film.row)
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
def east_flux(film, node, around, x, y, q, r, v):
    """Flux through the faces east of row r."""
    half = span(film.row)
    h = 1.0 - node * (x * film.cos_face[r] + y * film.sin_face[r])
    return (
        around
        * (h * h * h)
        * (following(q, r, v, film.rows, film.row) - vload(q, r * 2 * half + v))
    )


@inlined
def slope(system, t, u, work, out):
    """film.film_slope, film.film_force and rotor.rotor_slope.

    False where the journal is outside the clearance.
    """
    film, rotor = system
    half = span(film.row)
    rows, width = film.rows, 2 * half
    n = rows * width
    x, y = u[n], u[n + 1]
    if not x * x + y * y < 1.0:
        return False
    q, flux = work.tq, work.flux
    fx, fy = splat(0.0), splat(0.0)
    for r in range(rows):
        c, s = film.cos[r], film.sin[r]
        g = x * c + y * s
        for v in range(0, width, WIDTH):
            p = vload(u, r * width + v) / (1.0 - vload(film.node, v) * g)
            vstore(q, r * width + v, p * p - 1.0)
            excess = (p - 1.0) * vload(film.weight, v)
            fx, fy = fx - excess * c, fy - excess * s
        for v in range(0, width, WIDTH):
            h = 1.0 - vload(film.flux_node, v) * g
            vstore(
                flux,
                r * width + v,
                (h * h * h) * apply(film.gradient, 0, q, r * width, v, film.row),
            )
    supply = film.supply - 1.0
    for v in range(0, width, WIDTH):
        node, around = vload(film.node, v), vload(film.flux_around, v)
        couette, feed = vload(film.couette, v), vload(film.feed, v)
        o = opposite(v, film.row)
        west = turned(east_flux(film, vload(film.node, o), around, x, y, q, rows - 1, o), film.row)
        for r in range(rows):
            k = r * width + v
            east = east_flux(film, node, around, x, y, q, r, v)
            total = (
                apply(film.divergence, 0, flux, r * width, v, film.row)
                + (east - west)
                + feed * (supply - vload(q, k))
            )
            total = total - couette * (
                following(u, r, v, rows, film.row) - preceding(u, r, v, rows, film.row)
            )
            vstore(out, k, total)
            west = east
    zero = (0.0, 0.0, 0.0, 0.0)
    c = contact(rotor, x, y, u[n + 4], u[n + 5], zero, zero)
    _rotor_linear(rotor, n, u, vsum(fx) + c[0], vsum(fy) + c[1], out)
    _load(rotor, n, t, out)
    return True


@inner
def _east_flux_tangent(film, node, around, x, y, dx, dy, q, dq, r, v):
    """Flux through the faces east of row r, and its derivative."""
    half = span(film.row)
    c, s, k = film.cos_face[r], film.sin_face[r], r * 2 * half + v
    h = 1.0 - node * (x * c + y * s)
    slant = -3.0 * node * (dx * c + dy * s)
    d = following(q, r, v, film.rows, film.row) - vload(q, k)
    scale = around * (h * h)
    return scale * h * d, scale * (
        slant * d + h * (following(dq, r, v, film.rows, film.row) - vload(dq, k))
    )


@inlined
def slope_tangent(system, t, u, v, work, out, out_v):
    """:func:`slope` at ``u`` and its derivative along ``v``, in one pass over memory."""
    film, rotor = system
    half = span(film.row)
    rows, width = film.rows, 2 * half
    n = rows * width
    x, y, dx, dy = u[n], u[n + 1], v[n], v[n + 1]
    if not x * x + y * y < 1.0:
        return False
    q, dq, flux, dflux = work.tq, work.tdq, work.flux, work.dflux
    fx, fy, dfx, dfy = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    for r in range(rows):
        c, s = film.cos[r], film.sin[r]
        g, dg = x * c + y * s, dx * c + dy * s
        for i in range(0, width, WIDTH):
            k = r * width + i
            node, weight = vload(film.node, i), vload(film.weight, i)
            inverse = 1.0 / (1.0 - node * g)
            p = vload(u, k) * inverse
            dp = (vload(v, k) + p * (node * dg)) * inverse
            vstore(q, k, p * p - 1.0)
            vstore(dq, k, (p + p) * dp)
            excess, dexcess = (p - 1.0) * weight, dp * weight
            fx, fy = fx - excess * c, fy - excess * s
            dfx, dfy = dfx - dexcess * c, dfy - dexcess * s
        for i in range(0, width, WIDTH):
            k = r * width + i
            node = vload(film.flux_node, i)
            h = 1.0 - node * g
            h2, gradient = h * h, apply(film.gradient, 0, q, r * width, i, film.row)
            vstore(flux, k, h2 * h * gradient)
            vstore(
                dflux,
                k,
                h2
                * (
                    h * apply(film.gradient, 0, dq, r * width, i, film.row)
                    - (3.0 * dg) * node * gradient
                ),
            )
    supply = film.supply - 1.0
    for i in range(0, width, WIDTH):
        node, around = vload(film.node, i), vload(film.flux_around, i)
        couette, feed = vload(film.couette, i), vload(film.feed, i)
        o = opposite(i, film.row)
        west, dwest = _east_flux_tangent(
            film, vload(film.node, o), around, x, y, dx, dy, q, dq, rows - 1, o
        )
        west, dwest = turned(west, film.row), turned(dwest, film.row)
        for r in range(rows):
            k = r * width + i
            east, deast = _east_flux_tangent(film, node, around, x, y, dx, dy, q, dq, r, i)
            total = (
                apply(film.divergence, 0, flux, r * width, i, film.row)
                + (east - west)
                + feed * (supply - vload(q, k))
            )
            dtotal = (
                apply(film.divergence, 0, dflux, r * width, i, film.row)
                + (deast - dwest)
                - feed * vload(dq, k)
            )
            total = total - couette * (
                following(u, r, i, rows, film.row) - preceding(u, r, i, rows, film.row)
            )
            dtotal = dtotal - couette * (
                following(v, r, i, rows, film.row) - preceding(v, r, i, rows, film.row)
            )
            vstore(out, k, total)
            vstore(out_v, k, dtotal)
            west, dwest = east, deast
    a = (dx, dy, v[n + 4], v[n + 5])
    c = contact(rotor, x, y, u[n + 4], u[n + 5], a, (0.0, 0.0, 0.0, 0.0))
    _rotor_linear(rotor, n, u, vsum(fx) + c[0], vsum(fy) + c[1], out)
    _rotor_linear(rotor, n, v, vsum(dfx) + c[2], vsum(dfy) + c[3], out_v)
    _load(rotor, n, t, out)
    return True


@kernel
def error_norm(system, work, new, error):
    """Size of a step's error: the worst of journal and disc position (over C), velocity (over 1 +
    speed) and film (rms).
    """
    film, _ = system
    n = film.rows * 2 * span(film.row)
    total, least = splat(0.0), splat(math.inf)
    for k in range(0, n, WIDTH):
        gas = vload(new, k)
        scaled = vload(error, k) / (1.0 + gas)
        total, least = total + scaled * scaled, vmin(least, gas)
    worst = math.sqrt(vsum(total) / (film.columns * film.latitudes))
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


def slope_and_jacobian(
    system: System, state: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Slope and its derivative with respect to the states at ``columns``, by the compiled tangent.

    Returns
    -------
    slope : ndarray, (n,)
    jacobian : ndarray, (n, len(columns))

    Raises
    ------
    ValueError
        Where the journal is outside the clearance.
    """
    n = len(state)
    out, transposed = np.zeros(n), np.empty((len(columns), n))
    if not fill_jacobian(system, state, columns, build_work(system.film), out, transposed):
        raise ValueError("the journal is outside the clearance")
    return out, transposed.T


@njit(cache=True, nogil=True)
def fill_jacobian(system, state, columns, work, out, transposed):
    """Slope, and one row of ``transposed`` for each column of the Jacobian asked for."""
    direction = np.zeros(state.size)
    for k in range(columns.size):
        direction[columns[k]] = 1.0
        if not slope_tangent(system, 0.0, state, direction, work, out, transposed[k]):
            return False
        direction[columns[k]] = 0.0
    return True
