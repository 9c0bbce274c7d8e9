"""Tolerances: how far a machine that is built may be from the values of its drawing.

A tolerance is written in one way everywhere (design files, command line, form, address):

    ± 2 µm            each value from 2 µm below to 2 µm above is as likely as any other
    ± 8 % normal      a normal distribution cut there; its standard deviation is half of it
    up to G 2.5       from 0 to the unbalance of a balance quality grade, each as likely
    up to 1.5 µm      likewise, for a value that may be 0

A design file has them in its section ``[tolerances]``, which this module alone reads."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import truncnorm

from spab_core.common.errors import DesignError, InputError
from spab_core.common.units import from_rpm
from spab_core.design.form import (
    FIELDS,
    GROUPS,
    eccentricity_of_grade,
    from_form,
    to_form,
    unused,
)
from spab_core.design.limits import check_point
from spab_core.design.model import TOLERANCES, Design, file_values

UNIFORM, NORMAL, UP_TO = KINDS = ("uniform", "normal", "up to")
WITHIN = 2.0  # standard deviations of a normal distribution to each side, where it is cut
ROTOR_MASS, SPEED = "rotor_mass", "speed"
UNBALANCE = "rotor__unbalance_eccentricity"
GRADE, PERCENT = "G", "%"
MOST = 20  # tolerances of a machine
_TEXT = re.compile(
    r"(?P<how>±|\+-|\+/-|up to) ?(?P<grade>G)? ?(?P<number>[0-9.]+(?:e[+-]?[0-9]+)?)"
    r" ?(?P<unit>.*?)(?:[ ,]+(?P<kind>uniform|normal))?",
    re.IGNORECASE,
)
_FORMS = "± 2 µm, ± 8 %, ± 8 % normal, up to G 2.5"
_LONGEST = 80  # characters of one tolerance


class Value(NamedTuple):
    """A value of a machine that may have a tolerance.

    Attributes
    ----------
    name : str
        Of :data:`spab_core.design.form.FIELDS`, :data:`ROTOR_MASS` or :data:`SPEED`.
    label, unit : str
        As in a form.
    units : dict
        What one of each unit that may be written is in the form's unit.
    from_zero : bool
        Whether 0 is allowed.
    """

    name: str
    label: str
    unit: str
    units: dict[str, float]
    from_zero: bool

    @property
    def key(self) -> str:
        """Its name in design files and on the command line, such as ``bearing.clearance``."""
        return self.name.replace("__", ".")


class Machine(NamedTuple):
    """A design with what it carries and how fast it turns.

    Attributes
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    speed_rpm : float
    """

    design: Design
    rotor_mass: float
    speed_rpm: float

    @property
    def bearing_number(self) -> float:
        """Bearing number at its speed."""
        return self.design.bearing_number(from_rpm(self.speed_rpm))

    def check(self) -> None:
        """Raise :class:`DesignError` for a mass or a speed out of range."""
        check_point(self.rotor_mass, self.bearing_number)

    def values(self) -> dict[str, Any]:
        """Return all values by their names, in form units."""
        return to_form(self.design) | {ROTOR_MASS: self.rotor_mass, SPEED: self.speed_rpm}

    def replace(self, values: Mapping[str, float]) -> Machine:
        """Return the machine with values changed, by their names in form units.

        Raises :class:`DesignError` for a value out of range.
        """
        own = {name: value for name, value in values.items() if name not in (ROTOR_MASS, SPEED)}
        changed = Machine(
            from_form(own, self.design),
            float(values.get(ROTOR_MASS, self.rotor_mass)),
            float(values.get(SPEED, self.speed_rpm)),
        )
        changed.check()
        return changed

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "design": self.design.to_dict(),
            "rotor_mass": self.rotor_mass,
            "speed_rpm": self.speed_rpm,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Machine:
        """Read what :meth:`to_dict` returns; raise :class:`InputError` for anything else."""
        numbers = [data.get(name) for name in ("rotor_mass", "speed_rpm")]
        if any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in numbers):
            raise DesignError("a machine needs the numbers rotor_mass, kg, and speed_rpm")
        design = Design.from_dict(data.get("design", {}))
        machine = cls(design, *(float(v) for v in numbers if v is not None))
        machine.check()
        return machine


def plain_unit(unit: str) -> str:
    """Return a unit without what is typed in one way or another."""
    text = re.sub(r"[\s·*^]", "", unit.translate(str.maketrans("μ⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "µ-0123456789")))
    return re.sub("^u(?=m|Pa)", "µ", text)


def _tolerable() -> dict[str, Value]:
    found = {}
    for group, section in GROUPS.items():
        for f in dataclasses.fields(section):
            if f.metadata.get("choices"):
                continue  # one of several, which has no tolerance
            field = FIELDS[f"{group.lower()}__{f.name}"]
            units = {plain_unit(field.unit): 1.0}
            if not field.over_ambient:
                units.setdefault(plain_unit(f.metadata["unit"]), 10.0**-field.power)
            zero = f.metadata["low"] == 0.0 and not field.open_low
            found[field.name] = Value(field.name, field.label, field.unit, units, zero)
    found[ROTOR_MASS] = Value(ROTOR_MASS, "Rotor mass", "kg", {"kg": 1.0}, False)
    found[SPEED] = Value(SPEED, "Shaft speed", "rpm", {"rpm": 1.0}, False)
    return found


VALUES = _tolerable()  # that may have a tolerance, by name


def value_of(key: str) -> Value:
    """Return the value of a name such as ``bearing.clearance``; raise :class:`DesignError` with
    the names there are.
    """
    found = VALUES.get(key.strip().replace(".", "__"))
    if found is None:
        raise DesignError(
            f"there is no value {key.strip()[:60]!r}: allowed are "
            f"{', '.join(v.key for v in VALUES.values())}"
        )
    return found


@dataclass(frozen=True)
class Tolerance:
    """How far one value may be from the drawing.

    Attributes
    ----------
    name : str
        Of :data:`VALUES`.
    amount : float
        In the value's form unit, in % of it, or the balance grade in mm/s.
    unit : str
        The form unit, :data:`PERCENT` or :data:`GRADE`.
    kind : str
        Of :data:`KINDS`.
    """

    name: str
    amount: float
    unit: str
    kind: str = UNIFORM

    @property
    def text(self) -> str:
        """As it is written; :func:`parse_tolerance` reads it."""
        number = f"{self.amount:.6g}"
        if self.kind == UP_TO:
            return f"up to G {number}" if self.unit == GRADE else f"up to {number} {self.unit}"
        told = f"± {number} {self.unit}".rstrip()
        return f"{told} normal" if self.kind == NORMAL else told

    def bounds(self, machine: Machine) -> tuple[float, float]:
        """Return the least and the largest value that a machine may have, in form units."""
        at = machine.values()[self.name]
        if self.unit == GRADE:
            share = machine.design.rotor.journal_mass_fraction
            return 0.0, 1e6 * eccentricity_of_grade(self.amount, machine.speed_rpm, share)
        half = self.amount / 100.0 * abs(at) if self.unit == PERCENT else self.amount
        return (0.0, half) if self.kind == UP_TO else (at - half, at + half)

    def at(self, machine: Machine, quantile: np.ndarray) -> np.ndarray:
        """Return the values (n,) in form units at quantiles (n,) of the distribution."""
        low, high = self.bounds(machine)
        place = np.asarray(quantile, float)
        if self.kind == NORMAL:
            place = 0.5 + truncnorm.ppf(place, -WITHIN, WITHIN) / (2.0 * WITHIN)
        return np.clip(low + (high - low) * place, low, high)

    def narrowed(self, factor: float) -> Tolerance:
        """Return the tolerance times a factor, the same kind."""
        return dataclasses.replace(self, amount=self.amount * factor)


Tolerances = tuple[Tolerance, ...]


def parse_tolerance(key: str, text: object) -> Tolerance:
    """Read a tolerance of the value ``key`` (``bearing.clearance``, ``rotor_mass``, ``speed``).

    Raises
    ------
    DesignError
        For a name, a unit or a text that is not allowed.
    """
    value = value_of(key)
    begin = f"tolerance of {value.key} = {str(text)[:_LONGEST]!r}"
    plain = " ".join(str(text).split())
    match = _TEXT.fullmatch(plain) if isinstance(text, str) and len(plain) <= _LONGEST else None
    if match is None:
        raise DesignError(f"{begin} is not understood: write such as {_FORMS}")
    try:
        number = float(match["number"])
    except ValueError:
        raise DesignError(f"{begin}: {match['number']!r} is not a number") from None
    upper = match["how"].lower() == UP_TO
    kind = UP_TO if upper else (match["kind"] or UNIFORM).lower()
    if upper and (match["kind"] or "").lower() == NORMAL:
        raise DesignError(f"{begin}: what is up to a bound is uniform from 0 to it")
    unit = plain_unit(match["unit"])
    if match["grade"]:
        if not upper or value.name != UNBALANCE or unit not in ("", "mm/s"):
            raise DesignError(
                f"{begin}: a balance grade G is a bound of the unbalance alone, such as up to G 2.5"
            )
        return _checked(Tolerance(value.name, number, GRADE, kind), begin)
    if upper and not value.from_zero:
        raise DesignError(f"{begin}: this value may not be 0, so it has no tolerance up to a bound")
    if unit == PERCENT and value.unit != PERCENT:
        if upper:
            raise DesignError(f"{begin}: give the bound in {value.unit or 'the same unit'}")
        return _checked(Tolerance(value.name, number, PERCENT, kind), begin)
    if unit not in value.units:
        if comma := re.match(r",\d+", unit):
            told = f"{match['number']}.{comma[0][1:]}"
            raise DesignError(f"{begin}: the decimal sign is a point: write {told}")
        allowed = " or ".join(dict.fromkeys([PERCENT, value.unit or "a number without a unit"]))
        raise DesignError(f"{begin}: the unit {unit[:20]!r} is not allowed: give {allowed}")
    number = float(f"{number * value.units[unit]:.12g}")
    return _checked(Tolerance(value.name, number, value.unit, kind), begin)


def _checked(found: Tolerance, begin: str) -> Tolerance:
    top = 99.0 if found.unit == PERCENT else 1e12
    if not 0.0 < found.amount <= top:
        raise DesignError(f"{begin} is out of range: allowed is more than 0 up to {top:g}")
    return found


def parse_tolerances(texts: Mapping[str, object]) -> Tolerances:
    """Read tolerances by the names of their values; raise as :func:`parse_tolerance`."""
    if len(texts) > MOST:
        raise DesignError(f"{len(texts)} tolerances: allowed are at most {MOST}")
    found = [parse_tolerance(key, text) for key, text in texts.items()]
    names = [t.name for t in found]
    for name in names:
        if names.count(name) > 1:
            raise DesignError(f"{VALUES[name].key} has two tolerances")
    return tuple(found)


def read_tolerances(data: bytes | str, name: str = "file") -> Tolerances:
    """Read the section ``[tolerances]`` of a design file; none if it has no such section.

    Raises
    ------
    DesignError
        One sentence with the file's name.
    """
    try:
        section = file_values(data).get(TOLERANCES, {})
        if not isinstance(section, dict):
            raise DesignError(f"[{TOLERANCES}] must be a section")
        texts: dict[str, object] = {}
        for key, value in section.items():  # bearing.clearance = … makes a section of its own
            inside = value.items() if isinstance(value, dict) else ()
            texts |= {f"{key}.{k}": v for k, v in inside} if inside else {key: value}
        return parse_tolerances(texts)
    except InputError as error:
        raise DesignError(f"design file {name[:100]!r}: {error}") from None


def tolerances_toml(tolerances: Tolerances) -> str:
    """Return the section of a design file; nothing where there are none."""
    if not tolerances:
        return ""
    lines = [f'{VALUES[t.name].key} = "{t.text}"' for t in tolerances]
    return "\n".join([f"[{TOLERANCES}]", *lines, ""])


def parse_list(text: str) -> Tolerances:
    """Read tolerances in one line, such as "bearing.clearance ± 2 µm; speed ± 2 %"; raise as
    :func:`parse_tolerance`.
    """
    texts: dict[str, object] = {}
    for part in filter(None, map(str.strip, text.split(";"))):
        key, _, amount = part.partition(" ")
        if key in texts:
            raise DesignError(f"{key[:60]} has two tolerances")
        texts[key] = amount
    return parse_tolerances(texts)


def list_text(tolerances: Tolerances) -> str:
    """Return tolerances in one line that :func:`parse_list` reads."""
    return "; ".join(f"{VALUES[t.name].key} {t.text}" for t in tolerances)


def parse_ranges(text: str) -> dict[str, tuple[float, float]]:
    """Read ranges in one line, in form units, such as "bearing.clearance 15:40; rotor_mass 3:5".

    Raises :class:`DesignError`.
    """
    found: dict[str, tuple[float, float]] = {}
    for part in filter(None, map(str.strip, text.split(";"))):
        key, _, ends = part.partition(" ")
        name = value_of(key).name
        try:
            low, high = (float(end) for end in ends.split(":"))
        except ValueError:
            raise DesignError(f"range {part[:60]!r} must be a value and low:high") from None
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise DesignError(f"range {part[:60]!r}: the second number must be the larger one")
        found[name] = (low, high)
    return found


def ranges_text(ranges: Mapping[str, tuple[float, float]]) -> str:
    """Return ranges in one line that :func:`parse_ranges` reads."""
    return "; ".join(f"{VALUES[n].key} {low:.6g}:{high:.6g}" for n, (low, high) in ranges.items())


def check_tolerances(machine: Machine, tolerances: Tolerances) -> None:
    """Raise :class:`DesignError` where a bound of a tolerance, alone, is no machine."""
    machine.check()
    if not tolerances:
        raise DesignError("no value has a tolerance: give at least one, such as ± 2 µm")
    for tolerance in tolerances:
        value = VALUES[tolerance.name]
        if tolerance.name in unused(machine.design):
            raise DesignError(f"{value.key} says nothing about this design and has no tolerance")
        if not math.isfinite(machine.values()[tolerance.name]):
            raise DesignError(f"{value.key} is infinite and can have no tolerance")
        if tolerance.amount and not np.ptp(tolerance.bounds(machine)):
            raise DesignError(f"{value.key} is 0: its tolerance cannot be in %")
        for bound in tolerance.bounds(machine):
            try:
                machine.replace({tolerance.name: bound})
            except InputError as error:
                raise DesignError(
                    f"tolerance of {value.key} = {tolerance.text!r} reaches {bound:.6g} "
                    f"{value.unit}: {error}"
                ) from None


def parse_range(key: str, text: str, machine: Machine) -> tuple[str, tuple[float, float]]:
    """Read what a value may be, such as ``15:40 µm``, or ``1:6.3 G`` for an unbalance.

    Returns
    -------
    name : str
        Of :data:`VALUES`.
    bounds : tuple of float
        In form units.

    Raises
    ------
    DesignError
        For a name, a unit or numbers that are not allowed.
    """
    value = value_of(key)
    begin = f"range of {value.key} = {text[:_LONGEST]!r}"
    match = re.fullmatch(
        r"\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*:\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*(.{0,20}?)\s*",
        text,
        re.IGNORECASE,
    )
    unit = plain_unit(match[3]) if match else ""
    graded = value.name == UNBALANCE and unit.upper() == GRADE
    if match is None or not (graded or unit in value.units):
        raise DesignError(
            f"{begin} is not understood: write low:high and the unit, such as 1:2 {value.unit}"
        )
    low, high = (float(match[k]) for k in (1, 2))
    if graded:
        share = machine.design.rotor.journal_mass_fraction
        low, high = (1e6 * eccentricity_of_grade(g, machine.speed_rpm, share) for g in (low, high))
    else:
        low, high = (float(f"{v * value.units[unit]:.12g}") for v in (low, high))
    if not low < high:
        raise DesignError(f"{begin}: the second number must be the larger one")
    return value.name, (low, high)
