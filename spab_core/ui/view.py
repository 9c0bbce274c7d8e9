"""What follows a user through all pages and stands in the address: the chosen point, the design,
model and fraction.

Every key of :data:`VIEW` is a key of ``st.session_state``, and a widget may have it as its own.
:func:`open_view` begins each run (``page_head`` calls it): it reads the address once in a session,
keeps the values across pages, writes the address anew."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.active_learning.quick_map import SECONDS
from spab_core.cli.options import LIMITS
from spab_core.common.errors import InputError
from spab_core.common.units import from_rpm
from spab_core.common.validation import check_choice, check_number
from spab_core.design.form import (
    AMBIENT,
    FIELDS,
    SUPPLY,
    FormField,
    nearest_bearing_number,
    to_form,
)
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design, Value, reference_design
from spab_core.design.presets import PRESETS
from spab_core.design.tolerances import (
    Tolerances,
    list_text,
    parse_list,
    parse_ranges,
    ranges_text,
)
from spab_core.drawings.improve import WISHES
from spab_core.drawings.tolerance import MACHINES, WANTED
from spab_core.maps.bifurcation import SWEEPS, VARY
from spab_core.maps.sensitivity import AXES, SCAN, STEP, STEPS
from spab_core.maps.stability_map import axis
from spab_core.plotting.lines import COORDINATES
from spab_core.plotting.map import LAYERS, SURROGATE
from spab_core.plotting.point import QUANTITIES
from spab_core.plotting.surrogates import REFINE_LAYERS
from spab_core.shipped.model_store import DEFAULT
from spab_core.shipped.predicted_maps import FIGURE_DIVISORS
from spab_core.solver.film import AUTO, parse_mesh
from spab_core.solver.stepping import METHODS
from spab_core.surrogates.models import DIVISORS, FLOOR, MODELS
from spab_core.trajectory.assessment import (
    DEFAULT_LIMITS,
    ECCENTRICITIES,
    GRADES,
    LEAST_FILMS,
    ORBITS,
    SEPARATIONS,
    Limits,
)

T = TypeVar("T")

EXAMPLE = "example bearing SPAB-60"  # the reference design
LINES = ("paper", *VARY)  # of the page of lines: the paper's two, or one through the chosen point
NAME_LENGTH = 60  # characters
_LONGEST = 100  # characters of a value in the address that are looked at
_LONGEST_LIST = 1000  # of tolerances or ranges


@dataclass(frozen=True)
class Field:
    """One value of the view: what it is without a word in the address, and how a text becomes a
    checked value.
    """

    default: Any
    read: Callable[[str], Any]  # raises InputError
    write: Callable[[Any], str] = str
    longest: int = _LONGEST


def _one_of(name: str, allowed: Iterable[object]) -> Callable[[str], Any]:
    by_text = {str(a): a for a in allowed}

    def read(text: str) -> object:
        check_choice(name, text, by_text)
        return by_text[text]

    return read


def _number(
    name: str, low: float, high: float, unit: str = "", whole: bool = False
) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            value = int(text) if whole else float(text)
        except ValueError:
            raise InputError(
                f"{name} = {text!r} is not a {'whole ' if whole else ''}number"
            ) from None
        check_number(name, value, low, high, unit)
        return value

    return read


def _some_of(name: str, allowed: Iterable[object]) -> Callable[[str], Any]:
    one = _one_of(name, allowed)
    return lambda text: [one(word) for word in text.split(",")]


def _named(name: str, read: Callable[[str], str]) -> Callable[[str], str]:
    """Have an error of ``read`` name the value of the view."""

    def named(text: str) -> str:
        try:
            return read(text)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None

    return named


def _words(text: str) -> str:
    return " ".join(text.split())[:NAME_LENGTH]


def _mesh(text: str) -> str:
    return str(parse_mesh(text))


def _axis(name: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text:
            axis(text, name)
        return text

    return read


POINT_TABS = ("Overview", "Orbits", "Spectrum", "Signals", "Film 3-D", "Forces", "Exponent")
PRESSURES = ("gauge", "absolute")  # that the supply is given as
SAME = ("bearing number", "speed")  # that two designs are compared at
OWN_MINUTES, SCANS, SPEEDS = (0.5, 600.0), (4, 100), (10, 1000)
PROBABILITY = "Probability"  # of the assessment that is told, where it is predicted
OWN_LAYERS = (*(layer for layer in LAYERS if layer != SURROGATE), PROBABILITY)
WHAT_TABS = ("Change the drawing", "Run-up", "Two designs")
DRAW_TABS = ("Tolerances", "A better drawing")
ABOUT_TABS = (
    "Equations and assumptions",
    "Numerics and validation",
    "Results",
    "Where it differs from the paper",
)
DRAWN = (64, 128, 256, 512, 1024, 2048, 4096)  # machines within tolerances
WISH_PAIRS = tuple(f"{a}, {b}" for a in WISHES for b in WISHES if a != b)
METRICS, CELLS = ("rmse", "mae"), ("held_out", "all")
JUDGED = ("unsolved", "withheld")
TARGETS = {"full": None, "floored": FLOOR}  # floors of the exponents that surrogates learn
PAPER_PARTS = ("claims", "lines", "map", "predictions", "tables")
PAPER_MODELS = tuple(name for name, kind in MODELS.items() if kind.group == "paper")
AGAINST = ("whirl frequency", "shaft speed")

VIEW: dict[str, Field] = {
    "bearing_number": Field(
        3.45, _number("bearing_number", *BEARING_NUMBER_RANGE), "{:.6g}".format
    ),
    "rotor_mass": Field(4.52, _number("rotor_mass", *ROTOR_MASS_RANGE, "kg"), "{:.6g}".format),
    "name": Field("", _words),  # of the design
    "project": Field("", _words),  # of the report
    "author": Field("", _words),
    "supply_as": Field(PRESSURES[0], _one_of("supply_as", PRESSURES)),
    # of what is good; 0: the usual film
    "least_film": Field(0.0, _number("least_film", *LEAST_FILMS, "µm"), "{:.6g}".format),
    "max_eccentricity": Field(
        DEFAULT_LIMITS.eccentricity,
        _number("max_eccentricity", *ECCENTRICITIES),
        "{:.6g}".format,
    ),
    "calm_eccentricity": Field(
        DEFAULT_LIMITS.calm_eccentricity,
        _number("calm_eccentricity", 0.0, 1.0),
        "{:.6g}".format,
    ),
    "max_orbit": Field(DEFAULT_LIMITS.orbit, _number("max_orbit", *ORBITS), "{:.6g}".format),
    "separation": Field(
        DEFAULT_LIMITS.separation, _number("separation", *SEPARATIONS), "{:.6g}".format
    ),
    "layer": Field(LAYERS[0], _one_of("layer", LAYERS)),
    "model": Field(DEFAULT[0], _one_of("model", MODELS)),
    "divisor": Field(DEFAULT[1], _one_of("divisor", DIVISORS)),
    "draw": Field(0, _number("draw", 0, 999, whole=True)),
    "method": Field(METHODS[0], _one_of("method", METHODS)),
    "mesh": Field(str(AUTO), _mesh),
    "transient": Field(300, _number("transient", 30, 5000, "revolutions", whole=True)),
    "line": Field(LINES[0], _one_of("line", LINES)),
    # 0: the usual ones of the point (show_usual)
    "mass_from": Field(0.0, _number("mass_from", 0.0, ROTOR_MASS_RANGE[1], "kg"), "{:.6g}".format),
    "mass_to": Field(0.0, _number("mass_to", 0.0, ROTOR_MASS_RANGE[1], "kg"), "{:.6g}".format),
    "number_from": Field(
        0.0, _number("number_from", 0.0, BEARING_NUMBER_RANGE[1]), "{:.6g}".format
    ),
    "number_to": Field(0.0, _number("number_to", 0.0, BEARING_NUMBER_RANGE[1]), "{:.6g}".format),
    "points": Field(200, _number("points", 2, 2000, whole=True)),
    "sweeps": Field(["cold"], _some_of("sweeps", SWEEPS), ",".join),
    "coordinates": Field(["X2", "Y2"], _some_of("coordinates", COORDINATES), ",".join),
    "revolutions": Field(300, _number("revolutions", 20, 5000, "revolutions", whole=True)),
    "tab": Field(POINT_TABS[0], _one_of("tab", POINT_TABS)),
    "compare": Field(False, _one_of("compare", (True, False))),
    "same": Field(SAME[0], _one_of("same", SAME)),
    "film_colour": Field(QUANTITIES[0], _one_of("film_colour", QUANTITIES)),
    "beside": Field(
        False, _one_of("beside", (True, False))
    ),  # the surrogate's prediction is compared at the chosen point
    "sure": Field(False, _one_of("sure", (True, False))),
    "metric": Field(METRICS[0], _one_of("metric", METRICS)),
    "cells": Field(CELLS[0], _one_of("cells", CELLS)),
    "refine_layer": Field(REFINE_LAYERS[0], _one_of("refine_layer", REFINE_LAYERS)),
    "target": Field("full", _one_of("target", TARGETS)),
    "ranked": Field("floored", _one_of("ranked", TARGETS)),
    "paper": Field(PAPER_PARTS[0], _one_of("paper", PAPER_PARTS)),
    "paper_line": Field(VARY[0], _one_of("paper_line", VARY)),
    "paper_model": Field("forest", _one_of("paper_model", PAPER_MODELS)),
    "paper_divisor": Field(8, _one_of("paper_divisor", FIGURE_DIVISORS)),
    "judged": Field(JUDGED[0], _one_of("judged", JUDGED)),
    "against": Field(AGAINST[0], _one_of("against", AGAINST)),
    # "" and 0: the usual ones of the design (show_usual)
    "own_numbers": Field("", _axis("own_numbers")),
    "own_masses": Field("", _axis("own_masses")),
    "own_minutes": Field(
        SECONDS / 60.0, _number("own_minutes", *OWN_MINUTES, "minutes"), "{:.6g}".format
    ),
    "own_layer": Field(OWN_LAYERS[0], _one_of("own_layer", OWN_LAYERS)),
    "what_tab": Field(WHAT_TABS[0], _one_of("what_tab", WHAT_TABS)),
    "what_axis": Field(AXES[0], _one_of("what_axis", AXES)),
    "what_step": Field(
        100.0 * STEP, _number("what_step", 100.0 * STEPS[0], 100.0 * STEPS[1], "%"), "{:.6g}".format
    ),
    "what_scan": Field(SCAN, _number("what_scan", *SCANS, whole=True)),
    "run_from": Field(0.0, _number("run_from", 0.0, 1e9, "rpm"), "{:.6g}".format),
    "run_to": Field(0.0, _number("run_to", 0.0, 1e9, "rpm"), "{:.6g}".format),
    "run_count": Field(100, _number("run_count", *SPEEDS, whole=True)),
    "draw_tab": Field(DRAW_TABS[0], _one_of("draw_tab", DRAW_TABS)),
    "tolerances": Field(
        "", _named("tolerances", lambda text: list_text(parse_list(text))), longest=_LONGEST_LIST
    ),
    "draw_axis": Field(AXES[0], _one_of("draw_axis", AXES)),
    "machines": Field(MACHINES, _one_of("machines", DRAWN)),
    "wanted": Field(100 * WANTED, _number("wanted", 1.0, 99.9, "%"), "{:.6g}".format),
    "ranges": Field(
        "", _named("ranges", lambda text: ranges_text(parse_ranges(text))), longest=_LONGEST_LIST
    ),
    "wish": Field(WISH_PAIRS[0], _one_of("wish", WISH_PAIRS)),
    "worst_grade": Field(GRADES[0], _one_of("worst_grade", GRADES[:2])),
    "most_flow": Field(0.0, _number("most_flow", 0.0, 1e6, "Nl/min"), "{:.6g}".format),
    "least_stiffness": Field(0.0, _number("least_stiffness", 0.0, 1e6, "N/µm"), "{:.6g}".format),
    "held_film": Field(0.0, _number("held_film", 0.0, 1e3, "µm"), "{:.6g}".format),
    "load": Field(1.0, _number("load", 1.0, 100.0), "{:.6g}".format),
    "within": Field(False, _one_of("within", (True, False))),
    "about_tab": Field(ABOUT_TABS[0], _one_of("about_tab", ABOUT_TABS)),
    "two_preset": Field(list(PRESETS)[1], _one_of("two_preset", PRESETS)),
}
_DESIGN = (
    "_design"  # values of the design that differ from the reference, {"bearing.clearance": 3e-5}
)
_SPEED = "rpm"  # in an address that somebody wrote, in place of the bearing number
_SAME_SPEED = 1e-3  # relative: a speed in whole rpm is still that of its bearing number
_OF_PAGE = ("rpm", "supply", "my_filled", "my_grade_of", "my_grade_rpm")  # filled anew on each
_TYPED = "_typed"  # values of the design that the user gave, by their names in the form
_KEPT = "_view"  # all values as they were when the last run of a page began
_WRITTEN = "_written"  # the address of the last run
_TOLD = "_told"  # a sentence for the next page
_PAGE = "_page"
_LIVE = "_live"  # values whose fields the page's last run showed
_FORCED = "_forced"  # fields that are sent to the browser whatever they show, until they are drawn
_SENT = (
    "_sent"  # of fields, {key: (what the browser has, what it is to show)}, until they are drawn
)


def open_view(page: str = "") -> list[str]:
    """Begin a run: read the address where the session is new, keep the values, write the address.

    Parameters
    ----------
    page : str
        Its title.

    Returns
    -------
    list of str
        What was wrong in the address, in sentences, such values take their defaults; and what
        :func:`set_speed` has to say.
    """
    state = st.session_state
    complaints: list[str] = []
    if _DESIGN not in state:  # a new session
        complaints = _read_address()
    if _TOLD in state:
        complaints.append(state.pop(_TOLD))
    kept = state.get(_KEPT, {})
    if state.get(_PAGE) != page:
        state[_PAGE], state[_LIVE], state[_SENT], state[_FORCED] = page, (), {}, ()
        # a widget is of one page: what was set last may still stand under that of the page left,
        # and would be taken for shown here
        for key in _OF_PAGE:
            state.pop(key, None)
    for key, (stale, value) in state[_SENT].items():
        if state.get(key) == stale and key in VIEW:
            state[key] = value
    for key, entry in VIEW.items():
        # Streamlit drops a widget's value on a page that does not show it, also when its last run
        # was that of a fragment, as under a job at work; an emptied widget has None
        value = state.get(key)
        if value is None:
            state[key] = kept.get(key, entry.default)
        elif key not in state[_LIVE]:
            # not where its field stands on the page: what is set goes to the browser, over what the
            # user typed there in the meantime
            state[key] = value
    state[_KEPT] = {key: state[key] for key in VIEW}
    wanted = {
        key: entry.write(state[key]) for key, entry in VIEW.items() if state[key] != entry.default
    }
    wanted |= {
        key: value if isinstance(value, str) else repr(value)
        for key, value in state[_DESIGN].items()
    }
    # the browser may come with an address that it had before the last one reached it
    if st.query_params.to_dict() != wanted or state.get(_WRITTEN, wanted) != wanted:
        st.query_params.from_dict(wanted)
    state[_WRITTEN] = wanted
    return complaints


def tell(words: str) -> None:
    """Have the next run say a sentence above the page, in a widget's callback."""
    st.session_state[_TOLD] = words


