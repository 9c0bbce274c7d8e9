"""What the columns of somebody's table mean: quantities by the names people give them, units."""

from __future__ import annotations

import dataclasses
import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

from spab_core.common.errors import InputError
from spab_core.common.tables import is_number

NUMBER, SPEED, MASS, EXPONENT = "bearing_number", "speed_rpm", "rotor_mass", "mle"
_ANGULAR = ("omega", "ω", "angular speed", "angular velocity", "angular frequency")
_TURNS = ("n", "f", "frequency", "rotational frequency", "rotation frequency", "drehfrequenz")
# as spab writes them, and what else people call them; "lambda" (λ) is either of two
NAMES = {
    NUMBER: ("bearing_number", "bearing no", "bearing nr", "Λ", "compressibility number"),
    SPEED: (
        "speed",
        "rpm",
        *_ANGULAR,
        *_TURNS,
        "shaft speed",
        "rotor speed",
        "spindle speed",
        "running speed",
        "rotation speed",
        "rotational speed",
        "spin speed",
        "drehzahl",
    ),
    MASS: ("rotor_mass", "m_r", "mr", "m", "mass", "rotormasse", "masse"),
    EXPONENT: (
        "mle",
        "lle",
        "largest le",
        "maximum le",
        "max le",
        "lyapunov",
        "lyapunov max",
        "lyap",
        "exponent",
        "lyapunov exponent",
        "maximum lyapunov exponent",
        "maximal lyapunov exponent",
        "max lyapunov exponent",
        "largest lyapunov exponent",
        "λ max",
        "lambda max",
        "λ1",
        "λ 1",
    ),
}
_EITHER = ("lambda", "λ")
# what one of the unit is in rpm, kg; of an exponent, what it is per
UNITS: dict[str, dict[str, float | str]] = {
    NUMBER: {},
    SPEED: {
        **dict.fromkeys(
            (
                "rpm",
                "1/min",
                "min-1",
                "rev/min",
                "r/min",
                "u/min",
                "per minute",
                "revolutions per minute",
            ),
            1.0,
        ),
        **dict.fromkeys(("krpm",), 1e3),
        **dict.fromkeys(("hz", "rps", "rev/s", "r/s", "u/s"), 60.0),
        **dict.fromkeys(("1/s", "s-1"), "per second"),  # turns or radians, as the name says
        **dict.fromkeys(("khz",), 60e3),
        **dict.fromkeys(("rad/s", "rad s-1"), 30.0 / math.pi),
    },
    MASS: {
        **dict.fromkeys(("kg", "kilogram", "kilograms"), 1.0),
        **dict.fromkeys(("g", "gram", "grams", "gramm"), 1e-3),
        "t": 1e3,
        **dict.fromkeys(("lb", "lbs", "lbm", "pound", "pounds"), 0.45359237),
    },
    EXPONENT: {
        **dict.fromkeys(
            (
                "1/rev",
                "rev-1",
                "per rev",
                "per revolution",
                "1/revolution",
                "1/u",
                "nats/rev",
                "per revolution, natural logarithm",
            ),
            "revolution",
        ),
        **dict.fromkeys(("1/s", "s-1", "per second", "per s", "1/sec", "nats/s"), "second"),
        **dict.fromkeys(
            (
                "1/τ",
                "τ-1",
                "per τ",
                "1/tau",
                "tau-1",
                "per tau",
                "1/rad",
                "rad-1",
                "per rad",
                "per radian",
            ),
            "tau",
        ),
    },
}
NO_UNIT = ("", "1", "none", "dimensionless", "dimlos")  # "-" has no letters
_NO_UNIT_SIGN = re.compile(r"[\[(]\s*[-–—]\s*[\])]\s*$")
_MASS_NUMBER = "{!r} is told to have no unit: the mass number M is no mass; give a column in kg"
_PER_SECOND = {**dict.fromkeys(_ANGULAR, 30.0 / math.pi), **dict.fromkeys(_TURNS, 60.0)}


def _plain(text: str) -> str:
    """Words of a name or unit, one blank between them; Λ stays another letter than λ."""
    text = unicodedata.normalize("NFKC", text).replace("Λ", "\0")
    words = re.findall(r"[\w%‰°$€]+|\0", text.casefold().replace("_", " "))
    return " ".join(words).replace("\0", "Λ")


