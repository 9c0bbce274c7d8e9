"""Rebuild everything in artifacts/ that is computed from the map, bit for bit."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.compose import TransformedTargetRegressor
from threadpoolctl import threadpool_limits

from spab_core.common.errors import InputError
from spab_core.common.files import csv_bytes, write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.maps.stability_map import StabilityMap, load_map, save_map
from spab_core.shipped.manifest import (
    ARTIFACTS,
    BLOCK_CLASSIFIERS,
    BLOCK_SCORES,
    CLASSIFIER_TABLES,
    CLASSIFIERS,
    FLOORED_BLOCK_SCORES,
    FLOORED_PREDICTIONS,
    FLOORED_SCORES,
    PREDICTIONS,
    REFERENCE_MAP,
    SCORES,
    UNCERTAINTY,
    ArtifactError,
    checked_bytes,
    present_files,
    write_manifest,
)
from spab_core.shipped.model_files import (
    SEED,
    describe,
    dump,
    intervals_file,
    load_shipped_certainty,
    model_file,
    plain,
    plain_certainty,
    predictions,
)
from spab_core.shipped.model_store import DEFAULT, train_on_map, training_cells
from spab_core.shipped.predicted_maps import maps_file
from spab_core.shipped.provenance import (
    INTERVALS_RECIPE,
    classifiers_source,
    design_hash,
    difference,
    intervals_source,
    made_from,
    map_hash,
    mask_hash,
    model_source,
)
from spab_core.surrogates.classifier import LABELS, Labels
from spab_core.surrogates.metrics import SEEDS, evaluate, uncertainty_scores
from spab_core.surrogates.models import (
    DIVISORS,
    FLOOR,
    MODELS,
    Model,
    floor_of,
    floored,
    training_mask,
)
from spab_core.surrogates.uncertainty import TooFewCells, certainty, uncertain_map

# tables of scores by file: the models or classifiers in them (None: all models), and options of
# metrics.evaluate
TABLES: dict[str, tuple[tuple[str, ...] | None, dict[str, Any]]] = {
    SCORES: (None, {}),
    BLOCK_SCORES: (None, {"split": "blocks"}),
    UNCERTAINTY: (("theory-trees",), {"uncertainty": True}),
    FLOORED_SCORES: (None, {"floor": FLOOR}),
    FLOORED_BLOCK_SCORES: (None, {"floor": FLOOR, "split": "blocks"}),
    CLASSIFIERS: (tuple(LABELS), {}),
    BLOCK_CLASSIFIERS: (tuple(LABELS), {"split": "blocks"}),
}
CLASSIFIER_SEEDS = 10  # at most: a training with its scores takes a second of processor
ALWAYS = (
    ("forest", 8),
    DEFAULT,
)  # shipped whatever they take: the paper's best model, and the one that pages begin with
INTERVALS = (DEFAULT,)  # whose intervals can be told without training
MAX_MODEL_BYTES = 2_000_000  # another model that is larger is trained on first use
MAX_FOLDER_BYTES = 40_000_000  # of artifacts/ in all
STEP = 2.0**-16  # of a shipped exponent, per revolution
# per revolution, between a shipped map and what its model predicts, on another processor too
TOLERANCE = STEP
_Table = tuple[str, list[Model | Labels], dict[str, Any]]
_COMPRESSION = 10  # more than xz ever gains on a model


@dataclass(frozen=True)
class _Trained:
    """What is shipped of one model at one training fraction.

    Attributes
    ----------
    mle : ndarray of float32, (B, M)
        The predicted map.
    description : dict
        Of the model, for the metadata of the maps and the manifest.
    file : bytes or None
        None for interpolations, which have none, for files that are too large, and for models of a
        map with a floor.
    noted : dict
        Predictions, for the manifest.
    """

    mle: np.ndarray
    description: dict[str, Any]
    file: bytes | None
    noted: dict[str, Any]


def _train(m: StabilityMap, name: str, divisor: int) -> _Trained:
    kind = MODELS[name]
    predicted = train_on_map(m, kind, divisor, SEED)
    surrogate, data = predicted.surrogate, None
    if floor_of(m) is not None:
        return _Trained(rounded(predicted.mle), describe(surrogate), None, {})
    if (name, divisor) in ALWAYS:
        data = dump(slim(plain(surrogate)))
    elif (
        kind.group != "interpolation"
        and len(dump(plain(surrogate), 0)) <= _COMPRESSION * MAX_MODEL_BYTES
    ):
        data = dump(plain(surrogate))
    return _Trained(rounded(predicted.mle), describe(surrogate), data, predictions(m, surrogate))


def ship_intervals(m: StabilityMap, name: str, divisor: int) -> tuple[bytes, dict[str, Any]]:
    """Return the file of the models behind intervals and its manifest entry.

    Raises ``TooFewCells``.
    """
    kind = MODELS[name]
    known = certainty(m, kind, divisor, SEED)
    source = (
        intervals_source(m, kind, divisor, SEED)
        | describe(known.calibrated.surrogate)
        | predictions(m, known)
    )
    return dump([slim(fitted) for fitted in plain_certainty(known)]), source


def slim(fitted: BaseEstimator) -> BaseEstimator:
    """Set to zero, in place, the values of a forest that predictions do not need (impurities,
    counts, means of inner nodes), which halves its file.
    """
    forest = fitted.regressor_[-1] if isinstance(fitted, TransformedTargetRegressor) else fitted
    for fitted_tree in forest.estimators_:
        tree = fitted_tree.tree_
        tree.impurity[:] = 0.0
        tree.n_node_samples[:] = 0
        tree.weighted_n_node_samples[:] = 0.0
        tree.value[tree.children_left >= 0] = 0.0
    return fitted


def rounded(mle: np.ndarray) -> np.ndarray:
    """Round exponents to the nearest :data:`STEP`, as float32: the file is a third smaller."""
    return (np.round(mle / STEP) * STEP).astype(np.float32)


def _choose(
    models: Mapping[tuple[str, int], bytes | None], room: int
) -> dict[tuple[str, int], bytes]:
    """Return the model files to ship: those of :data:`ALWAYS`, then the smallest kinds first while
    there is room.
    """
    files = {job: data for job, data in models.items() if data is not None}
    chosen = {job: data for job, data in files.items() if job in ALWAYS}
    room -= sum(map(len, chosen.values()))
    small: dict[str, dict[int, bytes]] = {}
    for (name, divisor), data in files.items():
        if (name, divisor) not in chosen and len(data) <= MAX_MODEL_BYTES:
            small.setdefault(name, {})[divisor] = data
    for name in sorted(small, key=lambda name: (sum(map(len, small[name].values())), name)):
        for divisor, data in sorted(small[name].items()):
            if len(data) <= room:
                chosen[name, divisor] = data
                room -= len(data)
    return chosen


def rebuild(
    m: StabilityMap,
    folder: Path = ARTIFACTS,
    *,
    models: Sequence[Model] = tuple(MODELS.values()),
    divisors: Sequence[int] = DIVISORS,
    seeds: Sequence[int] = SEEDS,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> dict[str, int]:
    """Train everything that is shipped; write scores, predicted maps, models and the manifest.

    The same map and versions give the same bytes for any number of processes. The manifest is
    written last, so files left by an interrupted run are refused.

    Parameters
    ----------
    m : StabilityMap
    folder : Path
        The map is written to it too unless it has one.
    models : sequence of Model
    divisors, seeds : sequence of int
        Of the scores; predicted maps and models are those of seed :data:`SEED`.
    workers : int
        Processes.
    progress : callable
        Called with the number of trainings done since the last call; there are ``trainings(...)``.

    Returns
    -------
    dict
        Bytes of each file written.

    Raises
    ------
    InputError
        If the folder holds another map, or the map has too few cells.
    """
    source = made_from(m)
    _check_folder(m, folder, source, divisors)
    written = _score_tables(m, _tables(models, TABLES), divisors, seeds, workers, progress)
    trained = _train_all(m, models, divisors, workers, progress)
    written[PREDICTIONS] = _maps_bytes(m, models, divisors, trained)
    if all(of_figures := _of_figures(m, models, divisors)):
        low = floored(m, FLOOR)
        maps = _train_all(low, *of_figures, workers, progress)
        written[FLOORED_PREDICTIONS] = _maps_bytes(low, *of_figures, maps)
    sources = {name: table_source(m, name) for name in written}
    for name, divisor in (job for job in INTERVALS if job in trained):
        with contextlib.suppress(TooFewCells):
            path = intervals_file(MODELS[name], divisor)
            written[path], sources[path] = ship_intervals(m, name, divisor)
    files = {job: found.file for job, found in trained.items()}
    for (name, divisor), data in _choose(files, _room(folder, written)).items():
        path, model = model_file(MODELS[name], divisor), trained[name, divisor]
        written[path] = data
        sources[path] = (
            model_source(m, MODELS[name], divisor, SEED) | model.description | model.noted
        )
    _write(m, folder, written)
    write_manifest(folder, sources)
    return {name: len(data) for name, data in written.items()}


def make_tables(
    m: StabilityMap,
    names: Collection[str],
    folder: Path = ARTIFACTS,
    *,
    divisors: Sequence[int] = DIVISORS,
    seeds: Sequence[int] = SEEDS,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> dict[str, int]:
    """Compute some of the tables that :func:`rebuild` writes, and name them in the manifest; every
    other file stays.

    Parameters
    ----------
    m : StabilityMap
        That of the folder.
    names : collection of str
        Of :data:`TABLES`.
    folder, divisors, seeds, workers, progress
        As in :func:`rebuild`; ``progress`` ends at ``table_rows(...)``.

    Returns
    -------
    dict
        Bytes of each file written.

    Raises
    ------
    InputError
        As :func:`rebuild`.
    """
    _check_folder(m, folder, made_from(m), divisors)
    tables = _tables(tuple(MODELS.values()), names)
    written = _score_tables(m, tables, divisors, seeds, workers, progress)
    for name, data in written.items():
        write_atomically(folder / name, data)
    write_manifest(folder, {name: table_source(m, name) for name in written})
    return {name: len(data) for name, data in written.items()}


def _score_tables(
    m: StabilityMap,
    tables: list[_Table],
    divisors: Sequence[int],
    seeds: Sequence[int],
    workers: int,
    progress: Callable[[int], None] | None,
) -> dict[str, bytes]:
    """Return the bytes of tables of :func:`_tables` by file."""
    with joblib.parallel_config(backend="loky", inner_max_num_threads=1), threadpool_limits(1):
        scores = {
            name: evaluate(
                m,
                kinds,
                divisors,
                _seeds(name, seeds),
                workers=workers,
                progress=progress,
                **options,
            )
            for name, kinds, options in tables
        }
    return {name: _table_bytes(found) for name, found in scores.items()}


def _seeds(name: str, seeds: Sequence[int]) -> Sequence[int]:
    """Return those of the seeds that a table has."""
    return seeds[:CLASSIFIER_SEEDS] if name in CLASSIFIER_TABLES else seeds


def table_source(m: StabilityMap, name: str) -> dict[str, Any]:
    """Return what a table, or a file of predicted maps, is made from."""
    if name == UNCERTAINTY:
        return made_from(m, INTERVALS_RECIPE)
    return classifiers_source(m) if name in CLASSIFIER_TABLES else made_from(m)


def _check_folder(
    m: StabilityMap, folder: Path, source: dict[str, Any], divisors: Sequence[int]
) -> None:
    """Raise :class:`InputError` if the folder holds another map or the map has too few cells,
    before an hour of training starts.
    """
    if (folder / REFERENCE_MAP).exists() and difference(
        source, made_from(load_map(folder / REFERENCE_MAP))
    ):
        raise InputError(f"{folder} holds another map, {REFERENCE_MAP}: give an empty folder")
    for divisor in divisors:
        training_mask(int(np.isfinite(m.mle).sum()), divisor, SEED)


def _train_all(
    m: StabilityMap,
    models: Sequence[Model],
    divisors: Sequence[int],
    workers: int,
    progress: Callable[[int], None] | None,
) -> dict[tuple[str, int], _Trained]:
    """Train every model at every fraction; by name and divisor."""
    jobs = [(kind.name, divisor) for kind in models for divisor in divisors]
    run = joblib.Parallel(n_jobs=workers, return_as="generator")
    trained = {}
    for job, found in zip(jobs, run(joblib.delayed(_train)(m, *job) for job in jobs), strict=True):
        trained[job] = found
        if progress:
            progress(1)
    return trained


def _table_bytes(scores: pd.DataFrame) -> bytes:
    """Return a table of errors as CSV, without the seconds, which differ from run to run."""
    kept = [column for column in scores.columns if not column.endswith("_seconds")]
    return csv_bytes(scores[kept])


def _of_figures(
    m: StabilityMap, models: Sequence[Model], divisors: Sequence[int]
) -> tuple[list[Model], list[int]]:
    """Return the models and divisors whose maps with a floor are shipped, those of the paper's
    figures.
    """
    low = floored(m, FLOOR)
    found = [(k, d) for k in models for d in divisors if maps_file(low, k, d)]
    return (
        [k for k in models if k in {kind for kind, _ in found}],
        [d for d in divisors if d in {divisor for _, divisor in found}],
    )


def _maps_bytes(
    m: StabilityMap,
    models: Sequence[Model],
    divisors: Sequence[int],
    trained: dict[tuple[str, int], _Trained],
) -> bytes:
    """Return the predicted maps as an NPZ file: one array a model, with the divisors along its
    first dimension.
    """
    rows = {kind.name: [trained[kind.name, divisor] for divisor in divisors] for kind in models}
    metadata = {
        "seed": SEED,
        "divisors": list(divisors),
        "design": design_hash(m.design),
        "map": map_hash(m),
        "models": {name: [row.description for row in group] for name, group in rows.items()},
        "masks": [mask_hash(training_cells(m, divisor, SEED)) for divisor in divisors],
        "mle_unit": "per revolution, natural logarithm",
        "dimensions": ["divisor", "bearing_number", "rotor_mass"],
    }
    arrays = {"bearing_number": m.bearing_number, "rotor_mass": m.rotor_mass}
    arrays |= {name: np.stack([row.mle for row in group]) for name, group in rows.items()}
    return npz_bytes(arrays | {"metadata": np.array(json.dumps(metadata, sort_keys=True))})


def _room(folder: Path, written: dict[str, bytes]) -> int:
    """Return how many bytes are left for models beside the other files of the folder."""
    others = sum(
        (folder / name).stat().st_size
        for name in present_files(folder)
        if name not in written and not _is_model(name)
    )
    return MAX_FOLDER_BYTES - others - sum(map(len, written.values())) - 200_000  # the manifest


def _write(m: StabilityMap, folder: Path, written: dict[str, bytes]) -> None:
    """Write the files, and the map unless it is there; delete the old models."""
    for name in present_files(folder):
        if _is_model(name) and name not in written:
            (folder / name).unlink()
    if not (folder / REFERENCE_MAP).exists():
        save_map(m, folder / REFERENCE_MAP)
    for name, data in written.items():
        write_atomically(folder / name, data)


def trainings(models: Sequence[Model], divisors: Sequence[int], seeds: Sequence[int]) -> int:
    """Return the number of trainings in :func:`rebuild`."""
    return table_rows(TABLES, divisors, seeds, models) + len(models) * len(divisors)


def table_rows(
    names: Collection[str],
    divisors: Sequence[int],
    seeds: Sequence[int],
    models: Sequence[Model] = tuple(MODELS.values()),
) -> int:
    """Return the number of trainings in :func:`make_tables`."""
    rows = sum(len(kinds) * len(_seeds(name, seeds)) for name, kinds, _ in _tables(models, names))
    return rows * len(divisors)


def _tables(models: Sequence[Model], names: Collection[str]) -> list[_Table]:
    """Return file, models or classifiers, and options of each named table that has any of the
    models, and of those of classifiers.
    """
    known: list[Model | Labels] = [*models, *LABELS.values()]
    found: list[_Table] = []
    for name, (of, options) in TABLES.items():
        kinds = [k for k in known if (isinstance(k, Model) if of is None else k.name in of)]
        if name in names and kinds:
            found.append((name, kinds, options))
    return found


def _is_model(name: str) -> bool:
    return name.endswith(".joblib")


def check_intervals(m: StabilityMap, kind: Model, divisor: int, folder: Path) -> None:
    """Raise :class:`ArtifactError` where the shipped models behind a model's intervals do not give
    the scores that are shipped beside them.
    """
    found = uncertain_map(
        m, kind, divisor, SEED, known=load_shipped_certainty(m, kind, divisor, SEED, folder)
    )
    table = pd.read_csv(io.BytesIO(checked_bytes(UNCERTAINTY, folder))).set_index(
        ["model", "divisor", "seed"]
    )
    if (kind.name, divisor, SEED) not in table.index:
        raise ArtifactError(
            f"{kind.name} n/{divisor} is missing in {UNCERTAINTY}; `spab train --all` makes it "
            "again"
        )
    row = table.loc[kind.name, divisor, SEED]
    for column, value in uncertainty_scores(m, found).items():
        if not abs(float(row[column]) - value) <= TOLERANCE:
            raise ArtifactError(
                f"{column} is {row[column]:.6g} in {UNCERTAINTY} and {value:.6g} with this model"
            )
