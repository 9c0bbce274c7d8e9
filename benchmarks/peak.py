"""How far from the hardware: useful floating-point operations a second of the film kernels over the
core's own peak.

    python benchmarks/peak.py [--mesh 3x16]

The peak is measured on the same core in the same run, as the better of sixteen and of four
independent chains of fused multiply-adds on groups of eight doubles, the widest arithmetic that
spab_core uses: AVX-512 has a register for each of sixteen, AVX2 two for each of four. Useful
operations are those of the formulas, counted by hand in :class:`Operations` (an addition,
multiplication or division is one each; the rotor, sines, exponentials and what is of single numbers
are left out)."""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
from numba import njit

from spab_core.design.model import reference_design
from spab_core.solver.film import AUTO, build_film, parse_mesh
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.rodas import rodas_step
from spab_core.solver.rotor import build_rotor
from spab_core.solver.simd import kernel, load, splat, store
from spab_core.solver.slope import slope, slope_tangent
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System

ROUNDS, REPEAT, CHAINS, FEW = 15, 400, 16, 4
EIGHT = (0,)


class Operations:
    """Operations on a mesh of M x N.

    A sum over latitudes is 2 M - 1 at each of the M N nodes. A derivative around is a circulant
    matrix: :func:`spab_core.solver.simd.turn` splits the latitude into sums and differences of
    opposite azimuths, N, takes two products of half the size, 2 (N/2)² each, and joins them, N;
    where N is no multiple of sixteen it is one product, 2 N². Other products of a matrix N x N with
    a vector are 2 N², with a matrix 2 N³, and so is an inverse."""

    def __init__(self, m, n):
        nodes, square, cube = m * n, 2 * n * n, 2 * n**3
        turn = m * (n * n + 2 * n if n % 16 == 0 else square)
        reach, force = 6 * n, 4 * n  # of the journal to azimuths and faces; sums with cos and sin
        # at the azimuths: H 2, P 1, Q - 1 2, its share of the force 3, H of the face 2, its flux 4;
        # across: sum, H³ 4, flux 1; gain: sum, around 1, feed 3, Couette 1
        azimuth, latitude, gain = 14, 2 * m - 1 + 5, 2 * m - 1 + 5
        self.slope = nodes * (azimuth + latitude + gain) + 3 * turn + reach + force
        # dP 4, dQ 2, force 2, dH of the face 1, flux 4; sum, dH 1, flux 4; sum, around 1, feed 2,
        # Couette 1
        azimuth, latitude, gain = 13, 2 * m - 1 + 5, 2 * m - 1 + 4
        self.tangent = self.slope + nodes * (azimuth + latitude + gain) + 3 * turn + reach + force
        # P along the tangent 4, Q 2; the gradients
        self.prepare = nodes * (6 + 2 * m - 1) + turn + reach
        # dH twice 2, dP 3, d²P 4, dQ 2, d²Q 4, force 2; at the face H 2, dH 2, d²(H³ g) 13, flux 1;
        # across the same 17 and two sums; gain: sum, around 1, feed 2, added 2
        azimuth, latitude, gain = 35, 2 * (2 * m - 1) + 17, 2 * m - 1 + 5
        self.curvature = nodes * (azimuth + latitude + gain) + 3 * turn + reach + force
        # forward through the latitudes and back: M + 1 products with the inverses, as many with
        # what is left between latitudes from the second on as there are pairs of these, twice
        pairs = (m - 1) * (m - 2)
        film = (m + 1 + pairs) * square + n * (4 * (m - 1) + pairs + 1)
        self.solve = film + 3 * nodes + force + 4 * nodes  # force, and the journal's two columns
        # point: H, 1/H, P, dQ/dS, Q - 1 8, force 3, sum, gradients; three second moments
        point = nodes * (11 + 2 * m - 1) + turn + reach + 9 * n
        # a block of a latitude: seven harmonics 13, dQ/dS 1, Couette 2; between latitudes a cubic
        assemble = m * n * n * 16 + m * m * n * 8
        # M inverses; the first latitude leaves diagonals times its inverse times diagonals; the
        # others, j of them left: j products for what they answer, j² for what stays
        inverses = m + (m - 2) * (m - 1) * m // 3
        eliminate = inverses * cube + (m - 1) ** 2 * square + (m - 1) * n * n
        # the film per displacement: dQ 3, at the face 9, across 8 and sum, gain: sum and 3
        column = nodes * (20 + 2 * (2 * m - 1) + 3) + 2 * turn + reach
        border = 2 * (column + film + 3 * nodes + force)
        self.linearise = point + assemble + eliminate + border
        # sums of stages, state and tangent: where it is evaluated 20 + 1, its right side 36, its
        # end 1; the time's share 12; both norms 9
        sums = nodes * (2 * 58 + 12 + 9)
        self.step = (
            self.linearise
            + self.prepare
            + 6 * (self.tangent + self.curvature)
            + 12 * self.solve
            + sums
        )


