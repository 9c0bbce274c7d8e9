"""Computes stability maps in chunks that survive a crash, on the cores of this machine or of a Dask cluster.

Every cell is a cold start of its own, so the result does not depend on the number of workers, their order or their machine.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import filelock
import joblib
import numpy as np
import psutil

from spab_core._kernel_cache import solver_hash
from spab_core.compiling import compile_once
from spab_core.design import Design, InputError, patiently, write_atomically
from spab_core.npz import UNREADABLE, npz_bytes, open_npz
from spab_core.point import OperatingPoint, solve_point
from spab_core.simulate import Settings
from spab_core.stability_map import FIELDS, MapError, StabilityMap, check_plane, map_metadata

CHUNK_CELLS = 25
CLUSTER_SECONDS = 20  # for a scheduler to answer and for its first worker


def cell_values(point: OperatingPoint) -> dict:
    """A solved point as the values of a map's cell: one for each name in ``FIELDS``."""
    mle, regime, trajectory = point.mle, point.regime, point.trajectory
    return {"mle": mle.value if mle else np.nan, "mle_standard_error": mle.standard_error if mle else np.nan,
            "regime": regime.name if regime else "", "period": regime.period if regime else 0,
            "contact_share": point.contact_share, "max_eccentricity": point.max_eccentricity,
            "status": trajectory.status, "revolutions": trajectory.completed}


def solve_chunk(number: int, design: Design, cells: list[tuple[float, float]],
                 settings: Settings) -> tuple[int, dict[str, np.ndarray]]:
    """Solve (bearing number, rotor mass) cells one after the other; runs in a worker."""
    began = time.perf_counter()
    points = [solve_point(design, rotor_mass, bearing_number, settings) for bearing_number, rotor_mass in cells]
    rows = [cell_values(point) for point in points]
    result = {name: np.array([row[name] for row in rows], dtype) for name, dtype in FIELDS.items()}
    steps = sum(point.trajectory.steps for point in points)
    return number, result | {"seconds": np.array(time.perf_counter() - began), "steps": np.array(steps),
                             "solver": np.array(solver_hash())}


def _plan(design, bearing_number, rotor_mass, settings):
    """What a run computes, as a dictionary that must be the same to resume it."""
    return {
        "solver": solver_hash(), "design": design.to_dict(), "settings": settings.to_dict(), "chunk_cells": CHUNK_CELLS,
        "bearing_number": hashlib.sha256(bearing_number.tobytes()).hexdigest(),
        "rotor_mass": hashlib.sha256(rotor_mass.tobytes()).hexdigest(),
    }


def open_run(folder: Path, design: Design, bearing_number: np.ndarray, rotor_mass: np.ndarray, settings: Settings,
             **more) -> str:
    """Start a run in ``folder`` or go on with the one that is there; ``more``: what else must be the same to resume it.

    Returns
    -------
    str
        Hash of what the run computes; every chunk carries it.

    Raises
    ------
    MapError
        Where the folder holds another run.
    """
    plan = _plan(design, bearing_number, rotor_mass, settings) | more
    path = folder / "plan.json"
    text = json.dumps(plan, indent=1)
    if path.exists():
        try:
            old = json.loads(path.read_text("utf-8"))
        except (OSError, ValueError, RecursionError):
            old = None
        old = old if isinstance(old, dict) else {}
        different = sorted(k for k in plan.keys() | old.keys() if plan.get(k) != old.get(k))
        if different:
            raise MapError(f"{folder} holds the parts of another run (different: {', '.join(different)}); finish that run "
                           "with its own settings, or delete the folder")
    else:
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text.encode())
    return hashlib.sha256(text.encode()).hexdigest()


@contextlib.contextmanager
def locked(folder: Path | None) -> Iterator[None]:
    """Keep a second run away from the same parts, on this machine or on another one that shares the folder."""
    if folder is None:
        yield
        return
    lock = filelock.FileLock(folder / "lock", timeout=0)
    try:
        lock.acquire()
    except filelock.Timeout:
        raise MapError(f"another run is at work on {folder}: wait for it, or give another --out") from None
    try:
        remove_temporaries(folder, "chunk-*")
        yield
    finally:
        lock.release()


def remove_temporaries(folder: Path, name: str) -> None:
    """Delete what killed writers of files ``name`` (a pattern) left there. For who holds the lock that they write under."""
    for path in folder.glob(f".{name}.tmp"):
        patiently(partial(path.unlink, missing_ok=True))


