"""Tolerances and better drawings on pages: what is asked, what was found."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import streamlit as st

from spab_core.common.errors import InputError
from spab_core.common.validation import check_number
from spab_core.design.form import unused
from spab_core.design.model import Design
from spab_core.design.tolerances import (
    ROTOR_MASS,
    SPEED,
    UNBALANCE,
    VALUES,
    Machine,
    Tolerance,
    Tolerances,
    Value,
    list_text,
    parse_list,
    parse_ranges,
    parse_tolerance,
    parse_tolerances,
    ranges_text,
    value_of,
)
from spab_core.drawings.drivers import CONFIDENCE
from spab_core.drawings.improve import DRAWN as DRAWN_WITHIN
from spab_core.drawings.improve import (
    SEARCHED,
    WISHES,
    Improvement,
    Ranges,
    load_improvement,
)
from spab_core.drawings.tolerance import LEARNED, MACHINES, ToleranceStudy, load_study
from spab_core.jobs.store import Job, list_jobs
from spab_core.maps.sensitivity import AXES
from spab_core.plotting.drawings import (
    drivers_figure,
    front_figure,
    shares_figure,
    spread_figure,
)
from spab_core.reporting.drawings import NOT_MORE, improvement_section, tolerance_section
from spab_core.reporting.report import Section
from spab_core.trajectory.assessment import GRADES, Limits
from spab_core.ui.design_form import take_design
from spab_core.ui.downloads import downloads
from spab_core.ui.solving import live_point
from spab_core.ui.verdict import grade_box, point_verdict
from spab_core.ui.view import (
    DRAW_TABS,
    DRAWN,
    WISH_PAIRS,
    chosen_design,
    chosen_point,
    design_option,
    limits_option,
    set_limits,
    show_tolerances,
)

_USUAL = "± 10 %"  # of a value that just got a tolerance
_FACTORS = (0.6, 1.6)  # of a value that may just move
_CELL = 340  # pixels of a range in the form
_SAME = 1e-5  # relative: speeds are kept to six digits


def chosen_machine() -> Machine:
    """The machine that the user works on."""
    design, (mass, number) = chosen_design(), chosen_point()
    return Machine(design, mass, design.speed_rpm(number))


def _tolerable(machine: Machine) -> list[str]:
    """Names of the values that may have a tolerance: what is used, finite and not 0."""
    values, idle = machine.values(), unused(machine.design)
    return [
        name
        for name, v in VALUES.items()
        if name not in idle and math.isfinite(values[name]) and (values[name] or v.from_zero)
    ]


def _shown(value: Value, machine: Machine) -> str:
    at = f"{machine.values()[value.name]:.5g} {value.unit}".strip()
    return f"{value.label}, drawn {at}"


def tolerance_fields(machine: Machine) -> Tolerances | None:
    """Ask which values have a tolerance and how large; None where something typed is wrong."""
    state = st.session_state
    kept = {t.name: t.text for t in parse_list(state["tolerances"])}
    allowed = _tolerable(machine)
    chosen = _several("Values with a tolerance", allowed, kept, "tolerances_of")
    found, wrong = list[Tolerance](), False
    columns = st.columns(3) if chosen else ()
    for k, name in enumerate(chosen):
        value, key = VALUES[name], f"tolerance_{name}"
        if key not in state:
            usual = "up to G 2.5" if name == UNBALANCE else _USUAL
            state[key] = kept.get(name, usual)
        with columns[k % 3]:
            text = st.text_input(
                _shown(value, machine),
                key=key,
                max_chars=80,
                help=f"± 2 {value.unit}, ± 8 %, ± 8 % normal (cut there)".replace("  ", " ")
                + (", up to G 2.5 (balance grade)" if name == UNBALANCE else ""),
            )
            try:
                found.append(parse_tolerance(value.key, text))
            except InputError as error:
                st.error(f"{error}.")
                wrong = True
    if wrong:
        return None
    state["tolerances"] = list_text(tuple(found))
    return tuple(found)


def _several(label: str, allowed: list[str], kept: dict[str, Any], key: str) -> list[str]:
    """Ask for several values, those kept in the address at first; names in their usual order."""
    state = st.session_state
    if key not in state:
        state[key] = [name for name in kept if name in allowed]
    state[key] = [name for name in state[key] if name in allowed]
    chosen = st.multiselect(
        label, allowed, key=key, format_func=lambda name: VALUES[name].label, max_selections=12
    )
    return [name for name in VALUES if name in chosen]


def range_fields(machine: Machine) -> Ranges | None:
    """Ask which values may move between which bounds; None where something typed is wrong."""
    state, values = st.session_state, machine.values()
    kept = parse_ranges(state["ranges"])
    allowed = [name for name in _tolerable(machine) if name not in (ROTOR_MASS, SPEED)]
    chosen = _several("Values that may move", allowed, kept, "ranges_of")
    found: Ranges = {}
    wrong = False
    grid = st.container(horizontal=True)
    for name in chosen:
        value = VALUES[name]
        usual = tuple(float(f"{f * values[name]:.3g}") for f in _FACTORS)
        low, high = kept.get(name, usual if values[name] else (0.0, 1.0))
        cell = grid.container(width=_CELL, gap="xsmall")
        cell.caption(f"{_shown(value, machine)}: from, to")
        row = cell.container(horizontal=True)
        ends = []
        for key, which, usual_end in ((f"low_{name}", "from", low), (f"high_{name}", "to", high)):
            if key not in state:
                state[key] = usual_end
            label = f"{value.label} {which}, {value.unit}".rstrip(", ")
            ends.append(
                row.number_input(
                    label, value=None, key=key, format="%g", label_visibility="collapsed"
                )
            )
        try:
            typed = [end for end in ends if end is not None]
            if len(typed) < 2:
                raise InputError(f"{value.label}: type both numbers")
            for end in typed:
                check_number(value.label, end, 0.0, 1e12, value.unit)
                machine.replace({name: end})
            if not typed[0] < typed[1]:
                raise InputError(f"{value.label}: the second number must be the larger one")
            found[name] = (float(typed[0]), float(typed[1]))
        except InputError as error:
            cell.error(f"{error}.")
            wrong = True
    if wrong:
        return None
    state["ranges"] = ranges_text(found)
    return found


def show_request(kind: str, parameters: dict[str, Any]) -> None:
    """Put a job's request into the widgets, in a widget's callback."""
    state, p = st.session_state, parameters
    state["draw_tab"] = DRAW_TABS[kind == "improve"]
    tolerances = parse_tolerances(p["tolerances"])
    show_tolerances(tolerances)
    set_limits(Limits(**p.get("limits", {})))
    state["draw_axis"] = p["axis"] if p["axis"] in AXES else AXES[0]
    if kind == "tolerance":
        state["machines"] = p["machines"] if p["machines"] in DRAWN else MACHINES
        state["wanted"] = 100.0 * p["wanted"]
    else:
        state["ranges"] = ranges_text(
            {key.replace(".", "__"): (b[0], b[1]) for key, b in p["ranges"].items()}
        )
        pair = ", ".join(p["wishes"])
        state["wish"] = pair if pair in WISH_PAIRS else WISH_PAIRS[0]
        state["most_flow"] = p["most_gas_flow"] or 0.0
        state["least_stiffness"] = 1e-6 * p["least_stiffness"]
        state["held_film"] = 1e6 * p["least_film"]
        state["worst_grade"] = p["grade"]
        state["load"], state["within"] = p["load"], bool(tolerances)
    for key in list(state):
        if str(key).startswith(("low_", "high_", "ranges_of")):
            del state[key]


def wish_words(pair: str) -> str:
    """Two wishes in words."""
    first, second = (WISHES[name] for name in pair.split(", "))
    return f"{first.label.lower()} and {second.label.lower()}"


@st.cache_resource(max_entries=16, show_spinner=False)
def _study(path: Path, stamp: float) -> ToleranceStudy:
    return load_study(path)


def study_of_job(job: Job) -> ToleranceStudy:
    """The study that a finished job has found; raises ``InputError`` for a damaged file."""
    return _study(job.result, job.result.stat().st_mtime)


@st.cache_resource(max_entries=16, show_spinner=False)
def _improvement(path: Path, stamp: float) -> Improvement:
    return load_improvement(path)


def improvement_of_job(job: Job) -> Improvement:
    """The front that a finished job has found; raises ``InputError`` for a damaged file."""
    return _improvement(job.result, job.result.stat().st_mtime)


def sections_of(design: Design, rotor_mass: float, speed_rpm: float) -> list[Section]:
    """Sections of a report: the last tolerances and better drawings found for a machine."""
    found: dict[str, Section] = {}
    for job in list_jobs():
        p = job.parameters
        if job.kind not in ("tolerance", "improve") or job.kind in found or job.state != "done":
            continue
        try:
            same = (
                Design.from_dict(p["design"]) == design
                and math.isclose(p["rotor_mass"], rotor_mass, rel_tol=_SAME)
                and math.isclose(p["speed_rpm"], speed_rpm, rel_tol=_SAME)
            )
            if same and job.kind == "tolerance":
                found[job.kind] = tolerance_section(study_of_job(job))
            elif same:
                found[job.kind] = improvement_section(improvement_of_job(job))
        except (InputError, OSError, KeyError):
            continue  # a damaged result is told where it is opened
    return [found[kind] for kind in ("tolerance", "improve") if kind in found]


def _machine_options(machine: Machine) -> str:
    return f"--rotor-mass {machine.rotor_mass:.6g} --rpm {machine.speed_rpm:.6g}"


def _within_options(tolerances: Tolerances) -> str:
    return "".join(f" --within {VALUES[t.name].key} '{t.text}'" for t in tolerances)


def show_study(study: ToleranceStudy) -> None:
    """What was found within tolerances: shares, what drives them, distributions, what to narrow."""
    share, low, high = study.shares()["good"]
    # a verdict for the drawing: by the lower end of the interval, never by the middle
    grade = "good" if low >= study.wanted else "watch" if high >= study.wanted else "avoid"
    grade_box(
        f"**{100 * share:.0f} % of the machines built are predicted good** ({100 * low:.0f} to "
        f"{100 * high:.0f} %, {100 * CONFIDENCE:g} % Wilson interval of {study.count:,} machines "
        f"drawn and solved; wanted {100 * study.wanted:g} %)",
        grade,
    )
    shares = shares_figure(study)
    st.plotly_chart(shares, key="shares", width="stretch")
    what, table = study.drivers
    left, right = st.columns(2, gap="large")
    figures = {"Shares": shares}
    with left:
        st.markdown("## What drives it")
        if len(table) and table.attrs["explained"] >= LEARNED:
            figures["Drivers"] = drivers_figure(what, table)
            st.plotly_chart(figures["Drivers"], key="drivers", width="stretch")
            st.caption(
                f"Sobol' indices of a forest that explains "
                f"{100 * table.attrs['explained']:.0f} % of the variance of machines it has not "
                "seen; lines: the spread of forests on machines drawn again."
            )
        else:
            st.caption("What drives it cannot be told from these machines.")
    with right:
        st.markdown("## Machines")
        columns = ["margin", "least_film"] if study.look.axis else ["least_film"]
        for column in columns:
            figures[column.replace("_", " ").capitalize()] = spread_figure(study, column)
            st.plotly_chart(
                figures[column.replace("_", " ").capitalize()], key=f"of_{column}", width="stretch"
            )
    sentences = study.sentences()
    st.markdown("\n".join(f"- {text}" for text in sentences))
    narrow = study.narrowings
    if narrow["factor"].notna().any():
        _narrowings(narrow)
    st.caption(NOT_MORE)
    downloads(
        "tolerances",
        figures,
        {"Machines": study.table, "Narrowings": lambda: narrow, "Drivers": lambda: table},
        command=f"spab design tolerance {_machine_options(study.machine)}{design_option()}"
        f"{_within_options(study.tolerances)} --axis {study.look.axis or 'none'} --machines "
        f"{study.count} --half-width 0 --wanted {study.wanted:g}"
        f"{limits_option(study.look.limits)} --seed {study.seed}",
    )


def _narrowings(narrow: pd.DataFrame) -> None:
    """How far each tolerance has to be narrowed, as a table."""
    st.dataframe(
        narrow.assign(
            value=[value_of(v).label for v in narrow["value"]],
            **{c: 100.0 * narrow[c] for c in ("factor", "share", "low", "high")},
        ),
        hide_index=True,
        column_config={
            "value": "value",
            "tolerance": "tolerance",
            "factor": st.column_config.NumberColumn("to be narrowed to, %", format="%.0f"),
            "narrowed": "that is",
            "share": st.column_config.NumberColumn("good then, %", format="%.0f"),
            "low": st.column_config.NumberColumn("from, %", format="%.0f"),
            "high": st.column_config.NumberColumn("to, %", format="%.0f"),
            "machines": st.column_config.NumberColumn("machines behind it", format="%.0f"),
        },
    )


def _use(machine: Machine) -> None:
    take_design(machine.design, machine.rotor_mass, machine.speed_rpm)


def _clicked(found: Improvement) -> None:
    """A point of the front was clicked."""
    state = st.session_state
    for point in state["front"]["selection"]["points"]:
        if data := point.get("customdata"):
            state["drawing"] = int(data[0]) + 1


def show_front(found: Improvement) -> None:
    """The front, the drawing chosen on it, what it costs, its verdict, a button that takes it."""
    st.markdown("\n".join(f"- {text}" for text in found.sentences()))
    if not found.count:
        grade_box("No drawing within these ranges holds what must hold.", "avoid")
        return
    state = st.session_state
    usual = (found.best if found.best is not None else 0) + 1
    if not 1 <= state.get("drawing", 0) <= found.count:
        state["drawing"] = usual
    left, right = st.columns([1.3, 1], gap="large")
    with right:
        st.selectbox(
            "Drawing",
            range(1, found.count + 1),
            key="drawing",
            help="Or click a point of the front",
            format_func=lambda k: f"{k}, {_drawing_words(found, k - 1)}",
        )
    k = state["drawing"] - 1
    figure = front_figure(found, k)
    with left:
        st.plotly_chart(
            figure,
            key="front",
            width="stretch",
            on_select=partial(_clicked, found),
            selection_mode="points",
        )
    machine = found.machine_at(k)
    with right:
        _confirmation(found, k)
        st.button(
            "Use this design", key="use_drawing", type="primary", on_click=_use, args=(machine,)
        )
        bought = found.bought(k)
        st.dataframe(
            bought,
            hide_index=True,
            height="content",
            column_config={
                name: st.column_config.NumberColumn(name, format="%.4g")
                for name in ("before", "after")
            },
        )
    with left:
        point = live_point(machine.design, machine.rotor_mass, machine.bearing_number)
        if point is not None:
            point_verdict(point)
    downloads(
        "improve",
        {"Front": figure},
        {"Front": found.table, "Bought": lambda: pd.DataFrame(bought)},
        command=_improve_command(found),
    )


def _drawing_words(found: Improvement, k: int) -> str:
    told = []
    for name in found.wishes:
        wish = WISHES[name]
        number = wish.factor * float(found.rows[wish.column][k])
        told.append(f"{wish.label.lower()} {number:.3g} {wish.unit}")
    return ", ".join(told)


def _confirmation(found: Improvement, k: int) -> None:
    """Whether a drawing is good on the finer mesh too, and within its tolerances."""
    finer = found.finer
    words = (
        f"Solved: {GRADES[found.rows['grade'][k]]}, margin +{100 * found.rows['margin'][k]:.0f} %; "
        f"on a finer mesh, at points {100 * (SEARCHED - 1):.0f} % apart, "
        f"{GRADES[finer['grade'][k]]}, +{100 * finer['margin'][k]:.0f} %."
    )
    share, low, high = found.shares[k]
    grade = GRADES[finer["grade"][k]] if found.confirmed[k] else "avoid"
    if math.isfinite(share):
        words += (
            f" Within the tolerances {100 * share:.0f} % of {DRAWN_WITHIN} machines are good "
            f"({100 * low:.0f} to {100 * high:.0f} %)."
        )
        grade = "watch" if grade == "good" and low < 0.5 else grade
    grade_box(words, grade)


def _improve_command(found: Improvement) -> str:
    vary = "".join(
        f" --vary {VALUES[n].key} '{low:.6g}:{high:.6g} {VALUES[n].unit}'"
        for n, (low, high) in found.ranges.items()
    )
    holds = found.holds
    flow = f" --most-gas-flow {holds.gas_flow:g}" if math.isfinite(holds.gas_flow) else ""
    stiff = f" --least-stiffness {1e-6 * holds.stiffness:g}" if holds.stiffness else ""
    film = f" --held-film {1e6 * holds.least_film:g}" if holds.least_film else ""
    wishes = "".join(f" --wish {name}" for name in found.wishes)
    return (
        f"spab design improve {_machine_options(found.machine)}{design_option()}{vary}{wishes}"
        f" --axis {found.look.axis} --grade {holds.grade}{flow}{stiff}{film}"
        f" --load {found.look.load:g}{_within_options(found.tolerances)}"
        f"{limits_option(found.look.limits)} --seed {found.seed}"
    )
