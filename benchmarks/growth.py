"""How time grows: with the number of cells, with the mesh, and with one worker instead of two.

    python benchmarks/growth.py [--cells 24]

Cells: the same cells once, twice and four times over, so that the exponent tells overhead and not
which cells were drawn. Mesh: one periodic point, 40 revolutions with tangent, on several meshes.
Workers: the same cells with one and with two processes, in pairs, each pair back to back; medians
over pairs."""

from __future__ import annotations

import argparse
import math
import statistics
import time

import numpy as np

from spab_core import Settings, reference_design, solve_point
from spab_core.maps.compute import compute_map
from spab_core.solver.film import parse_mesh

PAPER_SECONDS = (60.0, 120.0)
MESHES = ("3x16", "3x24", "3x32", "6x16", "4x48")


def _timed(function):
    began = time.perf_counter()
    function()
    return time.perf_counter() - began


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=24, help="cells of the smallest set")
    parser.add_argument("--pairs", type=int, default=3)
    options = parser.parse_args()
    design, settings = reference_design(), Settings(revolutions=300)
    random = np.random.default_rng(1)
    cells = np.column_stack(
        [random.uniform(0.05, 8.5, options.cells), random.uniform(0.1, 25.0, options.cells)]
    )

    def solve(times):
        for _ in range(times):
            for number, mass in cells:
                solve_point(design, mass, number, settings)

    solve_point(design, 4.0, 3.0, Settings(transient=30, revolutions=20))  # loads the kernels
    times = {1: [], 2: [], 4: []}
    for _ in range(options.pairs):
        for k, found in times.items():
            found.append(_timed(lambda k=k: solve(k)))
    medians = {k: statistics.median(v) for k, v in times.items()}
    exponent = np.polyfit(np.log(list(medians)), np.log(list(medians.values())), 1)[0]
    print(
        f"cells 1x, 2x, 4x: {', '.join(f'{v:.2f}' for v in medians.values())} s, exponent "
        f"{exponent:.3f}"
    )
    mean = medians[4] / (4 * options.cells)
    print(
        f"seconds a point, one core: {mean:.3f}; the paper's own machine: {PAPER_SECONDS[0]:.0f} "
        f"to {PAPER_SECONDS[1]:.0f}"
    )

    short = {}
    for mesh in MESHES:
        s = Settings(mesh=mesh, transient=40, revolutions=40, early_stop=False)
        solve_point(design, 7.0, 6.0, s)  # loads or compiles the kernels
        points = []
        for _ in range(options.pairs):
            t = solve_point(design, 7.0, 6.0, s).trajectory
            points.append(t.wall_seconds / t.steps)
        short[mesh] = statistics.median(points)
    base = short[MESHES[0]]
    for mesh, seconds in short.items():
        times = math.prod(parse_mesh(mesh)) / math.prod(parse_mesh(MESHES[0]))
        grown = f", exponent in nodes {math.log(seconds / base, times):.2f}" if times > 1 else ""
        print(f"mesh {mesh}: {1e6 * seconds:.1f} µs a step, {seconds / base:.2f} x{grown}")

    number, mass = (
        np.linspace(0.5, 8.5, 20),
        np.linspace(1.0, 25.0, 40),
    )  # 32 chunks: the end, where one waits, is short
    compute_map(design, number[:2], mass[:2], settings, workers=2)  # starts the processes
    ratios = []
    for _ in range(2):
        one = _timed(lambda: compute_map(design, number, mass, settings, workers=1))
        two = _timed(lambda: compute_map(design, number, mass, settings, workers=2))
        ratios.append(one / two)
        print(
            f"{number.size * mass.size} cells: one worker {one:.1f} s, two {two:.1f} s, ratio "
            f"{one / two:.2f}",
            flush=True,
        )
    print(f"two workers over one: {statistics.median(ratios):.2f} x (mean of two pairs)")


if __name__ == "__main__":
    main()
