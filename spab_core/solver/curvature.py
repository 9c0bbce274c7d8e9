"""The second derivative of the slope along a direction, for the exact derivative of a Rosenbrock
step.
"""

from __future__ import annotations

from spab_core.solver.row_ops import apply, following, near, opposite, preceding, span, turned
from spab_core.solver.simd import WIDTH, inlined, inner, splat, vload, vstore, vsum
from spab_core.solver.slope import contact


@inner
def _bent_face(film, work, node, around, x, y, vx, vy, r, i):
    """Second derivatives of the flux east of row r along v and: the gas east, the gas here, the
    journal's x, y.
    """
    half = span(film.row)
    rows, k = film.rows, r * 2 * half + i
    row_east = r + 1 if r + 1 < rows else 0
    q, q_v = work.q, work.dq
    by_gas, by_gas2, by_gap, by_gap2 = work.by_gas, work.by_gas2, work.by_gap, work.by_gap2
    cos, sin = film.cos_face[r], film.sin_face[r]
    h, h_v = 1.0 - node * (x * cos + y * sin), -1.0 * node * (vx * cos + vy * sin)
    # what multiplies the difference of Q, and its derivative along v
    weight, weight_v = around * (h * h * h), 3.0 * around * (h * h) * h_v
    jump, jump_v = (
        following(q, r, i, rows, film.row) - vload(q, k),
        following(q_v, r, i, rows, film.row) - vload(q_v, k),
    )
    tilt = -3.0 * node * (around * h) * (2.0 * h_v * jump + h * jump_v)
    gas_east = weight_v * following(by_gas, r, i, rows, film.row) + weight * following(
        by_gas2, r, i, rows, film.row
    )
    gas_here = weight_v * vload(by_gas, k) + weight * vload(by_gas2, k)
    # by_gap of the row after the last, whose halves are exchanged, still goes with the cosine of
    # row 0
    gap_east = weight_v * following(by_gap, r, i, rows, film.row) + weight * following(
        by_gap2, r, i, rows, film.row
    )
    gap_here = weight_v * vload(by_gap, k) + weight * vload(by_gap2, k)
    return (
        gas_east,
        gas_here,
        tilt * cos + gap_east * film.cos[row_east] - gap_here * film.cos[r],
        tilt * sin + gap_east * film.sin[row_east] - gap_here * film.sin[r],
    )


