"""Compile the kernels that many tests need, on two cores, each once:
``python -m tests.kernels [--quick|--oldest]``.

Kernels differ by the mesh's width, the method, whether the wall stores gas and whether the journal
moves along the axis. Two workers of pytest that come upon the same ones would both compile them.
``--quick``: without those of tests marked slow alone (``make test-python``); ``--oldest``: those of
the tests on the oldest versions (``make test-oldest``)."""

from __future__ import annotations

import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor

from spab_core.design.model import reference_design
from spab_core.linear_theory.summary import derive
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

# mesh, method, porosity, axial motion: the slowest first
QUICK = (
    ("3x16", "dtm", 0.0, False),
    ("3x16", "rodas", 0.0, True),
    ("3x16", "rodas", 0.15, False),
    ("3x24", "rodas", 0.0, False),
)
SLOW = (
    ("3x24", "rodas", 0.15, False),
    ("4x32", "rodas", 0.0, False),
    ("2x16", "dtm", 0.15, False),
    ("3x16", "rodas", 0.15, True),
)
OLDEST = (("3x16", "dtm", 0.0, False), ("4x32", "rodas", 0.0, False))


def _compile(mesh: str, method: str, porosity: float, moving: bool) -> None:
    design = reference_design().replace(bearing__porosity=porosity, rotor__axial_motion=moving)
    if method == "rodas":
        derive(design, 4.0, 3.0)
    solve_point(design, 4.0, 3.0, Settings(mesh, method, transient=30, revolutions=20))


def main() -> None:
    compile_once()
    needed = {"--oldest": OLDEST, "--quick": QUICK}.get(" ".join(sys.argv[1:]), SLOW + QUICK)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, context) as pool:
        for work in [pool.submit(_compile, *kernels) for kernels in needed]:
            work.result()


if __name__ == "__main__":
    main()
