"""The design as a form on a page; what is typed becomes the design that the user works on
(:mod:`spab_core.ui.view`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.common.errors import InputError
from spab_core.common.words import capital
from spab_core.design.form import (
    AMBIENT,
    FIELDS,
    GRADE_RANGE,
    GROUPS,
    SUPPLY,
    FormField,
    contact_words,
    eccentricity_of_grade,
    from_form,
    grade_of_eccentricity,
    to_form,
    unused,
)
from spab_core.design.model import (
    Design,
    design_doubts,
    design_remarks,
    design_toml,
    left_out,
    read_design_bytes,
    reference_design,
)
from spab_core.design.presets import PRESETS
from spab_core.design.tolerances import parse_list, read_tolerances, tolerances_toml
from spab_core.ui.downloads import file_button
from spab_core.ui.view import (
    NAME_LENGTH,
    chosen_design,
    chosen_point,
    note_typed,
    set_design,
    set_speed,
    show_tolerances,
    show_value,
    supply_below,
)

_USUAL = to_form(reference_design())
_STIFFNESS, _UNBALANCE = "rotor__shaft_stiffness", "rotor__unbalance_eccentricity"
MACHINE = ("bearing__radius", "bearing__clearance", _UNBALANCE, _STIFFNESS)
UNBALANCE_AS = ("eccentricity", "grade G")


def _key(name: str) -> str:
    return f"my_{name}"


def _digits(value: float, digits: int = 6) -> float:
    """As it is shown: six digits survive the way to the bearing number and back."""
    return float(f"{value:.{digits}g}")


def _fill(design: Design) -> None:
    """Put a design into the widgets."""
    state = st.session_state
    for name, value in to_form(design).items():
        endless = not FIELDS[name].choices and math.isinf(value)
        state[_key(name)] = _USUAL[name] if endless else value
    state["my_rigid"] = design.rigid
    state["my_filled"], state["my_error"] = design, None


def _fill_grade(design: Design) -> None:
    """Put the balance grade of a design into its widgets, by default at the chosen speed."""
    state = st.session_state
    if state.get("my_grade_of") == design and "my_grade" in state and "my_grade_rpm" in state:
        return
    if state.get("my_grade_rpm") is None:
        # the bearing number of a typed speed has six digits: those of the speed are five
        state["my_grade_rpm"] = _digits(design.speed_rpm(state["bearing_number"]), 5)
    rotor = design.rotor
    state["my_grade"] = _digits(
        grade_of_eccentricity(
            rotor.unbalance_eccentricity, state["my_grade_rpm"], rotor.journal_mass_fraction
        )
    )
    state["my_grade_of"] = design


def take_design(
    design: Design, rotor_mass: float | None = None, speed_rpm: float | None = None
) -> None:
    """Make it the design that the user works on, in a widget's callback.

    The machine keeps its mass and speed where none are given: the bearing number follows.
    """
    mass, number = chosen_point()
    speed = chosen_design().speed_rpm(number) if speed_rpm is None else speed_rpm
    set_design(design)
    set_speed(design, mass if rotor_mass is None else rotor_mass, speed)
    st.session_state["my_error"] = None


def _typed(name: str = "") -> None:
    """Something in the form changed: the field of this name."""
    state, base = st.session_state, chosen_design()
    filled = to_form(state["my_filled"]) if "my_filled" in state else {}
    # of the fields that a page shows, those typed since they were filled: the design may have
    # changed elsewhere
    values = {
        key: state[_key(key)]
        for key in FIELDS
        if _key(key) in state and (key == name or state[_key(key)] != filled.get(key))
    }
    if state.get("my_rigid", base.rigid):
        values[_STIFFNESS] = math.inf
    fed = base.bearing.supply_pressure_ratio > 1.0
    if name == AMBIENT and fed and values.get(AMBIENT) is not None:
        # the supply stays what it was given as, over the ambient pressure or absolute
        below = supply_below(base)
        values[SUPPLY] = to_form(base)[SUPPLY] - below + (values[AMBIENT] if below else 0.0)
    try:
        for key, value in values.items():
            if value is None:
                raise InputError(
                    f"{FIELDS[key].label} {FIELDS[key].symbol} is empty: type a number"
                )
        design = from_form(values, base)
    except InputError as error:
        state["my_error"] = str(error)
        return
    take_design(design)
    if name == AMBIENT and _key(SUPPLY) in state:
        state[_key(SUPPLY)] = to_form(design)[SUPPLY]
    note_typed([name] if name else [])
    state["my_filled"] = design  # what is typed stays as it was typed


def _grade_typed() -> None:
    state, base = st.session_state, chosen_design()
    try:
        if state["my_grade"] is None or state["my_grade_rpm"] is None:
            raise InputError(
                "the balance grade needs two numbers: G, and the speed it is stated for"
            )
        design = base.replace(
            rotor__unbalance_eccentricity=_digits(
                eccentricity_of_grade(
                    state["my_grade"], state["my_grade_rpm"], base.rotor.journal_mass_fraction
                )
            )
        )
    except InputError as error:
        state["my_error"] = str(error)
        return
    take_design(design)
    note_typed([_UNBALANCE])
    state["my_grade_of"] = design


def _preset_chosen() -> None:
    chosen = PRESETS.get(st.session_state["my_preset"])
    if chosen is not None:
        st.session_state["my_notes"] = ""
        show_value("name", "")
        take_design(chosen.design, chosen.rotor_mass, chosen.speed_rpm)
        note_typed(FIELDS, anew=True)


def _back_to_example() -> None:
    take_design(reference_design())
    note_typed((), anew=True)


def _uploaded() -> None:
    state = st.session_state
    if state["my_file"] is None:
        return
    try:
        data = state["my_file"].getvalue()
        design = read_design_bytes(data, state["my_file"].name)
        tolerances = read_tolerances(data, state["my_file"].name)
    except InputError as error:
        state["my_error"] = str(error)
        return
    take_design(design)
    lacking = {key.replace(".", "__") for key in left_out(data)}
    note_typed((name for name in FIELDS if name not in lacking), anew=True)
    state["my_remarks"] = design, design_remarks(data)
    if tolerances:
        show_tolerances(tolerances)
    state["my_notes"] = design.notes
    show_value("name", design.name[:NAME_LENGTH])


def _field(place: DeltaGenerator, field: FormField, **options: Any) -> None:
    """Show the widget of a value; one that says nothing about the design is disabled."""
    usual = _USUAL[field.name]
    shared: dict[str, Any] = {
        "key": _key(field.name),
        "on_change": _typed,
        "args": (field.name,),
        "help": field.help,
        "disabled": field.name in unused(chosen_design()),
    } | options
    if field.choices == (False, True):
        place.checkbox(field.title, **shared)
    elif field.choices:
        place.segmented_control(field.title, field.choices, required=True, **shared)
    else:
        place.number_input(
            field.title,
            value=None,
            format="%g",
            step=10.0 ** (math.floor(math.log10(usual or 1.0)) - 1),
            **shared,
        )


def _rotor_fields() -> None:
    fields = {f.name: f for f in FIELDS.values() if f.group == "Rotor"}
    left, right = st.columns(2)
    _field(left, fields[_STIFFNESS], disabled=st.session_state["my_rigid"])
    right.checkbox(
        "Rigid shaft",
        key="my_rigid",
        on_change=_typed,
        args=(_STIFFNESS,),
        help="Disc and journal move as one",
    )
    how = st.segmented_control(
        "Unbalance given as",
        UNBALANCE_AS,
        default=UNBALANCE_AS[0],
        key="my_unbalance_as",
        help="ISO 21940-11: G = e_per ω in mm/s, e_per the residual unbalance over the mass of the "
        "whole rotor. Only the disc is unbalanced here: e_u = G / (ω (1 - μ_j))",
    )
    left, right = st.columns(2)
    if how == UNBALANCE_AS[1]:
        left.number_input(
            "Balance quality grade G, mm/s",
            value=None,
            key="my_grade",
            format="%g",
            step=0.1,
            on_change=_grade_typed,
            help=f"From {GRADE_RANGE[0]:g} to {GRADE_RANGE[1]:g} mm/s; spindles 0.4 to "
            "2.5, turbines 2.5",
        )
        right.number_input(
            "at the speed, rpm",
            value=None,
            key="my_grade_rpm",
            format="%g",
            step=100.0,
            on_change=_grade_typed,
        )
        st.caption(f"e_u = {1e6 * chosen_design().rotor.unbalance_eccentricity:.4g} µm")
    else:
        _field(left, fields[_UNBALANCE])
    rest = [name for name in fields if name not in (_STIFFNESS, _UNBALANCE)]
    columns = st.columns(2)
    for k, name in enumerate(rest):
        _field(columns[k % 2], fields[name])


def _prepare(names: Iterable[str]) -> None:
    """Fill the fields of these names where they do not hold the design; tell what was wrong."""
    state, design = st.session_state, chosen_design()
    if (
        state.get("my_filled") != design
        or any(_key(name) not in state for name in names)
        or "my_rigid" not in state
    ):
        _fill(design)
    if error := state["my_error"]:
        st.error(f"{capital(error)}. The design stays as it was.")


def machine_fields(row: DeltaGenerator) -> None:
    """Show what a designer has at hand besides the operating point, in a row."""
    _prepare(MACHINE)
    for name in MACHINE:
        rigid = name == _STIFFNESS and st.session_state["my_rigid"]
        _field(row, FIELDS[name], width=172, disabled=rigid)


def design_fields() -> None:
    """Show every value of the design in the units of a drawing; a wrong value is told and changes
    nothing.
    """
    _prepare(FIELDS)
    _fill_grade(chosen_design())
    of, remarks = st.session_state.get("my_remarks", (None, []))
    design = chosen_design()
    for remark in remarks if of == design else design_doubts(design):
        st.warning(f"{capital(remark)}.")
    for tab, group in zip(st.tabs(list(GROUPS)), GROUPS, strict=True):
        with tab:
            if group == "Rotor":
                _rotor_fields()
                continue
            columns = st.columns(2)
            fields = [f for f in FIELDS.values() if f.group == group]
            for k, field in enumerate(sorted(fields, key=lambda f: not f.choices)):
                _field(columns[k % 2], field)
            if group == "Contact":
                st.caption(f"{contact_words(design)}.")


def design_popover() -> None:
    """Show the design's values, and a button back to the reference bearing, behind a button."""
    with st.popover("Design", icon=":material/tune:"):
        design_fields()
        st.button(
            "Back to the example bearing",
            on_click=_back_to_example,
            key="design_reset",
        )


def design_files() -> None:
    """Presets to start from, design files to open and save."""
    state, design = st.session_state, chosen_design()
    # the preset's name stays there only as long as it is that design
    st.session_state["my_preset"] = next(
        (name for name, p in PRESETS.items() if p.design == design), None
    )
    st.selectbox(
        "Start from",
        list(PRESETS),
        key="my_preset",
        on_change=_preset_chosen,
        placeholder="own design",
        format_func=lambda name: PRESETS[name].label,
        index=None,
        help="  \n".join(f"{p.label}: {p.text}." for p in PRESETS.values()),
    )
    st.file_uploader(
        "Design file, TOML", type="toml", key="my_file", on_change=_uploaded, max_upload_size=1
    )
    file_button(
        "Save this design as TOML",
        design_toml(
            dataclasses.replace(design, name=state.get("name", ""), notes=state.get("my_notes", ""))
        )
        + tolerances_toml(parse_list(state["tolerances"])),
        "my.toml",
        "my_save",
        icon=":material/download:",
    )
