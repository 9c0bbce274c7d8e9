"""Kernels entered by many threads at once, as Streamlit does, one thread a user: the same bits, and
the process lives.

Numba's own parallel loops abort the process where two threads enter them at once; the kernels have
none."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import spab_core

# in a process of its own: an abort would take the test run with it, and no kernel is loaded yet
# when the threads start
PROGRAM = """
import sys, threading
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from spab_core import Settings, reference_design, solve_point
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.solver.film import Mesh

THREADS, design = 8, reference_design()
points = [(3.0, 2.0, "2x16", "rodas"), (5.0, 3.0, "2x16", "rodas"), (8.0, 3.5, "2x16", "rodas"),
          (18.0, 4.5, "2x16", "rodas"), (8.0, 3.5, "3x24", "rodas"), (18.0, 4.5, "3x24", "rodas"),
          (5.0, 3.0, "2x16", "dtm"), (18.0, 4.5, "2x16", "dtm")]
together = threading.Barrier(THREADS)

def solve(point):
    mass, number, mesh, method = point
    settings = Settings(mesh, method, transient=30, revolutions=20, early_stop=False)
    t = solve_point(design, mass, number, settings).trajectory
    whirls = whirl_thresholds(design, number, Mesh(2, 16)) if method == "dtm" else []
    arrays = (t.section, t.growth, t.final, [x.critical_mass for x in whirls])
    return b"".join(np.ascontiguousarray(a).tobytes() for a in arrays) + t.status.encode()

def turn(k):
    together.wait(60)  # all enter at once
    return [solve(point) for point in points[k:] + points[:k]]

with ThreadPoolExecutor(THREADS) as pool:
    found = list(pool.map(turn, range(THREADS)))
alone = [solve(point) for point in points]
assert len(set(alone)) == len(points), "the points must differ, or mixed-up work would go unseen"
for k, answers in enumerate(found):
    assert answers == alone[k:] + alone[:k], k
assert threading.active_count() == 1
print("same bits")
"""


@pytest.mark.slow
def test_eight_threads_solve_different_points_to_the_same_bits():
    path = os.pathsep.join(
        [str(Path(spab_core.__file__).parent.parent), os.environ.get("PYTHONPATH", "")]
    )
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"PYTHONPATH": path},
    )
    assert done.returncode == 0 and done.stdout == "same bits\n", (
        done.returncode,
        done.stdout,
        done.stderr[-2000:],
    )


def test_no_kernel_has_a_parallel_loop():
    sources = list(Path(spab_core.__file__).parent.rglob("*.py"))
    assert len(sources) > 100
    for source in sources:
        text = source.read_text("utf-8")
        assert "parallel=True" not in text and "prange" not in text, source.name
