"""NPZ files: the same arrays are written as the same bytes; files from strangers are read safely.

Nothing is unpickled. Sizes are known before memory is taken: a small file that unpacks to
gigabytes, or an array whose header names more cells than the file holds, is refused by what its
headers say."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from typing import IO, Any

import numpy as np

# unpacked, all arrays together: a map or refinement of stability_map.MAX_CELLS has less
MAX_BYTES = 500_000_000
MAX_TEXT_BYTES = 20_000_000  # of one text, four bytes a character
_DIRECTORY_BYTES = 1_000_000  # read in one go; the arrays are read in pieces of 2**18
_KINDS = "biufUS"  # no objects, structures or times
_PACKED = (
    zipfile.ZIP_STORED,
    zipfile.ZIP_DEFLATED,
)  # as numpy packs; of others no part can be unpacked alone

# whatever numpy, zipfile, zlib and json raise for a file that is damaged or no NPZ, and numbers for
# what is no number
UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
    tokenize.TokenError,
    MemoryError,
    SyntaxError,
    TypeError,
    AttributeError,
    IndexError,
    OverflowError,
    struct.error,
)


class _InPieces(io.BufferedReader):
    """A file that refuses to read more than :data:`_DIRECTORY_BYTES` at once: a ZIP archive may
    claim a directory of any length.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _DIRECTORY_BYTES:
            raise ValueError("it has too many parts")
        return super().read(size)


class Npz:
    """The arrays of an open NPZ file by name, read when asked for.

    Every method raises one of :data:`UNREADABLE` for an array that is not there or not what its
    header says."""

    def __init__(self, archive: zipfile.ZipFile):
        self._archive = archive
        self._names = {name.removesuffix(".npy") for name in archive.namelist()}

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def __getitem__(self, name: str) -> np.ndarray:
        """Return an array."""
        self.header(name)
        with self._open(name) as file:
            return np.lib.format.read_array(file, allow_pickle=False)

    def header(self, name: str, most: int = MAX_BYTES) -> tuple[tuple[int, ...], np.dtype]:
        """Return shape and dtype of an array without unpacking it.

        Raises ``ValueError`` too where the array is longer than its file or than ``most`` bytes.
        """
        with self._open(name) as file:
            version = np.lib.format.read_magic(file)
            if version not in ((1, 0), (2, 0)):
                raise ValueError(f"{name[:60]!r} is written in an unknown way")
            read = (
                np.lib.format.read_array_header_1_0
                if version == (1, 0)
                else np.lib.format.read_array_header_2_0
            )
            shape, _, dtype = read(file)
            if dtype.kind not in _KINDS:
                raise ValueError(f"{name[:60]!r} holds neither numbers nor text")
            size = math.prod(map(int, shape)) * max(dtype.itemsize, 1)
            there = self._archive.getinfo(f"{name}.npy").file_size - file.tell()
            if any(length < 0 for length in shape) or size > min(there, most):
                raise ValueError(
                    f"{name[:60]!r} of shape {str(shape)[:60]} is larger than the file, or than "
                    "allowed"
                )
        return shape, dtype

    def json(self, name: str) -> Any:
        """Return the value of a JSON text of at most :data:`MAX_TEXT_BYTES`."""
        self.header(name, MAX_TEXT_BYTES)
        return json.loads(str(self[name]))

    def _open(self, name: str) -> IO[bytes]:
        if name not in self:
            raise ValueError(f"{name[:60]!r} is not in the file")
        return self._archive.open(f"{name}.npy")


@contextlib.contextmanager
def open_npz(source: str | os.PathLike[str] | bytes) -> Iterator[Npz]:
    """Open an NPZ file to read arrays from.

    Parameters
    ----------
    source : path or bytes
        A regular file, or the bytes of one.

    Raises
    ------
    Exception
        One of :data:`UNREADABLE`, as for every array read: for what is no NPZ file, is damaged, or
        would unpack to more than :data:`MAX_BYTES`.
    """
    raw: io.RawIOBase
    if isinstance(source, bytes):
        raw = io.BytesIO(source)  # type: ignore[assignment]
    else:
        # not waiting for the other end of a pipe
        raw = io.FileIO(
            source, opener=lambda path, flags: os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
        )
        if not stat.S_ISREG(os.fstat(raw.fileno()).st_mode):
            raw.close()
            raise ValueError("it is no regular file")
    with _InPieces(raw) as file, zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        if any(member.compress_type not in _PACKED for member in members):
            raise ValueError("it is packed in another way than NPZ files are")
        size = sum(member.file_size for member in members)
        if size > MAX_BYTES:
            raise ValueError(f"it unpacks to {size:,} bytes: allowed are at most {MAX_BYTES:,}")
        yield Npz(archive)


def npz_bytes(arrays: dict[str, Any]) -> bytes:
    """Return arrays as the bytes of a compressed NPZ file; the same arrays give the same bytes."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()
