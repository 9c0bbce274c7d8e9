"""Start page: the values of my machine, its verdict and margin solved live, and where it stands in
its map.
"""

import plotly.graph_objects as go
import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.maps.stability_map import map_bytes
from spab_core.plotting.map import HEIGHT, LAYERS, SURROGATE
from spab_core.plotting.plain_picture import picture_of_orbits
from spab_core.plotting.point import orbit_figure, orbit_words
from spab_core.reporting.export import map_netcdf, map_table
from spab_core.surrogates.models import MODELS
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.provenance import film_nodes
from spab_core.ui import own_map
from spab_core.ui.clicks import clickable, mark_place
from spab_core.ui.design_form import design_files, machine_fields
from spab_core.ui.downloads import downloads
from spab_core.ui.margin import margin_panel
from spab_core.ui.navigation import page_link
from spab_core.ui.plain_picture import (
    listen_to_picture,
    plotly_wanted,
    show_picture,
    want_plotly,
)
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
    reference_map,
)
from spab_core.ui.solving import LIVE, live_point
from spab_core.ui.verdict import point_numbers, point_verdict
from spab_core.ui.view import (
    EXAMPLE,
    OWN_LAYERS,
    choice,
    chosen_design,
    chosen_limits,
    chosen_point,
    design_option,
    is_reference,
    limits_option,
    point_options,
    set_example,
    set_point,
)

ORBIT_HEIGHT = 215  # pixels
TALL = 420  # of the orbits where there is no map
SHORT_NAMES = {"Largest eccentricity": "Eccentricity", SURROGATE: "Surrogate"}  # of layers

page_head(HOME)
# what comes last, the orbit, stands where it will stay: verdict with its reasons, three numbers
st.html(
    f"<style>.st-key-verdict{{min-height:11rem}} .st-key-point_row{{min-height:{ORBIT_HEIGHT}px}} "
    "@media(max-width:640px){.st-key-point_numbers{min-height:13.25rem}}</style>"
)

state = st.session_state


def ways_in() -> None:
    """What stands here, and the ways to begin."""
    with st.container(horizontal=True, vertical_alignment="center", key="ways"):
        st.markdown("# Will my rotor run quietly, and how far is trouble?", width="content")
        with st.popover("Enter my machine", icon=":material/tune:"):
            st.markdown(
                "Type its values into the fields on this page, or start from a preset or a file:"
            )
            design_files()
        st.button(
            "Explore the example bearing",
            on_click=set_example,
            disabled=is_reference() and not state["name"],
            key="use_reference",
        )
        page_link("Reproduce_the_paper")


ways_in()
machine_fields(point_bar())
with errors_in_words():
    m = reference_map()
design, (mass, number) = chosen_design(), chosen_point()
own = None
if not is_reference():
    want_plotly()  # which only the picture of the example's map asks for by itself
    with errors_in_words():
        own = own_map.map_of(design, mass, number)


def _clicked(bearing_number: float, rotor_mass: float) -> None:
    set_point(rotor_mass, bearing_number)


charted = "map_click" in state  # by this page's last run: the browser has both charts
left, right = st.columns([1, 1.15], gap="medium")
shown = (state["layer"], state["model"], state["divisor"], int(state["draw"]))


def example_map() -> DeltaGenerator:
    """The map of the example bearing as a plain picture; returns the place of its chart."""
    st.markdown("## Stability map of the example bearing")
    layer = choice(
        "Layer",
        LAYERS,
        key="layer",
        label_visibility="collapsed",
        format_func=lambda name: SHORT_NAMES.get(name, name),
    )
    with errors_in_words():
        picture = map_picture(*shown)
    box = st.container(key="map_box", gap=None)
    with box:
        show_picture(picture.marked(*place), "map_box", HEIGHT)
        if not plotly_wanted():
            listen_to_picture(picture, "map", _clicked)
    _, model, divisor, _ = shown
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
    with errors_in_words(), st.expander("The borders of regimes around the point, off this map"):
        st.markdown(map_margin(mass, number))
        st.caption(f"Where map and linear theory disagree. {linear_words()}")
    return box


def own_picture() -> DeltaGenerator:
    """The map of the own design where there is one, else the ways to it; returns the place of its
    chart, or of the orbits.
    """
    if own:
        st.markdown("## Stability map of this design")
        box = st.container(key="map_box", gap=None)
        st.caption(f"{own.words}. Dots are solved cells; colours between are predicted.")
        page_link("My_map", "Open this map")
        return box
    st.markdown("## The motion of this design")
    box = st.container(key="map_box", gap=None)
    st.info(
        f"No map of this design yet. The map that comes with spab is of the {EXAMPLE}, and tells "
        "nothing of this design."
    )
    page_link("My_map", "Map this design")
    return box


