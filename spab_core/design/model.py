"""A rotor on spherical or cylindrical porous gas bearings, in SI units: what the designer draws,
checked, and its dimensionless groups.

The unit of every dimensionless quantity: lengths over the radial clearance C, pressures over the
ambient pressure p_a, forces over p_a R², time as the shaft angle tau = omega t. See docs/model.md.
"""

from __future__ import annotations

import codecs
import dataclasses
import json
import logging
import math
import os
import tomllib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

from spab_core.common.errors import DesignError, InputError
from spab_core.common.files import write_atomically
from spab_core.common.units import to_rpm
from spab_core.common.validation import check_choice, check_number
from spab_core.design import slips

TOLERANCES = "tolerances"  # section of a design file that is no part of the design
MIN_LAYER_NUMBER = 1e-9
MAX_FEEDING_NUMBER = 1e6  # far below, the wall holds the whole film at the supply pressure
SPHERE, CYLINDER = "sphere", "cylinder"
SLENDERNESS_RANGE = (0.01, 4.0)  # of a cylinder, length over diameter
Value = float | str | bool


def _number(
    form: tuple[str, str, str, int],
    default: float,
    unit: str,
    low: float,
    high: float,
    text: str,
    *,
    infinite: bool = False,
    open_low: bool = False,
    later: bool = False,
) -> Any:
    """A dataclass field with its unit and allowed range, read by :meth:`_Checked.__post_init__` and
    by :mod:`spab_core.design.form`.

    ``form``: label, symbol, form unit, and the power of ten that is one form unit in SI. ``later``:
    files made before there was such a value mean its default (:meth:`Design.told`).
    """
    metadata = {
        "form": form,
        "unit": unit,
        "low": low,
        "high": high,
        "text": text,
        "infinite": infinite,
        "open_low": open_low,
        "choices": (),
        "later": later,
    }
    return field(default=default, metadata=metadata)


def _choice(form: tuple[str, str, str, int], choices: tuple[Value, ...], text: str) -> Any:
    """A dataclass field that takes one of ``choices``, the first by default; else as
    :func:`_number`.
    """
    metadata = {"form": form, "unit": "", "text": text, "choices": choices, "later": True}
    return field(default=choices[0], metadata=metadata)


@dataclass(frozen=True)
class _Checked:
    def __post_init__(self) -> None:
        for f in fields(self):
            m, name, value = f.metadata, _dotted(self, f.name), getattr(self, f.name)
            if m["choices"]:
                check_choice(name, value, m["choices"])
                continue
            number = check_number(
                name,
                value,
                m["low"],
                m["high"],
                m["unit"],
                infinite=m["infinite"],
                open_low=m["open_low"],
            )
            object.__setattr__(self, f.name, number)

    @property
    def unused(self) -> frozenset[str]:
        """Names of values that say nothing about this part: they keep their defaults."""
        return frozenset()


def _dotted(part: object, name: str) -> str:
    return f"{type(part).__name__.lower()}.{name}"


