"""Exponents that were measured or computed elsewhere, read from CSV or a workbook."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.npz import npz_bytes
from spab_core.common.tables import MISSING, Table, decimal_sign, is_number, numbers, read_table
from spab_core.common.validation import check_choice
from spab_core.common.words import count
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.surrogates.columns import (
    EXPONENT,
    MASS,
    NUMBER,
    SPEED,
    Column,
    check_mass,
    choose,
    corner,
    count_known,
    is_unit_row,
    with_unit,
)

if TYPE_CHECKING:
    import pandas as pd

MAX_BYTES = 20_000_000
MAX_ROWS = 200_000
MIN_ROWS = 64  # a quarter of them still trains every model
LARGEST = 1e3  # per revolution: beyond it, a column is not an exponent
# per revolution; the deepest of the shipped map is -38
USUAL_LARGEST = 40.0
_SPEEDS = (1e-3, 1e8)  # rpm, beside bearing numbers
PER = ("revolution", "second", "tau")  # what an exponent is per; tau is the shaft angle in radian
_USUAL_MASS = 100.0  # kg: a table of heavier rotors may be in grams
_SCHEMA = Schema(
    "samples",
    {
        "inputs": Array(np.float64, ("sample", 2), finite=True),
        "mle": Array(np.float64, ("sample",), -LARGEST, LARGEST, finite=True),
        "left_out": Array(np.int64, low=0),
    },
)


@dataclass(frozen=True)
class Samples:
    """Exponents at points of the plane, on a grid or not.

    Attributes
    ----------
    inputs : ndarray, (n, 2)
        Bearing number and rotor mass in kg.
    mle : ndarray, (n,)
        Per revolution, finite.
    left_out : int
        Rows of the file without an exponent.
    notes : tuple of str
        What was taken for granted in reading, and what looks like a slip, in sentences.
    """

    inputs: np.ndarray
    mle: np.ndarray
    left_out: int = 0
    notes: tuple[str, ...] = ()


def read_samples(data: bytes, design: Design | None = None, *, per: str | None = None) -> Samples:
    """Read a table of exponents over bearing number, or shaft speed, and rotor mass.

    Parameters
    ----------
    data : bytes
        CSV text or an XLSX workbook (:func:`spab_core.common.tables.read_table`): a line of names
        as in :data:`spab_core.surrogates.columns.NAMES`, with units in the names or in the line
        below, then rows; or a matrix whose first cell names its rows and columns ("mass/Lambda").
        Other columns are ignored, rows with an empty exponent are left out. Masses are kg on one
        bearing unless another unit is told.
    design : Design, optional
        Turns shaft speeds into bearing numbers, and exponents per second into such per revolution.
    per : str, optional
        What the exponent is per, one of :data:`PER`; left out: what its column says, else a
        revolution, which is noted.

    Returns
    -------
    Samples

    Raises
    ------
    InputError
        For what is not the bytes of a file; for one that is too large, is no such table, is
        ambiguous, holds a value out of range, or needs the design and has none; the message names
        column and line.
    """
    if per is not None:
        check_choice("per", per, PER)
    if not isinstance(data, (bytes, bytearray)):
        raise InputError(
            f"data = {str(data)[:40]!r} must be the bytes of a file, as of Path(…).read_bytes(), "
            f"not {type(data).__name__}"
        )
    if design is not None and not isinstance(design, Design):
        raise InputError(
            f"design = {str(design)[:40]!r} must be a Design, as of load_design, not "
            f"{type(design).__name__}"
        )
    if len(data) > MAX_BYTES:
        raise InputError(f"the file has {len(data):,} bytes: allowed are at most {MAX_BYTES:,}")
    table = read_table(data, count_known, MAX_ROWS)
    notes = list(table.notes)
    cells = _cells(table)
    check_mass(cells[MASS].column)
    per_second = (per or cells[EXPONENT].column.unit) == "second"
    number, speed = _bearing_numbers(cells, design, notes, per_second)
    unit = float(cells[MASS].column.unit or 1.0)
    mass = cells[MASS].values * unit
    low, high = ROTOR_MASS_RANGE
    cells[MASS].check(mass, low, high, " kg", unit)
    factor, told = _per_revolution(cells[EXPONENT].column, per, speed)
    mle = cells[EXPONENT].values * factor
    cells[EXPONENT].check(mle, -LARGEST, LARGEST, " per revolution", empty_allowed=True)
    kept = np.isfinite(mle)
    if kept.sum() < MIN_ROWS:
        raise InputError(
            f"the table has {count(int(kept.sum()), 'row')} with an exponent: at least {MIN_ROWS} "
            "are needed"
        )
    inputs = np.column_stack([number, mass])[kept]
    _check_points(inputs, cells[MASS].lines[kept])
    if not told:
        notes += _exponent_notes(cells[EXPONENT].column, mle[kept])
    notes += _mass_notes(cells[MASS].column, inputs[:, 1], design)
    return Samples(inputs, mle[kept], int((~kept).sum()), tuple(notes))


@dataclass(frozen=True)
class _Cells:
    """The cells of one quantity.

    Attributes
    ----------
    column : Column
    text : Series of str, (n,)
    filled : ndarray of bool, (n,)
    values : ndarray, (n,)
        In the file's unit, nan where the text is no number.
    lines : ndarray of int, (n,)
    """

    column: Column
    text: pd.Series
    filled: np.ndarray
    values: np.ndarray
    lines: np.ndarray

    def check(
        self,
        values: np.ndarray,
        low: float,
        high: float,
        what: str,
        unit: float = 1.0,
        *,
        empty_allowed: bool = False,
    ) -> None:
        """Raise ``InputError`` with line and text of the first of ``values`` (those of the file
        times ``unit``) that is not from ``low`` to ``high``; ``what`` names their unit.
        """
        wrong = ~((low <= values) & (values <= high))
        if empty_allowed:
            wrong &= self.filled
        if not wrong.any():
            return
        row = int(wrong.argmax())
        text = str(self.text.iloc[row])
        said = repr(text[:40]) if self.filled[row] else "nothing"
        name = self.column.quantity
        if unit != 1.0:
            name, what = repr(self.column.name[:60]), f", which is {low:g} to {high:g}{what}"
        if any(sign in text for sign in "−–—"):
            what += "; its minus sign is not that of a keyboard"
        elif name == NUMBER and values[row] > high:
            what += "; speeds in rpm belong in a column speed_rpm"
        raise InputError(
            f"{name} in line {self.lines[row]} is {said}: allowed is a number from "
            f"{low / unit:g} to {high / unit:g}{what}"
        )


def _cells(table: Table) -> dict[str, _Cells]:
    """Return the cells by quantity."""
    import pandas as pd  # a third of a second to load

    columns, texts, lines = _matrix(table) or _columns(table)
    series = {q: pd.Series(values, dtype=object) for q, values in texts.items()}
    filled = {q: ~s.str.lower().isin(MISSING).to_numpy(bool) for q, s in series.items()}
    sign = decimal_sign([s[s.map(is_number)] for s in series.values()], table.separator)
    return {
        q: _Cells(columns[q], s, filled[q], numbers(s, sign), np.asarray(lines, int))
        for q, s in series.items()
    }


_Read = tuple[dict[str, Column], dict[str, list[str]], list[int]]


def _columns(table: Table) -> _Read:
    """Return columns, their cells and lines of a table with a column for each quantity."""
    chosen, rows, lines = choose(table.names), table.rows, table.lines
    if rows and is_unit_row([rows[0][c.place] for c in chosen.values()]):
        chosen = {q: with_unit(c, rows[0][c.place]) for q, c in chosen.items()}
        rows, lines = rows[1:], lines[1:]
    return chosen, {q: [row[c.place] for row in rows] for q, c in chosen.items()}, lines


def _matrix(table: Table) -> _Read | None:
    """Return columns, their cells and lines of a matrix; None for another table."""
    names, rows = table.names, table.rows
    if len(names) < 3 or not all(map(is_number, names[1:])) or is_number(names[0]):
        return None
    found = corner(names[0])
    if found is None:
        raise InputError(
            f"the table is a matrix, and its first cell {names[0][:40]!r} does not say what its "
            "rows and columns are: write there mass/Lambda or, for speeds, mass/speed [rpm] (rows "
            "first)"
        )
    down, across = found
    width = len(names) - 1
    cells = {
        down.quantity: [row[0] for row in rows for _ in range(width)],
        across.quantity: names[1:] * len(rows),
        EXPONENT: [cell for row in rows for cell in row[1:]],
    }
    if len(cells[EXPONENT]) > MAX_ROWS:
        raise InputError(f"the matrix has more than {MAX_ROWS:,} cells, which is the most allowed")
    lines = [line for line in table.lines for _ in range(width)]
    exponents = Column(0, "cells of the matrix", EXPONENT, None)
    chosen = {c.quantity: c for c in found} | {EXPONENT: exponents}
    return chosen, cells, lines


def _bearing_numbers(
    cells: dict[str, _Cells], design: Design | None, notes: list[str], per_second: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return bearing numbers, and speeds in rpm where file or design tell them; ``per_second``:
    whether exponents need the speed.
    """
    low, high = BEARING_NUMBER_RANGE
    speed = None
    if SPEED in cells:
        name, unit = repr(cells[SPEED].column.name[:60]), cells[SPEED].column.unit
        if unit is not None:
            speed = cells[SPEED].values * float(unit)
        elif NUMBER not in cells:
            raise InputError(
                f"the column {name} does not state its unit: name it speed_rpm, speed [Hz] or "
                "speed [rad/s]"
            )
    if NUMBER in cells:
        number = cells[NUMBER].values
        cells[NUMBER].check(number, low, high, "")
        if speed is not None and unit is not None:
            cells[SPEED].check(speed, *_SPEEDS, " rpm", float(unit), empty_allowed=not per_second)
        if design is not None:
            of_design = design.speed_rpm(1.0) * number
            if speed is None:
                speed = of_design
            elif np.any(abs(speed / of_design - 1.0) >= 0.01):
                notes.append(
                    f"the speeds in {name} are not those of the design at the table's bearing "
                    "numbers, which are taken: do the data belong to another design?"
                )
        return number, speed
    if design is None:
        raise InputError(
            f"the table has shaft speeds ({name}) and no bearing numbers: give the design, which "
            "turns one into the other"
        )
    assert speed is not None and unit is not None
    least, most = (design.speed_rpm(limit) for limit in (low, high))
    what = f" rpm of this design, bearing numbers {low:g} to {high:g}"
    # what was written from the limits themselves is read again
    near = np.where(np.abs(speed / np.clip(speed, least, most) - 1.0) < 1e-9, least, speed)
    cells[SPEED].check(near, least, most, what, float(unit))
    notes.append(f"bearing numbers are those of the design at the speeds in {name}")
    return np.clip(speed / design.speed_rpm(1.0), low, high), speed


