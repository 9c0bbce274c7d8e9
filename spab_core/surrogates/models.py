"""Models that predict a map from some of its cells: the paper's four, plain interpolation, and
better ones.

The protocol is the paper's (Kuo, Lee and Wang, IEEE Access 8, 2020, section IV): inputs (bearing
number, rotor mass) and target (exponent) scaled to [0, 1], training cells drawn at random without
replacement, predictions scaled back.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import (
    CloughTocher2DInterpolator,
    LinearNDInterpolator,
    NearestNDInterpolator,
)
from scipy.spatial import QhullError
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.compose import TransformedTargetRegressor
from sklearn.ensemble import (
    ExtraTreesRegressor,
    HistGradientBoostingRegressor,
    RandomForestRegressor,
)
from sklearn.exceptions import ConvergenceWarning
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MinMaxScaler
from sklearn.svm import SVR
from sklearn.tree import DecisionTreeRegressor

from spab_core.common.errors import InputError
from spab_core.common.validation import check_number
from spab_core.linear_theory.linear_table import LinearTable, shipped_table, table_for
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.theory_trees import TheoryTrees

DIVISORS = (2, 3, 4, 5, 6, 7, 8)  # training sets of n/2 ... n/8 cells
MIN_TRAINING = 8  # cells
SPLITS = ("random", "blocks")
BLOCKS = 10  # rectangles along each axis of the plane
WITHHELD = 0.25  # of the rectangles
TREES_A_STEP = 10  # of a forest that tells its progress
FLOOR = -1.0  # per revolution: what disturbs the motion has shrunk to 37 % after one revolution
FLOORS = (-1000.0, -0.01)  # that are allowed, per revolution
_FLOOR = "mle_floor"  # in a map's metadata
Progress = Callable[[int, int], None]  # steps done, steps in all


class Interpolation(RegressorMixin, BaseEstimator):
    """Piecewise polynomials over the Delaunay triangles of the samples; outside their hull the
    value of the nearest sample.

    Parameters
    ----------
    degree : int
        1: linear; 3: Clough and Tocher's cubic with continuous slopes.
    """

    def __init__(self, degree: int = 1):
        self.degree = degree

    def fit(self, X: np.ndarray, y: np.ndarray) -> Interpolation:
        """Triangulate the samples X (n, 2) with values y (n,).

        Raises InputError if they lie on one line.
        """
        kind = {1: LinearNDInterpolator, 3: CloughTocher2DInterpolator}[self.degree]
        try:
            self.inside_ = kind(X, y)
        except QhullError:
            raise InputError(
                "the training cells lie on one line: interpolation needs a plane"
            ) from None
        self.outside_ = NearestNDInterpolator(X, y)
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Return values at X (n, 2)."""
        values = np.asarray(self.inside_(X), float)
        missing = ~np.isfinite(values)
        values[missing] = self.outside_(np.asarray(X)[missing])
        return values


@dataclass(frozen=True)
class Model:
    """A kind of surrogate.

    Attributes
    ----------
    name : str
        As in the command line.
    label : str
        As in tables and figures.
    group : str
        ``paper``, ``interpolation`` or ``better``.
    build : callable
        Seed -> scikit-learn regressor on scaled inputs and target; with ``theory``, seed and linear
        table of the design -> regressor on bearing number, rotor mass and exponent as they are.
    theory : bool
        Whether it starts from linear theory.
    """

    name: str
    label: str
    group: str
    build: Callable[..., BaseEstimator]
    theory: bool = False


