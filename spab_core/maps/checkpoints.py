"""Checkpoints of a long run: solved chunks in a folder, from which a stopped run resumes.

The folder holds ``plan.json`` (what the run computes), ``lock``, and a file ``chunk-NAME.npz`` for
each solved chunk of cells.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import filelock
import numpy as np

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.files import patiently, write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.design.model import Design
from spab_core.maps.stability_map import MapError
from spab_core.solver.cache import solver_hash
from spab_core.trajectory.settings import Settings

Chunk = dict[str, np.ndarray]


def run_plan(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings,
    **more: Any,
) -> dict[str, Any]:
    """Return a description of what a run computes, in plain values; ``more`` is added to it."""
    return {
        "solver": solver_hash(),
        "design": design.to_dict(),
        "settings": settings.to_dict(),
        "bearing_number": hashlib.sha256(bearing_number.tobytes()).hexdigest(),
        "rotor_mass": hashlib.sha256(rotor_mass.tobytes()).hexdigest(),
    } | more


class Checkpoint:
    """The solved cells of a run, saved chunk by chunk.

    Parameters
    ----------
    folder : Path or None
        None: save nothing.
    plan : dict
        Of :func:`run_plan`; a run resumes only with the same plan.
    values : dict of ndarray, (n, ...)
        Arrays to fill, by name, one entry a cell.

    Attributes
    ----------
    values : dict of ndarray
    solved : ndarray of bool, (n,)
    states : dict of ndarray
        State of the motion at the end of a chunk, by the chunk's name, for chunks that have one.
    """

    def __init__(
        self, folder: Path | None, plan: dict[str, Any], values: dict[str, np.ndarray]
    ) -> None:
        self.folder, self.values = folder, values
        self.solved = np.zeros(len(next(iter(values.values()), ())), bool)
        self.states: dict[str, np.ndarray] = {}
        self._plan = plan
        self._run = hashlib.sha256(json.dumps(plan, indent=1).encode()).hexdigest()

    def open(self) -> None:
        """Create the folder with the run's plan, or check that an existing folder has the same
        plan.

        Raises
        ------
        MapError
            If the folder holds another run.
        """
        if self.folder is None:
            return
        path = self.folder / "plan.json"
        if not path.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, json.dumps(self._plan, indent=1).encode())
            return
        try:
            old = json.loads(path.read_text("utf-8"))
        except (OSError, ValueError, RecursionError):
            old = None
        old = old if isinstance(old, dict) else {}
        keys = self._plan.keys() | old.keys()
        different = sorted(k for k in keys if self._plan.get(k) != old.get(k))
        if different:
            raise MapError(
                f"{self.folder} holds the chunks of another run (different: "
                f"{', '.join(different)}); finish that run with its own settings, or delete the "
                "folder"
            )

    @contextlib.contextmanager
    def resume(self) -> Iterator[Checkpoint]:
        """Open and lock the folder and load its chunks.

        Raises
        ------
        MapError
            If the folder holds another run or is in use, or a chunk is damaged.
        """
        if self.folder is None:
            yield self
            return
        self.open()
        with locked(self.folder):
            for path in sorted(self.folder.glob("chunk-*.npz")):
                self._fill(path.stem.removeprefix("chunk-"), self.load(path))
            yield self

    def load(self, path: Path) -> Chunk:
        """Return the arrays of a chunk's file.

        Raises
        ------
        MapError
            For a file that is damaged or belongs to another run.
        """
        arrays = {
            "run": Array("<U64"),
            "cells": Array(np.int64, ("cell",), low=0, high=len(self.solved) - 1),
            "state": Array(np.float64, ("state",)),
        } | {
            name: Array(values.dtype, ("cell", *values.shape[1:]))
            for name, values in self.values.items()
        }
        schema = Schema(
            "finished chunk",
            arrays,
            error=MapError,
            advice="; delete it to compute that chunk again",
        )
        chunk = load(path, schema)
        if str(chunk.pop("run")) != self._run:
            raise schema.refusal(path, "it belongs to another run")
        return chunk

    def missing(self, cells: np.ndarray) -> np.ndarray:
        """Return those of ``cells`` (k,) that are not solved."""
        missing: np.ndarray = cells[~self.solved[cells]]
        return missing

    def save(
        self, name: str, cells: np.ndarray, values: Chunk, state: np.ndarray | None = None
    ) -> None:
        """Save a solved chunk.

        Parameters
        ----------
        name : str
        cells : ndarray of int, (k,)
        values : dict of ndarray, (k, ...)
            At least those of :attr:`values`.
        state : ndarray, (s,), optional
            State of the motion that the next chunk starts from; empty if there is none.
        """
        chunk = {key: values[key] for key in self.values}
        chunk |= {"cells": cells, "state": np.empty(0) if state is None else state}
        if self.folder is not None:
            path = self.folder / f"chunk-{name}.npz"
            write_atomically(path, npz_bytes(chunk | {"run": np.array(self._run)}))
        self._fill(name, chunk)

    def _fill(self, name: str, chunk: Chunk) -> None:
        cells = chunk["cells"]
        for key, values in self.values.items():
            values[cells] = chunk[key]
        self.solved[cells] = True
        self.states[name] = chunk["state"]


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a checkpoint's folder, on this machine and on others that share it, and remove temporary
    files of killed writers.

    Raises
    ------
    MapError
        If another run holds the lock.
    """
    lock = filelock.FileLock(folder / "lock", timeout=0)
    try:
        lock.acquire()
    except filelock.Timeout:
        raise MapError(
            f"another run is at work on {folder}: wait for it, or give another --out"
        ) from None
    try:
        remove_temporaries(folder, "chunk-*")
        yield
    finally:
        lock.release()


def remove_temporaries(folder: Path, pattern: str) -> None:
    """Delete temporary files of killed writers in a folder, for files matching ``pattern``.

    The caller must hold the lock under which such files are written.
    """
    for path in folder.glob(f".{pattern}.tmp"):
        patiently(partial(path.unlink, missing_ok=True))


def remove_checkpoint(folder: Path) -> None:
    """Delete the checkpoint of a finished run."""
    for chunk in sorted(folder.glob("chunk-*.npz")):  # before the plan that they belong to
        patiently(partial(chunk.unlink, missing_ok=True))
    shutil.rmtree(folder, ignore_errors=True)
