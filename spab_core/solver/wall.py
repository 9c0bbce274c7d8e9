"""Gas in the porous wall behind each node of the film (docs/model.md): cells through its thickness,
from the film to the outer face, and Darcy flow between them.

Each node has a column of K cells of its own, coupled to nothing else. With the cell's pressure P_j,
Q_j = P_j², and the film's Q at j = 0, the supply's beyond the last cell, the flow towards the film is

    f_j = conductance_j (Q_{j+1} - Q_j),    dP_j/dtau = (f_j - f_{j-1}) / capacity_j

per unit area in the film's units, so that f_0 is what the film gains. Pore gas changes by these
differences alone: gas is conserved to rounding.

The cells and the distances between them are those of a Gaussian rule for three points (Druskin and
Knizhnerman, SIAM J. Numer. Anal. 37, 2000, 403): chosen so that the flow at the film's side and the
slowest decays, not the pressure inside, are right. ``benchmarks/wall.py`` finds them and measures
the error.

The kernels below belong to loops over latitudes in :mod:`spab_core.solver.slope`,
:mod:`~spab_core.solver.linear_solve` and :mod:`~spab_core.solver.curvature`. K is a constant of the
compiler's, told by ``film.depth``; where it is 0, the wall stores nothing, they vanish."""

from __future__ import annotations

import numpy as np
from numba.extending import overload

from spab_core.solver.axial import closing_at
from spab_core.solver.ring import width
from spab_core.solver.simd import at, chosen, inner, load, splat, store

# of the thickness: from the film to the first cell, from cell to cell, to the outer face
SPACING = (0.001486, 0.007040, 0.013835, 0.027924, 0.059323, 0.120339, 0.237215, 0.437659, 0.095179)
# each cell's share of the pores
SHARE = (0.004328, 0.009996, 0.019452, 0.040680, 0.085160, 0.169128, 0.329394, 0.341862)


def cells(depth):
    """Return K: one for each place of ``depth`` (:class:`spab_core.solver.film.Film`)."""
    return len(depth)


@overload(cells)
def _cells(depth):
    count = len(depth)
    return lambda depth: count


@inner
def gas_entries(latitudes, ring, depth):
    """Entries of film and wall in a state: where the rotor's begin."""
    return latitudes * width(ring) * (1 + cells(depth))


def supplied(depth, supply, u, latitudes, row, ring):
    """Return Q - 1 that feeds a latitude of the film: the supply's, or that of the first cell."""
    raise NotImplementedError  # compiled only


@chosen(supplied)
def _supplied(depth, supply, u, latitudes, row, ring):
    if not len(depth):
        return lambda depth, supply, u, latitudes, row, ring: supply - 1.0

    def first_cell(depth, supply, u, latitudes, row, ring):
        n = width(ring)
        p = load(u, latitudes * n + row * n, ring)
        return p * p - 1.0

    return first_cell


def feed_of(depth, quiet, storing, row, ring):
    """Return what a latitude's gain falls by for each of its Q, the answer of its columns of the
    wall included, after :func:`factorise_wall`.
    """
    raise NotImplementedError  # compiled only


@chosen(feed_of)
def _feed_of(depth, quiet, storing, row, ring):
    if not len(depth):
        return lambda depth, quiet, storing, row, ring: quiet
    return lambda depth, quiet, storing, row, ring: load(storing, row * width(ring), ring)


@inner
def wall_slope(film, u, q, row, out):
    """dP/dtau of the cells behind a latitude; ``q`` holds the film's Q - 1."""
    count, n, ring = cells(film.depth), width(film.ring), film.ring
    size, o = film.latitudes * n, row * n
    if count > 0:
        p = load(u, size + o, ring)
        here = p * p - 1.0
        before = film.feed * (here - load(q, o, ring))
        for k in range(1, count):
            p = load(u, (k + 1) * size + o, ring)
            beyond = p * p - 1.0
            flow = at(film.conductance, k) * (beyond - here)
            store(out, k * size + o, (flow - before) * at(film.per_capacity, k - 1))
            here, before = beyond, flow
        flow = at(film.conductance, count) * ((film.supply - 1.0) - here)
        store(out, count * size + o, (flow - before) * at(film.per_capacity, count - 1))


@inner
def add_flow(film, gain, a, b, factor, row):
    """Return what a latitude gains and what the change ``factor`` a b of its first cell's Q adds."""
    if cells(film.depth) > 0:
        n, ring = width(film.ring), film.ring
        o = film.latitudes * n + row * n
        gain = gain + (film.feed * factor) * (load(a, o, ring) * load(b, o, ring))
    return gain


