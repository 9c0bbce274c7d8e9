"""Find, create and read folders outside the repository that only this user can enter."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from spab_core.common.errors import InputError
from spab_core.common.files import patiently

_FLAGS = os.O_RDONLY
for _name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"):  # follow no link, do not wait for a pipe
    _FLAGS |= getattr(os, _name, 0)  # not every system has all


def wanted_folder(
    variable: str,
    base_variable: str,
    base: str,
    name: str,
    what: str,
    error: type[InputError] = InputError,
) -> Path:
    """Return $``variable``, else $``base_variable``/``name`` (Windows: %LOCALAPPDATA%/``name``),
    else ~/``base``/``name``. The folder may not exist.

    Raises
    ------
    error
        If there is no home folder; the message says that ``what`` cannot be kept.
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
    """Return the folder; create it with mode 0700 if it does not exist.

    Raises
    ------
    error
        If it cannot be made or written, is not a folder, belongs to someone else, or can be entered
        by others.
    """
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
        found = path.lstat()
        writable = os.access(path, os.W_OK | os.X_OK)
    except (OSError, ValueError) as problem:
        raise error(
            f"{what} cannot be kept in {path} ({getattr(problem, 'strerror', None) or problem}): "
            f"set {variable} to a folder of yours"
        ) from None
    if not stat.S_ISDIR(found.st_mode) or not writable:
        raise error(
            f"{what} cannot be kept in {path}: it is not a folder that can be written; set "
            f"{variable} to a folder of yours"
        )
    if not _private(found):
        raise error(
            f"{what} are not kept in {path}, which others can enter: make it yours alone "
            f"(chmod 700), or set {variable} to a folder of yours"
        )
    return path


def _private(found: os.stat_result) -> bool:
    if not hasattr(os, "getuid"):
        return True  # Windows: access lists make the folders of a profile the user's
    return found.st_uid == os.getuid() and not found.st_mode & 0o077


def own_bytes(path: Path, limit: int) -> bytes:
    """Read a regular file of this user, at most ``limit`` bytes, following no link.

    Raise ``OSError`` where it is another kind of file, someone else's or larger.
    """
    if path.is_symlink():  # where there is no O_NOFOLLOW
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    with os.fdopen(patiently(lambda: os.open(path, _FLAGS)), "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or (
            hasattr(os, "getuid") and found.st_uid != os.getuid()
        ):
            raise PermissionError(0, "it is not a regular file of yours")
        if found.st_size > limit:
            raise OSError(0, f"it has more than {limit} bytes")
        return file.read()
