"""Predict the assessment of a point by its motion (good, to be watched, to be avoided) by the
classifier of regimes (:mod:`spab_core.surrogates.classifier`), trained on the assessments of some
cells of a map instead.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesClassifier

from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.classifier import RegimeTrees
from spab_core.surrogates.metrics import SEEDS
from spab_core.surrogates.models import DIVISORS, linear_table_of, solved_cells, split_cells
from spab_core.trajectory.assessment import DEFAULT_LIMITS, GRADES, Limits


class AssessmentTrees(RegimeTrees):
    """The trees of :class:`.classifier.RegimeTrees`, whose labels are the grades."""

    def with_trees(self, trees: ExtraTreesClassifier) -> AssessmentTrees:
        """Use fitted ``trees``; return self."""
        self.trees_, self.classes_ = trees, np.array(GRADES)
        return self

    def predict_proba(self, X: np.ndarray) -> np.ndarray:
        """Return probabilities (n, 3) in the order of ``GRADES``; 0 for a grade absent from the
        training cells.
        """
        found, known = self.trees_.predict_proba(self._inputs(X)), self.trees_.classes_
        return np.column_stack([found[:, known == grade].sum(1) for grade in GRADES])


@dataclass(frozen=True)
class PredictedAssessments:
    """Assessments of a map predicted from some of its own cells.

    Attributes
    ----------
    assessment : ndarray of str, (B, M)
        Of ``GRADES``; "" where the map has no exponent.
    probability : ndarray, (B, M, 3)
        In the order of ``GRADES``; nan likewise.
    held_out : ndarray of bool, (B, M)
        The cells that scores are measured on, as in ``surrogates.predict_map`` with this divisor,
        seed and split.
    train_seconds : float
    """

    assessment: np.ndarray
    probability: np.ndarray
    held_out: np.ndarray
    train_seconds: float


def predict_assessments(
    m: StabilityMap,
    divisor: int,
    seed: int = 0,
    split: str = "random",
    limits: Limits = DEFAULT_LIMITS,
) -> PredictedAssessments:
    """Train the classifier on 1/divisor of a map's cells and predict the assessment of all of them.

    Parameters
    ----------
    m : StabilityMap
    divisor, seed, split
        As in ``surrogates.predict_map``.
    limits : Limits
        By which the training cells are judged.

    Raises
    ------
    InputError
        For too few cells.
    """
    index, inputs, _ = solved_cells(m)
    chosen, tested = split_cells(m, divisor, seed, split)
    began = time.perf_counter()
    trees = AssessmentTrees(linear_table_of(m), seed)
    trees.fit(inputs[chosen], m.grades(limits).ravel()[index][chosen])
    seconds = time.perf_counter() - began
    probability = np.full((m.mle.size, len(GRADES)), np.nan)
    probability[index] = trees.predict_proba(inputs)
    assessment = np.full(m.mle.size, "", "<U5")
    assessment[index] = np.array(GRADES)[probability[index].argmax(1)]
    held_out = np.zeros(m.mle.size, bool)
    held_out[index[tested]] = True
    return PredictedAssessments(
        assessment.reshape(m.shape),
        probability.reshape(*m.shape, -1),
        held_out.reshape(m.shape),
        seconds,
    )


def assessment_scores(m: StabilityMap, found: PredictedAssessments) -> dict[str, float]:
    """Return how well predicted assessments hold on held-out cells.

    Returns
    -------
    dict
        ``assessment_accuracy``; ``good_precision``, the share of cells called good that are; and
        ``avoid_called_good``, the share of cells to be avoided that are called good. nan where
        there are none to count.
    """
    truth, said = m.grades()[found.held_out], found.assessment[found.held_out]
    return {
        "assessment_accuracy": _share(said == truth),
        "good_precision": _share((truth == "good")[said == "good"]),
        "avoid_called_good": _share((said == "good")[truth == "avoid"]),
    }


def evaluate_assessments(
    m: StabilityMap,
    divisors: Sequence[int] = DIVISORS,
    seeds: Iterable[int] = SEEDS,
    split: str = "random",
    progress: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """Score the classifier for each training fraction and seed.

    Returns
    -------
    DataFrame
        One row a training: ``divisor``, ``seed``, :func:`assessment_scores`, ``train_seconds``.

    Raises
    ------
    InputError
        As :func:`predict_assessments`.
    """
    rows, seeds = [], list(seeds)
    for divisor in divisors:
        for seed in seeds:
            found = predict_assessments(m, divisor, seed, split)
            rows.append(
                {"divisor": divisor, "seed": seed}
                | assessment_scores(m, found)
                | {"train_seconds": found.train_seconds}
            )
            if progress:
                progress(1)
    return pd.DataFrame(rows)


def _share(right: np.ndarray) -> float:
    return float(right.mean()) if right.size else float("nan")
