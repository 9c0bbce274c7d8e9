"""Predict all cells of a plane from the solved ones by a committee of randomised trees; score it on
a solved map.

One forest learns the difference between the exponent and linear theory, another the regime. The
spread among the trees of the first and the split of votes of the second measure the doubt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor
from sklearn.metrics import mean_absolute_error, root_mean_squared_error

from spab_core.linear_theory.linear_table import FEATURES, LinearFeatures, LinearTable
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.metrics import regime_scores
from spab_core.surrogates.theory_trees import baseline
from spab_core.trajectory.regimes import REGIMES

TREES = 60
POWERS = np.arange(1.0, 3.01, 0.25)  # of the bearing number, along which the trees can cut
LINEAR = slice(
    FEATURES.index("linear rate"), None
)  # what linear theory adds to bearing number, rotor mass and M
# bearing number below which exponents reach -38 per revolution: errors are told without them too
DAMPED = 0.15
Floats = npt.NDArray[np.float64]
LABELS = (*REGIMES, "")  # "": the run fails, no exponent


@dataclass(frozen=True)
class Prediction:
    """Prediction of every cell of a plane by the committee.

    Attributes
    ----------
    mle, deviation : ndarray, (n,)
        Mean and standard deviation over the trees, per revolution; nan if fewer than two solved
        cells have an exponent.
    probability : ndarray, (n, 5)
        Share of the trees' votes for each of :data:`LABELS`.
    """

    mle: Floats
    deviation: Floats
    probability: Floats

    @property
    def regime(self) -> np.ndarray:
        """Most probable of :data:`LABELS`, (n,) of str."""
        names: np.ndarray = np.array(LABELS)[self.probability.argmax(1)]
        return names

    @property
    def unstable(self) -> Floats:
        """Probability that the motion is not periodic, failed runs (touchdown) included, (n,)."""
        return 1.0 - self.probability[:, LABELS.index("periodic")]

    @property
    def impurity(self) -> Floats:
        """Gini impurity of the regime, (n,): the expected rate of wrong labels if labels were drawn
        with their probabilities.
        """
        impurity: Floats = 1.0 - np.square(self.probability).sum(1)
        return impurity


@dataclass(frozen=True)
class Inputs:
    """Inputs of the committee for the cells of a plane, in the order of ``mle.ravel()``.

    Attributes
    ----------
    features : ndarray of float32, (n, k)
        Bearing number and rotor mass scaled to [0, 1], ln(m Λ^p) for each p of :data:`POWERS`;
        decay rate, whirl frequency and static eccentricity by linear theory if its table is given.
    bearing_number : ndarray, (n,)
    baseline : ndarray, (n,)
        Exponent that the trees start from, per revolution: that of linear theory, or 0.
    """

    features: np.ndarray
    bearing_number: np.ndarray
    baseline: np.ndarray


def plane_inputs(
    bearing_number: np.ndarray, rotor_mass: np.ndarray, table: LinearTable | None = None
) -> Inputs:
    """Return the inputs of the committee for the cells of a plane.

    Trees split along the axes of their inputs, but borders and narrow bands, such as periodic
    windows within chaos, run along curves of nearly constant m Λ^p, with another p for each band.
    So powers m Λ^p are inputs too; p = 2 is the dimensionless mass.

    Parameters
    ----------
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    table : LinearTable, optional
        Linear theory of the design.
    """
    number, mass = (a.ravel() for a in np.meshgrid(bearing_number, rotor_mass, indexing="ij"))
    scaled = [(a - a.min()) / max(np.ptp(a), 1e-12) for a in (number, mass)]
    features = np.column_stack([*scaled, *(np.log(mass) + p * np.log(number) for p in POWERS)])
    start = np.zeros(len(number))
    if table is not None:
        theory = LinearFeatures(table).transform(np.column_stack([number, mass]))
        features, start = np.column_stack([features, theory[:, LINEAR]]), baseline(theory)
    return Inputs(
        features.astype(np.float32), number, start
    )  # what trees compute in: converted once


def predict_plane(
    inputs: Inputs, solved: np.ndarray, mle: np.ndarray, regime: np.ndarray, seed: int = 0
) -> Prediction:
    """Train the committee on the solved cells and predict all of them.

    Parameters
    ----------
    inputs : Inputs
        Of all n cells. The trees learn the MLE less the baseline, times the bearing number, which
        is nearly smooth where the exponent itself is steep.
    solved : ndarray of bool, (n,)
        The cells to learn from, at least one.
    mle : ndarray, (n,)
        Per revolution; nan if a run failed.
    regime : ndarray of str, (n,)
        "" if a run failed.
    seed : int

    Returns
    -------
    Prediction
    """
    features, number, start = inputs.features, inputs.bearing_number, inputs.baseline
    known = solved & np.isfinite(mle)
    mean, deviation = np.full(len(features), np.nan), np.full(len(features), np.nan)
    if known.sum() >= 2:
        trees = ExtraTreesRegressor(TREES, random_state=seed).fit(
            features[known], ((mle - start) * number)[known]
        )
        each = np.array([tree.predict(features) for tree in trees.estimators_], np.float32)
        mean, deviation = (
            start + each.mean(0, dtype=float) / number,
            each.std(0, dtype=float) / number,
        )
    votes = ExtraTreesClassifier(TREES, random_state=seed).fit(features[solved], regime[solved])
    probability = np.zeros((len(features), len(LABELS)))
    probability[:, [LABELS.index(name) for name in votes.classes_]] = votes.predict_proba(features)
    return Prediction(mean, deviation, probability)


def scores(
    m: StabilityMap, mle: np.ndarray, regime: np.ndarray, cells: np.ndarray
) -> dict[str, float]:
    """Score a prediction on some cells of a solved map.

    Parameters
    ----------
    m : StabilityMap
        The truth.
    mle : ndarray, (n,) or (B, M)
        Predicted exponent per revolution.
    regime : ndarray of str, (n,) or (B, M)
        Predicted.
    cells : ndarray of bool, (n,)
        Which cells count, such as the held-out ones.

    Returns
    -------
    dict
        Those of :func:`exponent_scores`, ``accuracy`` of regimes and ``chaos_f1``; nan if no cell
        counts.
    """
    regimes = regime_scores(m.regime.ravel()[cells], regime.ravel()[cells])
    return exponent_scores(m, mle.ravel(), cells) | {
        "accuracy": regimes["regime_accuracy"],
        "chaos_f1": regimes["chaos_f1"],
    }


def exponent_scores(m: StabilityMap, predicted: np.ndarray, cells: np.ndarray) -> dict[str, float]:
    """Return ``rmse``, ``mae`` and, over bearing numbers from :data:`DAMPED` on, ``rmse_undamped``.

    Per revolution, over those of ``cells`` (n,) that have an exponent, nan if there are none;
    ``predicted`` has the shape (n,).
    """
    truth = m.mle.ravel()
    known = cells & np.isfinite(truth)
    undamped = known & (np.repeat(m.bearing_number, len(m.rotor_mass)) >= DAMPED - 1e-9)
    return {
        name: function(truth[chosen], predicted[chosen]) if chosen.any() else np.nan
        for name, function, chosen in (
            ("rmse", root_mean_squared_error, known),
            ("rmse_undamped", root_mean_squared_error, undamped),
            ("mae", mean_absolute_error, known),
        )
    }