def end_with_parent(parent: int) -> None:
    """First thing in a worker process: see to it that it ends with the one that started it, which may be killed."""
    def watch() -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            # by number and time of start: Windows tells a dead parent's number for ever, and gives it to others
            process = psutil.Process(parent)
            while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
                time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def cluster_or_processes(workers: int, cluster: str | None = None) -> Iterator[joblib.Parallel]:
    """joblib's worker processes, or those of a Dask cluster."""
    options = {"return_as": "generator_unordered", "pre_dispatch": "2*n_jobs"}
    if cluster is None:
        compile_once()  # before several would at once
        yield joblib.Parallel(n_jobs=workers, initializer=end_with_parent, initargs=(os.getpid(),), **options)
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--dask needs the packages dask and distributed: pip install 'spab-core[dask]'") from None
    with contextlib.ExitStack() as stack:
        try:
            client = stack.enter_context(Client(cluster, timeout=CLUSTER_SECONDS))
            client.wait_for_workers(1, timeout=CLUSTER_SECONDS)
        except (OSError, ValueError, TypeError, TimeoutError) as error:
            raise InputError(f"--dask = {cluster[:200]!r}: no scheduler with workers answers there within {CLUSTER_SECONDS} s "
                             f"({' '.join(str(error).split())[:200]})") from None
        stack.enter_context(joblib.parallel_config(backend="dask", client=client))
        yield joblib.Parallel(n_jobs=-1, **options)


def compute_map(design: Design, bearing_number: np.ndarray, rotor_mass: np.ndarray, settings: Settings | None = None, *,
                workers: int = 1, cluster: str | None = None, parts: Path | None = None,
                progress: Callable[[int], None] | None = None) -> StabilityMap:
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
        Address of a Dask scheduler, such as ``tcp://host:8786``: its workers instead of processes here.
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
        For axes out of range, parts of another run or in use, or a cluster that does not answer or runs another solver.
    """
    settings = settings or Settings(revolutions=300)
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    count = check_plane(bearing_number, rotor_mass)
    cells = [(float(b), float(m)) for b in bearing_number for m in rotor_mass]
    chunks = [cells[k:k + CHUNK_CELLS] for k in range(0, count, CHUNK_CELLS)]
    run_hash = open_run(parts, design, bearing_number, rotor_mass, settings) if parts else ""
    with locked(parts):
        results: dict[int, dict] = {}
        for k in range(len(chunks)):
            path = parts / f"chunk-{k:06d}.npz" if parts else None
            if path and path.exists():
                results[k] = read_part(path, (*FIELDS, "seconds", "steps"), FIELDS, len(chunks[k]), run_hash)
        if progress:
            progress(sum(len(chunks[k]) for k in results))
        missing = [k for k in range(len(chunks)) if k not in results]
        began = time.perf_counter()
        if missing:
            with cluster_or_processes(workers, cluster) as run:
                for k, result in run(joblib.delayed(solve_chunk)(k, design, chunks[k], settings) for k in missing):
                    if str(result.pop("solver")) != solver_hash():
                        raise MapError(f"the workers of {cluster} run another version of spab's solver than this process: "
                                       "install the same version there")
                    results[k] = result
                    if parts:
                        write_atomically(parts / f"chunk-{k:06d}.npz", npz_bytes(result | {"run": np.array(run_hash)}))
                    if progress:
                        progress(len(chunks[k]))

    shape = (len(bearing_number), len(rotor_mass))
    arrays = {name: np.concatenate([results[k][name] for k in range(len(chunks))]).reshape(shape) for name in FIELDS}
    metadata = map_metadata(design, settings, shape) | {
        "wall_seconds": time.perf_counter() - began,  # of the last session, if the run was resumed
        "worker_seconds": float(sum(float(r["seconds"]) for r in results.values())),
        "steps": int(sum(int(r["steps"]) for r in results.values())),
        "workers": workers if cluster is None else "dask",
    }
    return StabilityMap(bearing_number, rotor_mass, **arrays, metadata=metadata)


def read_part(path: Path, names: Iterable[str], per_point: Iterable[str], count: int, run_hash: str) -> dict:
    """The arrays of a finished chunk, with ``count`` entries in those that have one a point.

    Raises
    ------
    MapError
        For a file that is damaged or belongs to another run.
    """
    try:
        with open_npz(path) as data:
            result = {name: data[name] for name in (*names, "run")}
    except UNREADABLE as error:
        raise MapError(f"{path} is damaged ({error}); delete it to compute that chunk again") from None
    if str(result.pop("run")) != run_hash or any(result[name].shape[:1] != (count,) for name in per_point):
        raise MapError(f"{path} belongs to another run; delete it to compute that chunk again")
    return result


def remove_parts(parts: Path) -> None:
    """Delete the chunks of a finished run."""
    for chunk in sorted(parts.glob("chunk-*.npz")):  # before the plan that they belong to
        patiently(partial(chunk.unlink, missing_ok=True))
    shutil.rmtree(parts, ignore_errors=True)
