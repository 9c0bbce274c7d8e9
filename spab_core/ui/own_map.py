"""Maps of one's own bearing on a page: loading what a job has published, its figure, jobs in a
list.
"""

from __future__ import annotations

import datetime
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.active_learning.quick_map import as_map
from spab_core.active_learning.refine import Refinement, load_refinement
from spab_core.common.errors import InputError
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import Job, active_jobs, find, job_id, list_jobs
from spab_core.maps.solved_margin import SPAN
from spab_core.maps.stability_map import StabilityMap, axis
from spab_core.plotting.map import hover, map_figure, mark_trace
from spab_core.reporting.export import map_table
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES
from spab_core.trajectory.regimes import REGIMES
from spab_core.ui.view import PROBABILITY, chosen_design, chosen_point

COUNTS = {"own_numbers": 170, "own_masses": 250}  # cells of a new map along its sides


@st.cache_resource(max_entries=8, show_spinner=False)
def _load(path: Path, stamp: float) -> tuple[Refinement, StabilityMap]:
    found = load_refinement(path)
    return found, as_map(found)


def published(job: Job | None) -> tuple[Refinement, StabilityMap] | None:
    """What a job of the kind ``map`` has given so far, solved and filled; None before that.

    Raises ``InputError``.
    """
    if job is None or not job.result.is_file():
        return None
    return _load(job.result, job.result.stat().st_mtime)


def map_job(parameters: dict[str, Any]) -> Job | None:
    """The job of a request, in whatever state; None where it was never asked for.

    Raises ``InputError``.
    """
    return find(job_id("map", parameters))


def map_of(
    design: Design, rotor_mass: float, bearing_number: float
) -> tuple[Job, tuple[Refinement, StabilityMap]] | None:
    """The map of a design to be shown at a point: the latest one that the point lies in, else the
    latest; None where nothing of one is solved.

    Raises ``InputError``.
    """
    wanted, latest = design.to_dict(), None
    for job in finished_maps():
        if job.parameters["design"] != wanted:
            continue
        found = published(job)
        if found is None:
            continue
        m = found[1]
        latest = latest or (job, found)
        if (
            m.bearing_number[0] <= bearing_number <= m.bearing_number[-1]
            and m.rotor_mass[0] <= rotor_mass <= m.rotor_mass[-1]
        ):
            return job, found
    return latest


def active_map(design: Design) -> Job | None:
    """The map of a design that is queued or at work. Raises ``InputError``."""
    wanted = design.to_dict()
    found = (j for j in active_jobs() if j.kind == "map" and j.parameters["design"] == wanted)
    return next(found, None)


def shown_map(
    design: Design, parameters: dict[str, Any], rotor_mass: float, bearing_number: float
) -> tuple[Job | None, tuple[Refinement, StabilityMap] | None]:
    """The map to be shown for a request: its own if anything of it is there, the one opened from
    the saved results, else another one of the design (:func:`map_of`).

    Raises ``InputError``.
    """
    opened = st.session_state.get("own_shown")
    for job in (map_job(parameters), find(opened) if opened else None):
        found = published(job)
        if job and found and job.parameters["design"] == design.to_dict():
            return job, found
    job = map_job(parameters)
    if job and job.active:
        return job, None
    return map_of(design, rotor_mass, bearing_number) or (job, None)


def range_fields(row: DeltaGenerator) -> tuple[str, str]:
    """Show from and to in rpm and kg for a new map, by default a quarter to three times the point.

    Returns
    -------
    bearing_number, rotor_mass : str
        start:stop:count, as the jobs take them, or what was typed that is no axis.
    """
    state, design = st.session_state, chosen_design()
    mass, number = chosen_point()
    told = []
    for key, label, format_, at, limits, scale in (
        ("own_numbers", "rpm", "%.0f", number, BEARING_NUMBER_RANGE, design.speed_rpm(1.0)),
        ("own_masses", "kg", "%.4g", mass, ROTOR_MASS_RANGE, 1.0),
    ):
        text = usual = _around(at, limits, COUNTS[key])
        if state[key]:
            with suppress(InputError):  # the fields stay, or it could not be mended
                axis(state[key], key)
                text = state[key]
        low, high = (float(x) for x in text.split(":")[:2])
        for name, value in (("from", low), ("to", high)):
            shown = f"{key}_{name}"
            state[shown] = float(f"{value * scale:.6g}")
            row.number_input(
                f"{name.capitalize()}, {label}",
                None,
                None,
                None,
                key=shown,
                format=format_,
                width=120,
                on_change=_range_typed,
                args=(key, scale, int(text.split(":")[2])),
                help="Of a new map; by default from a quarter of the point to three times it",
            )
        told.append(state[key] or usual)
    return told[0], told[1]


def _around(at: float, limits: tuple[float, float], count: int) -> str:
    low, high = (min(max(at * factor, limits[0]), limits[1]) for factor in SPAN)
    return f"{low:.5g}:{high:.5g}:{count}"


def _range_typed(key: str, scale: float, count: int) -> None:
    state = st.session_state
    ends = [state[f"{key}_{name}"] for name in ("from", "to")]
    if None in ends:
        return  # an emptied field has its last number in the next run
    state[key] = f"{ends[0] / scale:.6g}:{ends[1] / scale:.6g}:{count}"


