"""The wall's cells: how they are found, and the flow that they let through against the exact one;
and what a step costs on a wall that stores gas, over one that does not, in one run.

    python benchmarks/wall.py            # error of the cells in use, of equal ones, and costs
    python benchmarks/wall.py --find     # find the cells: a minute or two

At one node of the wall, a small oscillation at the whirl ratio nu: the flow over the quasi-steady
one is x coth x with x² = -i nu sigma_w / P. The cells' is a continued fraction in x², as long as
there are cells (docs/numerics.md)."""

import argparse
import time

import numpy as np
from numba import njit
from scipy.optimize import least_squares

from spab_core.design.presets import preset
from spab_core.solver.film import Mesh, build_film
from spab_core.solver.rodas import rodas_step
from spab_core.solver.rotor import build_rotor
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System
from spab_core.solver.wall import SHARE, SPACING

HIGHEST = 4e4  # nu sigma_w / P
WORKING = 300.0  # where the walls that are made work at the whirl: the spindles' at some 100
REPEAT, ROUNDS = 200, 40


def exact(s):
    """x coth x for x² = s."""
    x = np.sqrt(s)
    return x / np.tanh(x)


def through(spacing, share, s):
    """Flow through cells over the quasi-steady one, at s = x²."""
    admittance = s * share[-1] + 1.0 / spacing[-1]
    for cell, distance in zip(share[-2::-1], spacing[-2:0:-1], strict=True):
        admittance = s * cell + 1.0 / (distance + 1.0 / admittance)
    return 1.0 / (spacing[0] + 1.0 / admittance)


def error(spacing, share, highest=HIGHEST):
    """Largest error of the flow, over its size, from nu sigma_w / P = 0.01 on."""
    s = -1j * np.geomspace(1e-2, highest, 600)
    return np.abs(through(spacing, share, s) / exact(s) - 1.0).max()


def geometric(count, first):
    """Cells that grow from ``first`` of the thickness by one ratio, pressures at their middles."""
    ratios = np.linspace(1.0, 40.0, 400_000)
    sums = first * (ratios**count - 1.0) / np.maximum(ratios - 1.0, 1e-12)
    share = first * ratios[np.searchsorted(sums, 1.0)] ** np.arange(count)
    share /= share.sum()
    middles = np.cumsum(share) - 0.5 * share
    return np.diff([0.0, *middles, 1.0]), share


def decays(spacing, share):
    """Rates at which the cells' pressures decay under a held film, over the wall's, n² pi²."""
    inverse = 1.0 / spacing
    matrix = np.diag(inverse[:-1] + inverse[1:])
    matrix -= np.diag(inverse[1:-1], 1) + np.diag(inverse[1:-1], -1)
    rates = np.sort(np.linalg.eigvals(matrix / share[:, None]).real)
    return rates / (np.pi * np.arange(1, len(share) + 1)) ** 2


def find(count, highest=HIGHEST):
    """Cells with the least largest error of the flow, twice as small up to ``WORKING``, and of the
    slowest decay by half and the next by a tenth: least squares of rising powers of the errors.
    """
    s = -1j * np.geomspace(0.05, highest, 240)
    wanted, weight = exact(s), np.where(np.abs(s) < WORKING, 2.0, 1.0)

    def cells(p):
        p = np.exp(np.clip(p - p.max(), -30.0, 0.0))
        spacing, share = p[: count + 1], p[count + 1 :]
        return spacing / spacing.sum(), share / share.sum()

    def errors(p):
        flow = weight * np.abs(through(*cells(p), s) / wanted - 1.0)
        return np.append(flow, (0.5, 0.1) * np.abs(decays(*cells(p))[:2] - 1.0))

    growing = np.geomspace(highest**-0.5, 1.0, count + 1)
    p = np.log(np.concatenate([growing, np.sqrt(growing[1:] * growing[:-1])]))
    for power in (1, 2, 4, 8, 16):
        largest = errors(p).max()
        p = least_squares(lambda q, k=power, r=largest: (errors(q) / r) ** k, p, max_nfev=800).x
    return cells(p)


def step_costs():
    """Least microseconds of a step by porosity and whether it has a tangent, in turns."""
    spindle = preset("fed_spindle").design
    loops = []
    for porosity in (0.0, 0.15):
        for tangent in (False, True):
            design = spindle.replace(bearing__porosity=porosity)
            film = build_film(design, 5.87, Mesh(4, 16))
            system = System(film, build_rotor(design, 1.0, 5.87))
            memory = build_memory(film)
            advance(system, memory, Options(tangent=True), 0, 40, build_record(40, 0))

            @njit
            def loop(system, work, stages, u, v, tangent):
                for _ in range(REPEAT):
                    rodas_step(system, work, stages, 250.0, 0.02, u, v, tangent)

            arguments = (system, memory.work, memory.stages, memory.state, memory.tangent, tangent)
            loop(*arguments)
            loops.append(((porosity, tangent), loop, arguments))
    least = {}
    for _ in range(ROUNDS):
        for name, loop, arguments in loops:
            began = time.perf_counter()
            loop(*arguments)
            spent = 1e6 * (time.perf_counter() - began) / REPEAT
            least[name] = min(least.get(name, np.inf), spent)
    return least


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--find", action="store_true", help="find cells, 6 to 9 of them")
    if parser.parse_args().find:
        for count in (6, 7, 8, 9):
            spacing, share = find(count)
            first, second = decays(spacing, share)[:2]
            print(
                f"{count} cells: largest error {100 * error(spacing, share):.2f} %, slowest decays"
            )
            print(f"  {first:.3f}, {second:.3f} of the wall's")
            print("  spacing", ", ".join(f"{v:.6f}" for v in spacing))
            print("  share  ", ", ".join(f"{v:.6f}" for v in share))
        return
    print(f"largest error of the flow up to nu sigma_w / P = {HIGHEST:g}:")
    used = np.array(SPACING), np.array(SHARE)
    first, second = decays(*used)[:2]
    print(f"  {len(SHARE)} cells in use: {100 * error(*used):.2f} %; their slowest decays are")
    print(f"  {first:.3f} and {second:.3f} of the wall's")
    for count in (8, 16, 32):
        best = min(error(*geometric(count, first)) for first in np.geomspace(1e-4, 0.02, 24))
        print(f"  {count} cells that grow by one ratio, the best: {100 * best:.2f} %")
    costs = step_costs()
    for tangent, name in ((False, "a step"), (True, "a step with tangent")):
        without, storing = costs[0.0, tangent], costs[0.15, tangent]
        ratio = storing / without
        print(f"{name}: {without:.2f} µs, with storage {storing:.2f}, {ratio:.2f} times")


if __name__ == "__main__":
    main()