def _per_revolution(
    column: Column, per: str | None, speed: np.ndarray | None
) -> tuple[np.ndarray | float, bool]:
    """Return the factor that makes exponents such per revolution, and whether the unit is told."""
    if per is not None and column.unit is not None and per != column.unit:
        raise InputError(
            f"the column {column.name[:60]!r} tells an exponent per {column.unit}, and per {per} "
            "was asked for"
        )
    told = per or column.unit
    if told == "second":
        if speed is None:
            raise InputError(
                "exponents per second need the shaft speed: a column speed_rpm, or the design"
            )
        return 60.0 / speed, True
    if told == "tau":
        return 2.0 * np.pi, True
    return 1.0, told is not None


def _exponent_notes(column: Column, mle: np.ndarray) -> list[str]:
    """Doubt a unit that nothing tells; refuse to guess it where the numbers speak against it."""
    name = column.name[:60]
    largest = float(abs(mle).max())
    if largest > USUAL_LARGEST:
        raise InputError(
            f"the column {name!r} does not state its unit, and {largest:.3g} is "
            f"more than is usual per revolution ({USUAL_LARGEST:g}): name it "
            "'mle [1/rev]', 'mle [1/s]' or 'mle [1/rad]', or choose the unit"
        )
    if name.strip().casefold() == EXPONENT:  # as spab writes it
        return []
    return [f"the column {name!r} does not state its unit: taken as per revolution"]


