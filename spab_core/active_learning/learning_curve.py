"""What refining saves: errors over the number of solved cells, chosen by
:mod:`spab_core.active_learning.refine` or drawn at random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.metrics import f1_score

from spab_core.active_learning.committee import exponent_scores, plane_inputs, predict_plane, scores
from spab_core.active_learning.oracles import map_oracle
from spab_core.active_learning.refine import START, refine
from spab_core.common.errors import InputError
from spab_core.common.paths import HOME
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.models import MODELS, linear_table_of, train

DIVISORS = (64, 32, 16, 8, 4)  # n/64 ... n/4 solved cells
SEEDS = (10, 11, 12, 13, 14)  # not those looked at when refining was set up
WITHHELD = 5  # every WITHHELD-th cell, at random, neither strategy may solve in the second study
WITHHELD_DIVISORS = (64, 32, 16)  # of refining there
SLOW = ("svr", "mlp")  # worse than any other model by far, and the SVR takes half a minute a map
COMMITTEE = "committee"
CHAOTIC_MLE = 0.01  # smallest exponent called chaotic, as in spab_core.trajectory.regimes
LEARNING_CURVE = HOME / "docs" / "learning_curve.csv"
COLUMNS = (
    "strategy",
    "model",
    "judged",
    "divisor",
    "solved",
    "seed",
    "rmse",
    "rmse_undamped",
    "mae",
    "accuracy",
    "chaos_f1",
)
METRICS = COLUMNS[6:]
GOAL = (16, 4)  # refined n/16 against random n/4


def learning_curve(
    m: StabilityMap,
    seeds: Sequence[int] = SEEDS,
    models: Sequence[str] | None = None,
    progress: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """Compare the errors of refining with those of as many cells drawn at random.

    Parameters
    ----------
    m : StabilityMap
        Solved; at least ``16 START`` cells.
    seeds : sequence of int
    models : sequence of str, optional
        Names of ``MODELS`` judged on random draws; left out: all but :data:`SLOW`.
    progress : callable
        Called with the number of seeds done since the last call.

    Returns
    -------
    DataFrame
        One row a prediction, columns :data:`COLUMNS`. ``strategy``: ``refine`` or ``random``.
        ``model``: ``committee``, the trees of
        :func:`spab_core.active_learning.committee.predict_plane`, or a name of ``MODELS`` (random
        draws of n/4 only; chaos is where it predicts an exponent over :data:`CHAOTIC_MLE`).
        ``judged``: ``unsolved``, on all cells not solved, other cells for each strategy; or
        ``withheld``, on a random fifth of the cells that neither strategy may solve.

    Raises
    ------
    InputError
        If the map has too few cells.
    """
    if m.mle.size < 16 * START:
        raise InputError(
            f"a map of {m.mle.size} cells is too small for a learning curve: at least "
            f"{16 * START} are needed"
        )
    names = [name for name in MODELS if name not in SLOW] if models is None else list(models)
    rows = []
    for seed in seeds:
        rows += [dict(zip(COLUMNS, row, strict=True)) for row in _one_seed(m, seed, names)]
        if progress:
            progress(1)
    return pd.DataFrame(rows)


def _one_seed(m: StabilityMap, seed: int, names: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    count = m.mle.size
    sizes = {divisor: count // START * (START // divisor) for divisor in DIVISORS}
    rng = np.random.default_rng([seed, 2])
    order = rng.permutation(count)
    withheld = np.zeros(count, bool)
    withheld[rng.permutation(count)[: count // WITHHELD]] = True
    table = linear_table_of(m)
    inputs = plane_inputs(m.bearing_number, m.rotor_mass, table)
    for judged, allowed, divisors in (
        ("unsolved", np.ones(count, bool), DIVISORS),
        ("withheld", ~withheld, WITHHELD_DIVISORS),
    ):
        found = {}
        for r in refine(
            m.bearing_number,
            m.rotor_mass,
            map_oracle(m),
            sizes[divisors[-1]],
            seed,
            allowed=allowed.reshape(m.shape),
            table=table,
        ):
            solved = r.solved.ravel()
            cells = withheld if judged == "withheld" else ~solved
            found[int(solved.sum())] = scores(m, r.mle, r.regime, cells)
        for divisor in divisors:
            size = sizes[divisor]
            yield "refine", COMMITTEE, judged, divisor, size, seed, *found[size].values()
        drawn = order[allowed[order]]
        for divisor in DIVISORS:
            size, solved = sizes[divisor], np.zeros(count, bool)
            solved[drawn[:size]] = True
            cells = withheld if judged == "withheld" else ~solved
            prediction = predict_plane(inputs, solved, m.mle.ravel(), m.regime.ravel(), seed)
            errors = scores(m, prediction.mle, prediction.regime, cells)
            yield "random", COMMITTEE, judged, divisor, size, seed, *errors.values()
        for name in names:  # on the largest random set, the last
            errors_of = _model_scores(m, name, solved, cells, seed)
            yield "random", name, judged, divisor, size, seed, *errors_of


def _model_scores(
    m: StabilityMap, name: str, solved: np.ndarray, cells: np.ndarray, seed: int
) -> tuple[Any, ...]:
    number, mass = (
        np.repeat(m.bearing_number, len(m.rotor_mass)),
        np.tile(m.rotor_mass, len(m.bearing_number)),
    )
    known = solved & np.isfinite(m.mle.ravel())
    surrogate = train(
        MODELS[name], np.column_stack([number, mass])[known], m.mle.ravel()[known], seed
    )
    predicted = surrogate.predict(number, mass)
    return (
        *exponent_scores(m, predicted, cells).values(),
        np.nan,  # exponents alone do not tell periodic from quasi-periodic
        f1_score(
            m.regime.ravel()[cells] == "chaotic",
            predicted[cells] > CHAOTIC_MLE,
            zero_division=np.nan,
        ),
    )


def load_learning_curve(path: Path) -> pd.DataFrame:
    """Read the rows that ``python benchmarks/learning_curve.py`` wrote.

    Raises :class:`InputError` if they cannot be read.
    """
    try:
        rows = pd.read_csv(path)
        if (
            rows.empty
            or tuple(rows.columns) != COLUMNS
            or not set(rows["strategy"]) <= {"refine", "random"}
        ):
            raise ValueError("its columns are others")
        rows = rows.astype(
            {"divisor": int, "solved": int, "seed": int, "rmse": float, "chaos_f1": float}
        )
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot read the learning curve {path} ({error}): `python "
            "benchmarks/learning_curve.py` writes it again"
        ) from None
    return rows


def summary(rows: pd.DataFrame, judged: str = "unsolved") -> pd.DataFrame:
    """Return mean and standard deviation (n - 1) over the seeds of each metric, indexed by
    strategy, model and divisor.
    """
    chosen = rows[rows["judged"] == judged]
    grouped = chosen.groupby(["strategy", "model", "divisor"], sort=False)[list(METRICS)]
    return grouped.agg(["mean", "std"])


def goal(rows: pd.DataFrame, judged: str = "unsolved") -> pd.DataFrame:
    """Check the goal of refining: n/16 chosen cells predict at least as well as n/4 drawn at
    random, by ``rmse`` and ``chaos_f1``.

    Returns
    -------
    DataFrame
        Rows ``rmse``, ``rmse_undamped`` and ``chaos_f1``; columns ``refined``, ``random`` (the same
        committee), ``best`` (the best of all models on the random cells) and ``best_model``: means
        over the seeds; ``met`` against the same committee, ``met_best`` against the best.
    """
    means = summary(rows, judged).xs("mean", axis=1, level=1)
    refined, at_random = (
        means.loc[("refine", COMMITTEE, GOAL[0])],
        means.loc["random"].xs(GOAL[1], level="divisor"),
    )
    found = {}
    for metric, sign in (("rmse", 1.0), ("rmse_undamped", 1.0), ("chaos_f1", -1.0)):
        best = (sign * at_random[metric]).idxmin()
        values = (refined[metric], at_random.loc[COMMITTEE, metric], at_random.loc[best, metric])
        found[metric] = [*values, best, *(bool(sign * values[0] <= sign * v) for v in values[1:])]
    return pd.DataFrame.from_dict(
        found,
        orient="index",
        columns=["refined", "random", "best", "best_model", "met", "met_best"],
    )
