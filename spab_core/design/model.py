"""A rotor on spherical porous gas bearings, in SI units: what the designer draws, checked, and its
dimensionless groups.

The unit of every dimensionless quantity: lengths over the radial clearance C, pressures over the
ambient pressure p_a, forces over p_a R², time as the shaft angle tau = omega t. See docs/model.md.
"""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

from spab_core.common.errors import DesignError, InputError
from spab_core.common.files import write_atomically
from spab_core.common.units import to_rpm
from spab_core.common.validation import check_number

MAX_FEEDING_NUMBER = 1e6  # far below, the wall holds the whole film at the supply pressure


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
) -> Any:
    """A dataclass field with its unit and allowed range, read by :meth:`_Checked.__post_init__` and
    by :mod:`spab_core.design.form`.

    ``form``: label, symbol, form unit, and the power of ten that is one form unit in SI.
    """
    metadata = {
        "form": form,
        "unit": unit,
        "low": low,
        "high": high,
        "text": text,
        "infinite": infinite,
        "open_low": open_low,
    }
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class _Checked:
    def __post_init__(self) -> None:
        for f in fields(self):
            m = f.metadata
            number = check_number(
                f"{type(self).__name__.lower()}.{f.name}",
                getattr(self, f.name),
                m["low"],
                m["high"],
                m["unit"],
                infinite=m["infinite"],
                open_low=m["open_low"],
            )
            object.__setattr__(self, f.name, number)


@dataclass(frozen=True)
class Bearing(_Checked):
    """The spherical band |latitude| <= edge_latitude and its porous wall.

    Real ones leave room to the limits: clearances of 3 to 100 µm on radii of 5 to 300 mm, walls of
    carbon or bronze of 1 to 20 mm with permeabilities of 1e-16 to 1e-12 m2, feeding numbers of 0.01
    to 1e4."""

    radius: float = _number(
        ("Sphere radius", "R", "mm", -3), 0.060, "m", 1e-3, 1.0, "sphere radius R"
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

    def __post_init__(self) -> None:
        super().__post_init__()
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

    @property
    def feeding_number(self) -> float:
        """Porous feeding number beta = 6 kappa R² / (H_p C³)."""
        return 6.0 * self.permeability * self.radius**2 / (self.wall_thickness * self.clearance**3)


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

    Notes
    -----
    The dimensionless groups follow docs/model.md.
    """

    bearing: Bearing = field(default_factory=Bearing)
    gas: Gas = field(default_factory=Gas)
    rotor: Rotor = field(default_factory=Rotor)
    contact: Contact = field(default_factory=Contact)

    @property
    def force_unit(self) -> float:
        """Unit of force p_a R², in N."""
        return self.gas.ambient_pressure * self.bearing.radius**2

    @property
    def feeding_number(self) -> float:
        """Porous feeding number beta (:class:`Bearing`)."""
        return self.bearing.feeding_number

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
    def stiffness_unit(self) -> float:
        """Unit of stiffness p_a R² / C, in N/m."""
        return self.force_unit / self.bearing.clearance

    def replace(self, **changes: float) -> Design:
        """A copy with values changed, named ``section__field`` (``bearing__clearance=30e-6``)."""
        parts: dict[str, dict[str, float]] = {}
        for name, value in changes.items():
            section, _, key = name.partition("__")
            if section not in _SECTIONS or key not in {f.name for f in fields(_SECTIONS[section])}:
                raise DesignError(f"there is no design value {name!r}")
            parts.setdefault(section, {})[key] = value
        return dataclasses.replace(
            self, **{s: dataclasses.replace(getattr(self, s), **v) for s, v in parts.items()}
        )

    def to_dict(self) -> dict[str, dict[str, float]]:
        """Nested plain dictionary, section by section, as in the TOML file."""
        return {section: dataclasses.asdict(getattr(self, section)) for section in _SECTIONS}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Design:
        """Build from nested dictionaries; values left out take those of the reference design.

        Raises
        ------
        DesignError
            For a section or key that does not exist, or a value out of range.
        """
        if not isinstance(data, dict):
            raise DesignError("a design must have the sections " + ", ".join(_SECTIONS))
        parts = {}
        for section, values in data.items():
            if section not in _SECTIONS:
                raise DesignError(
                    f"unknown section {str(section)[:60]!r}: allowed are {', '.join(_SECTIONS)}"
                )
            known = [f.name for f in fields(_SECTIONS[section])]
            if not isinstance(values, dict):
                raise DesignError(f"[{section}] must be a section with the keys {', '.join(known)}")
            for key in values:
                if key not in known:
                    raise DesignError(
                        f"unknown key {str(key)[:60]!r} in [{section}]: allowed are "
                        f"{', '.join(known)}"
                    )
            parts[section] = _SECTIONS[section](**values)
        return cls(**parts)


_SECTIONS = {"bearing": Bearing, "gas": Gas, "rotor": Rotor, "contact": Contact}
# tomllib takes time and memory by the square of a dotted key's length: 0.4 GB for this one
MAX_DESIGN_BYTES = 20_000


def _check_length(content: str | bytes) -> None:
    if len(content) > MAX_DESIGN_BYTES:
        raise DesignError(f"it has more than {MAX_DESIGN_BYTES:,} bytes, the most that are allowed")


def parse_design(text: str) -> Design:
    """Read a design from TOML text (docs/model.md).

    Raises :class:`DesignError`, also for a text that is too long.
    """
    _check_length(text)
    try:
        return Design.from_dict(tomllib.loads(text))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise DesignError(f"not a TOML file: {error}") from None


def read_design_bytes(data: bytes, name: str = "file") -> Design:
    """The design in the bytes of a TOML file, an upload for instance.

    Raises
    ------
    DesignError
        One sentence with the file's name: too large, no text, no TOML, or a wrong value.
    """
    try:
        _check_length(data)
        return parse_design(data.decode("utf-8-sig"))  # Windows' editors may begin with a mark
    except UnicodeDecodeError:
        raise DesignError(f"design file {name[:100]!r}: not a text file in UTF-8") from None
    except InputError as error:
        raise DesignError(f"design file {name[:100]!r}: {error}") from None


def load_design(path: str | os.PathLike[str]) -> Design:
    """Read a design file.

    Raises :class:`DesignError` as :func:`read_design_bytes`, and where the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_DESIGN_BYTES + 1)
    except (OSError, ValueError) as error:  # a null byte in the path
        raise DesignError(
            f"cannot read the design file {str(path)[:200]!r}: "
            f"{getattr(error, 'strerror', None) or error}"
        ) from None
    return read_design_bytes(data, str(path))


def design_toml(design: Design) -> str:
    """The design as TOML text, with units; :func:`parse_design` gives the same design back."""
    lines = []
    for section, values in design.to_dict().items():
        meta = {f.name: f.metadata for f in fields(_SECTIONS[section])}
        lines.append(f"[{section}]")
        lines += [
            f"{key} = {value!r}  # "
            f"{(meta[key]['unit'] + ', ') if meta[key]['unit'] else ''}{meta[key]['text']}"
            for key, value in values.items()
        ]
        lines.append("")
    return "\n".join(lines)


def save_design(design: Design, path: str | os.PathLike[str]) -> None:
    """Write the design as TOML, atomically."""
    write_atomically(path, design_toml(design).encode())


def reference_design() -> Design:
    """The reference design "SPAB-60" (docs/model.md)."""
    return parse_design(
        resources.files("spab_core").joinpath("design/data/spab60.toml").read_text("utf-8")
    )
