"""The table of linear theory that My map needs: as it was before the first cell, and as it is now.

    python benchmarks/linear_table.py [--nodes 32 25] [preset ...]

Old: all nodes one after the other, the linear algebra on as many threads as it takes. New: rows in
two processes, the linear algebra of each on one thread. Both on the nodes of My map, in one run;
times are the wall's and the processors', of a warm pool. Then eigenvalues of a node: all of them on
one thread over Arnoldi iterations (ARPACK) on the factorised matrix about real shifts, and in how
many nodes of a coarse table these miss the leading one."""

import argparse
import time

import numpy as np
import psutil
import scipy.linalg
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs
from threadpoolctl import threadpool_limits

from spab_core.active_learning.quick_map import SETTINGS, TABLE_NODES, usual_plane
from spab_core.design.presets import PRESETS
from spab_core.linear_theory.equilibrium import dense_system, find_equilibrium
from spab_core.linear_theory.linear_table import COLUMNS, MESH, linear_table
from spab_core.linear_theory.parallel_table import table_by_rows
from spab_core.maps.parallel import cluster_or_processes
from spab_core.maps.stability_map import axis
from spab_core.solver.slope import slope_and_jacobian

WORKERS, SHIFTS, SOUGHT, KRYLOV = 2, (0.0, 1.0), 6, 24
COARSE = (8, 6)


def processor():
    """Processor seconds of this process and its children."""
    me = psutil.Process()
    return sum(sum(p.cpu_times()[:2]) for p in (me, *me.children(recursive=True)))


def timed(work):
    """The result and how long it took: wall and processors."""
    wall, spent = time.perf_counter(), processor()
    result = work()
    return result, time.perf_counter() - wall, processor() - spent


def tables(design, plane, nodes):
    """Old table over new: seconds of both."""
    linear_table(design, plane, (2, 2))
    old, *before = timed(lambda: linear_table(design, plane, nodes))
    with cluster_or_processes(WORKERS, SETTINGS) as run:
        table_by_rows(design, plane, (8, 2), run)  # processes start
        new, *after = timed(lambda: table_by_rows(design, plane, nodes, run))
    apart = max(
        np.abs(getattr(old, name) - getattr(new, name)).max() / np.abs(getattr(old, name)).max()
        for name in COLUMNS
    )
    print(
        f"  table of {nodes[0]} x {nodes[1]} nodes: wall {before[0]:.1f} s over "
        f"{after[0]:.1f} s = {before[0] / after[0]:.1f}; processors {before[1]:.1f} s over "
        f"{after[1]:.1f} s = {before[1] / after[1]:.1f}; largest difference {apart:.1e}"
    )


def _leading(jacobian, shift):
    """Leading eigenvalue by Arnoldi iterations about a shift."""
    n = len(jacobian)
    factors = scipy.linalg.lu_factor(jacobian - shift * np.eye(n), check_finite=False)
    inverse = LinearOperator(
        (n, n), lambda x: scipy.linalg.lu_solve(factors, x, check_finite=False), dtype=float
    )
    values = eigs(inverse, SOUGHT, ncv=KRYLOV, return_eigenvectors=False, tol=1e-8)
    return max((shift + 1.0 / values).real)


def eigenvalues(design, plane):
    """All eigenvalues over Arnoldi iterations, and how often those miss the leading one."""
    spent, missed, nodes = dict.fromkeys(("all", *SHIFTS), 0.0), dict.fromkeys(SHIFTS, 0), 0
    for b in np.geomspace(*plane[0], COARSE[0]):
        for kg in np.linspace(*plane[1], COARSE[1]):
            system = dense_system(design, float(kg), float(b), MESH)
            rest = find_equilibrium(system)
            if rest is None:
                continue
            unknowns, nodes = system.unknowns, nodes + 1
            jacobian = slope_and_jacobian(system, rest.state, unknowns)[1][unknowns]
            began = time.thread_time()
            exact = np.linalg.eigvals(jacobian).real.max()
            spent["all"] += time.thread_time() - began
            for shift in SHIFTS:
                began = time.thread_time()
                try:
                    found = _leading(jacobian, shift)
                except ArpackNoConvergence:
                    found = np.inf
                spent[shift] += time.thread_time() - began
                missed[shift] += not np.isclose(found, exact, rtol=1e-5, atol=1e-8)
    for shift in SHIFTS:
        print(
            f"  a node: all eigenvalues {1e3 * spent['all'] / nodes:.2f} ms over Arnoldi about "
            f"{shift:g} {1e3 * spent[shift] / nodes:.2f} ms = {spent['all'] / spent[shift]:.1f}; "
            f"that misses the leading one in {missed[shift]} of {nodes} nodes"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("presets", nargs="*", default=list(PRESETS))
    parser.add_argument("--nodes", nargs=2, type=int, default=TABLE_NODES)
    args = parser.parse_args()
    for name in args.presets:
        design = PRESETS[name].design
        ends = [axis(text, "axis") for text in usual_plane(design)]
        plane = tuple((float(values[0]), float(values[-1])) for values in ends)
        print(name, flush=True)
        tables(design, plane, tuple(args.nodes))
        with threadpool_limits(1):
            eigenvalues(design, plane)


if __name__ == "__main__":
    main()