_NAMES = {_plain(name): quantity for quantity, names in NAMES.items() for name in names}
_NAMES |= dict.fromkeys(map(_plain, _EITHER), "")
_UNITS = {q: {_plain(unit): value for unit, value in units.items()} for q, units in UNITS.items()}


@dataclass(frozen=True)
class Column:
    """A column that means something.

    Attributes
    ----------
    place : int
        From 0.
    name : str
        As in the file.
    quantity : str
        One of :data:`NAMES`; "" where it may be bearing number or exponent.
    unit : float or str or None
        A value of :data:`UNITS`; None where the name tells none.
    """

    place: int
    name: str
    quantity: str
    unit: float | str | None


def understand(name: str, place: int = 0) -> Column | None:
    """Return what a name says, None where it says nothing known.

    Raises
    ------
    InputError
        For a known name with an unknown unit in brackets.
    """
    words = _plain(name).split()
    for k in range(len(words), 0, -1):
        quantity = _NAMES.get(" ".join(words[:k]))
        if quantity is None:
            continue
        rest = " ".join(words[k:]).removeprefix("in ")
        if rest in NO_UNIT:
            if quantity == MASS and (rest or _NO_UNIT_SIGN.search(name)):
                raise InputError(_MASS_NUMBER.format(name[:60]))
            told = "rpm" if (quantity, words[:k]) == (SPEED, ["rpm"]) else None
            return Column(place, name, quantity, UNITS[SPEED][told] if told else None)
        for candidate in (quantity,) if quantity else (NUMBER, EXPONENT):
            if rest in _UNITS[candidate]:
                return Column(place, name, candidate, _turns(_UNITS[candidate][rest], name))
        if bracket := re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", name):
            unit = _plain(bracket[1])
            if any(unit in units for units in _UNITS.values()) and rest != unit:
                more = " ".join(words[:k])
                raise InputError(
                    f"{name[:60]!r} is not understood: write {more} [{bracket[1].strip()}]"
                    + ("; masses are those that one bearing carries" if quantity == MASS else "")
                )
            raise InputError(
                f"the unit in {name[:60]!r} is not known{_known_units(quantity or EXPONENT)}"
            )
        return None
    return None


def _turns(unit: float | str, name: str) -> float | str:
    """Return the unit, one of turns or radians for a speed per second of that name."""
    if unit != "per second":
        return unit
    words = _plain(name)
    for known, factor in _PER_SECOND.items():
        if f"{words} ".startswith(f"{known} "):
            return factor
    raise InputError(
        f"{name[:60]!r} may be turns or radians in a second: write rev/s (Hz) or rad/s"
    )


def _known_units(quantity: str) -> str:
    units = list(UNITS[quantity])
    return f": give one of {', '.join(units[:12])}" if units else ", the bearing number has none"


def unit_of(quantity: str, text: str) -> float | str | None:
    """Return the unit that a cell below a name tells; None for none ("" or "-").

    Raises
    ------
    InputError
        For a unit that is not known.
    """
    plain = _plain(text.strip("[](){}"))
    if plain in NO_UNIT:
        if quantity == MASS and text.strip("[](){} "):
            raise InputError(_MASS_NUMBER.format(f"{quantity} in {text}"))
        return None
    if plain not in _UNITS[quantity]:
        raise InputError(f"the unit {text[:40]!r} is not known{_known_units(quantity)}")
    return _UNITS[quantity][plain]


def check_mass(column: Column) -> None:
    """Raise :class:`InputError` for a mass that may be the dimensionless mass number M."""
    if column.unit is None and column.name.strip() == "M":
        raise InputError(
            "'M' may be the rotor mass or the dimensionless mass number M: name a mass 'mass [kg]'"
        )


def with_unit(column: Column, text: str) -> Column:
    """Return the column with the unit that a cell below its name tells.

    Raises
    ------
    InputError
        For a unit that is not known, or differs from the one in the name.
    """
    unit = unit_of(column.quantity, text)
    unit = unit and _turns(unit, column.name)
    if unit is not None and column.unit is not None and unit != column.unit:
        raise InputError(f"{column.name[:60]!r} and the unit below it, {text[:40]!r}, differ")
    return dataclasses.replace(column, unit=column.unit if unit is None else unit)


