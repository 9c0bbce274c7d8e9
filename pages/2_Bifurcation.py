"""Bifurcation diagrams: section and exponent along a line, the paper's two from the shipped data,
any other computed live.
"""

import streamlit as st

from spab_core.active_learning.quick_map import ends_around
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.jobs.kinds import workers_for
from spab_core.maps.bifurcation import SWEEPS, line_of_map
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.lines import COORDINATES
from spab_core.shipped.manifest import ARTIFACTS, BIFURCATIONS
from spab_core.trajectory.expected_time import expected_seconds
from spab_core.trajectory.provenance import film_nodes
from spab_core.ui import own_map
from spab_core.ui.jobs import AUTO, job_panel, solves_unasked
from spab_core.ui.lines import done_with_more, line_command, line_of_job, line_view, shipped_line
from spab_core.ui.point import chosen_settings, duration, solver_controls
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, page_head, reference_map
from spab_core.ui.view import (
    LINES,
    VIEW,
    choice,
    chosen_design,
    chosen_point,
    design_option,
    is_reference,
    number_field,
    show_usual,
)

page_head("speed and mass sweeps")
state = st.session_state
POINT = ("rotor_mass", "bearing_number")
if (
    state["line"] == "paper"
    and not state.get("line_chosen")
    and (not is_reference() or any(state[key] != VIEW[key].default for key in POINT))
):
    state["line"] = "rotor-mass"  # who comes with a point of their own wants the line through it


def _chosen() -> None:
    state["line_chosen"] = True


st.markdown("# Speed and mass sweeps")
point_bar()
a, b, c = st.columns([2.6, 1.2, 1.2], vertical_alignment="bottom")
kind = choice(
    "Line",
    LINES,
    place=a,
    key="line",
    on_change=_chosen,
    format_func={
        "paper": "The paper's two lines",
        "rotor-mass": "Over mass, through my point",
        "bearing-number": "Over Λ, through my point",
    }.__getitem__,
)
coordinates = (
    b.pills(
        "Coordinates, over C",
        COORDINATES,
        selection_mode="multi",
        key="coordinates",
        help="X₂, Y₂: journal; X₁, Y₁: disc; at τ = 2πk",
    )
    or VIEW["coordinates"].default
)
sweeps = (
    c.pills(
        "Sweeps",
        SWEEPS,
        selection_mode="multi",
        key="sweeps",
        help="cold: every point from rest; up, down: each point from where its neighbour ended, "
        "which shows motions that exist side by side",
    )
    or VIEW["sweeps"].default
)
coordinates, sweeps = (
    [k for k in COORDINATES if k in coordinates],
    [k for k in SWEEPS if k in sweeps],
)
mass, number = chosen_point()

if kind == "paper":
    for column, name in zip(st.columns(2, gap="medium"), BIFURCATIONS, strict=True):
        with column, errors_in_words():
            line = shipped_line(name)
            over_mass = line.vary == "rotor-mass"
            other, value = (number, mass) if over_mass else (mass, number)
            title = (
                f"Over rotor mass at Λ = {line.at:g}"
                if over_mass
                else f"Over bearing number at {line.at:g} kg"
            )
            line_view(
                line,
                coordinates,
                sweeps,
                value if is_reference() and other == line.at else None,
                title,
                name=f"bifurcation_{line.vary}",
                file=ARTIFACTS / name,
                command=line_command(line, sweeps),
                height=415,
            )
    st.caption(
        f"Reference bearing, {film_nodes(line.metadata)}, {line.metadata['transient']} + "
        f"{line.metadata['revolutions']} revolutions a point, shipped with spab."
    )
    st.stop()

over_mass = kind == "rotor-mass"
along, limits, unit = (
    ("mass", ROTOR_MASS_RANGE, "kg") if over_mass else ("number", BEARING_NUMBER_RANGE, "Λ")
)
row = st.container(horizontal=True, vertical_alignment="bottom")
start, stop = (
    number_field(
        f"{name.capitalize()}, {unit}",
        *limits,
        place=row,
        **show_usual(f"{along}_{name}", usual, limits),
        step=0.1,
        format="%.4g",
        width=160,
        help="By default from a quarter of the point to three times it",
    )
    for name, usual in zip(
        ("from", "to"), ends_around(mass if over_mass else number, limits), strict=True
    )
)
count = int(number_field("Points", 2, 2000, place=row, key="points", step=10, width=160))
with row.popover("Solver", icon=":material/memory:"):
    solver_controls(cost=False)


def _known_map() -> tuple[StabilityMap, str, str] | None:
    """A map of the design that the point lies in, its name, and what to say of its cells."""
    if is_reference():
        return reference_map(), "the shipped map", ""
    shown = own_map.map_of(chosen_design(), mass, number)
    if shown is None or own_map.cell_of(shown.found[1], mass, number) is None:
        return None
    name = f"the shipped example ({shown.shipped.label})" if shown.shipped else "its map"
    return shown.found[1], name, ", solved or predicted"


at, value = (number, mass) if over_mass else (mass, number)
with errors_in_words():
    settings = chosen_settings()
    parameters = {
        "design": chosen_design().to_dict(),
        "vary": kind,
        "at": at,
        "range": f"{start!r}:{stop!r}:{count}",
        "sweeps": sweeps,
        "settings": settings.to_dict(),
    }
    job = done_with_more("bifurcation", parameters)
    points = count * len(sweeps)
    seconds = (
        points * expected_seconds(settings, number if over_mass else start) / workers_for(points)
    )
    label = f"Compute {points:,} points (up to {duration(max(seconds, 1.0))})"
auto = seconds <= AUTO and solves_unasked()
job = job or job_panel("bifurcation", parameters, label, "line_job", auto=auto)
title = (
    f"Over rotor mass at Λ = {at:.4g} ({chosen_design().speed_rpm(at):,.0f} rpm)"
    if over_mass
    else f"Over bearing number at {at:.4g} kg"
)
with errors_in_words():
    if job:
        line = line_of_job(job)
        line_view(
            line,
            coordinates,
            sweeps,
            value,
            title,
            name="bifurcation",
            file=job.result,
            command=line_command(line, sweeps, design_option()),
            height=600,
            beside=True,
        )
    elif source := _known_map():
        m, whose, more = source
        line = line_of_map(m, kind, at)
        line_view(
            line,
            (),
            ["cold"],
            value,
            f"{title}: exponent, as {whose} has it",
            name="preview",
            file=None,
            command=line_command(line, ["cold"], design_option()),
            height=380,
            beside=True,
        )
        st.caption(
            "The map's cells at "
            f"{'Λ = ' if over_mass else ''}{line.at:.4g}{'' if over_mass else ' kg'}, the nearest"
            f"{more}. The section and the other sweeps have to be computed."
        )
