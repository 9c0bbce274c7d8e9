"""Read a map back from the NetCDF file that ``spab export`` wrote of it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from spab_core.common.npz import MAX_BYTES, npz_bytes
from spab_core.solver.stepping import STATUS
from spab_core.trajectory.assessment import GRADES
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES

# NetCDF 3 has no strings: words are numbers whose meanings are listed
CODES = {"regime": (NO_EXPONENT, *REGIMES), "status": STATUS, "assessment": GRADES}
MARK = b"CDF"


def is_netcdf(path: str | Path) -> bool:
    """Whether a regular file begins as a NetCDF file does."""
    try:
        if not Path(path).is_file():
            return False
        with Path(path).open("rb") as file:
            return file.read(len(MARK)) == MARK
    except (OSError, ValueError):
        return False


def as_npz(path: str | Path) -> bytes:
    """Return the arrays of a NetCDF map as the bytes of an NPZ file.

    Raises ``ValueError``, or what SciPy raises for a damaged file.
    """
    data = Path(path).read_bytes() if Path(path).stat().st_size <= MAX_BYTES else b""
    if not data:
        raise ValueError(f"it is larger than {MAX_BYTES:,} bytes")
    from scipy.io import netcdf_file  # a fifth of a second to load, for such a file alone

    with netcdf_file(io.BytesIO(data), mmap=False) as file:
        if not {"mle", "bearing_number", "rotor_mass"} <= set(file.variables):
            raise ValueError("it is a NetCDF file of no map: give the NPZ file")
        arrays = {str(name): _values(str(name), v) for name, v in file.variables.items()}
        metadata = getattr(file, "metadata", b"")
    arrays["metadata"] = np.array(metadata.decode())
    return npz_bytes(arrays)


def _values(name: str, variable: Any) -> np.ndarray:
    values: np.ndarray = np.array(variable[...])
    if name not in CODES:
        return np.asarray(values, values.dtype.newbyteorder("="))
    told = {word.replace(" ", "_"): word for word in CODES[name]} | {
        NO_EXPONENT.replace(" ", "_"): ""
    }
    words = [told.get(word, word) for word in variable.flag_meanings.decode().split()]
    if not (0 <= values.min(initial=0) and values.max(initial=0) < len(words)):
        raise ValueError(f"{name} has a number without a meaning")
    return np.asarray(np.array(words)[values.astype(int)])
