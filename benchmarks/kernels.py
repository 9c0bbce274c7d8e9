"""Cost of the parts of a step on one core, and of those of another checkout in the same run.

    git worktree add /tmp/before 7d54606 && python benchmarks/kernels.py --against /tmp/before

Told are the least microseconds of some rounds, as ratios to one evaluation of film and rotor, and
over the other checkout's. A process for each checkout, both on their default mesh, take turns round
by round. For another processor's instructions: NUMBA_CPU_NAME=haswell NUMBA_CPU_FEATURES= and a
NUMBA_CACHE_DIR of their own."""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from numba import njit

from spab_core.design.model import reference_design
from spab_core.solver.curvature import add_curvature, prepare_curvature
from spab_core.solver.film import build_film
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.rodas import rodas_step
from spab_core.solver.rotor import build_rotor
from spab_core.solver.slope import slope, slope_tangent
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System

HERE = Path(__file__).resolve().parent.parent
REPEAT, SETTLE = 300, 40


def build_parts():
    """What is timed: (name, function, arguments)."""
    design = reference_design()
    film = build_film(design, 4.5)
    system = System(film, build_rotor(design, 18.0, 4.5))
    memory = build_memory(film)
    advance(system, memory, Options(tangent=True), 0, SETTLE, build_record(SETTLE, 0))
    u, v, work = memory.state, memory.tangent, memory.work
    a, b = np.zeros_like(u), np.zeros_like(u)
    rodas = (system, work, memory.stages, 250.0, 0.02, u, v)
    linearise(system, 0.02, u, work)
    return [
        ("slope", slope, (system, 250.0, u, work, a)),
        ("slope and its tangent", slope_tangent, (system, 250.0, u, v, work, a, b)),
        ("form and factorise I - g J", linearise, (system, 0.02, u, work)),
        ("solve", solve, (system, work, np.zeros_like(u))),
        ("prepare the curvature", prepare_curvature, (system, u, v, work)),
        ("add the curvature", add_curvature, (system, u, v, v, 1e-9, work, np.zeros_like(u))),
        ("RODAS4 step", rodas_step, (*rodas, False)),
        ("RODAS4 step with tangent", rodas_step, (*rodas, True)),
    ]


def _loop(function):
    @njit
    def loop(arguments):
        for _ in range(REPEAT):
            function(*arguments)

    return loop


def take_turns():
    """Answer each line of the input by the microseconds of all parts, a line of JSON."""
    loops = [(name, _loop(function), arguments) for name, function, arguments in build_parts()]
    for _, loop, arguments in loops:
        loop(arguments)
    print("ready", flush=True)
    for _ in sys.stdin:
        found = {}
        for name, loop, arguments in loops:
            began = time.perf_counter()
            loop(arguments)
            found[name] = 1e6 * (time.perf_counter() - began) / REPEAT
        print(json.dumps(found), flush=True)


def start(checkout):
    """A process that takes turns with the code of a checkout, once it has compiled."""
    process = subprocess.Popen(
        [sys.executable, __file__, "--turns"],
        cwd=checkout,
        env=os.environ | {"PYTHONPATH": str(checkout)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    process.stdout.readline()
    return process


def ask(process):
    """One round of a process."""
    process.stdin.write("\n")
    process.stdin.flush()
    return json.loads(process.stdout.readline())


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--turns", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.turns:
        take_turns()
        return
    checkouts = [HERE] + ([args.against.resolve()] if args.against else [])
    processes = [start(checkout) for checkout in checkouts]
    rounds = [[ask(process) for process in processes] for _ in range(args.rounds)]
    for process in processes:
        process.stdin.close()
        process.wait()
    least = [
        {name: min(found[name] for found in column) for name in column[0]}
        for column in zip(*rounds, strict=True)
    ]
    for name, ours in least[0].items():
        line = f"{name:28s} {ours / least[0]['slope']:6.1f} x slope {ours:9.2f} µs"
        if args.against:
            line += f"   {least[1][name]:9.2f} µs there, ratio {ours / least[1][name]:.3f}"
        print(line)


if __name__ == "__main__":
    main()
