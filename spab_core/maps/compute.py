"""Solve many operating points, each from a cold start, on the cores of this machine or a Dask
cluster; solved chunks survive a crash.

The result does not depend on the number of workers, their order or their machines.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from spab_core.common.validation import check_whole
from spab_core.common.workers import MAX_WORKERS
from spab_core.design.model import Design
from spab_core.maps.checkpoints import Checkpoint, Chunk, run_plan
from spab_core.maps.parallel import cluster_or_processes
from spab_core.maps.stability_map import (
    FIELDS,
    MapError,
    StabilityMap,
    check_axis,
    check_plane,
    unsolved,
)
from spab_core.solver.cache import solver_hash
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings

CHUNK_CELLS = 25
_COSTS: dict[str, type] = {"seconds": np.float64, "steps": np.int64}  # of each cell
CellSolver = Callable[[np.ndarray], Chunk]


def cell_values(point: OperatingPoint) -> dict[str, Any]:
    """Return the values of a map's cell for a solved point, by the names of ``FIELDS``."""
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
        "orbit_amplitude": point.orbit_amplitude,
        "thin_film_share": point.thin_film_share,
        "peak_contact_force": point.peak_contact_force,
    }


def solve_chunk(
    name: str, design: Design, points: Sequence[tuple[float, float]], settings: Settings
) -> tuple[str, Chunk]:
    """Solve (bearing number, rotor mass) points one after the other; runs in a worker.

    Returns
    -------
    name : str
    values : dict of ndarray, (k,)
        By the names of ``FIELDS``; ``seconds`` and ``steps`` of each point; ``solver``, the hash
        of the worker's solver.
    """
    rows = []
    for bearing_number, rotor_mass in points:
        began = time.perf_counter()
        point = solve_point(design, rotor_mass, bearing_number, settings)
        costs = {"seconds": time.perf_counter() - began, "steps": point.trajectory.steps}
        rows.append(cell_values(point) | costs)
    values = {
        key: np.array([row[key] for row in rows], dtype) for key, dtype in (FIELDS | _COSTS).items()
    }
    return name, values | {"solver": np.array(solver_hash())}


