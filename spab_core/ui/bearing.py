"""Cached answers about the bearing that the user works on."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import streamlit as st

from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import Design
from spab_core.linear_theory.coefficients import (
    FILM_WHIRL,
    Coefficients,
    coefficients_over_speed,
    coefficients_over_speed_and_frequency,
    coefficients_over_whirl,
)
from spab_core.linear_theory.held import LoadCurves, load_curves
from spab_core.linear_theory.ross_table import table_bytes
from spab_core.linear_theory.summary import Derived, derive
from spab_core.ui.downloads import file_button

WHIRL_RATIOS = np.linspace(0.0, 2.0, 41)
SPEEDS = np.linspace(0.25, 1.5, 26)  # over the speed of the operating point


@st.cache_resource(max_entries=64, show_spinner=False)
def derived_now(design: Design, rotor_mass: float, bearing_number: float) -> Derived:
    """``derive``, or the answer out of the last 64. Raises ``InputError``."""
    return derive(design, rotor_mass, bearing_number)


@st.cache_resource(max_entries=64, show_spinner=False)
def curves_now(design: Design, bearing_number: float) -> LoadCurves:
    """``load_curves``, or the answer out of the last 64. Raises ``InputError``."""
    return load_curves(design, bearing_number)


@st.cache_resource(max_entries=64, show_spinner=False)
def over_whirl(design: Design, rotor_mass: float, bearing_number: float) -> Coefficients:
    """The coefficients against whirl frequency. Raises ``InputError``."""
    return coefficients_over_whirl(design, rotor_mass, bearing_number, WHIRL_RATIOS)


@st.cache_resource(max_entries=64, show_spinner=False)
def over_speed(
    design: Design, rotor_mass: float, bearing_number: float, whirl: float | str
) -> Coefficients:
    """The coefficients against shaft speed, around that of the point; ``whirl`` as in
    ``coefficients_over_speed``.
    """
    return coefficients_over_speed(design, rotor_mass, _speeds(bearing_number), whirl)


def _speeds(bearing_number: float) -> np.ndarray:
    """The bearing numbers of a table around the point, each once."""
    return np.unique(np.clip(bearing_number * SPEEDS, *BEARING_NUMBER_RANGE))


def speed_range(design: Design, bearing_number: float) -> str:
    """The speeds of that table as ``--rpm`` takes them."""
    low, high = (design.speed_rpm(float(b)) for b in _speeds(bearing_number)[[0, -1]])
    return f"{math.ceil(low)}:{math.floor(high)}:{len(SPEEDS)}"


def _grid_file(design: Design, rotor_mass: float, bearing_number: float) -> bytes:
    found = coefficients_over_speed_and_frequency(design, rotor_mass, _speeds(bearing_number))
    return table_bytes(found, ".json")


def _speed_file(
    design: Design, rotor_mass: float, bearing_number: float, whirl: float | str
) -> bytes:
    return table_bytes(over_speed(design, rotor_mass, bearing_number, whirl), ".xlsx")


def _whirl_file(design: Design, rotor_mass: float, bearing_number: float) -> bytes:
    return table_bytes(over_whirl(design, rotor_mass, bearing_number), ".csv")


def coefficient_downloads(
    design: Design, rotor_mass: float, bearing_number: float, command: str
) -> None:
    """A popover with the tables for ROSS and the command line that writes them; files are made on
    the click.
    """
    point = (design, rotor_mass, bearing_number)
    with st.popover("Tables for ROSS", icon=":material/download:"):
        file_button(
            "Against speed and whirl frequency: for all modes, JSON",
            partial(_grid_file, *point),
            "bearing.json",
            "ross_grid",
        )
        for label, name, whirl in (
            ("Against speed, at the film's whirl: for the limit of stability", "whirl", FILM_WHIRL),
            ("Against speed, synchronous: for unbalance response", "synchronous", 1.0),
        ):
            make = partial(_speed_file, *point, whirl)
            file_button(label, make, f"bearing_{name}.xlsx", f"ross_{name}")
        file_button(
            "Against whirl frequency, at this speed, CSV",
            partial(_whirl_file, *point),
            "bearing_frequency.csv",
            "ross_frequency",
        )
        st.caption(
            "The first is read by `ross.BearingElement.load`, for `run_modal(speed, "
            "matched_whirl=True)`; the next two by `ross.BearingElement.from_table`. Synchronous "
            "coefficients overrate the stability of a rotor that whirls at half speed, by a factor "
            "of two in speed and more: take them for unbalance alone."
        )
        st.code(command, language=None, wrap_lines=True)
