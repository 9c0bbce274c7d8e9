"""Tables of surrogate errors as in the paper, with held-out cells beside the whole map, and a
ranking of the models.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from scipy.stats import ttest_rel

from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.classifier import Labels
from spab_core.surrogates.metrics import ERRORS
from spab_core.surrogates.models import MODELS, PredictedMap
from spab_core.surrogates.uncertainty import CONFIDENCE
from spab_core.trajectory.lyapunov import Exponent
from spab_core.trajectory.regimes import REGIMES

SIGNIFICANT = 0.05  # a difference with a larger p is a tie


def comparison_words(
    predicted: float,
    exponent: Exponent | None,
    interval: tuple[float, float] | None,
    trained: bool,
    floor: float | None = None,
) -> tuple[bool | None, str]:
    """Compare a prediction with the solved exponent, in words.

    Parameters
    ----------
    predicted : float
        Per revolution; nan if the map has no exponent there.
    exponent : Exponent or None
        Solved; None if the run failed.
    interval : (float, float) or None
        Of :data:`uncertainty.CONFIDENCE`; None if it is not known yet.
    trained : bool
        Whether the model was trained on this cell.
    floor : float or None
        Of the exponents that the model learnt (``models.floored``).

    Returns
    -------
    bool or None
        Whether the solved exponent lies inside the interval; None if there is nothing to compare.
    str
        The sentence.
    """
    if exponent is None or not math.isfinite(predicted):
        return None, "There is nothing to compare: the run failed, here or on the map."
    value, cut = exponent.value, ""
    if floor is not None and value < floor:
        value, cut = floor, f", which counts as {floor:g}"
    words = (
        f"Predicted {predicted:+.3f}, solved live {exponent.value:+.3f} ± "
        f"{exponent.standard_error:.3f} per revolution{cut}: {abs(predicted - value):.3f} apart"
    )
    inside = None
    if interval is not None and np.isfinite(interval).all():
        inside = bool(interval[0] <= value <= interval[1])
        words += (
            f". The solved value lies {'inside' if inside else 'outside'} the model's "
            f"{CONFIDENCE:.0%} interval, {interval[0]:+.3f} to {interval[1]:+.3f}"
            + ("" if inside else "; one cell in ten should")
        )
    return inside, words + (". The model was trained on this cell." if trained else ".")


def table(scores: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Return a table like the paper's, a column for each model.

    Its rows are the fractions from n/2 to n/8, Average, Standard deviation (n - 1) and Max - Min.

    Parameters
    ----------
    scores : DataFrame
        Of :func:`evaluate`.
    metric : str
        A column of it, such as ``rmse_held_out``; entries are means over seeds.
    """
    means = scores.pivot_table(
        index="divisor", columns="model", values=metric, aggfunc="mean", sort=False
    ).sort_index()
    rows = means.set_axis([f"n/{k}" for k in means.index])
    summary = pd.DataFrame(
        {
            "Average": means.mean(),
            "Standard deviation": means.std(ddof=1),
            "Max - Min": means.max() - means.min(),
        }
    ).T
    return pd.concat([rows, summary])


