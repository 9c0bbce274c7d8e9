"""How far from the hardware: useful floating-point operations a second of the film kernels over the
core's own peak.

    python benchmarks/peak.py

The peak is measured on the same core in the same run: sixteen independent chains of fused
multiply-adds on registers of eight doubles, the widest arithmetic that spab_core uses. Useful
operations are those of the formulas, counted by hand below, per node of the film (an addition,
multiplication or division is one each; sines and exponentials are left out)."""

from __future__ import annotations

import statistics
import time

import numpy as np
from numba import njit

from spab_core.design.model import reference_design
from spab_core.solver.film import DEFAULT_MESH, build_film
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.rodas import rodas_step
from spab_core.solver.rotor import build_rotor
from spab_core.solver.simd import kernel, splat, vload, vstore
from spab_core.solver.slope import slope, slope_tangent
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System

ROUNDS, REPEAT, CHAINS = 15, 400, 16
LATITUDES = DEFAULT_MESH.latitude
# one node: P, Q - 1 and its share of the force 11 (gap 2, P 1, Q 2, excess 2, two sums 4); gradient
# 2 M, gap, cube and product 5; divergence 2 M + 1; the face east 7 and its two uses 2; feed 3,
# Couette 3
SLOPE = 11 + (2 * LATITUDES + 5) + (2 * LATITUDES + 1) + 7 + 2 + 3 + 3
# the derivative along a direction: P, Q and force 11; gradient 2 M and flux 5; divergence 2 M + 1;
# face 6 and 2; feed 2, Couette 3
TANGENT = SLOPE + 11 + (2 * LATITUDES + 5) + (2 * LATITUDES + 1) + 6 + 2 + 2 + 3
# the curvature: formed once a step (a block of M columns at 20 a place, three more gradients, a
# divergence), applied at each stage
BEND, BENT = 75 + 28 * LATITUDES, 2 * LATITUDES + 13


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
    total = (
        splat(0.0) + c0 + c1 + c2 + c3 + c4 + c5 + c6 + c7 + d0 + d1 + d2 + d3 + d4 + d5 + d6 + d7
    )
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
def _steps(system, work, stages, u, v, repeat):
    for _ in range(repeat):
        rodas_step(system, work, stages, 250.0, 0.2, u, v, True)


def _elimination(film, work):
    """Operations of the factorisation and of one solve: dense blocks of M, as many as the state
    couples.
    """
    m, rows, nodes = film.latitudes, film.rows, film.columns * film.latitudes
    chain = rows - 1
    middle = chain // 2
    reach = [
        int(work.small[14]),
        chain - 1 - int(work.small[15]),
    ]  # rows from either end that answer to the separator there
    products = sum(2 * min(k, middle) + 1 + max(k - middle, 0) for k in reach)
    invert, product, times = (
        2 * 2 * m**3,
        2 * 2 * m**3,
        2 * 2 * m**2,
    )  # for the two columns of a row
    one = chain * (2 * times + 8 * m) + sum(k + 1 for k in reach) * times + 2 * (2 * m) ** 2
    factor = chain * invert + (chain - 1) * 6 * m**2 + products * product + 2 * (2 * m) ** 3
    assemble, border = nodes * (30 + 10 * m), nodes * (30 + 4 * m)
    return assemble + factor + border + 2 * (one + 5 * nodes), one + 9 * nodes


def main():
    design = reference_design()
    film = build_film(design, 4.5, DEFAULT_MESH)
    system = System(film, build_rotor(design, 18.0, 4.5))
    memory = build_memory(film)
    advance(system, memory, Options(tangent=True), 0, 40, build_record(40, 0))
    u, v, work = memory.state, memory.tangent, memory.work
    a, b = np.zeros_like(u), np.zeros_like(u)
    linearise(system, 0.05, u, work)
    array = np.full(24, 0.5)
    nodes = film.columns * film.latitudes
    factor, one = _elimination(film, work)
    film_part = (6 * TANGENT + BEND + 6 * BENT) * nodes + factor + 12 * one
    runs = {
        "peak": (_peak, (array, 100 * REPEAT), CHAINS * 16 * 100),
        "slope": (_slopes, (system, u, work, a, REPEAT), SLOPE * nodes),
        "slope and its tangent": (_tangents, (system, u, v, work, a, b, REPEAT), TANGENT * nodes),
        "form and factorise": (_factorise, (system, u, work, REPEAT), factor),
        "solve": (_solves, (system, work, a, REPEAT), one),
        "whole step with tangent": (_steps, (system, work, memory.stages, u, v, REPEAT), film_part),
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
        print(
            f"{name:24s} {statistics.median(values):6.1f} Gflop/s   "
            f"{100 * statistics.median(shares):5.1f} % of the peak"
        )


if __name__ == "__main__":
    main()
