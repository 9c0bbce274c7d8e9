"""Maps of one's own bearing on a page: loading what a job has published, its figure, jobs in a
list.
"""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import streamlit as st

from spab_core.active_learning.quick_map import as_map
from spab_core.active_learning.refine import Refinement, load_refinement
from spab_core.common.errors import InputError
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import Job, delete, find, job_id, list_jobs
from spab_core.maps.margin import Margin, margin
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.map import hover, map_figure, mark_trace
from spab_core.ui.view import OWN_LAYERS


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


def finished_maps() -> list[Job]:
    """Jobs of the kind ``map`` with something to show, the latest first."""
    return [
        job for job in list_jobs() if job.kind == "map" and job.parameters and job.result.is_file()
    ]


def own_figure(
    found: tuple[Refinement, StabilityMap], layer: str, bearing_number: float, rotor_mass: float
) -> go.Figure:
    """A published map with its solved cells as dots and the chosen point."""
    refined, m = found
    figure = map_figure(m, "MLE" if layer == OWN_LAYERS[2] else layer)
    if layer == OWN_LAYERS[2]:
        figure.update_traces(
            z=refined.unstable.T.astype(np.float32),
            zmin=0.0,
            zmax=1.0,
            colorscale="Cividis",
            colorbar={"title": {"text": "probability of instability", "side": "right"}},
            **hover(m, "<br>probability of instability %{z:.2f}"),
            selector={"type": "heatmap"},
        )
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


def map_command(design_option: str, numbers: str, masses: str, minutes: float) -> str:
    """The command that maps a bearing."""
    return (
        f"spab design map{design_option} --bearing-number {numbers} --rotor-mass {masses} "
        f"--minutes {minutes:g} --out my_map.npz"
    )


def margin_in_map(m: StabilityMap, rotor_mass: float, bearing_number: float) -> Margin | None:
    """The margin of a point, or None where it lies outside the map."""
    try:
        return margin(m, rotor_mass, bearing_number)
    except InputError:
        return None


def shares(found: tuple[Refinement, StabilityMap]) -> dict[str, float]:
    """Share of the plane by regime, "" for failed runs."""
    names, counts = np.unique(found[1].regime, return_counts=True)
    return dict(zip(names.tolist(), (counts / counts.sum()).tolist(), strict=True))


def job_words(job: Job) -> str:
    """A job in a line: kind, when, state."""
    label = KINDS[job.kind].label if job.kind in KINDS else job.kind
    when = datetime.datetime.fromtimestamp(job.created).strftime("%Y-%m-%d %H:%M")
    return f"{label}, {when}, {job.state}"


def jobs_table() -> None:
    """All jobs of this user with their sizes; each can be deleted once it is not at work."""
    found = list_jobs()
    if not found:
        st.caption(
            "No jobs yet: maps, lines and what-ifs that you compute are kept here until you "
            "delete them."
        )
        return
    total = sum(job.size for job in found)
    rows = [
        {
            "id": job.id,
            "job": job_words(job),
            "progress": f"{job.done:,} of {job.total:,}" if job.total else "",
            "size, kB": job.size / 1e3,
            "message": job.message,
        }
        for job in found
    ]
    picked = st.dataframe(
        pd.DataFrame(rows),
        hide_index=True,
        width="stretch",
        on_select="rerun",
        selection_mode="multi-row",
        key="jobs_table",
        column_config={"size, kB": st.column_config.NumberColumn(format="%.0f")},
    )
    st.caption(
        f"{len(found)} job{'s' if len(found) > 1 else ''}, {total / 1e6:.1f} MB in "
        f"{found[0].folder.parent}"
    )
    chosen = [found[k] for k in picked["selection"]["rows"] if k < len(found)]
    if st.button("Delete the selected jobs", disabled=not chosen, key="jobs_delete"):
        for job in chosen:
            delete(job.id)
        st.rerun()
