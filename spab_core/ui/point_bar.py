"""The bar of inputs, the same on every page that asks for an operating point."""

from __future__ import annotations

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.common.errors import InputError
from spab_core.common.validation import check_number
from spab_core.design.form import AMBIENT, FIELDS, SUPPLY, to_form
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design, reference_design
from spab_core.trajectory.assessment import (
    DEFAULT_LIMITS,
    ECCENTRICITIES,
    LEAST_FILMS,
    ORBITS,
    SEPARATIONS,
)
from spab_core.ui.design_form import take_design
from spab_core.ui.view import (
    EXAMPLE,
    NAME_LENGTH,
    PRESSURES,
    chosen_design,
    chosen_limits,
    chosen_point,
    design_words,
    is_reference,
    is_typed,
    note_live,
    note_typed,
    set_speed,
    show_value,
    supply_below,
    supply_range,
    tell,
    view_value,
)

_WIDTH = 150  # of a field, pixels
LIMIT_FIELDS = {  # label, ends, step and help by the key in the view
    "least_film": (
        "Least film, µm",
        LEAST_FILMS,
        0.5,
        "A thinner one is to be avoided. 0: the larger of 3 µm and five roughness lengths",
    ),
    "max_eccentricity": (
        "Largest eccentricity, over C",
        ECCENTRICITIES,
        0.05,
        "A larger one is to be avoided",
    ),
    "calm_eccentricity": (
        "Calm eccentricity, over C",
        (0.0, 1.0),
        0.05,
        "A larger one is to be watched; at most the largest eccentricity",
    ),
    "max_orbit": (
        "Largest orbit, over C",
        ORBITS,
        0.05,
        "Of a whirl that does not repeat every revolution: a larger one is to be avoided; of one "
        "that does: to be watched",
    ),
    "separation": (
        "Separation from resonance",
        SEPARATIONS,
        0.1,
        "Of a lightly damped vibration from the shaft speed, in times the margin of API 617; 0: "
        "not judged",
    ),
}


def _speeds(design: Design) -> tuple[float, float]:
    low, high = BEARING_NUMBER_RANGE
    return design.speed_rpm(low), design.speed_rpm(high)


def _refused(key: str, what: str, low: float, high: float, unit: str = "") -> bool:
    """Whether a typed number is out of range; it is told then and the field has its last number."""
    state = st.session_state
    try:
        if is_typed(key):
            check_number(what, state[key], low, high, unit)
    except InputError as error:
        kept = view_value(key)
        if kept is None:  # shown anew from what is in the view
            state.pop(key)
        else:
            state[key] = kept
        tell(f"{error}. The value before it is kept.")
        return True
    return False


def _keep_in_range(key: str, what: str, low: float, high: float, unit: str = "") -> None:
    _refused(key, what, low, high, unit)


def _speed_typed(design: Design) -> None:
    state = st.session_state
    if is_typed("rpm") and not _refused("rpm", "shaft speed", *_speeds(design), "rpm"):
        set_speed(design, state["rotor_mass"], state["rpm"])


def _supply_typed() -> None:
    state, design = st.session_state, chosen_design()
    given = f"bar {state['supply_as']}"
    ends = supply_range(design)
    if not is_typed("supply") or _refused("supply", "supply pressure", *ends, given):
        return
    ratio = (state["supply"] + supply_below(design)) / to_form(design)[AMBIENT]
    field = FIELDS[SUPPLY]
    take_design(design.replace(**{SUPPLY: min(max(ratio, field.low), field.high)}))
    note_typed([SUPPLY])


def example_line() -> None:
    """Say on a page about the example bearing that the chosen point and design are not its
    subject, and what they are, in the order of :func:`point_bar`.
    """
    mass, number = chosen_point()
    st.markdown(
        f":small[This page is about the **{EXAMPLE}**. The chosen point is kept: {mass:.4g} kg, "
        f"{chosen_design().speed_rpm(number):,.0f} rpm, Λ {number:.4g}, {design_words()}.]"
    )


