"""Folders that only this user can enter, outside the repository: find them, make them, read files
in them.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from spab_core.common.errors import InputError
from spab_core.common.files import patiently

_FLAGS = os.O_RDONLY
for _name in (
    "O_NOFOLLOW",
    "O_NONBLOCK",
    "O_BINARY",
):  # no link, no waiting for a pipe; not every system has all
    _FLAGS |= getattr(os, _name, 0)


def wanted_folder(
    variable: str,
    base_variable: str,
    base: str,
    name: str,
    what: str,
    error: type[InputError] = InputError,
) -> Path:
    """$``variable``, else $``base_variable``/``name`` or, on Windows, %LOCALAPPDATA%/``name``, else
    ~/``base``/``name``.

    It may not exist.

    Raises
    ------
    error
        Without a home; ``what`` is named there as what cannot be kept.
    """
    if os.environ.get(variable):
        return Path(os.environ[variable]).absolute()
    for given in (os.environ.get(base_variable, ""), os.environ.get("LOCALAPPDATA", "")):
        if Path(given).is_absolute():  # the XDG specification: a relative one is ignored
            return Path(given) / name
    try:
        return Path.home() / base / name
    except RuntimeError:
        raise error(
            f"there is no home folder to keep {what} in: set {variable} to a folder of yours"
        ) from None


def private_folder(
    path: Path, variable: str, what: str, error: type[InputError] = InputError
) -> Path:
    """Return the folder, made with mode 0700 where it is missing.

    Raises
    ------
    error
        Where it cannot be made or written, is no folder, belongs to someone else, or others can
        enter it.
    """
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
        found = path.lstat()
        writable = os.access(path, os.W_OK | os.X_OK)
    except (OSError, ValueError) as problem:
        raise error(
            f"{what} cannot be kept in {path} ({getattr(problem, 'strerror', None) or problem}): "
            f"set {variable} to "
            "a folder of yours"
        ) from None
    if not stat.S_ISDIR(found.st_mode) or not writable:
        raise error(
            f"{what} cannot be kept in {path}: it is no folder that can be written; set "
            f"{variable} to one"
        )
    if not _private(found):
        raise error(
            f"{what} are not kept in {path}: it must be yours alone (chmod 700); or set "
            f"{variable} to a folder "
            "that is"
        )
    return path


def _private(found: os.stat_result) -> bool:
    if not hasattr(os, "getuid"):
        # Windows: a profile's folders are the user's by their access lists; those of others are not
        # looked at
        return True
    return found.st_uid == os.getuid() and not found.st_mode & 0o077


def own_bytes(path: Path, limit: int) -> bytes:
    """Return the bytes of a regular file of this user. Raises ``OSError``, for a link too."""
    if path.is_symlink():  # where there is no O_NOFOLLOW
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    with os.fdopen(patiently(lambda: os.open(path, _FLAGS)), "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or (
            hasattr(os, "getuid") and found.st_uid != os.getuid()
        ):
            raise PermissionError(0, "it is no regular file of yours")
        if found.st_size > limit:
            raise OSError(0, f"it has more than {limit} bytes")
        return file.read()