MODELS = {
    model.name: model
    for model in (
        # section IV.B of the paper; what it does not say is scikit-learn's default
        Model(
            "mlp",
            "MLP",
            "paper",
            lambda seed: MLPRegressor(
                hidden_layer_sizes=(10,),
                activation="relu",
                solver="adam",
                max_iter=500,
                random_state=seed,
            ),
        ),
        Model("svr", "SVR", "paper", lambda seed: SVR(kernel="rbf", C=1.0)),
        Model(
            "tree",
            "Decision tree",
            "paper",
            lambda seed: DecisionTreeRegressor(max_depth=20, random_state=seed),
        ),
        Model(
            "forest",
            "Random forest",
            "paper",
            lambda seed: RandomForestRegressor(n_estimators=100, max_depth=20, random_state=seed),
        ),
        Model(
            "nearest",
            "Nearest sample",
            "interpolation",
            lambda seed: KNeighborsRegressor(n_neighbors=1),
        ),
        Model("linear", "Linear interpolation", "interpolation", lambda seed: Interpolation(1)),
        Model("cubic", "Cubic interpolation", "interpolation", lambda seed: Interpolation(3)),
        Model(
            "extra-trees",
            "Extra trees",
            "better",
            lambda seed: ExtraTreesRegressor(
                n_estimators=100, min_samples_leaf=1, random_state=seed
            ),
        ),
        Model(
            "boosting",
            "Gradient boosting",
            "better",
            lambda seed: HistGradientBoostingRegressor(
                max_iter=600,
                learning_rate=0.1,
                max_leaf_nodes=63,
                min_samples_leaf=5,
                random_state=seed,
            ),
        ),
        Model(
            "neighbours",
            "Four neighbours",
            "better",
            lambda seed: KNeighborsRegressor(n_neighbors=4, weights="distance"),
        ),
        Model(
            "theory-trees",
            "Trees on linear theory",
            "better",
            lambda seed, table: TheoryTrees(table, seed),
            theory=True,
        ),
    )
}


def model(name: str) -> Model:
    """Return the model of that name; raise :class:`InputError` with the known names otherwise."""
    if name not in MODELS:
        raise InputError(f"model = {str(name)[:40]!r} is not allowed: choose {', '.join(MODELS)}")
    return MODELS[name]


def floored(m: StabilityMap, floor: float | None) -> StabilityMap:
    """Return the map with its exponents cut off at a floor: another target for the same models.

    Scaling to [0, 1] gives most of its range to cells that are damped within a revolution, and how
    fast decides nothing. All that is trained, predicted and scored on the map that is returned has
    the floor: it stands in its metadata.

    Parameters
    ----------
    m : StabilityMap
    floor : float or None
        Per revolution; smaller exponents are set to it. None: the map as it is.

    Raises
    ------
    InputError
        For a floor outside :data:`FLOORS`.
    """
    if floor is None:
        return m
    check_number("floor", floor, *FLOORS, "per revolution")
    return replace(m, mle=np.maximum(m.mle, floor), metadata={**m.metadata, _FLOOR: float(floor)})


def floor_of(m: StabilityMap) -> float | None:
    """Return the floor of a map of :func:`floored`, per revolution; None for any other.

    Raises ``InputError`` for a map whose file names a floor outside :data:`FLOORS`.
    """
    floor = m.metadata.get(_FLOOR)
    return None if floor is None else check_number(_FLOOR, floor, *FLOORS, "per revolution")


def floored_table(table: LinearTable, floor: float | None) -> LinearTable:
    """Return linear theory for models of a map of :func:`floored`: its rates end at the floor."""
    return table if floor is None else replace(table, rate=np.maximum(table.rate, floor))