def view_value(key: str) -> Any:
    """Return a value of the view as it was when the last run began; None for a key of none."""
    return st.session_state.get(_KEPT, {}).get(key)


def note_live(keys: Iterable[str]) -> None:
    """Keep that the page has drawn the fields of these values, and draws them in each run."""
    state = st.session_state
    state[_LIVE], state[_SENT], state[_FORCED] = tuple(keys), {}, ()


def _read_address() -> list[str]:
    state, complaints = st.session_state, []
    changes: dict[str, Any] = {}
    given = st.query_params.to_dict()
    speed = given.pop(_SPEED, None)
    for key, raw in given.items():
        text = raw[: VIEW[key].longest if key in VIEW else _LONGEST]
        try:
            if key in VIEW:
                state.setdefault(key, VIEW[key].read(text))
            elif key.replace(".", "__") in FIELDS:
                changes[key] = _design_value(key, text)
            else:
                complaints.append(
                    f"The address has an unknown value {key[:_LONGEST]!r}; it is left out."
                )
        except InputError as error:
            complaints.append(f"In the address: {error}. The usual value is taken.")
    state[_DESIGN] = {}
    try:
        set_design(_changed(changes))
    except InputError as error:
        complaints.append(f"In the address: {error}. The reference design is taken.")
    if speed is not None:
        complaints += _read_speed(speed[:_LONGEST], "bearing_number" in given)
    return complaints


