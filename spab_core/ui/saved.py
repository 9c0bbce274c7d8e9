"""Saved results: every job of this user, what it is of and what it found, and what can be done with
it.
"""

from __future__ import annotations

import dataclasses
import datetime
from pathlib import Path
from typing import Any

import pandas as pd
import streamlit as st

from spab_core.active_learning.refine import load_refinement
from spab_core.common.errors import InputError
from spab_core.common.words import capital
from spab_core.design.form import FIELDS, to_form
from spab_core.design.model import Design, reference_design
from spab_core.design.presets import PRESETS
from spab_core.drawings.improve import load_improvement
from spab_core.drawings.tolerance import load_study
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import (
    NAME_LENGTH,
    Job,
    cancel,
    delete,
    list_jobs,
    rename,
    submit,
)
from spab_core.maps.bifurcation import line_verdict, load_bifurcation
from spab_core.maps.sensitivity import load_sensitivity
from spab_core.trajectory.assessment import Limits
from spab_core.trajectory.point_file import load_point
from spab_core.trajectory.regimes import NO_EXPONENT
from spab_core.ui.downloads import file_button
from spab_core.ui.drawings import show_request
from spab_core.ui.navigation import page_path
from spab_core.ui.running import label, time_left
from spab_core.ui.shared import errors_in_words
from spab_core.ui.view import (
    EXAMPLE,
    chosen_design,
    chosen_limits,
    note_typed,
    set_design,
    set_limits,
    set_point,
    with_unit,
)

SHOWN = 15  # jobs, before all are asked for
_OPEN = "_open_page"
_PAGES = {  # that show the result of a kind, by their names
    "bifurcation": "Bifurcation",
    "point": "Operating_point",
    "map": "My_map",
    "sensitivity": "What_if",
    "tolerance": "Tolerances_and_improvements",
    "improve": "Tolerances_and_improvements",
    "ranking": "Model_ranking",
    "intervals": "Surrogate_map",
}


def design_of(job: Job) -> Design | None:
    """The design that a job is of; None where it has none, or none that can be read."""
    try:
        return Design.from_dict(job.parameters["design"])
    except (KeyError, TypeError, InputError):
        return None


def name_of(design: Design) -> str:
    """A design in a few words: a preset's label, or what differs from the reference."""
    for preset in PRESETS.values():
        if preset.design == design:
            return EXAMPLE if design == reference_design() else preset.label
    usual, values = to_form(reference_design()), to_form(design)
    told = [
        f"{FIELDS[name].symbol} {with_unit(FIELDS[name], values[name])}"
        for name in FIELDS
        if values[name] != usual[name]
    ]
    return f"own design ({', '.join(told[:4])}{', …' if len(told) > 4 else ''})"


def place_of(job: Job) -> str:
    """The operating point, line or plane that a job is of, in the units of the machine."""
    p, design = job.parameters, design_of(job)
    if job.kind in ("intervals", "ranking") or design is None:
        return f"{p['model']}, n/{p['divisor']}, seed {p['seed']}" if "model" in p else ""
    rpm = design.speed_rpm(1.0)
    try:
        if job.kind == "point":
            return f"{p['rotor_mass']:.4g} kg at {p['bearing_number'] * rpm:,.0f} rpm"
        if job.kind in ("sensitivity", "tolerance", "improve"):
            return f"{p['rotor_mass']:.4g} kg at {p['speed_rpm']:,.0f} rpm"
        if job.kind == "map":
            number, mass = _ends(p["bearing_number"]), _ends(p["rotor_mass"])
            return (
                f"{number[0] * rpm:,.0f} to {number[1] * rpm:,.0f} rpm, {mass[0]:.4g} to "
                f"{mass[1]:.4g} kg"
            )
        low, high = _ends(p["range"])
        if p["vary"] == "rotor-mass":
            return f"{low:.4g} to {high:.4g} kg at {p['at'] * rpm:,.0f} rpm"
        return f"{low * rpm:,.0f} to {high * rpm:,.0f} rpm at {p['at']:.4g} kg"
    except (KeyError, TypeError, ValueError):
        return ""


