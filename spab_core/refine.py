"""Where to solve next: picks the cells of a plane worth solving, from a coarse start, and predicts the others.

A committee of randomised trees learns from the solved cells. Cells are then drawn, a batch at a time, in proportion to what the
committee expects to get wrong: the variance of the exponent among its trees (the expected squared error, which lives in the
strongly damped corner of low bearing numbers) for one part of a batch, the impurity of the regime (the expected rate of wrong
labels, which lives at the borders) for the rest; never two neighbours in one batch. A choice depends on the solved values, the
seed and the number of the batch alone, so a run that was killed makes the same choices again.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor

from spab_core.design import Design, InputError, check_number, write_atomically
from spab_core.evaluation import mae, rmse
from spab_core.features import LinearTable
from spab_core.map_engine import cluster_or_processes, locked, open_run, solve_chunk
from spab_core.regimes import REGIMES
from spab_core.simulate import Settings
from spab_core.stability_map import FIELDS, UNREADABLE, MapError, StabilityMap, check_plane, npz_bytes

MIN_START = 16  # cells
START = 256  # the coarse start is 1/START of the plane, but no more than a quarter of the budget
MAX_PLANE = 250_000  # cells that the committee predicts after each batch
TREES = 60
DOUBLING = 4  # batches in which the solved cells double
# part of a batch drawn by the variance of the exponent, the rest by the impurity of the regime; where linear theory takes the
# smooth part of the exponent away, what still varies lies at the borders between regimes too
EXPONENT_SHARE, THEORY_SHARE = 0.3, 0.92
EXPLORE = 1e-3  # impurity below which no cell is taken to be: an island that no solved cell has met can be found
SUGGESTIONS = 24  # cells named to be solved next
CHUNK = 5  # cells solved between two checkpoints
DAMPED = 0.15  # bearing number below which exponents reach -38 per revolution: errors are told without them too
LABELS = (*REGIMES, "")  # "": the run fails, no exponent

Oracle = Callable[[np.ndarray], dict[str, np.ndarray]]  # flat indices (k,) -> values (k,) by the names of FIELDS


@dataclass(frozen=True)
class Prediction:
    """What the committee says of every cell of a plane.

    Attributes
    ----------
    mle, deviation : ndarray, (n,)
        Mean and standard deviation over the trees, per revolution; nan where fewer than two solved cells have an exponent.
    probability : ndarray, (n, 4)
        Share of the trees' votes for each of :data:`LABELS`.
    """

    mle: np.ndarray
    deviation: np.ndarray
    probability: np.ndarray

    @property
    def regime(self) -> np.ndarray:
        """The likeliest of :data:`LABELS`, (n,) of str."""
        return np.array(LABELS)[self.probability.argmax(1)]

    @property
    def unstable(self) -> np.ndarray:
        """Probability that the motion is not periodic, a run that fails (touchdown) included, (n,)."""
        return 1.0 - self.probability[:, LABELS.index("periodic")]

    @property
    def impurity(self) -> np.ndarray:
        """Gini impurity of the regime, (n,): the rate of wrong labels if they were drawn by their probabilities."""
        return 1.0 - (self.probability**2).sum(1)


def linear_columns(bearing_number: np.ndarray, rotor_mass: np.ndarray, table: LinearTable) -> np.ndarray:
    """Decay rate per revolution, whirl frequency and static eccentricity of each cell by linear theory, (n, 3)."""
    number, mass = np.meshgrid(bearing_number, rotor_mass, indexing="ij")
    return table.at(number.ravel(), mass.ravel())


def plane_inputs(bearing_number: np.ndarray, rotor_mass: np.ndarray) -> np.ndarray:
    """What the trees see of each cell of a plane, (n, 6) in the order of ``mle.ravel()``.

    Both axes scaled to [0, 1], their sum and difference, ln(m Λ) and ln(m Λ²); the last is, up to a constant, that of the
    dimensionless mass. Trees split along axes, and the borders between regimes run obliquely.
    """
    number, mass = np.meshgrid(bearing_number, rotor_mass, indexing="ij")
    number, mass = number.ravel(), mass.ravel()
    u, v = ((a - a.min()) / max(np.ptp(a), 1e-12) for a in (number, mass))
    return np.column_stack([u, v, u + v, u - v, np.log(mass * number), np.log(mass * number**2)])


def predict_plane(inputs: np.ndarray, bearing_number: np.ndarray, solved: np.ndarray, mle: np.ndarray, regime: np.ndarray,
                  seed: int = 0, linear: np.ndarray | None = None) -> Prediction:
    """Train the committee on the solved cells and predict all of them.

    Parameters
    ----------
    inputs : ndarray, (n, 6)
        Of :func:`plane_inputs`.
    bearing_number : ndarray, (n,)
        Of each cell. The trees learn MLE times bearing number, which is nearly smooth where the exponent itself is steep.
    solved : ndarray of bool, (n,)
        The cells to learn from, at least one.
    mle : ndarray, (n,)
        Per revolution; nan where a run failed.
    regime : ndarray of str, (n,)
        "" where a run failed.
    seed : int
    linear : ndarray, (n, 3)
        Of :func:`linear_columns`: more inputs, and the exponent that the trees start from where the rate is negative.

    Returns
    -------
    Prediction
    """
    base = np.zeros(len(mle)) if linear is None else np.minimum(linear[:, 0], 0.0)
    inputs = inputs if linear is None else np.column_stack([inputs, linear])
    inputs = np.asarray(inputs, np.float32)  # what trees compute in: converted once
    count = len(inputs)
    known = solved & np.isfinite(mle)
    mean, deviation = np.full(count, np.nan), np.full(count, np.nan)
    if known.sum() >= 2:
        trees = ExtraTreesRegressor(TREES, random_state=seed).fit(inputs[known], ((mle - base) * bearing_number)[known])
        each = np.array([tree.predict(inputs) for tree in trees.estimators_], np.float32)
        mean, deviation = base + each.mean(0, dtype=float) / bearing_number, each.std(0, dtype=float) / bearing_number
    votes = ExtraTreesClassifier(TREES, random_state=seed).fit(inputs[solved], regime[solved])
    probability = np.zeros((count, len(LABELS)))
    probability[:, [LABELS.index(name) for name in votes.classes_]] = votes.predict_proba(inputs)
    return Prediction(mean, deviation, probability)


def choose_start(shape: tuple[int, int], count: int, seed: int, allowed: np.ndarray) -> np.ndarray:
    """Space-filling cells: flat indices (count,) among ``allowed`` (n,), from an additive recurrence with a random offset.

    The steps are powers of the plastic number's inverse: points k times them, modulo 1, fill a square evenly for every k.
    """
    rng = np.random.default_rng([seed, 0])
    steps = 1.324717957244746 ** -np.arange(1.0, 3.0)
    points = (rng.random(2) + np.arange(20 * count)[:, None] * steps) % 1.0
    cells = np.ravel_multi_index(tuple((points * shape).astype(int).T), shape)
    others = rng.permutation(allowed.size)  # where few cells are allowed, the recurrence may not meet enough of them
    cells = np.concatenate([cells, others])
    cells = cells[allowed[cells]]
    _, first = np.unique(cells, return_index=True)
    return cells[np.sort(first)[:count]]


def choose_next(prediction: Prediction, free: np.ndarray, shape: tuple[int, int], size: int, seed: int,
                batch: int, share: float = EXPONENT_SHARE) -> tuple[np.ndarray, np.ndarray]:
    """Draw a batch: first by the variance of the exponent, then by the impurity of the regime, never two neighbours.

    Parameters
    ----------
    prediction : Prediction
    free : ndarray of bool, (n,)
        Cells that may be chosen: never a solved one.
    shape : tuple of int
        (bearing numbers, rotor masses).
    size : int
        At most the number of free cells.
    seed, batch : int
        Of the random draw.
    share : float
        Of the batch, drawn by the variance of the exponent.

    Returns
    -------
    cells : ndarray of int, (size,)
        Flat indices.
    for_regime : ndarray of bool, (size,)
        Whether a cell was drawn for its regime rather than for its exponent.
    """
    rng = np.random.default_rng([seed, 1, batch])
    rows, columns = shape
    blocked = np.zeros((rows + 2, columns + 2), bool)
    taken = ~free
    cells: list[int] = []
    for_regime: list[bool] = []
    for_exponent = round(share * size)
    variance = np.nan_to_num(prediction.deviation**2)
    for weight, regime, until in ((variance, False, for_exponent), (np.maximum(prediction.impurity, EXPLORE), True, size)):
        # the largest of log weight + Gumbel noise: a draw without replacement in proportion to the weights
        order = np.argsort(-(np.log(weight + 1e-12) + rng.gumbel(size=weight.size)), kind="stable")
        for apart in (True, False):  # neighbours only where nothing else is left
            for cell in order:
                if len(cells) == until:
                    break
                row, column = divmod(int(cell), columns)
                if taken[cell] or (apart and blocked[row + 1, column + 1]):
                    continue
                taken[cell] = True
                blocked[row:row + 3, column:column + 3] = True
                cells.append(int(cell))
                for_regime.append(regime)
    return np.array(cells, int), np.array(for_regime, bool)


@dataclass(frozen=True)
class Refinement:
    """A plane of which some cells are solved and all are predicted.

    Attributes
    ----------
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    batch : ndarray of int, (B, M)
        In which batch a cell was solved, 0: the start; -1 where it is not solved.
    values : dict of ndarray, (B, M)
        Solved values by the names of ``stability_map.FIELDS``; nan, "" or 0 in cells that are not solved.
    mle, deviation : ndarray, (B, M)
        Predicted exponent per revolution and its standard deviation among the trees.
    regime : ndarray of str, (B, M)
        Predicted; "" where the run is predicted to fail.
    unstable : ndarray, (B, M)
        Predicted probability that the motion is not periodic, a run that fails included.
    suggested : ndarray of int, (k,)
        Flat indices of the cells to solve next, empty where none is left.
    suggested_for_regime : ndarray of bool, (k,)
        Whether each is suggested for its regime rather than for its exponent.
    metadata : dict
    """

    bearing_number: np.ndarray
    rotor_mass: np.ndarray
    batch: np.ndarray
    values: dict[str, np.ndarray]
    mle: np.ndarray
    deviation: np.ndarray
    regime: np.ndarray
    unstable: np.ndarray
    suggested: np.ndarray
    suggested_for_regime: np.ndarray
    metadata: dict = field(default_factory=dict)

    @property
    def solved(self) -> np.ndarray:
        """Which cells are solved, (B, M) of bool."""
        return self.batch >= 0

    def suggestions(self) -> pd.DataFrame:
        """The cells to solve next, one row each, in the order of their choice."""
        row, column = np.unravel_index(self.suggested, self.batch.shape)
        speed = Design.from_dict(self.metadata["design"]).speed_rpm(1.0)
        return pd.DataFrame({
            "bearing_number": self.bearing_number[row], "speed_rpm": speed * self.bearing_number[row],
            "rotor_mass_kg": self.rotor_mass[column], "predicted_mle": self.mle[row, column],
            "deviation": self.deviation[row, column], "predicted_regime": self.regime[row, column],
            "probability_unstable": self.unstable[row, column],
            "in_doubt": np.where(self.suggested_for_regime, "regime", "exponent")})


def check_budget(cells: int, budget: int, seed: int) -> int:
    """Size of the coarse start of a run. Raises :class:`InputError` for a plane, budget or seed out of range."""
    if not MIN_START <= cells <= MAX_PLANE:
        raise InputError(f"a plane of {cells} cells is out of range: allowed is from {MIN_START} to {MAX_PLANE} cells")
    check_number("budget", budget, MIN_START, cells, "cells")
    check_number("seed", seed, 0, 2**32 - 1)
    for name, value in (("budget", budget), ("seed", seed)):
        if value != int(value):
            raise InputError(f"{name} = {value} must be a whole number")
    return max(MIN_START, min(cells // START, int(budget) // 4))


Watch = Callable[[np.ndarray, Prediction], None]


def refine(bearing_number: np.ndarray, rotor_mass: np.ndarray, oracle: Oracle, budget: int, seed: int = 0, *,
           allowed: np.ndarray | None = None, table: LinearTable | None = None, watch: Watch | None = None,
           metadata: dict | None = None, start: int | None = None, share: float | None = None,
           allowance: Callable[[int], int] | None = None, publish: Callable[[Refinement], None] | None = None) -> Refinement:
    """Solve ``budget`` cells of a plane, each batch where the cells solved before leave most in doubt.

    Parameters
    ----------
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    oracle : callable
        Solves cells, :func:`map_oracle` or :func:`live_oracle`: flat indices (k,) -> arrays (k,) by the names of
        ``stability_map.FIELDS``. A cell that fails counts, and is not asked for again.
    budget : int
        Cells solved in the end, the start included.
    seed : int
        Of the start, the trees and the draws.
    allowed : ndarray of bool, (B, M), optional
        Cells that may be solved, at least ``budget`` of them; left out: all.
    table : LinearTable, optional
        What linear theory knows of the design, for the committee to start from.
    watch : callable, optional
        Called after each batch with the solved cells (n,) and what they predict.
    metadata : dict, optional
        Of the result; ``design`` is needed for :meth:`Refinement.suggestions`.
    start : int, optional
        Cells of the coarse start, at most ``budget``; those of a smaller start are among those of a larger one.
    share : float, optional
        Of a batch, drawn for the exponent rather than for the regime.
    allowance : callable, optional
        Called with the number of solved cells before each batch: the most cells that it may have; 0 ends the run.
    publish : callable, optional
        Called with the result so far after each batch.

    Returns
    -------
    Refinement

    Raises
    ------
    InputError
        For a plane, a budget or a seed out of range.
    """
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    count = check_plane(bearing_number, rotor_mass)
    first = check_budget(count, budget, seed)
    if start is not None:
        first = int(check_number("start", start, MIN_START, budget, "cells"))
    shape = (len(bearing_number), len(rotor_mass))
    may = np.ones(count, bool) if allowed is None else np.asarray(allowed, bool).ravel()
    if may.size != count or may.sum() < budget:
        raise InputError(f"budget = {budget} is out of range: {int(may.sum())} of {may.size} cells may be solved")
    inputs, number = plane_inputs(bearing_number, rotor_mass), np.repeat(bearing_number, shape[1])
    linear = None if table is None else linear_columns(bearing_number, rotor_mass, table)
    if share is None:
        share = EXPONENT_SHARE if table is None else THEORY_SHARE
    values = {name: _nothing(dtype, count) for name, dtype in FIELDS.items()}
    batch_of = np.full(count, -1, np.int16)
    cells, batch = choose_start(shape, first, seed, may), 0
    while True:
        found = oracle(cells)
        for name in FIELDS:
            values[name][cells] = found[name]
        batch_of[cells] = batch
        solved = batch_of >= 0
        prediction = predict_plane(inputs, number, solved, values["mle"], values["regime"], seed, linear)
        if watch:
            watch(solved, prediction)
        batch += 1
        done, free = int(solved.sum()), may & ~solved
        goal = min(max(done + 1, round(first * 2.0 ** (batch / DOUBLING))), budget)
        size = goal - done if allowance is None else min(goal - done, allowance(done))
        own = {"budget": int(budget), "seed": int(seed), "start": first, "batches": batch}
        if publish or size <= 0:
            suggested = choose_next(prediction, free, shape, min(SUGGESTIONS, int(free.sum())), seed, batch, share)
            result = _refinement(bearing_number, rotor_mass, batch_of, values, prediction, suggested, (metadata or {}) | own)
            if publish:
                publish(result)
            if size <= 0:
                return result
        cells, _ = choose_next(prediction, free, shape, size, seed, batch, share)


def _refinement(bearing_number, rotor_mass, batch_of, values, prediction, suggested, metadata) -> Refinement:
    shape = (len(bearing_number), len(rotor_mass))
    mle, deviation, regime, unstable = (a.reshape(shape) for a in (prediction.mle, prediction.deviation, prediction.regime,
                                                                   prediction.unstable))
    return Refinement(bearing_number, rotor_mass, batch_of.reshape(shape).copy(),
                      {k: v.reshape(shape).copy() for k, v in values.items()}, mle, deviation, regime, unstable,
                      suggested[0], suggested[1], metadata)


def _nothing(dtype, shape):
    kind = np.dtype(dtype).kind
    return np.full(shape, np.nan if kind == "f" else "" if kind == "U" else 0, dtype)


def map_oracle(m: StabilityMap) -> Oracle:
    """Takes the cells' values from a solved map: for studies, where the truth is known."""
    flat = {name: getattr(m, name).ravel() for name in FIELDS}
    return lambda cells: {name: values[cells] for name, values in flat.items()}