def point_bar(*, of_example: bool = False) -> DeltaGenerator:
    """Show rotor mass, shaft speed, bearing number, supply pressure and the design's name in a row.

    The values are those of the view (:func:`spab_core.ui.view.chosen_point`).

    Parameters
    ----------
    of_example : bool
        The page is about the example bearing: its speeds, no supply and name of another design.

    Returns
    -------
    DeltaGenerator
        The row, for what a page asks besides.
    """
    state, design = st.session_state, reference_design() if of_example else chosen_design()
    slowest, fastest = _speeds(design)
    speed = float(f"{design.speed_rpm(state['bearing_number']):.6g}")
    show_value("rpm", min(max(speed, slowest), fastest))
    row = st.container(horizontal=True, vertical_alignment="bottom", key="point_bar")
    row.number_input(
        "Rotor mass, kg",
        value=None,
        key="rotor_mass",
        on_change=_keep_in_range,
        args=("rotor_mass", "rotor mass", *ROTOR_MASS_RANGE, "kg"),
        step=0.1,
        format="%.3f",
        width=_WIDTH,
        help="What one bearing carries of the rotor's mass: half of it where two equal bearings "
        "carry it",
    )
    row.number_input(
        "Shaft speed, rpm",
        value=None,
        key="rpm",
        step=100.0,
        format="%.0f",
        width=_WIDTH,
        on_change=_speed_typed,
        args=(design,),
        help=f"The same as Λ, of the {EXAMPLE if of_example else 'chosen design'}",
    )
    row.number_input(
        "Bearing number Λ",
        value=None,
        key="bearing_number",
        on_change=_keep_in_range,
        args=("bearing_number", "bearing number", *BEARING_NUMBER_RANGE),
        step=0.05,
        format="%.3f",
        width=_WIDTH,
        help="(6 μ ω / p_a)(R/C)²: shaft speed, dimensionless",
    )
    if of_example:
        kept = "" if is_reference() else f" Your own design is kept: {design_words()}."
        row.markdown(f":small[This page is about the **{EXAMPLE}**.{kept}]", width="content")
        note_live(("rotor_mass", "bearing_number"))
        return row
    low, high = supply_range(design)
    shown = float(f"{to_form(design)[SUPPLY] - supply_below(design):.6g}")
    show_value("supply", min(max(shown, low), high))
    gauge = state["supply_as"] == PRESSURES[0]
    row.number_input(
        f"Supply, bar {state['supply_as']}",
        value=None,
        key="supply",
        step=0.1,
        format="%.3f",
        width=_WIDTH,
        on_change=_supply_typed,
        help="Of the chamber behind the porous wall; "
        + (
            "0 is open to ambient. Gauge: over the ambient pressure"
            if gauge
            else "the ambient pressure is open to ambient. Absolute: over vacuum"
        )
        + f", {to_form(design)[AMBIENT]:.6g} bar",
    )
    row.segmented_control(
        "Supply given as",
        PRESSURES,
        key="supply_as",
        required=True,
        help="Gauge: over the ambient pressure. Absolute: over vacuum",
    )
    row.text_input(
        "Name of the design",
        key="name",
        max_chars=NAME_LENGTH,
        width=210,
        placeholder=EXAMPLE if is_reference() else "own design",
    )
    with row.popover("Limits", icon=":material/rule:"):
        _limit_fields()
    if chosen_limits() != DEFAULT_LIMITS:
        row.markdown(":small[Judged by limits of your own.]", width="content")
    note_live(("rotor_mass", "bearing_number", "supply_as", "name", *LIMIT_FIELDS))
    return row


def _limit_fields() -> None:
    """What the designer calls good."""
    st.caption("By which every motion on these pages is judged.")
    for key, (label, ends, step, text) in LIMIT_FIELDS.items():
        st.number_input(label, *ends, None, key=key, step=step, format="%.6g", help=text)