def _command() -> str:
    """The commands that give the same as this page."""
    solved = (
        f"{point_options()}{design_option()} --transient {LIVE.transient} "
        f"--revolutions {LIVE.revolutions}{limits_option(chosen_limits())}\n"
    )
    command = f"spab margin {solved}spab simulate {solved}"
    if not is_reference():
        return command.rstrip()
    b0, b1, m0, m1 = (float(v) for v in (*m.bearing_number[[0, -1]], *m.rotor_mass[[0, -1]]))
    command += (
        f"spab map --bearing-number {b0:g}:{b1:g}:{m.shape[0]} --rotor-mass "
        f"{m0:g}:{m1:g}:{m.shape[1]} --out map.npz\n"
        "spab export map.npz --out map.nc"
    )
    layer, model, divisor, draw = shown
    if layer == SURROGATE:
        command += (
            f"\nspab predict --model {model} --divisor {divisor} --seed {draw} --out predicted.npz"
        )
    return command


def _downloads(orbit: go.Figure) -> None:
    if not is_reference():
        downloads("start", {"Orbit": orbit}, command=_command())
        return
    # not the page's own figure: its mark may stand where it was before a click (mark_place)
    downloads(
        "stability_map",
        {"Map": lambda: marked_map_figure((number, mass), *shown), "Orbit": orbit},
        {"Map": lambda: map_table(m)},
        {"npz": lambda: map_bytes(m), "nc": lambda: map_netcdf(m)},
        _command(),
    )


def _point() -> tuple[DeltaGenerator, go.Figure] | None:
    """Words and numbers of the operating point.

    Returns the place of the figure of its orbits, and the figure; None where it is not solved.
    """
    if is_reference():
        st.markdown(
            f":small[This is the **{EXAMPLE}**: type your machine's values, and the "
            "whole page follows.]"
        )
    verdict, numbers, words = st.container(key="verdict"), st.empty(), st.container()
    with verdict, errors_in_words():
        point = live_point(design, mass, number)
        if point is None:
            return None
        point_verdict(point)
    beside = is_reference() or own is not None
    height = ORBIT_HEIGHT if beside else TALL
    orbit = orbit_figure(point).update_layout(height=height, margin_t=30)
    if beside:
        orbit.update_layout(legend_y=-0.42)  # of a low figure, below the axis title
    place = _numbers(point, numbers, beside)
    with words, errors_in_words():
        margin_panel(design, mass, number)
    with st.container(horizontal=True, vertical_alignment="center"):
        page_link("Operating_point", "Motion in detail: section, spectrum, film")
        _downloads(orbit)
    t = point.trajectory
    settled = ", settled on a periodic orbit" if t.settled else ""
    st.caption(
        f"Solved live: {t.completed} revolutions from rest{settled}, {t.wall_seconds:.2f} s on "
        f"{t.mesh} film nodes, at Λ {number:.4g} and {mass:.4g} kg. {orbit_words(point)}"
    )
    return place, orbit


def _numbers(point: OperatingPoint, box: DeltaGenerator, beside: bool) -> DeltaGenerator:
    """A point's numbers, beside the orbits or in a row; returns the place of the orbits."""
    if not beside:
        with box.container(horizontal=True, horizontal_alignment="distribute"):
            for label, value, text in point_numbers(point):
                st.metric(label, value, help=text, width="content")
        return map_place
    numbers, place = box.container(key="point_row").columns(
        [1, 1.7], gap="small", vertical_alignment="center"
    )
    with numbers.container(key="point_numbers"):
        for label, value, text in point_numbers(point)[:3]:
            st.metric(label, value, help=text)
    return place


with right:
    place = (number, mass)
    if plotly_wanted() and (is_reference() or own):
        key = shown if is_reference() else (own.id, own.found[0].solved.sum()) if own else ()
        place = mark_place("map", key, place)
    map_place = example_map() if is_reference() else own_picture()

# words first: while Plotly draws the browser shows nothing new
try:
    with left:
        answer = _point()
finally:  # also where the point cannot be solved
    if plotly_wanted() and (is_reference() or own):
        with map_place:
            clickable(
                own_map.own_figure(own.found, OWN_LAYERS[0], *place)
                if own
                else marked_map_figure(place, *shown),
                "map",
                _clicked,
                config={"displaylogo": False, "scrollZoom": True},
            )
if answer:
    orbit_place, orbits = answer
    with orbit_place.container(key="orbit_box", gap=None):
        show_picture(
            None if charted else picture_of_orbits(orbits), "orbit_box", orbits.layout.height
        )
        if plotly_wanted():
            st.plotly_chart(orbits, key="orbit", width="stretch")
