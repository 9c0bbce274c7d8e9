"""Predict all cells of a plane from the solved ones by a committee of randomised trees; score it on
a solved map.

One forest learns the difference between the exponent and linear theory, another the regime, or the
whole kind of motion: regime, period, assessment and contact at once, so that what is predicted of a
cell fits together. The spread among the trees of the first and the split of votes of the second
measure the doubt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor
from sklearn.metrics import mean_absolute_error, root_mean_squared_error

from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import FEATURES, LinearFeatures, LinearTable
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.metrics import regime_scores
from spab_core.surrogates.theory_trees import baseline
from spab_core.trajectory.assessment import CONTACT, GRADES, Motion, grades
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
PARTS = ("regime", "period", "assessment", "contact")  # of a kind of motion, in its name
RUBS = "rubs"  # the part ``contact`` of a motion that rubs
_JOINT = "|"  # between the parts
_LONGEST = 3  # periods from here on are one kind


def kinds_of_motion(design: Design, values: dict[str, np.ndarray]) -> np.ndarray:
    """Name the kinds of motion that a designer tells apart: regime, period 1, 2 or more, assessment
    by the motion alone, and whether it rubs.

    Parameters
    ----------
    design : Design
    values : dict of ndarray, (n,)
        Of solved cells, by the names of ``stability_map.FIELDS``.

    Returns
    -------
    ndarray of str, (n,)
        The :data:`PARTS`, joined.
    """
    parts = (
        values["regime"],
        np.minimum(values["period"], _LONGEST).astype(str),
        grades(design, Motion(*(values[name] for name in Motion._fields))),
        np.where(values["contact_share"] > CONTACT, RUBS, ""),
    )
    names = parts[0]
    for part in parts[1:]:
        names = np.char.add(np.char.add(names, _JOINT), part)
    return names


@dataclass(frozen=True)
class Votes:
    """Votes of the trees for the kinds of motion among the solved cells.

    Attributes
    ----------
    kinds : ndarray of str, (k,)
        Of :func:`kinds_of_motion`.
    share : ndarray, (n, k)
        Of the trees' votes.
    """

    kinds: np.ndarray
    share: Floats

    @property
    def winner(self) -> np.ndarray:
        """The kind with most votes, (n,) of str."""
        names: np.ndarray = self.kinds[self.share.argmax(1)]
        return names

    def probability(self, part: str, value: str) -> Floats:
        """Return the share of votes for kinds whose ``part``, of :data:`PARTS`, is ``value``,
        (n,).
        """
        where = _part(self.kinds, part) == value
        found: Floats = self.share[:, where].sum(1)
        return found


def _part(kinds: np.ndarray, part: str) -> np.ndarray:
    k = PARTS.index(part)
    return np.array([name.split(_JOINT)[k] for name in kinds.tolist()])


def _gini(probability: Floats) -> Floats:
    impurity: Floats = 1.0 - np.square(probability).sum(1)
    return impurity


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
    votes : Votes or None
        For whole kinds of motion, where they were learnt; ``probability`` is of the same votes.
    """

    mle: Floats
    deviation: Floats
    probability: Floats
    votes: Votes | None = None

    @property
    def regime(self) -> np.ndarray:
        """Most probable of :data:`LABELS`, (n,) of str; where whole kinds of motion were learnt,
        that of the most probable kind.
        """
        names, share = np.array(LABELS), self.probability
        if self.votes is not None:
            names, share = _part(self.votes.kinds, "regime").astype(names.dtype), self.votes.share
        found: np.ndarray = names[share.argmax(1)]
        return found

    @property
    def unstable(self) -> Floats:
        """Probability that the motion is not periodic, failed runs (touchdown) included, (n,)."""
        return 1.0 - self.probability[:, LABELS.index("periodic")]

    @property
    def impurity(self) -> Floats:
        """Gini impurity of the regime, (n,): the expected rate of wrong labels if labels were drawn
        with their probabilities. Where whole kinds of motion were learnt, the mean of those of the
        kind and of the assessment, whose borders count most.
        """
        if self.votes is None:
            return _gini(self.probability)
        worth = [self.votes.probability("assessment", grade) for grade in GRADES]
        return 0.5 * (_gini(self.votes.share) + _gini(np.column_stack(worth)))


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
    inputs: Inputs,
    solved: np.ndarray,
    mle: np.ndarray,
    regime: np.ndarray,
    seed: int = 0,
    kinds: np.ndarray | None = None,
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
    kinds : ndarray of str, (n,), optional
        Of :func:`kinds_of_motion`: learnt instead of the regime alone.

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
    # kinds with every feature tried at each cut, which has more cells right
    options = {} if kinds is None else {"max_features": None}
    trees = ExtraTreesClassifier(TREES, random_state=seed, **options)
    trees.fit(features[solved], (regime if kinds is None else kinds)[solved])
    names, share = trees.classes_.astype(str), trees.predict_proba(features)
    regimes = names if kinds is None else _part(names, "regime")
    probability = np.column_stack([share[:, regimes == label].sum(1) for label in LABELS])
    return Prediction(mean, deviation, probability, None if kinds is None else Votes(names, share))


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
