"""Where models trained on this machine are kept between runs: a folder of this user alone, outside the repository.

A model file is code to whoever unpickles it. Nothing is handed out from here but the bytes of a file that belongs to this
user, in a folder that nobody else can enter, with the checksum in the side file written with it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
from pathlib import Path

from spab_core.artifacts import ArtifactError
from spab_core.design import write_atomically

VARIABLE = "SPAB_CACHE"
MAX_BYTES = 1_000_000_000  # of all models together; the oldest go first
_MAX_SIDE_BYTES = 100_000
_FLAGS = os.O_RDONLY
for _name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"):  # no link, no waiting for a pipe; not every system has all
    _FLAGS |= getattr(os, _name, 0)


class CacheError(ArtifactError):
    """The cache cannot be used, or a file in it is not to be opened; the message says why."""


def wanted_folder() -> Path:
    """$SPAB_CACHE, else $XDG_CACHE_HOME/spab, else ~/.cache/spab; may not exist. Raises :class:`CacheError` without a home."""
    if os.environ.get(VARIABLE):
        return Path(os.environ[VARIABLE]).absolute()
    base = os.environ.get("XDG_CACHE_HOME", "")
    if Path(base).is_absolute():  # its specification: a relative one is ignored
        return Path(base) / "spab"
    try:
        return Path.home() / ".cache" / "spab"
    except RuntimeError:
        raise CacheError(f"there is no home folder to keep models in: set {VARIABLE} to a folder of yours") from None


def cache_folder() -> Path:
    """The folder, made if need be with mode 0700.

    Raises
    ------
    CacheError
        Where it cannot be made or written, is no folder, belongs to someone else, or others can enter it.
    """
    path = wanted_folder()
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
        found = path.lstat()
        writable = os.access(path, os.W_OK | os.X_OK)
    except (OSError, ValueError) as error:
        raise CacheError(f"models cannot be kept in {path} ({getattr(error, 'strerror', None) or error}): set {VARIABLE} to "
                         "a folder of yours") from None
    if not stat.S_ISDIR(found.st_mode) or not writable:
        raise CacheError(f"models cannot be kept in {path}: it is no folder that can be written; set {VARIABLE} to one")
    if not _private(found):
        raise CacheError(f"models are not kept in {path}: it must be yours alone (chmod 700); or set {VARIABLE} to a folder "
                         "that is")
    return path


def _private(found: os.stat_result) -> bool:
    if not hasattr(os, "getuid"):
        return True  # Windows: a profile's folders are the user's by their access lists
    return found.st_uid == os.getuid() and not found.st_mode & 0o077


def read(name: str) -> tuple[bytes, dict] | None:
    """A model's bytes and what it was made from, checked against its side file; None where it is not there.

    Raises
    ------
    CacheError
        For a file that is damaged or not this user's.
    """
    folder = cache_folder()
    try:
        data = _own_bytes(folder / name)
        side = _own_bytes(folder / f"{name}.json", _MAX_SIDE_BYTES)
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
        raise CacheError(f"{folder / name} is not opened: it is not the file that was kept (its SHA-256 differs)")
    with contextlib.suppress(OSError):
        os.utime(folder / name)  # the least recently used goes first
    return data, made_from


def _own_bytes(path: Path, limit: int = MAX_BYTES) -> bytes:
    """The bytes of a regular file of this user; a link is not followed."""
    with os.fdopen(os.open(path, _FLAGS), "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or (hasattr(os, "getuid") and found.st_uid != os.getuid()):
            raise PermissionError(0, "it is no regular file of yours")
        if found.st_size > limit:
            raise OSError(0, f"it has more than {limit} bytes")
        return file.read()


def write(path: Path, data: bytes, made_from: dict) -> None:
    """A model's bytes with their side file, ``path`` with ".json" added. Raises ``OSError``."""
    side = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data), "made_from": made_from}
    write_atomically(path, data)
    write_atomically(path.with_name(f"{path.name}.json"), (json.dumps(side, indent=1) + "\n").encode())


def keep(name: str, data: bytes, made_from: dict) -> Path:
    """Keep a model in the cache, and drop the oldest ones beyond :data:`MAX_BYTES`.

    Raises
    ------
    CacheError
        Where it cannot be kept.
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
                path.unlink(missing_ok=True)
                path.with_name(f"{path.name}.json").unlink(missing_ok=True)
    except OSError as error:
        raise CacheError(f"the model cannot be kept in {folder}: {error.strerror or error}") from None
    return folder / name
