"""Predict the regime of a point, or the assessment of its motion, by a classifier trained on the
labels of some cells; or the regime by thresholds of a predicted exponent.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.tree import DecisionTreeClassifier

from spab_core.linear_theory.linear_table import LinearFeatures, LinearTable
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.models import linear_table_of, solved_cells, split_cells
from spab_core.trajectory.assessment import GRADES
from spab_core.trajectory.regimes import REGIMES

TREES = 200
_SLOPES = (
    (1, 1),
    (1, -1),
    (1, 2),
    (1, -2),
    (2, 1),
    (2, -1),
)  # borders are lines across the plane: directions to cut along


@dataclass(frozen=True)
class Labels:
    """What a classifier tells of a cell.

    Attributes
    ----------
    name : str
    values : tuple of str
        In the order of probabilities.
    best, worst : str
        Of the values: the one that a designer hopes for, and the one that must least be taken for
        it.
    of : callable
        Takes a StabilityMap; returns the labels of its cells, (B, M) of str.
    """

    name: str
    values: tuple[str, ...]
    best: str
    worst: str
    of: Callable[[StabilityMap], np.ndarray]


REGIME = Labels("regime", REGIMES, "periodic", "chaotic", lambda m: m.regime)
# of the motion alone, by the usual limits
ASSESSMENT = Labels("assessment", GRADES, "good", "avoid", lambda m: m.grades())
LABELS = {labels.name: labels for labels in (REGIME, ASSESSMENT)}


class LabelTrees(ClassifierMixin, BaseEstimator):
    """Extra trees on linear theory and on slanted coordinates of the plane.

    Parameters
    ----------
    labels : Labels
    table : LinearTable
        Linear stability of the design.
    seed : int
    """

    def __init__(self, labels: Labels, table: LinearTable, seed: int = 0):
        self.labels = labels
        self.table = table
        self.seed = seed

    def _inputs(self, X: np.ndarray) -> np.ndarray:
        features = LinearFeatures(self.table).transform(X)
        number, mass = (
            features[:, 0] / self.table.bearing_number[-1],
            features[:, 1] / self.table.rotor_mass[-1],
        )
        return np.column_stack([features, *(a * number + b * mass for a, b in _SLOPES)])

    def fit(self, X: np.ndarray, y: np.ndarray) -> LabelTrees:
        """Learn from X (n, 2), bearing number and rotor mass in kg, and labels y (n,) of str."""
        trees = ExtraTreesClassifier(
            TREES, max_features=None, min_samples_leaf=2, random_state=self.seed
        )
        return self.with_trees(trees.fit(self._inputs(X), y))

    def with_trees(self, trees: ExtraTreesClassifier) -> LabelTrees:
        """Use fitted ``trees``, such as the ``trees_`` of another instance; return self."""
        self.trees_, self.classes_ = trees, np.array(self.labels.values)
        return self

    def predict_proba(self, X: np.ndarray) -> np.ndarray:
        """Return probabilities (n, labels) in the order of ``labels.values``; 0 for a label absent
        from the training cells.
        """
        found, known = self.trees_.predict_proba(self._inputs(X)), self.trees_.classes_
        return np.column_stack([found[:, known == value].sum(1) for value in self.labels.values])

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Return the most probable labels (n,)."""
        found: np.ndarray = self.classes_[self.predict_proba(X).argmax(axis=1)]
        return found


@dataclass(frozen=True)
class PredictedLabels:
    """Labels of a map predicted from some of its own cells.

    Attributes
    ----------
    classifier : LabelTrees
    divisor, seed : int
    label : ndarray of str, (B, M)
        "" where the map has no exponent.
    probability : ndarray, (B, M, labels)
        In the order of the labels' ``values``; nan where the map has no exponent.
    trained, held_out : ndarray of bool, (B, M)
        The training cells and the cells that scores are measured on, the same as in
        ``surrogates.predict_map`` with this divisor, seed and split.
    train_seconds : float
    """

    classifier: LabelTrees
    divisor: int
    seed: int
    label: np.ndarray
    probability: np.ndarray
    trained: np.ndarray
    held_out: np.ndarray
    train_seconds: float


def predict_labels(
    m: StabilityMap,
    labels: Labels,
    divisor: int,
    seed: int = 0,
    split: str = "random",
    classifier: LabelTrees | None = None,
) -> PredictedLabels:
    """Train the classifier on 1/divisor of a map's cells and predict the labels of all of them.

    Parameters
    ----------
    m : StabilityMap
    labels : Labels
        Of :data:`LABELS`.
    divisor, seed, split
        As in ``surrogates.predict_map``.
    classifier : LabelTrees
        Already trained on these cells; left out: train one.

    Raises
    ------
    InputError
        For too few cells.
    """
    index, inputs, _ = solved_cells(m)
    chosen, tested = split_cells(m, divisor, seed, split)
    began = time.perf_counter()
    classifier = classifier or LabelTrees(labels, linear_table_of(m), seed).fit(
        inputs[chosen], labels.of(m).ravel()[index][chosen]
    )
    seconds = time.perf_counter() - began
    probability = np.full((m.mle.size, len(labels.values)), np.nan)
    probability[index] = classifier.predict_proba(inputs)
    trained, held_out = np.zeros((2, m.mle.size), bool)
    trained[index[chosen]] = True
    held_out[index[tested]] = True
    values = np.array(labels.values)
    label = np.full(m.mle.size, "", values.dtype)
    label[index] = values[probability[index].argmax(axis=1)]
    return PredictedLabels(
        classifier,
        divisor,
        seed,
        label.reshape(m.shape),
        probability.reshape(*m.shape, -1),
        trained.reshape(m.shape),
        held_out.reshape(m.shape),
        seconds,
    )


def regimes_by_threshold(
    predicted_mle: np.ndarray, solved_mle: np.ndarray, solved_regime: np.ndarray
) -> np.ndarray:
    """Classify predicted exponents by the two thresholds that best separate the training cells.

    Parameters
    ----------
    predicted_mle : ndarray
        Any shape.
    solved_mle, solved_regime : ndarray, (n,)
        Of the training cells.

    Returns
    -------
    ndarray of str
        The shape of ``predicted_mle``; "" where that is nan.
    """
    predicted_mle = np.asarray(predicted_mle, float)
    thresholds = DecisionTreeClassifier(max_leaf_nodes=3, random_state=0).fit(
        solved_mle[:, None], solved_regime
    )
    found, known = np.full(predicted_mle.shape, "", "<U14"), np.isfinite(predicted_mle)
    if known.any():
        found[known] = thresholds.predict(predicted_mle[known][:, None])
    return found
