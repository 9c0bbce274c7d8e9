"""Cached answers about the bearing that the user works on."""

from __future__ import annotations

from functools import partial

import numpy as np
import streamlit as st

from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import Design
from spab_core.linear_theory.coefficients import (
    LEAST_STABLE,
    Coefficients,
    coefficients,
    coefficients_over_speed,
    impedance,
)
from spab_core.linear_theory.ross_table import coefficient_table, table_bytes
from spab_core.linear_theory.summary import Derived, derive

WHIRL_RATIOS = np.linspace(0.0, 2.0, 41)
SPEEDS = np.linspace(0.25, 1.5, 26)  # over the speed of the operating point


@st.cache_resource(max_entries=64, show_spinner=False)
def derived_now(design: Design, rotor_mass: float, bearing_number: float) -> Derived:
    """``derive``, or the answer out of the last 64. Raises ``InputError``."""
    return derive(design, rotor_mass, bearing_number)


@st.cache_resource(max_entries=64, show_spinner=False)
def over_whirl(design: Design, rotor_mass: float, bearing_number: float) -> Coefficients | None:
    """The coefficients against whirl frequency; None where there is no static equilibrium."""
    z = impedance(design, rotor_mass, bearing_number)
    return None if z is None else coefficients(z, WHIRL_RATIOS)


@st.cache_resource(max_entries=64, show_spinner=False)
def over_speed(
    design: Design, rotor_mass: float, bearing_number: float, whirl: float | str
) -> Coefficients:
    """The coefficients against shaft speed, around that of the point; ``whirl`` as in
    ``coefficients_over_speed``.
    """
    return coefficients_over_speed(
        design, rotor_mass, np.clip(bearing_number * SPEEDS, *BEARING_NUMBER_RANGE), whirl
    )


def _speed_file(design, rotor_mass, bearing_number, whirl, form) -> bytes:
    return table_bytes(
        coefficient_table(over_speed(design, rotor_mass, bearing_number, whirl)), form
    )


def _whirl_file(design, rotor_mass, bearing_number) -> bytes:
    found = over_whirl(design, rotor_mass, bearing_number)
    assert found is not None  # the button stands there only where there is an equilibrium
    return table_bytes(coefficient_table(found, "frequency"), ".csv")


def coefficient_downloads(
    design: Design, rotor_mass: float, bearing_number: float, command: str
) -> None:
    """A popover with the tables for ROSS and the command line that writes them; files are made on
    the click.
    """
    point = (design, rotor_mass, bearing_number)
    with st.popover("Tables for ROSS", icon=":material/download:"):
        sheet = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"
        for label, name, whirl in (
            ("Against speed, at the rotor's own whirl: for stability", "whirl", LEAST_STABLE),
            ("Against speed, synchronous: for unbalance response", "synchronous", 1.0),
        ):
            st.download_button(
                label,
                partial(_speed_file, *point, whirl, ".xlsx"),
                f"bearing_{name}.xlsx",
                sheet,
                key=f"ross_{name}",
                on_click="ignore",
                width="stretch",
            )
        st.download_button(
            "Against whirl frequency, at this speed, CSV",
            partial(_whirl_file, *point),
            "bearing_frequency.csv",
            "text/csv",
            key="ross_frequency",
            on_click="ignore",
            width="stretch",
        )
        st.caption(
            "The first two are read by `ross.BearingElement.from_table`. Synchronous coefficients "
            "overrate the "
            "stability of a rotor that whirls at half speed, by a factor of two in speed and "
            "more: use the first."
        )
        st.code(command, language="bash", wrap_lines=True)
