"""Maps of one's own bearing on a page: loading what a job has published, its figure, jobs in a
list.
"""

from __future__ import annotations

import dataclasses
import datetime
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.active_learning.quick_map import as_map, axis_around
from spab_core.active_learning.refine import Refinement, load_refinement
from spab_core.common.errors import InputError
from spab_core.common.words import capital
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import Job, active_jobs, find, job_id, list_jobs
from spab_core.maps.stability_map import StabilityMap, axis
from spab_core.plotting.map import hover, map_figure, mark_trace
from spab_core.reporting.export import map_table
from spab_core.shipped.manifest import ARTIFACTS
from spab_core.shipped.preset_maps import MAPS, PresetMap, load_preset_map, map_of_design, others
from spab_core.trajectory.assessment import (
    DEFAULT_LIMITS,
    GRADE_WORDS,
    GRADES,
    Assessment,
    assess,
)
from spab_core.trajectory.compiling import is_linear_compiled
from spab_core.trajectory.regimes import REGIMES
from spab_core.ui.bearing import derived_now
from spab_core.ui.view import (
    PROBABILITY,
    chosen_design,
    chosen_limits,
    chosen_point,
    design_option,
)

Found = tuple[Refinement, StabilityMap]  # solved, and filled
COUNTS = {"own_numbers": 170, "own_masses": 250}  # cells of a new map along its sides


@dataclass(frozen=True)
class Shown:
    """A map that a page can show.

    Attributes
    ----------
    id : str
        Of the job, or the name of the shipped file.
    words : str
        What it is, in a line.
    file : Path
    found : tuple
        Solved, and filled.
    command : str
        The command that computes it.
    shipped : PresetMap or None
        The example that it is; None for a job's.
    """

    id: str
    words: str
    file: Path
    found: Found
    command: str
    shipped: PresetMap | None = None


def shown_job(job: Job | None) -> Shown | None:
    """What a job of the kind ``map`` has given so far; None before that.

    Raises ``InputError``.
    """
    found = published(job)
    if job is None or found is None:
        return None
    return Shown(job.id, job_words(job), job.result, found, command_of(job))


def shown_example(one: PresetMap) -> Shown:
    """A shipped map. Raises ``InputError`` where it is stale, missing or damaged."""
    path = ARTIFACTS / one.file
    found = _judged(_load_example(one.file, path.stat().st_mtime if path.exists() else 0.0))
    words = f"Shipped example: {one.label}"
    return Shown(one.file, words, path, found, one.command(int(found[0].solved.sum())), one)


@st.cache_resource(max_entries=8, show_spinner=False)
def _load_example(name: str, stamp: float) -> Found:
    one = next(m for m in MAPS if m.file == name)
    found = load_preset_map(one)
    return found, as_map(found)


def _judged(found: Found) -> Found:
    """The same, its cells judged by the chosen limits."""
    return found[0], dataclasses.replace(found[1], limits=chosen_limits())


@st.cache_resource(max_entries=8, show_spinner=False)
def _load(path: Path, stamp: float) -> Found:
    found = load_refinement(path)
    return found, as_map(found)


def published(job: Job | None) -> Found | None:
    """What a job of the kind ``map`` has given so far, solved and filled; None before that.

    Raises ``InputError``.
    """
    if job is None or not job.result.is_file():
        return None
    return _judged(_load(job.result, job.result.stat().st_mtime))


def map_job(parameters: dict[str, Any]) -> Job | None:
    """The job of a request, in whatever state; None where it was never asked for.

    Raises ``InputError``.
    """
    return find(job_id("map", parameters))


def map_of(design: Design, rotor_mass: float, bearing_number: float) -> Shown | None:
    """The map of a design to be shown at a point: the latest one that the point lies in, else the
    example that comes with spab if it lies in that, else the latest, else the example; None where
    there is none.

    Raises ``InputError``.
    """
    wanted, latest = design.to_dict(), None
    for job in finished_maps():
        if job.parameters["design"] != wanted:
            continue
        found = shown_job(job)
        if found is None:
            continue
        latest = latest or found
        if cell_of(found.found[1], rotor_mass, bearing_number):
            return found
    example = example_of(design)
    if latest and not (example and cell_of(example.found[1], rotor_mass, bearing_number)):
        return latest
    return example


def find_example(design: Design) -> Shown | None:
    """The example of a design that comes with spab; None where there is none.

    Raises ``InputError`` where it is stale, missing or damaged.
    """
    one = map_of_design(design)
    return shown_example(one) if one else None


