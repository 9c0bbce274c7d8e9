"""Array files with a declared schema: what an NPZ file must hold, checked in one place.

A :class:`Schema` lists the arrays of a kind of file; :func:`load` returns them checked, or raises
one sentence that names file, array, value and what is allowed."""

from __future__ import annotations

import contextlib
import os
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.npz import UNREADABLE, Npz, open_npz

_KIND_NAMES = {
    "b": "true or false",
    "i": "whole numbers",
    "u": "whole numbers without a sign",
    "f": "floating-point numbers",
    "U": "text",
    "S": "bytes",
}


@dataclass(frozen=True)
class Array:
    """What one array of a file must be.

    Attributes
    ----------
    dtype : dtype
        The array is returned with this dtype; in the file it must have the same kind.
    shape : tuple of str or int
        Length of each dimension: a number, or the name of a dimension, whose length is the same
        in every array of the file.
    low, high : float
        Range of the numbers, both ends included; nan is inside.
    finite : bool
        Whether nan and infinity are refused.
    rising : bool
        Whether the numbers must be finite, at least one, and each larger than the one before.
    texts : tuple of str, optional
        The texts that are allowed; left out: any that fit ``dtype``.
    required : bool
        Whether the file must hold it.
    """

    dtype: Any
    shape: tuple[str | int, ...] = ()
    low: float = -np.inf
    high: float = np.inf
    finite: bool = False
    rising: bool = False
    texts: tuple[str, ...] | None = None
    required: bool = True

    def along(self, *shape: str | int, **changes: Any) -> Array:
        """Return a copy with another shape and ``changes`` to the attributes."""
        return replace(self, shape=shape, **changes)


@dataclass(frozen=True)
class Schema:
    """What a kind of NPZ file must hold.

    Attributes
    ----------
    what : str
        What to call such a file in a sentence.
    arrays : mapping of str to Array
    json : mapping of str to tuple of str
        Arrays that are a JSON object as text, with the keys that each must have.
    error : type
        Of :class:`InputError`, raised for any other file.
    advice : str
        What to do about a file that is refused; ends the sentence.
    """

    what: str
    arrays: Mapping[str, Array] = field(default_factory=dict)
    json: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    error: type[InputError] = InputError
    advice: str = ""

    def refusal(self, source: str | os.PathLike[str] | bytes, why: object) -> InputError:
        """Return the error to raise for a file that does not fit the schema."""
        name = "" if isinstance(source, bytes) else f" {str(source)!r}"
        reason = " ".join(str(why).split())[:300]
        if isinstance(why, zipfile.BadZipFile):
            reason = _what_it_is(source) or reason
        elif isinstance(why, OSError) and why.strerror:
            reason = why.strerror
        return self.error(f"cannot read the {self.what}{name}: {reason}{self.advice}")

    @contextlib.contextmanager
    def reading(self, source: str | os.PathLike[str] | bytes) -> Iterator[None]:
        """Re-raise errors in the block, which reads a file's content, as :meth:`refusal`; let an
        :class:`InputError` pass.
        """
        try:
            yield
        except InputError:
            raise
        except UNREADABLE as error:
            raise self.refusal(source, error) from None


_KINDS = (  # first bytes
    (b"CDF", "it is a NetCDF file, of which maps alone are read: give the NPZ file"),
    (b"\x89HDF", "it is an HDF5 file: give the NPZ file"),
    (b"MATLAB 5.0", "it is a MATLAB file: give the NPZ file"),
    (b"PK", "it is a damaged NPZ file"),
)


def _what_it_is(source: str | os.PathLike[str] | bytes) -> str:
    """Return a clause that names a file which is no NPZ; "" where it is not known."""
    try:
        head = source[:4096] if isinstance(source, bytes) else _head(source)
    except (OSError, ValueError):
        return ""
    for mark, words in _KINDS:
        if head.startswith(mark):
            return words
    if not head:
        return "it is empty"
    first = head.split(b"\n")[0]
    if b"\0" not in head and any(first.count(sign) > 1 for sign in (b",", b";", b"\t")):
        return "it is a table (CSV), not an NPZ file: give the file it was exported from"
    return "it is a text, not an NPZ file" if b"\0" not in head else ""


def _head(path: str | os.PathLike[str]) -> bytes:
    with Path(path).open("rb") as file:
        return file.read(4096)


