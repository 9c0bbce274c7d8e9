"""Home page: the stability map; a click or typed numbers choose an operating point: its margin,
solved live beside it.
"""

import plotly.graph_objects as go
import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.design.model import reference_design
from spab_core.maps.stability_map import map_bytes
from spab_core.plotting.map import HEIGHT, LAYERS, SURROGATE
from spab_core.plotting.plain_picture import picture_of_orbits
from spab_core.plotting.point import orbit_figure
from spab_core.reporting.export import map_netcdf, map_table
from spab_core.surrogates.models import MODELS
from spab_core.trajectory.provenance import film_nodes
from spab_core.ui.clicks import clickable, mark_place
from spab_core.ui.downloads import downloads
from spab_core.ui.margin import margin_panel
from spab_core.ui.plain_picture import listen_to_picture, plotly_wanted, show_picture
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import (
    HOME,
    errors_in_words,
    grade_words,
    linear_words,
    map_margin,
    map_picture,
    marked_map_figure,
    page_head,
    page_link,
    reference_map,
)
from spab_core.ui.solving import LIVE, live_point
from spab_core.ui.verdict import point_numbers, point_verdict
from spab_core.ui.view import (
    choice,
    chosen_design,
    chosen_point,
    design_option,
    is_reference,
    point_options,
    set_design,
    set_point,
)

ORBIT_HEIGHT = 250  # pixels
SHORT_NAMES = {"Largest eccentricity": "Eccentricity", SURROGATE: "Surrogate"}  # of layers

page_head(HOME)
# what comes last, the orbit, stands where it will stay: verdict with its reasons, three numbers
st.html(
    f"<style>.st-key-verdict{{min-height:12rem}} .st-key-point_row{{min-height:{ORBIT_HEIGHT}px}} "
    "@media(max-width:640px){.st-key-point_numbers{min-height:13.25rem}}</style>"
)

with errors_in_words():
    m = reference_map()

state, design = st.session_state, chosen_design()
mass, number = chosen_point()


def _clicked(bearing_number: float, rotor_mass: float) -> None:
    set_point(rotor_mass, bearing_number)


charted = "map_click" in state  # by this page's last run: the browser has both charts
left, right = st.columns([1.15, 1], gap="medium")

with left:
    st.markdown("#### Stability map of the reference bearing")
    layer = choice(
        "Layer",
        LAYERS,
        key="layer",
        label_visibility="collapsed",
        format_func=lambda name: SHORT_NAMES.get(name, name),
    )
    model, divisor, draw = state["model"], state["divisor"], int(state["draw"])
    with errors_in_words():
        shown, place = (layer, model, divisor, draw), (number, mass)
        if plotly_wanted():
            place = mark_place("map", shown, place)
        picture = map_picture(*shown)
    map_place = st.container(key="map_box", gap=None)
    with map_place:
        show_picture(picture.marked(*place), "map_box", HEIGHT)
        if not plotly_wanted():
            listen_to_picture(picture, "map", _clicked)
    told = (
        f"Predicted by {MODELS[model].label} from n/{divisor} of the cells. "
        if layer == SURROGATE
        else grade_words()
        if layer == LAYERS[0]
        else ""
    )
    st.caption(
        f"{told}Click a cell, or type the point. {m.shape[0]} × {m.shape[1]} cold starts on "
        f"{film_nodes(m.metadata)}; the linear threshold is that of the static equilibrium "
        "without unbalance."
    )
    st.caption(f"Where map and linear theory disagree. {linear_words()}")


def _margin() -> None:
    """The borders of regimes around the point in the shipped map; with another design, the ways to
    its own.
    """
    if is_reference():
        with errors_in_words():
            st.markdown(map_margin(mass, number))
        return
    st.info(
        "The map is of the reference bearing. The point and its margin are solved with your own "
        "design."
    )
    with st.container(horizontal=True):
        st.button(
            "Use the reference bearing",
            on_click=set_design,
            args=(reference_design(),),
            key="use_reference",
        )
        page_link("My_bearing", "My bearing")
        page_link("My_map", "My map: the map of your own design")


def _command() -> str:
    """The commands that give the same as this page."""
    b0, b1, m0, m1 = (float(v) for v in (*m.bearing_number[[0, -1]], *m.rotor_mass[[0, -1]]))
    solved = (
        f"{point_options()}{design_option()} --transient {LIVE.transient} "
        f"--revolutions {LIVE.revolutions}\n"
    )
    command = (
        f"spab margin {solved}"
        f"spab simulate {solved}"
        f"spab map --bearing-number {b0:g}:{b1:g}:{m.shape[0]} --rotor-mass "
        f"{m0:g}:{m1:g}:{m.shape[1]} --out map.npz\n"
        "spab export map.npz --out map.nc"
    )
    if layer == SURROGATE:
        command += (
            f"\nspab predict --model {model} --divisor {divisor} --seed {draw} --out predicted.npz"
        )
    return command


def _point() -> tuple[DeltaGenerator, go.Figure] | None:
    """Words and numbers of the operating point.

    Returns the place of the figure of its orbits, and the figure; None where it is not solved.
    """
    st.markdown("#### Operating point")
    point_bar("stretch")
    verdict, row = st.container(key="verdict"), st.empty()
    solved, words = st.container(), st.container()
    numbers, place = row.container(key="point_row").columns(
        [1, 1.7], gap="small", vertical_alignment="center"
    )
    with words:
        _margin()
    with verdict, errors_in_words():
        point = live_point(design, mass, number)
        if point is None:
            row.empty()
            return None
        point_verdict(point)
    with solved, errors_in_words():
        margin_panel(design, mass, number)
    with numbers.container(key="point_numbers"):
        for label, value, text in point_numbers(point)[:3]:
            st.metric(label, value, help=text)
    orbit = orbit_figure(point).update_layout(height=ORBIT_HEIGHT, margin_t=30, legend_y=-0.3)
    with st.container(horizontal=True, vertical_alignment="center"):
        page_link("Operating_point", "Operating point: section, spectrum, film")
        # not the page's own figure: its mark may stand where it was before a click (mark_place)
        downloads(
            "stability_map",
            {"Map": lambda: marked_map_figure((number, mass), *shown), "Orbit": orbit},
            {"Map": lambda: map_table(m)},
            {"npz": lambda: map_bytes(m), "nc": lambda: map_netcdf(m)},
            _command(),
        )
    t = point.trajectory
    settled = ", settled on a periodic orbit" if t.settled else ""
    st.caption(
        f"Solved live: {t.completed} revolutions from rest{settled}, {t.wall_seconds:.2f} s on "
        f"{t.mesh} film nodes, at Λ {number:.4g} and {mass:.4g} kg."
    )
    return place, orbit


# words first: while Plotly draws the browser shows nothing new
try:
    with right:
        answer = _point()
finally:  # also where the point cannot be solved
    if plotly_wanted():
        with map_place:
            clickable(
                marked_map_figure(place, *shown),
                "map",
                _clicked,
                config={"displaylogo": False, "scrollZoom": True},
            )
if answer:
    orbit_place, orbits = answer
    with orbit_place.container(key="orbit_box", gap=None):
        show_picture(None if charted else picture_of_orbits(orbits), "orbit_box", ORBIT_HEIGHT)
        if plotly_wanted():
            st.plotly_chart(orbits, key="orbit", width="stretch")
