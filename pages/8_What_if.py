"""What if: how the margin moves with the drawing, what a run-up crosses, two designs compared."""

from dataclasses import asdict

import pandas as pd
import streamlit as st

from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import read_design_bytes
from spab_core.design.presets import PRESETS
from spab_core.maps.bifurcation import interval_table, line_verdict
from spab_core.maps.sensitivity import (
    AXES,
    SCAN,
    STEPS,
    MachineMargin,
    load_sensitivity,
)
from spab_core.plotting.point import orbit_figure, orbit_words
from spab_core.plotting.sensitivity import run_up_figure, tornado_figure
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES
from spab_core.trajectory.expected_time import expected_seconds
from spab_core.trajectory.settings import Settings
from spab_core.ui.downloads import downloads
from spab_core.ui.jobs import AUTO, job_panel, solves_unasked
from spab_core.ui.lines import band_table, line_command, line_of_job
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.solving import live_point
from spab_core.ui.verdict import assumed_line, grade_box, grade_label, point_rows, point_verdict
from spab_core.ui.view import (
    SCANS,
    SPEEDS,
    WHAT_TABS,
    choice,
    chosen_design,
    chosen_limits,
    chosen_point,
    design_option,
    number_field,
    show_usual,
)

page_head("what if")
st.markdown("# What if")
point_bar()
design, (mass, number) = chosen_design(), chosen_point()
rpm = design.speed_rpm(number)
st.caption("The machine keeps its mass and speed when its bearing changes.")
drawing, run_up, two = st.tabs(WHAT_TABS, key="what_tab", on_change="rerun")


def change_the_drawing() -> None:
    """How the margin moves with each value of the drawing."""
    row = st.container(horizontal=True, vertical_alignment="bottom")
    axis = choice("Margin in", AXES, place=row, key="what_axis")
    step = number_field(
        "Change of each value, %",
        100 * STEPS[0],
        100 * STEPS[1],
        place=row,
        key="what_step",
        step=1.0,
        width=200,
    )
    scan = number_field(
        "Points to each side",
        *SCANS,
        place=row,
        key="what_scan",
        width=200,
        help="From half to twice the operating point; a band narrower than their distance can be "
        "missed",
    )
    with errors_in_words():
        asked = {
            "design": design.to_dict(),
            "rotor_mass": mass,
            "speed_rpm": rpm,
            "axis": axis,
            "step": step / 100.0,
            "scan": int(scan),
            "limits": asdict(chosen_limits()),
        }
        job = job_panel(
            "sensitivity",
            asked,
            "Compute the sensitivity (up to a minute)",
            "what_job",
            auto=scan <= SCAN and solves_unasked(),
        )
        if job:
            show_sensitivity(*load_sensitivity(job.result))


def show_sensitivity(base: MachineMargin, table: pd.DataFrame) -> None:
    """The margin in words, its changes as a figure and a table."""
    unit = "rpm" if base.axis == "speed" else "kg"
    grade_box(base.verdict(), base.grade)
    assumed_line()
    figure = tornado_figure(base, table)
    st.plotly_chart(figure, key="tornado", width="stretch")
    st.dataframe(
        table.assign(
            factor=100.0 * (table["factor"] - 1.0),
            assessment=table["assessment"].map(grade_label),
            distance=100.0 * table["distance"],
            change=100.0 * table["change"],
        ),
        hide_index=True,
        column_config={
            "factor": st.column_config.NumberColumn("change, %", format="%+.0f"),
            "below": st.column_config.NumberColumn(f"border below, {unit}", format="%.4g"),
            "below_what": "what there",
            "above": st.column_config.NumberColumn(f"border above, {unit}", format="%.4g"),
            "above_what": "what above",
            "distance": st.column_config.NumberColumn("margin, %", format="%.1f"),
            "change": st.column_config.NumberColumn("its change, %", format="%+.1f"),
        },
    )
    downloads("what_if", {"Tornado": figure}, {"Sensitivity": lambda: table})


