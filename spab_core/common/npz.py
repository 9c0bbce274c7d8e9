"""Write NPZ files, the same arrays as the same bytes; read NPZ files of any origin safely.

Nothing is unpickled. Sizes are taken from the headers before memory is allocated: a small file that
unpacks to gigabytes, or an array whose header claims more elements than the file holds, is refused.
"""

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
_KINDS = "biufUS"  # neither objects, structures nor times
_PACKED = (
    zipfile.ZIP_STORED,
    zipfile.ZIP_DEFLATED,
)  # as numpy packs; of others no part can be unpacked alone

# what numpy, zipfile, zlib, json and conversions to numbers raise for a file that is damaged or no
# NPZ
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
    """A file that refuses to read more than :data:`_DIRECTORY_BYTES` at once, since a ZIP archive
    may claim a directory of any length.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _DIRECTORY_BYTES:
            raise ValueError("it has too many parts")
        return super().read(size)


class Npz:
    """An open NPZ file; its arrays are read by name, on demand.

    Every method raises one of :data:`UNREADABLE` for an array that is missing or differs from its
    header.
    """

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

        Raises ``ValueError`` if the array is larger than its file or than ``most`` bytes.
        """
        with self._open(name) as file:
            version = np.lib.format.read_magic(file)
            if version not in ((1, 0), (2, 0)):
                raise ValueError(f"{name[:60]!r} has an unknown kind of header")
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
        One of :data:`UNREADABLE`, here or when an array is read, for a file that is damaged, is no
        NPZ file, or would unpack to more than :data:`MAX_BYTES`.
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
            raise ValueError("it is not a regular file")
    with _InPieces(raw) as file, zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        if any(member.compress_type not in _PACKED for member in members):
            raise ValueError("it is compressed in another way than NPZ files")
        size = sum(member.file_size for member in members)
        if size > MAX_BYTES:
            raise ValueError(f"it unpacks to {size:,} bytes: allowed are at most {MAX_BYTES:,}")
        yield Npz(archive)


def npz_bytes(arrays: dict[str, Any]) -> bytes:
    """Return arrays as a compressed NPZ file; the same arrays give the same bytes."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()