def _read_speed(text: str, beside_number: bool) -> list[str]:
    """Take the speed in an address as that of the point, of the design that stands there too; the
    bearing number counts where both are given and differ.
    """
    state, design = st.session_state, chosen_design()
    low, high = (design.speed_rpm(limit) for limit in BEARING_NUMBER_RANGE)
    try:
        rpm = _number(_SPEED, low, high, "rpm")(text)
    except InputError as error:
        return [f"In the address: {error}. The usual value is taken."]
    number = float(f"{nearest_bearing_number(design, rpm):.6g}")
    there = state.setdefault("bearing_number", number)
    if not beside_number or math.isclose(there, number, rel_tol=_SAME_SPEED):
        return []
    return [
        f"In the address: rpm = {rpm:g} and bearing_number = {there:g}, which is "
        f"{design.speed_rpm(there):,.0f} rpm of this design, are two speeds. The bearing number "
        "counts."
    ]


def _design_value(name: str, text: str) -> Value:
    """Read the value of a design with that dotted name: a float, or one of its choices."""
    choices = {str(choice): choice for choice in FIELDS[name.replace(".", "__")].choices}
    if choices:
        check_choice(name, text, choices)
        return choices[text]
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{name} = {text!r} is not a number") from None


def _changed(changes: dict[str, Any]) -> Design:
    """The reference design with values by their dotted names changed."""
    return _design_of(tuple(changes.items()))


