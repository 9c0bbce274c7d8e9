"""Stability map: the plane of one's own bearing, solved where it matters within minutes, predicted
elsewhere; margin and report.
"""

from functools import partial

import streamlit as st

from spab_core.active_learning.quick_map import check_cluster, check_quick_map
from spab_core.plotting.map import LAYERS
from spab_core.shipped.model_store import DEFAULT
from spab_core.trajectory.assessment import GRADE_WORDS
from spab_core.ui import own_map
from spab_core.ui.clicks import clickable, mark_place
from spab_core.ui.downloads import downloads
from spab_core.ui.jobs import job_panel
from spab_core.ui.margin import margin_panel
from spab_core.ui.own_report import report_downloads
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, marked_map_figure, page_head
from spab_core.ui.verdict import assumed_line, grade_box
from spab_core.ui.view import (
    OWN_LAYERS,
    OWN_MINUTES,
    choice,
    chosen_design,
    chosen_point,
    is_reference,
    number_field,
    set_point,
)

page_head("stability map")
design, state = chosen_design(), st.session_state
st.markdown("# Stability map")
point_bar()
row = st.container(horizontal=True, vertical_alignment="bottom")
number, mass = own_map.range_fields(row)
minutes = number_field(
    "Minutes",
    *OWN_MINUTES,
    place=row,
    key="own_minutes",
    step=0.5,
    width=110,
    help="Wall time of the computation; more minutes solve more cells near the borders",
)
with row.popover("Cells, cluster", icon=":material/lan:"):
    st.text_input(
        "Bearing numbers Λ, start:stop:count",
        key="own_numbers",
        max_chars=60,
        placeholder=number,
        help="The same range as in rpm, with the number of cells",
    )
    st.text_input(
        "Rotor masses in kg, start:stop:count",
        key="own_masses",
        max_chars=60,
        placeholder=mass,
    )
    cluster = st.text_input(
        "Dask scheduler",
        key="own_dask",
        placeholder="tcp://host:8786",
        max_chars=200,
        help="Solve on a cluster of yours instead of this machine (docs/scaling.md). Its answers "
        "are code to this server: give only an address that you trust",
    )
layer = choice("Layer", OWN_LAYERS, place=row, key="own_layer")
with errors_in_words():
    check_quick_map(number, mass, 60.0 * minutes)
    parameters = {
        "design": design.to_dict(),
        "bearing_number": number,
        "rotor_mass": mass,
        "seconds": 60.0 * minutes,
        "dask": check_cluster(cluster),
    }


def _clicked(bearing_number: float, rotor_mass: float) -> None:
    set_point(rotor_mass, bearing_number)
    state["own_clicked"] = True


with errors_in_words():  # the map at work goes on, wherever the point is moved to
    at_work = own_map.active_map(design)
    asked = at_work.parameters if at_work else parameters
left, right = st.columns([1.35, 1], gap="medium")
with right, errors_in_words():
    job_panel(
        "map",
        asked,
        f"Map this bearing in {minutes:g} minute{'' if minutes == 1 else 's'}",
        "own_map",
    )


def _plane() -> None:
    if state.pop("own_clicked", False):
        st.rerun()  # of the page: its margin is another one
    with errors_in_words():
        latest = own_map.shown_map(design, asked, *chosen_point())
    if latest is None:
        if is_reference():
            figure = marked_map_figure(chosen_point()[::-1], LAYERS[0], *DEFAULT, 0)
            clickable(figure, "own_figure", _clicked, config={"displaylogo": False})
            st.caption(
                "The map that comes with spab, of the example bearing: every cell is solved."
            )
            return
        st.info(
            "A coarse plane comes first, within some 10 seconds on two idle cores; then cells are "
            "solved where their assessment or motion is in doubt. Solved cells are dots, the "
            "colours between them are predicted. The margin of the chosen point is solved beside "
            "it. It can be stopped at any time: what has been solved is kept."
        )
        return
    place = mark_place(
        "own_figure",
        (layer, latest.id, latest.found[0].solved.sum()),
        (state["bearing_number"], state["rotor_mass"]),
    )
    if latest.shipped:
        st.info(own_map.example_words(latest), icon=":material/inventory_2:")
    clickable(
        own_map.own_figure(latest.found, layer, *place),
        "own_figure",
        _clicked,
        config={"displaylogo": False},
    )


