"""Trained surrogates and their predicted maps: shipped, kept on this machine, or trained now.

A joblib file is code to whoever opens it. One is opened only where the manifest of artifacts/ names it with the SHA-256 of
its bytes, or the private folder of :mod:`spab_core.model_cache` holds it, and only where library versions, design, map and
training code are those it was made with. All of that is checked before unpickling (docs/artifacts.md).
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import hashlib
import importlib.metadata
import io
import json
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from multiprocessing.pool import ThreadPool
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from joblib.parallel import ThreadingBackend
from sklearn.base import BaseEstimator, RegressorMixin
from threadpoolctl import threadpool_limits

from spab_core import model_cache
from spab_core.artifacts import ARTIFACTS, PREDICTIONS, SECONDS, ArtifactError, checked_bytes, read_manifest
from spab_core.design import Design
from spab_core.npz import UNREADABLE, npz_bytes, open_npz
from spab_core.stability_map import FIELDS, StabilityMap
from spab_core.surrogates import Model, PredictedMap, Surrogate, predict_map, solved_cells, training_mask

SEED = 0  # of what is shipped
LIBRARIES = ("numpy", "scipy", "scikit-learn", "joblib", "numba")
RECIPE = ("features", "surrogates", "theory_models")  # modules whose code makes a trained model what it is
Progress = Callable[[int, int], None]  # steps done, steps in all


@functools.cache
def versions() -> dict[str, str]:
    """Versions that a model file depends on: Python's without its last number, the libraries' in full."""
    return {"python": ".".join(platform.python_version_tuple()[:2])} | {
        name: importlib.metadata.version(name) for name in LIBRARIES}


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
def recipe_hash() -> str:
    """SHA-256 of the code of :data:`RECIPE`, comments and docstrings left out; differs between versions of Python."""
    digest = hashlib.sha256()
    for name in RECIPE:
        tree = ast.parse((Path(__file__).parent / f"{name}.py").read_bytes())
        for node in ast.walk(tree):
            if (isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and isinstance(node.body[0], ast.Expr)
                    and isinstance(node.body[0].value, ast.Constant)):
                node.body[0].value.value = ""
        digest.update(ast.dump(tree).encode())
    return digest.hexdigest()


def made_from(m: StabilityMap) -> dict:
    """What anything computed from a map with surrogates depends on: ``versions``, ``recipe``, ``design``, ``map``."""
    return {"versions": versions(), "recipe": recipe_hash(), "design": design_hash(m.design), "map": map_hash(m)}


def model_source(m: StabilityMap, kind: Model, divisor: int, seed: int) -> dict:
    """:func:`made_from` of one trained model: ``model``, ``divisor`` and ``seed`` too."""
    return made_from(m) | {"model": kind.name, "divisor": divisor, "seed": seed}


def difference(noted: object, wanted: dict) -> str | None:
    """What, of all that ``wanted`` names, is otherwise in ``noted``: one clause for a sentence, or None.

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
    for name, version in wanted.get("versions", {}).items():
        before = found.get(name) if isinstance(found, dict) else None
        if before != version:
            return f"it was made with {name} {str(before)[:20]} and this is {name} {version}"
    words = {"design": "it was made for another design", "map": "it was made from another map",
             "recipe": "the code that makes it has changed since (spab_core/" + ".py, ".join(RECIPE) + ".py)"}
    for key in wanted.keys() - {"versions"}:
        if noted.get(key) != wanted[key]:
            return words.get(key, f"it has {key} {str(noted.get(key))[:40]} and not {wanted[key]}")
    return None


def model_file(kind: Model, divisor: int) -> str:
    """Name of a shipped model's file."""
    return f"surrogate_{kind.name}_n{divisor}.joblib"


def dump(surrogate: Surrogate, compress=("xz", 6)) -> bytes:
    """A trained model's estimator as the bytes of a joblib file; the same training gives the same bytes."""
    buffer = io.BytesIO()
    joblib.dump(surrogate.estimator, buffer, compress=compress)
    return buffer.getvalue()


def describe(surrogate: Surrogate) -> dict:
    """What the manifest says of a model beside its source: ``training_cells``, ``converged``."""
    return {"training_cells": surrogate.training_cells, "converged": surrogate.converged}


def _restore(name: str, data: bytes, noted: object, wanted: dict, kind: Model, retrain: str) -> Surrogate:
    """Unpickle checked bytes if they were made from what is wanted. Raises :class:`ArtifactError`."""
    if apart := difference(noted, wanted):
        raise ArtifactError(f"{name} is not opened: {apart}; {retrain}")
    assert isinstance(noted, dict)
    cells, converged = noted.get("training_cells"), noted.get("converged")
    if not isinstance(cells, int) or converged not in (None, True, False):
        raise ArtifactError(f"{name} is not opened: what is noted of it is damaged; {retrain}")
    try:
        estimator = joblib.load(io.BytesIO(data))
        if not hasattr(estimator, "predict"):
            raise TypeError("there is no model in it")
    except Exception as error:  # the bytes are the right ones: something else is broken, which training mends
        raise ArtifactError(f"{name} cannot be opened ({type(error).__name__}: {str(error)[:100]}); {retrain}") from None
    return Surrogate(kind, estimator, wanted["seed"], cells, float("nan"), converged)


