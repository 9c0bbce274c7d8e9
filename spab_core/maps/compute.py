"""Computes stability maps in chunks that survive a crash, on the cores of this machine or of a Dask
cluster.

Every cell is a cold start of its own, so the result does not depend on the number of workers, their
order or their machine."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import joblib
import numpy as np

from spab_core.common.arrays import Array
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.design.model import Design
from spab_core.maps.checkpoints import CHUNK_CELLS, locked, open_run, read_part
from spab_core.maps.parallel import cluster_or_processes
from spab_core.maps.stability_map import CHUNK_ARRAYS, FIELDS, MapError, StabilityMap, check_plane
from spab_core.solver.cache import solver_hash
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings

_CHUNK = CHUNK_ARRAYS | {"seconds": Array(np.float64, low=0.0), "steps": Array(np.int64, low=0)}


def cell_values(point: OperatingPoint) -> dict:
    """A solved point as the values of a map's cell: one for each name in ``FIELDS``."""
    mle, regime, trajectory = point.mle, point.regime, point.trajectory
    return {
        "mle": mle.value if mle else np.nan,
        "mle_standard_error": mle.standard_error if mle else np.nan,
        "regime": regime.name if regime else "",
        "period": regime.period if regime else 0,
        "contact_share": point.contact_share,
        "max_eccentricity": point.max_eccentricity,
        "status": trajectory.status,
        "revolutions": trajectory.completed,
    }


def solve_chunk(
    number: int, design: Design, cells: list[tuple[float, float]], settings: Settings
) -> tuple[int, dict[str, np.ndarray]]:
    """Solve (bearing number, rotor mass) cells one after the other; runs in a worker."""
    began = time.perf_counter()
    points = [
        solve_point(design, rotor_mass, bearing_number, settings)
        for bearing_number, rotor_mass in cells
    ]
    rows = [cell_values(point) for point in points]
    result = {name: np.array([row[name] for row in rows], dtype) for name, dtype in FIELDS.items()}
    steps = sum(point.trajectory.steps for point in points)
    return number, result | {
        "seconds": np.array(time.perf_counter() - began),
        "steps": np.array(steps),
        "solver": np.array(solver_hash()),
    }


def compute_map(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings | None = None,
    *,
    workers: int = 1,
    cluster: str | None = None,
    parts: Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> StabilityMap:
    """Solve every cell of a plane from its own cold start.

    Parameters
    ----------
    design : Design
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    settings : Settings
    workers : int
        Processes.
    cluster : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``: its workers instead of processes
        here.
    parts : Path, optional
        Folder for finished chunks. A run that finds its own chunks there goes on from them.
    progress : callable
        Called with the number of cells done since the last call.

    Returns
    -------
    StabilityMap

    Raises
    ------
    InputError
        For axes out of range, parts of another run or in use, or a cluster that does not answer or
        runs another solver.
    """
    settings = settings or Settings(revolutions=300)
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    count = check_plane(bearing_number, rotor_mass)
    cells = [(float(b), float(m)) for b in bearing_number for m in rotor_mass]
    chunks = [cells[k : k + CHUNK_CELLS] for k in range(0, count, CHUNK_CELLS)]
    run_hash = open_run(parts, design, bearing_number, rotor_mass, settings) if parts else ""
    with locked(parts):
        results: dict[int, dict] = {}
        for k in range(len(chunks)):
            path = parts / f"chunk-{k:06d}.npz" if parts else None
            if path and path.exists():
                results[k] = read_part(path, _CHUNK, run_hash, len(chunks[k]))
        if progress:
            progress(sum(len(chunks[k]) for k in results))
        missing = [k for k in range(len(chunks)) if k not in results]
        began = time.perf_counter()
        if missing:
            with cluster_or_processes(workers, cluster) as run:
                for k, result in run(
                    joblib.delayed(solve_chunk)(k, design, chunks[k], settings) for k in missing
                ):
                    if str(result.pop("solver")) != solver_hash():
                        raise MapError(
                            f"the workers of {cluster} run another version of spab's solver than "
                            "this process: "
                            "install the same version there"
                        )
                    results[k] = result
                    if parts:
                        write_atomically(
                            parts / f"chunk-{k:06d}.npz",
                            npz_bytes(result | {"run": np.array(run_hash)}),
                        )
                    if progress:
                        progress(len(chunks[k]))

    shape = (len(bearing_number), len(rotor_mass))
    arrays = {
        name: np.concatenate([results[k][name] for k in range(len(chunks))]).reshape(shape)
        for name in FIELDS
    }
    metadata = map_metadata(design, settings, shape) | {
        "wall_seconds": time.perf_counter() - began,  # of the last session, if the run was resumed
        "worker_seconds": float(sum(float(r["seconds"]) for r in results.values())),
        "steps": int(sum(int(r["steps"]) for r in results.values())),
        "workers": workers if cluster is None else "dask",
    }
    return StabilityMap(bearing_number, rotor_mass, **arrays, metadata=metadata)