def _ends(axis: str) -> tuple[float, float]:
    start, stop, _ = axis.split(":")
    return float(start), float(stop)


@st.cache_resource(max_entries=64, show_spinner=False)
def _headline(kind: str, path: Path, stamp: float, limits: Limits) -> str:
    if kind == "point":
        return load_point(path).assessment(limits).motion
    if kind == "bifurcation":
        line = dataclasses.replace(load_bifurcation(path), limits=limits)
        bands = (f"{name}: {line_verdict(line, name)[1]}" for name in line.branches)
        return f"{len(line.values)} points, {' '.join(bands)}"
    if kind == "map":
        r = load_refinement(path)
        share = pd.Series(r.regime.ravel()).value_counts(normalize=True)
        told = ", ".join(f"{100 * v:.0f} % {k or NO_EXPONENT}" for k, v in share.items())
        return f"{int(r.solved.sum()):,} of {r.batch.size:,} cells solved; {told}."
    if kind == "sensitivity":
        return load_sensitivity(path)[0].verdict()
    if kind == "tolerance":
        return load_study(path).sentences()[0]
    if kind == "improve":
        return " ".join(load_improvement(path).sentences()[:2])
    if kind == "ranking":
        return f"{len(pd.read_csv(path)):,} scores of models."
    return "Intervals calibrated."


def headline(job: Job) -> str:
    """What a job found, in a sentence; what went wrong, or how far it is."""
    if job.state == "failed":
        return f"{capital(job.message)}."
    if job.active or job.state == "cancelled":
        far = f"{job.done:,} of {job.total:,}" if job.total else ""
        return ", ".join(filter(None, (far, job.message, time_left(job.seconds_left))))
    try:
        return _headline(job.kind, job.result, job.result.stat().st_mtime, chosen_limits())
    except (InputError, OSError, ValueError) as error:
        return f"The result cannot be read: {error}."


def open_job(job: Job) -> None:
    """Make what a job is of what the user works on; its page opens in the next run. Call it in a
    widget's callback.
    """
    state, p, design = st.session_state, job.parameters, design_of(job)
    state[_OPEN] = _PAGES[job.kind]
    if job.kind == "intervals":
        state.update(model=p["model"], divisor=p["divisor"], draw=p["seed"], sure=True)
    if design is None:
        return
    if design != chosen_design():
        set_design(design)
        note_typed((), anew=True)
        state["name"] = job.name
    if job.kind == "point":
        set_point(p["rotor_mass"], p["bearing_number"])
        _set_settings(p["settings"])
    elif job.kind == "sensitivity":
        set_point(p["rotor_mass"], p["speed_rpm"] / design.speed_rpm(1.0))
        state.update(what_tab="Change the drawing", what_axis=p["axis"])
        state.update(what_step=100.0 * p["step"], what_scan=p["scan"])
        set_limits(Limits(**p.get("limits", {})))
    elif job.kind in ("tolerance", "improve"):
        set_point(p["rotor_mass"], p["speed_rpm"] / design.speed_rpm(1.0))
        show_request(job.kind, p)
    elif job.kind == "map":
        number, mass = _ends(p["bearing_number"]), _ends(p["rotor_mass"])
        at_mass, at_number = state["rotor_mass"], state["bearing_number"]
        if not (mass[0] <= at_mass <= mass[1] and number[0] <= at_number <= number[1]):
            set_point(0.5 * sum(mass), 0.5 * sum(number))
        state["own_shown"] = job.id
    elif job.kind == "bifurcation":
        along, count = _ends(p["range"]), int(p["range"].split(":")[2])
        over_mass = p["vary"] == "rotor-mass"
        key, low = ("mass", "rotor_mass") if over_mass else ("number", "bearing_number")
        at = state[low] if along[0] <= state[low] <= along[1] else 0.5 * sum(along)
        set_point(*((at, p["at"]) if over_mass else (p["at"], at)))
        state.update({f"{key}_from": along[0], f"{key}_to": along[1], "points": count})
        state.update(line=p["vary"], line_chosen=True, sweeps=p["sweeps"])
        _set_settings(p["settings"])


