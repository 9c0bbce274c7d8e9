"""The map of My map after one minute against the solver: how many cells are worth what it says?

    python benchmarks/held_out.py [machine reference ...] [--minutes 1] [--cells 1000]
                                  [--clock wall|processor] [--folder held_out]

Two bearings with much contact and chaos: the machine of docs/margin.md from a quarter of its point,
4 kg at 20,000 rpm, to three times it, and the reference design as a design of one's own over the
usual plane. Cells drawn at random from the whole plane are solved and compared. The
share whose assessment by the motion (good, to be watched, not recommended) is that of the map is
told with its 95 % interval (Wilson); so are regime and contact, how many cells that are to be
avoided the map calls good, and how often a predicted assessment is right by its probability.

Held-out cells are kept in the folder chunk by chunk: a run that was stopped goes on from them. On a
busy machine ``--clock processor`` counts the processor time of this process and its workers, over
two, as that of two idle cores."""

import argparse
import itertools
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from scipy.stats import binomtest

from spab_core.active_learning.quick_map import SETTINGS, as_map, quick_map, usual_plane
from spab_core.common.units import from_rpm
from spab_core.design.model import reference_design
from spab_core.maps.compute import cell_solver
from spab_core.maps.stability_map import axis
from spab_core.trajectory.assessment import CONTACT, Motion, grades

CASES = ("machine", "reference")
# R 40 mm, C 25 µm, fed with 6 bar gauge, the rest of the reference
MACHINE = reference_design().replace(
    bearing__radius=0.04, bearing__clearance=25e-6, bearing__supply_pressure_ratio=7.01325 / 1.01325
)
SEED, WORKERS = 20_260, 2
SHAPE = (170, 250)
SURE = (0.0, 0.6, 0.8, 0.95, 1.0001)  # classes of the probability of the predicted assessment


def case(name):
    """Design, bearing numbers and rotor masses of a case."""
    if name == "reference":
        design = reference_design()
        return design, *(axis(text, "axis") for text in usual_plane(design))
    number, mass = MACHINE.bearing_number(from_rpm(20_000.0)), 4.0
    axes = (np.linspace(0.25, 3.0, n) * at for n, at in zip(SHAPE, (number, mass), strict=True))
    return MACHINE, *axes


def held_out(name, design, number, mass, cells, folder=None):
    """Flat indices of random cells and their solved values, by the names of a map's; kept in the
    folder, if one is given.
    """
    drawn = np.random.default_rng(SEED).permutation(number.size * mass.size)[:cells]
    done = 0

    def progress(more):
        nonlocal done
        done += more
        print(f"\r{name}: {done} of {cells} held-out cells", end="", flush=True)

    with cell_solver(
        design,
        number,
        mass,
        SETTINGS,
        checkpoint=folder and folder / name,
        chunk_cells=20,
        workers=WORKERS,
        progress=progress,
    ) as solve:
        found = solve(drawn)
    print()
    return drawn, found


class Processor:
    """Seconds that two idle cores would take for what this process and its workers have done."""

    def __init__(self):
        self.seconds = {}

    def __call__(self):
        me = psutil.Process()
        for process in (me, *me.children(recursive=True)):
            try:
                self.seconds[process.pid] = sum(process.cpu_times()[:2])
            except psutil.Error:
                continue
        here = self.seconds[me.pid]  # alone: the other core waits meanwhile
        return here + (sum(self.seconds.values()) - here) / WORKERS


def share(name, right):
    """A share in words, with its interval."""
    low, high = binomtest(int(right.sum()), right.size).proportion_ci(method="wilson")
    return f"{name} {100 * right.mean():.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def measure(name, minutes, cells, clock, folder):
    """Map one case, compare with its held-out cells; print what was found."""
    design, number, mass = case(name)
    drawn, truth = held_out(name, design, number, mass, cells, folder)
    began, told = clock(), []
    wall, first = time.perf_counter(), None
    with tempfile.TemporaryDirectory() as parts:
        for result in quick_map(
            design,
            number,
            mass,
            seconds=60.0 * minutes,
            checkpoint=Path(parts) / "parts",
            workers=WORKERS,
            tell=lambda words: told.append((clock() - began, words)),
            clock=clock,
        ):
            found, first = result, first or clock() - began
    seconds, m = clock() - began, as_map(found)
    row, column = np.unravel_index(drawn, m.shape)
    values = {key: truth[key] for key in Motion._fields}
    worth, said = grades(design, Motion(**values)), m.grades()[row, column]
    avoid, good = found.avoid[row, column], found.good[row, column]
    sure = np.choose((said == "watch") + 2 * (said == "avoid"), (good, 1.0 - good - avoid, avoid))
    predicted = ~found.solved[row, column]
    print(
        f"{name}: {seconds:.0f} s ({time.perf_counter() - wall:.0f} s of the wall), first map "
        f"after {first:.0f} s, {int(found.solved.sum()):,} of {m.mle.size:,} cells solved"
    )
    print(f"  held out: {dict(zip(*np.unique(worth, return_counts=True), strict=True))}")
    print(
        "  "
        + "; ".join(
            (
                share("assessment", said == worth),
                share("predicted ones alone", (said == worth)[predicted]),
                share("regime", m.regime[row, column] == truth["regime"]),
                share(
                    "contact",
                    (m.contact_share[row, column] > CONTACT) == (truth["contact_share"] > CONTACT),
                ),
            )
        )
    )
    print(
        f"  called good: {int((said == 'good').sum())}, of which to be avoided "
        f"{int(((said == 'good') & (worth == 'avoid')).sum())}"
    )
    for low, high in itertools.pairwise(SURE):
        those = predicted & (sure >= low) & (sure < high)
        if those.any():
            print(
                f"  probability {low:g} to {min(high, 1.0):g}: {int(those.sum())} cells, mean "
                f"{sure[those].mean():.3f}, right {(said == worth)[those].mean():.3f}"
            )
    spent = dict.fromkeys(words for _, words in told)
    ends = [*(t for t, _ in told[1:]), seconds]
    for words in spent:
        spent[words] = sum(e - t for (t, w), e in zip(told, ends, strict=True) if w == words)
    print("  " + ", ".join(f"{words} {s:.1f} s" for words, s in spent.items()), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("cases", nargs="*", default=CASES)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--cells", type=int, default=1000)
    parser.add_argument("--clock", choices=("wall", "processor"), default="wall")
    parser.add_argument("--folder", type=Path, default=Path("held_out"))
    args = parser.parse_args()
    for name in args.cases:
        clock = time.perf_counter if args.clock == "wall" else Processor()
        measure(name, args.minutes, args.cells, clock, args.folder)


if __name__ == "__main__":
    main()