def scores(m: StabilityMap, prediction: Prediction, cells: np.ndarray) -> dict[str, float]:
    """How well a prediction does on some cells of a solved map.

    Parameters
    ----------
    m : StabilityMap
        The truth.
    prediction : Prediction
    cells : ndarray of bool, (n,)
        Which cells count, such as the held-out ones.

    Returns
    -------
    dict
        Those of :func:`exponent_scores` and :func:`regime_scores`; nan where no cell counts.
    """
    return (exponent_scores(m, prediction.mle, cells)
            | regime_scores(m.regime.ravel()[cells], prediction.regime[cells]))


def exponent_scores(m: StabilityMap, predicted: np.ndarray, cells: np.ndarray) -> dict[str, float]:
    """``rmse``, ``mae`` and, at bearing numbers from :data:`DAMPED` on, ``rmse_undamped``.

    Per revolution, over those of ``cells`` (n,) that have an exponent; ``predicted`` (n,). nan where there are none.
    """
    truth = m.mle.ravel()
    known = cells & np.isfinite(truth)
    undamped = known & (np.repeat(m.bearing_number, len(m.rotor_mass)) >= DAMPED - 1e-9)
    return {name: function(truth[chosen], predicted[chosen]) if chosen.any() else np.nan
            for name, function, chosen in (("rmse", rmse, known), ("rmse_undamped", rmse, undamped), ("mae", mae, known))}


