"""Tables as other programs write them: rows of text from the bytes of a CSV file or a workbook,
with the line each row has in its file.

Separator, decimal sign and encoding are found out; a file of another kind is named in a sentence.
"""

from __future__ import annotations

import codecs
import csv
import io
import itertools
import re
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.npz import UNREADABLE
from spab_core.common.words import count

if TYPE_CHECKING:
    import pandas as pd

MAX_COLUMNS = 5_000
_MAX_LINE = 1_000_000  # characters
_PREAMBLE = 50  # filled lines among which the names are looked for
_LONG_NAMES = 100_000  # characters of such a line
_UNPACKED = 100_000_000  # bytes of a workbook
_NOT_A_CSV = "not a CSV table"
_COMMENTS = ("#", "%", "//")
_ERROR = re.compile(r"#(N/?A|NV|[A-ZÄÖÜ/0]+[!?])(?=$|[\s,;|\"])")  # of a cell, as Excel writes it
_SPACES = {"two or more spaces": r"\s{2,}", "spaces": r"\s+"}
_SEPARATORS = (",", ";", "\t", "|", ":", *_SPACES)
MISSING = frozenset(  # in lower case, as Excel, pandas, R and MATLAB write an empty cell
    ("", "nan", "na", "n/a", "#n/a", "#na", "#nv", "null", "none", "<na>", "-nan", "1.#qnan")
)
_RULE = re.compile(r"[|+:=\s-]+")  # with three in a row: drawn below the names
_MARKS = (  # of encodings; that of UTF-32 begins with that of UTF-16
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_OTHERS = (  # first bytes of files that are no table
    (b"\xd0\xcf\x11\xe0", "a workbook of Excel before 2007 (.xls): save it as .xlsx or CSV"),
    (b"CDF\x01", "a NetCDF file: write it as CSV (spab export MAP.npz --out MAP.csv)"),
    (b"CDF\x02", "a NetCDF file: write it as CSV"),
    (b"MATLAB 7.3", "a MATLAB file: write it as CSV"),
    (b"PAR1", "a Parquet file: write it as CSV"),
    (b"ARROW1", "a Feather file: write it as CSV"),
    (b"SQLite", "a database (SQLite): write it as CSV"),
    (b"7z\xbc\xaf", "packed by 7-Zip: unpack it first"),
    (b"PK\x05\x06", "an empty ZIP archive"),
    (b"{\\rtf", "a formatted text (RTF): save it as plain text or CSV"),
    (b"\x89HDF", "an HDF5 file (NetCDF 4, or MATLAB 7.3): write it as CSV"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB file: write it as CSV"),
    (b"\x93NUMPY", "a NumPy file (.npy): write it as CSV"),
    (b"\x1f\x8b", "packed by gzip: unpack it first"),
    (b"%PDF", "a PDF file"),
    (b"\x89PNG", "a picture"),
    (b"\xff\xd8\xff", "a picture"),
)


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    names : list of str
        The line of names, without empty ones at its end.
    rows : list of list of str
        Cells without blanks around them, each row as long as ``names``; empty rows left out.
    lines : list of int
        Line of each row in the file, from 1; of a workbook the row.
    separator : str
        ``,``, ``;``, a tab, ``|`` or a word of spaces; "" for a workbook.
    notes : list of str
        What was left aside, in sentences.
    """

    names: list[str]
    rows: list[list[str]]
    lines: list[int]
    separator: str
    notes: list[str]


def read_table(data: bytes, known: Callable[[Sequence[str]], int], most: int) -> Table:
    """Read the bytes of a CSV file or an XLSX workbook.

    Parameters
    ----------
    data : bytes
        Text in UTF-8, UTF-16, UTF-32 or Windows' Western alphabet (cp1252): a line of names, then
        rows, separated by commas, semicolons, tabs, bars or spaces. A line ``sep=…``, comment
        lines (``#``, ``%``, ``//``), empty lines, separators at the ends of lines are allowed; the
        names may stand in the last comment. Or a workbook, whose first filled sheet is read.
    known : callable
        How many of some names are understood: the separator that gives most is taken.
    most : int
        Largest number of rows.

    Raises
    ------
    InputError
        For another kind of file, which is named where it is known; for a table that is too large,
        or a row longer than the line of names.
    """
    if data.startswith(b"PK\x03\x04"):
        return _workbook(data, known, most)
    for mark, what in _OTHERS:
        if data.startswith(mark):
            raise InputError(f"{_NOT_A_CSV}: it is {what}")
    text = _decoded(data)
    begin = text.lstrip()[:200].lower()
    if begin.startswith(("<!doctype", "<html", "<?xml", "<table")):
        raise InputError(f"{_NOT_A_CSV}: it is a page of HTML or XML")
    if begin.startswith(("{", "[{", "[[")):
        raise InputError(f"{_NOT_A_CSV}: it is JSON")
    return _text_table(text, known, most)


def _decoded(data: bytes) -> str:
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if encoding is None and len(data) >= 4 and 0 in data[:4]:  # UTF-16 without a mark
        high, low = data[:400:2].count(0), data[1:400:2].count(0)
        encoding = "utf-16-be" if high > low else "utf-16-le"
    try:
        if encoding is not None:
            text = data.decode(encoding)
        else:
            try:
                text = data.decode("utf-8")
            except UnicodeDecodeError:
                text = data.decode("cp1252")
    except UnicodeError as error:
        raise InputError(
            f"{_NOT_A_CSV}: it is no text ({' '.join(str(error).split())[:120]})"
        ) from None
    if "\0" in text:
        raise InputError(f"{_NOT_A_CSV}: it is no text")
    if not text.strip():
        raise InputError(f"{_NOT_A_CSV}: it is empty")
    return text


_GROUPED = re.compile(r"[+-]?\d{1,3}(?:[ \u00a0\u2009\u202f'\u2019]\d{3})+(?:[.,]\d*)?")


def _bare(cell: str) -> str:
    """Return a cell without blanks or apostrophes around it, and without those between the
    thousands of its number.
    """
    cell = cell.strip()
    if cell[:1] == "'":
        cell = cell.strip("' ")
    if _GROUPED.fullmatch(cell):
        cell = re.sub(r"[^\d+\-.,]", "", cell)
    return cell


class _Lines:
    """Lines of a text without comments, and where the last one given stands."""

    def __init__(self, text: str, skip: int):
        self.number = skip
        self._lines = itertools.islice(io.StringIO(text, newline=None), skip, None)

    def __iter__(self) -> Iterator[str]:
        for line in self._lines:
            self.number += 1
            if len(line) > _MAX_LINE:
                raise InputError(
                    f"{_NOT_A_CSV}: line {self.number} has more than {_MAX_LINE:,} characters"
                )
            if not _is_comment(line) and not _is_rule(line.strip()):
                yield line


def _is_comment(line: str) -> bool:
    begin = line.lstrip()
    return begin.startswith(_COMMENTS) and not _ERROR.match(begin)


def _is_rule(line: str) -> bool:
    return ("---" in line or "===" in line) and bool(_RULE.fullmatch(line))


def _records(text: str, skip: int, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line and cells of each row that is not empty."""
    lines = _Lines(text, skip)
    records: Iterable[list[str]]
    if separator in _SPACES:
        records = (re.split(_SPACES[separator], line.strip()) for line in lines)
    else:
        records = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    try:
        for record in records:
            cells = [_bare(cell) for cell in record]
            if len(cells) > MAX_COLUMNS:
                raise InputError(
                    f"line {lines.number} has {count(len(cells), 'value')}: allowed are at most "
                    f"{MAX_COLUMNS:,}"
                )
            if any(cells):
                yield lines.number, cells
    except csv.Error as error:
        raise InputError(f"{_NOT_A_CSV}: line {lines.number}: {error}") from None


def _text_table(text: str, known: Callable[[Sequence[str]], int], most: int) -> Table:
    text = _unwrapped(text)
    declared, comment = "", ""
    above: list[tuple[int, str]] = []  # lines that may hold the names
    for number, line in enumerate(io.StringIO(text, newline=None)):
        bare = line.strip("\n\ufeff").strip('"')
        if not above and (found := re.fullmatch(r"sep=([,;|:\t ])", bare, re.IGNORECASE)):
            declared = found[1].replace(" ", "spaces")
        elif _is_comment(bare):
            comment = comment if above else bare.lstrip("#%/ ")
        elif bare.strip(",;|\t "):
            above.append((number, line[:_MAX_LINE]))
            if len(above) == _PREAMBLE:
                break
    if not above:
        raise InputError(f"{_NOT_A_CSV}: it has no line of names")

    def cells(line: str, separator: str) -> list[str]:
        return next((row for _, row in _records(line, 0, separator)), [])

    allowed = (declared,) if declared else _SEPARATORS

    def understood(line: str) -> int:
        return max(known(cells(line, s)) for s in allowed)

    skip, first = next(
        ((n, line) for n, line in above if len(line) < _LONG_NAMES and understood(line) >= 2),
        above[0],
    )
    separator = max(allowed, key=lambda s: (known(cells(first, s)), len(cells(first, s))))
    if comment and all(map(is_number, filter(None, cells(first, separator)))):
        # as numpy.savetxt writes a header
        between = max(allowed, key=lambda s: known(cells(comment, s)))
        if known(names := cells(comment, between)) >= 2:
            below = max(allowed, key=lambda s: len(cells(first, s)) == len(names))
            return _checked(names, _records(text, skip, below), below, most, [])
    records = _records(text, skip, separator)
    _, names = next(records, (0, []))
    if not names:
        raise InputError(f"{_NOT_A_CSV}: it has no line of names")
    return _checked(names, records, separator, most, _left_aside(skip > above[0][0]))


_WRAPPED = r'^"([^"\n]*[,;\t|][^"\n]*)"[,; \t]*$'


def _unwrapped(text: str) -> str:
    """Return a text without the quotes around whole lines, where each of its first lines has
    them.
    """
    first = [line for line in itertools.islice(io.StringIO(text), _PREAMBLE) if line.strip()]
    if first and all(re.match(_WRAPPED, line) for line in first):
        return re.sub(_WRAPPED, r"\1", text, flags=re.MULTILINE)
    return text


def _left_aside(preamble: bool) -> list[str]:
    return ["lines above the names are left aside"] if preamble else []


def _checked(
    names: list[str],
    records: Iterable[tuple[int, list[str]]],
    separator: str,
    most: int,
    notes: list[str],
) -> Table:
    """Return the table, rows cut or filled to the number of names."""
    while names and not names[-1]:
        names = names[:-1]
    rows: list[list[str]] = []
    lines: list[int] = []
    width, shifted = len(names), True
    for line, cells in records:
        if len(rows) == most:
            raise InputError(f"the table has more than {most:,} rows, which is the most allowed")
        shifted &= len(cells) == width + 1 and cells[0].strip('"') in (
            str(len(rows)),
            str(len(rows) + 1),
        )
        if any(cells[width:]):
            raise InputError(
                f"{_NOT_A_CSV}: line {line} has {count(len(cells), 'value')}, longer than the "
                f"line of names with {width}{_told_separator(separator)}"
            )
        rows.append(cells[:width] + [""] * (width - len(cells)))
        lines.append(line)
    if shifted and len(rows) > 1 and names[0]:
        raise InputError(
            f"{_NOT_A_CSV}: each row has one value more than the line of names and begins with its "
            "number: give that column a name"
        )
    return Table(names, rows, lines, separator, notes)


def _told_separator(separator: str) -> str:
    name = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}.get(separator, separator)
    return f", separated by {name}" if name else ""


def _workbook(data: bytes, known: Callable[[Sequence[str]], int], most: int) -> Table:
    from openpyxl import load_workbook  # only who brings a workbook waits for it
    from openpyxl.utils.exceptions import InvalidFileException

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            parts = archive.namelist()
            size = sum(part.file_size for part in archive.infolist())
        if any(name.endswith(".npy") for name in parts):
            raise InputError(
                f"{_NOT_A_CSV}: it is an NPZ file; a map or line of spab becomes a table by spab "
                "export FILE.npz --out FILE.csv"
            )
        if "xl/workbook.xml" not in parts:
            raise InputError(
                f"{_NOT_A_CSV}: it is a ZIP archive without a workbook of Excel (.xlsx)"
            )
        if size > _UNPACKED:
            raise InputError(
                f"the workbook unpacks to {size:,} bytes: allowed are at most {_UNPACKED:,}"
            )
        with warnings.catch_warnings():  # about styles and the like
            warnings.simplefilter("ignore")
            book = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            try:
                return _best_sheet(book.worksheets, known, most)
            finally:
                book.close()
    except InputError:
        raise
    except (*UNREADABLE, InvalidFileException, ArithmeticError, LookupError) as error:
        raise InputError(f"not a workbook of Excel: {' '.join(str(error).split())[:160]}") from None


def _best_sheet(sheets: Sequence[Any], known: Callable[[Sequence[str]], int], most: int) -> Table:
    """Return the first sheet with names that are understood, else the first that is filled."""
    filled: list[tuple[bool, int, Any, int]] = []
    for sheet in sheets:
        sheet.reset_dimensions()  # what the file claims may be anything
        above = list(itertools.islice(_sheet_rows(sheet, most), _PREAMBLE))
        place = next((k for k, (_, row) in enumerate(above) if known(row) >= 2), None)
        if above:
            filled.append((place is None, len(filled), sheet, place or 0))
    if not filled:
        raise InputError("the workbook has no filled sheet")
    _, _, sheet, place = min(filled, key=lambda found: found[:2])
    notes = _left_aside(place > 0)
    if len(filled) > 1:
        notes.append(f"of the workbook's {len(filled)} filled sheets {sheet.title!r} is read")
    records = itertools.islice(_sheet_rows(sheet, most), place, None)
    _, names = next(records)
    return _checked(names, records, "", most, notes)


def _sheet_rows(sheet: Any, most: int) -> Iterator[tuple[int, list[str]]]:
    rows = sheet.iter_rows(max_row=2 * most, max_col=MAX_COLUMNS, values_only=True)
    for number, row in enumerate(rows, 1):
        cells = ["" if value is None else _bare(str(value)) for value in row]
        if any(cells) and not _is_comment(cells[0]):
            yield number, cells


_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)*|[.,]\d+)([eEdD][+-]?\d+)?")


