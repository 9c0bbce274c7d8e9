"""Trained surrogates and their predicted maps: shipped, kept on this machine, or trained now.

A joblib file is code to whoever opens it. One is opened only where the manifest of artifacts/ names
it with the SHA-256 of its bytes, or the private folder of :mod:`spab_core.shipped.model_cache`
holds it, and only where the versions that change a pickle's meaning, design, map and training code
are those it was made with. All of that is checked before unpickling. It is used only if it then
predicts what was noted with it (docs/artifacts.md). Python's own version does not matter."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib.metadata
import io
import json
import platform
import threading
import time
import warnings
from dataclasses import dataclass, fields
from pathlib import Path
from types import ModuleType
from typing import Any

import joblib
import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import InconsistentVersionWarning
from threadpoolctl import threadpool_limits

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.npz import npz_bytes
from spab_core.common.source_hash import source_hash
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.linear_theory import linear_table as features
from spab_core.maps.stability_map import FIELDS, StabilityMap
from spab_core.shipped import model_cache
from spab_core.shipped.manifest import (
    ARTIFACTS,
    PREDICTIONS,
    SECONDS,
    ArtifactError,
    checked_bytes,
    read_manifest,
)
from spab_core.surrogates import classifier, uncertainty
from spab_core.surrogates import models as surrogates
from spab_core.surrogates import theory_trees as theory_models
from spab_core.surrogates.classifier import RegimeTrees
from spab_core.surrogates.models import (
    MODELS,
    Model,
    PredictedMap,
    Progress,
    Surrogate,
    linear_table_of,
    predict_map,
    solved_cells,
    training_mask,
)
from spab_core.surrogates.uncertainty import Certainty, certainty

SEED = 0  # of what is shipped
DEFAULT = ("theory-trees", 8)  # model and fraction n/8 that pages begin with
LIBRARIES = ("numpy", "scipy", "scikit-learn", "joblib", "numba")
MEANING = {"scikit-learn": 2, "numpy": 1}  # how many numbers of a version say what a pickle means
RECIPE = (
    features,
    surrogates,
    theory_models,
)  # modules whose code makes a trained model what it is
INTERVALS_RECIPE = (*RECIPE, classifier, uncertainty)
# per revolution or of a probability; without AVX and with another BLAS kernel predictions moved by
# 2e-14
SAME = 1e-6
_MAPS_JSON = {"metadata": ("divisors", "models", "masks")}  # of the file of predicted maps
_GRID = 4  # predictions noted with a model: at 4 x 4 cells over the plane


@functools.cache
def versions() -> dict[str, str]:
    """What a model is made with, noted with it: Python's version without its last number, the
    libraries' in full.
    """
    return {"python": ".".join(platform.python_version_tuple()[:2])} | {
        name: importlib.metadata.version(name) for name in LIBRARIES
    }


def _meaning(name: str, version: object) -> str:
    return ".".join(str(version).split(".")[: MEANING[name]])[:20]


def design_hash(design: Design) -> str:
    """SHA-256 of a design's values."""
    return hashlib.sha256(json.dumps(design.to_dict(), sort_keys=True).encode()).hexdigest()


def map_hash(m: StabilityMap) -> str:
    """SHA-256 of a map's axes and cells; its metadata (date, versions) left out."""
    digest = hashlib.sha256()
    for name, dtype in {"bearing_number": np.float64, "rotor_mass": np.float64, **FIELDS}.items():
        array = np.ascontiguousarray(getattr(m, name), dtype)
        digest.update(f"{name} {array.shape} {array.dtype.str}".encode() + array.tobytes())
    return digest.hexdigest()


@functools.cache
def recipe_hash(modules: tuple[ModuleType, ...] = RECIPE) -> str:
    """Hash of modules' code, wherever they stand and however they are laid out
    (:mod:`spab_core.common.source_hash`).
    """
    return source_hash(Path(str(module.__file__)).read_bytes() for module in modules)


def made_from(m: StabilityMap) -> dict:
    """What anything computed from a map with surrogates comes from: ``versions``, ``recipe``,
    ``design``, ``map``.
    """
    return {
        "versions": versions(),
        "recipe": recipe_hash(),
        "design": design_hash(m.design),
        "map": map_hash(m),
    }


