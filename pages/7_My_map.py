"""My map: the plane of one's own bearing, solved where it matters within minutes, predicted
elsewhere; margin and report.
"""

import streamlit as st

from spab_core.active_learning.quick_map import check_cluster, check_quick_map, usual_plane
from spab_core.reporting.export import map_table
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES
from spab_core.ui import own_map
from spab_core.ui.clicks import clickable, mark_place
from spab_core.ui.downloads import downloads
from spab_core.ui.jobs import job_panel
from spab_core.ui.margin import margin_panel
from spab_core.ui.own_report import report_downloads
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.verdict import stability_box
from spab_core.ui.view import (
    OWN_LAYERS,
    OWN_MINUTES,
    choice,
    chosen_design,
    chosen_point,
    design_option,
    design_words,
    number_field,
    set_point,
    show_usual,
)

page_head("my map")
design, state = chosen_design(), st.session_state
st.markdown(f"#### Map of my bearing: {design_words()}")
usual = usual_plane(design)
row = st.container(horizontal=True, vertical_alignment="bottom")
number = row.text_input(
    "Bearing numbers Λ, start:stop:count",
    **show_usual("own_numbers", usual[0]),
    width=230,
    max_chars=60,
)
mass = row.text_input(
    "Rotor masses in kg, start:stop:count",
    **show_usual("own_masses", usual[1]),
    width=230,
    max_chars=60,
)
minutes = number_field(
    "Minutes",
    *OWN_MINUTES,
    place=row,
    key="own_minutes",
    step=0.5,
    width=110,
    help="Wall time of the computation; more minutes solve more cells near the borders",
)
with row.popover("Cluster", icon=":material/lan:"):
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


left, right = st.columns([1.35, 1], gap="medium")
with right, errors_in_words():
    job_panel("map", parameters, f"Map this bearing in {minutes:g} minutes", "own_map")


def _plane() -> None:
    if state.pop("own_clicked", False):
        st.rerun()  # of the page: its margin is another one
    with errors_in_words():
        latest = own_map.map_job(parameters)
        found = own_map.published(latest)
    if latest is None or found is None:
        st.info(
            "A coarse plane comes first, within some 20 seconds; then cells are solved where "
            "regimes are in doubt. Solved cells are dots, the colours between them are predicted. "
            "It can be stopped at any time: what is there is kept."
        )
        return
    place = mark_place(
        "own_figure",
        (layer, latest.id, found[0].solved.sum()),
        (state["bearing_number"], state["rotor_mass"]),
    )
    clickable(
        own_map.own_figure(found, layer, *place),
        "own_figure",
        _clicked,
        config={"displaylogo": False},
    )


with errors_in_words():
    job = own_map.map_job(parameters)
    found = own_map.published(job)
with left:
    st.fragment(_plane, run_every=4.0 if job and job.active else None)()
if job and found:
    refined, m = found
    with right:
        point_bar("stretch")
        rotor_mass, bearing_number = chosen_point()
        with errors_in_words():
            margin_panel(design, rotor_mass, bearing_number)
        at = own_map.margin_in_map(m, rotor_mass, bearing_number)
        if at is None:
            st.warning("The chosen point lies outside this map.")
        else:
            stability_box(f"Regimes alone, read off the map. {at.headline()}", at.stable)
            cell = m.nearest(rotor_mass, bearing_number)
            if not refined.solved[cell]:
                st.caption(
                    f"The cell of this point is predicted, not solved: probability of instability "
                    f"{100 * refined.unstable[cell]:.0f} %. Solving the point settles it."
                )
            st.markdown("\n".join(f"- {text}" for text in at.sentences()))
        share = own_map.shares(found)
        # rare ones only where there are any: failed runs, undecided motions
        shown = [r for r in (*REGIMES, "") if r in REGIMES[:3] or share.get(r)]
        cells = st.columns(1 + len(shown))
        cells[0].metric(
            "Solved cells",
            f"{int(refined.solved.sum()):,}",
            help=f"Of {refined.batch.size:,}; the rest predicted",
        )
        for box, name in zip(cells[1:], shown, strict=True):
            box.metric(
                (name or NO_EXPONENT).capitalize(),
                f"{100 * share.get(name, 0.0):.1f} %",
                help="Of the plane, predicted cells included",
            )
        actions = st.container(horizontal=True)
        if actions.button("Solve this point", key="own_point", icon=":material/adjust:"):
            st.switch_page("pages/1_Operating_point.py")
        with actions:
            downloads(
                "my_map",
                {"Map": own_map.own_figure(found, layer, bearing_number, rotor_mass)},
                {"Cells": lambda: map_table(m)},
                {"npz": job.result.read_bytes},
                own_map.map_command(design_option(), number, mass, minutes),
            )
            command = own_map.map_command(" --design my.toml", number, mass, minutes)
            report_downloads(design, found, at, rotor_mass, bearing_number, command)

saved = [j for j in own_map.finished_maps() if job is None or j.id != job.id]
if job and found and saved:
    with st.expander("Compare with another map"):
        other = st.selectbox("Map", saved, format_func=own_map.job_words, key="own_other")
        one, two = st.columns(2, gap="medium")
        for box, which, title in ((one, job, "this map"), (two, other, own_map.job_words(other))):
            with box, errors_in_words():
                st.caption(title)
                drawn = own_map.published(which)
                if drawn is None:
                    st.info("This map has just been deleted.")
                    continue
                st.plotly_chart(
                    own_map.own_figure(drawn, layer, bearing_number, rotor_mass),
                    key=f"compared_{which.id}",
                    width="stretch",
                )
with st.expander("Jobs kept on this machine"), errors_in_words():
    own_map.jobs_table()