def regime_scores(truth: np.ndarray, predicted: np.ndarray) -> dict[str, float]:
    """``accuracy`` of regimes and ``chaos_f1``: 2 tp / (2 tp + fp + fn) of "chaotic"; nan where there is nothing to count."""
    chaotic, said = truth == "chaotic", predicted == "chaotic"
    both, either = int((chaotic & said).sum()), int(chaotic.sum() + said.sum())
    return {"accuracy": float((truth == predicted).mean()) if len(truth) else np.nan,
            "chaos_f1": 2 * both / either if either else np.nan}


@contextlib.contextmanager
def live_oracle(design: Design, bearing_number: np.ndarray, rotor_mass: np.ndarray, settings: Settings, *, parts: Path,
                plan: dict, workers: int = 1, progress: Callable[[int], None] | None = None) -> Iterator[Oracle]:
    """Solves cells live, each from its own cold start, and keeps them in ``parts``: a run that was killed goes on from them.

    Parameters
    ----------
    design : Design
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
    settings : Settings
    parts : Path
        Folder for solved cells; :func:`spab_core.map_engine.remove_parts` deletes it.
    plan : dict
        What else must be the same to go on, such as the seed; plain values.
    workers : int
        Processes; the values do not depend on it.
    progress : callable
        Called with the number of cells done since the last call, those found in ``parts`` included.

    Raises
    ------
    MapError
        Where ``parts`` holds another run, is in use, or is damaged.
    """
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    count = check_plane(bearing_number, rotor_mass)
    run_hash = open_run(parts, design, bearing_number, rotor_mass, settings, **{f"refine_{k}": v for k, v in plan.items()})
    number, mass = np.repeat(bearing_number, len(rotor_mass)), np.tile(rotor_mass, len(bearing_number))
    with locked(parts):
        stored = {name: _nothing(dtype, count) for name, dtype in FIELDS.items()}
        have = np.zeros(count, bool)
        files = sorted(parts.glob("chunk-*.npz"))
        for path in files:
            cells, values = _read_chunk(path, run_hash, count)
            have[cells] = True
            for name in FIELDS:
                stored[name][cells] = values[name]
        last = int(files[-1].stem.removeprefix("chunk-")) if files else -1

        def solve(cells: np.ndarray) -> dict[str, np.ndarray]:
            nonlocal last
            missing = cells[~have[cells]]
            if progress and len(missing) < len(cells):
                progress(len(cells) - len(missing))
            chunks = {last + 1 + k: missing[at:at + CHUNK] for k, at in enumerate(range(0, len(missing), CHUNK))}
            if chunks:
                last = max(chunks)
                jobs = (joblib.delayed(solve_chunk)(k, design, [(float(number[c]), float(mass[c])) for c in chunk], settings)
                        for k, chunk in chunks.items())
                with cluster_or_processes(workers) as run:
                    for k, result in run(jobs):
                        result = {name: result[name] for name in FIELDS}
                        write_atomically(parts / f"chunk-{k:06d}.npz", npz_bytes(
                            result | {"cells": chunks[k], "run": np.array(run_hash)}))
                        have[chunks[k]] = True
                        for name in FIELDS:
                            stored[name][chunks[k]] = result[name]
                        if progress:
                            progress(len(chunks[k]))
            return {name: values[cells] for name, values in stored.items()}

        yield solve


