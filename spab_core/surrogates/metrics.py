"""Score surrogates: the paper's errors and others, for any model, training fraction and seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import joblib
import numpy as np
import pandas as pd
from sklearn.metrics import (
    accuracy_score,
    f1_score,
    mean_absolute_error,
    root_mean_squared_error,
)

from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.classifier import (
    LABELS,
    Labels,
    predict_labels,
    regimes_by_threshold,
)
from spab_core.surrogates.models import (
    DIVISORS,
    MODELS,
    Model,
    PredictedMap,
    floored,
    predict_map,
)
from spab_core.surrogates.uncertainty import MapIntervals, reliability, uncertain_map
from spab_core.trajectory.regimes import REGIMES

SEEDS = tuple(range(10))
# equations (8) and (9) of the paper, in the unit of their arguments
ERRORS: dict[str, Callable[..., float]] = {
    "rmse": root_mean_squared_error,
    "mae": mean_absolute_error,
}


def errors(m: StabilityMap, predicted: PredictedMap) -> dict[str, float]:
    """Return ``rmse_all`` and ``mae_all`` over all solved cells, ``rmse_held_out`` and
    ``mae_held_out`` over the held-out cells, if any.
    """
    found = {}
    for name, function in ERRORS.items():
        for where, cells in (("all", np.isfinite(m.mle)), ("held_out", predicted.held_out)):
            if cells.any():
                found[f"{name}_{where}"] = function(m.mle[cells], predicted.mle[cells])
    return found


def regime_scores(truth: np.ndarray, predicted: np.ndarray) -> dict[str, float]:
    """Return ``regime_accuracy`` and ``chaos_f1`` of predicted regimes, arrays of str (n,); nan if
    there are no cells to count.
    """
    if not len(truth):
        return {"regime_accuracy": math.nan, "chaos_f1": math.nan}
    return {
        "regime_accuracy": accuracy_score(truth, predicted),
        "chaos_f1": f1_score(truth == "chaotic", predicted == "chaotic", zero_division=math.nan),
    }


def score(
    m: StabilityMap, kind: Model, divisor: int, seed: int, split: str = "random"
) -> dict[str, Any]:
    """Return the errors of one model trained on 1/divisor of a map's cells.

    Returns
    -------
    dict
        ``model``, ``divisor``, ``seed``; ``rmse_all``, ``mae_all`` over all cells, training cells
        included as in the paper; ``rmse_held_out``, ``mae_held_out`` over the held-out cells (split
        by blocks: the withheld ones); ``regime_accuracy``, ``chaos_f1`` there, of regimes
        classified by two thresholds of the predicted exponent; ``train_seconds``,
        ``predict_seconds``, ``converged``.
    """
    predicted = predict_map(m, kind, divisor, seed, split)
    found = {"model": kind.name, "divisor": divisor, "seed": seed} | errors(m, predicted)
    regimes = regimes_by_threshold(
        predicted.mle, m.mle[predicted.trained], m.regime[predicted.trained]
    )
    found |= regime_scores(m.regime[predicted.held_out], regimes[predicted.held_out])
    return found | {
        "train_seconds": predicted.surrogate.seconds,
        "predict_seconds": predicted.predict_seconds,
        "converged": predicted.surrogate.converged,
    }


def uncertainty_scores(m: StabilityMap, found: MapIntervals) -> dict[str, float]:
    """Return how well predicted regimes, intervals and probabilities hold on held-out cells.

    Returns
    -------
    dict
        Of the classifier of regimes, the same for every model, ``classifier_accuracy`` and
        ``classifier_chaos_f1``; of the intervals ``coverage``,
        ``coverage_periodic``, ``coverage_quasi-periodic``, ``coverage_chaotic``,
        ``coverage_undecided`` (by the regime that the solver found; nan where there is none) and
        ``width``, the median per revolution; of the probability of instability
        ``calibration_error``.
    """
    tested = found.held_out
    truth = m.regime[tested]
    inside = ((found.low <= m.mle) & (m.mle <= found.high))[tested]
    regimes = regime_scores(truth, found.regime[tested])
    scores = {
        "classifier_accuracy": regimes["regime_accuracy"],
        "classifier_chaos_f1": regimes["chaos_f1"],
        "coverage": float(inside.mean()),
    }
    scores |= {
        f"coverage_{r}": float(inside[truth == r].mean()) if (truth == r).any() else math.nan
        for r in REGIMES
    }
    _, error = reliability(truth != "periodic", found.unstable[tested])
    return scores | {
        "width": float(np.median((found.high - found.low)[tested])),
        "calibration_error": error,
    }


def score_uncertainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int, split: str = "random"
) -> dict[str, Any]:
    """Return :func:`uncertainty_scores` of models trained on 1/divisor of a map, with ``model``,
    ``divisor``, ``seed`` and ``train_seconds``.
    """
    found = uncertain_map(m, kind, divisor, seed, split)
    return (
        {"model": kind.name, "divisor": divisor, "seed": seed}
        | uncertainty_scores(m, found)
        | {"train_seconds": found.seconds}
    )


def label_scores(labels: Labels, truth: np.ndarray, said: np.ndarray) -> dict[str, float]:
    """Return how well predicted labels hold.

    Parameters
    ----------
    labels : Labels
    truth, said : ndarray of str, (n,)
        Solved and predicted.

    Returns
    -------
    dict
        ``cells`` counted; ``accuracy``; ``balanced_accuracy``, the mean of the recalls;
        ``recall_LABEL``, the share of cells of a label that are called so, nan where there are
        none; ``called_best``, the cells called by the best label; ``unsafe``, those of them that
        have another one; ``unsafe_share``, the latter over the former, nan where nothing is called
        so; ``worst_called_best``, those of them that have the worst label.
    """
    recalls = {
        name: float((said[truth == name] == name).mean())
        for name in labels.values
        if (truth == name).any()
    }
    called = truth[said == labels.best]
    unsafe = int((called != labels.best).sum())
    return {
        "cells": len(truth),
        "accuracy": float((truth == said).mean()) if len(truth) else math.nan,
        "balanced_accuracy": float(np.mean([*recalls.values()])) if recalls else math.nan,
        "called_best": len(called),
        "unsafe": unsafe,
        "unsafe_share": unsafe / len(called) if len(called) else math.nan,
        "worst_called_best": int((called == labels.worst).sum()),
    } | {f"recall_{name}": recalls.get(name, math.nan) for name in labels.values}


def score_labels(
    m: StabilityMap, labels: Labels, divisor: int, seed: int, split: str = "random"
) -> dict[str, Any]:
    """Return :func:`label_scores` of a classifier trained on 1/divisor of a map's cells, on the
    held-out cells, with ``model`` (the labels' name), ``divisor``, ``seed`` and ``train_seconds``.
    """
    found = predict_labels(m, labels, divisor, seed, split)
    tested = found.held_out
    return (
        {"model": labels.name, "divisor": divisor, "seed": seed}
        | label_scores(labels, labels.of(m)[tested], found.label[tested])
        | {"train_seconds": found.train_seconds}
    )


def evaluate(
    m: StabilityMap,
    models: Iterable[Model | Labels] = tuple(MODELS.values()),
    divisors: Sequence[int] = DIVISORS,
    seeds: Sequence[int] = SEEDS,
    *,
    split: str = "random",
    uncertainty: bool = False,
    floor: float | None = None,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """Score each combination of model, training fraction and seed, by :func:`score` or
    :func:`score_uncertainty`, and of classifiers by :func:`score_labels`.

    Parameters
    ----------
    m : StabilityMap
    models : iterable of Model or Labels
        Models, or what classifiers tell.
    divisors, seeds : sequence of int
    split : str
        Of ``surrogates.SPLITS``.
    uncertainty : bool
        Whether regimes and intervals are scored instead of predictions.
    floor : float or None
        Per revolution: models learn, and are measured on, ``models.floored(m, floor)``.
    workers : int
        Processes.
    progress : callable
        Called with the number of rows done since the last call.

    Returns
    -------
    DataFrame
        One row a combination, sorted by model, divisor and seed for any number of workers.

    Raises
    ------
    InputError
        For a floor out of range, or too few cells.
    """
    m, kinds = floored(m, floor), list(models)
    jobs = [
        (kind.name, divisor, seed, split, uncertainty)
        for kind in kinds
        for divisor in divisors
        for seed in seeds
    ]
    rows = []
    run = joblib.Parallel(n_jobs=workers, return_as="generator_unordered", pre_dispatch="2*n_jobs")
    for row in run(joblib.delayed(_score_by_name)(m, *job) for job in jobs):
        rows.append(row)
        if progress:
            progress(1)
    order = {kind.name: k for k, kind in enumerate(kinds)}
    rows.sort(key=lambda row: (order[row["model"]], row["divisor"], row["seed"]))
    return pd.DataFrame(rows)


def _score_by_name(
    m: StabilityMap, name: str, divisor: int, seed: int, split: str, uncertainty: bool
) -> dict[str, Any]:
    # by name, for models and labels hold functions, which do not travel to another process
    if name in LABELS:
        return score_labels(m, LABELS[name], divisor, seed, split)
    kind = MODELS[name]
    return (score_uncertainty if uncertainty else score)(m, kind, divisor, seed, split)