@functools.lru_cache(maxsize=32)  # a page asks for it up to 35 times
def _design_of(changes: tuple[tuple[str, Any], ...]) -> Design:
    return reference_design().replace(**{key.replace(".", "__"): value for key, value in changes})


def chosen_design() -> Design:
    """The design that the user works on."""
    return _changed(st.session_state.get(_DESIGN, {}))


def is_reference() -> bool:
    """Whether that is the reference design, whose map is shipped."""
    return not st.session_state.get(_DESIGN)


def set_design(design: Design) -> None:
    """Make this the design that the user works on; the next run writes it to the address."""
    usual = reference_design().to_dict()
    st.session_state[_DESIGN] = {
        f"{part}.{key}": value
        for part, values in design.to_dict().items()
        for key, value in values.items()
        if value != usual[part].get(key)
    }


def set_example() -> None:
    """Make the example bearing at its usual point what the user works on."""
    set_design(reference_design())
    note_typed((), anew=True)
    show_value("name", "")
    set_point(VIEW["rotor_mass"].default, VIEW["bearing_number"].default)


def note_typed(names: Iterable[str], anew: bool = False) -> None:
    """Keep that the user gave these values of the design, by their names in the form; ``anew``: of
    another design, for which nothing given before counts.
    """
    before = frozenset() if anew else st.session_state.get(_TYPED, frozenset())
    st.session_state[_TYPED] = before | set(names)


