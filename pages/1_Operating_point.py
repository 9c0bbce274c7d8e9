"""Operating point: one rotor mass and bearing number solved live, in every view, beside the
example bearing if wanted.
"""

from collections.abc import Callable
from functools import partial
from typing import Literal

import plotly.graph_objects as go
import streamlit as st

from spab_core.common.words import capital
from spab_core.design.model import reference_design
from spab_core.plotting import point as draw
from spab_core.trajectory.point import OperatingPoint
from spab_core.ui import point as ui
from spab_core.ui.design_form import design_popover
from spab_core.ui.downloads import downloads
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.view import (
    EXAMPLE,
    POINT_TABS,
    SAME,
    choice,
    chosen_design,
    chosen_point,
    design_option,
    design_words,
    is_reference,
    point_options,
)

page_head("motion in detail")
state = st.session_state

st.markdown("# Motion in detail")
row = point_bar()
with row:
    design_popover()
    with st.popover("Solver", icon=":material/memory:"):
        ui.solver_controls()
compare = (
    row.toggle(
        "Compare with the example bearing",
        key="compare",
        disabled=is_reference() and not state["compare"],
        help="Change a value of the design first: this is the example bearing",
    )
    and not is_reference()
)

files = row.container()
design, (mass, number) = chosen_design(), chosen_point()
with errors_in_words():
    settings = ui.chosen_settings()

sides = [(design, number, design_words(), "own")]
if compare:
    usual = reference_design()
    same = choice(
        "At the same",
        SAME,
        place=row,
        key="same",
        label_visibility="collapsed",
        format_func={SAME[0]: "same Λ", SAME[1]: "same speed"}.__getitem__,
    )
    other = number if same == SAME[0] else usual.bearing_number(design.speed(number))
    sides.append((usual, other, EXAMPLE, "reference"))

points = []
for box, (one, at, words, key) in zip(st.columns(len(sides), gap="medium"), sides, strict=True):
    with box, errors_in_words():
        if compare:
            st.markdown(f"**{capital(words)}**: Λ {at:.3f}, {one.speed_rpm(at):,.0f} rpm")
        point = ui.solved_point(one, mass, at, settings, key)
        points.append(point)
        if point is not None:
            ui.verdict_panel(point)


LOW = {
    "spectrum": 315,
    "film": 290,
}  # pixels: with two designs side by side the page has a title and an axis more


def show(name: str, figure: go.Figure, key: str) -> None:
    # given here, not to the figure: that of the film is everybody's
    height: int | Literal["content"] = "content"
    if compare:
        height = min(figure.layout.height, LOW.get(name, 380))
    st.plotly_chart(
        figure, key=f"{name}_{key}", width="stretch", height=height, config={"displaylogo": False}
    )


def overview(point: OperatingPoint, key: str) -> None:
    tall = {"height": 300 if compare else 420}
    orbit = draw.orbit_figure(point, ui.run_up_of(point)).update_layout(tall)
    if point.mle is None:
        show("orbit", orbit, key)
        return
    boxes = st.columns(2 if compare else 3)
    with boxes[0]:
        show("orbit", orbit, key)
    with boxes[-1]:
        show("spectrum", ui.spectrum_of(point).update_layout(tall), key)
    with st.container() if compare else boxes[1]:  # its points are marked on the orbit too
        show("section", draw.section_figure(point).update_layout(tall), key)
    if words := draw.orbit_words(point):
        st.caption(words)


def tab_content(name: str, point: OperatingPoint, key: str) -> None:
    if name == "Overview":
        overview(point, key)
    elif point.mle is None:
        st.info(
            "The run did not complete: there is nothing to show but its run-up, in the overview."
        )
    elif name == "Orbits":
        bodies = ["journal"] if point.design.rigid else ["journal", "disc"]
        for box, body in zip(st.columns(2), bodies, strict=False):
            with box:
                show(body, draw.body_figure(point, body, ui.run_up_of(point)), key)
        if words := draw.orbit_words(point):
            st.caption(words)
    elif name == "Film 3-D":
        film(point, key)
    else:
        draws: dict[str, Callable[[], go.Figure]] = {
            "Spectrum": lambda: ui.spectrum_of(point, 4).update_layout(height=405),
            "Signals": partial(draw.signals_figure, point),
            "Forces": lambda: draw.forces_figure(ui.revolution_of(point)),
            "Exponent": lambda: draw.exponent_figure(point).update_layout(height=440),
        }
        show(name.lower(), draws[name](), key)
        if name == "Spectrum":
            st.caption(ui.strongest_lines(point))
        elif name == "Exponent":
            st.caption(draw.exponent_words(point))


def film(point: OperatingPoint, key: str) -> None:
    show("film", ui.film_of(point, colour), key)
    b = point.design.bearing
    wider = draw.FILM_SHARE * b.radius / b.clearance
    st.caption(
        f"The journal within the bearing band (grey). The gap is drawn {wider:,.0f} times wider "
        "than it is "
        f"({1e6 * b.clearance:g} µm on a radius of {1e3 * b.radius:g} mm); angles are true."
    )


shown = [(p, key) for p, (*_, key) in zip(points, sides, strict=True) if p is not None]
if shown:
    for tab, name in zip(
        st.tabs(POINT_TABS, key="tab", on_change="rerun"), POINT_TABS, strict=True
    ):
        if tab.open:
            with tab, errors_in_words():
                if name == "Film 3-D":
                    colour = choice(
                        "Colour", draw.QUANTITIES, key="film_colour", label_visibility="collapsed"
                    )
                for box, (p, key) in zip(st.columns(len(shown), gap="medium"), shown, strict=True):
                    with box:
                        tab_content(name, p, key)
    t = shown[0][0].trajectory
    ended = ", settled on a periodic orbit" if t.settled else ""
    st.caption(
        f"{t.completed} revolutions from rest{ended}, {t.steps:,} steps in {t.wall_seconds:.2f} s; "
        f"{settings.method}, {t.mesh} film nodes. Run-up: "
        "the first 60 revolutions; load and unbalance rise over 30."
    )

with files:
    first = points[0]
    downloads(
        "point",
        {
            f"{title}{' reference' if key == 'reference' else ''}": make
            for p, key in shown
            for title, make in ui.figures_of(p).items()
        },
        {"Orbit": partial(ui.orbit_table, first)} if first else {},
        {"npz": partial(ui.point_npz, first)} if first else {},
        ui.simulate_command(design_option(), point_options(), settings),
    )