def _read_chunk(path: Path, run_hash: str, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            found = {name: data[name] for name in (*FIELDS, "cells", "run")}
    except UNREADABLE as error:
        raise MapError(f"{path} is damaged ({error}); delete it to compute these cells again") from None
    cells = found.pop("cells")
    fits = cells.dtype.kind == "i" and cells.ndim == 1 and np.all((cells >= 0) & (cells < count))
    if str(found.pop("run")) != run_hash or not fits or any(found[name].shape != cells.shape for name in FIELDS):
        raise MapError(f"{path} belongs to another run; delete it to compute these cells again")
    return cells, found


_FLOATS = {"predicted_mle": "mle", "predicted_deviation": "deviation", "probability_unstable": "unstable"}  # in the file
_ARRAYS = {"batch": "i", "predicted_regime": "U", **dict.fromkeys(_FLOATS, "f")}


def save_refinement(result: Refinement, path: str | Path) -> None:
    """Write as NPZ, atomically.

    Keys: ``bearing_number``, ``rotor_mass``, ``solved``, ``batch``, the solved values by the names of ``FIELDS``,
    ``predicted_mle``, ``predicted_deviation`` and ``probability_unstable`` (float32), ``predicted_regime``, ``suggested`` (flat
    indices), ``suggested_for_regime``, ``metadata`` as JSON text.
    """
    arrays = {"bearing_number": result.bearing_number, "rotor_mass": result.rotor_mass, "solved": result.solved,
              "batch": result.batch, **result.values,
              **{key: getattr(result, name).astype(np.float32) for key, name in _FLOATS.items()},
              "predicted_regime": result.regime, "suggested": result.suggested,
              "suggested_for_regime": result.suggested_for_regime, "metadata": np.array(json.dumps(result.metadata))}
    write_atomically(path, npz_bytes(arrays))


def load_refinement(path: str | Path) -> Refinement:
    """Read what :func:`save_refinement` wrote; nothing in it is ever unpickled. Raises ``MapError`` for any other file."""
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
            found = {name: data[name] for name in ("bearing_number", "rotor_mass", *_ARRAYS, *FIELDS, "suggested",
                                                   "suggested_for_regime")}
            metadata = json.loads(str(data["metadata"]))
            Design.from_dict(metadata["design"])
    except InputError:
        raise
    except (*UNREADABLE, TypeError) as error:
        raise MapError(f"cannot read the refinement {str(path)!r}: {error}") from None
    number, mass, suggested = found["bearing_number"], found["rotor_mass"], found["suggested"]
    kinds = _ARRAYS | {name: np.dtype(dtype).kind for name, dtype in FIELDS.items()}
    fits = (number.ndim == mass.ndim == suggested.ndim == 1 and number.dtype.kind == mass.dtype.kind == "f"
            and suggested.dtype.kind == "i" and found["suggested_for_regime"].shape == suggested.shape
            and all(found[k].shape == (len(number), len(mass)) and found[k].dtype.kind == kind for k, kind in kinds.items())
            and np.all((suggested >= 0) & (suggested < len(number) * len(mass)))
            and np.isin(found["predicted_regime"], LABELS).all() and np.isin(found["regime"], LABELS).all())
    if not fits:
        raise MapError(f"{path} is not a refinement: its arrays do not fit together")
    return Refinement(number, mass, found["batch"], {name: found[name] for name in FIELDS},
                      **{name: found[key].astype(float) for key, name in _FLOATS.items()}, regime=found["predicted_regime"],
                      suggested=suggested, suggested_for_regime=found["suggested_for_regime"].astype(bool), metadata=metadata)
