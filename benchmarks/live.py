"""Seconds of a live point, 200 + 200 revolutions on the default mesh, warm, one core: median of
five.

python benchmarks/live.py
"""

import statistics

from spab_core import Settings, reference_design, solve_point

POINTS = {
    "periodic": (7.0, 6.0),
    "weakly damped": (4.52, 1.5),
    "quasi-periodic": (2.0, 5.0),
    "chaotic": (18.0, 4.5),
    "chaotic, heavy contact": (24.0, 4.0),
    "stiff": (20.0, 0.2),
}


def main():
    design, settings = reference_design(), Settings(transient=200, revolutions=200)
    solve_point(design, 4.0, 3.0, Settings(transient=20, revolutions=20))  # loads the kernels
    for name, (mass, number) in POINTS.items():
        runs = [
            solve_point(design, mass, number, settings, path_revolutions=30).trajectory
            for _ in range(5)
        ]
        print(
            f"{name:24s} {mass:5.2f} kg, L {number:4.2f}: "
            f"{statistics.median(r.wall_seconds for r in runs):.2f} s, "
            f"{runs[0].completed} revolutions, {runs[0].steps / runs[0].completed:.0f} steps a "
            "revolution"
        )


if __name__ == "__main__":
    main()
