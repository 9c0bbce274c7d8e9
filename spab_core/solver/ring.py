"""Matrices over the N azimuths of a latitude: products and inverses, by blocks of eight."""

from __future__ import annotations

from numba.extending import overload

from spab_core.solver.simd import WIDTH, block_product, inner, invert_block


def width(ring):
    """Return N: eight for each place of ``ring`` (:class:`spab_core.solver.film.Film`)."""
    return WIDTH * len(ring)


@overload(width)
def _width(ring):
    count = WIDTH * len(ring)
    return lambda ring: count


@inner
def matrix_product(a, oa, b, ob, c, oc, ring):
    """Write the matrix at a[oa:] times the one at b[ob:] to c[oc:], by columns; no two may
    overlap.
    """
    n = width(ring)
    for j in range(0, n, WIDTH):
        for i in range(0, n, WIDTH):
            block_product(0, 1, a, oa + i, b, ob + j * n, c, oc + j * n + i, n)
            for k in range(WIDTH, n, WIDTH):
                block_product(1, 1, a, oa + k * n + i, b, ob + j * n + k, c, oc + j * n + i, n)


@inner
def subtract_product(a, oa, b, ob, c, oc, ring):
    """Take the matrix at a[oa:] times the one at b[ob:] from the one at c[oc:]."""
    n = width(ring)
    for j in range(0, n, WIDTH):
        for i in range(0, n, WIDTH):
            for k in range(0, n, WIDTH):
                block_product(1, -1, a, oa + k * n + i, b, ob + j * n + k, c, oc + j * n + i, n)


@inner
def invert(b, o, ring):
    """Invert the matrix at b[o:] in place, by Gauss-Jordan over blocks of eight, without pivoting."""
    n = width(ring)
    for k in range(0, n, WIDTH):
        own = o + k * n + k
        invert_block(b, own, n)
        for j in range(0, n, WIDTH):
            if j != k:  # the pivot's row: from the left by the inverse
                there = o + j * n + k
                block_product(0, 1, b, own, b, there, b, there, n)
        for i in range(0, n, WIDTH):
            if i != k:
                here = o + k * n + i
                for j in range(0, n, WIDTH):
                    if j != k:
                        block_product(1, -1, b, here, b, o + j * n + k, b, o + j * n + i, n)
                # the pivot's column: from the right
                block_product(0, -1, b, here, b, own, b, here, n)


__all__ = ["invert", "matrix_product", "subtract_product", "width"]