def load_shipped_model(m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS) -> Surrogate:
    """A shipped model after everything about it is checked; ``seconds`` of training are nan.

    Raises
    ------
    ArtifactError
        Where it is not shipped, damaged, or made with other versions, for another design or from another map; says how to
        train it again.
    """
    name = model_file(kind, divisor)
    retrain = f"`spab train --model {kind.name} --divisor {divisor}` trains it again on this machine"
    if name not in read_manifest(folder):
        raise ArtifactError(f"{kind.label} trained on n/{divisor} is not shipped; {retrain}")
    noted = read_manifest(folder)[name].get("made_from")
    return _restore(name, checked_bytes(name, folder), noted, model_source(m, kind, divisor, seed), kind, retrain)


def cache_name(m: StabilityMap, kind: Model, divisor: int, seed: int) -> str:
    """Name of a model's file in the cache: one for each map and design, so that maps do not drive each other out."""
    place = hashlib.sha256(f"{map_hash(m)} {design_hash(m.design)}".encode()).hexdigest()[:16]
    return f"{kind.name}_n{divisor}_seed{seed}_{place}.joblib"


def load_kept_model(m: StabilityMap, kind: Model, divisor: int, seed: int = SEED) -> Surrogate | None:
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
    return _restore(name, found[0], found[1], model_source(m, kind, divisor, seed), kind, "it is trained again")


class _CountingThread(ThreadingBackend):
    """joblib on one thread, in order (sums come out the same to the bit), telling how many tasks (trees) are done."""

    def __init__(self, total: int = 1, progress: Progress | None = None, **options):
        super().__init__(**options)
        self._pool: ThreadPool | None = None
        self.total, self.progress, self.done = total, progress, 0

    def effective_n_jobs(self, n_jobs):
        return 2  # for one, joblib would go round this class

    def _get_pool(self):
        self._pool = self._pool or ThreadPool(1)
        return self._pool

    def submit(self, func, callback=None):
        def counted(result):
            if self.progress is not None and 1 < self.total > self.done:
                self.done += 1
                self.progress(self.done, self.total)
            if callback is not None:
                callback(result)
        return super().submit(func, counted)


def train_on_map(m: StabilityMap, kind: Model, divisor: int, seed: int = SEED,
                 progress: Progress | None = None) -> PredictedMap:
    """``surrogates.predict_map``, the same to the bit however many cores there are, telling progress.

    Parameters
    ----------
    m, kind, divisor, seed :
        As there.
    progress : callable
        Called with the steps done and the steps in all: trees, or one for the whole training.

    Returns
    -------
    PredictedMap
    """
    m = _with_plain_dtypes(m)
    with threadpool_limits(1):  # sums in another order would be other bits
        if progress is None:
            return predict_map(m, kind, divisor, seed)
        total = _trees(kind)
        progress(0, total)
        with joblib.parallel_config(backend=_CountingThread(total, progress)):
            found = predict_map(m, kind, divisor, seed)
    progress(total, total)
    return found


def _trees(kind: Model) -> int:
    try:
        return kind.build(0).n_estimators
    except (AttributeError, TypeError):  # no forest, or built from more than a seed: its training is one step
        return 1


def _with_plain_dtypes(m: StabilityMap) -> StabilityMap:
    """The same map; arrays that came from another process have dtype objects of their own, which pickle as other bytes."""
    axes = {"bearing_number": np.float64, "rotor_mass": np.float64}
    return dataclasses.replace(m, **{name: getattr(m, name).astype(dtype) for name, dtype in {**axes, **FIELDS}.items()})


@dataclass(frozen=True)
class Found:
    """A trained model and where it came from.

    Attributes
    ----------
    surrogate : Surrogate
    origin : str
        ``shipped``, ``kept`` (trained on this machine before) or ``trained`` (now).
    notes : tuple of str
        Why a shipped or kept one was not used, why the new one was not kept: sentences, mostly none.
    """

    surrogate: Surrogate
    origin: str
    notes: tuple[str, ...] = ()


def find_model(m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, *, folder: Path | None = ARTIFACTS,
               progress: Progress | None = None) -> Found:
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
            notes.append(str(error))
    try:
        kept = load_kept_model(m, kind, divisor, seed)
        if kept is not None:
            return Found(kept, "kept", tuple(notes)), None
    except ArtifactError as error:
        notes.append(str(error))
    predicted = train_on_map(m, kind, divisor, seed, progress)
    try:
        keep_model(m, predicted.surrogate, divisor)
    except model_cache.CacheError as error:
        notes.append(str(error))
    return Found(predicted.surrogate, "trained", tuple(dict.fromkeys(notes))), predicted


