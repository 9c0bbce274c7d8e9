"""Seconds of a live point, 200 + 200 revolutions on the mesh of the design, warm, one core: median
of five.

    python benchmarks/live.py
    python benchmarks/live.py --costs

With ``--costs``: what a revolution with tangent of an expensive point takes by method and mesh, the
least of some rounds, beside what spab_core.trajectory.expected_time tells."""

import argparse
import statistics
import time

from spab_core import Settings, reference_design, solve_point
from spab_core.solver.film import parse_mesh
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import build_system
from spab_core.trajectory.expected_time import expected_seconds

POINTS = {
    "periodic": (7.0, 6.0),
    "weakly damped": (4.52, 1.5),
    "quasi-periodic": (2.0, 5.0),
    "chaotic": (18.0, 4.5),
    "chaotic, heavy contact": (24.0, 4.0),
    "stiff": (20.0, 0.2),
}
# meshes of the costs, by method; masses and bearing numbers
COSTS = {
    "rodas": "2x16 3x16 4x16 6x16 8x16 2x24 3x24 4x24 6x24 3x32 4x32 8x32 2x48 4x48",
    "dtm": "2x16 3x16 4x16 6x16 8x16 3x24 4x24 3x32 4x32 2x48 4x48",
}
EXPENSIVE = {"rodas": ((18.0, 4.5),), "dtm": ((18.0, 4.5), (18.0, 1.5))}
SETTLE = 60


def tell_points():
    """Print how long live points take."""
    design, settings = reference_design(), Settings(transient=200, revolutions=200)
    solve_point(design, 4.0, 3.0, Settings(transient=30, revolutions=20))  # loads the kernels
    for name, (mass, number) in POINTS.items():
        runs = [
            solve_point(design, mass, number, settings, path_revolutions=30).trajectory
            for _ in range(5)
        ]
        print(
            f"{name:24s} {mass:5.2f} kg, L {number:4.2f}: "
            f"{statistics.median(r.wall_seconds for r in runs):.2f} s, {runs[0].completed} "
            f"revolutions, {runs[0].steps / runs[0].completed:.0f} steps a revolution"
        )


def tell_costs(rounds, methods):
    """Print what a revolution takes on each mesh, beside what is expected."""
    for method in methods:
        implicit = method == "rodas"
        count = 20 if implicit else 2
        options = Options(tangent=True) if implicit else Options(1e-6, tangent=True)
        for mesh in map(parse_mesh, COSTS[method].split()):
            for mass, number in EXPENSIVE[method]:
                system = build_system(reference_design(), mass, number, mesh)
                settled = build_memory(system.film)
                advance(system, settled, Options(tangent=True), 0, SETTLE, build_record(SETTLE, 0))
                found = []
                for _ in range(rounds):
                    memory = build_memory(system.film, method)
                    memory.state[:], memory.tangent[:] = settled.state, settled.tangent
                    began = time.perf_counter()
                    advance(system, memory, options, SETTLE, count, build_record(count, 0))
                    found.append((time.perf_counter() - began) / count)
                expected = expected_seconds(Settings(mesh, method, 0, 20), number) / 20
                print(
                    f"{method} {mesh} {mass:g} kg, L {number:g}: {1e3 * min(found):.3f} ms a "
                    f"revolution of {memory.control[1] / count:.0f} steps, expected "
                    f"{1e3 * expected:.3f}",
                    flush=True,
                )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--costs", action="store_true", help="by method and mesh")
    parser.add_argument("--methods", nargs="+", choices=list(COSTS), default=list(COSTS))
    parser.add_argument("--rounds", type=int, default=7)
    args = parser.parse_args()
    if args.costs:
        tell_costs(args.rounds, args.methods)
    else:
        tell_points()


if __name__ == "__main__":
    main()
