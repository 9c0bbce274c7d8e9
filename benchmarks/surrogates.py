"""Seconds of training and asking surrogates, and how many times faster that is than solving the
same cells.

    python benchmarks/surrogates.py [--cells 40] [--write]

Every training is one on the shipped map from the draw of seed 0, the map predicted after it, on one
thread. ``--write`` puts the seconds into artifacts/surrogate_seconds.csv, which the page "Surrogate
map" shows."""

import argparse
import statistics
import time

import joblib
import numpy as np

from spab_core import Settings, solve_point
from spab_core.common.files import write_atomically
from spab_core.shipped.manifest import (
    ARTIFACTS,
    SECONDS,
    load_reference_map,
    load_reference_scores,
    write_manifest,
)
from spab_core.shipped.model_store import train_on_map
from spab_core.surrogates.models import DIVISORS, MODELS
from spab_core.surrogates.ranking import ranking

SEED = 11  # of the draw of the cells that are solved
DIVISOR = 2  # of the models that are asked: the largest ones
GOALS = {"training": 300.0, "map": 1.0, "point": 0.020}  # s


def timed(m, name, divisor):
    """Seconds of training and of predicting the map."""
    found = train_on_map(m, MODELS[name], divisor)
    return found.surrogate.seconds, found.predict_seconds


def train_the_papers(m, workers):
    """Wall seconds, and the seconds of each of the paper's models."""
    jobs = [
        (kind.name, divisor)
        for kind in MODELS.values()
        if kind.group == "paper"
        for divisor in DIVISORS
    ]
    with (
        joblib.parallel_config(backend="loky", inner_max_num_threads=1),
        joblib.Parallel(n_jobs=workers) as run,
    ):
        run(joblib.delayed(timed)(m, "tree", 8) for _ in range(2 * workers))  # starts the processes
        began = time.perf_counter()
        found = run(joblib.delayed(timed)(m, *job) for job in jobs)
        return time.perf_counter() - began, dict(zip(jobs, found, strict=True))


def median_seconds(function, count):
    """Median of ``count`` calls."""
    spent = []
    for _ in range(count):
        began = time.perf_counter()
        function()
        spent.append(time.perf_counter() - began)
    return statistics.median(spent)


def solve(m, cells):
    """Seconds of solving cells as the shipped map was, the kernels loaded before."""
    settings = Settings(transient=300, revolutions=300)
    solve_point(m.design, 4.0, 3.0, Settings(transient=30, revolutions=20))
    began = time.perf_counter()
    for row, column in cells:
        solve_point(m.design, float(m.rotor_mass[column]), float(m.bearing_number[row]), settings)
    return time.perf_counter() - began


def verdict(value, goal):
    """Whether a goal is met."""
    return f"goal {goal:g} s: {'met' if value <= goal else 'MISSED'}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=40, help="how many random cells are solved")
    parser.add_argument("--write", action="store_true", help=f"write artifacts/{SECONDS}")
    args = parser.parse_args()
    m = load_reference_map()

    seconds = {}
    print(
        f"The paper's {4 * len(DIVISORS)} models, trained, and the map of {m.mle.size:,} cells "
        "predicted by each"
    )
    for workers in (1, 2):
        wall, found = train_the_papers(m, workers)
        seconds = seconds or found
        print(
            f"  {workers} process{'es' if workers > 1 else ''}: {wall:6.1f} s, of which "
            f"{sum(train for train, _ in found.values()):6.1f} s training (added up over "
            f"processes); {verdict(wall, GOALS['training']) if workers == 2 else ''}"
        )

    best = ranking(load_reference_scores()).index[0]
    points = np.random.default_rng(SEED).uniform([1.0, 1.0], [8.0, 24.0], (50, 2))
    print(
        f"\n{'model':24s} {'train n/2':>10s} {'train n/8':>10s} {'map n/2':>9s} {'map n/8':>9s} "
        f"{'point n/2':>11s}"
    )
    kept = None
    for kind in MODELS.values():
        for divisor in DIVISORS:
            found = train_on_map(m, kind, divisor)
            seconds.setdefault(
                (kind.name, divisor), (found.surrogate.seconds, found.predict_seconds)
            )
            if divisor == DIVISOR:
                surrogate = found.surrogate
        asked = iter(np.tile(points, (2, 1)))
        point = median_seconds(
            lambda s=surrogate, asked=asked: s.predict(*next(asked)), len(points)
        )
        if kind.name == best:
            kept, best_point = surrogate, point
        print(
            f"{kind.label:24s}"
            + "".join(f" {seconds[kind.name, k][0]:8.2f} s" for k in (2, 8))
            + "".join(f" {seconds[kind.name, k][1]:7.3f} s" for k in (2, 8))
            + f" {1e3 * point:8.2f} ms",
            flush=True,
        )
    slow: dict[str, float] = {}
    for (name, _), (_, predict) in seconds.items():
        if predict > GOALS["map"] and name != "svr":
            slow[name] = max(slow.get(name, 0.0), predict)
    told = ", ".join(f"{MODELS[name].label} {most:.2f} s" for name, most in slow.items())
    svr = [seconds["svr", k][1] for k in DIVISORS]
    print(
        f"predicting the map: goal {GOALS['map']:g} s, SVR apart: "
        f"{f'MISSED by {told}' if told else 'met'}; SVR takes {min(svr):.2f} to {max(svr):.2f} s"
    )
    print(
        f"one point through {MODELS[best].label}, the best by RMSE, n/{DIVISOR}: "
        f"{1e3 * best_point:.2f} ms; {verdict(best_point, GOALS['point'])}"
    )

    solved = np.argwhere(np.isfinite(m.mle))
    cells = np.random.default_rng(SEED).choice(solved, args.cells, replace=False)
    number, mass = m.bearing_number[cells[:, 0]], m.rotor_mass[cells[:, 1]]
    solving = solve(m, cells)
    asking = median_seconds(lambda: kept.predict(number, mass), 20)
    whole = seconds[best, DIVISOR][1]
    print(
        f"\nsolving {args.cells} random cells (seed {SEED}, 300 + 300 revolutions): {solving:.2f} "
        f"s, {solving / args.cells:.3f} s a cell; asking {MODELS[best].label} for the same cells: "
        f"{1e3 * asking:.2f} ms, ratio {solving / asking:,.0f}"
    )
    print(
        f"one cell at a time: ratio {solving / args.cells / best_point:,.1f}; the whole map, "
        "solving extrapolated from these "
        f"cells: ratio {solving / args.cells * len(solved) / whole:,.0f}"
    )
    if args.write:
        lines = ["model,divisor,train_seconds,predict_seconds"]
        lines += [
            f"{name},{k},{seconds[name, k][0]:.4f},{seconds[name, k][1]:.4f}"
            for name in MODELS
            for k in DIVISORS
        ]
        write_atomically(ARTIFACTS / SECONDS, ("\n".join(lines) + "\n").encode())
        write_manifest()
        print(f"seconds of {len(lines) - 1} models in {ARTIFACTS / SECONDS}")


if __name__ == "__main__":
    main()