def run_the_machine_up() -> None:
    """What a slow run-up of the machine crosses."""
    row = st.container(horizontal=True, vertical_alignment="bottom")
    low, high = (design.speed_rpm(limit) for limit in BEARING_NUMBER_RANGE)
    first, last = (
        number_field(
            f"{name}, rpm",
            low,
            high,
            place=row,
            **show_usual(key, usual, (low, high)),
            format="%.0f",
            width=160,
        )
        for name, key, usual in (("From", "run_from", 0.05 * rpm), ("To", "run_to", 1.5 * rpm))
    )
    count = number_field("Speeds", *SPEEDS, place=row, key="run_count", width=160)
    with errors_in_words():
        start, stop = first / design.speed_rpm(1.0), last / design.speed_rpm(1.0)
        asked = {
            "design": design.to_dict(),
            "vary": "bearing-number",
            "at": mass,
            "range": f"{start!r}:{stop!r}:{int(count)}",
            "sweeps": ["up"],
            "settings": {"transient": 200, "revolutions": 200},
        }
        seconds = count * expected_seconds(Settings(transient=200, revolutions=200), stop)
        auto = seconds <= AUTO and solves_unasked()
        job = job_panel("bifurcation", asked, "Compute the run-up", "run_job", auto=auto)
        if job:
            line = line_of_job(job)
            worst, words = line_verdict(line, "up")
            grade_box(f"The run-up. {words}", worst)
            assumed_line()
            figure, found = run_up_figure(line), interval_table(line, ["up"])
            st.plotly_chart(figure, key="run_up", width="stretch")
            left, right = st.columns([1, 1])
            with left:
                band_table(found.drop(columns=["sweep", "first", "last"]), "run_up_bands", "")
            with right:
                st.caption(
                    "Each speed from where the one before ended, settled there: slow compared "
                    "with the rotor's own motion. A fast run-up crosses narrow bands before they "
                    "build up. Bands are judged by the motion alone: resonance and stability at "
                    "rest where a point is solved alone."
                )
                downloads(
                    "run_up",
                    {"Run-up": figure},
                    {"Bands": lambda: found},
                    {"npz": job.result.read_bytes},
                    line_command(line, ["up"], design_option()),
                )


def two_designs() -> None:
    """The design beside another one at the same mass and speed."""
    row = st.container(horizontal=True, vertical_alignment="bottom")
    name = row.selectbox(
        "Compare with",
        list(PRESETS),
        key="two_preset",
        width=260,
        format_func=lambda k: PRESETS[k].label,
    )
    file = row.file_uploader("or a design file (TOML)", "toml", key="two_file", width=420)
    with errors_in_words():
        other = read_design_bytes(file.getvalue(), file.name) if file else PRESETS[name].design
        sides = (
            ("This design", design),
            (f"Other: {file.name if file else PRESETS[name].label}", other),
        )
        judged: dict[str, str] = {}
        columns: dict[str, dict[str, str]] = {}
        for box, (title, one) in zip(st.columns(2, gap="medium"), sides, strict=True):
            at = one.bearing_number(design.speed(number))
            with box:
                st.markdown(f"**{title}** at {rpm:,.0f} rpm, Λ {at:.3f}, {mass:g} kg")
                point = live_point(one, mass, at)
                if point is None:
                    continue
                point_verdict(point)
                st.plotly_chart(orbit_figure(point), key=f"two_{len(columns)}", width="stretch")
                if words := orbit_words(point):
                    st.caption(words)
                judged[title] = point.assessment(chosen_limits()).grade
                columns[title] = point_rows(point)
        if len(judged) == len(sides):
            better = min(judged, key=lambda title: GRADES.index(judged[title]))
            if len(set(judged.values())) == 1:
                words = f"Both are {GRADE_WORDS[judged[better]]}."
            else:
                other_one = next(title for title in judged if title != better)
                words = (
                    f"Better judged: {better} ({GRADE_WORDS[judged[better]]}; the other is "
                    f"{GRADE_WORDS[judged[other_one]]})."
                )
            grade_box(words, judged[better])
        if columns:
            st.dataframe(pd.DataFrame(columns).rename_axis("at this point"))


for tab, content in (
    (drawing, change_the_drawing),
    (run_up, run_the_machine_up),
    (two, two_designs),
):
    if tab.open:
        with tab:
            content()