def _compared(one: own_map.Shown) -> None:
    """A map with the chosen point, and its shares, in half a page's width."""
    st.plotly_chart(
        own_map.own_figure(one.found, layer, *chosen_point()[::-1]),
        key=f"compared_{one.id}",
        width="stretch",
    )
    st.caption(f"{own_map.shares_words(one.found)} of the plane.".capitalize())


with errors_in_words():
    shown = own_map.shown_map(design, asked, *chosen_point())
with left:
    st.fragment(_plane, run_every=4.0 if at_work else None)()
with right, errors_in_words():
    margin_panel(design, *chosen_point())
if shown:
    found = refined, m = shown.found
    rotor_mass, bearing_number = chosen_point()
    with right:
        cell = own_map.cell_of(m, rotor_mass, bearing_number)
        if cell is None:
            st.warning("The chosen point lies outside this map.")
        else:
            words, judged = own_map.cell_words(found, cell), own_map.cell_assessment(found, cell)
            if judged.grade != str(m.grades()[cell]):
                words += f" **With its equilibrium: {judged.words}**; {judged.reasons[0]}."
            if judged.grade == "good" and not refined.solved[cell]:
                st.info(words, icon=":material/info:")  # green is for what was solved
            else:
                grade_box(words, judged.grade)
            assumed_line()
        by_grade, by_regime = own_map.shares(found)
        tiles = {"Solved cells": f"{int(refined.solved.sum()):,}"}
        tiles |= {GRADE_WORDS[g].capitalize(): f"{100 * s:.1f} %" for g, s in by_grade.items()}
        tiles["Failed runs"] = f"{100 * by_regime.pop(''):.1f} %"
        with st.container(horizontal=True, horizontal_alignment="distribute"):
            for name, value in tiles.items():
                st.metric(
                    name,
                    value,
                    width="content",
                    help=f"Of {refined.batch.size:,}; the rest predicted"
                    if name == "Solved cells"
                    else "Of the plane, predicted cells included; failed runs are not recommended "
                    "too",
                )
        told = ", ".join(f"{name} {100 * share:.1f} %" for name, share in by_regime.items())
        st.caption(f"Regimes of the plane, predicted cells included: {told}.")
        actions = st.container(horizontal=True)
        if actions.button("Solve this point", key="own_point", icon=":material/adjust:"):
            st.switch_page("pages/1_Operating_point.py")
        with actions:
            downloads(
                "my_map",
                {"Map": own_map.own_figure(found, layer, bearing_number, rotor_mass)},
                {"Cells": partial(own_map.own_table, found)},
                {"npz": shown.file.read_bytes},
                shown.command,
            )
            report_downloads(design, shown, rotor_mass, bearing_number)

choices = own_map.to_compare(shown) if shown else {}
if shown and choices:
    title = "The same bearing with another wall" if shown.shipped else "Compare with another map"
    with st.expander(title, expanded=shown.shipped is not None):
        names = list(choices)
        if state.get("own_other") not in choices:
            state.pop("own_other", None)  # of another map
        other = st.selectbox("Map", names, format_func=choices.__getitem__, key="own_other")
        other = other or names[0]
        for box, which in zip(st.columns(2, gap="medium"), (shown.id, other), strict=True):
            with box, errors_in_words():
                own_words = shown.words if shown.shipped else "This map"
                st.markdown(f"**{own_words if which == shown.id else choices[which]}**")
                drawn = shown if which == shown.id else own_map.shown_by_id(which)
                if drawn is None:
                    st.info("This map has just been deleted.")
                else:
                    _compared(drawn)