def assumed_values() -> list[str]:
    """Values of the design that are the reference's because nobody gave others, by their names in
    the form; none of the reference itself.
    """
    state = st.session_state
    changes = {key.replace(".", "__") for key in state.get(_DESIGN, {})}
    if not changes:
        return []
    return [name for name in FIELDS if name not in changes | state.get(_TYPED, frozenset())]


def supply_below(design: Design) -> float:
    """Return what is added to the supply pressure as it is given to have the absolute one, bar."""
    gauge = st.session_state["supply_as"] == PRESSURES[0]
    return to_form(design)[AMBIENT] if gauge else 0.0


def supply_range(design: Design) -> tuple[float, float]:
    """Return the allowed supply pressures as they are given, bar."""
    field, ambient = FIELDS[SUPPLY], to_form(design)[AMBIENT]
    below = supply_below(design)
    return field.low * ambient - below, field.high * ambient - below


def set_point(rotor_mass: float, bearing_number: float) -> None:
    """Make this the chosen operating point; call it in a widget's callback, before the widgets of
    the next run.

    Two quick clicks: the second may come from a browser that does not show the first one's point
    yet, and gets it right after. So the fields are sent even where they seem to show the point.
    """
    st.session_state[_FORCED] = ("rotor_mass", "bearing_number", "rpm")
    show_point(rotor_mass, bearing_number)