def is_number(text: str) -> bool:
    """Whether a text is a number, with either decimal sign, or with separated thousands."""
    return _NUMBER.fullmatch(text) is not None


_THOUSANDS = {sign: rf"[+-]?[1-9]\d{{0,2}}(\{sign}\d{{3}})+" for sign in ",."}


def decimal_sign(columns: Sequence[pd.Series], separator: str) -> tuple[str, str]:
    """Return the decimal sign of columns of text, and the sign between thousands ("" for none).

    Raises
    ------
    InputError
        Where numbers can be read in two ways.
    """
    import pandas as pd  # a third of a second to load

    cells = pd.concat(list(columns), ignore_index=True)
    comma, point = (cells.str.contains(sign, regex=False) for sign in ",.")
    if not comma.any():
        return ".", ""
    both = cells[comma & point]
    if len(both):
        last = both.map(lambda cell: "," if cell.rfind(",") > cell.rfind(".") else ".")
        if last.nunique() > 1:
            raise InputError(
                f"numbers such as {both.iloc[0][:40]!r} have commas and points: which of them is "
                "the decimal sign cannot be told"
            )
        return last.iloc[0], "." if last.iloc[0] == "," else ","
    thousands = cells[comma].str.fullmatch(_THOUSANDS[","]).all()
    if point.any():  # never both in one number
        if thousands:
            return ".", ","
        if cells[point].str.fullmatch(_THOUSANDS["."]).all():
            return ",", "."
        raise InputError(
            f"decimal signs are mixed: {cells[comma].iloc[0][:40]!r} and "
            f"{cells[point].iloc[0][:40]!r}; write all numbers with points"
        )
    if thousands and separator == ",":
        raise InputError(
            f"a number such as {cells[comma].iloc[0][:40]!r} can be read in two ways (decimal "
            "comma, or thousands): write it with a decimal point"
        )
    return ",", ""


def numbers(column: pd.Series, sign: tuple[str, str]) -> np.ndarray:
    """Return a column of text as numbers, nan where a cell is none; ``sign`` is of
    :func:`decimal_sign`. Powers of ten may be written with d, as Fortran does.
    """
    import pandas as pd

    decimal, thousands = sign
    text = column
    if thousands:
        grouped = column.str.fullmatch(
            rf"[+-]?\d{{1,3}}(\{thousands}\d{{3}})+(\{decimal}\d*)?([eEdD][+-]?\d+)?"
        )
        text = column.where(~grouped, column.str.replace(thousands, "", regex=False))
    if decimal == ",":
        text = text.str.replace(".", "x", regex=False).str.replace(",", ".", regex=False)
    plain = text.str.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")
    text = text.where(plain).str.replace("[dD]", "e", regex=True)
    found: np.ndarray = pd.to_numeric(text, errors="coerce").to_numpy(float)
    return found
