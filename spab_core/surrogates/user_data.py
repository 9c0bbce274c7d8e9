"""Train and rank surrogates on exponents that were measured or computed elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import LinearTable, table_for
from spab_core.surrogates.metrics import ERRORS
from spab_core.surrogates.models import (
    DIVISORS,
    MODELS,
    Model,
    floored_table,
    train,
    training_mask,
)
from spab_core.surrogates.samples import (
    MAX_BYTES,
    MIN_ROWS,
    Samples,
    load_samples,
    read_samples,
    samples_bytes,
)

__all__ = [
    "MAX_BYTES",
    "MIN_ROWS",
    "SEEDS",
    "Samples",
    "load_samples",
    "rank_samples",
    "read_samples",
    "samples_bytes",
]

SEEDS = (0, 1, 2)


def rank_samples(
    samples: Samples,
    design: Design,
    models: Iterable[Model] = tuple(MODELS.values()),
    divisors: Sequence[int] = DIVISORS,
    seeds: Sequence[int] = SEEDS,
    *,
    floor: float | None = None,
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
    floor : float or None
        As in ``metrics.evaluate``.
    progress : callable
        Called with the number of trainings done since the last call.

    Returns
    -------
    DataFrame
        As ``metrics.evaluate``, for its ``table``, ``ranking`` and ``suggestion``.
    """
    rows = []
    if floor is not None:
        samples = replace(samples, mle=np.maximum(samples.mle, floor))
    count = len(samples.mle)
    (low, high) = samples.inputs.min(axis=0), samples.inputs.max(axis=0)
    kinds = list(models)
    table = (
        floored_table(table_for(design, ((low[0], high[0]), (low[1], high[1]))), floor)
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
