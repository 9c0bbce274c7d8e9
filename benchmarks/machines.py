"""How far answers on another processor may lie apart: the same points compiled for this processor
and for any x86-64.

    python benchmarks/machines.py

A processor without fused multiply-add, or another width of vector, rounds differently; so may
another mathematical library. Numba is told to compile for the oldest x86-64
(NUMBA_CPU_NAME=generic), in a process and a cache of its own: about two minutes. Periodic points
agree to the tolerance of the step, an exponent of a torus or of chaos within its standard error,
because there two runs that differ by one rounding part for good."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

POINTS = [
    (1.0, 0.5),
    (3.0, 2.0),
    (5.0, 3.0),
    (4.52, 3.45),
    (8.0, 3.5),
    (12.0, 3.45),
    (18.0, 4.5),
    (20.0, 6.0),
    (24.0, 8.0),
]


def answers() -> list[dict]:
    """The points (rotor mass in kg, bearing number) solved here, as ``OperatingPoint.record`` has
    them.
    """
    from spab_core import Settings, reference_design, solve_point

    how = Settings("2x16", transient=200, revolutions=300)
    return [solve_point(reference_design(), *point, how).record() for point in POINTS]


def elsewhere(**variables: str) -> list[dict]:
    """The same in a process of its own, with these environment variables."""
    root = str(Path(__file__).resolve().parent.parent)
    done = subprocess.run(
        [sys.executable, __file__, "--answers"],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": root} | variables,
    )
    return json.loads(done.stdout)


def main() -> None:
    """Print both answers of every point and how far they lie apart."""
    here = elsewhere()
    with tempfile.TemporaryDirectory() as folder:
        there = elsewhere(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=folder)
    print(
        "rotor mass, bearing number: regime and MLE here; there; difference, in standard errors "
        "of a difference"
    )
    for (mass, number), a, b in zip(POINTS, here, there, strict=True):
        if a["regime"] is None or b["regime"] is None:
            print(f"{mass:5.2f} {number:5.2f}: {a['status']}; {b['status']}")
            continue
        apart = b["mle_per_revolution"] - a["mle_per_revolution"]
        error = (a["mle_standard_error"] ** 2 + b["mle_standard_error"] ** 2) ** 0.5
        print(
            f"{mass:5.2f} {number:5.2f}: {a['regime']}-{a['period']} "
            f"{a['mle_per_revolution']:+.6f}; "
            f"{b['regime']}-{b['period']} {b['mle_per_revolution']:+.6f}; {apart:+.1e}, "
            f"{abs(apart) / max(error, 1e-12):.2f}"
            f"{'' if a['regime'] == b['regime'] else '  ANOTHER REGIME'}"
        )


if __name__ == "__main__":
    if "--answers" in sys.argv:
        print(json.dumps(answers()))
    else:
        main()
