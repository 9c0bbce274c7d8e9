"""Which tolerance? Random points of the plane at several tolerances against a tight one.

    python benchmarks/tolerance.py [--points 90] [--tolerances 1.5e-3 3e-3]

300 + 300 revolutions with early stop on the default mesh. Exponents are compared over points that
settle on a periodic orbit in both runs: there they have no statistical error."""

import argparse

import numpy as np

from spab_core import Settings, reference_design, solve_point
from spab_core.solver.stepping import DEFAULT_TOLERANCE

TIGHT = 1e-5


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=90)
    parser.add_argument(
        "--tolerances",
        type=float,
        nargs="+",
        default=[DEFAULT_TOLERANCE * k for k in (0.5, 1.0, 2.0)],
    )
    options = parser.parse_args()
    random = np.random.default_rng(11)
    points = [(random.uniform(0.1, 25.0), random.uniform(0.05, 8.5)) for _ in range(options.points)]
    design = reference_design()

    def solve(tolerance):
        return [
            solve_point(design, *point, Settings(revolutions=300, tolerance=tolerance))
            for point in points
        ]

    tight = solve(TIGHT)
    for tolerance in options.tolerances:
        found = solve(tolerance)
        change = [
            abs(a.mle.value - b.mle.value)
            for a, b in zip(found, tight, strict=True)
            if a.trajectory.settled and b.trajectory.settled
        ]
        steps = np.mean([a.trajectory.steps / a.trajectory.completed for a in found])
        print(
            f"tolerance {tolerance:.2g}: {steps:.1f} steps a revolution; |dMLE| median "
            f"{np.median(change):.5f}, eight in ten {np.quantile(change, 0.8):.5f}, largest "
            f"{max(change):.5f} ({len(change)} periodic points)",
            flush=True,
        )
        for point, a, b in zip(points, found, tight, strict=True):
            names = [p.regime.text if p.regime else p.trajectory.status for p in (a, b)]
            if names[0] != names[1]:
                print(f"    {point[0]:.2f} kg, L {point[1]:.2f}: {names[0]} for {names[1]}")


if __name__ == "__main__":
    main()
