"""Vectors over a row of the film's state: two opposite columns side by side
(:class:`spab_core.solver.film.Film`).

``half`` is the padded number of latitudes, a row has 2 ``half`` places. ``row``
(:class:`spab_core.solver.film.Film`) tells it by its type: where one register holds a row, ``half``
is a constant of the compiler's and only that case is compiled."""

from __future__ import annotations

from numba.extending import overload

from spab_core.solver.simd import (
    HALF,
    WIDTH,
    both_halves,
    halves_times,
    inner,
    splat,
    spread,
    swapped_halves,
    vload,
)


def span(row):
    """Padded number of latitudes: ``row`` is () where it is :data:`HALF`, else (half,)."""
    return row[0] if row else HALF


@overload(span)
def _span(row):
    if len(row) == 0:
        return lambda row: HALF
    return lambda row: row[0]


@inner
def opposite(v, row):
    """Where the register at place v of a row, once its halves are exchanged by :func:`turned`,
    comes from.
    """
    half = span(row)
    return v if half == HALF else (v + half) % (2 * half)


@inner
def turned(value, row):
    """A register loaded at :func:`opposite`, as the row with its halves exchanged holds it."""
    half = span(row)
    if half == HALF:
        return swapped_halves(value, value)
    return value


@inner
def chosen(v, first, second, row):
    """``first`` in the first half of a row, ``second`` in the other."""
    half = span(row)
    if half == HALF:
        return both_halves(first, second)
    return first if v < half else second


@inner
def following(x, r, v, rows, row):
    """The columns east of those in row r."""
    half = span(row)
    if r + 1 < rows:
        return vload(x, (r + 1) * 2 * half + v)
    return turned(vload(x, opposite(v, row)), row)


@inner
def preceding(x, r, v, rows, row):
    """The columns west of those in row r."""
    half = span(row)
    if r > 0:
        return vload(x, (r - 1) * 2 * half + v)
    return turned(vload(x, (rows - 1) * 2 * half + opposite(v, row)), row)


@inner
def near(x, o, c, v, row):
    """Latitude c of each half of the row at x[o:], in all places of its half."""
    half = span(row)
    if half == HALF:
        return both_halves(spread(x, o + c), spread(x, o + half + c))
    return spread(x, o + c + (half if v >= half else 0))


@inner
def apply(matrix, o, x, ox, v, row):
    """Register v of the product of two blocks side by side, stored by columns at matrix[o:], and
    the row at x[ox:].
    """
    half = span(row)
    if half == HALF:
        return halves_times(matrix, o, vload(x, ox))
    start = ox + (half if v >= half else 0)
    even, odd = splat(0.0), splat(0.0)
    for c in range(0, half, 2):  # two sums for latency
        even = even + vload(matrix, o + c * 2 * half + v) * spread(x, start + c)
        odd = odd + vload(matrix, o + (c + 1) * 2 * half + v) * spread(x, start + c + 1)
    return even + odd


__all__ = [
    "WIDTH",
    "apply",
    "chosen",
    "following",
    "near",
    "opposite",
    "preceding",
    "span",
    "turned",
]