@inlined
def prepare_curvature(system, u, v, work):
    """Form the derivative of the Jacobian along ``v`` at the point of linearisation ``u``, for
    :func:`add_curvature`.

    It has the stencil of the Jacobian. With P = S/H and one direction v fixed, dQ[w] = a w + b dH
    and d²Q[v, w] = e w + f dH at a node, where a = 2P/H (``by_gas``), b = -aP (``by_gap``), e =
    2 (dvP - P dvH/H)/H (``by_gas2``), f = -Pe - a dvP (``by_gap2``); a name with ``_v`` is a
    derivative along v. A flux k H³ DQ adds k [6 H dvH dwH DQ + 3 H² (dvH D dwQ + dwH D dvQ) + H³ D d²Q]. The
    journal's displacement makes two columns of their own, and the force's part is d²P[v, w] = -(dwH
    dvP + dvH dwP)/H."""
    film, _ = system
    half = span(film.row)
    rows, width = film.rows, 2 * half
    n, size = rows * width, half * width
    x, y, vx, vy = u[n], u[n + 1], v[n], v[n + 1]
    q_v = work.dq
    by_gas, by_gas2, by_gap, by_gap2 = work.by_gas, work.by_gas2, work.by_gap, work.by_gap2
    fxx, fxy, fyy = splat(0.0), splat(0.0), splat(0.0)
    for r in range(rows):
        c, s = film.cos[r], film.sin[r]
        g, g_v = x * c + y * s, vx * c + vy * s
        for i in range(0, width, WIDTH):
            k = r * width + i
            node, inverse, p = vload(film.node, i), vload(work.y, k), vload(work.p, k)
            turn = node * inverse  # -dH/H of a unit displacement towards the column
            p_v = vload(v, k) * inverse + p * turn * g_v
            second = 2.0 * inverse * (p_v + p * turn * g_v)
            vstore(q_v, k, (p + p) * p_v)
            vstore(by_gas2, k, second)
            vstore(by_gap2, k, (second * p + vload(by_gas, k) * p_v) * node)
            push = vload(film.weight, i) * turn
            vstore(work.push, k, push * inverse * g_v)
            push = push * (p_v + p * turn * g_v)
            fxx, fxy, fyy = fxx + push * (c * c), fxy + push * (c * s), fyy + push * (s * s)
        for i in range(0, width, WIDTH):
            k, node = r * width + i, vload(film.flux_node, i)
            h, h_v = 1.0 - node * g, -1.0 * node * g_v
            total = (
                -3.0
                * node
                * h
                * (
                    2.0 * h_v * vload(work.gq, k)
                    + h * apply(film.gradient, 0, q_v, r * width, i, film.row)
                )
            )
            total = total + 3.0 * (h * h) * h_v * apply(
                film.gradient, 0, by_gap, r * width, i, film.row
            )
            vstore(
                work.flux,
                k,
                total + h * h * h * apply(film.gradient, 0, by_gap2, r * width, i, film.row),
            )
    work.small[20], work.small[21], work.small[22] = vsum(fxx), vsum(fxy), vsum(fyy)
    for i in range(0, width, WIDTH):
        node, around, feed = vload(film.node, i), vload(film.flux_around, i), vload(film.feed, i)
        o = opposite(i, film.row)
        west, back, west_x, west_y = _bent_face(
            film, work, vload(film.node, o), around, x, y, vx, vy, rows - 1, o
        )
        west, back = turned(west, film.row), turned(back, film.row)
        west_x, west_y = turned(west_x, film.row), turned(west_y, film.row)
        for r in range(rows):
            k = r * width + i
            c, s = film.cos[r], film.sin[r]
            g, g_v = x * c + y * s, vx * c + vy * s
            east, here, east_x, east_y = _bent_face(film, work, node, around, x, y, vx, vy, r, i)
            vstore(work.east, k, east)
            vstore(work.west, k, back)
            bend = apply(film.divergence, 0, work.flux, r * width, i, film.row) - feed * vload(
                by_gap2, k
            )
            vstore(work.bend_x, k, bend * c + (east_x - west_x))
            vstore(work.bend_y, k, bend * s + (east_y - west_y))
            diagonal = here + west + feed * vload(by_gas2, k)
            for j in range(half):
                m = j * width + i
                a0, a1 = vload(film.across, m), vload(film.across, size + m)
                a2, a3 = vload(film.across, 2 * size + m), vload(film.across, 3 * size + m)
                straight, slant = (
                    a0 + g * (a1 + g * (a2 + g * a3)),
                    g_v * (a1 + g * (2.0 * a2 + (3.0 * g) * a3)),
                )
                block = slant * near(by_gas, r * width, j, i, film.row) + straight * near(
                    by_gas2, r * width, j, i, film.row
                )
                vstore(work.own, r * size + m, block - diagonal * vload(film.unit, m))
            west, back, west_x, west_y = east, here, east_x, east_y


@inlined
def add_curvature(system, u, v, w, scale, work, out):
    """out += scale * d²f(u)[v, w], the second derivative of the slope, after
    :func:`prepare_curvature` for ``v``.
    """
    film, rotor = system
    half = span(film.row)
    rows, width = film.rows, 2 * half
    n, size = rows * width, half * width
    fx, fy = splat(0.0), splat(0.0)
    wx, wy = w[n], w[n + 1]
    for r in range(rows):
        for i in range(0, width, WIDTH):
            k = r * width + i
            total = apply(work.own, r * size, w, r * width, i, film.row)
            total = total + vload(work.bend_x, k) * wx + vload(work.bend_y, k) * wy
            total = total + vload(work.east, k) * following(w, r, i, rows, film.row)
            total = total + vload(work.west, k) * preceding(w, r, i, rows, film.row)
            vstore(out, k, vload(out, k) + scale * total)
            push = vload(work.push, k) * vload(w, k)
            fx, fy = fx - push * film.cos[r], fy - push * film.sin[r]
    small = work.small
    gx, gy = small[20] * wx + small[21] * wy, small[21] * wx + small[22] * wy
    a, b = (v[n], v[n + 1], v[n + 4], v[n + 5]), (w[n], w[n + 1], w[n + 4], w[n + 5])
    c = contact(rotor, u[n], u[n + 1], u[n + 4], u[n + 5], a, b)
    out[n + 4] += scale * rotor.inverse_mass * (vsum(fx) - gx + c[6])
    out[n + 5] += scale * rotor.inverse_mass * (vsum(fy) - gy + c[7])
