"""Uncertainty of a surrogate: conformal intervals of the exponent and a calibrated probability that
a point is unstable.

Unstable means that the exponent is not negative: the motion is not periodic, but quasi-periodic or
chaotic.

A quarter of the training cells is kept for calibration: the model's errors there set the width of
the intervals (split conformal prediction, the library crepes), separately for each predicted regime
(Mondrian) and in proportion to the spread of the training cells around a point. The intervals then
cover nine in ten cells drawn at random from the same plane.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from crepes import ConformalRegressor
from crepes.extras import DifficultyEstimator
from sklearn.isotonic import IsotonicRegression

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.linear_theory.linear_table import LinearFeatures, LinearTable, shipped_table
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.classifier import REGIME, LabelTrees, PredictedLabels, predict_labels
from spab_core.surrogates.models import (
    Model,
    Surrogate,
    linear_table_of,
    solved_cells,
    train,
    training_mask,
)
from spab_core.surrogates.theory_trees import baseline
from spab_core.trajectory.regimes import REGIMES

CONFIDENCE = 0.9
CALIBRATION = 0.25  # share of the training cells
MIN_CALIBRATION = 20  # cells: fewer give no interval at this confidence for a regime of its own
_NEIGHBOURS = 12


class TooFewCells(InputError):
    """Too few training cells to keep some for calibration."""


@dataclass(frozen=True)
class Uncertainty:
    """Result of :func:`calibrate`.

    Attributes
    ----------
    surrogate : Surrogate
        Trained on three quarters of the training cells; the intervals are around its predictions.
    classifier : LabelTrees
        Trained on the same cells.
    calibration_cells : int
    """

    surrogate: Surrogate
    classifier: LabelTrees
    calibration_cells: int
    _difficulty: DifficultyEstimator
    _conformal: ConformalRegressor
    _bins: np.ndarray
    _unstable: IsotonicRegression
    _scale: np.ndarray

    def intervals(
        self, bearing_number: np.ndarray, rotor_mass: np.ndarray, confidence: float = CONFIDENCE
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds of the exponent per revolution, at points given by arrays
        (n,), rotor mass in kg.
        """
        inputs = np.column_stack([bearing_number, rotor_mass]).astype(float)
        bins = self._bins[self.classifier.predict_proba(inputs).argmax(axis=1)]
        sigmas = self._difficulty.apply(inputs / self._scale)
        found = self._conformal.predict_int(
            self.surrogate.predict(*inputs.T), sigmas=sigmas, bins=bins, confidence=confidence
        )
        return found[:, 0], found[:, 1]

    def unstable(self, bearing_number: np.ndarray, rotor_mass: np.ndarray) -> np.ndarray:
        """Return the probability (n,) that a point is not periodic, at points given by arrays (n,),
        rotor mass in kg.
        """
        inputs = np.column_stack([bearing_number, rotor_mass]).astype(float)
        found: np.ndarray = self._unstable.predict(
            1.0 - self.classifier.predict_proba(inputs)[:, REGIMES.index("periodic")]
        )
        return found


