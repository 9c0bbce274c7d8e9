"""Chunks of a long run on disk: open, lock, load, resume."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import filelock
import numpy as np

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.files import patiently, write_atomically
from spab_core.design.model import Design
from spab_core.maps.stability_map import MapError
from spab_core.solver.cache import solver_hash
from spab_core.trajectory.settings import Settings

CHUNK_CELLS = 25


def _plan(design, bearing_number, rotor_mass, settings):
    """What a run computes, as a dictionary that must be the same to resume it."""
    return {
        "solver": solver_hash(),
        "design": design.to_dict(),
        "settings": settings.to_dict(),
        "chunk_cells": CHUNK_CELLS,
        "bearing_number": hashlib.sha256(bearing_number.tobytes()).hexdigest(),
        "rotor_mass": hashlib.sha256(rotor_mass.tobytes()).hexdigest(),
    }


def open_run(
    folder: Path,
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings,
    **more,
) -> str:
    """Start a run in ``folder`` or go on with the one that is there; ``more``: what else must be
    the same to resume it.

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
            raise MapError(
                f"{folder} holds the parts of another run (different: {', '.join(different)}); "
                "finish that run "
                "with its own settings, or delete the folder"
            )
    else:
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text.encode())
    return hashlib.sha256(text.encode()).hexdigest()


@contextlib.contextmanager
def locked(folder: Path | None) -> Iterator[None]:
    """Keep a second run away from the same parts, on this machine or on another one that shares the
    folder.
    """
    if folder is None:
        yield
        return
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


def remove_temporaries(folder: Path, name: str) -> None:
    """Delete what killed writers of files ``name`` (a pattern) left there.

    For who holds the lock that they write under.
    """
    for path in folder.glob(f".{name}.tmp"):
        patiently(partial(path.unlink, missing_ok=True))


def read_part(
    path: Path, arrays: Mapping[str, Array], run_hash: str, count: int | None = None
) -> dict[str, np.ndarray]:
    """Return the arrays of a finished chunk; their dimension "point" has the length ``count``.

    Raises
    ------
    MapError
        For a file that is damaged or belongs to another run.
    """
    schema = Schema(
        "finished chunk",
        {**arrays, "run": Array("<U64")},
        error=MapError,
        advice="; delete it to compute that chunk again",
    )
    found = load(path, schema, None if count is None else {"point": count})
    if str(found.pop("run")) != run_hash:
        raise schema.refusal(path, "it belongs to another run")
    return found


def remove_parts(parts: Path) -> None:
    """Delete the chunks of a finished run."""
    for chunk in sorted(parts.glob("chunk-*.npz")):  # before the plan that they belong to
        patiently(partial(chunk.unlink, missing_ok=True))
    shutil.rmtree(parts, ignore_errors=True)