@inner
def wall_change(film, a, b, factor, dq, row, keep, scale, out):
    """out = keep out + scale times the change of :func:`wall_slope`, where the cells' Q change by
    ``factor`` a b and the film's by ``dq``.

    a = u, b = v, factor = 2: the derivative along v. a = v, b = w, factor = 2: the second one."""
    count, n, ring = cells(film.depth), width(film.ring), film.ring
    size, o = film.latitudes * n, row * n
    if count > 0:
        here = factor * (load(a, size + o, ring) * load(b, size + o, ring))
        before = film.feed * (here - load(dq, o, ring))
        for k in range(1, count + 1):
            i = k * size + o
            if k < count:
                beyond = factor * (load(a, i + size, ring) * load(b, i + size, ring))
                flow = at(film.conductance, k) * (beyond - here)
            else:
                beyond, flow = here, (-at(film.conductance, k)) * here
            change = (scale * at(film.per_capacity, k - 1)) * (flow - before)
            if keep:
                change = change + load(out, i, ring)
            store(out, i, change)
            here, before = beyond, flow


@inner
def factorise_wall(film, step, u, work):
    """Eliminate the cells of all columns from I - step J, from the outer face to the film.

    What the film's part of the system changes by is left in ``work.feed``: a column changes the
    diagonal entry of its own node alone."""
    count, n, ring = cells(film.depth), width(film.ring), film.ring
    size = film.latitudes * n
    if count > 0:
        for o in range(0, size, n):
            # of the cell beyond: twice its pressure, and what it answers to this one
            beyond = answer = splat(0.0, ring)
            twice = 2.0 * load(u, count * size + o, ring)
            for k in range(count, 0, -1):
                share = step * at(film.per_capacity, k - 1)
                inward, outward = (
                    share * at(film.conductance, k - 1),
                    share * at(film.conductance, k),
                )
                nearer = 2.0 * load(u, (k - 1) * size + o, ring) if k > 1 else splat(1.0, ring)
                inverse = 1.0 / (1.0 + (inward + outward) * twice - outward * (beyond * answer))
                place = (k - 1) * size + o
                store(work.wall_inverse, place, inverse)
                store(work.wall_outward, place, outward * (beyond * inverse))
                answer = inward * (nearer * inverse)
                store(work.wall_inward, place, answer)
                beyond, twice = twice, nearer
            # these are now the first cell's
            store(work.wall_feed, o, (step * film.feed) * beyond)
            store(work.feed, o, film.feed - film.feed * (beyond * answer))


@inner
def reduce_wall(film, work, r):
    """Eliminate the cells from a right-hand side, in place."""
    count, n, ring = cells(film.depth), width(film.ring), film.ring
    size = film.latitudes * n
    if count > 0:
        for o in range(0, size, n):
            i = count * size + o
            x = load(work.wall_inverse, i - size, ring) * load(r, i, ring)
            store(r, i, x)
            for _ in range(1, count):
                i -= size
                x = load(work.wall_inverse, i - size, ring) * load(r, i, ring) + x * load(
                    work.wall_outward, i - size, ring
                )
                store(r, i, x)
            store(r, o, load(r, o, ring) + load(work.wall_feed, o, ring) * x)


@inner
def restore_wall(film, work, x, y, z, r):
    """Find the cells' unknowns from those of the film and the journal's displacement (x, y, z), in
    place, after :func:`reduce_wall`.
    """
    count, n, ring = cells(film.depth), width(film.ring), film.ring
    size = film.latitudes * n
    if count > 0:
        reach = load(film.cos, 0, ring) * x + load(film.sin, 0, ring) * y
        for row in range(film.latitudes):
            o = row * n
            closing = closing_at(film.slide, 1.0, film.node, film.sine, z, row, reach)
            by_journal = load(work.pressure, o, ring) * closing
            change = load(work.by_gas, o, ring) * (load(r, o, ring) + by_journal)
            for i in range(o, o + count * size, size):
                change = load(r, i + size, ring) + load(work.wall_inward, i, ring) * change
                store(r, i + size, change)


def steady_wall(conductance: np.ndarray, q: np.ndarray, supply: float) -> np.ndarray:
    """Pressure of the cells where nothing changes: Q is linear in the resistances.

    Parameters
    ----------
    conductance : ndarray, (K + 1,)
    q : ndarray, (...)
        P² of the film.
    supply : float
        P_s².

    Returns
    -------
    ndarray, (K, ...)
    """
    passed = np.cumsum(1.0 / conductance)
    share = (passed[:-1] / passed[-1]).reshape(-1, *(1,) * q.ndim)
    return np.asarray(np.sqrt(q + share * (supply - q)))


__all__ = [
    "SHARE",
    "SPACING",
    "add_flow",
    "cells",
    "factorise_wall",
    "feed_of",
    "gas_entries",
    "reduce_wall",
    "restore_wall",
    "steady_wall",
    "supplied",
    "wall_change",
    "wall_slope",
]