def calibrate(
    kind: Model,
    inputs: np.ndarray,
    mle: np.ndarray,
    regime: np.ndarray,
    seed: int = 0,
    table: LinearTable | None = None,
    trained: tuple[Surrogate, LabelTrees] | None = None,
) -> Uncertainty:
    """Train on three quarters of the cells and calibrate on the others.

    Parameters
    ----------
    kind : Model
    inputs : ndarray, (n, 2)
        Training cells: bearing number and rotor mass in kg.
    mle : ndarray, (n,)
        Per revolution, finite.
    regime : ndarray of str, (n,)
    seed : int
        Of the split and of the models.
    table : LinearTable
        Of the design; left out: the reference design's.
    trained : Surrogate and LabelTrees
        Already trained on these three quarters; left out: train them.

    Returns
    -------
    Uncertainty

    Raises
    ------
    TooFewCells
    """
    table = table or shipped_table()
    count = int(CALIBRATION * len(mle))
    if count < MIN_CALIBRATION:
        raise TooFewCells(
            f"{len(mle)} training cells are too few for intervals: at least "
            f"{int(MIN_CALIBRATION / CALIBRATION)} are needed"
        )
    order = np.random.default_rng([seed, 1]).permutation(
        len(mle)
    )  # not the draw of the training cells again
    held, used = order[:count], order[count:]
    surrogate, classifier = trained or (
        train(kind, inputs[used], mle[used], seed, table),
        LabelTrees(REGIME, table, seed).fit(inputs[used], regime[used]),
    )
    scale = np.ptp(inputs, axis=0) + 1e-300
    varies = (
        mle - baseline(LinearFeatures(table).transform(inputs)) if kind.theory else mle
    )  # what the model has to learn
    difficulty = DifficultyEstimator().fit(
        X=inputs[used] / scale,
        y=varies[used],
        k=min(_NEIGHBOURS, len(used)),
        scaler=False,
        beta=0.01,
    )
    probability = classifier.predict_proba(inputs[held])
    predicted = probability.argmax(axis=1)
    # undecided cells are few: they share the width of the chaotic ones
    bins = np.minimum(np.arange(len(REGIMES)), REGIMES.index("chaotic"))
    if np.bincount(bins[predicted], minlength=bins.max() + 1).min() < MIN_CALIBRATION:
        bins = np.zeros(len(REGIMES), int)  # too few of one regime: all share one width
    conformal = ConformalRegressor().fit(
        mle[held] - surrogate.predict(*inputs[held].T),
        bins=bins[predicted],
        sigmas=difficulty.apply(inputs[held] / scale),
    )
    unstable = IsotonicRegression(y_min=0.0, y_max=1.0, out_of_bounds="clip")
    unstable.fit(1.0 - probability[:, REGIMES.index("periodic")], regime[held] != "periodic")
    return Uncertainty(surrogate, classifier, count, difficulty, conformal, bins, unstable, scale)


@dataclass(frozen=True)
class Certainty:
    """Models that give regime, interval and probability at any point of a map's plane.

    Attributes
    ----------
    regimes : LabelTrees
        Trained on all training cells.
    calibrated : Uncertainty
    """

    regimes: LabelTrees
    calibrated: Uncertainty


def certainty(
    m: StabilityMap,
    kind: Model,
    divisor: int,
    seed: int = 0,
    trained: tuple[Surrogate, LabelTrees, LabelTrees] | None = None,
) -> Certainty:
    """Train and calibrate what :func:`uncertain_map` needs, without predicting the whole map.

    Parameters
    ----------
    m, kind, divisor, seed
        As in :func:`uncertain_map`.
    trained : Surrogate, LabelTrees and LabelTrees
        Already trained: the first two on three quarters of the training cells, the last on all of
        them; left out: train them.

    Raises
    ------
    TooFewCells
    InputError
        For a fraction that leaves too few cells to train on.
    """
    index, inputs, mle = solved_cells(m)
    chosen = training_mask(len(mle), divisor, seed)
    regime, table = m.regime.ravel()[index][chosen], linear_table_of(m)
    calibrated = calibrate(
        kind, inputs[chosen], mle[chosen], regime, seed, table, trained[:2] if trained else None
    )
    return Certainty(
        trained[2] if trained else LabelTrees(REGIME, table, seed).fit(inputs[chosen], regime),
        calibrated,
    )


@dataclass(frozen=True)
class MapIntervals:
    """Regimes, intervals and probabilities of a whole map from some of its own cells.

    Attributes
    ----------
    low, high : ndarray, (B, M)
        Bounds of the 90 % intervals, per revolution; nan where the map has no exponent.
    unstable : ndarray, (B, M)
        Probability that the motion is not periodic; nan likewise.
    regime : ndarray of str, (B, M)
        By the classifier trained on all training cells; "" likewise.
    held_out : ndarray of bool, (B, M)
        Cells that scores are measured on.
    seconds : float
        Of training both.
    """

    low: np.ndarray
    high: np.ndarray
    unstable: np.ndarray
    regime: np.ndarray
    held_out: np.ndarray
    seconds: float


@dataclass(frozen=True)
class MapUncertainty(MapIntervals):
    """The same, with the trained models.

    Attributes
    ----------
    regimes : PredictedLabels
    calibrated : Uncertainty
    """

    regimes: PredictedLabels
    calibrated: Uncertainty


STEPS = 3  # of uncertain_map


