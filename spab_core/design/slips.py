"""Likely slips in a design: another unit than the file's, a decimal comma, a diametral clearance.

Nothing here refuses a value; it says in a sentence what may have been meant.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping

# usual values in the unit of the file, and what one of another unit is in it; a value outside the
# usual range is doubted. Keys that are not listed are not looked at.
USUAL: dict[str, tuple[float, float, dict[str, float]]] = {
    "bearing.radius": (0.003, 0.3, {"mm": 1e-3, "cm": 1e-2}),
    "bearing.length": (0.003, 0.6, {"mm": 1e-3, "cm": 1e-2}),
    "bearing.clearance": (2e-6, 2e-4, {"µm": 1e-6, "mm": 1e-3, "mil (0.001 inch)": 2.54e-5}),
    "bearing.edge_latitude": (5.0, 89.5, {"radians": 180.0 / math.pi}),
    "bearing.permeability": (0.0, 1e-11, {"10⁻¹⁵ m²": 1e-15, "darcy": 9.869233e-13}),
    "bearing.wall_thickness": (5e-4, 0.03, {"mm": 1e-3, "cm": 1e-2}),
    "bearing.porosity": (0.0, 0.6, {"%": 1e-2}),
    "bearing.layer_permeability": (0.0, 1e-11, {"10⁻¹⁵ m²": 1e-15}),
    "bearing.layer_thickness": (0.0, 2e-3, {"mm": 1e-3, "µm": 1e-6}),
    "bearing.supply_pressure_ratio": (
        1.0,
        20.0,
        {"Pa": 1.0 / 101325.0, "mbar": 1.0 / 1013.25, "kPa": 1.0 / 101.325},
    ),
    "gas.viscosity": (
        5e-6,
        1e-4,
        {"mPa s (cP)": 1e-3, "10⁻⁵ Pa s": 1e-5, "µPa s": 1e-6},
    ),
    "gas.ambient_pressure": (
        2e4,
        2e6,
        {
            "mbar (hPa)": 1e2,
            "bar": 1e5,
            "kPa": 1e3,
            "MPa": 1e6,
            "mmHg (Torr)": 133.322,
            "psi": 6894.757,
        },
    ),
    "rotor.shaft_stiffness": (1e5, 1e11, {"N/µm": 1e6, "N/mm": 1e3}),
    "rotor.journal_mass_fraction": (0.01, 0.99, {"%": 1e-2}),
    "rotor.unbalance_eccentricity": (0.0, 1e-4, {"mm": 1e-3, "µm": 1e-6}),
    "rotor.gravity": (0.0, 20.0, {"cm/s²": 1e-2, "mm/s²": 1e-3, "g": 9.80665}),
    "rotor.span": (0.0, 10.0, {"mm": 1e-3}),
    "rotor.transverse_inertia": (0.0, 100.0, {"kg cm²": 1e-4, "kg mm²": 1e-6}),
    "rotor.polar_inertia": (0.0, 100.0, {"kg cm²": 1e-4, "kg mm²": 1e-6}),
    "contact.roughness": (1e-3, 0.1, {"%": 1e-2}),
}
LARGEST_CLEARANCE = 1.1e-3  # radial, over the radius; bearings of this kind have 0.3e-3 to 1e-3
_TYPICAL = {"gas.ambient_pressure": 101325.0, "bearing.permeability": 3e-15}
_RATIO = "bearing.supply_pressure_ratio"
_SPELLINGS = {  # of a unit behind a number, in lower case
    **dict.fromkeys(("um", "µm", "micron", "microns", "mikrometer"), 1e-6),
    "mm": 1e-3,
    "cm": 1e-2,
    **dict.fromkeys(("m", "pa", "n/m", "deg", "°", "pa s", "pa*s", "m2", "m²", "m^2"), 1.0),
    "bar": 1e5,
    **dict.fromkeys(("mbar", "hpa"), 1e2),
    "kpa": 1e3,
    "rad": 180.0 / math.pi,
    "%": 1e-2,
    **dict.fromkeys(("n/um", "n/µm"), 1e6),
    "n/mm": 1e3,
    "cp": 1e-3,
}
_NUMBER = r"[+-]?\d*[.,]?\d+(?:[eE][+-]?\d+)?"


def meant(key: str, value: float, low: float = -math.inf, high: float = math.inf) -> str:
    """What a value was meant as, if another unit makes it a usual one from ``low`` to ``high``.

    Parameters
    ----------
    key : str
        ``section.key`` of a design file.
    value : float
        As it is in the file.

    Returns
    -------
    str
        Such as "if that is in mm, write 0.04"; "" where nothing is known.
    """
    if key not in USUAL or not math.isfinite(value):
        return ""
    least, most, units = USUAL[key]
    digits = max(3, len(re.sub(r"e.*|\D", "", repr(value)).strip("0")))
    order = list(units.items())
    if key in _TYPICAL and value > 0.0:  # the unit that comes nearest to it
        order.sort(key=lambda unit: abs(math.log(value * unit[1] / _TYPICAL[key])))
    for unit, factor in order:
        if value and max(least, low) <= value * factor <= min(most, high):
            return f"if that is in {unit}, write {value * factor:.{digits}g}"
    return ""


def doubts(values: Mapping[str, float], units: Mapping[str, str]) -> list[str]:
    """Return what looks like a slip, in sentences without a full stop.

    Parameters
    ----------
    values : mapping
        Values of a whole design by ``section.key``, in the units of the file.
    units : mapping
        Those units.
    """
    found = []
    for key, (least, most, _) in USUAL.items():
        value = values.get(key)
        if value is None or least <= value <= most or not math.isfinite(value):
            continue
        unit = f" {units[key]}" if units.get(key) else ""
        said = f"{key} = {value:g}{unit} is unusual (usual: {least:g} to {most:g}{unit})"
        if key == _RATIO and value < 1.0:
            said = (
                f"{key} = {value:g} is suction: it is the absolute supply pressure over the "
                "ambient one; if that is in MPa over ambient, write "
                f"{_ratio(values, value * 1e6):.4g}, if in bar over ambient, "
                f"{_ratio(values, value * 1e5):.4g}"
            )
        elif hint := meant(key, value):
            said += f": {hint}"
        found.append(said)
    radius, clearance = values.get("bearing.radius"), values.get("bearing.clearance")
    if radius and clearance and clearance > LARGEST_CLEARANCE * radius and not found:
        found.append(
            f"bearing.clearance = {clearance:g} m is 1/{radius / clearance:.0f} of the radius, "
            "more than usual (1/1000): it is the radial clearance; if that is the diametral one, "
            f"write {0.5 * clearance:g}"
        )
    return found


def _ratio(values: Mapping[str, float], gauge: float) -> float:
    ambient = values.get("gas.ambient_pressure", 101325.0)
    return 1.0 + gauge / ambient


def near(word: str, allowed: Iterable[str]) -> str:
    """Return "; is X meant?" for the allowed word that is nearest, if one is near."""
    found = difflib.get_close_matches(word.lower(), list(allowed), 1, 0.75)
    return f"; is {found[0]} meant?" if found else ""


def text_hint(key: str, text: str, low: float, high: float) -> str:
    """What a text in place of a number was meant as; "" where it does not tell.

    Parameters
    ----------
    key : str
        ``section.key``.
    text : str
        Such as "25 um".
    low, high : float
        Allowed range.
    """
    if text.strip().lower() in ("rigid", "inf", "infinity", "starr") and high >= 1e6:
        return "for a rigid shaft write inf, without quotes"
    found = re.fullmatch(rf"\s*({_NUMBER})\s*(.*?)\s*", text)
    if not found:
        return ""
    value, unit = float(found[1].replace(",", ".")), found[2].replace("μ", "µ").strip("[]()")
    if not unit:
        return f"write {found[1].replace(',', '.')}, without quotes"
    # MPa and mPa differ by nothing but a capital letter
    bare = re.sub(r"[ *·.]", "", unit)
    if bare.lower() in ("cst", "mm2/s", "mm²/s", "m2/s", "m²/s"):
        return "that is a kinematic viscosity: write the dynamic one, in Pa s (air: 1.8e-5)"
    factor = {"MPa": 1e6, "mPas": 1e-3, "µPas": 1e-6, "uPas": 1e-6, "Pas": 1.0}.get(bare)
    factor = _SPELLINGS.get(unit.lower()) if factor is None else factor
    if factor is None or not low <= value * factor <= high:
        return "write the number alone, in the unit of the file"
    return f"write {value * factor:.6g}, the number alone"


_GROUPED = r"[+-]?\d{1,3}([ '’]\d{3})+(\.\d*)?|[+-]?\d{1,3}(,\d{3})+\.\d*"
_POWER = r"([+-]?[\d.]+)\s*[×x*·]\s*10\s*(?:\^|\*\*)\s*([+-]?\d+)"
_VALUE_HINTS: tuple[tuple[str, Callable[[re.Match[str]], str]], ...] = (
    (
        rf"({_NUMBER})\s*[;,]",
        lambda m: f"nothing stands behind the number: {m[1].replace(',', '.')}",
    ),
    (
        _GROUPED,
        lambda m: f"thousands are not separated: {re.sub('[^0-9.+-]', '', m[0])}",
    ),
    (_POWER, lambda m: f"powers of ten are written with e: {m[1]}e{m[2]}"),
    (
        r"[+-]?\d+,\d+([eE][+-]?\d+)?",
        lambda m: f"the decimal sign is a point: {m[0].replace(',', '.')}",
    ),
    (
        r"[+-]?\.\d+([eE][+-]?\d+)?",
        lambda m: f"a digit is missing before the point: {m[0].replace('.', '0.', 1)}",
    ),
    (
        r"[+-]?\d+\.([eE][+-]?\d+)?",
        lambda m: f"a digit is missing behind the point: {m[0].replace('.', '.0', 1)}",
    ),
    (
        r"[+-]?[\d.]+[dD][+-]?\d+",
        lambda m: f"the exponent begins with e: {re.sub('[dD]', 'e', m[0])}",
    ),
    (
        r"[+-]?0\d+(\.\d+)?",
        lambda m: f"a number does not begin with 0: {m[0].lstrip('+0') or '0'}",
    ),
    (
        rf"{_NUMBER}\s*[^\W\d_%°²].*|{_NUMBER}\s*[%°].*",
        lambda _: "the number stands alone, in the unit of the file (m, deg, Pa, Pa s, N/m)",
    ),
    (r"[A-Za-z ]+", lambda _: "a value is a number; inf is a rigid shaft"),
)
_LINE_HINTS = (
    (r"^\s*(//|;|%|!)", "a comment begins with #"),
    (
        "[\u00a0\u2007\u202f\u2009]",
        "the line has a blank of another kind (non-breaking): type it again",
    ),
    ("[“”„‘]", 'a text stands in straight quotes, "…"'),
    ("\u2212", "the minus sign is not that of a keyboard"),
    ("^[^=]+:[^=]*$", "a value is given as key = value"),
)


def syntax_hint(text: str, message: str) -> str:
    """What is wrong with the line of a TOML text that a parser's message names, and what to write;
    "" where it is nothing known.
    """
    for begin, what in (("{", "it is JSON"), ("PK", "it is a workbook or a ZIP archive")):
        if text.lstrip().startswith(begin):
            return what
    found = re.search(r"at line (\d+)", message)
    lines = text.split("\n")
    if not found or not 1 <= int(found[1]) <= len(lines):
        return ""
    line = lines[int(found[1]) - 1].split("#")[0]
    if "Cannot declare" in message:
        return "the section stands twice"
    for pattern, words in _LINE_HINTS:
        if re.search(pattern, line):
            return words
    key, _, value = (part.strip() for part in line.partition("="))
    if "overwrite" in message:
        return f"{key} stands twice, or as a value and a section"
    for pattern, hint in _VALUE_HINTS:
        if match := re.fullmatch(pattern, value):
            return hint(match)
    return ""
