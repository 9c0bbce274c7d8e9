"""Find a trained model: the shipped one, one kept on this machine, or one trained now."""

from __future__ import annotations

import dataclasses
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from spab_core.design.limits import check_point
from spab_core.maps.stability_map import FIELDS, StabilityMap
from spab_core.shipped import model_cache
from spab_core.shipped.manifest import ARTIFACTS, ArtifactError, read_manifest
from spab_core.shipped.model_files import (
    SEED,
    intervals_file,
    keep_model,
    load_kept_model,
    load_shipped_certainty,
    load_shipped_model,
    model_file,
)
from spab_core.shipped.provenance import design_hash, map_hash
from spab_core.surrogates.models import (
    MODELS,
    Model,
    PredictedMap,
    Progress,
    Surrogate,
    floor_of,
    predict_map,
    solved_cells,
    training_mask,
)
from spab_core.surrogates.uncertainty import Certainty, certainty

DEFAULT = ("theory-trees", 8)  # model and fraction n/8 that pages begin with


def train_on_map(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, progress: Progress | None = None
) -> PredictedMap:
    """Train on a map and predict it as ``surrogates.predict_map``, with the same bits for any
    number of cores.

    Parameters
    ----------
    m, kind, divisor, seed :
        As in ``surrogates.predict_map``.
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
    """Return the map with numpy's own dtype objects, since those of arrays from another process
    pickle to other bytes.
    """
    axes = {"bearing_number": np.float64, "rotor_mass": np.float64}
    return dataclasses.replace(
        m, **{name: getattr(m, name).astype(dtype) for name, dtype in {**axes, **FIELDS}.items()}
    )


_told: set[str] = set()


def _once(error: ArtifactError) -> list[str]:
    """Return the error's sentence in a list, empty if this process has shown it before."""
    text = str(error)
    new = [] if text in _told else [text]
    _told.add(text)
    return new


@dataclass(frozen=True)
class ModelWithOrigin:
    """A trained model and where it came from.

    Attributes
    ----------
    surrogate : Surrogate
    origin : str
        ``shipped``, ``kept`` (trained on this machine before) or ``trained`` (now).
    notes : tuple of str
        Sentences: why a shipped or kept model was refused, once in a process; why the new one was
        not kept. Mostly empty.
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
) -> ModelWithOrigin:
    """Return the shipped model, else the one kept on this machine, else train and keep one.

    Parameters
    ----------
    m : StabilityMap
    kind : Model
    divisor, seed : int
    folder : Path or None
        Of the shipped files; None for a map that has none.
    progress : callable
        As :func:`train_on_map`; called only if something is trained.

    Raises
    ------
    InputError
        For too few cells.
    """
    return find_or_train(m, kind, divisor, seed, folder, progress)[0]


def find_or_train(
    m: StabilityMap,
    kind: Model,
    divisor: int,
    seed: int,
    folder: Path | None,
    progress: Progress | None,
) -> tuple[ModelWithOrigin, PredictedMap | None]:
    """Return the model, and the predicted map too if the model had to be trained."""
    notes, folder = [], _models_folder(m, seed, folder)
    if folder is not None and is_shipped(model_file(kind, divisor), folder):
        try:
            return ModelWithOrigin(
                load_shipped_model(m, kind, divisor, seed, folder), "shipped"
            ), None
        except ArtifactError as error:
            notes += _once(error)
    try:
        kept = load_kept_model(m, kind, divisor, seed)
        if kept is not None:
            return ModelWithOrigin(kept, "kept", tuple(notes)), None
    except model_cache.CacheError as error:
        notes.append(str(error))
    except ArtifactError as error:
        notes += _once(error)
    predicted = train_on_map(m, kind, divisor, seed, progress)
    try:
        keep_model(m, predicted.surrogate, divisor)
    except model_cache.CacheError as error:
        notes.append(str(error))
    return ModelWithOrigin(predicted.surrogate, "trained", tuple(dict.fromkeys(notes))), predicted


def training_cells(m: StabilityMap, divisor: int, seed: int) -> np.ndarray:
    """Return the mask (B, M) of the cells that a model is trained on."""
    trained: np.ndarray = np.isfinite(m.mle)
    trained[trained] = training_mask(int(trained.sum()), divisor, seed)
    return trained


def predict_with(m: StabilityMap, surrogate: Surrogate, divisor: int) -> PredictedMap:
    """Predict a map with a model trained before; the result is that of
    ``surrogates.predict_map``.
    """
    index, inputs, _ = solved_cells(m)
    predicted = np.full(m.mle.size, np.nan)
    began = time.perf_counter()
    with threadpool_limits(1):
        predicted[index] = surrogate.estimator.predict(inputs)
    seconds = time.perf_counter() - began
    return PredictedMap(
        surrogate.model,
        divisor,
        surrogate.seed,
        predicted.reshape(m.shape),
        training_cells(m, divisor, surrogate.seed),
        surrogate,
        seconds,
    )


def is_shipped(name: str, folder: Path) -> bool:
    """Return whether the manifest of a folder names a file."""
    try:
        return name in read_manifest(folder)
    except ArtifactError:
        return False


def _models_folder(m: StabilityMap, seed: int, folder: Path | None) -> Path | None:
    """Return the folder if models like these are shipped: of one draw, and without a floor."""
    return folder if seed == SEED and floor_of(m) is None else None


def find_certainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, *, folder: Path | None = ARTIFACTS
) -> tuple[Certainty, tuple[str, ...]]:
    """Return the models behind a model's intervals: the shipped ones, else train them.

    Parameters
    ----------
    m, kind, divisor, seed, folder
        As :func:`find_model`.

    Returns
    -------
    Certainty
    tuple of str
        Why the shipped ones were refused, once in a process.

    Raises
    ------
    TooFewCells
        If there are too few training cells to keep some for calibration.
    InputError
        For too few cells.
    """
    known, notes = shipped_certainty(m, kind, divisor, seed, folder)
    return known or certainty(m, kind, divisor, seed), notes


def shipped_certainty(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path | None = ARTIFACTS
) -> tuple[Certainty | None, tuple[str, ...]]:
    """As :func:`find_certainty`, but return None if no shipped models can be used."""
    folder = _models_folder(m, seed, folder)
    if folder is not None and is_shipped(intervals_file(kind, divisor), folder):
        try:
            return load_shipped_certainty(m, kind, divisor, seed, folder), ()
        except ArtifactError as error:
            return None, tuple(_once(error))
    return None, ()


@dataclass(frozen=True)
class PointPrediction:
    """Prediction of one operating point by a surrogate, not a solution.

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
    """Predict one point and its interval with shipped models; nothing is trained or solved.

    Opened models stay in memory: the first call takes about a second, later ones some hundredths.

    Parameters
    ----------
    m : StabilityMap
        The shipped map.
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    kind, divisor
        Left out: the defaults of the pages.
    folder : Path
        Of the shipped files.

    Raises
    ------
    InputError
        For a point out of range.
    ArtifactError
        If the model or its intervals are not shipped, or must not be opened.
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

# of the last map, model and fraction
_points: dict[tuple[object, ...], tuple[Surrogate, Certainty]] = {}