def show_point(rotor_mass: float, bearing_number: float) -> None:
    """As :func:`set_point`; of two fields the one that shows its value is let alone."""
    for key, value in (("rotor_mass", rotor_mass), ("bearing_number", bearing_number)):
        show_value(key, float(f"{value:.6g}"))


def show_value(key: str, value: object) -> None:
    """Have a field show a value; one that does is let alone, as the user may be typing there."""
    state = st.session_state
    if (shown := state.get(key)) != value or key in state.get(_FORCED, ()):
        sent = state.setdefault(_SENT, {})
        sent[key] = (sent.get(key, (shown,))[0], value)
        state[key] = value


def is_typed(key: str) -> bool:
    """Whether a field that has changed was changed by the user: a run that ends before the field is
    drawn leaves the browser with the value from before :func:`show_value`.
    """
    state = st.session_state
    return state[key] is not None and state[key] != state.get(_SENT, {}).get(key, (None,))[0]


def chosen_point() -> tuple[float, float]:
    """Rotor mass in kg and bearing number of the chosen operating point."""
    return float(st.session_state["rotor_mass"]), float(st.session_state["bearing_number"])


def _limit_keys() -> list[tuple[str, str, float]]:
    """Key in the view, attribute of :class:`Limits` and what one in the view is there: the options
    of the commands by their names.
    """
    return [(option[2:].replace("-", "_"), name, unit) for option, name, unit, _ in LIMITS]


def chosen_limits() -> Limits:
    """What the user calls good; a calm eccentricity over the largest one is taken as that."""
    given = {
        name: unit * float(st.session_state.get(key, VIEW[key].default))
        for key, name, unit in _limit_keys()
    }
    given["calm_eccentricity"] = min(given["calm_eccentricity"], given["eccentricity"])
    return Limits(given.pop("least_film") or None, **given)


def set_limits(limits: Limits) -> None:
    """Make this what the user calls good; call it in a widget's callback."""
    for key, name, unit in _limit_keys():
        show_value(key, float(f"{(getattr(limits, name) or 0.0) / unit:.6g}"))


def limits_option(limits: Limits) -> str:
    """The options of a command that judges by some limits; "" for the usual ones."""
    told = ""
    for option, attribute, unit, _ in LIMITS:
        value = getattr(limits, attribute)
        if value != getattr(DEFAULT_LIMITS, attribute):
            told += f" {option} {value / unit:.6g}"
    return told


