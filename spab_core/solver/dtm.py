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
from numba.extending import overload

from spab_core.solver.film import Film
from spab_core.solver.ring import width
from spab_core.solver.rotor import CENTRE
from spab_core.solver.simd import (
    EIGHT,
    WIDTH,
    aligned_zeros,
    at,
    inner,
    kernel,
    load,
    splat,
    store,
    total,
    turn,
)
from spab_core.solver.slope import across, displace, diverge, error_norm
from spab_core.solver.wall import cells, gas_entries

DTM_ORDER = 6
_K = DTM_ORDER + 1
# rows of the series, one for each order: gas S, pressure P, Q = P² - 1, its gradient across the
# band and around, the journal's reach towards the azimuths and faces (Work.reach), H, H² and H³ at
# the flux nodes and at the faces, flux across and around; then the same for the tangent
_S, _P, _Q, _ACROSS, _AROUND, _REACH, _GAP, _GAP_FACE, _FLUX, _FACE = (
    _K * row for row in (0, 1, 2, 3, 4, 5, 6, 9, 12, 13)
)
_SQUARE, _CUBE = _K, 2 * _K  # beyond H
_TANGENT = 14 * _K
# beyond both: P and Q - 1 of the wall's cells, from the film outwards; then the same for the tangent
_WALL = 2 * _TANGENT

# columns of the contact's series: e², e, f, A = f/e, m = x·v, B = damping f m / e², x and y of the
# force, 1/e, A/e
_E2, _E, _NORMAL, _SPRING, _RADIAL, _DAMPING, _FX, _FY, _INVERSE, _PER_E2 = range(10)


def build_series(film: Film) -> np.ndarray:
    """Memory for the transforms, shape (2 * (14 + 2 K) * (order + 1), size of the film's fluxes)."""
    size, rows = film.fluxes * film.columns, _WALL + 4 * _K * len(film.depth)
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
def _cauchy(z, a, b, k, o, ring):
    """Order k of the product of the series at rows a and b, for the latitude at o."""
    value = load(z[a], o, ring) * load(z[b + k], o, ring)
    for l in range(1, k + 1):
        value = value + load(z[a + l], o, ring) * load(z[b + k - l], o, ring)
    return value


@inner
def _cauchy_tangent(z, a, b, k, o, ring):
    """The derivative of :func:`_cauchy`."""
    return _cauchy(z, a, _TANGENT + b, k, o, ring) + _cauchy(z, _TANGENT + a, b, k, o, ring)


@inner
def _carried(z, reach, pressure, first, k, o, ring):
    """Sum of the reach's orders ``first`` to k times those of the pressure that make order k."""
    value = splat(0.0, ring)
    for l in range(first, k + 1):
        value = value + load(z[reach + l], 0, ring) * load(z[pressure + k - l], o, ring)
    return value


@kernel
def _pressure_order(film, z, k, dual):
    """Order k of P = S/H, of Q = P² - 1 and of its gradients; returns its share of the force, (fx,
    fy, dfx, dfy).
    """
    n, m, ring = width(film.ring), film.latitudes, film.ring
    push, dpush = splat(0.0, ring), splat(0.0, ring)
    unit = 1.0 if k == 0 else 0.0
    for row in range(m):
        o, node, weight = row * n, at(film.node, row), at(film.weight, row)
        inverse = 1.0 / (at(film.base, row) - node * load(z[_REACH], 0, ring))
        p = load(z[_S + k], o, ring) + node * _carried(z, _REACH, _P, 1, k, o, ring)
        store(z[_P + k], o, p * inverse)
        store(z[_Q + k], o, _cauchy(z, _P, _P, k, o, ring) - unit)
        push = push + weight * (p * inverse - unit)
        if dual:
            dp = load(z[_TANGENT + _S + k], o, ring)
            dp = dp + node * _carried(z, _REACH, _TANGENT + _P, 1, k, o, ring)
            dp = dp + node * _carried(z, _TANGENT + _REACH, _P, 0, k, o, ring)
            store(z[_TANGENT + _P + k], o, dp * inverse)
            store(z[_TANGENT + _Q + k], o, 2.0 * _cauchy(z, _P, _TANGENT + _P, k, o, ring))
            dpush = dpush + weight * (dp * inverse)
    for part in range(2 if dual else 1):
        t = part * _TANGENT
        q = z[t + _Q + k]
        for row in range(film.fluxes):
            store(z[t + _ACROSS + k], row * n, across(film, film.gradient, row, q))
        for row in range(m):
            store(z[t + _AROUND + k], row * n, turn(film.to_face, load(q, row * n, ring)))
    c, s = load(film.cos, 0, ring), load(film.sin, 0, ring)
    return -total(push * c), -total(push * s), -total(dpush * c), -total(dpush * s)


