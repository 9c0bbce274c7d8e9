"""Coefficients as a table: CSV for anyone, XLSX as ``ross.BearingElement.from_table`` reads it
(rad/s, N/m, N s/m).

ROSS looks its coefficients up by shaft speed. A whirl that neither grows nor decays feels those at
its own frequency: rows at the frequency of the rotor's least stable whirl at each speed give ROSS
the right limit of stability, synchronous rows the response to unbalance."""

from __future__ import annotations

import io
from datetime import datetime
from pathlib import Path

import pandas as pd

from spab_core.common.errors import InputError
from spab_core.common.files import check_output, write_atomically
from spab_core.linear_theory.coefficients import NAMES, Coefficients

FORMATS = (".csv", ".xlsx")
AXES = ("speed", "frequency")


def coefficient_table(found: Coefficients, axis: str = "speed") -> pd.DataFrame:
    """One row a speed or whirl frequency, in SI units.

    Parameters
    ----------
    found : Coefficients
    axis : str
        ``speed``: the first column is the shaft speed, rad/s. ``frequency``: the whirl frequency,
        rad/s.

    Returns
    -------
    DataFrame
        ``speed`` or ``frequency``, the eight coefficients by the names of ROSS, and
        ``whirl_ratio``, which ROSS passes over.
    """
    if axis not in AXES:
        raise InputError(f"axis = {axis!r} is not one of {', '.join(AXES)}")
    first = found.speed if axis == "speed" else found.whirl_frequency
    return pd.DataFrame(
        {
            axis: first,
            **{name: found.column(name) for name in NAMES},
            "whirl_ratio": found.whirl_ratio,
        }
    )


def table_bytes(table: pd.DataFrame, form: str) -> bytes:
    """Return the table as a file's bytes, the same for the same numbers.

    ``form`` is one of :data:`FORMATS`; XLSX holds 16 significant digits of a number.
    """
    if form == ".csv":
        return table.to_csv(index=False, lineterminator="\n").encode()
    data = io.BytesIO()
    with pd.ExcelWriter(data, engine="xlsxwriter") as writer:
        writer.book.set_properties({"created": datetime(1980, 1, 1)})  # not the time of writing
        table.to_excel(writer, sheet_name="bearing", index=False)
    return data.getvalue()


def check_table_output(path: str) -> None:
    """Raise :class:`InputError` unless ``path`` is a writable file of one of :data:`FORMATS`."""
    check_output(path, "--out")
    if Path(path).suffix.lower() not in FORMATS:
        raise InputError(f"--out = {path[:200]!r} must end in {' or '.join(FORMATS)}")


def save_table(table: pd.DataFrame, path: str) -> None:
    """Write the table atomically, in the format of the file's ending."""
    check_table_output(path)
    write_atomically(path, table_bytes(table, Path(path).suffix.lower()))
