"""Write files whole or not at all, and tables as CSV; check beforehand that they can be written."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pandas as pd

from spab_core.common.errors import InputError

_T = TypeVar("_T")


def check_output(path: str | os.PathLike[str], name: str) -> None:
    """Raise :class:`InputError` unless ``path`` can become a regular file: a file or nothing yet,
    in a folder that exists.
    """
    target = Path(path)
    if (
        "\0" in str(path)
        or not str(path)
        or not target.parent.is_dir()
        or (target.exists() and not target.is_file())
    ):
        raise InputError(
            f"{name} = {str(path)[:200]!r} cannot be written: give a file name in a folder that "
            "exists"
        )


def write_atomically(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a whole file or nothing: to a temporary file beside it, then renamed over it.

    A link's target is replaced.
    """
    path = Path(path).resolve()
    # not tempfile's name: in a folder closed to us it would try another one for hours on Windows
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)
        patiently(lambda: temporary.replace(path))
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


_WAITS = (0.01, 0.03, 0.1, 0.3, 0.5)  # seconds


def patiently(action: Callable[[], _T]) -> _T:
    """Call ``action``, again within a second where it is denied: Windows denies it while another
    process has the file open.

    Parameters
    ----------
    action : callable
        Without arguments; can be called again after it has failed.

    Raises
    ------
    PermissionError
        The last one.
    """
    for wait in _WAITS:
        try:
            return action()
        except PermissionError as error:
            if error.errno != errno.EACCES:
                raise
            time.sleep(wait)
    return action()


def check_writable(folder: Path, name: str) -> None:
    """Raise ``InputError`` unless files can be made in a folder; to be called before long work.

    ``name``: who needs it.
    """
    if folder.is_dir():
        trial = folder / f".{secrets.token_hex(4)}.tmp"
        try:  # os.access would not know of Windows' access lists
            trial.touch(exist_ok=False)
            trial.unlink()
        except OSError:
            raise InputError(
                f"{name} cannot be written: the folder {folder} is read-only"
            ) from None


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as CSV in UTF-8."""
    text: str = table.to_csv(index=False, lineterminator="\n")
    return text.encode()