def finished_maps() -> list[Job]:
    """Jobs of the kind ``map`` with something to show, the latest first."""
    return [
        job for job in list_jobs() if job.kind == "map" and job.parameters and job.result.is_file()
    ]


def own_figure(
    found: tuple[Refinement, StabilityMap], layer: str, bearing_number: float, rotor_mass: float
) -> go.Figure:
    """A published map with its solved cells as dots and the chosen point; under the pointer what a
    cell is worth, and with which probability where that is predicted.
    """
    refined, m = found
    figure = map_figure(m, "MLE" if layer == PROBABILITY else layer)
    shown = {"selector": {"type": "heatmap"}, **_told(refined, m)}
    if layer == PROBABILITY:
        shown |= {
            "z": refined.certainty.T.astype(np.float32),
            "zmin": 0.0,
            "zmax": 1.0,
            "colorscale": "Cividis",
            "colorbar": {"title": {"text": "probability of the assessment", "side": "right"}},
        }
    figure.update_traces(**shown)
    row, column = np.nonzero(refined.solved)
    figure.add_scattergl(
        x=m.bearing_number[row].astype(np.float32),
        y=m.rotor_mass[column].astype(np.float32),
        mode="markers",
        name=f"solved ({len(row):,})",
        hoverinfo="skip",
        marker={"color": "#000000", "size": 2},
    )
    return figure.add_trace(mark_trace(bearing_number, rotor_mass))


def _told(r: Refinement, m: StabilityMap) -> dict[str, Any]:
    """Options of a heatmap: what stands under the pointer."""
    text = hover(m, None)["text"]
    worth = np.vectorize(GRADE_WORDS.get)(m.grades().T)
    numbers = [m.mle, r.certainty, r.good, r.avoid, r.rubs]
    return {
        "text": np.where(r.solved.T, "solved: ", "predicted: ") + worth + "<br>" + text,
        "customdata": np.stack([a.T for a in numbers], axis=-1).astype(np.float32),
        "hovertemplate": "Λ %{x:.3f}, %{y:.3g} kg<br><b>%{text}</b>, MLE %{customdata[0]:+.3f}"
        "<br>probability of this assessment %{customdata[1]:.0%}<br>good %{customdata[2]:.0%}, "
        "not recommended %{customdata[3]:.0%}, rubbing %{customdata[4]:.0%}<extra></extra>",
    }


def cell_of(m: StabilityMap, rotor_mass: float, bearing_number: float) -> tuple[int, int] | None:
    """The cell of a point, None outside the map."""
    plane = ((m.rotor_mass, rotor_mass), (m.bearing_number, bearing_number))
    if not all(axis[0] <= value <= axis[-1] for axis, value in plane):
        return None
    return m.nearest(rotor_mass, bearing_number)


def own_table(found: tuple[Refinement, StabilityMap]) -> pd.DataFrame:
    """A published map as a table (:func:`~spab_core.reporting.export.map_table`): whether each cell
    is solved, and the predicted probabilities.
    """
    r, m = found
    return map_table(m).assign(
        solved=r.solved.ravel(),
        probability_good=r.good.ravel(),
        probability_avoid=r.avoid.ravel(),
        probability_contact=r.rubs.ravel(),
        probability_unstable=r.unstable.ravel(),
    )


def cell_words(found: tuple[Refinement, StabilityMap], cell: tuple[int, int]) -> str:
    """What a map says of a cell, and whether it is solved."""
    r, m = found
    words = GRADE_WORDS[str(m.grades()[cell])]
    text = m.cell_text(*cell).partition(",")[0]
    if r.solved[cell]:
        return f"The cell of this point is solved: {text}, by its motion {words}."
    sure = f" with a probability of {100 * r.certainty[cell]:.0f} %" if r.judged else ""
    return (
        f"The cell of this point is predicted, not solved: {text}, by its motion {words}{sure}. "
        "Solving the point settles it."
    )


def map_command(design_option: str, numbers: str, masses: str, minutes: float) -> str:
    """The command that maps a bearing."""
    return (
        f"spab design map{design_option} --bearing-number {numbers} --rotor-mass {masses} "
        f"--minutes {minutes:g} --out my_map.npz"
    )


def command_of(job: Job, design_option: str = " --design my.toml") -> str:
    """The command that computes a map."""
    p = job.parameters
    return map_command(design_option, p["bearing_number"], p["rotor_mass"], p["seconds"] / 60.0)


def shares(found: tuple[Refinement, StabilityMap]) -> tuple[dict[str, float], dict[str, float]]:
    """Shares of the plane by assessment, and by regime with "" for failed runs."""
    m, by_grade = found[1], found[1].grades()
    return (
        {grade: float((by_grade == grade).mean()) for grade in GRADES},
        {regime: float((m.regime == regime).mean()) for regime in (*REGIMES, "")},
    )


def job_words(job: Job) -> str:
    """A job in a line: kind, when, state."""
    label = KINDS[job.kind].label if job.kind in KINDS else job.kind
    when = datetime.datetime.fromtimestamp(job.created).strftime("%Y-%m-%d %H:%M")
    return f"{label}, {when}, {job.state}"