def chunk_solver(
    run: Checkpoint,
    job: Callable[[str, np.ndarray], Any],
    design: Design,
    settings: Settings,
    *,
    chunk_cells: int = CHUNK_CELLS,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> CellSolver:
    """Return a function that solves requested cells of a run in parallel, each once.

    Parameters
    ----------
    run : Checkpoint
        Open; filled and saved chunk by chunk.
    job : callable
        Name and cells (k,) of a chunk -> joblib's delayed call of a function that returns the name
        and the values (k,), with the hash of the worker's solver as ``solver``.
    design : Design
    settings : Settings
        With ``design``, what the solver is compiled for.
    chunk_cells : int
        Cells solved between two checkpoints.
    workers : int
        Processes.
    cluster : str, optional
        Address of a Dask scheduler whose workers solve instead.
    progress : callable
        Called with the number of cells done since the last call. Each call of the solver first
        reports the cells that were already solved, even if that is 0.

    Returns
    -------
    callable
        Cells (k,) -> values (k,) by the names of the run's. Raises :class:`MapError` for workers
        with another solver, :class:`InputError` for a cluster that does not answer.
    """
    names = (name for k in itertools.count() if (name := f"{k:06d}") not in run.states)

    def solve(cells: np.ndarray) -> Chunk:
        missing = run.missing(cells)
        if progress:
            progress(len(cells) - len(missing))
        starts = range(0, len(missing), chunk_cells)
        chunks = {next(names): missing[k : k + chunk_cells] for k in starts}
        if chunks:
            # open for these only: what trains in between must not find the cluster at hand
            with cluster_or_processes(workers, settings, design, cluster) as parallel:
                for name, found in parallel(job(*chunk) for chunk in chunks.items()):
                    if str(found["solver"]) != solver_hash():
                        raise MapError(
                            f"the workers of {cluster or 'this machine'} run another version of "
                            "spab's solver than this process: install the same version there"
                        )
                    run.save(name, chunks[name], found)
                    if progress:
                        progress(len(chunks[name]))
        return {name: array[cells] for name, array in run.values.items()}

    return solve


@contextlib.contextmanager
def cell_solver(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings,
    *,
    checkpoint: str | Path | None = None,
    plan: dict[str, Any] | None = None,
    chunk_cells: int = CHUNK_CELLS,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> Iterator[CellSolver]:
    """Yield a function that solves requested cells of a plane, each once, from a cold start.

    Parameters
    ----------
    design : Design
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    settings : Settings
    checkpoint : str or Path, optional
        Folder of the checkpoint, from which a killed run resumes.
    plan : dict, optional
        More plain values that must agree to resume, such as a seed.
    chunk_cells : int
        Cells solved between two checkpoints.
    workers : int
        Processes; the values do not depend on it.
    cluster : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``: its workers solve instead.
    progress : callable
        Called with the number of cells done since the last call. Each call of the solver first
        reports the cells that were already solved, even if that is 0.

    Yields
    ------
    callable
        Flat indices (k,) -> values (k,) by the names of ``FIELDS``, ``seconds`` and ``steps``.

    Raises
    ------
    MapError
        If ``checkpoint`` holds another run, is in use, or is damaged.
    InputError
        For axes out of range, or a cluster that does not answer or runs another solver.
    """
    count = check_plane(bearing_number, rotor_mass)
    check_whole("workers", workers, 1, MAX_WORKERS)
    checkpoint = None if checkpoint is None else Path(checkpoint)
    settings.check_cold_start()
    points = [(float(b), float(m)) for b in bearing_number for m in rotor_mass]
    values = {name: unsolved(dtype, count) for name, dtype in (FIELDS | _COSTS).items()}
    same = run_plan(design, bearing_number, rotor_mass, settings, **(plan or {}))
    if cluster is not None:
        # an address where nobody answers is told before anything else is done
        with cluster_or_processes(workers, settings, design, cluster):
            pass

    def job(name: str, cells: np.ndarray) -> Any:
        return joblib.delayed(solve_chunk)(name, design, [points[c] for c in cells], settings)

    with Checkpoint(checkpoint, same, values).resume() as run:
        yield chunk_solver(
            run,
            job,
            design,
            settings,
            chunk_cells=chunk_cells,
            workers=workers,
            cluster=cluster,
            progress=progress,
        )


def compute_map(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings | None = None,
    *,
    workers: int = 1,
    cluster: str | None = None,
    checkpoint: str | Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> StabilityMap:
    """Solve every cell of a plane, each from a cold start.

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
        Address of a Dask scheduler, such as ``tcp://host:8786``, whose workers solve instead.
    checkpoint : str or Path, optional
        Folder of the checkpoint, from which a run with the same plan resumes.
    progress : callable
        Called with the number of cells done since the last call.

    Returns
    -------
    StabilityMap

    Raises
    ------
    InputError
        As :func:`cell_solver`.
    """
    settings = settings or Settings(revolutions=300)
    check_axis("bearing number", bearing_number)
    check_axis("rotor mass", rotor_mass)
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    shape = (len(bearing_number), len(rotor_mass))
    with cell_solver(
        design,
        bearing_number,
        rotor_mass,
        settings,
        checkpoint=checkpoint,
        workers=workers,
        cluster=cluster,
        progress=progress,
    ) as solve:
        began = time.perf_counter()
        found = solve(np.arange(shape[0] * shape[1]))
    metadata = map_metadata(design, settings, shape) | {
        "wall_seconds": time.perf_counter() - began,  # of the last session, if the run was resumed
        "worker_seconds": float(found["seconds"].sum()),
        "steps": int(found["steps"].sum()),
        "workers": workers if cluster is None else "dask",
    }
    arrays: dict[str, Any] = {name: found[name].reshape(shape) for name in FIELDS}
    return StabilityMap(bearing_number, rotor_mass, **arrays, metadata=metadata)
