"""Find a predicted map: the shipped one, or that of a model that is found or trained now."""

from __future__ import annotations

import functools
import io
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.npz import npz_bytes
from spab_core.maps.stability_map import StabilityMap
from spab_core.shipped.manifest import (
    ARTIFACTS,
    FLOORED_PREDICTIONS,
    PREDICTIONS,
    SECONDS,
    ArtifactError,
    checked_bytes,
)
from spab_core.shipped.model_files import SEED
from spab_core.shipped.model_store import (
    find_model,
    find_or_train,
    is_shipped,
    predict_with,
    training_cells,
)
from spab_core.shipped.provenance import design_hash, difference, map_hash, mask_hash
from spab_core.surrogates.models import (
    FLOOR,
    Model,
    PredictedMap,
    Progress,
    Surrogate,
    floor_of,
)

FIGURE_DIVISORS = (2, 4, 8)  # of the paper's figures 11 to 22
_MAPS_JSON = {"metadata": ("divisors", "models", "masks")}  # of the file of predicted maps


class ModelOnDemand(RegressorMixin, BaseEstimator):
    """Regressor of a shipped predicted map, found or trained by :func:`find_model` at its first
    prediction.
    """

    def __init__(self, m: StabilityMap, kind: Model, divisor: int, seed: int, folder: Path):
        self.m, self.kind, self.divisor, self.seed, self.folder = m, kind, divisor, seed, folder

    @functools.cached_property
    def _estimator(self) -> BaseEstimator:
        return find_model(
            self.m, self.kind, self.divisor, self.seed, folder=self.folder
        ).surrogate.estimator

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Return values at X (n, 2)."""
        found: np.ndarray = self._estimator.predict(X)
        return found


@dataclass(frozen=True)
class ServedMap(PredictedMap):
    """A predicted map and where it came from.

    Attributes
    ----------
    origin : str
        ``shipped``, or where the model came from: see :class:`ModelWithOrigin`.
    note : str
        Why the shipped one was not used; "" if none is expected.
    """

    origin: str = "trained"
    note: str = ""


def maps_file(m: StabilityMap, kind: Model, divisor: int) -> str | None:
    """Return the name of the shipped file that holds a predicted map; None where none is shipped.

    Of a map with a floor (``models.floored``) only those of the paper's figures are.
    """
    floor = floor_of(m)
    if floor is None:
        return PREDICTIONS
    of_figures = kind.group == "paper" and divisor in FIGURE_DIVISORS
    return FLOORED_PREDICTIONS if floor == FLOOR and of_figures else None


def load_shipped_map(
    m: StabilityMap, kind: Model, divisor: int, seed: int = SEED, folder: Path = ARTIFACTS
) -> ServedMap:
    """Load a shipped predicted map; nothing is unpickled, so library versions do not matter.

    Its seconds are those measured by benchmarks/surrogates.py, nan if there are none.

    Raises
    ------
    ArtifactError
        If it is not shipped, is damaged, or was predicted for another design, from another map, or
        from other cells than the seed draws here.
    """
    file, retrain = maps_file(m, kind, divisor), "`spab train --all` makes it again"
    if file is None:
        raise ArtifactError(f"no map predicted by {kind.label} from n/{divisor} is shipped")
    data = checked_bytes(file, folder)
    wanted = {"design": design_hash(m.design), "map": map_hash(m), "seed": seed}
    noted = load(data, Schema("predicted maps", {}, _MAPS_JSON, ArtifactError, f"; {retrain}"))[
        "metadata"
    ]
    if apart := difference(noted, wanted):
        raise ArtifactError(f"the predicted maps of {file} are not shown: {apart}; {retrain}")
    plane = ("bearing_number", "rotor_mass")
    schema = Schema(
        f"map predicted by {kind.label} in {file}",
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
    trained = training_cells(m, divisor, seed)
    if mask_hash(trained) != expected_mask:
        raise ArtifactError(
            f"the predicted maps of {file} are not shown: this version of numpy draws other "
            f"training cells; {retrain}"
        )
    train_seconds, predict_seconds = (
        measured_seconds(kind, divisor, folder) if file == PREDICTIONS else (float("nan"),) * 2
    )
    surrogate = Surrogate(
        kind, ModelOnDemand(m, kind, divisor, seed, folder), seed, cells, train_seconds, converged
    )
    return ServedMap(
        kind, divisor, seed, mle, trained, surrogate, predict_seconds, origin="shipped"
    )


def measured_seconds(kind: Model, divisor: int, folder: Path = ARTIFACTS) -> tuple[float, float]:
    """Return the benchmark's seconds of training and of predicting the map; nan if it has none."""
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
    """Return the shipped predicted map; if there is none, predict it with :func:`find_model`.

    Parameters and errors are those of :func:`find_model`.
    """
    note, file = "", maps_file(m, kind, divisor)
    if seed == SEED and file and is_shipped(file, folder):
        try:
            return load_shipped_map(m, kind, divisor, seed, folder)
        except ArtifactError as error:
            note = str(error)
    found, predicted = find_or_train(m, kind, divisor, seed, folder, progress)
    predicted = predicted or predict_with(m, found.surrogate, divisor)
    return ServedMap(
        **{f.name: getattr(predicted, f.name) for f in fields(predicted)},
        origin=found.origin,
        note=note,
    )


def prediction_npz(m: StabilityMap, predicted: PredictedMap) -> bytes:
    """Return a predicted map as an NPZ file: ``bearing_number``, ``rotor_mass`` in kg, ``mle`` per
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
