"""Regressors that start from linear theory: they learn what it leaves of the exponent, from the cells that were solved.

Where the rotor is strongly damped (small bearing number) the linear decay rate is the exponent but for a few percent; where
it whirls linear theory says nothing but that, and the exponent is near 0. So the baseline is the rate where it is negative, 0
elsewhere, and what remains is learnt times the bearing number, in which it is smooth: exponents grow as 1/bearing number.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import ExtraTreesRegressor

from spab_core.features import FEATURES, LinearFeatures, LinearTable

TREES = 100
STRETCH = 0.6  # of ln(bearing number) against rotor mass over its largest value: benchmarks/tune_surrogates.py
SPLINE_NEIGHBOURS = 8
_FOLDS, _FOLD_TREES = 5, 30
_LOCAL = 24  # training cells around a point that decide
_DAMPED = -2.0  # per revolution: linear theory is trusted below
_CONTRADICTION = 0.3  # of the linear rate


def baseline(features: np.ndarray) -> np.ndarray:
    """Exponent by linear theory, (n,), per revolution, from features (n, 6): the rate of decay, 0 where the rotor whirls."""
    return np.minimum(features[:, FEATURES.index("linear rate")], 0.0)


def credible(coordinates: np.ndarray, mle: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Which training cells do not contradict both linear theory and their neighbours.

    A solver that measures a strongly damped orbit badly reports too slow a decay; one such cell among the training cells
    spoils all around it. Only cells with a linear rate under -2 per revolution are judged, by the median over their 24
    nearest training cells of the relative departure from the linear rate, and only those that decay more slowly.

    Parameters
    ----------
    coordinates : ndarray, (n, 2)
        In which nearness counts.
    mle, linear : ndarray, (n,)
        Exponent solved and by linear theory, per revolution.

    Returns
    -------
    ndarray of bool, (n,)
    """
    departure = (mle - linear) / np.maximum(np.abs(linear), 1e-9)
    _, near = cKDTree(coordinates).query(coordinates, min(_LOCAL + 1, len(mle)))
    around = departure[near[:, 1:]]
    middle = np.median(around, axis=1)
    spread = np.median(np.abs(around - middle[:, None]), axis=1)
    return (linear > _DAMPED) | (departure - middle <= np.maximum(5.0 * spread, _CONTRADICTION))


class TheoryTrees(RegressorMixin, BaseEstimator):
    """Extra trees on bearing number, rotor mass, M and linear theory, for what linear theory leaves.

    Parameters
    ----------
    table : LinearTable
        Linear stability of the design.
    seed : int
    """

    def __init__(self, table: LinearTable, seed: int = 0):
        self.table = table
        self.seed = seed

    def _prepare(self, X):
        X = np.asarray(X, float)
        features = LinearFeatures(self.table).transform(X)
        place = np.column_stack([STRETCH * np.log(X[:, 0]), X[:, 1] / self.table.rotor_mass[-1]])
        return X[:, 0], features, place, baseline(features)

    def _rest(self, X, y):
        """Features, places and what is to be learnt, of the credible training cells."""
        number, features, place, linear = self._prepare(X)
        kept = credible(place, np.asarray(y, float), linear)
        return features[kept], place[kept], ((y - linear) * number)[kept]

    def fit(self, X, y):
        """Learn from X (n, 2), bearing number and rotor mass in kg, and exponents y (n,)."""
        features, _, rest = self._rest(X, y)
        self.trees_ = ExtraTreesRegressor(TREES, random_state=self.seed).fit(features, rest)
        return self

    def predict(self, X):
        """Exponents (n,) at X (n, 2)."""
        number, features, _, linear = self._prepare(X)
        return linear + self.trees_.predict(features) / number


class TheoryBlend(TheoryTrees):
    """The same trees blended with a local spline, each trusted where it did well on cells that it had not seen.

    Both members are trained on four fifths of the training cells and tried on the fifth left, five times; at a point each
    counts by the mean square of the other's errors over the 24 nearest training cells. The spline is linear in the
    distance, through the 8 nearest cells.

    Parameters
    ----------
    table : LinearTable
    seed : int
    """

    def fit(self, X, y):
        """As :meth:`TheoryTrees.fit`."""
        features, place, rest = self._rest(X, y)
        fold = np.random.default_rng(self.seed).permutation(len(rest)) % _FOLDS
        squares = np.empty((2, len(rest)))
        for k in range(_FOLDS):
            seen, tried = fold != k, fold == k
            trees = ExtraTreesRegressor(_FOLD_TREES, random_state=self.seed).fit(features[seen], rest[seen])
            squares[0, tried] = (trees.predict(features[tried]) - rest[tried])**2
            squares[1, tried] = (_spline(place[seen], rest[seen])(place[tried]) - rest[tried])**2
        self.trees_ = ExtraTreesRegressor(TREES, random_state=self.seed).fit(features, rest)
        self.spline_ = _spline(place, rest)
        self.places_ = cKDTree(place)
        _, near = self.places_.query(place, min(_LOCAL, len(rest)))
        tree_error, spline_error = squares[:, near].mean(axis=2) + 1e-12
        self.trust_in_trees_ = spline_error / (tree_error + spline_error)
        return self

    def predict(self, X):
        """Exponents (n,) at X (n, 2)."""
        number, features, place, linear = self._prepare(X)
        trust = self.trust_in_trees_[self.places_.query(place)[1]]
        return linear + (trust * self.trees_.predict(features) + (1.0 - trust) * self.spline_(place)) / number


def _spline(place, values):
    return RBFInterpolator(place, values, neighbors=min(SPLINE_NEIGHBOURS, len(values)), kernel="linear", degree=0)