def is_unit_row(cells: Sequence[str]) -> bool:
    """Whether the cells below the names tell units: no number among them, and one known unit."""
    return not any(map(is_number, cells)) and any(
        _plain(cell.strip("[](){}")) in units for cell in cells for units in _UNITS.values()
    )


def count_known(names: Sequence[str]) -> int:
    """How many names are understood; a matrix's first cell counts as two."""
    return sum(1 for name in names if _safely(name)) + 2 * bool(names and corner(names[0]))


def _safely(name: str) -> bool:
    try:
        return understand(name) is not None
    except InputError:
        return True


def corner(text: str) -> tuple[Column, Column] | None:
    """Return what rows and columns of a matrix are, from its first cell such as "mass/Lambda"; None
    where it does not tell.
    """
    pieces = re.split(
        r"\s+(?:vs\.?|by|over|x|×)\s+|[\\/|,;]|×|->|→",
        re.sub(r"\[[^]]*\]|\([^)]*\)", _masked, text),
    )
    if len(pieces) != 2:
        return None
    try:
        found = [understand(_unmasked(piece)) for piece in pieces]
    except InputError:
        return None
    rows, columns = (c and (c if c.quantity else Column(0, c.name, NUMBER, None)) for c in found)
    if rows and columns and {rows.quantity, columns.quantity} in ({MASS, NUMBER}, {MASS, SPEED}):
        return rows, columns
    return None


_MASK = {sign: chr(0xE000 + k) for k, sign in enumerate("\\/|,; ")}


def _masked(found: re.Match[str]) -> str:
    return "".join(_MASK.get(sign, sign) for sign in found[0])


def _unmasked(text: str) -> str:
    signs = {mask: sign for sign, mask in _MASK.items()}
    return "".join(signs.get(sign, sign) for sign in text)


def choose(names: Sequence[str]) -> dict[str, Column]:
    """Return the columns by quantity: exponent, mass, bearing number or speed or both.

    Raises
    ------
    InputError
        Where one is missing, or two columns claim to be the same.
    """
    found, problems = [], []
    for place, name in enumerate(names):
        try:
            column = understand(name, place)
        except InputError as error:
            problems.append(str(error))
            continue
        if column is not None:
            found.append(column)
    by = {q: [c for c in found if c.quantity == q] for q in NAMES}
    either = [c for c in found if not c.quantity]
    for q, columns in by.items():
        if len(columns) > 1:
            raise InputError(
                f"the table is ambiguous: {_listed(columns)} both mean the {_WORDS[q]}; leave one"
            )
    # beside an exponent a lone n or f may number the rows: it is a speed if it has a unit
    speeds = [c for c in by[SPEED] if c.unit is not None or not by[EXPONENT]]
    open_ = [q for q in (NUMBER, EXPONENT) if not by[q] and not (q == NUMBER and speeds)]
    if len(either) > 1 or (either and len(open_) != 1):
        others = [c for q in (NUMBER, EXPONENT) for c in by[q]]
        raise InputError(
            f"the table is ambiguous: {_listed(either + others)}; λ (lambda) may be the bearing "
            "number or the exponent: name them bearing_number and mle"
        )
    if either:
        by[open_[0]] = [dataclasses.replace(either[0], quantity=open_[0])]
    chosen = {q: columns[0] for q, columns in by.items() if columns}
    needed = (MASS, EXPONENT) if SPEED in chosen else (NUMBER, MASS, EXPONENT)
    for q in needed:
        if q not in chosen:
            raise InputError(_missing(q, names, problems))
    return chosen


_WORDS = {
    NUMBER: "bearing number",
    SPEED: "shaft speed",
    MASS: "rotor mass",
    EXPONENT: "exponent",
}


def _listed(columns: Sequence[Column]) -> str:
    return " and ".join(repr(c.name[:40]) for c in columns)


def _missing(quantity: str, names: Sequence[str], problems: Sequence[str]) -> str:
    if problems:
        return problems[0]
    others = list(NAMES[quantity][:6]) + (["speed_rpm"] if quantity == NUMBER else [])
    seen = ", ".join(name[:30] for name in names[:8])
    if names and all(is_number(name) for name in names if name):
        return (
            f"the table has no column {quantity!r}: its first line holds numbers ({seen}), not "
            "names"
        )
    others = [other for other in others if other != quantity]
    return f"the table has no column {quantity!r} (or {', '.join(others)}); its columns are {seen}"