def uncertain_map(
    m: StabilityMap,
    kind: Model,
    divisor: int,
    seed: int = 0,
    split: str = "random",
    progress: Callable[[int], None] = lambda steps: None,
    known: Certainty | None = None,
) -> MapUncertainty:
    """Predict regimes, intervals and probabilities of a map from the training cells of
    ``surrogates.predict_map``.

    Parameters
    ----------
    m : StabilityMap
    kind : Model
    divisor, seed, split
        As in ``surrogates.predict_map``.
    progress : callable
        Called with the number of steps done since the last call, :data:`STEPS` in total.
    known : Certainty
        Models trained on the same cells; left out: train and calibrate them.

    Raises
    ------
    TooFewCells
    InputError
        If the cells cannot be split so.
    """
    regimes = predict_labels(m, REGIME, divisor, seed, split, known.regimes if known else None)
    progress(1)
    index, inputs, mle = solved_cells(m)
    chosen = regimes.trained.ravel()[index]
    began = time.perf_counter()
    found = (
        known.calibrated
        if known
        else calibrate(
            kind,
            inputs[chosen],
            mle[chosen],
            m.regime.ravel()[index][chosen],
            seed,
            linear_table_of(m),
        )
    )
    seconds = regimes.train_seconds + time.perf_counter() - began
    progress(1)
    values = np.full((3, m.mle.size), np.nan)
    values[:2, index] = found.intervals(*inputs.T)
    values[2, index] = found.unstable(*inputs.T)
    low, high, unstable = values.reshape(3, *m.shape)
    progress(1)
    return MapUncertainty(
        low, high, unstable, regimes.label, regimes.held_out, seconds, regimes, found
    )


_CELL = ("bearing_number", "rotor_mass")
_SCHEMA = Schema(
    "intervals",
    {
        "low": Array(np.float32, _CELL),
        "high": Array(np.float32, _CELL),
        "unstable": Array(np.float32, _CELL, low=0.0, high=1.0),
        "regime": Array("<U14", _CELL, texts=(*REGIMES, "")),
        "held_out": Array(bool, _CELL),
        "seconds": Array(np.float64, low=0.0),
    },
)


def save_intervals(found: MapIntervals, path: str | Path) -> None:
    """Write the intervals of a map as an NPZ file, atomically."""
    write_atomically(
        path,
        npz_bytes(
            {
                name: np.asarray(getattr(found, name)).astype(array.dtype)
                for name, array in _SCHEMA.arrays.items()
            }
        ),
    )


def load_intervals(path: str | Path, m: StabilityMap) -> MapIntervals:
    """Read what :func:`save_intervals` wrote for this map; nothing in it is ever unpickled.

    Raises
    ------
    InputError
        For a file of another kind, or of another map.
    """
    found = load(path, _SCHEMA, dict(zip(_CELL, m.shape, strict=True)))
    return MapIntervals(**found | {"seconds": float(found["seconds"])})


def reliability(
    unstable: np.ndarray, probability: np.ndarray, bins: int = 10
) -> tuple[pd.DataFrame, float]:
    """Compare the predicted probability of instability with the observed share of unstable points.

    Parameters
    ----------
    unstable : ndarray of bool, (n,)
    probability : ndarray, (n,)
    bins : int
        Of equal width over [0, 1].

    Returns
    -------
    DataFrame
        A row for each bin that is not empty: ``low``, ``high``, ``cells``, ``predicted`` (mean
        probability) and ``observed`` (share of unstable points).
    float
        Expected calibration error: mean over the cells of the difference between the two.
    """
    which = np.minimum((np.asarray(probability) * bins).astype(int), bins - 1)
    rows = []
    for k in range(bins):
        chosen = which == k
        if chosen.any():
            rows.append(
                {
                    "low": k / bins,
                    "high": (k + 1) / bins,
                    "cells": int(chosen.sum()),
                    "predicted": float(probability[chosen].mean()),
                    "observed": float(unstable[chosen].mean()),
                }
            )
    found = pd.DataFrame(rows, columns=["low", "high", "cells", "predicted", "observed"])
    error = float(
        (found["cells"] * (found["predicted"] - found["observed"]).abs()).sum()
        / max(found["cells"].sum(), 1)
    )
    return found, error
