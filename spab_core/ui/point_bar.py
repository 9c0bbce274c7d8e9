"""The bar of inputs that every page shows where it asks for an operating point."""

from __future__ import annotations

from typing import Literal

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.ui.view import chosen_design, design_words, set_speed


def _speed_typed() -> None:
    state = st.session_state
    if state["rpm"] is not None:  # an emptied field keeps the speed
        set_speed(chosen_design(), state["rotor_mass"], state["rpm"])


def point_bar(width: int | Literal["stretch"] = 160) -> DeltaGenerator:
    """Show rotor mass, shaft speed, bearing number and the design's name in a row.

    The values are those of the view (:func:`spab_core.ui.view.chosen_point`).

    Parameters
    ----------
    width : int or "stretch"
        Of each field, in pixels.

    Returns
    -------
    DeltaGenerator
        The row, for what a page asks besides.
    """
    state, design = st.session_state, chosen_design()
    slowest, fastest = (design.speed_rpm(limit) for limit in BEARING_NUMBER_RANGE)
    speed = float(f"{design.speed_rpm(state['bearing_number']):.6g}")
    state["rpm"] = min(max(speed, slowest), fastest)
    name = design_words()
    st.markdown(f":small[{name[0].upper()}{name[1:]}]")
    row = st.container(horizontal=True, vertical_alignment="bottom")
    row.number_input(
        "Rotor mass, kg",
        *ROTOR_MASS_RANGE,
        None,
        key="rotor_mass",
        step=0.1,
        format="%.3f",
        width=width,
        help="Whole rotor mass that one bearing carries",
    )
    row.number_input(
        "Shaft speed, rpm",
        slowest,
        fastest,
        None,
        key="rpm",
        step=100.0,
        format="%.0f",
        width=width,
        on_change=_speed_typed,
        help="The same as Λ, of the chosen design",
    )
    row.number_input(
        "Bearing number Λ",
        *BEARING_NUMBER_RANGE,
        None,
        key="bearing_number",
        step=0.05,
        format="%.3f",
        width=width,
        help="(6 μ ω / p_a)(R/C)²: shaft speed, dimensionless",
    )
    return row