def spread(scores: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Return a metric's standard deviation over seeds (n - 1): a row for each fraction from n/2 to
    n/8, a column for each model.
    """
    found = scores.pivot_table(
        index="divisor", columns="model", values=metric, aggfunc="std", sort=False
    ).sort_index()
    return found.set_axis([f"n/{k}" for k in found.index])


def classifier_table(scores: pd.DataFrame, labels: Labels) -> pd.DataFrame:
    """Return how well a classifier does from each fraction.

    Parameters
    ----------
    scores : DataFrame
        Of :func:`evaluate` for classifiers.
    labels : Labels

    Returns
    -------
    DataFrame
        A row for each fraction from n/2 to n/8; columns ``accuracy``, ``balanced_accuracy``,
        ``recall_LABEL``, ``called_best``, ``unsafe``, ``worst_called_best`` as of
        ``metrics.label_scores``, means over the seeds, and ``unsafe_share``, ``unsafe`` over
        ``called_best``.
    """
    counts = ["called_best", "unsafe", "worst_called_best"]
    columns = ["accuracy", "balanced_accuracy", *(f"recall_{k}" for k in labels.values), *counts]
    rows = scores[scores["model"] == labels.name].groupby("divisor")[columns].mean().sort_index()
    rows["unsafe_share"] = rows["unsafe"] / rows["called_best"].where(rows["called_best"] > 0)
    return rows.set_axis([f"n/{k}" for k in rows.index])


def is_tie(scores: pd.DataFrame, metric: str, first: str, second: str) -> bool:
    """Return whether two models' averages over the fractions differ by chance only: Student's t
    test, paired by seed.

    Parameters
    ----------
    scores : DataFrame
        A row a training, with ``model`` and ``seed``.
    metric : str
        A column of it.
    first, second : str
        Names of the models.

    Returns
    -------
    bool
        With one seed always true.
    """
    by_seed = scores.pivot_table(index="seed", columns="model", values=metric, aggfunc="mean")
    difference = (by_seed[first] - by_seed[second]).to_numpy()
    if len(difference) < 2 or np.ptp(difference) == 0.0:
        return len(difference) < 2 or difference[0] == 0.0
    return bool(ttest_rel(by_seed[first], by_seed[second]).pvalue > SIGNIFICANT)


def ranking(scores: pd.DataFrame, kind: str = "held_out") -> pd.DataFrame:
    """Rank the models from best to worst.

    Parameters
    ----------
    scores : DataFrame
        Of :func:`evaluate`.
    kind : str
        ``held_out`` or ``all``: which cells count.

    Returns
    -------
    DataFrame
        Indexed by model, in the order of ``rmse``: ``rmse``, ``mae`` (averages over fractions and
        seeds), ``spread`` (standard deviation of the RMSE over the fractions), the rank by each,
        and ``tied``, whether the RMSE differs from the best one by chance only.
    """
    tables = {name: table(scores, f"{name}_{kind}") for name in ERRORS}
    found = pd.DataFrame(
        {
            "rmse": tables["rmse"].loc["Average"],
            "mae": tables["mae"].loc["Average"],
            "spread": tables["rmse"].loc["Standard deviation"],
        }
    )
    for name in ("rmse", "mae", "spread"):
        found[f"rank_{name}"] = (
            found[name].rank(method="min", na_option="bottom").astype(int)
        )  # one fraction has no spread
    found = found.sort_values("rmse")
    best = found.index[0]
    found["tied"] = [
        name != best and is_tie(scores, f"rmse_{kind}", best, name) for name in found.index
    ]
    return found


def suggestion(ranked: pd.DataFrame) -> str:
    """Return the ranking in one sentence."""
    best, tied = ranked.index[0], ranked.index[ranked["tied"]]
    row = ranked.loc[best]
    text = (
        f"Best by RMSE: {MODELS[best].label}, on average {row['rmse']:.3f} per revolution, MAE "
        f"{row['mae']:.3f}, over the training fractions"
    )
    if len(tied):
        text += f"; {', '.join(MODELS[name].label for name in tied)}: differ from it by chance only"
    return text + "."


def error_by_regime(m: StabilityMap, predicted: PredictedMap) -> pd.DataFrame:
    """Return the errors of held-out cells by solved regime, and of those next to another regime.

    Returns
    -------
    DataFrame
        Rows: the regimes in the map, and "at a border" (another regime among the four neighbours);
        columns ``cells``, ``rmse``, ``mae``, and ``share`` of the sum of squares.
    """
    held_out = predicted.held_out
    border = np.zeros(m.shape, bool)
    for axis in (0, 1):
        first, second = (np.take(m.regime, range(k, m.shape[axis] - 1 + k), axis) for k in (0, 1))
        differs = first != second
        pad = [(0, 1) if a == axis else (0, 0) for a in (0, 1)]
        border |= np.pad(differs, pad) | np.pad(differs, [p[::-1] for p in pad])
    squares = (m.mle - predicted.mle) ** 2
    rows = {}
    for name, mask in [*((r, m.regime == r) for r in REGIMES), ("at a border", border)]:
        chosen = held_out & mask
        if chosen.any():
            rows[name] = {
                "cells": int(chosen.sum()),
                "rmse": ERRORS["rmse"](m.mle[chosen], predicted.mle[chosen]),
                "mae": ERRORS["mae"](m.mle[chosen], predicted.mle[chosen]),
                "share": float(squares[chosen].sum() / max(squares[held_out].sum(), 1e-300)),
            }
    return pd.DataFrame.from_dict(rows, orient="index", columns=["cells", "rmse", "mae", "share"])
