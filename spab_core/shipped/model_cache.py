"""Keep models trained on this machine between runs, in a folder of this user outside the
repository.

Unpickling a model file can run any code. So bytes are returned only from a file of this user, in a
folder that nobody else can enter, and only if they match the checksum in the side file written with
it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from pathlib import Path
from typing import Any

from spab_core.common import private_folders as private_folder
from spab_core.common.files import write_atomically
from spab_core.shipped.manifest import ArtifactError

VARIABLE = "SPAB_CACHE"
MAX_BYTES = 1_000_000_000  # of all models together; the oldest go first
_MAX_SIDE_BYTES = 100_000


class CacheError(ArtifactError):
    """The cache cannot be used, or a file in it must not be opened; the message says why."""


def wanted_folder() -> Path:
    """Return $SPAB_CACHE, else $XDG_CACHE_HOME/spab, else ~/.cache/spab; it may not exist.

    Raises :class:`CacheError` without a home.
    """
    return private_folder.wanted_folder(
        VARIABLE, "XDG_CACHE_HOME", ".cache", "spab", "models", CacheError
    )


def cache_folder() -> Path:
    """Return the folder; create it with mode 0700 if it does not exist.

    Raises :class:`CacheError` as :func:`private_folder.private_folder`.
    """
    return private_folder.private_folder(wanted_folder(), VARIABLE, "models", CacheError)


def read(name: str) -> tuple[bytes, dict[str, Any]] | None:
    """Return a model's bytes, checked against its side file, and what it was made from; None if it
    is missing.

    Raises
    ------
    CacheError
        For a file that is damaged or not this user's.
    """
    folder = cache_folder()
    try:
        data = private_folder.own_bytes(folder / name, MAX_BYTES)
        side = private_folder.own_bytes(folder / f"{name}.json", _MAX_SIDE_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise CacheError(f"{folder / name} is not opened: {error.strerror or error}") from None
    try:
        noted = json.loads(side)
        expected, made_from = noted["sha256"], noted["made_from"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise CacheError(f"{folder / name} is not opened: its side file is damaged") from None
    if hashlib.sha256(data).hexdigest() != expected or not isinstance(made_from, dict):
        raise CacheError(
            f"{folder / name} is not opened: it is not the file that was kept (its SHA-256 differs)"
        )
    with contextlib.suppress(OSError):
        os.utime(folder / name)  # the least recently used goes first
    return data, made_from


def write(path: Path, data: bytes, made_from: dict[str, Any]) -> None:
    """Write a model and its side file (``path`` with ".json" added). Raises ``OSError``."""
    side = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data), "made_from": made_from}
    write_atomically(path, data)
    write_atomically(
        path.with_name(f"{path.name}.json"), (json.dumps(side, indent=1) + "\n").encode()
    )


def keep(name: str, data: bytes, made_from: dict[str, Any]) -> Path:
    """Keep a model in the cache; delete the oldest ones beyond :data:`MAX_BYTES`.

    Raises
    ------
    CacheError
        If it cannot be kept.
    """
    folder = cache_folder()
    try:
        for path in (folder / name, folder / f"{name}.json"):
            if path.is_symlink():
                path.unlink()  # or its target would be written
        write(folder / name, data, made_from)
        files = sorted(folder.glob("*.joblib"), key=lambda p: (p.name != name, -p.stat().st_mtime))
        room = MAX_BYTES
        for path in files:
            room -= path.stat().st_size
            if room < 0 and path.name != name:
                with contextlib.suppress(PermissionError):  # Windows: another process reads it now
                    path.unlink(missing_ok=True)
                    path.with_name(f"{path.name}.json").unlink(missing_ok=True)
    except OSError as error:
        raise CacheError(
            f"the model cannot be kept in {folder}: {error.strerror or error}"
        ) from None
    return folder / name
