"""Open files of trained models, after checking everything about them.

Opening a joblib file can run any code. A file is unpickled only if the manifest of artifacts/ names
it with the SHA-256 of its bytes, or if it lies in the private folder of
:mod:`spab_core.shipped.model_cache`; and only if the design, the map, the training code and the
library versions that matter to a pickle are those it was made with. It is used only if it then
reproduces the predictions noted with it (docs/artifacts.md). Python's own version does not matter.
"""

from __future__ import annotations

import hashlib
import io
import threading
import warnings
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from sklearn.base import BaseEstimator
from sklearn.exceptions import InconsistentVersionWarning
from threadpoolctl import threadpool_limits

from spab_core.maps.stability_map import StabilityMap
from spab_core.shipped import model_cache
from spab_core.shipped.manifest import ARTIFACTS, ArtifactError, checked_bytes, read_manifest
from spab_core.shipped.provenance import (
    design_hash,
    difference,
    intervals_source,
    map_hash,
    model_source,
)
from spab_core.surrogates.classifier import REGIME, LabelTrees
from spab_core.surrogates.models import Model, Surrogate, linear_table_of
from spab_core.surrogates.uncertainty import Certainty, certainty

SEED = 0  # of what is shipped

# per revolution or of a probability; without AVX and with another BLAS kernel predictions moved by
# 2e-14
SAME = 1e-6

_GRID = 4  # predictions noted with a model: at 4 x 4 cells over the plane


def model_file(kind: Model, divisor: int) -> str:
    """Return the name of a shipped model's file."""
    return f"surrogate_{kind.name}_n{divisor}.joblib"


def intervals_file(kind: Model, divisor: int) -> str:
    """Return the name of the file of the models behind a shipped model's intervals."""
    return f"intervals_{kind.name}_n{divisor}.joblib"


def cache_name(m: StabilityMap, kind: Model, divisor: int, seed: int) -> str:
    """Return the name of a model's file in the cache; each map and design has its own."""
    place = hashlib.sha256(f"{map_hash(m)} {design_hash(m.design)}".encode()).hexdigest()[:16]
    return f"{kind.name}_n{divisor}_seed{seed}_{place}.joblib"


def dump(fitted: object, compress: int | tuple[str, int] = ("xz", 6)) -> bytes:
    """Return fitted estimators as a joblib file; the same training gives the same bytes."""
    buffer = io.BytesIO()
    joblib.dump(fitted, buffer, compress=compress)
    return buffer.getvalue()


def plain(surrogate: Surrogate) -> BaseEstimator:
    """Return the scikit-learn estimator in a trained model, whose file does not name modules of
    this project.
    """
    return surrogate.estimator.trees_ if surrogate.model.theory else surrogate.estimator


def _around(
    fitted: BaseEstimator,
    m: StabilityMap,
    kind: Model,
    seed: int,
    cells: int,
    converged: bool | None,
) -> Surrogate:
    """Return the surrogate that contains an estimator of :func:`plain`."""
    estimator = fitted
    if kind.theory:
        estimator = kind.build(seed, linear_table_of(m))
        estimator.trees_ = fitted
    return Surrogate(kind, estimator, seed, cells, float("nan"), converged)


def plain_certainty(known: Certainty) -> list[BaseEstimator]:
    """Return the scikit-learn estimators of the models behind intervals."""
    found = known.calibrated
    return [plain(found.surrogate), found.classifier.trees_, known.regimes.trees_]


def describe(surrogate: Surrogate) -> dict[str, Any]:
    """Return ``training_cells`` and ``converged`` of a model, for its manifest entry."""
    return {"training_cells": surrogate.training_cells, "converged": surrogate.converged}


