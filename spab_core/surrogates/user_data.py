"""Read exponents that were measured or computed elsewhere from CSV; train and rank surrogates on
them.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.npz import npz_bytes
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import LinearTable, table_for
from spab_core.surrogates.metrics import ERRORS
from spab_core.surrogates.models import DIVISORS, MODELS, Model, train, training_mask

MAX_BYTES = 20_000_000
MAX_ROWS = 200_000
MIN_ROWS = 64  # a quarter of them still trains every model
LARGEST = 1e3  # per revolution: beyond it, a column is not an exponent
SEEDS = (0, 1, 2)
COLUMNS = {  # as this dashboard writes them, and what else people call them
    "bearing_number": ("bearing_number", "bearing number", "lambda", "λ", "Λ"),
    "rotor_mass": (
        "rotor_mass_kg",
        "rotor_mass",
        "rotor mass",
        "rotor mass, kg",
        "m_r",
        "mass",
        "mass_kg",
    ),
    "mle": ("mle", "mle_per_revolution", "lyapunov", "exponent"),
}
_RANGES = {
    "bearing_number": (*BEARING_NUMBER_RANGE, ""),
    "rotor_mass": (*ROTOR_MASS_RANGE, " kg"),
    "mle": (-LARGEST, LARGEST, " per revolution"),
}
_SCHEMA = Schema(
    "samples",
    {
        "inputs": Array(np.float64, ("sample", 2), finite=True),
        "mle": Array(np.float64, ("sample",), -LARGEST, LARGEST, finite=True),
        "left_out": Array(np.int64, low=0),
    },
)


@dataclass(frozen=True)
class Samples:
    """Exponents at points of the plane, on a grid or not.

    Attributes
    ----------
    inputs : ndarray, (n, 2)
        Bearing number and rotor mass in kg.
    mle : ndarray, (n,)
        Per revolution, finite.
    left_out : int
        Rows of the file without an exponent.
    """

    inputs: np.ndarray
    mle: np.ndarray
    left_out: int = 0


def read_samples(data: bytes) -> Samples:
    """Read a CSV file with the columns bearing number, rotor mass in kg and exponent per
    revolution, in any order.

    Parameters
    ----------
    data : bytes
        UTF-8 text, a line of names first; names as in :data:`COLUMNS`, in upper or lower case.
        Other columns are ignored, rows with an empty exponent are left out.

    Returns
    -------
    Samples

    Raises
    ------
    InputError
        For a file that is too large, is no such table, or holds a value out of range; the message
        names column and line.
    """
    if len(data) > MAX_BYTES:
        raise InputError(f"the file has {len(data):,} bytes: allowed are at most {MAX_BYTES:,}")
    try:
        table = pd.read_csv(
            io.BytesIO(data),
            dtype=str,
            encoding="utf-8-sig",
            nrows=MAX_ROWS + 1,
            skipinitialspace=True,
        )
    except (ValueError, UnicodeError, pd.errors.ParserError, MemoryError) as error:
        raise InputError(f"not a CSV table: {' '.join(str(error).split())[:200]}") from None
    if not isinstance(table.index, pd.RangeIndex):
        raise InputError("not a CSV table: its rows are longer than the line of names")
    if len(table) > MAX_ROWS:
        raise InputError(f"the table has more than {MAX_ROWS:,} rows, which is the most allowed")
    known = {str(name).strip().lower(): name for name in table.columns}
    columns = {}
    for name, others in COLUMNS.items():
        found = [known[o.lower()] for o in others if o.lower() in known]
        if not found:
            seen = ", ".join(str(c)[:30] for c in table.columns[:8])
            raise InputError(
                f"the table has no column {name!r} (or {', '.join(others[1:])}); its columns are "
                f"{seen}"
            )
        columns[name] = _numbers(table[found[0]], name, empty_allowed=name == "mle")
    mle = columns["mle"]
    kept = np.isfinite(mle)
    if kept.sum() < MIN_ROWS:
        raise InputError(
            f"the table has {int(kept.sum())} rows with an exponent: at least {MIN_ROWS} are needed"
        )
    inputs = np.column_stack([columns["bearing_number"], columns["rotor_mass"]])[kept]
    _, first = np.unique(inputs, axis=0, return_index=True)
    if len(first) < len(inputs):
        row = int(np.setdiff1d(np.arange(len(inputs)), first)[0])
        raise InputError(
            f"the point bearing number {inputs[row, 0]:g}, rotor mass {inputs[row, 1]:g} kg stands "
            "twice in the table"
        )
    if not np.ptp(inputs, axis=0).all():
        raise InputError(
            "all points have one bearing number or one rotor mass: surrogates need a plane"
        )
    return Samples(inputs, mle[kept], int((~kept).sum()))


def samples_bytes(samples: Samples) -> bytes:
    """Return samples as the bytes of an NPZ file."""
    return npz_bytes(
        {"inputs": samples.inputs, "mle": samples.mle, "left_out": np.array(samples.left_out)}
    )


def load_samples(path: Path) -> Samples:
    """Read a file of :func:`samples_bytes`.

    Raises ``InputError`` for any other file.
    """
    found = load(path, _SCHEMA)
    return Samples(found["inputs"], found["mle"], int(found["left_out"]))


def _numbers(column: pd.Series, name: str, empty_allowed: bool) -> np.ndarray:
    values: np.ndarray = pd.to_numeric(column, errors="coerce").to_numpy(float)
    empty = column.isna().to_numpy()
    low, high, unit = _RANGES[name]
    wrong = ~((low <= values) & (values <= high)) & ~(empty & empty_allowed)
    if wrong.any():
        row = int(wrong.argmax())
        said = "nothing" if empty[row] else repr(str(column.iloc[row])[:40])
        raise InputError(
            f"{name} in line {row + 2} is {said}: allowed is a number from {low:g} to "
            f"{high:g}{unit}"
        )
    return values


def rank_samples(
    samples: Samples,
    design: Design,
    models: Iterable[Model] = tuple(MODELS.values()),
    divisors: Sequence[int] = DIVISORS,
    seeds: Sequence[int] = SEEDS,
    *,
    progress: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """Score each combination of model, training fraction and seed on the samples, by the paper's
    protocol.

    Parameters
    ----------
    samples : Samples
    design : Design
        Its linear theory is the start of models that use it.
    models, divisors, seeds
        As in ``metrics.evaluate``; fractions that leave too few points to train on are left out.
    progress : callable
        Called with the number of trainings done since the last call.

    Returns
    -------
    DataFrame
        As ``metrics.evaluate``, for its ``table``, ``ranking`` and ``suggestion``.
    """
    rows = []
    count = len(samples.mle)
    (low, high) = samples.inputs.min(axis=0), samples.inputs.max(axis=0)
    kinds = list(models)
    table = (
        table_for(design, ((low[0], high[0]), (low[1], high[1])))
        if any(kind.theory for kind in kinds)
        else None
    )
    for kind in kinds:
        for divisor in divisors:
            for seed in seeds:
                if count // divisor >= MIN_ROWS // 8:
                    rows.append(_row(samples, kind, divisor, seed, table))
                if progress:
                    progress(1)
    return pd.DataFrame(rows)


def _row(
    samples: Samples, kind: Model, divisor: int, seed: int, table: LinearTable | None
) -> dict[str, Any]:
    chosen = training_mask(len(samples.mle), divisor, seed)
    surrogate = train(kind, samples.inputs[chosen], samples.mle[chosen], seed, table)
    began = time.perf_counter()
    predicted = surrogate.predict(*samples.inputs.T)
    seconds = time.perf_counter() - began
    found = {
        f"{name}_{where}": function(samples.mle[mask], predicted[mask])
        for name, function in ERRORS.items()
        for where, mask in (("all", np.ones_like(chosen)), ("held_out", ~chosen))
    }
    return {
        "model": kind.name,
        "divisor": divisor,
        "seed": seed,
        **found,
        "train_seconds": surrogate.seconds,
        "predict_seconds": seconds,
        "converged": surrogate.converged,
    }