def predict_with(m: StabilityMap, surrogate: Surrogate, divisor: int) -> PredictedMap:
    """The map that a model trained before predicts, as ``surrogates.predict_map`` has it from one trained now."""
    index, inputs, mle = solved_cells(m)
    predicted, trained = np.full(m.mle.size, np.nan), np.zeros(m.mle.size, bool)
    trained[index[training_mask(len(mle), divisor, surrogate.seed)]] = True
    began = time.perf_counter()
    with threadpool_limits(1):
        predicted[index] = surrogate.estimator.predict(inputs)
    seconds = time.perf_counter() - began
    return PredictedMap(surrogate.model, divisor, surrogate.seed, predicted.reshape(m.shape), trained.reshape(m.shape),
                        surrogate, seconds)


def prediction_npz(m: StabilityMap, predicted: PredictedMap) -> bytes:
    """A predicted map as an NPZ file: ``bearing_number``, ``rotor_mass`` in kg, ``mle`` per revolution, ``trained``."""
    return npz_bytes({"bearing_number": m.bearing_number, "rotor_mass": m.rotor_mass, "mle": predicted.mle,
                      "trained": predicted.trained})


def keep_model(m: StabilityMap, surrogate: Surrogate, divisor: int) -> Path:
    """Keep a trained model in the cache; its path there. Raises :class:`model_cache.CacheError`."""
    kind, seed = surrogate.model, surrogate.seed
    model_cache.cache_folder()  # before a forest is compressed in vain
    noted = model_source(m, kind, divisor, seed) | describe(surrogate)
    return model_cache.keep(cache_name(m, kind, divisor, seed), dump(surrogate, ("zlib", 1)), noted)


def _is_shipped(name: str, folder: Path) -> bool:
    try:
        return name in read_manifest(folder)
    except ArtifactError:
        return False


class OnDemand(RegressorMixin, BaseEstimator):
    """Stands for the model of a shipped predicted map: found by :func:`find_model` when first asked to predict."""

    def __init__(self, m: StabilityMap, kind: Model, divisor: int, seed: int, folder: Path):
        self.m, self.kind, self.divisor, self.seed, self.folder = m, kind, divisor, seed, folder

    @functools.cached_property
    def _estimator(self):
        return find_model(self.m, self.kind, self.divisor, self.seed, folder=self.folder).surrogate.estimator

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


def load_shipped_map(m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS) -> ServedMap:
    """A shipped predicted map; nothing is unpickled, so the libraries' versions do not matter.

    The seconds are those that benchmarks/surrogates.py measured, nan where it did not.

    Raises
    ------
    ArtifactError
        Where it is not shipped, damaged, or was predicted for another design, from another map, or from other cells than the
        seed draws here.
    """
    data, retrain = checked_bytes(PREDICTIONS, folder), "`spab train --all` makes it again"
    wanted = {"design": design_hash(m.design), "map": map_hash(m), "seed": seed}
    try:
        with open_npz(data) as file:
            noted = file.json("metadata")
            if apart := difference(noted, wanted):
                raise ArtifactError(f"the predicted maps of {PREDICTIONS} are not shown: {apart}; {retrain}")
            row = noted["divisors"].index(divisor)
            mle = file[kind.name][row].astype(float)
            about, expected_mask = noted["models"][kind.name][row], noted["masks"][row]
        cells, converged = int(about["training_cells"]), about["converged"]
        if mle.shape != m.shape or not np.array_equal(np.isfinite(mle), np.isfinite(m.mle)):
            raise ValueError("it does not fit the map")
    except ArtifactError:
        raise
    except UNREADABLE as error:
        raise ArtifactError(f"{kind.label} trained on n/{divisor} is not in {PREDICTIONS} ({str(error)[:100]}); "
                            f"{retrain}") from None
    index, _, values = solved_cells(m)
    trained = np.zeros(m.mle.size, bool)
    trained[index[training_mask(len(values), divisor, seed)]] = True
    if mask_hash(trained) != expected_mask:
        raise ArtifactError(f"the predicted maps of {PREDICTIONS} are not shown: this version of numpy draws other training "
                            f"cells; {retrain}")
    train_seconds, predict_seconds = measured_seconds(kind, divisor, folder)
    surrogate = Surrogate(kind, OnDemand(m, kind, divisor, seed, folder), seed, cells, train_seconds, converged)
    return ServedMap(kind, divisor, seed, mle, trained.reshape(m.shape), surrogate, predict_seconds, origin="shipped")


def measured_seconds(kind: Model, divisor: int, folder: Path = ARTIFACTS) -> tuple[float, float]:
    """Seconds of training and of predicting the map as the benchmark measured them; nan where it did not."""
    try:
        table = pd.read_csv(io.BytesIO(checked_bytes(SECONDS, folder)))
        row = table[(table["model"] == kind.name) & (table["divisor"] == divisor)].iloc[0]
        return float(row["train_seconds"]), float(row["predict_seconds"])
    except (ArtifactError, ValueError, KeyError, IndexError):
        return float("nan"), float("nan")


def find_map(m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, *, folder: Path = ARTIFACTS,
             progress: Progress | None = None) -> ServedMap:
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
    return ServedMap(**{f.name: getattr(predicted, f.name) for f in fields(predicted)}, origin=found.origin, note=note)
