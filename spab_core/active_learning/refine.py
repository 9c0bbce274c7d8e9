"""Where to solve next: solve a coarse start, pick the cells of a plane worth solving, predict the
others.

The committee of :mod:`spab_core.active_learning.committee` learns from the solved cells. It then
draws cells in batches where it expects errors: part of a batch by the variance of the exponent
among its trees (the expected squared error), the rest in proportion to the impurity of the regime
(the expected rate of wrong labels, largest at the borders); never two neighbours in one batch. The
choice depends only on the solved values, the seed and the number of the batch, so a run that is
resumed makes the same choices.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import distance_transform_edt

from spab_core.active_learning.committee import (
    LABELS,
    RUBS,
    Prediction,
    kinds_of_motion,
    plane_inputs,
    predict_plane,
)
from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import LinearTable
from spab_core.maps.compute import CellSolver
from spab_core.maps.stability_map import (
    AXES,
    CELLS,
    FIELDS,
    MapError,
    check_plane,
    unsolved,
    with_unknown,
)
from spab_core.solver.stepping import STATUS
from spab_core.trajectory.assessment import GRADES, Motion, grades

MIN_START = 16  # cells
START = 256  # the coarse start is 1/START of the plane, but no more than a quarter of the budget
MAX_PLANE = 250_000  # cells that the committee predicts after each batch
DOUBLING = (
    6  # batches in which the solved cells double, fewer where they would have less than BATCH cells
)
BATCH = 16
# part of a batch drawn by the variance of the exponent, the rest by the impurity of the regime;
# where linear theory takes the smooth part of the exponent away, what still varies lies at the
# borders between regimes too
EXPONENT_SHARE, THEORY_SHARE = 0.3, 0.85
SHARPNESS = 1.25  # the power of the variance to which draws are proportional
# least impurity of any cell, so that islands which no solved cell has met can be found
EXPLORE = 1e-3
SUGGESTIONS = 24  # cells named to be solved next


def choose_start(shape: tuple[int, int], count: int, seed: int, allowed: np.ndarray) -> np.ndarray:
    """Return space-filling cells, flat indices (count,) among ``allowed`` (n,), from an additive
    recurrence with a random offset.

    The steps are powers of the inverse of the plastic number: the points k * steps modulo 1, k = 0,
    1, 2 ..., fill a square evenly, however many there are.
    """
    rng = np.random.default_rng([seed, 0])
    steps = 1.324717957244746 ** -np.arange(1.0, 3.0)
    points = (rng.random(2) + np.arange(20 * count)[:, None] * steps) % 1.0
    cells = np.ravel_multi_index(tuple((points * shape).astype(int).T), shape)
    # where few cells are allowed, the recurrence may not meet enough of them
    others = rng.permutation(allowed.size)
    cells = np.concatenate([cells, others])
    cells = cells[allowed[cells]]
    _, first = np.unique(cells, return_index=True)
    return np.take(cells, np.sort(first)[:count])


def choose_next(
    prediction: Prediction,
    free: np.ndarray,
    shape: tuple[int, int],
    size: int,
    seed: int,
    batch: int,
    share: float = EXPONENT_SHARE,
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a batch, part weighted by the variance of the exponent and part by the impurity of the
    regime, never two neighbours.

    Parameters
    ----------
    prediction : Prediction
    free : ndarray of bool, (n,)
        Cells that may be chosen; no solved cell is among them.
    shape : tuple of int
        (bearing numbers, rotor masses).
    size : int
        At most the number of free cells.
    seed, batch : int
        Seeds of the random numbers, which differ between batches.
    share : float
        Share of the batch that is chosen by the variance of the exponent.

    Returns
    -------
    cells : ndarray of int, (size,)
        Flat indices.
    for_regime : ndarray of bool, (size,)
        Whether a cell was chosen for its regime rather than for its exponent.
    """
    rng = np.random.default_rng([seed, 1, batch])
    rows, columns = shape
    blocked = np.zeros((rows + 2, columns + 2), bool)
    taken = ~free
    cells: list[int] = []
    for_regime: list[bool] = []
    for_exponent = round(share * size)
    doubt = np.nan_to_num(prediction.deviation**2) ** SHARPNESS
    for weight, regime, until in (
        (doubt, False, for_exponent),
        (np.maximum(prediction.impurity, EXPLORE), True, size),
    ):
        # the largest of log weight + Gumbel noise: a draw without replacement in proportion to the
        # weights
        order = np.argsort(-(np.log(weight + 1e-12) + rng.gumbel(size=weight.size)), kind="stable")
        for apart in (True, False):  # neighbours only where nothing else is left
            for cell in order:
                if len(cells) == until:
                    break
                row, column = divmod(int(cell), columns)
                if taken[cell] or (apart and blocked[row + 1, column + 1]):
                    continue
                taken[cell] = True
                blocked[row : row + 3, column : column + 3] = True
                cells.append(int(cell))
                for_regime.append(regime)
    return np.array(cells, int), np.array(for_regime, bool)


