"""How far from the hardware: useful floating-point operations a second of the film kernels over the core's own peak.

    python benchmarks/peak.py

The peak is measured on the same core in the same run: sixteen independent chains of fused multiply-adds on registers of eight
doubles, the widest arithmetic that spab_core uses. Useful operations are those of the formulas, counted by hand below,
per cell of the film (an addition, multiplication or division is one each; sines and exponentials are left out).
"""

from __future__ import annotations

import statistics
import time

import numpy as np
from numba import njit

from spab_core.design import reference_design
from spab_core.film import DEFAULT_MESH, build_film
from spab_core.integrate import Options, advance, build_memory, build_record, rodas_step
from spab_core.kernels import slope, slope_tangent
from spab_core.linear import linearise, solve
from spab_core.rotor import build_rotor
from spab_core.simd import kernel, splat, vload, vstore

ROUNDS, REPEAT, CHAINS = 15, 400, 16
# one cell: P, Q and its share of the force 9 (gap 2, P 1, Q 1, excess 2, two sums 4 less 1); three faces of gap 2, cube 2,
# difference, two products and a sum 6 each, so 3 x 8 for up, down, east with the west face reused 1, feed 3, Couette 3
SLOPE = 9 + 3 * 8 + 1 + 3 + 3
# the derivative along a direction: P and Q 7, force 5; a face: dH 2, two products and sums 7; feed 2, Couette 3
TANGENT = SLOPE + 7 + 5 + 3 * 9 + 1 + 2 + 3


@kernel
def _peak(array, repeat):
    a, b = vload(array, 0), vload(array, 8)
    c0, c1, c2, c3, c4, c5, c6, c7 = a, b, a + b, a - b, a * b, a + a, b + b, a * a
    d0, d1, d2, d3, d4, d5, d6, d7 = b, a, b + a, b - a, b * a, b + 2.0, a + 2.0, b * b
    for _ in range(repeat):
        c0, c1, c2, c3 = c0 * a + b, c1 * a + b, c2 * a + b, c3 * a + b
        c4, c5, c6, c7 = c4 * a + b, c5 * a + b, c6 * a + b, c7 * a + b
        d0, d1, d2, d3 = d0 * a + b, d1 * a + b, d2 * a + b, d3 * a + b
        d4, d5, d6, d7 = d4 * a + b, d5 * a + b, d6 * a + b, d7 * a + b
    total = splat(0.0) + c0 + c1 + c2 + c3 + c4 + c5 + c6 + c7 + d0 + d1 + d2 + d3 + d4 + d5 + d6 + d7
    vstore(array, 16, total)


@njit
def _slopes(system, u, work, out, repeat):
    for _ in range(repeat):
        slope(system, 250.0, u, work, out)


@njit
def _tangents(system, u, v, work, out, out_v, repeat):
    for _ in range(repeat):
        slope_tangent(system, 250.0, u, v, work, out, out_v)


@njit
def _factorise(system, u, work, repeat):
    for _ in range(repeat):
        linearise(system, 0.05, u, work)


@njit
def _solves(system, work, out, repeat):
    for _ in range(repeat):
        solve(system, work, out)


@njit
def _steps(system, work, stages, series, u, v, repeat):
    for _ in range(repeat):
        rodas_step(system, work, stages, series, 250.0, 0.2, u, v, True)


def _elimination(film, work):
    """Operations of the factorisation and of one solve: dense blocks of eight, as many as the state couples."""
    n, m = film.columns, film.padded
    coupled = work.small[14] + work.small[15] + work.small[16]
    multiply, apply = 2 * m**3, 2 * m**2
    border = 2 * (n * m * 35)
    one = 2 * (n - 1) * apply + apply + coupled * apply + 4 * n * m
    factor = n * (2 * m**3 + 3 * m**2 + 30 * m) + coupled * (2 * multiply + 4 * m**2)
    return factor + border + 2 * (one + 7 * n * m), one + 11 * n * m


def main():
    design = reference_design()
    film = build_film(design, 4.5, DEFAULT_MESH)
    system = (film, build_rotor(design, 18.0, 4.5))
    memory = build_memory(film)
    advance(system, memory, Options(tangent=True), 0, 40, build_record(40, 0))
    u, v, work = memory.state, memory.tangent, memory.work
    a, b = np.zeros_like(u), np.zeros_like(u)
    linearise(system, 0.05, u, work)
    array = np.full(24, 0.5)
    cells = film.columns * film.padded
    factor, one = _elimination(film, work)
    film_part = 6 * TANGENT * cells + factor + 12 * one + 6 * 20 * cells + 60 * cells  # + curvature: applied and formed
    runs = {
        "peak": (_peak, (array, 100 * REPEAT), CHAINS * 16 * 100),
        "slope": (_slopes, (system, u, work, a, REPEAT), SLOPE * cells),
        "slope and its tangent": (_tangents, (system, u, v, work, a, b, REPEAT), TANGENT * cells),
        "form and factorise": (_factorise, (system, u, work, REPEAT), factor),
        "solve": (_solves, (system, work, a, REPEAT), one),
        "whole step with tangent": (_steps, (system, work, memory.stages, memory.series, u, v, REPEAT), film_part),
    }
    rates = {name: [] for name in runs}
    for function, arguments, _ in runs.values():
        function(*arguments)
    for _ in range(ROUNDS):
        for name, (function, arguments, operations) in runs.items():
            a[:] = 0.0
            began = time.perf_counter()
            function(*arguments)
            rates[name].append(operations * REPEAT / (time.perf_counter() - began) / 1e9)
    for name, values in rates.items():
        shares = [value / top for value, top in zip(values, rates["peak"], strict=True)]
        print(f"{name:24s} {statistics.median(values):6.1f} Gflop/s   {100 * statistics.median(shares):5.1f} % of the peak")


if __name__ == "__main__":
    main()
