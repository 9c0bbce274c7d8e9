"""Tolerances and better drawings: how many of the machines built will be good, and what would be
better.
"""

from dataclasses import asdict

import streamlit as st

from spab_core.design.tolerances import VALUES, parse_list
from spab_core.drawings.improve import outside_words
from spab_core.maps.sensitivity import AXES
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES
from spab_core.ui.drawings import (
    chosen_machine,
    improvement_of_job,
    range_fields,
    show_front,
    show_study,
    study_of_job,
    tolerance_fields,
    wish_words,
)
from spab_core.ui.jobs import job_panel
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.view import (
    DRAW_TABS,
    DRAWN,
    WISH_PAIRS,
    choice,
    chosen_limits,
    number_field,
)

page_head("tolerances and better drawings")
st.markdown("# Tolerances, better drawings")
point_bar()
machine = chosen_machine()
tolerances_tab, better_tab = st.tabs(DRAW_TABS, key="draw_tab", on_change="rerun")


def request() -> dict[str, object]:
    """What both kinds of jobs are asked of the machine."""
    return {
        "design": machine.design.to_dict(),
        "rotor_mass": machine.rotor_mass,
        "speed_rpm": machine.speed_rpm,
        "axis": st.session_state["draw_axis"],
        "limits": asdict(chosen_limits()),
    }


def within_tolerances() -> None:
    """Which machines are built, and what they are worth."""
    tolerances = tolerance_fields(machine)
    row = st.container(horizontal=True, vertical_alignment="bottom")
    choice("Margin up in", AXES, place=row, key="draw_axis")
    row.selectbox(
        "Machines at most",
        DRAWN,
        key="machines",
        width=160,
        help="Drawn in batches; it stops where the share of good machines is known to ± 4 %",
    )
    number_field("Wanted share of good machines, %", 1.0, 99.9, place=row, key="wanted", width=240)
    if not tolerances:
        st.info("Choose the values of the drawing that have a tolerance.")
        return
    asked = request() | {
        "tolerances": {VALUES[t.name].key: t.text for t in tolerances},
        "machines": st.session_state["machines"],
        "wanted": st.session_state["wanted"] / 100.0,
    }
    job = job_panel("tolerance", asked, "Draw and solve the machines (up to a minute)", "tol_job")
    if job:
        show_study(study_of_job(job))


def a_better_drawing() -> None:
    """What may move, what must hold, what is wanted; the front."""
    ranges = range_fields(machine)
    row = st.container(horizontal=True, vertical_alignment="bottom")
    row.selectbox("Wanted", WISH_PAIRS, key="wish", width=260, format_func=wish_words)
    choice("Margin up in", AXES, place=row, key="draw_axis")
    row = st.container(horizontal=True, vertical_alignment="bottom")
    choice(
        "Must hold: grade at worst",
        GRADES[:2],
        place=row,
        key="worst_grade",
        format_func=GRADE_WORDS.__getitem__,
    )
    number_field(
        "Gas flow at most, Nl/min (0: any)", 0.0, 1e6, place=row, key="most_flow", width=230
    )
    number_field("Stiffness at least, N/µm", 0.0, 1e6, place=row, key="least_stiffness", width=200)
    number_field(
        "Least film at least, µm",
        0.0,
        1e3,
        place=row,
        key="held_film",
        width=180,
        help="Besides the limits of the verdict, which always hold",
    )
    number_field(
        "Carries at rest, × mass",
        1.0,
        100.0,
        place=row,
        key="load",
        width=180,
        help="Times the rotor mass that the film carries within the largest eccentricity allowed",
    )
    within = st.checkbox(
        "With the tolerances of the other tab", key="within", help="Of every drawing on the front"
    )
    if not ranges:
        st.info("Choose the values that may move, and between which bounds.")
        return
    state = st.session_state
    if state["worst_grade"] == "good" and (words := outside_words(machine)):
        st.warning(words)
    asked = request() | {
        "ranges": {VALUES[name].key: list(bounds) for name, bounds in ranges.items()},
        "wishes": state["wish"].split(", "),
        "most_gas_flow": state["most_flow"] or None,
        "least_stiffness": 1e6 * state["least_stiffness"],
        "least_film": 1e-6 * state["held_film"],
        "load": state["load"],
        "grade": state["worst_grade"],
        "tolerances": kept_tolerances() if within else {},
    }
    job = job_panel("improve", asked, "Look for better drawings (some minutes)", "better_job")
    if job:
        show_front(improvement_of_job(job))


def kept_tolerances() -> dict[str, str]:
    """The tolerances of the other tab, as texts."""
    return {VALUES[t.name].key: t.text for t in parse_list(st.session_state["tolerances"])}


for tab, content in ((tolerances_tab, within_tolerances), (better_tab, a_better_drawing)):
    if tab.open:
        with tab, errors_in_words():
            content()