@kernel
def _peak(array, repeat):
    a, b = load(array, 0, EIGHT), load(array, 8, EIGHT)
    c0, c1, c2, c3, c4, c5, c6, c7 = a, b, a + b, a - b, a * b, a + a, b + b, a * a
    d0, d1, d2, d3, d4, d5, d6, d7 = b, a, b + a, b - a, b * a, b + 2.0, a + 2.0, b * b
    for _ in range(repeat):
        c0, c1, c2, c3 = c0 * a + b, c1 * a + b, c2 * a + b, c3 * a + b
        c4, c5, c6, c7 = c4 * a + b, c5 * a + b, c6 * a + b, c7 * a + b
        d0, d1, d2, d3 = d0 * a + b, d1 * a + b, d2 * a + b, d3 * a + b
        d4, d5, d6, d7 = d4 * a + b, d5 * a + b, d6 * a + b, d7 * a + b
    total = (
        splat(0.0, EIGHT)
        + c0
        + c1
        + c2
        + c3
        + c4
        + c5
        + c6
        + c7
        + d0
        + d1
        + d2
        + d3
        + d4
        + d5
        + d6
        + d7
    )
    store(array, 16, total)


@kernel
def _peak_of_few(array, repeat):
    a, b = load(array, 0, EIGHT), load(array, 8, EIGHT)
    c0, c1, c2, c3 = a, b, a + b, a - b
    for _ in range(repeat):
        c0, c1, c2, c3 = c0 * a + b, c1 * a + b, c2 * a + b, c3 * a + b
    store(array, 16, c0 + c1 + c2 + c3)


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


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", type=parse_mesh, default=AUTO)
    design = reference_design()
    film = build_film(design, 4.5, parser.parse_args().mesh)
    system = System(film, build_rotor(design, 18.0, 4.5))
    memory = build_memory(film)
    advance(system, memory, Options(tangent=True), 0, 40, build_record(40, 0))
    u, v, work = memory.state, memory.tangent, memory.work
    a, b = np.zeros_like(u), np.zeros_like(u)
    linearise(system, 0.05, u, work)
    array = np.full(24, 0.5)
    count = Operations(film.latitudes, film.columns)
    runs = {
        "sixteen chains": (_peak, (array, 100 * REPEAT), CHAINS * 16 * 100),
        "four chains": (_peak_of_few, (array, 100 * REPEAT), FEW * 16 * 100),
        "slope": (_slopes, (system, u, work, a, REPEAT), count.slope),
        "slope and its tangent": (_tangents, (system, u, v, work, a, b, REPEAT), count.tangent),
        "form and factorise": (_factorise, (system, u, work, REPEAT), count.linearise),
        "solve": (_solves, (system, work, a, REPEAT), count.solve),
        "whole step with tangent": (
            _steps,
            (system, work, memory.stages, u, v, REPEAT),
            count.step,
        ),
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
    peak = max(("sixteen chains", "four chains"), key=lambda name: statistics.median(rates[name]))
    for name, values in rates.items():
        shares = [value / top for value, top in zip(values, rates[peak], strict=True)]
        print(
            f"{name:24s} {runs[name][2]:7d} operations {statistics.median(values):6.1f} Gflop/s "
            f"{100 * statistics.median(shares):5.1f} % of the peak"
        )


if __name__ == "__main__":
    main()