def example_of(design: Design) -> Shown | None:
    """The example of a design that comes with spab; None where there is none, or, with a sentence
    on the page, where it is not to be shown.
    """
    try:
        return find_example(design)
    except InputError as error:
        st.warning(f"{capital(str(error))}.")
        return None


def active_map(design: Design) -> Job | None:
    """The map of a design that is queued or at work. Raises ``InputError``."""
    wanted = design.to_dict()
    found = (j for j in active_jobs() if j.kind == "map" and j.parameters["design"] == wanted)
    return next(found, None)


def shown_map(
    design: Design, parameters: dict[str, Any], rotor_mass: float, bearing_number: float
) -> Shown | None:
    """The map to be shown for a request: its own if anything of it is there, the one opened from
    the saved results, else another one of the design (:func:`map_of`), but none of a job while
    that of the request is at work.

    Raises ``InputError``.
    """
    opened = st.session_state.get("own_shown")
    job = map_job(parameters)
    for one in (job, find(opened) if opened else None):
        if one and one.parameters["design"] == design.to_dict():
            found = shown_job(one)
            if found:
                return found
    if job and job.active:
        return example_of(design)
    return map_of(design, rotor_mass, bearing_number)


def to_compare(shown: Shown) -> dict[str, str]:
    """Maps to be compared with one, words by id: for an example those of the same bearing with
    other walls first, then those of jobs.
    """
    family = others(shown.shipped) if shown.shipped else []
    return {one.file: f"Shipped example: {one.label}" for one in family} | {
        job.id: job_words(job) for job in finished_maps() if job.id != shown.id
    }


def shown_by_id(name: str) -> Shown | None:
    """The map of an id of :func:`to_compare`; None where it has been deleted.

    Raises ``InputError``.
    """
    example = next((one for one in MAPS if one.file == name), None)
    return shown_example(example) if example else shown_job(find(name))


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
        text = usual = axis_around(at, limits, COUNTS[key])
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


def own_figure(found: Found, layer: str, bearing_number: float, rotor_mass: float) -> go.Figure:
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


def own_table(found: Found) -> pd.DataFrame:
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


def cell_words(found: Found, cell: tuple[int, int]) -> str:
    """What a map says of a cell, and whether it is solved."""
    r, m = found
    words = GRADE_WORDS[str(m.grades()[cell])]
    text = m.cell_text(*cell).partition(",")[0]
    if r.solved[cell]:
        return f"The cell of this point is solved: {text}, by its motion {words}."
    told = r.judged and m.limits == DEFAULT_LIMITS  # which a map's solver sought the borders of
    sure = f" with a probability of {100 * r.certainty[cell]:.0f} %" if told else ""
    return (
        f"The cell of this point is predicted, not solved: {text}, by its motion {words}{sure}. "
        "Solving the point settles it."
    )


def cell_assessment(found: Found, cell: tuple[int, int]) -> Assessment:
    """Judge a cell by its motion and, where linear theory says something and needs no compiling, by
    its equilibrium, which is otherwise told as not known.
    """
    m, (row, column) = found[1], cell
    rest = None
    if is_linear_compiled(m.design):
        at = float(m.rotor_mass[column]), float(m.bearing_number[row])
        with suppress(InputError, np.linalg.LinAlgError):  # as a point's own
            rest = derived_now(m.design, *at)
    return assess(m.design, m.motion(row, column), rest, m.limits)


def command_of(job: Job) -> str:
    """The command that computes a map of the chosen design."""
    p = job.parameters
    return (
        f"spab design map{design_option()} --bearing-number {p['bearing_number']} --rotor-mass "
        f"{p['rotor_mass']} --minutes {p['seconds'] / 60.0:g} --out my_map.npz"
    )


def shares_words(found: Found) -> str:
    """Shares of the plane by assessment, in a line."""
    return ", ".join(f"{GRADE_WORDS[g]} {100 * s:.1f} %" for g, s in shares(found)[0].items())


def example_words(shown: Shown) -> str:
    """What a shipped example is, in a line."""
    r, design = shown.found[0], shown.found[1].design
    preset = shown.shipped.preset if shown.shipped else None
    low, high = (round(design.speed_rpm(r.bearing_number[k]), -1) for k in (0, -1))
    around = f" around {preset.rotor_mass:g} kg and {preset.speed_rpm:,.0f} rpm" if preset else ""
    return (
        f"**{shown.words}**, {int(r.solved.sum())} cells solved of {r.batch.size:,}{around}, "
        f"{low:,.0f} to {high:,.0f} rpm. A map of your own is finer."
    )


def shares(found: Found) -> tuple[dict[str, float], dict[str, float]]:
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