def solved_cells(m: StabilityMap) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the cells that have an exponent: flat indices (n,), inputs (n, 2) as bearing number
    and rotor mass, exponents (n,).
    """
    number, mass = np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij")
    index = np.flatnonzero(np.isfinite(m.mle))
    return (
        index,
        np.column_stack([number.ravel()[index], mass.ravel()[index]]),
        m.mle.ravel()[index],
    )


def training_mask(count: int, divisor: int, seed: int) -> np.ndarray:
    """Draw count // divisor training cells out of ``count`` without replacement.

    Returns a mask (count,) of bool.

    Raises
    ------
    InputError
        If that gives fewer than :data:`MIN_TRAINING` cells.
    """
    if not 1 <= divisor <= max(count // MIN_TRAINING, 1) or count < MIN_TRAINING:
        raise InputError(
            f"training fraction 1/{divisor} of {count} cells is out of range: at least "
            f"{MIN_TRAINING} cells are "
            "needed to train"
        )
    mask = np.zeros(count, bool)
    mask[np.random.default_rng(seed).permutation(count)[: count // divisor]] = True
    return mask


def block_split(m: StabilityMap, divisor: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Withhold a quarter of 10 x 10 rectangles of the plane and draw training cells outside them: a
    harder split than cells at random.

    Parameters
    ----------
    m : StabilityMap
    divisor : int
        As many training cells as in :func:`training_mask`: 1/divisor of all solved ones.
    seed : int

    Returns
    -------
    chosen, withheld : ndarray of bool, (solved cells,)
        Training cells, and the cells of the withheld rectangles.

    Raises
    ------
    InputError
        If too few cells are left outside.
    """
    index, _, _ = solved_cells(m)
    count = len(index)
    rows, columns = np.unravel_index(index, m.shape)
    block = rows * BLOCKS // m.shape[0] * BLOCKS + columns * BLOCKS // m.shape[1]
    random = np.random.default_rng(seed)
    withheld = np.isin(block, random.permutation(BLOCKS**2)[: round(WITHHELD * BLOCKS**2)])
    outside = np.flatnonzero(~withheld)
    if not 1 <= divisor <= max(
        count // MIN_TRAINING, 1
    ) or not MIN_TRAINING <= count // divisor <= len(outside):
        raise InputError(
            f"training fraction 1/{divisor} of {count} cells is out of range: at least "
            f"{MIN_TRAINING} cells, and "
            f"at most the {len(outside)} outside the withheld rectangles can be trained on"
        )
    chosen = np.zeros(count, bool)
    chosen[random.permutation(outside)[: count // divisor]] = True
    return chosen, withheld


def split_cells(
    m: StabilityMap, divisor: int, seed: int, split: str = "random"
) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of the training cells and of the cells that errors are measured on, among the
    solved ones, by a split of :data:`SPLITS`.

    Raises
    ------
    InputError
        For too few cells or another split.
    """
    if split == "blocks":
        return block_split(m, divisor, seed)
    if split != "random":
        raise InputError(f"split = {str(split)[:40]!r} is not allowed: choose {', '.join(SPLITS)}")
    chosen = training_mask(int(np.isfinite(m.mle).sum()), divisor, seed)
    return chosen, ~chosen


@dataclass(frozen=True)
class Surrogate:
    """A trained model.

    Attributes
    ----------
    model : Model
    estimator : object
        scikit-learn regressor, scaling included.
    seed : int
    training_cells : int
    seconds : float
        Of training.
    converged : bool or None
        Whether an iterative training ended by its own criterion; None where nothing iterates.
    """

    model: Model
    estimator: BaseEstimator
    seed: int
    training_cells: int
    seconds: float
    converged: bool | None

    def predict(self, bearing_number: np.ndarray, rotor_mass: np.ndarray) -> np.ndarray:
        """Return exponents per revolution at points, arrays of one shape; rotor mass in kg."""
        number, mass = np.broadcast_arrays(
            np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
        )
        found: np.ndarray = self.estimator.predict(np.column_stack([number.ravel(), mass.ravel()]))
        return found.reshape(number.shape)


def linear_table_of(m: StabilityMap) -> LinearTable:
    """Return linear stability of a map's design over at least the map's plane: the shipped table,
    or one computed in half a minute; of a map of :func:`floored` with its floor.

    Raises
    ------
    InputError
        If the design has no static equilibrium anywhere in the plane.
    """
    number, mass = m.bearing_number, m.rotor_mass
    plane = ((float(number.min()), float(number.max())), (float(mass.min()), float(mass.max())))
    return floored_table(table_for(m.design, plane), floor_of(m))


def train(
    kind: Model,
    inputs: np.ndarray,
    mle: np.ndarray,
    seed: int = 0,
    table: LinearTable | None = None,
    progress: Progress | None = None,
) -> Surrogate:
    """Train one model.

    Parameters
    ----------
    kind : Model
    inputs : ndarray, (n, 2)
        Bearing number and rotor mass in kg.
    mle : ndarray, (n,)
        Per revolution, finite.
    seed : int
    table : LinearTable
        Of the design (:func:`linear_table_of`), for models that start from linear theory; left out:
        the reference design's.
    progress : callable
        Called with the number of steps done and in total: trees of a forest, else one step.

    Returns
    -------
    Surrogate
    """
    if kind.theory:
        estimator = kind.build(seed, table or shipped_table())
    else:
        estimator = TransformedTargetRegressor(
            make_pipeline(MinMaxScaler(), kind.build(seed)), transformer=MinMaxScaler()
        )
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # told by ``converged``
        _fit(estimator, inputs, mle, progress or (lambda done, total: None))
    seconds = time.perf_counter() - began
    inner = None if kind.theory else estimator.regressor_[-1]
    converged = inner.n_iter_ < inner.max_iter if isinstance(inner, MLPRegressor) else None
    return Surrogate(kind, estimator, seed, len(mle), seconds, converged)


def _fit(estimator: BaseEstimator, X: np.ndarray, y: np.ndarray, progress: Progress) -> None:
    """Fit an estimator; grow a forest some trees at a time, bit for bit as in a single fit."""
    theory = isinstance(estimator, TheoryTrees)
    unfitted = estimator if theory else estimator.regressor[-1]
    total = getattr(unfitted, "n_estimators", 1)
    progress(0, total)
    if total > 1:
        unfitted.set_params(n_estimators=min(TREES_A_STEP, total))
    estimator.fit(X, y)
    if total > 1:
        unfitted.set_params(n_estimators=total)
        if theory:
            forest, (X, y) = estimator.trees_, estimator.remainder(X, y)
        else:
            forest, X = estimator.regressor_[-1], estimator.regressor_[:-1].transform(X)
            y = estimator.transformer_.transform(y[:, None])[:, 0]
        for done in range(TREES_A_STEP, total, TREES_A_STEP):
            progress(done, total)
            count = min(done + TREES_A_STEP, total)
            forest.set_params(n_estimators=count, warm_start=True).fit(X, y)
        forest.set_params(warm_start=False)
    progress(total, total)


@dataclass(frozen=True)
class PredictedMap:
    """A map predicted from some of its own cells.

    Attributes
    ----------
    model : Model
    divisor, seed : int
    mle : ndarray, (B, M)
        Predicted for every cell where the map has an exponent; nan elsewhere.
    trained : ndarray of bool, (B, M)
        The training cells.
    surrogate : Surrogate
    predict_seconds : float
        For the whole map.
    withheld : ndarray of bool, (B, M), or None
        The cells of withheld rectangles; None if training cells were drawn from the whole plane.
    """

    model: Model
    divisor: int
    seed: int
    mle: np.ndarray
    trained: np.ndarray
    surrogate: Surrogate
    predict_seconds: float
    withheld: np.ndarray | None = None

    @property
    def held_out(self) -> np.ndarray:
        """Mask (B, M) of the cells that errors are measured on: those with an exponent outside the
        training cells; after a split by blocks only the withheld ones.
        """
        tested = ~self.trained if self.withheld is None else self.withheld
        found: np.ndarray = np.isfinite(self.mle) & tested
        return found


def predict_map(
    m: StabilityMap,
    kind: Model,
    divisor: int,
    seed: int = 0,
    split: str = "random",
    progress: Progress | None = None,
) -> PredictedMap:
    """Train on 1/divisor of a map's cells and predict all of them.

    Parameters
    ----------
    m : StabilityMap
    kind : Model
    divisor : int
        The paper's: 2 to 8.
    seed : int
        Of the choice of cells and of the model.
    split : str
        Of :data:`SPLITS`.
    progress : callable
        As of :func:`train`.

    Returns
    -------
    PredictedMap

    Raises
    ------
    InputError
        For too few cells.
    """
    index, inputs, mle = solved_cells(m)
    chosen, tested = split_cells(m, divisor, seed, split)
    table = linear_table_of(m) if kind.theory else None
    surrogate = train(kind, inputs[chosen], mle[chosen], seed, table, progress)
    began = time.perf_counter()
    predicted = np.full(m.mle.size, np.nan)
    predicted[index] = surrogate.estimator.predict(inputs)
    seconds = time.perf_counter() - began
    trained, withheld = np.zeros((2, m.mle.size), bool)
    trained[index[chosen]] = True
    withheld[index[tested]] = True
    return PredictedMap(
        kind,
        divisor,
        seed,
        predicted.reshape(m.shape),
        trained.reshape(m.shape),
        surrogate,
        seconds,
        withheld.reshape(m.shape) if split == "blocks" else None,
    )
