"""Write files atomically and tables as CSV; check beforehand that a file can be written."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from spab_core.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

_T = TypeVar("_T")


def check_output(path: str | os.PathLike[str], name: str, endings: Collection[str] = ()) -> None:
    """Raise :class:`InputError` unless ``path`` is a regular file, or does not exist in a folder
    that does, and has one of the ``endings`` where some are given, such as ".npz". ``name`` is the
    option or field named in the message.
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
    if endings and target.suffix.lower() not in endings:
        raise InputError(f"{name} = {str(path)[:200]!r} must end in {' or '.join(endings)}")


def write_atomically(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file atomically: to a temporary file beside it, which is then renamed.

    Where ``path`` is a link, the file that it points to is replaced.
    """
    path = Path(path).resolve()
    # not by tempfile: in a folder that denies us it would try other names for hours on Windows
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
    """Call ``action``; if it is denied access to a file, try again for a second: Windows denies
    access while another process has the file open.

    Parameters
    ----------
    action : callable
        Without arguments; can be called again after it has failed.

    Raises
    ------
    PermissionError
        If access is still denied after a second.
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
    """Raise ``InputError`` unless files can be created in a folder; call it before long work.

    ``name`` is the file named in the message.
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


def with_units(table: pd.DataFrame, words: str) -> pd.DataFrame:
    """Return a table with what its columns are measured in: in the first row of a last column
    ``units``, so that programs find the names in the first line and the numbers under them.
    """
    return table.assign(units=[words] + [""] * (len(table) - 1) if len(table) else [])


def csv_bytes(table: pd.DataFrame, semicolons: bool = False) -> bytes:
    """Return a table as CSV; the bytes are the same on every system.

    ``semicolons``: separated by semicolons, with decimal commas and a byte order mark, as Excel
    reads it where a comma is the decimal sign; otherwise commas, decimal points, plain UTF-8.
    """
    style = {"sep": ";", "decimal": ","} if semicolons else {}
    text: str = table.to_csv(index=False, lineterminator="\n", **style)
    return text.encode("utf-8-sig" if semicolons else "utf-8")
