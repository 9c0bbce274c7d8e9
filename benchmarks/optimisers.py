"""Which optimiser finds the better front of drawings? Margin against gas flow of the layered
machine of 4 kg (benchmarks/drawings.py), six values that may move, predicted by linear theory.

    pip install pymoo optuna      (without them only what comes with spab is compared)
    python benchmarks/optimisers.py [--count 768] [--seeds 3]

Each method may have as many drawings predicted, for each of some seeds. Told: the area that its
front of good drawings dominates, over that of all fronts together, with the worst of all good
drawings as the corner; mean and least and most over the seeds."""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable

import joblib
import numpy as np
from drawings import RANGES, layered
from scipy.stats import qmc

from spab_core.design.tolerances import parse_range
from spab_core.drawings.improve import (
    CAPS,
    FIRST,
    POPULATION,
    PRECISION,
    REACH,
    USUAL_WISHES,
    WISHES,
    Holds,
    Space,
    _columns,
    _evolve,
    _screen_chunk,
    front_of,
)
from spab_core.drawings.look import Look

MACHINE = layered()
SPACE = Space(MACHINE, dict(parse_range(k, v, MACHINE) for k, v in RANGES.items()))
LOOK, D = Look(reach=REACH, precision=PRECISION), len(RANGES)
Found = tuple[np.ndarray, np.ndarray]  # costs (n, 2), violations (n,)


def predict(parallel: joblib.Parallel, places: np.ndarray) -> Found:
    """Costs and violations of places (n, d) of the unit cube."""
    machines = [SPACE.machine_at(place) for place in places]
    chunks = [machines[k : k + 8] for k in range(0, len(machines), 8)]
    parts = parallel(
        joblib.delayed(_screen_chunk)(k, chunk, LOOK) for k, chunk in enumerate(chunks)
    )
    rows = _columns([row for _, part in sorted(parts, key=lambda p: p[0]) for row in part])
    costs = np.column_stack([WISHES[w].cost(rows[WISHES[w].column]) for w in USUAL_WISHES])
    return costs, Holds().violation(rows)


def sobol(ask: Callable[[np.ndarray], Found], count: int, seed: int) -> None:
    ask(qmc.Sobol(D, scramble=True, seed=seed).random(count))


def evolution(ask: Callable[[np.ndarray], Found], count: int, seed: int) -> None:
    """Differential evolution of scipy with bounds of the second wish: what spab does."""
    first = qmc.Sobol(D, scramble=True, seed=seed).random(min(FIRST, count // 2))
    _evolve(first, ask, max(round((count - len(first)) / (CAPS * POPULATION)), 1), seed)


def pymoo(ask: Callable[[np.ndarray], Found], count: int, seed: int) -> None:
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Drawings(Problem):
        def __init__(self) -> None:
            super().__init__(n_var=D, n_obj=2, n_ieq_constr=1, xl=0.0, xu=1.0)

        def _evaluate(self, x, out, *args, **kwargs):
            costs, missed = ask(x)
            out["F"], out["G"] = costs, np.where(missed > 0.0, missed, -1.0)[:, None]

    minimize(Drawings(), NSGA2(pop_size=64), ("n_eval", count), seed=seed)


def optuna(ask: Callable[[np.ndarray], Found], count: int, seed: int) -> None:
    import optuna as library

    library.logging.set_verbosity(library.logging.ERROR)
    sampler = library.samplers.NSGAIISampler(
        population_size=64, seed=seed, constraints_func=lambda trial: trial.user_attrs["missed"]
    )
    study = library.create_study(directions=["minimize"] * 2, sampler=sampler)
    for _ in range(count // 64):
        trials = [study.ask() for _ in range(64)]
        x = [[trial.suggest_float(f"x{k}", 0.0, 1.0) for k in range(D)] for trial in trials]
        costs, missed = ask(np.array(x))
        for trial, cost, miss in zip(trials, costs, missed, strict=True):
            trial.set_user_attr("missed", [float(miss) if miss > 0.0 else -1.0])
            study.tell(trial, cost.tolist())


METHODS = {
    "scrambled Sobol' design": (sobol, None),
    "scipy's differential evolution": (evolution, None),
    "pymoo's NSGA-II": (pymoo, "pymoo"),
    "optuna's NSGA-II": (optuna, "optuna"),
}


def area(costs: np.ndarray, corner: np.ndarray) -> float:
    """Area between a front of rising first cost and a corner."""
    inside = costs[(costs < corner).all(axis=1)]
    front = inside[front_of(inside, np.zeros(len(inside)))]
    ends = np.append(front[1:, 0], corner[0])
    return float(np.sum((ends - front[:, 0]) * (corner[1] - front[:, 1])))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=768)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    fronts: dict[str, list[np.ndarray]] = {}
    with joblib.Parallel(n_jobs=args.workers) as parallel:
        for name, (method, needs) in METHODS.items():
            if needs and importlib.util.find_spec(needs) is None:
                print(f"{name}: {needs} is not installed")
                continue
            for seed in range(args.seeds):
                kept: list[Found] = []

                def ask(places: np.ndarray, kept: list[Found] = kept) -> Found:
                    kept.append(predict(parallel, np.asarray(places, float)))
                    return kept[-1]

                method(ask, args.count, seed)
                costs, missed = (np.concatenate(parts) for parts in zip(*kept, strict=True))
                fronts.setdefault(name, []).append(costs[missed == 0.0])
                print(f"{name}, seed {seed}: {len(costs)} predicted, {(missed == 0.0).sum()} good")
    every = np.concatenate([front for some in fronts.values() for front in some])
    corner = every.max(axis=0)
    whole = area(every, corner)
    for name, some in fronts.items():
        shares = np.array([area(front, corner) for front in some]) / whole
        print(f"{name}: {shares.mean():.4f} ({shares.min():.4f} to {shares.max():.4f})")


if __name__ == "__main__":
    main()