def alike(solved: np.ndarray, known: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return for each cell the flat index of the nearest solved cell of its kind, (B, M).

    Parameters
    ----------
    solved : ndarray of bool, (B, M)
    known, predicted : ndarray of str, (B, M)
        Kinds of the solved cells and of all. Where no solved cell is of a kind, any counts.
    """
    source = np.arange(solved.size).reshape(solved.shape)
    for kind in np.unique(predicted[~solved]):
        like = solved & (known == kind)
        wanted = ~solved & (predicted == kind)
        _, (row, column) = distance_transform_edt(
            ~(like if like.any() else solved), return_indices=True
        )
        source[wanted] = np.ravel_multi_index((row[wanted], column[wanted]), solved.shape)
    return source


def _unknown() -> np.ndarray:
    return np.array(np.nan)


_JUDGED = {
    "probability_good": "good",
    "probability_avoid": "avoid",
    "probability_contact": "rubs",
}  # in the file, where more than regimes are predicted


@dataclass(frozen=True)
class Refinement:
    """A plane of which some cells are solved and all are predicted.

    Attributes
    ----------
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    batch : ndarray of int, (B, M)
        Batch in which a cell was solved, 0 for the start; -1 if it is not solved.
    values : dict of ndarray, (B, M)
        Solved values by the names of ``stability_map.FIELDS``; nan, "" or 0 in cells that are not
        solved.
    mle, deviation : ndarray, (B, M)
        Predicted exponent per revolution and its standard deviation among the trees.
    regime : ndarray of str, (B, M)
        Predicted; "" if the run is predicted to fail.
    unstable : ndarray, (B, M)
        Predicted probability that the motion is not periodic, failed runs included.
    suggested : ndarray of int, (k,)
        Flat indices of the cells to solve next, empty if none is left.
    suggested_for_regime : ndarray of bool, (k,)
        Whether each is suggested for its regime rather than for its exponent.
    metadata : dict
    good, avoid, rubs : ndarray, (B, M)
        Predicted probability that the motion is good, to be avoided, and in contact; nan where only
        regimes are predicted.
    source : ndarray of int, (B, M)
        Flat index of the nearest solved cell of the kind that is predicted, itself for a solved
        one: what a cell's orbit, contact and period are taken from.
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
    metadata: dict[str, Any] = field(default_factory=dict)
    good: np.ndarray = field(default_factory=_unknown)
    avoid: np.ndarray = field(default_factory=_unknown)
    rubs: np.ndarray = field(default_factory=_unknown)
    source: np.ndarray = field(default_factory=_unknown)

    def __post_init__(self) -> None:
        for name in _JUDGED.values():
            if not getattr(self, name).ndim:
                object.__setattr__(self, name, np.full(self.batch.shape, np.nan))
        if not self.source.ndim:
            source = alike(self.solved, self.values["regime"], self.regime)
            object.__setattr__(self, "source", source)

    @property
    def solved(self) -> np.ndarray:
        """Mask (B, M) of the solved cells."""
        return self.batch >= 0

    @property
    def judged(self) -> bool:
        """Whether more than regimes are predicted."""
        return not np.isnan(self.good).all()

    @property
    def certainty(self) -> np.ndarray:
        """Probability of the predicted :attr:`assessment`, (B, M); 1 in solved cells, nan where
        only regimes are predicted.
        """
        found = self.assessment
        watch = 1.0 - self.good - self.avoid
        predicted = np.select([found == "good", found == "avoid"], [self.good, self.avoid], watch)
        return np.where(self.solved, 1.0 + 0.0 * self.good, np.clip(predicted, 0.0, 1.0))

    @property
    def assessment(self) -> np.ndarray:
        """Of the motion (:data:`~spab_core.trajectory.assessment.GRADES`), solved or predicted,
        (B, M) of str: that of the cell's source.
        """
        cells = {name: self.values[name].ravel()[self.source] for name in Motion._fields}
        return grades(Design.from_dict(self.metadata["design"]), Motion(**cells))

    def suggestions(self) -> pd.DataFrame:
        """Return the cells to solve next, one row each, in the order of their choice."""
        row, column = np.unravel_index(self.suggested, self.batch.shape)
        speed = Design.from_dict(self.metadata["design"]).speed_rpm(1.0)
        return pd.DataFrame(
            {
                "bearing_number": self.bearing_number[row],
                "speed_rpm": speed * self.bearing_number[row],
                "rotor_mass_kg": self.rotor_mass[column],
                "predicted_mle": self.mle[row, column],
                "deviation": self.deviation[row, column],
                "predicted_regime": self.regime[row, column],
                "probability_unstable": self.unstable[row, column],
                "in_doubt": np.where(self.suggested_for_regime, "regime", "exponent"),
            }
        )


def check_budget(cells: int, budget: int, seed: int) -> int:
    """Return the size of the coarse start of a run.

    Raises :class:`InputError` for a plane, budget or seed out of range.
    """
    if not MIN_START <= cells <= MAX_PLANE:
        raise InputError(
            f"a plane of {cells} cells is out of range: allowed is from {MIN_START} to "
            f"{MAX_PLANE} cells"
        )
    check_number("budget", budget, MIN_START, cells, "cells")
    check_number("seed", seed, 0, 2**32 - 1)
    for name, value in (("budget", budget), ("seed", seed)):
        if value != int(value):
            raise InputError(f"{name} = {value} must be a whole number")
    return max(MIN_START, min(cells // START, int(budget) // 4))


def batch_goals(start: int, budget: int, doubling: int = DOUBLING) -> Iterator[int]:
    """Yield how many cells are solved after each batch: ``start``, then twice as many in
    ``doubling`` batches, and so on up to ``budget``.
    """
    goal = start
    yield goal
    while goal < budget:
        first, steps = goal, min(doubling, max(1, goal // BATCH))
        for k in range(1, steps + 1):
            goal = round(first * 2.0 ** (k / steps))
            yield min(goal, budget)


def refine(
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    oracle: CellSolver,
    budget: int,
    seed: int = 0,
    *,
    allowed: np.ndarray | None = None,
    table: LinearTable | None = None,
    share: float | None = None,
    judge: bool = False,
    goals: Iterable[int] | None = None,
    metadata: dict[str, Any] | None = None,
) -> Iterator[Refinement]:
    """Solve ``budget`` cells of a plane in batches, each where the prediction from the cells solved
    so far is most in doubt.

    Parameters
    ----------
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    oracle : callable
        Solves cells, one of :mod:`spab_core.active_learning.oracles`: flat indices (k,) -> arrays
        (k,) by the names of ``stability_map.FIELDS``. A cell whose run fails counts as solved.
    budget : int
        Cells to solve, the start included.
    seed : int
        Of all random numbers: the start, the trees and the choice of cells.
    allowed : ndarray of bool, (B, M), optional
        Cells that may be solved, at least ``budget`` of them; left out: all.
    table : LinearTable, optional
        Linear theory of the design, which the committee starts from.
    share : float, optional
        Share of a batch that is chosen for the exponent rather than for the regime.
    judge : bool
        Whether the whole kind of motion is predicted (:func:`.committee.kinds_of_motion`), with
        assessment and contact, and cells are chosen for it; else the regime alone.
    goals : iterable of int, optional
        How many cells are to be solved after each batch, the coarse start first; the next one is
        taken when a batch is done. The run ends when it is exhausted, or at ``budget``. Left out:
        :func:`batch_goals`.
    metadata : dict, optional
        Of the result; ``design`` is needed for ``judge`` and :meth:`Refinement.suggestions`.

    Returns
    -------
    iterator of Refinement
        The result so far after each batch; each batch is solved when its result is requested.

    Raises
    ------
    InputError
        For a plane, a budget or a seed out of range.
    """
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    count = check_plane(bearing_number, rotor_mass)
    start = check_budget(count, budget, seed)
    may = np.ones(count, bool) if allowed is None else np.asarray(allowed, bool).ravel()
    if may.size != count or may.sum() < budget:
        raise InputError(
            f"budget = {budget} is out of range: {int(may.sum())} of {may.size} cells may be solved"
        )
    if share is None:
        share = EXPONENT_SHARE if table is None else THEORY_SHARE
    goals = batch_goals(start, budget) if goals is None else goals
    about = (metadata or {}) | {"budget": int(budget), "seed": int(seed)}
    return _batches(bearing_number, rotor_mass, oracle, goals, may, table, share, judge, about)


def last(results: Iterable[Refinement]) -> Refinement:
    """Run a refinement to its end and return its last result."""
    return deque(results, maxlen=1).pop()


def _batches(
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    oracle: CellSolver,
    goals: Iterable[int],
    allowed: np.ndarray,
    table: LinearTable | None,
    share: float,
    judge: bool,
    metadata: dict[str, Any],
) -> Iterator[Refinement]:
    shape, seed = (len(bearing_number), len(rotor_mass)), metadata["seed"]
    inputs = plane_inputs(bearing_number, rotor_mass, table)
    values = {name: unsolved(dtype, allowed.size) for name, dtype in FIELDS.items()}
    batch_of = np.full(allowed.size, -1, np.int16)
    prediction, start, kinds = None, 0, None
    design = Design.from_dict(metadata["design"]) if judge else None
    for batch, goal in enumerate(goals):
        free = allowed & (batch_of < 0)
        size = min(goal, metadata["budget"]) - int((batch_of >= 0).sum())
        if size <= 0:
            return
        if prediction is None:
            start, cells = size, choose_start(shape, size, seed, allowed)
        else:
            cells, _ = choose_next(prediction, free, shape, size, seed, batch, share)
        found = oracle(cells)
        for name in FIELDS:
            values[name][cells] = found[name]
        batch_of[cells], free[cells] = batch, False
        solved = batch_of >= 0
        if design:
            kinds = kinds_of_motion(design, values)
        prediction = predict_plane(inputs, solved, values["mle"], values["regime"], seed, kinds)
        most = min(SUGGESTIONS, int(free.sum()))
        suggested = choose_next(prediction, free, shape, most, seed, batch + 1, share)
        yield Refinement(
            bearing_number,
            rotor_mass,
            batch_of.reshape(shape).copy(),
            {name: array.reshape(shape).copy() for name, array in values.items()},
            prediction.mle.reshape(shape),
            prediction.deviation.reshape(shape),
            prediction.regime.reshape(shape),
            prediction.unstable.reshape(shape),
            *suggested,
            metadata | {"start": start, "batches": batch + 1},
            **_judged(prediction, solved, kinds, shape),
        )


def _judged(
    prediction: Prediction, solved: np.ndarray, kinds: np.ndarray | None, shape: tuple[int, int]
) -> dict[str, np.ndarray]:
    """Return what is predicted beyond regimes, by the names of a refinement's attributes."""
    votes = prediction.votes
    if votes is None or kinds is None:
        return {}
    found = {
        "good": votes.probability("assessment", "good"),
        "avoid": votes.probability("assessment", "avoid"),
        "rubs": votes.probability("contact", RUBS),
    }
    source = alike(*(a.reshape(shape) for a in (solved, kinds, votes.winner)))
    return {name: p.reshape(shape) for name, p in found.items()} | {"source": source}


_FLOATS = {
    "predicted_mle": "mle",
    "predicted_deviation": "deviation",
    "probability_unstable": "unstable",
}  # in the file
_SCHEMA = Schema(
    "refinement",
    {
        **AXES,
        "batch": Array(np.int16, tuple(AXES), low=-1, high=MAX_PLANE),
        **CELLS,
        "status": CELLS["status"].along(*AXES, texts=(*STATUS, "")),
        **dict.fromkeys(_FLOATS, Array(np.float32, tuple(AXES))),
        "predicted_regime": Array("<U14", tuple(AXES), texts=LABELS),
        "suggested": Array(np.int64, ("suggestion",), low=0),
        "suggested_for_regime": Array(bool, ("suggestion",)),
        # of those that predict more than regimes
        **dict.fromkeys(_JUDGED, Array(np.float32, tuple(AXES), required=False)),
        "source": Array(np.int64, tuple(AXES), low=0, required=False),
        "predicted_assessment": Array("<U5", tuple(AXES), texts=GRADES, required=False),
    },
    {"metadata": ("design",)},
    error=MapError,
)


def save_refinement(result: Refinement, path: str | Path) -> None:
    """Write as NPZ, atomically.

    Keys: ``bearing_number``, ``rotor_mass``, ``solved``, ``batch``, the solved values by the names
    of ``FIELDS``, ``predicted_mle``, ``predicted_deviation`` and ``probability_unstable``
    (float32), ``predicted_regime``, ``suggested`` (flat indices), ``suggested_for_regime``,
    ``metadata`` as JSON text; where more than regimes are predicted ``predicted_assessment``,
    ``probability_good``, ``probability_avoid``, ``probability_contact`` (float32) and ``source``
    (flat indices)."""
    arrays = {
        "bearing_number": result.bearing_number,
        "rotor_mass": result.rotor_mass,
        "solved": result.solved,
        "batch": result.batch,
        **result.values,
        **{key: getattr(result, name).astype(np.float32) for key, name in _FLOATS.items()},
        "predicted_regime": result.regime,
        "suggested": result.suggested,
        "suggested_for_regime": result.suggested_for_regime,
        "metadata": np.array(json.dumps(result.metadata)),
    }
    if result.judged:
        arrays |= {key: getattr(result, name).astype(np.float32) for key, name in _JUDGED.items()}
        arrays |= {"source": result.source, "predicted_assessment": result.assessment}
    write_atomically(path, npz_bytes(arrays))


def load_refinement(path: str | Path) -> Refinement:
    """Read a file of :func:`save_refinement`; nothing is unpickled.

    Raises ``MapError`` for any other file.
    """
    found = load(path, _SCHEMA)
    number, mass, suggested = found["bearing_number"], found["rotor_mass"], found["suggested"]
    count = check_plane(number, mass)
    if count > MAX_PLANE:
        raise _SCHEMA.refusal(path, f"it has {count:,} cells: allowed are at most {MAX_PLANE:,}")
    if np.any(suggested >= count):
        raise _SCHEMA.refusal(path, f"suggested holds {suggested.max()}: it has {count} cells")
    Design.from_dict(found["metadata"]["design"])
    judged = {name: found[key].astype(float) for key, name in _JUDGED.items() if key in found}
    if "source" in found:
        source = found["source"].ravel()
        if np.any(source >= count) or np.any(found["batch"].ravel()[source] < 0):
            raise _SCHEMA.refusal(path, "source holds cells that are not solved")
        judged["source"] = found["source"]
    found = with_unknown(found, found["batch"].shape)
    return Refinement(
        number,
        mass,
        found["batch"],
        {name: found[name] for name in FIELDS},
        **{name: found[key].astype(float) for key, name in _FLOATS.items()},
        regime=found["predicted_regime"],
        suggested=suggested,
        suggested_for_regime=found["suggested_for_regime"],
        metadata=found["metadata"],
        **judged,
    )
