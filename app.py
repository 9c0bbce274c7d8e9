"""Home page: the stability map; a click or typed numbers choose an operating point, which is solved live."""

import streamlit as st

from spab_core.figures import LAYERS
from spab_core.figures_point import exponent_figure, orbit_figure, section_figure
from spab_core.simulate import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.ui.shared import errors_in_words, live_point, marked_map_figure, page_head, reference_map

page_head("stability map")

with errors_in_words():
    m = reference_map()

state = st.session_state
if "mark" not in state:
    state["mark"] = (state["bearing_number"], state["rotor_mass"])


def _typed():
    """Mark the typed point with a cross."""
    state["mark"] = (state["bearing_number"], state["rotor_mass"])


def _layer_changed():
    """Another layer is another figure: it must show the cell clicked last, which the browser alone knew."""
    if isinstance(state["mark"], int):
        row, column = m.nearest(state["rotor_mass"], state["bearing_number"])
        state["mark"] = row * len(m.rotor_mass) + column


def _clicked():
    """Take the cell that was clicked; the overlay's points are the cells in the order of the map."""
    points = state["map"]["selection"]["points"]
    if points:
        index = int(points[0]["point_index"])
        row, column = divmod(index, len(m.rotor_mass))
        # the browser marks a clicked cell: from the second click on the figure stays as it is, is not sent again
        if not isinstance(state["mark"], int):
            state["mark"] = index
        state["bearing_number"] = round(float(m.bearing_number[row]), 6)
        state["rotor_mass"] = round(float(m.rotor_mass[column]), 6)


left, right = st.columns([1.15, 1], gap="medium")

with left:
    st.markdown("#### Stability map of the reference bearing")
    a, b, c = st.columns([1.6, 1, 1], vertical_alignment="bottom")
    layer = a.segmented_control("Layer", LAYERS, key="layer", on_change=_layer_changed) or LAYERS[0]
    b.number_input("Bearing number Λ", *BEARING_NUMBER_RANGE, key="bearing_number", step=0.05, format="%.3f",
                   on_change=_typed, help="(6 μ ω / p_a)(R/C)²: shaft speed, dimensionless")
    c.number_input("Rotor mass, kg", *ROTOR_MASS_RANGE, key="rotor_mass", step=0.1, format="%.3f", on_change=_typed,
                   help="Whole rotor mass that one bearing carries")
    st.plotly_chart(marked_map_figure(layer, state["mark"]), key="map", on_select=_clicked, selection_mode="points",
                    width="stretch", config={"displaylogo": False, "scrollZoom": True})
    st.caption(f"{m.shape[0]} × {m.shape[1]} cold starts on {m.metadata['mesh']} film nodes, {m.metadata['transient']} + "
               f"{m.metadata['revolutions']} revolutions each, fewer where the orbit settled. Click a cell, or type Λ and mass "
               "to solve that point now.")

with right:
    design = m.design
    mass, number = state["rotor_mass"], state["bearing_number"]
    st.markdown(f"#### Operating point: Λ {number:.3f}, {design.speed_rpm(number):,.0f} rpm, {mass:.2f} kg")
    with errors_in_words():
        point = live_point(design, mass, number)
    box = {"periodic": st.success, "quasi-periodic": st.warning}.get(point.regime.name if point.regime else "", st.error)
    box(point.verdict())
    if point.mle:
        cells = st.columns(4)
        cells[0].metric("MLE per revolution", f"{point.mle.value:+.3f}", help="Maximum Lyapunov exponent, natural log: below "
                        "zero periodic, zero quasi-periodic, above zero chaotic")
        spread = point.mle.standard_error
        cells[1].metric("Standard error", f"± {spread:.3f}" if spread >= 0.0005 else "< 0.001",
                        help="Of the MLE, by batch means; on a settled periodic orbit, the last change of its leading "
                             "multiplier's rate")
        cells[2].metric("Max. eccentricity", f"{point.max_eccentricity:.3f}", help="Largest of the journal, over the clearance")
        cells[3].metric("Time in contact", f"{100 * point.contact_share:.1f} %",
                        help="Share of the time with a film under a tenth of the clearance")
    one, two = st.columns(2)
    one.plotly_chart(orbit_figure(point), key="orbit", width="stretch")
    two.plotly_chart(section_figure(point), key="section", width="stretch")
    st.plotly_chart(exponent_figure(point).update_layout(height=205), key="exponent", width="stretch")
    t, cell = point.trajectory, m.nearest(mass, number)
    ended = ", settled on a periodic orbit" if t.settled else ""
    st.caption(f"Solved live: {t.completed} revolutions from rest{ended}, {t.steps:,} steps in {t.wall_seconds:.2f} s on "
               f"{point.settings.mesh} film nodes. Nearest cell of the map (Λ {m.bearing_number[cell[0]]:.3f}, "
               f"{m.rotor_mass[cell[1]]:.2f} kg): {m.cell_text(*cell)}.")
