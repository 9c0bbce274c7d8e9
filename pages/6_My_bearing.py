"""My bearing: from the designer's drawing to numbers, live: groups, equilibrium, gas flow,
stiffness and damping, whirl.
"""

import pandas as pd
import streamlit as st

from spab_core.linear_theory.coefficients import FILM_WHIRL, NAMES, Coefficients
from spab_core.linear_theory.ross_table import coefficient_warnings
from spab_core.linear_theory.summary import Derived
from spab_core.plotting.bearing import coefficient_figure, load_figure
from spab_core.trajectory.assessment import assess
from spab_core.ui.bearing import (
    coefficient_downloads,
    curves_now,
    derived_now,
    over_speed,
    over_whirl,
    speed_range,
)
from spab_core.ui.design_form import design_fields, design_files
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.solving import live_point, waits_for_compiler
from spab_core.ui.verdict import assessment_box, point_verdict
from spab_core.ui.view import (
    AGAINST,
    choice,
    chosen_design,
    chosen_limits,
    chosen_point,
    design_option,
    point_options,
)

page_head("all values of the design")


def verdict(found: Derived) -> None:
    """What motion and equilibrium are worth; the motion is solved if it is not yet."""
    with errors_in_words():
        point = live_point(design, mass, number, words=False)
    if point:
        point_verdict(point)
    else:
        assessment_box(assess(design, None, found, chosen_limits()))
    st.caption(
        "First line: the motion with unbalance, from a cold start. Second line: linear theory "
        "around the static equilibrium, without unbalance."
    )


def numbers(found: Derived) -> None:
    """Two rows of derived numbers."""
    rigid = found.shaft_stiffness_number == float("inf")
    cells = st.columns(5)
    cells[0].metric("Bearing number Λ", f"{found.bearing_number:.3g}", help="(6 μ ω / p_a)(R/C)²")
    cells[1].metric("Mass number M", f"{found.mass_number:.3g}", help="m_r C ω² / (p_a R²)")
    cells[2].metric(
        "Shaft stiffness K",
        "rigid" if rigid else f"{found.shaft_stiffness_number:.3g}",
        help="K_s C / (p_a R²)",
    )
    cells[3].metric("Feeding number β", f"{found.feeding_number:.3g}", help="6 κ R² / (H_p C³)")
    cells[4].metric("Load number W", f"{found.load_number:.3g}", help="m_r g / (p_a R²)")
    flow, film = found.gas_flow, found.least_film
    if flow is None or film is None:  # it does not rest on its film
        return
    cells = st.columns(5)
    cells[0].metric(
        "Eccentricity",
        f"{found.eccentricity:.3f}",
        help="Of the journal at rest on its film, over the clearance",
    )
    cells[1].metric(
        "Attitude angle",
        "none" if found.attitude_angle is None else f"{found.attitude_angle:.1f}°",
        help="From the load to the journal's displacement, with the rotation",
    )
    cells[2].metric("Least film", f"{1e6 * film:.1f} µm", help="C (1 - e), at rest on the film")
    cells[3].metric(
        "Gas flow, Nl/min",
        flow.words,
        help="Through the porous wall, net (negative: drawn in at the edges); normal litres per "
        f"minute, at 0 °C and 1.01325 bar. {flow.mass:.3g} kg/s of air at 20 °C",
    )
    cells[4].metric(
        "Whirl / speed",
        "none" if found.whirl is None else f"{found.whirl.ratio:.3f}",
        help="Frequency of the least stable whirl over the shaft speed",
    )
    if found.conical:
        st.caption(
            f"Conical motion: {found.conical.ratio:.3f} of the speed, growth "
            f"{found.conical.growth:+.3g} per revolution."
        )
    if found.axial and found.axial.ratio:
        st.caption(
            f"Along the axis: the least stable vibration at {found.axial.ratio:.3f} of the speed, "
            f"growth {found.axial.growth:+.3g} per revolution."
        )
    elif found.axial:
        st.caption(
            f"Along the axis the film does not hold the journal: a drift grows by "
            f"{found.axial.growth:.3g} per revolution."
        )


