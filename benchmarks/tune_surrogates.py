"""What else could learn the rest of linear theory, and with which settings: five folds INSIDE one
training set.

    python benchmarks/tune_surrogates.py [--divisor 8] [--seed 0]

No held-out cell is looked at. Columns: RMSE; RMSE without the largest 0.5 % of the errors (few
wrong cells of a solver decide the first); MAE, all per revolution; seconds for the five trainings.
"""

import argparse
import time
import warnings

import numpy as np
from sklearn.ensemble import (
    ExtraTreesRegressor,
    HistGradientBoostingRegressor,
    RandomForestRegressor,
)
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern, WhiteKernel
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from spab_core.linear_theory.linear_table import shipped_table
from spab_core.shipped.manifest import load_reference_map
from spab_core.surrogates.models import MODELS, solved_cells, train, training_mask
from spab_core.surrogates.theory_trees import TheoryTrees

FOLDS, GP_CELLS = 5, 1200


class Rest(TheoryTrees):
    """Any learner in place of the trees."""

    def __init__(self, table, learner, most=None):
        super().__init__(table)
        self.learner, self.most = learner, most

    def fit(self, X, y):
        number, features, linear = self._prepare(X)
        some = np.random.default_rng(0).permutation(len(y))[: self.most]
        self.learner.fit(features[some], ((y - linear) * number)[some])
        return self

    def predict(self, X):
        number, features, linear = self._prepare(X)
        return linear + self.learner.predict(features) / number


def options():
    """Label -> table -> regressor."""

    def rest(make, **settings):
        return lambda table: Rest(table, make(), **settings)

    found = {"extra trees": TheoryTrees}
    found["extra trees, half the features a cut"] = rest(
        lambda: ExtraTreesRegressor(100, max_features=0.5, random_state=0)
    )
    found["extra trees, leaves of 3"] = rest(
        lambda: ExtraTreesRegressor(100, min_samples_leaf=3, random_state=0)
    )
    found["random forest"] = rest(lambda: RandomForestRegressor(100, random_state=0))
    found["gradient boosting"] = rest(
        lambda: HistGradientBoostingRegressor(
            max_iter=600, learning_rate=0.1, max_leaf_nodes=63, min_samples_leaf=5, random_state=0
        )
    )
    found["four neighbours"] = rest(
        lambda: make_pipeline(StandardScaler(), KNeighborsRegressor(4, weights="distance"))
    )
    found["MLP 64, 64"] = rest(
        lambda: make_pipeline(
            StandardScaler(),
            MLPRegressor(hidden_layer_sizes=(64, 64), max_iter=400, random_state=0),
        )
    )
    found["MLP 128, 128, 128"] = rest(
        lambda: make_pipeline(
            StandardScaler(),
            MLPRegressor(hidden_layer_sizes=(128,) * 3, max_iter=200, random_state=0),
        )
    )
    found[f"Gaussian process on {GP_CELLS} cells"] = rest(
        lambda: make_pipeline(
            StandardScaler(),
            GaussianProcessRegressor(
                Matern(np.ones(6), nu=1.5) + WhiteKernel(0.01), normalize_y=True, random_state=0
            ),
        ),
        most=GP_CELLS,
    )
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--divisor", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="options whose label contains this")
    args = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    _, inputs, mle = solved_cells(load_reference_map())
    chosen = training_mask(len(mle), args.divisor, args.seed)
    inputs, mle = inputs[chosen], mle[chosen]
    fold = np.random.default_rng(args.seed).permutation(len(mle)) % FOLDS
    table = shipped_table()
    candidates = {
        f"without linear theory: {name}": name
        for name in ("extra-trees", "forest", "boosting", "cubic")
    } | options()
    print(f"{len(mle)} training cells, {FOLDS} folds\n{'':38s}   RMSE  trimmed    MAE  seconds")
    for label, option in candidates.items():
        if args.only not in label:
            continue
        error, began = np.empty(len(mle)), time.perf_counter()
        for k in range(FOLDS):
            seen, tried = fold != k, fold == k
            estimator = (
                train(MODELS[option], inputs[seen], mle[seen]).estimator
                if isinstance(option, str)
                else option(table).fit(inputs[seen], mle[seen])
            )
            error[tried] = np.abs(estimator.predict(inputs[tried]) - mle[tried])
        trimmed = np.sort(error)[: int(0.995 * len(error))]
        print(
            f"{label:38s} {np.sqrt(np.mean(error**2)):6.3f} {np.sqrt(np.mean(trimmed**2)):8.4f} "
            f"{error.mean():6.4f} {time.perf_counter() - began:6.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