@dataclass(frozen=True)
class Bearing(_Checked):
    """The spherical band |latitude| <= edge_latitude, or a cylinder of some length, and its porous
    wall.

    Real ones leave room to the limits: clearances of 3 to 100 µm on radii of 5 to 300 mm, walls of
    carbon or bronze of 1 to 20 mm with permeabilities of 1e-16 to 1e-12 m2, feeding numbers of 0.01
    to 1e4."""

    radius: float = _number(
        ("Radius", "R", "mm", -3), 0.060, "m", 1e-3, 1.0, "radius R of the sphere or cylinder"
    )
    clearance: float = _number(
        ("Radial clearance", "C", "µm", -6), 35e-6, "m", 1e-6, 1e-3, "radial clearance C"
    )
    edge_latitude: float = _number(
        ("Edge latitude", "λ_e", "°", 0), 30.0, "deg", 1.0, 89.5, "latitude of the open edges"
    )
    permeability: float = _number(
        ("Wall permeability", "κ", "10⁻¹⁵ m²", -15),
        1.44e-15,
        "m2",
        0.0,
        1e-11,
        "permeability of the porous wall",
    )
    wall_thickness: float = _number(
        ("Wall thickness", "H_p", "mm", -3), 4.5e-3, "m", 1e-4, 0.1, "thickness of the porous wall"
    )
    supply_pressure_ratio: float = _number(
        ("Supply pressure, absolute", "p_s", "bar", 5),
        1.0,
        "",
        0.1,
        100.0,
        "supply pressure over ambient (1: open to ambient)",
    )
    porosity: float = _number(
        ("Wall porosity", "φ", "%", -2),
        0.0,
        "",
        0.0,
        0.9,
        "porosity of the wall, whose pores store gas (0: none is stored)",
        later=True,
    )
    layer_permeability: float = _number(
        ("Layer permeability", "κ_l", "10⁻¹⁵ m²", -15),
        0.0,
        "m2",
        0.0,
        1e-11,
        "permeability of a restricted layer on the wall's surface (0: no layer)",
        later=True,
    )
    layer_thickness: float = _number(
        ("Layer thickness", "t_l", "µm", -6),
        0.0,
        "m",
        0.0,
        1e-2,
        "thickness of that layer (0: no layer)",
        later=True,
    )
    shape: str = _choice(
        ("Shape", "", "", 0), (SPHERE, CYLINDER), "sphere, or cylinder (its length below)"
    )
    length: float = _number(
        ("Length of a cylinder", "L", "mm", -3),
        0.060,
        "m",
        1e-3,
        2.0,
        "length of a cylinder from edge to edge",
        later=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for f in fields(self):
            if f.name in self.unused:
                object.__setattr__(self, f.name, f.default)
        low, high = SLENDERNESS_RANGE
        if self.cylindrical and not low <= self.edge <= high:
            raise DesignError(
                f"bearing.length = {self.length:g} m is out of range for this radius: allowed is "
                f"from {2.0 * low * self.radius:g} to {2.0 * high * self.radius:g} m, L/(2 R) from "
                f"{low:g} to {high:g}"
            )
        if self.clearance > 0.05 * self.radius:
            raise DesignError(
                f"bearing.clearance = {self.clearance:g} m is out of range: the thin-film equation "
                f"needs at most a twentieth of the radius, {0.05 * self.radius:g} m"
            )
        if not self.feeding_number <= MAX_FEEDING_NUMBER:
            raise DesignError(
                f"bearing.permeability = {self.permeability:g} m2 is out of range for this radius, "
                "clearance and wall thickness: the feeding number 6 kappa R²/(H_p C³) would be "
                f"{self.feeding_number:.3g}; allowed is at most {MAX_FEEDING_NUMBER:g}"
            )
        if (self.layer_permeability > 0.0) != (self.layer_thickness > 0.0):
            raise DesignError(
                f"bearing.layer_permeability = {self.layer_permeability:g} m2 and "
                f"bearing.layer_thickness = {self.layer_thickness:g} m: a layer needs both above "
                "0; both 0 mean no layer"
            )
        if self.layer_thickness > 0.5 * self.wall_thickness:
            raise DesignError(
                f"bearing.layer_thickness = {self.layer_thickness:g} m is out of range: a layer is "
                f"thin, at most half the wall's {self.wall_thickness:g} m, since it stores no gas "
                "here"
            )
        # a layer that lets nothing through is none: its resistance must stay a number
        if self.layered and not self.layer_number >= MIN_LAYER_NUMBER:
            raise DesignError(
                f"bearing.layer_permeability = {self.layer_permeability:g} m2 is out of range: the "
                f"layer's number 6 kappa_l R²/(t_l C³) would be {self.layer_number:.3g}; allowed "
                f"is at least {MIN_LAYER_NUMBER:g}, or no layer"
            )

    @property
    def unused(self) -> frozenset[str]:
        """The extent of the other shape."""
        return frozenset({"edge_latitude" if self.cylindrical else "length"})

    @property
    def cylindrical(self) -> bool:
        """Whether it is a cylinder."""
        return self.shape == CYLINDER

    @property
    def edge(self) -> float:
        """Half the width of the band over R: the edges' latitude in rad, L/(2R) of a cylinder."""
        if self.cylindrical:
            return self.length / (2.0 * self.radius)
        return math.radians(self.edge_latitude)

    @property
    def feeding_number(self) -> float:
        """Porous feeding number of the bulk, beta = 6 kappa R² / (H_p C³)."""
        return 6.0 * self.permeability * self.radius**2 / (self.wall_thickness * self.clearance**3)

    @property
    def layered(self) -> bool:
        """Whether a restricted layer lies on the wall."""
        return self.layer_thickness > 0.0

    @property
    def layer_number(self) -> float:
        """beta_l = 6 kappa_l R² / (t_l C³) of the layer; inf where there is none."""
        if not self.layered:
            return math.inf
        conductance = self.layer_permeability / self.layer_thickness
        return 6.0 * conductance * self.radius**2 / self.clearance**3

    @property
    def steady_feeding_number(self) -> float:
        """What bulk and layer pass together in steady flow, 1/(1/beta + 1/beta_l)."""
        beta = self.feeding_number
        if not self.layered or beta == 0.0:
            return beta
        return 1.0 / (1.0 / beta + 1.0 / self.layer_number)

    @property
    def stores_gas(self) -> bool:
        """Whether the wall's pores hold gas that the film reaches."""
        return self.porosity > 0.0 and self.feeding_number > 0.0


@dataclass(frozen=True)
class Gas(_Checked):
    """The isothermal ideal gas around the bearing."""

    viscosity: float = _number(
        ("Viscosity", "μ", "µPa s", -6), 1.85e-5, "Pa s", 1e-6, 1e-3, "dynamic viscosity"
    )
    ambient_pressure: float = _number(
        ("Ambient pressure", "p_a", "bar", 5), 101325.0, "Pa", 1e3, 1e8, "ambient pressure p_a"
    )


@dataclass(frozen=True)
class Rotor(_Checked):
    """Disc and journal on an elastic shaft; the rotor mass itself is an operating parameter."""

    shaft_stiffness: float = _number(
        ("Shaft stiffness", "K_s", "N/µm", 6),
        5.0e7,
        "N/m",
        1e3,
        1e12,
        "shaft stiffness (inf: rigid rotor)",
        infinite=True,
    )
    journal_mass_fraction: float = _number(
        ("Journal's share of the mass", "μ_j", "%", -2),
        0.2,
        "",
        0.01,
        0.99,
        "share of the rotor mass that rides in the journal",
    )
    unbalance_eccentricity: float = _number(
        ("Unbalance eccentricity", "e_u", "µm", -6),
        13e-6,
        "m",
        0.0,
        1e-3,
        "eccentricity of the disc's mass centre",
    )
    gravity: float = _number(
        ("Gravity", "g", "m/s²", 0), 9.81, "m/s2", 0.0, 1e3, "gravity, along -Y"
    )
    transverse_inertia: float = _number(
        ("Transverse inertia", "I_t", "kg m²", 0),
        0.0,
        "kg m2",
        0.0,
        1e5,
        "moment of inertia of the whole rotor about an axis across, through its centre (0: conical "
        "motion is not judged)",
        later=True,
    )
    polar_inertia: float = _number(
        ("Polar inertia", "I_p", "kg m²", 0),
        0.0,
        "kg m2",
        0.0,
        1e5,
        "moment of inertia of the whole rotor about its axis",
        later=True,
    )
    axial_load: float = _number(
        ("Axial load", "F_z", "N", 0),
        0.0,
        "N",
        -1e6,
        1e6,
        "axial load on one bearing, along +z of a sphere",
        later=True,
    )
    axial_motion: bool = _choice(
        ("Axial motion", "", "", 0),
        (False, True),
        "whether the journal of a sphere moves along the axis, or is held at its static axial "
        "position",
    )
    span: float = _number(
        ("Span", "2a", "mm", -3),
        0.0,
        "m",
        0.0,
        100.0,
        "distance between the centres of the two bearings",
        later=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.transverse_inertia > 0.0 and not self.span > 0.0:
            raise DesignError(
                f"rotor.span = {self.span:g} m is out of range for rotor.transverse_inertia = "
                f"{self.transverse_inertia:g} kg m2: conical motion needs the distance between the "
                "bearings, more than 0; give it first"
            )
        if self.transverse_inertia > 0.0 and self.polar_inertia > 2.0 * self.transverse_inertia:
            raise DesignError(
                f"rotor.polar_inertia = {self.polar_inertia:g} kg m2 is out of range: allowed is "
                f"at most twice the transverse one, {2.0 * self.transverse_inertia:g} kg m2, which "
                "a thin disc has"
            )

    @property
    def conical(self) -> bool:
        """Whether its conical motion can be judged."""
        return self.transverse_inertia > 0.0


@dataclass(frozen=True)
class Contact(_Checked):
    """Exponential asperity law of the wall."""

    force_at_closure: float = _number(
        ("Contact force at closure", "f₀", "p_a R²", 0),
        100.0,
        "",
        0.0,
        1e6,
        "contact force at e = 1, over p_a R2",
    )
    roughness: float = _number(
        ("Roughness length", "s", "C", 0),
        0.02,
        "",
        1e-3,
        0.1,
        "roughness length over the clearance",
    )
    friction: float = _number(
        ("Friction coefficient", "μ_f", "", 0), 0.1, "", 0.0, 2.0, "friction coefficient"
    )
    damping: float = _number(
        ("Contact damping", "d", "", 0),
        0.5,
        "",
        0.0,
        100.0,
        "contact damping, per dimensionless radial speed",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        at_centre = self.force_at_closure * math.exp(-1.0 / self.roughness)
        if at_centre > 1e-9:
            raise DesignError(
                f"contact.roughness = {self.roughness:g} is out of range for "
                f"contact.force_at_closure = {self.force_at_closure:g}: the contact force at the "
                f"centre, f0 exp(-1/s), would be {at_centre:.2g}; allowed is at most 1e-09"
            )


@dataclass(frozen=True)
class Design:
    """A complete design.

    Attributes
    ----------
    bearing, gas, rotor, contact : Bearing, Gas, Rotor, Contact
        The four parts, in SI units.
    name, notes : str
        What the designer calls it, and what is to be remembered; they change no number, so designs
        that differ in them alone are equal, and files of results do not hold them.

    Notes
    -----
    The dimensionless groups follow docs/model.md.
    """

    bearing: Bearing = field(default_factory=Bearing)
    gas: Gas = field(default_factory=Gas)
    rotor: Rotor = field(default_factory=Rotor)
    contact: Contact = field(default_factory=Contact)
    name: str = field(default="", compare=False)
    notes: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.bearing.cylindrical and self.rotor.axial_load:
            raise DesignError(
                f"rotor.axial_load = {self.rotor.axial_load:g} N is not allowed with a cylinder, "
                "which carries no load along its axis: set it to 0, or take a sphere"
            )
        if self.bearing.cylindrical and self.rotor.axial_motion:
            raise DesignError(
                "rotor.axial_motion = true is not allowed with a cylinder, whose film does not "
                "feel it: set it to false, or take a sphere"
            )
        if self.bearing.cylindrical and self.rotor.conical:
            raise DesignError(
                f"rotor.transverse_inertia = {self.rotor.transverse_inertia:g} kg m2 is not "
                "allowed with a cylinder, whose film feels the tilt of a conical motion, which is "
                "not modelled: set it to 0, or take a sphere"
            )

    @property
    def force_unit(self) -> float:
        """Unit of force p_a R², in N."""
        return self.gas.ambient_pressure * self.bearing.radius**2

    @property
    def feeding_number(self) -> float:
        """Porous feeding number beta of the bulk (:class:`Bearing`)."""
        return self.bearing.feeding_number

    def sigma_wall(self, bearing_number: float) -> float:
        """sigma_w = phi mu omega H_p² / (kappa p_a): how slowly a pressure wave passes the wall, in
        shaft radians; 0 where the wall stores no gas (docs/model.md).
        """
        b, g = self.bearing, self.gas
        if not b.stores_gas:
            return 0.0
        viscous = b.porosity * g.viscosity * self.speed(bearing_number)
        return viscous / b.permeability * (b.wall_thickness / g.ambient_pressure) * b.wall_thickness

    @property
    def shaft_stiffness_number(self) -> float:
        """K = K_s C / (p_a R²); inf for a rigid rotor."""
        return self.rotor.shaft_stiffness * self.bearing.clearance / self.force_unit

    @property
    def unbalance_number(self) -> float:
        """rho = e_u / C."""
        return self.rotor.unbalance_eccentricity / self.bearing.clearance

    @property
    def rigid(self) -> bool:
        """Whether disc and journal move as one."""
        return math.isinf(self.rotor.shaft_stiffness)

    def speed(self, bearing_number: float) -> float:
        """Shaft speed omega in rad/s at the bearing number Lambda = (6 mu omega / p_a) (R/C)²."""
        b, g = self.bearing, self.gas
        return (
            bearing_number
            * g.ambient_pressure
            / (6.0 * g.viscosity)
            * (b.clearance / b.radius) ** 2
        )

    def speed_rpm(self, bearing_number: float) -> float:
        """Shaft speed in revolutions per minute."""
        return to_rpm(self.speed(bearing_number))

    def bearing_number(self, speed: float) -> float:
        """Bearing number Lambda at the shaft speed omega in rad/s."""
        return speed / self.speed(1.0)

    def mass_number(self, rotor_mass: float, bearing_number: float) -> float:
        """M = m_r C omega² / (p_a R²), ``rotor_mass`` in kg on one bearing."""
        return (
            rotor_mass * self.bearing.clearance * self.speed(bearing_number) ** 2 / self.force_unit
        )

    def load_number(self, rotor_mass: float) -> float:
        """W = m_r g / (p_a R²), ``rotor_mass`` in kg on one bearing."""
        return rotor_mass * self.rotor.gravity / self.force_unit

    @property
    def axial_load_number(self) -> float:
        """W_z over p_a R², of the load on one bearing along +z."""
        return self.rotor.axial_load / self.force_unit

    @property
    def stiffness_unit(self) -> float:
        """Unit of stiffness p_a R² / C, in N/m."""
        return self.force_unit / self.bearing.clearance

    def replace(self, **changes: Value) -> Design:
        """A copy with values changed, named ``section__field`` (``bearing__clearance=30e-6``).

        Raises
        ------
        DesignError
            For a name that does not exist, a value out of range, or one that says nothing about
            the new design (the length of a sphere).
        """
        parts: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            section, _, key = name.partition("__")
            if section not in _SECTIONS or key not in {f.name for f in fields(_SECTIONS[section])}:
                raise DesignError(f"there is no design value {name!r}")
            parts.setdefault(section, {})[key] = value
        changed = {s: dataclasses.replace(getattr(self, s), **v) for s, v in parts.items()}
        for section, part in changed.items():
            _check_used(part, parts[section])
        return dataclasses.replace(self, **changed)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Nested plain dictionary, section by section, as in the TOML file; without values that say
        nothing about this design (the length of a sphere).
        """
        return {
            section: {
                f.name: getattr(part, f.name) for f in fields(part) if f.name not in part.unused
            }
            for section in _SECTIONS
            for part in (getattr(self, section),)
        }

    def told(self) -> dict[str, dict[str, Any]]:
        """:meth:`to_dict` without the values that came later and are at their default: what a hash
        of the design is made of, so that one from before such a value stays as it was.
        """
        said = self.to_dict()
        for section, cls in _SECTIONS.items():
            for f in fields(cls):
                if f.metadata["later"] and said[section].get(f.name) == f.default:
                    del said[section][f.name]
        return said

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Design:
        """Build from nested dictionaries, and texts ``name`` and ``notes``; values left out take
        those of the reference design.

        Raises
        ------
        DesignError
            For a section or key that does not exist, or a value out of range.
        """
        if not isinstance(data, dict):
            raise DesignError("a design must have the sections " + ", ".join(_SECTIONS))
        parts: dict[str, Any] = {}
        for section, values in data.items():
            if section in _TEXTS:
                parts[section] = _text(section, values)
                continue
            if section not in _SECTIONS:
                raise DesignError(
                    f"unknown section {str(section)[:60]!r}: allowed are {', '.join(_SECTIONS)}, "
                    f"and the texts {' and '.join(_TEXTS)}"
                    f"{slips.near(str(section)[:60], _SECTIONS)}"
                )
            known = [f.name for f in fields(_SECTIONS[section])]
            if not isinstance(values, dict):
                raise DesignError(f"[{section}] must be a section with the keys {', '.join(known)}")
            for key in values:
                if key not in known:
                    raise DesignError(
                        f"unknown key {str(key)[:60]!r} in [{section}]: allowed are "
                        f"{', '.join(known)}{slips.near(str(key)[:60], known)}"
                    )
            parts[section] = _SECTIONS[section](**values)
            _check_used(parts[section], values)
        return cls(**parts)


def _check_used(part: Any, given: Collection[str]) -> None:
    """Raise :class:`DesignError` if a value was given that says nothing about the part."""
    for name in sorted(part.unused & set(given)):
        other = SPHERE if part.cylindrical else CYLINDER
        raise DesignError(
            f'{_dotted(part, name)} belongs to a {other}, and bearing.shape is "{part.shape}": '
            f'leave it out, or set bearing.shape = "{other}"'
        )


def _text(key: str, value: object) -> str:
    """Return a name or notes; a section becomes a line for each of its keys."""
    if isinstance(value, dict):
        value = "\n".join(f"{name}: {text}" for name, text in value.items())
    if not isinstance(value, str) or (key == "name" and "\n" in value):
        raise DesignError(
            f"{key} = {str(value)[:60]!r} must be a text in quotes, a name in one line"
        )
    return value.strip()


_TEXTS = ("name", "notes")  # above the sections
_SECTIONS: dict[str, Any] = {"bearing": Bearing, "gas": Gas, "rotor": Rotor, "contact": Contact}
# tomllib takes time and memory by the square of a dotted key's length: 0.4 GB for this one
MAX_DESIGN_BYTES = 20_000


def _check_length(content: str | bytes) -> None:
    if len(content) > MAX_DESIGN_BYTES:
        raise DesignError(f"it has more than {MAX_DESIGN_BYTES:,} bytes, the most that are allowed")


def file_values(data: str | bytes) -> dict[str, Any]:
    """Return all that a design file holds, unchecked; raise :class:`DesignError` for a text that is
    too long or no TOML.
    """
    text = data if isinstance(data, str) else _decoded(data)
    _check_length(text)
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # of a number of thousands of digits too
        hint = slips.syntax_hint(text, str(error))
        raise DesignError(f"not a TOML file: {error}{hint and f'; {hint}'}") from None


def _parse(text: str) -> tuple[dict[str, Any], Design]:
    """Return the values that a TOML text gives, and their design."""
    values = file_values(text)
    values.pop(TOLERANCES, None)  # read by spab_core.design.tolerances
    if not any(values.get(section) for section in values if section not in _TEXTS):
        raise DesignError(
            "it is empty: not one value of a design is in it; spab design new writes a file to "
            "start from"
        )
    try:
        return values, Design.from_dict(values)
    except DesignError as error:
        hint = _value_hint(values, str(error))
        raise DesignError(f"{error}{hint and f'; {hint}'}") from None


def parse_design(text: str) -> Design:
    """Read a design from TOML text (docs/model.md).

    Raises :class:`DesignError`, also for a text that is too long or gives no value.
    """
    return _parse(text)[1]


def _numbers(values: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Yield ``section.key``, value and metadata of each number of a design that is there."""
    for section, part in _SECTIONS.items():
        inside = values.get(section)
        for f in fields(part):
            if isinstance(inside, dict) and f.name in inside and "low" in f.metadata:
                yield f"{section}.{f.name}", inside[f.name], f.metadata


def _value_hint(values: dict[str, Any], message: str) -> str:
    """What the value that a message refuses was meant as."""
    for key, value, meta in _numbers(values):
        if message.startswith(f"{key} "):
            low, high = meta["low"], meta["high"]
            if isinstance(value, str):
                return slips.text_hint(key, value, low, high)
            if isinstance(value, (int, float)) and abs(value) < 1e300 and not low <= value <= high:
                return slips.meant(key, float(value), low, high)
    return ""


def design_doubts(design: Design) -> list[str]:
    """What looks like a slip of unit in a design, in sentences (:mod:`spab_core.design.slips`)."""
    numbers = list(_numbers(design.to_dict()))
    return slips.doubts(
        {key: value for key, value, _ in numbers}, {key: meta["unit"] for key, _, meta in numbers}
    )


def left_out(data: str | bytes) -> list[str]:
    """The numbers that a design file leaves to the reference design, as ``section.key``; without
    those that came later and do nothing at their default.

    Raises :class:`DesignError` as :func:`read_design_bytes`.
    """
    given, design = _parse(data if isinstance(data, str) else _decoded(data))
    there = {key for key, _, _ in _numbers(given)}
    return [key for key, _, _ in _numbers(design.told()) if key not in there]


def design_remarks(data: str | bytes) -> list[str]:
    """What to know about a design file that can be read, in sentences: which values it leaves to
    the reference design, what looks like a slip of unit.

    Raises :class:`DesignError` as :func:`read_design_bytes`.
    """
    design, lacking = _parse(data if isinstance(data, str) else _decoded(data))[1], left_out(data)
    told = [
        f"{key} = {value:g}{' ' if meta['unit'] else ''}{meta['unit']}"
        for key, value, meta in _numbers(design.to_dict())
        if key in lacking
    ]
    words = f"of the reference design, since the file does not give them: {', '.join(told)}"
    return ([words] if told else []) + design_doubts(design)


def _decoded(data: bytes) -> str:
    _check_length(data)
    try:
        marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return data.decode("utf-16" if marked else "utf-8")
    except UnicodeDecodeError:
        raise DesignError("not a text file in UTF-8: save it again with that encoding") from None


def read_design_bytes(data: bytes, name: str = "file") -> Design:
    """The design in the bytes of a TOML file, an upload for instance.

    Raises
    ------
    DesignError
        One sentence with the file's name: too large, no text, no TOML, or a wrong value.
    """
    try:
        return parse_design(_decoded(data))
    except InputError as error:
        raise DesignError(f"design file {name[:100]!r}: {error}") from None


def design_file(path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of a design file, no more than may be in one.

    Raises :class:`DesignError` where it cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(MAX_DESIGN_BYTES + 1)
    except (OSError, ValueError) as error:  # a null byte in the path
        raise DesignError(
            f"cannot read the design file {str(path)[:200]!r}: "
            f"{getattr(error, 'strerror', None) or error}"
        ) from None


def load_design(path: str | os.PathLike[str]) -> Design:
    """Read a design file; log a warning of each remark about it (:func:`design_remarks`).

    Raises :class:`DesignError` as :func:`read_design_bytes`, and where the file cannot be read.
    """
    data = design_file(path)
    design = read_design_bytes(data, str(path))
    for remark in design_remarks(data):
        logging.getLogger(__name__).warning("design file %r: %s", str(path)[:200], remark)
    return design


def design_toml(design: Design) -> str:
    """The design as TOML text, with units; :func:`parse_design` gives the same design back."""
    lines = [f"{key} = {_quoted(getattr(design, key))}" for key in _TEXTS if getattr(design, key)]
    lines += [""] if lines else []
    for section, values in design.to_dict().items():
        meta = {f.name: f.metadata for f in fields(_SECTIONS[section])}
        lines.append(f"[{section}]")
        lines += [
            f"{key} = {_toml(value)}  # "
            f"{(meta[key]['unit'] + ', ') if meta[key]['unit'] else ''}{meta[key]['text']}"
            for key, value in values.items()
        ]
        lines.append("")
    return "\n".join(lines)


def _quoted(text: str) -> str:
    """Return a TOML string: that of JSON, but for one letter."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _toml(value: Value) -> str:
    if isinstance(value, str):
        return _quoted(value)
    return json.dumps(value) if isinstance(value, bool) else repr(value)


def save_design(design: Design, path: str | os.PathLike[str]) -> None:
    """Write the design as TOML, atomically."""
    write_atomically(path, design_toml(design).encode())


def reference_design() -> Design:
    """The reference design "SPAB-60" (docs/model.md)."""
    return parse_design(
        resources.files("spab_core").joinpath("design/data/spab60.toml").read_text("utf-8")
    )