def _mass_notes(column: Column, mass: np.ndarray, design: Design | None) -> list[str]:
    if column.unit is not None:
        return []
    heaviest, name = float(mass.max()), column.name[:60]
    if design is not None and design.rotor.gravity > 0.0:
        carried = max(design.bearing.supply_pressure_ratio, 1.0) * design.force_unit
        weight = heaviest * design.rotor.gravity
        if weight > 3.0 * carried:
            return [
                f"{heaviest:g} kg in {name!r} weighs {weight / carried:.2g} times the pressure "
                "times R² of the design, more than its film can carry: are these grams, or another "
                "design?"
            ]
        return []
    if heaviest > _USUAL_MASS:
        return [f"{name!r} goes up to {heaviest:g} kg: are these grams? Name it mass [g]"]
    return []


def _check_points(inputs: np.ndarray, lines: np.ndarray) -> None:
    _, first = np.unique(inputs, axis=0, return_index=True)
    if len(first) < len(inputs):
        row = int(np.setdiff1d(np.arange(len(inputs)), first)[0])
        raise InputError(
            f"the point bearing number {inputs[row, 0]:g}, rotor mass {inputs[row, 1]:g} kg stands "
            f"twice in the table, the second time in line {lines[row]}"
        )
    if not np.ptp(inputs, axis=0).all():
        raise InputError(
            "all points have one bearing number or one rotor mass: surrogates need a plane"
        )


def samples_bytes(samples: Samples) -> bytes:
    """Return samples as the bytes of an NPZ file."""
    return npz_bytes(
        {"inputs": samples.inputs, "mle": samples.mle, "left_out": np.array(samples.left_out)}
    )


def load_samples(path: Path) -> Samples:
    """Read a file of :func:`samples_bytes`.

    Raises ``InputError`` for any other file.
    """
    found = load(path, _SCHEMA)
    return Samples(found["inputs"], found["mle"], int(found["left_out"]))
