"""Designs to start from: files in ``data/``, each with an operating point to look at first."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

from spab_core.common.errors import InputError
from spab_core.design.model import Design, parse_design
from spab_core.design.slips import near


@dataclass(frozen=True)
class Preset:
    """A design that comes with spab.

    Attributes
    ----------
    name : str
        As the command line takes it; its file is ``data/NAME.toml``.
    label, text : str
        What it is, in two words and in a sentence.
    rotor_mass : float
        kg on one bearing, of the point to look at first.
    speed_rpm : float
        Likewise.
    """

    name: str
    label: str
    text: str
    rotor_mass: float
    speed_rpm: float

    @property
    def design(self) -> Design:
        """The design, read from its file."""
        return parse_design(
            resources.files("spab_core")
            .joinpath(f"design/data/{self.name}.toml")
            .read_text("utf-8")
        )


PRESETS = {
    p.name: p
    for p in (
        Preset(
            "spab60",
            "SPAB-60, reference",
            "Self-acting, R 60 mm: the design of the shipped map, with all regimes in its plane",
            4.52,
            10_000.0,
        ),
        Preset(
            "fed_spindle",
            "Fed porous spindle",
            "R 40 mm fed with 6.1 bar absolute through bare porous carbon, whose pores store gas: "
            "pneumatic hammer from 1.6 kg on",
            4.0,
            20_000.0,
        ),
        Preset(
            "fed_spindle_layered",
            "Fed spindle, layered",
            "The same spindle and the same gas flow through a thin layer of low permeability on "
            "the wall: stiff and light, whirl only at high speed or mass",
            4.0,
            20_000.0,
        ),
        Preset(
            "small_high_speed",
            "Small high-speed",
            "R 10 mm fed with 4.1 bar absolute through bare porous carbon, a rotor of 50 g at "
            "60,000 rpm: pneumatic hammer from 29 g on",
            0.05,
            60_000.0,
        ),
        Preset(
            "small_high_speed_layered",
            "Small high-speed, layered",
            "The same rotor and the same gas flow through a thin layer of low permeability on the "
            "wall: no hammer",
            0.05,
            60_000.0,
        ),
        Preset(
            "carbon_bushing",
            "Porous carbon bushing",
            "A cylinder as it is sold: 50 mm bore, 89 mm long, fed with 4.1 bar absolute, gap 8 µm",
            3.0,
            10_000.0,
        ),
        Preset(
            "rigid_balanced",
            "Rigid balanced",
            "R 60 mm fed with 5.1 bar absolute through bare porous carbon, rigid and without "
            "unbalance: what linear theory treats exactly; pneumatic hammer from 7.1 kg on",
            5.0,
            15_000.0,
        ),
        Preset(
            "rigid_balanced_layered",
            "Rigid balanced, layered",
            "The same rotor and the same gas flow through a thin layer of low permeability on the "
            "wall: no hammer",
            5.0,
            15_000.0,
        ),
    )
}


def preset(name: str) -> Preset:
    """The preset of that name. Raises :class:`InputError` with the names there are."""
    if name not in PRESETS:
        raise InputError(
            f"there is no preset {str(name)[:60]!r}: allowed are {', '.join(PRESETS)}"
            f"{near(str(name), PRESETS)}"
        )
    return PRESETS[name]