@kernel
def _cube_order(film, z, rows, base, cosine, place, gap, k, dual):
    """Order k of H, H² and H³ at the flux nodes or at the faces, whose reach is at ``place``, of so
    many rows.
    """
    n, ring = width(film.ring), film.ring
    square, cube = gap + _SQUARE, gap + _CUBE
    still = 1.0 if k == 0 else 0.0
    for row in range(rows):
        o, c = row * n, at(cosine, row)
        store(z[gap + k], o, still * at(base, row) - c * load(z[_REACH + k], place, ring))
        store(z[square + k], o, _cauchy(z, gap, gap, k, o, ring))
        store(z[cube + k], o, _cauchy(z, gap, square, k, o, ring))
        if dual:
            store(z[_TANGENT + gap + k], o, (-c) * load(z[_TANGENT + _REACH + k], place, ring))
            store(z[_TANGENT + square + k], o, _cauchy_tangent(z, gap, gap, k, o, ring))
            store(z[_TANGENT + cube + k], o, _cauchy_tangent(z, gap, square, k, o, ring))


@inner
def _pores(film, part):
    """Rows of the first cell's P and Q - 1; ``part`` 0 the state, 1 the tangent."""
    first = _WALL + part * 2 * _K * cells(film.depth)
    return first, first + _K * cells(film.depth)


@inner
def _wall_order(film, z, k, part):
    """Order k of the cells' Q and order k + 1 of their P (:func:`spab_core.solver.wall.
    wall_slope`).
    """
    count, n, ring = cells(film.depth), width(film.ring), film.ring
    if count > 0:
        (p, q), (state, _) = _pores(film, part), _pores(film, 0)
        film_q = part * _TANGENT + _Q + k
        unit = 1.0 if k == 0 and part == 0 else 0.0
        supply = film.supply - 1.0 if k == 0 and part == 0 else 0.0
        for o in range(0, film.latitudes * n, n):
            before = splat(0.0, ring)
            for c in range(0, count * _K, _K):
                if part == 0:
                    here = _cauchy(z, p + c, p + c, k, o, ring) - unit
                else:
                    here = 2.0 * _cauchy(z, state + c, p + c, k, o, ring)
                store(z[q + c + k], o, here)
            before = film.feed * (load(z[q + k], o, ring) - load(z[film_q], o, ring))
            for c in range(count):
                here = load(z[q + c * _K + k], o, ring)
                if c + 1 < count:
                    flow = load(z[q + (c + 1) * _K + k], o, ring) - here
                else:
                    flow = supply - here
                flow = at(film.conductance, c + 1) * flow
                gain = (at(film.per_capacity, c) / (k + 1)) * (flow - before)
                store(z[p + c * _K + k + 1], o, gain)
                before = flow


def _supply_order(film, z, k, part, o):
    """Order k of the Q - 1 that feeds the film's nodes from ``o`` on."""
    raise NotImplementedError  # compiled only


