"""What follows a user through all pages and stands in the address: the chosen point, the design, model and fraction.

Every key of :data:`VIEW` is a key of ``st.session_state``, and a widget may have it as its own. :func:`open_view` begins each
run (``page_head`` calls it): it reads the address once in a session, keeps the values across pages, writes the address anew.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import streamlit as st

from spab_core.bifurcation import SWEEPS, VARY
from spab_core.design import Design, InputError, check_number, reference_design
from spab_core.figures_lines import COORDINATES
from spab_core.figures_map import LAYERS
from spab_core.film import DEFAULT_MESH, SCHEMES, parse_mesh
from spab_core.form import FIELDS, to_form
from spab_core.integrate import METHODS
from spab_core.simulate import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.surrogates import DIVISORS, MODELS

LINES = ("paper", *VARY)  # of the page of lines: the paper's two, or one through the chosen point
_LONGEST = 100  # characters of a value in the address that are looked at


@dataclass(frozen=True)
class Field:
    """One value of the view: what it is without a word in the address, and how a text becomes a checked value."""

    default: Any
    read: Callable[[str], Any]  # raises InputError
    write: Callable[[Any], str] = str


def _one_of(name: str, allowed) -> Callable[[str], Any]:
    by_text = {str(a): a for a in allowed}

    def read(text: str):
        if text not in by_text:
            raise InputError(f"{name} = {text!r} is not allowed: choose {', '.join(by_text)}")
        return by_text[text]
    return read


def _number(name: str, low: float, high: float, unit: str = "", whole: bool = False) -> Callable[[str], float]:
    def read(text: str):
        try:
            value = int(text) if whole else float(text)
        except ValueError:
            raise InputError(f"{name} = {text!r} is not a {'whole ' if whole else ''}number") from None
        check_number(name, value, low, high, unit)
        return value
    return read


def _some_of(name: str, allowed) -> Callable[[str], Any]:
    one = _one_of(name, allowed)
    return lambda text: [one(word) for word in text.split(",")]


def _mesh(text: str) -> str:
    return str(parse_mesh(text))


POINT_TABS = ("Overview", "Orbits", "Spectrum", "Signals", "Film 3-D", "Forces", "Exponent")
SAME = ("bearing number", "speed")  # that two designs are compared at

VIEW: dict[str, Field] = {
    "bearing_number": Field(3.45, _number("bearing_number", *BEARING_NUMBER_RANGE), "{:.6g}".format),
    "rotor_mass": Field(4.52, _number("rotor_mass", *ROTOR_MASS_RANGE, "kg"), "{:.6g}".format),
    "layer": Field(LAYERS[0], _one_of("layer", LAYERS)),
    "model": Field("theory-trees", _one_of("model", MODELS)),
    "divisor": Field(8, _one_of("divisor", DIVISORS)),
    "draw": Field(0, _number("draw", 0, 999, whole=True)),
    "method": Field(METHODS[0], _one_of("method", METHODS)),
    "mesh": Field(str(DEFAULT_MESH), _mesh),
    "scheme": Field(SCHEMES[0], _one_of("scheme", SCHEMES)),
    "transient": Field(200, _number("transient", 0, 5000, "revolutions", whole=True)),
    "line": Field(LINES[0], _one_of("line", LINES)),
    "mass_from": Field(0.1, _number("mass_from", *ROTOR_MASS_RANGE, "kg"), "{:.6g}".format),
    "mass_to": Field(25.0, _number("mass_to", *ROTOR_MASS_RANGE, "kg"), "{:.6g}".format),
    "number_from": Field(0.05, _number("number_from", *BEARING_NUMBER_RANGE), "{:.6g}".format),
    "number_to": Field(8.5, _number("number_to", *BEARING_NUMBER_RANGE), "{:.6g}".format),
    "points": Field(200, _number("points", 2, 2000, whole=True)),
    "sweeps": Field(["cold"], _some_of("sweeps", SWEEPS), ",".join),
    "coordinates": Field(["X2", "Y2"], _some_of("coordinates", COORDINATES), ",".join),
    "revolutions": Field(200, _number("revolutions", 20, 5000, "revolutions", whole=True)),
    "tab": Field(POINT_TABS[0], _one_of("tab", POINT_TABS)),
    "compare": Field(False, _one_of("compare", (True, False))),
    "same": Field(SAME[0], _one_of("same", SAME)),
}
_DESIGN = "_design"  # values of the design that differ from the reference, {"bearing.clearance": 3e-5}


def open_view() -> list[str]:
    """Begin a run: read the address where the session is new, keep the values, write the address.

    Returns
    -------
    list of str
        What was wrong in the address, in sentences; such values take their defaults.
    """
    state = st.session_state
    complaints: list[str] = []
    if _DESIGN not in state:  # a new session
        complaints = _read_address()
    for key, entry in VIEW.items():
        # a widget's value is dropped on a page that does not show it unless it is set anew; an emptied widget has None
        value = state.get(key)
        state[key] = entry.default if value is None else value
    wanted = {key: entry.write(state[key]) for key, entry in VIEW.items() if state[key] != entry.default}
    wanted |= {key: repr(value) for key, value in state[_DESIGN].items()}
    if st.query_params.to_dict() != wanted:
        st.query_params.from_dict(wanted)
    return complaints


def _read_address() -> list[str]:
    state, complaints = st.session_state, []
    changes: dict[str, float] = {}
    for key, raw in st.query_params.to_dict().items():
        text = raw[:_LONGEST]
        try:
            if key in VIEW:
                state.setdefault(key, VIEW[key].read(text))
            elif key in _design_fields():
                changes[key] = _float(key, text)
            else:
                complaints.append(f"The address has an unknown value {key[:_LONGEST]!r}; it is left out.")
        except InputError as error:
            complaints.append(f"In the address: {error}. The usual value is taken.")
    state[_DESIGN] = {}
    try:
        set_design(_changed(changes))
    except InputError as error:
        complaints.append(f"In the address: {error}. The reference design is taken.")
    return complaints


def _float(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{name} = {text!r} is not a number") from None


def _design_fields() -> list[str]:
    return [f"{part.name}.{f.name}" for part in fields(Design) for f in fields(getattr(reference_design(), part.name))]


def _changed(changes: dict[str, float]) -> Design:
    """The reference design with values by their dotted names changed."""
    return reference_design().replace(**{key.replace(".", "__"): value for key, value in changes.items()})


def chosen_design() -> Design:
    """The design that the user works on."""
    return _changed(st.session_state.get(_DESIGN, {}))


def is_reference() -> bool:
    """Whether that is the reference design, whose map is shipped."""
    return not st.session_state.get(_DESIGN)


def set_design(design: Design) -> None:
    """Make this the design that the user works on; it stands in the address from the next run on."""
    usual = reference_design().to_dict()
    st.session_state[_DESIGN] = {f"{part}.{key}": value for part, values in dataclasses.asdict(design).items()
                                 for key, value in values.items() if value != usual[part][key]}


def set_point(rotor_mass: float, bearing_number: float) -> None:
    """Make this the chosen operating point; call it in a widget's callback, before the widgets of the next run."""
    st.session_state["rotor_mass"] = float(f"{rotor_mass:.6g}")
    st.session_state["bearing_number"] = float(f"{bearing_number:.6g}")


def design_words() -> str:
    """The chosen design in a few words: the reference, or what differs from it."""
    changes = st.session_state.get(_DESIGN, {})
    if not changes:
        return "reference bearing SPAB-60"
    values = to_form(chosen_design())
    taken = [(FIELDS[key.replace(".", "__")], values[key.replace(".", "__")]) for key in list(changes)[:3]]
    shown = ", ".join(f"{f.label.lower()} {'rigid' if math.isinf(v) else f'{v:.4g} {f.unit}'.strip()}" for f, v in taken)
    return f"own design ({shown}{', …' if len(changes) > 3 else ''})"


def point_options() -> str:
    """The chosen point as options of the command line."""
    state = st.session_state
    return f"--rotor-mass {state['rotor_mass']:.6g} --bearing-number {state['bearing_number']:.6g}"


def design_option() -> str:
    """The chosen design as an option of the command line: "" for the reference, else a file the user has to download."""
    return "" if is_reference() else " --design my.toml"
