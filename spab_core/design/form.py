"""The design as a form: one schema of every design value in the units of a drawing, with an exact
way there and back.

Labels, units and allowed ranges are declared with the dataclass fields in
:mod:`spab_core.design.model`. A form unit is a power of ten of the SI unit, so that a number of up
to 15 digits keeps its digits both ways: the decimal point alone moves."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from spab_core.common.errors import DesignError
from spab_core.common.units import from_rpm
from spab_core.common.validation import check_choice, check_number
from spab_core.common.words import capital
from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import Bearing, Contact, Design, Gas, Rotor, Value

GRADE_RANGE = (1e-3, 4000.0)  # mm/s; ISO 21940-11 names grades from G 0.4 to G 4000
# of a pressure that is a ratio in the design; enough to hold every reading, and below rounding
RATIO_DIGITS = 12


@dataclass(frozen=True)
class FormField:
    """One design value as a form shows it.

    Attributes
    ----------
    name : str
        ``section__field``, as :meth:`spab_core.design.model.Design.replace` takes it.
    label, symbol : str
    unit : str
        Form unit, "" for a pure number.
    power : int
        One form unit is ten to this power in SI.
    group : str
        One of :data:`GROUPS`.
    help : str
    low, high : float
        Allowed range in form units; for a pressure that is a ratio in the design, over the ambient
        pressure.
    infinite, open_low : bool
        Whether infinity is allowed; whether ``low`` itself is not.
    over_ambient : bool
        The design holds the ratio to the ambient pressure, the form the pressure itself.
    choices : tuple
        What it may be where it is no number; what stands before then says nothing.
    """

    name: str
    label: str
    symbol: str
    unit: str
    power: int
    group: str
    help: str
    low: float
    high: float
    infinite: bool
    open_low: bool
    over_ambient: bool
    choices: tuple[Value, ...] = ()

    @property
    def title(self) -> str:
        """Label, symbol and unit in one line."""
        return f"{self.label} {self.symbol}".strip() + (f", {self.unit}" if self.unit else "")


GROUPS = {"Bearing": Bearing, "Gas": Gas, "Rotor": Rotor, "Contact": Contact}
SUPPLY, AMBIENT = "bearing__supply_pressure_ratio", "gas__ambient_pressure"


def _shift(value: float, power: int) -> float:
    """``value`` times ten to ``power``, by moving the decimal point of its shortest spelling."""
    return float(Decimal(repr(float(value))).scaleb(power)) if math.isfinite(value) else value


def _fields() -> dict[str, FormField]:
    found = {}
    for group, section in GROUPS.items():
        for f in dataclasses.fields(section):
            name, m = f"{group.lower()}__{f.name}", f.metadata
            label, symbol, unit, power = m["form"]
            text = capital(m["text"])
            if m["choices"]:
                limits = (math.nan, math.nan, False, False, False)
                found[name] = FormField(
                    name, label, symbol, unit, power, group, f"{text}.", *limits, m["choices"]
                )
                continue
            over_ambient = name == SUPPLY
            low, high = (m[k] if over_ambient else _shift(m[k], -power) for k in ("low", "high"))
            shown = f"{low:g} to {high:g}" + (f" {unit}" if unit and not over_ambient else "")
            if over_ambient:
                text = (
                    "Of the chamber behind the porous wall, over vacuum; open to ambient it is the "
                    f"ambient pressure. From {shown} times the ambient pressure"
                )
            else:
                text += f". From {'above ' if m['open_low'] else ''}{shown}" + (
                    ", or rigid" if m["infinite"] else ""
                )
            found[name] = FormField(
                name,
                label,
                symbol,
                unit,
                power,
                group,
                f"{text}.",
                low,
                high,
                m["infinite"],
                m["open_low"],
                over_ambient,
            )
    return found


FIELDS = _fields()


def contact_words(design: Design) -> str:
    """Return the wall's contact law in N and µm, which the form has over p_a R² and C."""
    force, length = design.force_unit, 1e6 * design.bearing.clearance
    closure = design.contact.force_at_closure * force
    return (
        f"In this bearing f₀ = {closure:{',.0f' if closure >= 1e3 else '.4g'}} N "
        f"(p_a R² = {force:,.4g} N), s = {design.contact.roughness * length:.3g} µm "
        f"(C = {length:.4g} µm)"
    )


def unused(design: Design) -> frozenset[str]:
    """Names of form fields that say nothing about a design, such as the length of a sphere."""
    return frozenset(
        f"{group.lower()}__{name}"
        for group in GROUPS
        for name in getattr(design, group.lower()).unused
    )


