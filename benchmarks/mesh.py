"""Which mesh, which differences? Regime and exponent of operating points of the reference design on
finer and finer meshes.

    python benchmarks/mesh.py [--points 12] [--finest 8x96]

Points: those of docs/model.md and random ones of the plane (fixed seed). For each mesh it tells how
many regimes agree with the finest mesh, and the median and largest difference of the exponent over
points that are periodic on both. Then, at the two points near a half-speed lock, the plain and the
fitted scheme with more and more azimuths."""

import argparse
import statistics

import numpy as np

from spab_core.design.model import reference_design
from spab_core.solver.film import parse_mesh
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

MESHES = ["3x32", "4x32", "4x40", "4x48", "6x48"]
FIXED = [
    (4.52, 1.5),
    (20.0, 2.0),
    (7.0, 6.0),
    (10.0, 5.0),
    (12.0, 8.0),
    (4.52, 3.0),
    (2.0, 5.0),
    (18.0, 4.5),
    (24.0, 4.0),
    (15.0, 5.0),
]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--points", type=int, default=12, help="random points besides those of docs/model.md"
    )
    parser.add_argument("--finest", type=parse_mesh, default="8x96")
    options = parser.parse_args()
    random = np.random.default_rng(11)
    points = FIXED + [
        (random.uniform(0.1, 25.0), random.uniform(0.05, 8.5)) for _ in range(options.points)
    ]
    design = reference_design()
    answers = {}
    for mesh in [*MESHES, str(options.finest)]:
        answers[mesh] = [
            solve_point(design, *point, Settings(mesh=mesh, revolutions=300)) for point in points
        ]
    finest = answers.pop(str(options.finest))
    print(f"{len(points)} points against {options.finest}, 300 + 300 revolutions")
    for mesh, found in answers.items():
        same = [a.regime == b.regime for a, b in zip(found, finest, strict=True)]
        change = [
            abs(a.mle.value - b.mle.value)
            for a, b in zip(found, finest, strict=True)
            if a.regime and b.regime and a.regime.name == b.regime.name == "periodic"
        ]
        seconds = sum(a.trajectory.wall_seconds for a in found) / sum(
            b.trajectory.wall_seconds for b in finest
        )
        print(
            f"  {mesh:6s} regimes {sum(same)}/{len(points)}   |dMLE| median "
            f"{statistics.median(change):.4f}, largest "
            f"{max(change):.4f}   time {seconds:.2f} x"
        )
        for point, a, b, agrees in zip(points, found, finest, same, strict=True):
            if not agrees:
                texts = [p.regime.text if p.regime else p.trajectory.status for p in (a, b)]
                print(f"         {point[0]:.2f} kg, L {point[1]:.2f}: {texts[0]} for {texts[1]}")
    print("\nschemes, 4 latitudes, 300 + 200 revolutions")
    for point in FIXED[0], FIXED[5]:
        for scheme, azimuths in (("plain", (32, 64, 96, 128, 192)), ("fitted", (32, 48, 64, 96))):
            for n in azimuths:
                a = solve_point(
                    design, *point, Settings(mesh=f"4x{n}", scheme=scheme, revolutions=200)
                )
                print(
                    f"  {point[0]} kg, L {point[1]}: {scheme:6s} N = {n:3d}  {a.regime.text:14s} "
                    f"{a.mle.value:+.4f}"
                )


if __name__ == "__main__":
    main()
