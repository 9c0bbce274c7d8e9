"""A regressor that learns the difference between the exponent and linear theory from solved cells.

At small bearing numbers the rotor is strongly damped and the linear decay rate equals the exponent
within a few percent. Where the rotor whirls, the exponent is near 0 and linear theory gives no
value. So the baseline is the rate where it is negative and 0 elsewhere. The trees learn the
remainder times the bearing number, which is smooth because exponents grow as 1/bearing number.
"""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import ExtraTreesRegressor

from spab_core.linear_theory.linear_table import FEATURES, LinearFeatures, LinearTable

TREES = 100


def baseline(features: np.ndarray) -> np.ndarray:
    """Return the exponent by linear theory, (n,), per revolution, from features (n, 6): the rate of
    decay, 0 where the rotor whirls.
    """
    rate: np.ndarray = np.minimum(features[:, FEATURES.index("linear rate")], 0.0)
    return rate


class TheoryTrees(RegressorMixin, BaseEstimator):
    """Extra trees on bearing number, rotor mass, M and linear theory; their target is the exponent
    minus that of linear theory.

    Parameters
    ----------
    table : LinearTable
        Linear stability of the design.
    seed : int
    n_estimators : int
        Trees.
    """

    def __init__(self, table: LinearTable, seed: int = 0, n_estimators: int = TREES):
        self.table = table
        self.seed = seed
        self.n_estimators = n_estimators

    def _prepare(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        X = np.asarray(X, float)
        features = LinearFeatures(self.table).transform(X)
        return X[:, 0], features, baseline(features)

    def remainder(self, X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return inputs (n, 6) and targets (n,) of the trees for X (n, 2), bearing number and rotor
        mass in kg, and exponents y (n,).
        """
        number, features, linear = self._prepare(X)
        # to single precision: the last bits, which differ between processors, would pick among
        # splits that are alike in all others
        return features, ((y - linear) * number).astype(np.float32).astype(float)

    def fit(self, X: np.ndarray, y: np.ndarray) -> TheoryTrees:
        """Learn from X (n, 2), bearing number and rotor mass in kg, and exponents y (n,)."""
        forest = ExtraTreesRegressor(self.n_estimators, random_state=self.seed)
        self.trees_ = forest.fit(*self.remainder(X, y))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Return exponents (n,) at X (n, 2)."""
        number, features, linear = self._prepare(X)
        found: np.ndarray = linear + self.trees_.predict(features) / number
        return found