def model_source(m: StabilityMap, kind: Model, divisor: int, seed: int) -> dict:
    """:func:`made_from` of one trained model: ``model``, ``divisor`` and ``seed`` too."""
    return made_from(m) | {"model": kind.name, "divisor": divisor, "seed": seed}


def difference(noted: object, wanted: dict) -> str | None:
    """What, of all that ``wanted`` names, is otherwise in ``noted``: one clause for a sentence, or
    None.

    Of versions only the numbers of :data:`MEANING` count.

    Parameters
    ----------
    noted : object
        What a manifest or side file says; anything at all.
    wanted : dict
        Of :func:`made_from` or :func:`model_source`, or part of it.
    """
    if not isinstance(noted, dict):
        return "nothing is noted of what it was made from"
    found = noted.get("versions")
    for name, now in (
        (name, _meaning(name, wanted["versions"][name])) for name in MEANING if "versions" in wanted
    ):
        before = _meaning(name, found.get(name) if isinstance(found, dict) else None)
        if before != now:
            return f"it was made with {name} {before} and this is {name} {now}"
    words = {
        "design": "it was made for another design",
        "map": "it was made from another map",
        "recipe": "the code that makes it has changed since",
    }
    for key in wanted.keys() - {"versions"}:
        if noted.get(key) != wanted[key]:
            return words.get(key, f"it has {key} {str(noted.get(key))[:40]} and not {wanted[key]}")
    return None


def model_file(kind: Model, divisor: int) -> str:
    """Name of a shipped model's file."""
    return f"surrogate_{kind.name}_n{divisor}.joblib"


def intervals_file(kind: Model, divisor: int) -> str:
    """Name of the file of the models behind a shipped model's intervals."""
    return f"intervals_{kind.name}_n{divisor}.joblib"


def dump(fitted: object, compress=("xz", 6)) -> bytes:
    """Fitted estimators as the bytes of a joblib file; the same training gives the same bytes."""
    buffer = io.BytesIO()
    joblib.dump(fitted, buffer, compress=compress)
    return buffer.getvalue()


def plain(surrogate: Surrogate) -> BaseEstimator:
    """A trained model as scikit-learn's own estimators alone: a file of it opens wherever the code
    of this project stands.
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
    """The surrogate of what :func:`plain` took out."""
    estimator = fitted
    if kind.theory:
        estimator = kind.build(seed, linear_table_of(m))
        estimator.trees_ = fitted
    return Surrogate(kind, estimator, seed, cells, float("nan"), converged)


def plain_certainty(known: Certainty) -> list[BaseEstimator]:
    """The trained models behind intervals as scikit-learn's own estimators alone."""
    found = known.calibrated
    return [plain(found.surrogate), found.classifier.trees_, known.regimes.trees_]


def describe(surrogate: Surrogate) -> dict:
    """What the manifest says of a model beside its source: ``training_cells``, ``converged``."""
    return {"training_cells": surrogate.training_cells, "converged": surrogate.converged}