@overload(_supply_order, jit_options={"error_model": "numpy", "nogil": True, "forceinline": True})
def _supply_order_of(film, z, k, part, o):
    if not len(film.types[film.fields.index("depth")]):
        return lambda film, z, k, part, o: film.supply - 1.0 if k == 0 and part == 0 else 0.0

    def first_cell(film, z, k, part, o):
        return load(z[_pores(film, part)[1] + k], o, film.ring)

    return first_cell


@kernel
def _gas_order(film, z, k, part):
    """Order k + 1 of S from the fluxes of order k; ``part`` 0 the state, 1 the tangent."""
    n, m, ring = width(film.ring), film.latitudes, film.ring
    t, cube, cube_face = part * _TANGENT, _GAP + _CUBE, _GAP_FACE + _CUBE
    flux, face, q, s = z[t + _FLUX + k], z[t + _FACE + k], z[t + _Q + k], z[t + _S + k]
    for row in range(film.fluxes):
        o = row * n
        if part == 0:
            store(flux, o, _cauchy(z, cube, _ACROSS, k, o, ring))
        else:
            store(flux, o, _cauchy_tangent(z, cube, _ACROSS, k, o, ring))
    for row in range(m):
        o, scale = row * n, at(film.around, row)
        if part == 0:
            store(face, o, scale * _cauchy(z, cube_face, _AROUND, k, o, ring))
        else:
            store(face, o, scale * _cauchy_tangent(z, cube_face, _AROUND, k, o, ring))
    _wall_order(film, z, k, part)
    for row in range(m):
        o = row * n
        supply = _supply_order(film, z, k, part, o)
        gain = diverge(film, flux, face, row) + film.feed * (supply - load(q, o, ring))
        gain = gain + turn(film.couette, load(s, o, ring))
        store(z[t + _S + k + 1], o, gain * (1.0 / (k + 1)))


@inner
def _rotor_order(rotor, order, k, fx, fy, ramp, ramp_rate, wave):
    """Order k + 1 of the rotor's state from film and contact forces of order k.

    ``wave`` holds order k of cos and sin of tau and the orders before, for the load; zero for the
    tangent, which no load drives."""
    dx, dy = order[k, 2] - order[k, 0], order[k, 3] - order[k, 1]
    cos_load = ramp * wave[0] + ramp_rate * wave[2]
    sin_load = ramp * wave[1] + ramp_rate * wave[3]
    down = ramp if k == 0 else (ramp_rate if k == 1 else 0.0)
    share = 1.0 / (k + 1)
    for i in range(4):
        order[k + 1, i] = share * order[k, 4 + i]
    order[k + 1, 4] = share * (
        rotor.coupling_journal * dx + rotor.inverse_mass * fx + rotor.unbalance_journal * cos_load
    )
    order[k + 1, 5] = share * (
        rotor.coupling_journal * dy
        + rotor.inverse_mass * fy
        + rotor.unbalance_journal * sin_load
        - down * rotor.gravity_journal
    )
    order[k + 1, 6] = share * (-rotor.coupling_disc * dx + rotor.unbalance_disc * cos_load)
    order[k + 1, 7] = share * (
        -rotor.coupling_disc * dy + rotor.unbalance_disc * sin_load - down * rotor.gravity_disc
    )


@inner
def _first_row(film, part, plane):
    """Row of the series of a plane of the state: the film's gas, then the wall's cells."""
    if plane == 0:
        return part * _TANGENT + _S
    return _pores(film, part)[0] + (plane - 1) * _K


@inner
def _sum_series(film, z, part, rotor, h, out):
    """Sum the series of gas and rotor a step ``h`` later into the state ``out``."""
    n, size = gas_entries(film.latitudes, film.ring, film.depth), film.latitudes * width(film.ring)
    for plane in range(1 + cells(film.depth)):
        first = _first_row(film, part, plane)
        for i in range(0, size, WIDTH):
            value = load(z[first + DTM_ORDER], i, EIGHT)
            for k in range(DTM_ORDER - 1, -1, -1):
                value = value * h + load(z[first + k], i, EIGHT)
            store(out, plane * size + i, value)
    for i in range(8):
        sum_ = 0.0
        for k in range(DTM_ORDER, -1, -1):
            sum_ = sum_ * h + rotor[k, i]
        out[n + i] = sum_


