"""Cost of the parts of a step, on one core, as ratios to one evaluation of film and rotor.

python benchmarks/kernels.py
"""

import statistics
import time

import numpy as np
from numba import njit

from spab_core.design.model import reference_design
from spab_core.solver.curvature import add_curvature, prepare_curvature
from spab_core.solver.film import DEFAULT_MESH, build_film
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.rodas import rodas_step
from spab_core.solver.rotor import build_rotor
from spab_core.solver.slope import slope, slope_tangent
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System

REPEAT, ROUNDS = 500, 9


def main():
    design = reference_design()
    film = build_film(design, 4.5, DEFAULT_MESH)
    system = System(film, build_rotor(design, 18.0, 4.5))
    memory = build_memory(film)
    advance(system, memory, Options(), 0, 40, build_record(40, 0))
    u, v, work = memory.state, memory.tangent, memory.work
    a, b = np.zeros_like(u), np.zeros_like(u)
    rodas = (system, work, memory.stages, 250.0, 0.02, u, v)
    parts = {
        "slope": (slope, (system, 250.0, u, work, a)),
        "slope and its tangent": (slope_tangent, (system, 250.0, u, v, work, a, b)),
        "prepare the curvature": (prepare_curvature, (system, u, v, work)),
        "add the curvature": (add_curvature, (system, u, v, v, 1e-9, work, a)),
        "form and factorise I - g J": (linearise, (system, 0.02, u, work)),
        "solve": (solve, (system, work, a)),
        "RODAS4 step": (rodas_step, (*rodas, False)),
        "RODAS4 step with tangent": (rodas_step, (*rodas, True)),
    }
    loops = {name: (_loop(function), arguments) for name, (function, arguments) in parts.items()}
    seconds = {name: [] for name in parts}
    for _ in range(ROUNDS):
        for name, (loop, arguments) in loops.items():
            linearise(system, 0.02, u, work)
            a[:] = 0.0
            began = time.perf_counter()
            loop(arguments)
            seconds[name].append((time.perf_counter() - began) / REPEAT)
    base = statistics.median(seconds["slope"][1:])
    for name, values in seconds.items():
        print(
            f"{name:28s} {statistics.median(values[1:]) / base:6.1f} x   "
            f"{1e6 * statistics.median(values[1:]):.2f} µs"
        )


def _loop(function):
    @njit
    def loop(arguments):
        for _ in range(REPEAT):
            function(*arguments)

    return loop


if __name__ == "__main__":
    main()
