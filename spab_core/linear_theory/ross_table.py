"""Coefficients as a table: CSV for anyone, XLSX as ``ross.BearingElement.from_table`` reads it
(rad/s, N/m, N s/m).

ROSS looks its coefficients up by shaft speed. A whirl that neither grows nor decays feels those at
its own frequency: rows at the frequency of the rotor's least stable whirl at each speed give ROSS
the right limit of stability, synchronous rows the response to unbalance."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from xml.sax.saxutils import escape

import pandas as pd

from spab_core.common.errors import InputError
from spab_core.common.files import check_output, write_atomically
from spab_core.linear_theory.coefficients import NAMES, Coefficients

FORMATS = (".csv", ".xlsx")
AXES = ("speed", "frequency")
_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_SCHEMA = "http://schemas.openxmlformats.org"
_PARTS = {  # the least that makes a workbook of one sheet (ECMA-376)
    "[Content_Types].xml": f'<Types xmlns="{_SCHEMA}/package/2006/content-types">'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Override PartName="/xl/workbook.xml" '
    'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>'
    '<Override PartName="/xl/worksheets/sheet1.xml" '
    'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/></Types>',
    "_rels/.rels": f'<Relationships xmlns="{_SCHEMA}/package/2006/relationships"><Relationship '
    'Id="rId1" '
    f'Type="{_SCHEMA}/officeDocument/2006/relationships/officeDocument" '
    'Target="xl/workbook.xml"/></Relationships>',
    "xl/workbook.xml": f'<workbook xmlns="{_SCHEMA}/spreadsheetml/2006/main" '
    f'xmlns:r="{_SCHEMA}/officeDocument/2006/relationships"><sheets><sheet name="bearing" '
    'sheetId="1" r:id="rId1"/></sheets>'
    "</workbook>",
    "xl/_rels/workbook.xml.rels": "<Relationships "
    f'xmlns="{_SCHEMA}/package/2006/relationships"><Relationship '
    'Id="rId1" '
    f'Type="{_SCHEMA}/officeDocument/2006/relationships/worksheet" '
    'Target="worksheets/sheet1.xml"/></Relationships>',
}


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
    """The table as a file's bytes, the same for the same numbers; ``form`` is one of
    :data:`FORMATS`.
    """
    if form == ".csv":
        return table.to_csv(index=False, lineterminator="\n").encode()
    rows = [
        "".join(
            f'<c t="inlineStr"><is><t>{escape(str(name))}</t></is></c>' for name in table.columns
        )
    ]
    rows += ["".join(f"<c><v>{float(v)!r}</v></c>" for v in row) for row in table.to_numpy()]
    sheet = (
        f'<worksheet xmlns="{_SCHEMA}/spreadsheetml/2006/main"><sheetData>'
        + "".join(f"<row>{row}</row>" for row in rows)
        + "</sheetData></worksheet>"
    )
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as file:
        for name, text in (_PARTS | {"xl/worksheets/sheet1.xml": sheet}).items():
            file.writestr(
                zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), _HEAD + text, zipfile.ZIP_DEFLATED
            )
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
