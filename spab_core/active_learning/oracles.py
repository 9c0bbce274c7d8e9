"""Where :func:`spab_core.active_learning.refine.refine` gets the values of the cells it picks: out
of a solved map, or solved live.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import joblib
import numpy as np

from spab_core.common.arrays import Array
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.design.model import Design
from spab_core.maps.checkpoints import locked, open_run, read_part
from spab_core.maps.compute import solve_chunk
from spab_core.maps.parallel import cluster_or_processes
from spab_core.maps.stability_map import CHUNK_ARRAYS, FIELDS, StabilityMap, check_plane
from spab_core.trajectory.settings import Settings

CHUNK = 5  # cells solved between two checkpoints

Oracle = Callable[
    [np.ndarray], dict[str, np.ndarray]
]  # flat indices (k,) -> values (k,) by the names of FIELDS


def unsolved_values(dtype, shape) -> np.ndarray:
    """What stands in an array of one of ``FIELDS`` where a cell is not solved: nan, "" or 0."""
    kind = np.dtype(dtype).kind
    return np.full(shape, np.nan if kind == "f" else "" if kind == "U" else 0, dtype)


def map_oracle(m: StabilityMap) -> Oracle:
    """Takes the cells' values from a solved map: for studies, where the truth is known."""
    flat = {name: getattr(m, name).ravel() for name in FIELDS}
    return lambda cells: {name: values[cells] for name, values in flat.items()}


@contextlib.contextmanager
def live_oracle(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings,
    *,
    parts: Path,
    plan: dict,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Oracle]:
    """Solves cells live, each from its own cold start, and keeps them in ``parts``: a run that was
    killed goes on from them.

    Parameters
    ----------
    design : Design
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
    settings : Settings
    parts : Path
        Folder for solved cells; :func:`spab_core.maps.checkpoints.remove_parts` deletes it.
    plan : dict
        What else must be the same to go on, such as the seed; plain values.
    workers : int
        Processes; the values do not depend on it.
    cluster : str, optional
        Address of a Dask scheduler, whose workers solve instead.
    progress : callable
        Called with the number of cells done since the last call, those found in ``parts`` included.

    Raises
    ------
    MapError
        Where ``parts`` holds another run, is in use, or is damaged.
    InputError
        Where no cluster answers there.
    """
    bearing_number, rotor_mass = np.asarray(bearing_number, float), np.asarray(rotor_mass, float)
    count = check_plane(bearing_number, rotor_mass)
    run_hash = open_run(
        parts,
        design,
        bearing_number,
        rotor_mass,
        settings,
        **{f"refine_{k}": v for k, v in plan.items()},
    )
    number, mass = (
        np.repeat(bearing_number, len(rotor_mass)),
        np.tile(rotor_mass, len(bearing_number)),
    )
    if cluster is not None:
        with cluster_or_processes(
            workers, cluster
        ):  # an address where nobody answers is told before anything is solved
            pass
    with locked(parts):
        stored = {name: unsolved_values(dtype, count) for name, dtype in FIELDS.items()}
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
            chunks = {
                last + 1 + k: missing[at : at + CHUNK]
                for k, at in enumerate(range(0, len(missing), CHUNK))
            }
            if chunks:
                last = max(chunks)
                jobs = (
                    joblib.delayed(solve_chunk)(
                        k, design, [(float(number[c]), float(mass[c])) for c in chunk], settings
                    )
                    for k, chunk in chunks.items()
                )
                # open for a batch only: the committee's trees, too, would train on a cluster that
                # is at hand
                with cluster_or_processes(workers, cluster) as run:
                    for k, result in run(jobs):
                        result = {name: result[name] for name in FIELDS}
                        write_atomically(
                            parts / f"chunk-{k:06d}.npz",
                            npz_bytes(result | {"cells": chunks[k], "run": np.array(run_hash)}),
                        )
                        have[chunks[k]] = True
                        for name in FIELDS:
                            stored[name][chunks[k]] = result[name]
                        if progress:
                            progress(len(chunks[k]))
            return {name: values[cells] for name, values in stored.items()}

        yield solve


def _read_chunk(path: Path, run_hash: str, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    cells = Array(np.int64, ("point",), low=0, high=count - 1)
    found = read_part(path, CHUNK_ARRAYS | {"cells": cells}, run_hash)
    return found.pop("cells"), found
