"""Which tolerance drives the failures, and how far one of them would have to be narrowed.

Sobol' indices of a forest that learned the machines drawn. First order: the share of the variance
that a tolerance explains alone; total: with all its interactions. They sum up the whole
distribution and need no direction, as the importance by permutation of a model's input does not
either; but they have a scale, 0 to 1 of the variance, and tell what acts alone from what acts
together. The spread is that of forests on machines drawn again with replacement.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest, norm, sobol_indices, uniform

from spab_core.common.threads import one_thread
from spab_core.design.tolerances import NORMAL, UP_TO, VALUES, WITHIN, Tolerances

CONFIDENCE = 0.95
SAMPLES = 1024  # of Sobol's estimate, a power of two
TREES, AGAIN = 100, 10
FEWEST = 16  # machines, effective, that a share is told of
_FACTORS = np.linspace(1.0, 0.05, 96)  # of a tolerance's width that are looked at


def wilson(count: float, total: float) -> tuple[float, float]:
    """Return Wilson's interval of a share at :data:`CONFIDENCE`; 0 to 1 for nothing drawn.

    Wilson, J. Am. Stat. Assoc. 22, 209 (1927). Numbers of weighted machines need not be whole.
    """
    if total <= 0.0:
        return 0.0, 1.0
    if float(count).is_integer() and float(total).is_integer():
        found = binomtest(int(count), int(total)).proportion_ci(CONFIDENCE, "wilson")
        return float(found.low), float(found.high)
    z = float(norm.ppf(0.5 + 0.5 * CONFIDENCE))
    p = count / total
    middle = (p + z * z / (2.0 * total)) / (1.0 + z * z / total)
    half = z / (1.0 + z * z / total) * math.sqrt(p * (1.0 - p) / total + (z / (2.0 * total)) ** 2)
    return max(middle - half, 0.0), min(middle + half, 1.0)


@one_thread
def drivers(
    quantiles: np.ndarray, response: np.ndarray, names: list[str], seed: int
) -> pd.DataFrame:
    """Return the Sobol' indices of a response over tolerances.

    Parameters
    ----------
    quantiles : ndarray, (n, d)
        Of each tolerance's distribution: uniform on the unit cube, whatever the distributions.
    response : ndarray, (n,)
        Such as 1 for a machine that is not good, else 0.
    names : list of str, (d,)
    seed : int

    Returns
    -------
    DataFrame
        ``value``, ``first``, ``first_spread``, ``total``, ``total_spread`` (a standard deviation),
        the largest total first; empty where the response is the same everywhere. Its ``attrs`` have
        ``explained``, the share of the variance that the forest explains of machines it has not
        learned (out of bag).
    """
    columns = ["value", "first", "first_spread", "total", "total_spread"]
    y = np.asarray(response, float)
    if len(y) < FEWEST or np.ptp(y) == 0.0:
        return pd.DataFrame({c: [] for c in columns})
    rng = np.random.default_rng(seed)
    forest, indices = _forest_indices(quantiles, y, seed)
    again = []
    for k in range(AGAIN):
        rows = rng.integers(0, len(y), len(y))
        if np.ptp(y[rows]) > 0.0:
            again.append(_forest_indices(quantiles[rows], y[rows], seed + k + 1)[1])
    spread = np.std(again, axis=0, ddof=1) if len(again) > 1 else np.full_like(indices, np.nan)
    table = pd.DataFrame(
        {
            "value": names,
            "first": indices[0],
            "first_spread": spread[0],
            "total": indices[1],
            "total_spread": spread[1],
        }
    ).sort_values("total", ascending=False, ignore_index=True)
    table.attrs["explained"] = max(float(forest.oob_score_), 0.0)
    return table


def _forest_indices(
    quantiles: np.ndarray, response: np.ndarray, seed: int
) -> tuple[Any, np.ndarray]:
    """Return a forest and its indices (2, d): first order and total, from 0 to 1."""
    from sklearn.ensemble import RandomForestRegressor  # a second to load

    forest = RandomForestRegressor(
        TREES, min_samples_leaf=2, oob_score=True, random_state=seed % 2**32
    ).fit(quantiles, response)
    learned: Callable[[np.ndarray], np.ndarray] = lambda x: forest.predict(x.T)  # noqa: E731
    if np.ptp(forest.predict(quantiles)) == 0.0:
        return forest, np.zeros((2, quantiles.shape[1]))
    if quantiles.shape[1] == 1:
        return forest, np.ones((2, 1))  # the only tolerance explains all
    found = sobol_indices(
        func=learned,
        n=SAMPLES,
        dists=[uniform()] * quantiles.shape[1],
        random_state=np.random.default_rng(seed),
    )
    return forest, np.clip([found.first_order, found.total_order], 0.0, 1.0)


def _place(quantile: np.ndarray, kind: str) -> np.ndarray:
    """Return how far from the drawing a value is, over its tolerance, 0 to 1."""
    if kind == UP_TO:
        return quantile
    if kind != NORMAL:
        return np.abs(2.0 * quantile - 1.0)
    edge = norm.cdf(WITHIN)
    inside = (1.0 - edge) + quantile * (2.0 * edge - 1.0)
    return np.asarray(np.abs(norm.ppf(inside)) / WITHIN)


def _weights(place: np.ndarray, kind: str, factor: float) -> np.ndarray:
    """Return the likelihood of machines under a tolerance narrowed by a factor over that under the
    whole one.
    """
    inside = place <= factor
    if kind != NORMAL:
        return inside.astype(float)
    # Gaussian of a standard deviation smaller by the factor, cut there, over the whole one
    scaled = WITHIN * place
    ratio = np.exp(0.5 * scaled**2 * (1.0 - 1.0 / factor**2))
    return np.where(inside, ratio, 0.0)


def narrowings(
    quantiles: np.ndarray, good: np.ndarray, tolerances: Tolerances, wanted: float
) -> pd.DataFrame:
    """Return how far each tolerance alone has to be narrowed for a wanted share of good machines.

    Nothing is solved anew: the share is that of the machines drawn that lie within the narrower
    tolerance, weighted to its distribution.

    Parameters
    ----------
    quantiles : ndarray, (n, d)
    good : ndarray of bool, (n,)
    tolerances : tuple of Tolerance, (d,)
    wanted : float

    Returns
    -------
    DataFrame
        A row for each: ``value``, ``tolerance`` (as it is), ``factor`` of its width (nan: even
        a twentieth of it does not do, or too few machines are left), ``narrowed`` (written out),
        ``share``, ``low``, ``high`` (Wilson's interval), ``machines`` (effective number); what has
        to be narrowed least first.
    """
    rows = []
    for k, tolerance in enumerate(tolerances):
        row = {
            "value": VALUES[tolerance.name].key,
            "tolerance": tolerance.text,
            "factor": math.nan,
            "narrowed": "",
            "share": math.nan,
            "low": math.nan,
            "high": math.nan,
            "machines": math.nan,
        }
        place = _place(quantiles[:, k], tolerance.kind)
        for factor in _FACTORS:
            weight = _weights(place, tolerance.kind, float(factor))
            number = float(weight.sum()) ** 2 / max(float((weight**2).sum()), 1e-300)
            if number < FEWEST:
                break
            share = min(float((weight * good).sum() / weight.sum()), 1.0)
            if share >= wanted:
                low, high = wilson(share * number, number)
                row |= {
                    "factor": float(factor),
                    "narrowed": tolerance.narrowed(_down(float(factor))).text,
                    "share": share,
                    "low": low,
                    "high": high,
                    "machines": number,
                }
                break
        rows.append(row)
    return pd.DataFrame(rows).sort_values("factor", ascending=False, ignore_index=True)


def _down(factor: float) -> float:
    """Return a factor of two digits, never larger."""
    return math.floor(100.0 * factor + 1e-9) / 100.0