def load(
    source: str | os.PathLike[str] | bytes, schema: Schema, sizes: Mapping[str, int] | None = None
) -> dict[str, Any]:
    """Return the arrays and JSON objects of an NPZ file by name, checked; nothing is unpickled.

    Kind and shape are checked before an array is unpacked.

    Parameters
    ----------
    source : path or bytes
        A regular file, or the bytes of one.
    schema : Schema
    sizes : mapping of str to int
        Lengths of named dimensions that are known beforehand.

    Raises
    ------
    InputError
        ``schema.error``, for a file that is damaged or holds anything else.
    """
    with schema.reading(source), open_npz(source) as file:
        wanted = [name for name, array in schema.arrays.items() if array.required]
        missing = [name for name in [*wanted, *schema.json] if name not in file]
        if missing:
            raise ValueError(f"it lacks {', '.join(missing)}")
        known = dict(sizes or {})
        found: dict[str, Any] = {
            name: _checked(name, array, file, known)
            for name, array in schema.arrays.items()
            if name in file
        }
        for name, keys in schema.json.items():
            found[name] = content = file.json(name)
            if not isinstance(content, dict):
                raise ValueError(f"{name} is no JSON object")
            if missing := [key for key in keys if key not in content]:
                raise ValueError(f"its {name} lacks {', '.join(missing)}")
    return found


def _checked(name: str, array: Array, file: Npz, sizes: dict[str, int]) -> np.ndarray:
    """Return an array cast to its dtype; raise ``ValueError`` if kind, shape or values differ."""
    shape, dtype = file.header(name)
    wanted = np.dtype(array.dtype)
    if dtype.kind != wanted.kind:
        raise ValueError(
            f"{name} holds {_KIND_NAMES[dtype.kind]}: allowed is {_KIND_NAMES[wanted.kind]}"
        )
    if len(shape) == len(array.shape):
        for dimension, length in zip(array.shape, shape, strict=True):
            if isinstance(dimension, str):
                sizes.setdefault(dimension, length)
    if shape != tuple(sizes.get(d, d) if isinstance(d, str) else d for d in array.shape):
        allowed = [f"{d} ({sizes[d]})" if d in sizes else str(d) for d in array.shape]
        raise ValueError(f"{name} has the shape {_times(shape)}: allowed is {_times(allowed)}")
    values = file[name]
    _check_values(name, array, values)
    with np.errstate(over="ignore"):
        found = values.astype(wanted, copy=False)
    if wanted.kind != "f":  # a cast that cuts or wraps
        told = f"{wanted.itemsize // 4} characters" if wanted.kind == "U" else wanted.name
        _refuse(name, values, found != values, f"what fits {told}")
    return found


def _times(lengths: Any) -> str:
    return " x ".join(map(str, lengths))[:100] or "() of a single value"


def _check_values(name: str, array: Array, values: np.ndarray) -> None:
    if array.rising and not values.size:
        raise ValueError(f"{name} is empty: allowed is at least one number")
    if array.finite or array.rising:
        _refuse(name, values, ~np.isfinite(values), "a finite number")
    if array.rising:
        falls = np.concatenate([[False], np.diff(values) <= 0.0])
        _refuse(name, values, falls, "numbers that rise")
    if array.low > -np.inf or array.high < np.inf:
        outside = (values < array.low) | (values > array.high)
        allowed = f"from {array.low:g} to {array.high:g}"
        _refuse(
            name, values, outside, f"{array.low:g} or more" if array.high == np.inf else allowed
        )
    if array.texts is not None:
        allowed = ", ".join(text or "nothing" for text in array.texts)
        _refuse(name, values, ~np.isin(values, array.texts), allowed)


def _refuse(name: str, values: np.ndarray, wrong: np.ndarray, allowed: str) -> None:
    """Raise ``ValueError`` with the first wrong value and its index, if any is wrong."""
    if np.any(wrong):
        at = tuple(int(k) for k in np.argwhere(wrong)[0])
        place = f" at {list(at)}" if at else ""
        value = values[at].item()
        told = repr(value[:40]) if isinstance(value, (str, bytes)) else f"{value:g}"
        raise ValueError(f"{name} holds {told}{place}: allowed is {allowed}")