def _set_settings(given: dict[str, Any]) -> None:
    state = st.session_state
    for name in ("method", "transient", "revolutions"):
        state[name] = given[name]
    mesh = given["mesh"]
    state["mesh"] = mesh if isinstance(mesh, str) else "x".join(map(str, mesh))


def follow_opened() -> None:
    """Go to the page of a result that was opened; called before :func:`saved_results`."""
    name = st.session_state.pop(_OPEN, None)
    if name and (path := page_path(name)):
        st.switch_page(path)


def saved_results() -> None:
    """Every job, the latest first, with what can be done with it."""
    with errors_in_words():
        found = list_jobs()
    if not found:
        st.info(
            "Nothing is saved yet: maps, sweeps and what-ifs that you compute are kept here until "
            "you delete them."
        )
        return
    if problem := st.session_state.pop("saved_problem", ""):
        st.error(f"{capital(problem)}.")
    shown = found if st.session_state.get("saved_all") else found[:SHOWN]
    for job in shown:
        with st.container(border=True, key=f"saved_{job.id}"):
            _row(job)
    if len(found) > len(shown):
        st.button(
            f"Show all {len(found)}",
            key="saved_more",
            on_click=st.session_state.update,
            kwargs={"saved_all": True},
        )
    total = sum(job.size for job in found)
    st.caption(
        f"{len(found)} result{'s' if len(found) > 1 else ''}, {total / 1e6:.1f} MB in "
        f"{found[0].folder.parent}"
    )


def _row(job: Job) -> None:
    design, when = design_of(job), datetime.datetime.fromtimestamp(job.created)
    words, buttons = st.columns([1.6, 1], vertical_alignment="center")
    with words:
        of = ", ".join(filter(None, (name_of(design) if design else "", place_of(job))))
        st.markdown(f"**{label(job)}**: {of}" if of else f"**{label(job)}**")
        st.caption(f"{when:%Y-%m-%d %H:%M}, {job.state}. {headline(job)}")
    with buttons.container(horizontal=True, horizontal_alignment="right"):
        if job.kind in _PAGES and job.parameters:
            st.button("Open", key=f"open_{job.id}", on_click=open_job, args=(job,))
        if job.active:
            st.button("Cancel", key=f"cancel_{job.id}", on_click=_do, args=(cancel, job.id))
        elif job.parameters and job.state != "done":
            st.button(
                "Continue" if KINDS[job.kind].resumes else "Start again",
                key=f"more_{job.id}",
                on_click=_do,
                args=(submit, job.kind, job.parameters),
            )
        if job.kind in KINDS and job.result.is_file():
            file = f"{job.id}{job.result.suffix}"
            file_button("Download", job.result.read_bytes, file, f"take_{job.id}", width="content")
        with st.popover("Rename"):
            st.text_input(
                "Name",
                job.name,
                key=f"name_{job.id}",
                max_chars=NAME_LENGTH,
                on_change=_renamed,
                args=(job.id,),
            )
        if not job.active:
            with st.popover("Delete …"):
                st.markdown("The result and what is solved of it cannot be had back.")
                st.button("Delete", key=f"delete_{job.id}", on_click=_do, args=(delete, job.id))


def _do(what: Any, *arguments: Any) -> None:
    try:
        what(*arguments)
    except (InputError, OSError) as error:
        st.session_state["saved_problem"] = str(error)


def _renamed(name: str) -> None:
    _do(rename, name, st.session_state[f"name_{name}"])