def to_form(design: Design) -> dict[str, Any]:
    """Every design value in form units, by the names of :data:`FIELDS`."""
    values = {}
    for name, field in FIELDS.items():
        section, _, key = name.partition("__")
        value = getattr(getattr(design, section), key)
        if field.choices:
            values[name] = value
            continue
        if field.over_ambient:
            value = float(f"{value * design.gas.ambient_pressure:.{RATIO_DIGITS}g}")
        values[name] = _shift(value, -field.power)
    return values


def from_form(values: Mapping[str, Any], base: Design | None = None) -> Design:
    """The design that a form describes.

    Parameters
    ----------
    values : mapping
        In form units, by the names of :data:`FIELDS`; the design values left out are those of
        ``base``. Values that say nothing about the design (the length of a sphere) are passed over.
    base : Design, optional
        The design the form was filled from: a number that still is what :func:`to_form` gave keeps
        its value to the last bit, so that ``from_form(to_form(d), d) == d`` for every design. Left
        out: the reference design.

    Raises
    ------
    DesignError
        For a name that does not exist or a value out of range; the message speaks the form's labels
        and units.
    """
    base = Design() if base is None else base
    shown, changes = to_form(base), dict[str, Any]()
    for name in values:
        if name not in FIELDS:
            raise DesignError(f"there is no form field {str(name)[:60]!r}")
        if FIELDS[name].choices:
            check_choice(FIELDS[name].label, values[name], FIELDS[name].choices)
            changes[name] = values[name]
    passed_over = unused(base.replace(**changes))
    numbers = [name for name in values if name not in changes and name not in passed_over]
    for name in sorted(
        numbers, key=lambda name: FIELDS[name].over_ambient
    ):  # the ambient pressure before what is over it
        field, value, scale = FIELDS[name], values[name], 1.0
        if value == shown[name] and not (field.over_ambient and AMBIENT in changes):
            continue
        if field.over_ambient:
            scale = changes.get(AMBIENT, base.gas.ambient_pressure)
        low, high = (
            _shift(limit * scale, -field.power) if field.over_ambient else limit
            for limit in (field.low, field.high)
        )
        number = check_number(
            f"{field.label} {field.symbol}",
            value,
            low,
            high,
            field.unit,
            infinite=field.infinite,
            open_low=field.open_low,
        )
        changes[name] = _shift(number, field.power)
        if field.over_ambient:  # the limits themselves survive the division
            changes[name] = min(max(changes[name] / scale, field.low), field.high)
    return base.replace(**changes)


def eccentricity_of_grade(grade: float, speed_rpm: float, journal_mass_fraction: float) -> float:
    """Eccentricity of the disc's mass centre at a balance quality grade of ISO 21940-11:2016.

    The grade is e_per ω: permissible residual specific unbalance e_per = U_per/m, with m the mass
    of the whole rotor, times the angular speed. The disc alone is unbalanced here and has the share
    1 - μ_j of the mass: e_u = G / (ω (1 - μ_j)).

    Parameters
    ----------
    grade : float
        G in mm/s, such as 2.5 for G 2.5.
    speed_rpm : float
        Service speed the grade is stated for.
    journal_mass_fraction : float
        μ_j.

    Returns
    -------
    float
        e_u in m.

    Raises
    ------
    DesignError
        For a grade or speed out of range.
    """
    check_number("balance quality grade G", grade, *GRADE_RANGE, "mm/s")
    check_number("speed of the grade", speed_rpm, 1.0, 1e7, "rpm")
    return 1e-3 * grade / from_rpm(speed_rpm) / (1.0 - journal_mass_fraction)


def grade_of_eccentricity(
    eccentricity: float, speed_rpm: float, journal_mass_fraction: float
) -> float:
    """Balance quality grade G in mm/s of an eccentricity in m: the inverse of
    :func:`eccentricity_of_grade`.
    """
    return 1e3 * eccentricity * (1.0 - journal_mass_fraction) * from_rpm(speed_rpm)


def nearest_bearing_number(design: Design, speed_rpm: float) -> float:
    """Return the bearing number at a shaft speed in rpm, or the nearest one that is allowed."""
    low, high = BEARING_NUMBER_RANGE
    return min(max(design.bearing_number(from_rpm(speed_rpm)), low), high)


def bearing_number_of(
    design: Design, bearing_number: float | None, speed_rpm: float | None, name: str = "speed"
) -> float:
    """The bearing number, given as such or by the shaft speed in rpm: exactly one of both.

    ``name`` is what to call the speed in the message.

    Raises
    ------
    DesignError
        For both or neither, or a value out of range; the range of a speed is told in rpm.
    """
    if (bearing_number is None) == (speed_rpm is None):
        raise DesignError("give either the bearing number or the speed in rpm")
    if speed_rpm is None:
        return check_number("bearing number", bearing_number, *BEARING_NUMBER_RANGE)
    low, high = (design.speed_rpm(limit) for limit in BEARING_NUMBER_RANGE)
    return nearest_bearing_number(design, check_number(name, speed_rpm, low, high, "rpm"))