def wall_numbers(found: Derived) -> None:
    """A row of what the wall's pores do, where they store gas."""
    if found.penetration_depth is None:
        return
    cells = st.columns(3)
    cells[0].metric(
        "Storage number σ_w",
        f"{found.sigma_wall:.3g}",
        help="φ μ ω H_p² / (κ p_a): how slowly a pressure wave passes the wall, in shaft radians",
    )
    cells[1].metric("Pores' gas / film's", f"{found.pore_gas_ratio:.3g}")
    cells[2].metric(
        "Waves reach",
        f"{1e3 * found.penetration_depth:.2f} mm",
        help="Depth in the wall at which a pressure wave of the least stable whirl's frequency is "
        "down to 1/e",
    )


def assumption_panel(found: Derived) -> None:
    """What the theory assumes, in numbers."""
    broken = len(found.broken())
    title = "Assumptions: " + (f"{broken} outside the theory" if broken else "all hold")
    with st.expander(title, icon=":material/rule:" if not broken else ":material/warning:"):
        st.dataframe(
            pd.DataFrame(
                {
                    "Number": [one.name for one in found.assumptions],
                    "Value": [f"{one.value:.3g}" for one in found.assumptions],
                    "Limit": [f"{one.limit:.3g}" for one in found.assumptions],
                    "Holds": [one.holds for one in found.assumptions],
                    "Why this limit": [one.source for one in found.assumptions],
                }
            ),
            hide_index=True,
            key="assumptions",
        )


def rows(found: Coefficients) -> pd.DataFrame:
    """The eight coefficients, static and synchronous."""
    table = {name: found.column(name) for name in NAMES}
    return pd.DataFrame(table, index=["static", "synchronous"])


st.markdown("# All values of the design")
with point_bar(), st.popover("Start from, open, save", icon=":material/folder_open:"):
    design_files()
left, right = st.columns([1, 1.35], gap="large")
with left:
    design_fields()
design, (mass, number) = chosen_design(), chosen_point()
with right:
    if waits_for_compiler(design, mass, number, linear=True):
        st.stop()
    with errors_in_words():
        found = derived_now(design, mass, number)
    place = st.container()
    numbers(found)
    wall_numbers(found)
    assumption_panel(found)
    with place:
        verdict(found)
    if found.coefficients:
        a, b = st.columns([2, 1], vertical_alignment="bottom")
        against = choice(
            "Stiffness and damping of the film against", AGAINST, place=a, key="against"
        )
        with b:
            coefficient_downloads(
                design,
                mass,
                number,
                f"spab design coefficients{design_option()} --rotor-mass {mass:g} --rpm "
                f"{speed_range(design, number)} --out bearing.json",
            )
        if against == AGAINST[0]:
            with errors_in_words():
                table = over_whirl(design, mass, number)
                dotted = found.whirl.ratio if found.whirl else None
                figure = coefficient_figure(table, "frequency", dotted)
        else:
            with st.spinner("Linearising at 26 speeds …"), errors_in_words():
                table = over_speed(design, mass, number, FILM_WHIRL)
                figure = coefficient_figure(table, "speed", found.speed_rpm)
        st.plotly_chart(figure, key="coefficients", width="stretch")
        for words in coefficient_warnings(table):
            st.warning(words)
        st.caption(
            "Dotted, if in range: the rotor's least stable whirl. 1: synchronous."
            if against == AGAINST[0]
            else "Dotted: this speed. Each at the film's whirl, followed over speed: these give "
            "the right limit of stability."
        )
        st.dataframe(
            rows(found.coefficients),
            column_config={
                "_index": st.column_config.Column("N/m, N s/m", width=98),
                **{
                    name: st.column_config.NumberColumn(name, format="%.2e", width=66)
                    for name in NAMES
                },
            },
        )
    if st.toggle("Load curves", key="load_curves", help="What the bearing carries at this speed"):
        with st.spinner("Displacing the journal …"), errors_in_words():
            curves = curves_now(design, number)
        mark = (found.eccentricity, found.axial_offset)
        figure = load_figure(curves, mark if found.status == "ok" else None)
        st.plotly_chart(figure, key="curves", width="stretch")
        st.caption(
            "The journal displaced radially in the middle of the band, and along the axis without "
            "radial displacement; film alone, wall steady. Dotted: where it rests."
        )
    st.caption(
        f"The same on the command line: `spab design show{design_option()} {point_options()}`"
    )