def _noted_points(m: StabilityMap) -> tuple[np.ndarray, np.ndarray]:
    """Return bearing numbers and rotor masses (16,) of cells spread evenly over a map."""
    axes = [
        a[[(2 * k + 1) * len(a) // (2 * _GRID) for k in range(_GRID)]]
        for a in (m.bearing_number, m.rotor_mass)
    ]
    number, mass = np.meshgrid(*axes, indexing="ij")
    return number.ravel(), mass.ravel()


def predictions(m: StabilityMap, trained: Surrogate | Certainty) -> dict[str, Any]:
    """Return ``predictions`` at 4 x 4 cells over the plane, noted with a model and compared when it
    is opened.

    Exponents per revolution; for the models behind intervals the lower and upper bounds, the
    probability of instability and that of each regime.
    """
    points = _noted_points(m)
    with threadpool_limits(1):
        if isinstance(trained, Surrogate):
            found = trained.predict(*points)
        else:
            found = np.concatenate(
                [
                    *trained.calibrated.intervals(*points),
                    trained.calibrated.unstable(*points),
                    *trained.regimes.predict_proba(np.column_stack(points)).T,
                ]
            )
    return {"predictions": found.tolist()}


_UNPICKLING = threading.Lock()  # warnings are caught for the whole process


def _unpickle(name: str, data: bytes, retrain: str) -> Any:
    """Unpickle bytes that were checked.

    Raises :class:`ArtifactError` if they cannot be opened, or only with a warning.
    """
    try:
        with _UNPICKLING, warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = joblib.load(io.BytesIO(data))
    except (
        Exception
    ) as error:  # the bytes are the right ones: something else is broken, which training mends
        raise ArtifactError(
            f"{name} cannot be opened ({type(error).__name__}: {str(error)[:100]}); {retrain}"
        ) from None
    for warning in told:
        if not issubclass(
            warning.category, InconsistentVersionWarning
        ):  # of another patch: what it predicts decides
            raise ArtifactError(
                f"{name} is not used: opening it warns ({str(warning.message)[:100]}); {retrain}"
            )
    return found


def _check_predictions(
    name: str, m: StabilityMap, noted: dict[str, Any], trained: Surrogate | Certainty, retrain: str
) -> None:
    try:
        expected = np.array(noted["predictions"], float)
        found = np.array(predictions(m, trained)["predictions"])
        apart = float(np.abs(found - expected).max()) if found.shape == expected.shape else np.inf
    except Exception as error:
        raise ArtifactError(
            f"{name} is not used: it cannot predict ({type(error).__name__}: {str(error)[:100]}); "
            f"{retrain}"
        ) from None
    if not apart <= SAME:
        raise ArtifactError(
            f"{name} is not used: with these libraries its predictions differ by up to "
            f"{apart:.3g} from those noted with it; {retrain}"
        )


def _noted(name: str, noted: object, wanted: dict[str, Any], retrain: str) -> dict[str, Any]:
    """Return the entry of a file in the manifest or side file if it was made from ``wanted``.

    Raises :class:`ArtifactError`.
    """
    if apart := difference(noted, wanted):
        raise ArtifactError(f"{name} is not opened: {apart}; {retrain}")
    assert isinstance(noted, dict)
    if not isinstance(noted.get("training_cells"), int) or noted.get("converged") not in (
        None,
        True,
        False,
    ):
        raise ArtifactError(
            f"{name} is not opened: its entry in the manifest or side file is damaged; {retrain}"
        )
    return noted


def _open_shipped(
    name: str, what: str, wanted: dict[str, Any], retrain: str, folder: Path
) -> tuple[Any, dict[str, Any]]:
    """Return the content of a shipped file and its manifest entry, after checking both.

    Raises :class:`ArtifactError`.
    """
    if name not in read_manifest(folder):
        raise ArtifactError(f"{what} not shipped; {retrain}")
    data = checked_bytes(name, folder)
    noted = _noted(name, read_manifest(folder)[name].get("made_from"), wanted, retrain)
    return _unpickle(name, data, retrain), noted


def load_shipped_model(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS
) -> Surrogate:
    """Check and open a shipped model; its training ``seconds`` are nan.

    Raises
    ------
    ArtifactError
        If it is not shipped, is damaged, was made with other library versions, for another design
        or from another map, or does not reproduce its noted predictions; the message says how to
        train it again.
    """
    name, what = model_file(kind, divisor), f"{kind.label} trained on n/{divisor} is"
    retrain = (
        f"`spab train --model {kind.name} --divisor {divisor}` trains it again on this machine"
    )
    wanted = model_source(m, kind, divisor, seed)
    fitted, noted = _open_shipped(name, what, wanted, retrain, folder)
    found = _around(fitted, m, kind, seed, noted["training_cells"], noted.get("converged"))
    _check_predictions(name, m, noted, found, retrain)
    return found


def load_shipped_certainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS
) -> Certainty:
    """Check and open the shipped models behind a model's intervals, as :func:`load_shipped_model`,
    and calibrate them.

    Raises
    ------
    ArtifactError
    """
    name, retrain = intervals_file(kind, divisor), "they are trained again on this machine"
    what = f"the intervals of {kind.label} trained on n/{divisor} are"
    wanted = intervals_source(m, kind, divisor, seed)
    fitted, noted = _open_shipped(name, what, wanted, retrain, folder)
    try:
        inner, *trees = fitted
        table = linear_table_of(m)
        first, last = (LabelTrees(REGIME, table, seed).with_trees(forest) for forest in trees)
        surrogate = _around(inner, m, kind, seed, noted["training_cells"], None)
        found = certainty(m, kind, divisor, seed, (surrogate, first, last))
    except Exception as error:
        raise ArtifactError(
            f"{name} cannot be used ({type(error).__name__}: {str(error)[:100]}); {retrain}"
        ) from None
    _check_predictions(name, m, noted, found, retrain)
    return found


def load_kept_model(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED
) -> Surrogate | None:
    """Check and open a model that this user trained before; None if there is none.

    Raises
    ------
    ArtifactError
        If there is one that must not be opened.
    """
    name = cache_name(m, kind, divisor, seed)
    found = model_cache.read(name)
    if found is None:
        return None
    noted = _noted(name, found[1], model_source(m, kind, divisor, seed), "it is trained again")
    estimator = _unpickle(name, found[0], "it is trained again")
    kept = Surrogate(
        kind, estimator, seed, noted["training_cells"], float("nan"), noted.get("converged")
    )
    _check_predictions(name, m, noted, kept, "it is trained again")
    return kept


def keep_model(m: StabilityMap, surrogate: Surrogate, divisor: int) -> Path:
    """Keep a trained model in the cache and return its path.

    Raises :class:`model_cache.CacheError`.
    """
    kind, seed = surrogate.model, surrogate.seed
    model_cache.cache_folder()  # before a forest is compressed in vain
    noted = model_source(m, kind, divisor, seed) | describe(surrogate) | predictions(m, surrogate)
    return model_cache.keep(
        cache_name(m, kind, divisor, seed), dump(surrogate.estimator, ("zlib", 1)), noted
    )
