"""Oracles: give :func:`spab_core.active_learning.refine.refine` the values of the cells it picks,
out of a solved map or by solving them.
"""

from __future__ import annotations

from functools import partial

from spab_core.maps.compute import CellSolver, cell_solver
from spab_core.maps.stability_map import FIELDS, StabilityMap

CHUNK = 5  # cells solved between two checkpoints

live_oracle = partial(cell_solver, chunk_cells=CHUNK)


def map_oracle(m: StabilityMap) -> CellSolver:
    """Return an oracle that takes values from a solved map, for studies of refining."""
    flat = {name: getattr(m, name).ravel() for name in FIELDS}
    return lambda cells: {name: values[cells] for name, values in flat.items()}