@njit(cache=True, nogil=True, error_model="numpy", _nrt=True)  # allocates its short series
def dtm_step(system, work, stages, series, t, h, u, v, with_tangent):
    """One step of differential transformation of order :data:`DTM_ORDER`; same interface as
    ``rodas_step``.
    """
    film, rotor = system
    n, size = gas_entries(film.latitudes, film.ring, film.depth), film.latitudes * width(film.ring)
    if not u[n] * u[n] + u[n + 1] * u[n + 1] < film.room * film.room:
        return math.inf
    new, new_v, last_term = stages.new, stages.new_tangent, stages.state[5]
    rotor_u, rotor_v = np.zeros((_K + 1, 8)), np.zeros((_K + 1, 8))
    contact = np.zeros((2 * _K, 10))
    for plane in range(1 + cells(film.depth)):
        here = plane * size
        series[_first_row(film, 0, plane), :size] = u[here : here + size]
        series[_first_row(film, 1, plane), :size] = v[here : here + size]
    rotor_u[0], rotor_v[0] = u[n:], v[n:]
    ramp = min(t / rotor.ramp, 1.0) if rotor.ramp > 0.0 else 1.0
    ramp_rate = 1.0 / rotor.ramp if rotor.ramp > 0.0 and t < rotor.ramp else 0.0
    c, s, c_before, s_before = math.cos(t), math.sin(t), 0.0, 0.0  # orders of cos and sin of tau
    for k in range(DTM_ORDER):
        displace(film, rotor_u[k, 0], rotor_u[k, 1], series[_REACH + k])
        displace(film, rotor_v[k, 0], rotor_v[k, 1], series[_TANGENT + _REACH + k])
        fx, fy, dfx, dfy = _pressure_order(film, series, k, with_tangent)
        edges, faces = (film.fluxes, film.flux_base), (film.latitudes, film.base)
        _cube_order(film, series, *edges, film.flux_node, 0, _GAP, k, with_tangent)
        _cube_order(film, series, *faces, film.node, film.columns, _GAP_FACE, k, with_tangent)
        _gas_order(film, series, k, 0)
        _contact_series(rotor, rotor_u, rotor_v, k, contact, with_tangent)
        fx, fy = fx + contact[k, _FX], fy + contact[k, _FY]
        _rotor_order(rotor, rotor_u, k, fx, fy, ramp, ramp_rate, (c, s, c_before, s_before))
        if with_tangent:
            _gas_order(film, series, k, 1)
            dfx, dfy = dfx + contact[_K + k, _FX], dfy + contact[_K + k, _FY]
            _rotor_order(rotor, rotor_v, k, dfx, dfy, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0))
        c, s, c_before, s_before = -s / (k + 1), c / (k + 1), c, s
    _sum_series(film, series, 0, rotor_u, h, new)
    power = h**DTM_ORDER
    last_term[n:] = rotor_u[DTM_ORDER] * power
    for plane in range(1 + cells(film.depth)):
        term = series[_first_row(film, 0, plane) + DTM_ORDER, :size]
        last_term[plane * size : (plane + 1) * size] = term * power
    error = error_norm(system, work, new, last_term)
    # an explicit step too long for stiffness shows in the tangent long before it shows in the state
    if with_tangent:
        _sum_series(film, series, 1, rotor_v, h, new_v)
        rest = rotor_v[DTM_ORDER]
        squares = (rest * rest).sum()
        for plane in range(1 + cells(film.depth)):
            gas = series[_first_row(film, 1, plane) + DTM_ORDER, :size]
            squares += (gas * gas).sum()
        last = power * math.sqrt(squares)
        error = max(error, last / math.sqrt((new_v * new_v).sum()))
    return error
