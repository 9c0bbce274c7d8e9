"""The table of linear theory row by row, a bearing number each, for many processes at once.

All eigenvalues of a node are sought, on one thread: Arnoldi iterations about one shift take half
the time and miss the leading one where the shaft bends at many times the speed
(benchmarks/linear_table.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import joblib
import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import COLUMNS, LinearTable, Plane, linear_table

_one_row = one_thread(linear_table)
Run = Callable[[Iterable[Any]], Iterator[Any]]


def _row(
    k: int, design: Design, bearing_number: float, masses: tuple[float, float], nodes: int
) -> tuple[int, list[np.ndarray] | None]:
    try:
        table = _one_row(design, ((bearing_number, bearing_number), masses), (1, nodes))
    except InputError:
        return k, None
    return k, [getattr(table, name)[0] for name in COLUMNS]


def table_by_rows(
    design: Design,
    plane: Plane,
    nodes: tuple[int, int],
    run: Run,
    progress: Callable[[int], None] | None = None,
) -> LinearTable:
    """Tabulate linear stability as :func:`.linear_table.linear_table`, row by row.

    A node without an equilibrium has the values of the nearest in its row, a row without any those
    of the nearest row.

    Parameters
    ----------
    design : Design
    plane : Plane
    nodes : tuple of int
        Bearing numbers and rotor masses.
    run : callable
        Runs joblib's delayed calls, such as a ``joblib.Parallel``; yields results in any order.
    progress : callable
        Called with the number of rows done since the last call.

    Raises
    ------
    InputError
        Where the design has no static equilibrium anywhere in the plane.
    """
    number, mass = np.geomspace(*plane[0], nodes[0]), np.linspace(*plane[1], nodes[1])
    rows: dict[int, list[np.ndarray]] = {}
    calls = (
        joblib.delayed(_row)(k, design, float(b), plane[1], nodes[1]) for k, b in enumerate(number)
    )
    for k, row in run(calls):
        if row is not None:
            rows[k] = row
        if progress:
            progress(1)
    if not rows:
        raise InputError(
            "linear stability: this design has no static equilibrium anywhere in the plane"
        )
    known = np.array(sorted(rows))
    nearest = known[np.abs(known - np.arange(nodes[0])[:, None]).argmin(1)]
    values = np.array([rows[k] for k in nearest.tolist()])
    return LinearTable(design, number, mass, *np.moveaxis(values, 1, 0))