def _noted_points(m: StabilityMap) -> tuple[np.ndarray, np.ndarray]:
    """Bearing numbers and rotor masses (16,) of cells spread evenly over a map."""
    axes = [
        a[[(2 * k + 1) * len(a) // (2 * _GRID) for k in range(_GRID)]]
        for a in (m.bearing_number, m.rotor_mass)
    ]
    number, mass = np.meshgrid(*axes, indexing="ij")
    return number.ravel(), mass.ravel()


def predictions(m: StabilityMap, trained: Surrogate | Certainty) -> dict:
    """What is noted with a model to compare with once it is opened: ``predictions`` at 4 x 4 cells
    over the plane.

    Exponents per revolution; of the models behind intervals lower bounds, upper ones, and the
    probabilities of instability and of each regime."""
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
    """The content of checked bytes.

    Raises :class:`ArtifactError` for what cannot be opened, or only with a warning.
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
    name: str, m: StabilityMap, noted: dict, trained: Surrogate | Certainty, retrain: str
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
            f"{name} is not used: with these libraries it predicts up to {apart:.3g} from what "
            "was noted with "
            f"it; {retrain}"
        )


def _noted(name: str, noted: object, wanted: dict, retrain: str) -> dict:
    """What is noted of a file, if it was made from what is wanted.

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
        raise ArtifactError(f"{name} is not opened: what is noted of it is damaged; {retrain}")
    return noted


def load_shipped_model(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS
) -> Surrogate:
    """A shipped model after everything about it is checked; ``seconds`` of training are nan.

    Raises
    ------
    ArtifactError
        Where it is not shipped, damaged, made with libraries that mean something else by it, for
        another design or from another map, or does not predict what was noted with it; says how to
        train it again.
    """
    name = model_file(kind, divisor)
    retrain = (
        f"`spab train --model {kind.name} --divisor {divisor}` trains it again on this machine"
    )
    if name not in read_manifest(folder):
        raise ArtifactError(f"{kind.label} trained on n/{divisor} is not shipped; {retrain}")
    data = checked_bytes(name, folder)
    noted = _noted(
        name,
        read_manifest(folder)[name].get("made_from"),
        model_source(m, kind, divisor, seed),
        retrain,
    )
    fitted = _unpickle(name, data, retrain)
    found = _around(fitted, m, kind, seed, noted["training_cells"], noted.get("converged"))
    _check_predictions(name, m, noted, found, retrain)
    return found


def intervals_source(m: StabilityMap, kind: Model, divisor: int, seed: int) -> dict:
    """:func:`model_source` of the models behind intervals."""
    return model_source(m, kind, divisor, seed) | {"recipe": recipe_hash(INTERVALS_RECIPE)}


def load_shipped_certainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS
) -> Certainty:
    """The shipped models behind a model's intervals, checked as :func:`load_shipped_model` and
    calibrated.

    Raises
    ------
    ArtifactError
    """
    name, retrain = intervals_file(kind, divisor), "they are trained again on this machine"
    if name not in read_manifest(folder):
        raise ArtifactError(
            f"the intervals of {kind.label} trained on n/{divisor} are not shipped; {retrain}"
        )
    data = checked_bytes(name, folder)
    noted = _noted(
        name,
        read_manifest(folder)[name].get("made_from"),
        intervals_source(m, kind, divisor, seed),
        retrain,
    )
    fitted = _unpickle(name, data, retrain)
    try:
        inner, *trees = fitted
        first, last = (RegimeTrees(linear_table_of(m), seed).with_trees(forest) for forest in trees)
        found = certainty(
            m,
            kind,
            divisor,
            seed,
            (_around(inner, m, kind, seed, noted["training_cells"], None), first, last),
        )
    except Exception as error:
        raise ArtifactError(
            f"{name} cannot be used ({type(error).__name__}: {str(error)[:100]}); {retrain}"
        ) from None
    _check_predictions(name, m, noted, found, retrain)
    return found


def cache_name(m: StabilityMap, kind: Model, divisor: int, seed: int) -> str:
    """Name of a model's file in the cache: one for each map and design, so that maps do not drive
    each other out.
    """
    place = hashlib.sha256(f"{map_hash(m)} {design_hash(m.design)}".encode()).hexdigest()[:16]
    return f"{kind.name}_n{divisor}_seed{seed}_{place}.joblib"


def load_kept_model(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED
) -> Surrogate | None:
    """A model that this user trained before, checked; None where there is none.

    Raises
    ------
    ArtifactError
        Where there is one that must not be opened.
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


def train_on_map(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, progress: Progress | None = None
) -> PredictedMap:
    """``surrogates.predict_map``, the same to the bit however many cores there are, telling
    progress.

    Parameters
    ----------
    m, kind, divisor, seed :
        As there.
    progress : callable
        As of :func:`spab_core.surrogates.models.train`.

    Returns
    -------
    PredictedMap
    """
    m = _with_plain_dtypes(m)
    with threadpool_limits(1):  # sums in another order would be other bits
        return predict_map(m, kind, divisor, seed, progress=progress)


def _with_plain_dtypes(m: StabilityMap) -> StabilityMap:
    """The same map; arrays that came from another process have dtype objects of their own, which
    pickle as other bytes.
    """
    axes = {"bearing_number": np.float64, "rotor_mass": np.float64}
    return dataclasses.replace(
        m, **{name: getattr(m, name).astype(dtype) for name, dtype in {**axes, **FIELDS}.items()}
    )


_told: set[str] = set()


def _once(error: ArtifactError) -> list[str]:
    """The sentence, if this process has not told it yet."""
    text = str(error)
    new = [] if text in _told else [text]
    _told.add(text)
    return new


@dataclass(frozen=True)
class Found:
    """A trained model and where it came from.

    Attributes
    ----------
    surrogate : Surrogate
    origin : str
        ``shipped``, ``kept`` (trained on this machine before) or ``trained`` (now).
    notes : tuple of str
        Why a shipped or kept one was refused, told once in a process; why the new one was not kept.
        Sentences, mostly none.
    """

    surrogate: Surrogate
    origin: str
    notes: tuple[str, ...] = ()


def find_model(
    m: StabilityMap,
    kind: Model,
    divisor: int,
    seed: int = SEED,
    *,
    folder: Path | None = ARTIFACTS,
    progress: Progress | None = None,
) -> Found:
    """A trained model: the shipped one, else one kept on this machine, else trained now and kept.

    Parameters
    ----------
    m : StabilityMap
    kind : Model
    divisor, seed : int
    folder : Path or None
        Of the shipped files; None for a map of which nothing can be shipped.
    progress : callable
        As :func:`train_on_map`; called only where something is trained.

    Raises
    ------
    InputError
        For too few cells.
    """
    return _find(m, kind, divisor, seed, folder, progress)[0]


def _find(m, kind, divisor, seed, folder, progress) -> tuple[Found, PredictedMap | None]:
    """The model, and the map that was predicted where it had to be trained."""
    notes = []
    if folder is not None and seed == SEED and _is_shipped(model_file(kind, divisor), folder):
        try:
            return Found(load_shipped_model(m, kind, divisor, seed, folder), "shipped"), None
        except ArtifactError as error:
            notes += _once(error)
    try:
        kept = load_kept_model(m, kind, divisor, seed)
        if kept is not None:
            return Found(kept, "kept", tuple(notes)), None
    except model_cache.CacheError as error:
        notes.append(str(error))
    except ArtifactError as error:
        notes += _once(error)
    predicted = train_on_map(m, kind, divisor, seed, progress)
    try:
        keep_model(m, predicted.surrogate, divisor)
    except model_cache.CacheError as error:
        notes.append(str(error))
    return Found(predicted.surrogate, "trained", tuple(dict.fromkeys(notes))), predicted


def predict_with(m: StabilityMap, surrogate: Surrogate, divisor: int) -> PredictedMap:
    """The map that a model trained before predicts, as ``surrogates.predict_map`` has it from one
    trained now.
    """
    index, inputs, mle = solved_cells(m)
    predicted, trained = np.full(m.mle.size, np.nan), np.zeros(m.mle.size, bool)
    trained[index[training_mask(len(mle), divisor, surrogate.seed)]] = True
    began = time.perf_counter()
    with threadpool_limits(1):
        predicted[index] = surrogate.estimator.predict(inputs)
    seconds = time.perf_counter() - began
    return PredictedMap(
        surrogate.model,
        divisor,
        surrogate.seed,
        predicted.reshape(m.shape),
        trained.reshape(m.shape),
        surrogate,
        seconds,
    )


def prediction_npz(m: StabilityMap, predicted: PredictedMap) -> bytes:
    """A predicted map as an NPZ file: ``bearing_number``, ``rotor_mass`` in kg, ``mle`` per
    revolution, ``trained``.
    """
    return npz_bytes(
        {
            "bearing_number": m.bearing_number,
            "rotor_mass": m.rotor_mass,
            "mle": predicted.mle,
            "trained": predicted.trained,
        }
    )


def keep_model(m: StabilityMap, surrogate: Surrogate, divisor: int) -> Path:
    """Keep a trained model in the cache; its path there. Raises :class:`model_cache.CacheError`."""
    kind, seed = surrogate.model, surrogate.seed
    model_cache.cache_folder()  # before a forest is compressed in vain
    noted = model_source(m, kind, divisor, seed) | describe(surrogate) | predictions(m, surrogate)
    return model_cache.keep(
        cache_name(m, kind, divisor, seed), dump(surrogate.estimator, ("zlib", 1)), noted
    )


def _is_shipped(name: str, folder: Path) -> bool:
    try:
        return name in read_manifest(folder)
    except ArtifactError:
        return False


def find_certainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, *, folder: Path | None = ARTIFACTS
) -> tuple[Certainty, tuple[str, ...]]:
    """What says how sure a model is at any point: the shipped models behind its intervals, else
    trained now.

    Parameters
    ----------
    m, kind, divisor, seed, folder
        As :func:`find_model`.

    Returns
    -------
    Certainty
    tuple of str
        Why the shipped ones were refused, told once in a process.

    Raises
    ------
    TooFewCells
        Where the training cells leave too few to calibrate with.
    InputError
        For too few cells.
    """
    known, notes = shipped_certainty(m, kind, divisor, seed, folder)
    return known or certainty(m, kind, divisor, seed), notes


def shipped_certainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path | None = ARTIFACTS
) -> tuple[Certainty | None, tuple[str, ...]]:
    """As :func:`find_certainty`, None where nothing that is shipped serves."""
    if folder is not None and seed == SEED and _is_shipped(intervals_file(kind, divisor), folder):
        try:
            return load_shipped_certainty(m, kind, divisor, seed, folder), ()
        except ArtifactError as error:
            return None, tuple(_once(error))
    return None, ()


@dataclass(frozen=True)
class PointPrediction:
    """What a surrogate says of one operating point; predicted, not solved.

    Attributes
    ----------
    model : Model
    training_cells : int
        Solved cells of the map that it was trained on.
    mle : float
        Exponent per revolution.
    low, high : float
        Bounds of its 90 % interval, per revolution.
    regime : str
        One of ``regimes.REGIMES``, by the classifier.
    probability_unstable : float
        That the motion is not periodic.
    """

    model: Model
    training_cells: int
    mle: float
    low: float
    high: float
    regime: str
    probability_unstable: float


def predict_point(
    m: StabilityMap,
    rotor_mass: float,
    bearing_number: float,
    kind: Model = MODELS[DEFAULT[0]],
    divisor: int = DEFAULT[1],
    *,
    folder: Path = ARTIFACTS,
) -> PointPrediction:
    """Predict one point with its interval, with the default model from what is shipped: nothing is
    trained nor solved.

    What was opened is kept in memory: the first call takes about a second, the others some
    hundredths.

    Parameters
    ----------
    m : StabilityMap
        The shipped map.
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    kind, divisor
        Left out: the ones that pages begin with.
    folder : Path
        Of the shipped files.

    Raises
    ------
    InputError
        For a point out of range.
    ArtifactError
        Where the model or its intervals are not shipped, or not to be opened.
    """
    check_point(rotor_mass, bearing_number)
    key = (map_hash(m), design_hash(m.design), kind.name, divisor, folder)
    with _POINTS:
        if key not in _points:
            found = (
                load_shipped_model(m, kind, divisor, folder=folder),
                load_shipped_certainty(m, kind, divisor, folder=folder),
            )
            _points.clear()
            _points[key] = found
        surrogate, known = _points[key]
    at = np.array([bearing_number], float), np.array([rotor_mass], float)
    low, high = known.calibrated.intervals(*at)
    return PointPrediction(
        kind,
        surrogate.training_cells,
        float(surrogate.predict(*at)[0]),
        float(low[0]),
        float(high[0]),
        str(known.regimes.predict(np.column_stack(at))[0]),
        float(known.calibrated.unstable(*at)[0]),
    )


_POINTS = threading.Lock()
_points: dict[tuple, tuple[Surrogate, Certainty]] = {}  # of the last map, model and fraction


class OnDemand(RegressorMixin, BaseEstimator):
    """Stands for the model of a shipped predicted map: found by :func:`find_model` when first asked
    to predict.
    """

    def __init__(self, m: StabilityMap, kind: Model, divisor: int, seed: int, folder: Path):
        self.m, self.kind, self.divisor, self.seed, self.folder = m, kind, divisor, seed, folder

    @functools.cached_property
    def _estimator(self):
        return find_model(
            self.m, self.kind, self.divisor, self.seed, folder=self.folder
        ).surrogate.estimator

    def predict(self, X):
        """Values at X (n, 2)."""
        return self._estimator.predict(X)


@dataclass(frozen=True)
class ServedMap(PredictedMap):
    """A predicted map and where it came from.

    Attributes
    ----------
    origin : str
        ``shipped``, or where the model came from: see :class:`Found`.
    note : str
        Why no shipped one was used; "" where none could be expected.
    """

    origin: str = "trained"
    note: str = ""


def mask_hash(trained: np.ndarray) -> str:
    """SHA-256 of a mask of training cells."""
    return hashlib.sha256(np.packbits(trained).tobytes()).hexdigest()


def load_shipped_map(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS
) -> ServedMap:
    """A shipped predicted map; nothing is unpickled, so the libraries' versions do not matter.

    The seconds are those that benchmarks/surrogates.py measured, nan where it did not.

    Raises
    ------
    ArtifactError
        Where it is not shipped, damaged, or was predicted for another design, from another map, or
        from other cells than the seed draws here.
    """
    data, retrain = checked_bytes(PREDICTIONS, folder), "`spab train --all` makes it again"
    wanted = {"design": design_hash(m.design), "map": map_hash(m), "seed": seed}
    noted = load(data, Schema("predicted maps", {}, _MAPS_JSON, ArtifactError, f"; {retrain}"))[
        "metadata"
    ]
    if apart := difference(noted, wanted):
        raise ArtifactError(
            f"the predicted maps of {PREDICTIONS} are not shown: {apart}; {retrain}"
        )
    plane = ("bearing_number", "rotor_mass")
    schema = Schema(
        f"map predicted by {kind.label} in {PREDICTIONS}",
        {kind.name: Array(np.float32, ("divisor", *plane))},
        error=ArtifactError,
        advice=f"; {retrain}",
    )
    found = load(data, schema, dict(zip(plane, m.shape, strict=True)))
    with schema.reading(data):
        if divisor not in noted["divisors"]:
            raise ValueError(f"there is no map of n/{divisor}")
        row = noted["divisors"].index(divisor)
        mle = found[kind.name][row].astype(float)
        about, expected_mask = noted["models"][kind.name][row], noted["masks"][row]
        cells, converged = int(about["training_cells"]), about["converged"]
        if not np.array_equal(np.isfinite(mle), np.isfinite(m.mle)):
            raise ValueError("it has no value where the map has one, or one where it has none")
    index, _, values = solved_cells(m)
    trained = np.zeros(m.mle.size, bool)
    trained[index[training_mask(len(values), divisor, seed)]] = True
    if mask_hash(trained) != expected_mask:
        raise ArtifactError(
            f"the predicted maps of {PREDICTIONS} are not shown: this version of numpy draws "
            "other training "
            f"cells; {retrain}"
        )
    train_seconds, predict_seconds = measured_seconds(kind, divisor, folder)
    surrogate = Surrogate(
        kind, OnDemand(m, kind, divisor, seed, folder), seed, cells, train_seconds, converged
    )
    return ServedMap(
        kind,
        divisor,
        seed,
        mle,
        trained.reshape(m.shape),
        surrogate,
        predict_seconds,
        origin="shipped",
    )


def measured_seconds(kind: Model, divisor: int, folder: Path = ARTIFACTS) -> tuple[float, float]:
    """Seconds of training and of predicting the map as the benchmark measured them; nan where it
    did not.
    """
    try:
        table = pd.read_csv(io.BytesIO(checked_bytes(SECONDS, folder)))
        row = table[(table["model"] == kind.name) & (table["divisor"] == divisor)].iloc[0]
        return float(row["train_seconds"]), float(row["predict_seconds"])
    except (ArtifactError, ValueError, KeyError, IndexError):
        return float("nan"), float("nan")


def find_map(
    m: StabilityMap,
    kind: Model,
    divisor: int,
    seed: int = SEED,
    *,
    folder: Path = ARTIFACTS,
    progress: Progress | None = None,
) -> ServedMap:
    """A predicted map: the shipped one, else what the model of :func:`find_model` predicts.

    Parameters and errors are those of :func:`find_model`.
    """
    note = ""
    if seed == SEED and _is_shipped(PREDICTIONS, folder):
        try:
            return load_shipped_map(m, kind, divisor, seed, folder)
        except ArtifactError as error:
            note = str(error)
    found, predicted = _find(m, kind, divisor, seed, folder, progress)
    predicted = predicted or predict_with(m, found.surrogate, divisor)
    return ServedMap(
        **{f.name: getattr(predicted, f.name) for f in fields(predicted)},
        origin=found.origin,
        note=note,
    )