def set_speed(design: Design, rotor_mass: float, speed_rpm: float) -> None:
    """As :func:`set_point`, at a speed; outside the bearing numbers that can be solved the nearest,
    as the next page tells.
    """
    number, (low, high) = design.bearing_number(from_rpm(speed_rpm)), BEARING_NUMBER_RANGE
    nearest = nearest_bearing_number(design, speed_rpm)
    if not math.isclose(number, nearest, rel_tol=1e-5):
        st.session_state[_TOLD] = (
            f"At {speed_rpm:,.0f} rpm the bearing number of this design would be {number:.4g}; "
            "allowed "
            f"is from {low:g} to {high:g}. The speed is now {design.speed_rpm(nearest):,.0f} rpm."
        )
    show_point(rotor_mass, nearest)


def show_usual(key: str, usual: Any, limits: tuple[float, float] | None = None) -> dict[str, Any]:
    """Options of a widget for a value of the view that is usually another one with each design or
    point.

    Parameters
    ----------
    key : str
        Of the view's value, which is "" or 0 as long as the user wants the usual one.
    usual : str or float
    limits : tuple, optional
        Of a number, which move with the design too.

    Returns
    -------
    dict
        ``key`` and ``on_change``: the widget has a key of its own, filled here.
    """
    state, shown = st.session_state, f"{key}_shown"
    state[shown] = state[key] or usual
    if limits:
        state[shown] = min(max(state[shown], limits[0]), limits[1])

    def changed() -> None:
        if state[shown] is not None:  # an emptied field keeps its value
            state[key] = type(usual)() if state[shown] == usual else state[shown]

    return {"key": shown, "on_change": changed}


def number_field(
    label: str, low: float, high: float, *, place: DeltaGenerator | None = None, **options: Any
) -> float:
    """Show a field for a number of the view and return the number.

    ``options`` are those of ``st.number_input``; an emptied field has its last number in the next
    run (:func:`open_view`, :func:`show_usual`).
    """
    show = place.number_input if place else st.number_input
    value = show(label, low, high, None, **options)
    assert value is not None
    return value


def choice(
    label: str, allowed: Sequence[T], *, place: DeltaGenerator | None = None, **options: Any
) -> T:
    """Show a button for each allowed value of the view and return the value of the pressed one.

    ``options`` are those of ``st.segmented_control``.
    """
    show = place.segmented_control if place else st.segmented_control
    value: T | None = show(label, allowed, required=True, **options)
    assert value is not None  # the view has one of them from the start
    return value


def design_words() -> str:
    """The chosen design in a few words: its name, the reference, or what differs from it."""
    changes = st.session_state.get(_DESIGN, {})
    if name := st.session_state.get("name"):
        return str(name)
    if not changes:
        return EXAMPLE
    values = to_form(chosen_design())
    taken = [
        (FIELDS[key.replace(".", "__")], values[key.replace(".", "__")])
        for key in list(changes)[:3]
    ]
    shown = ", ".join(f"{f.label.lower()} {with_unit(f, v)}" for f, v in taken)
    return f"own design ({shown}{', …' if len(changes) > 3 else ''})"


def with_unit(field: FormField, value: Any) -> str:
    """A value of a design in form units, as it is told."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if field.choices:
        return str(value)
    return "rigid" if math.isinf(value) else f"{value:.4g} {field.unit}".strip()


def show_tolerances(tolerances: Tolerances) -> None:
    """Put tolerances into the view, in a widget's callback; their widgets are filled anew."""
    state = st.session_state
    state["tolerances"] = list_text(tolerances)
    for key in [key for key in state if str(key).startswith(("tolerance_", "tolerances_of"))]:
        del state[key]


def point_options() -> str:
    """The chosen point as options of the command line."""
    state = st.session_state
    return f"--rotor-mass {state['rotor_mass']:.6g} --bearing-number {state['bearing_number']:.6g}"


def design_option() -> str:
    """The chosen design as an option of the command line: "" for the reference, else a file the
    user has to download.
    """
    return "" if is_reference() else " --design my.toml"
