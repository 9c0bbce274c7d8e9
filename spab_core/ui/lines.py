"""Lines of operating points on a page: cached loaders, the figure with its table and downloads."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import pandas as pd
import streamlit as st

from spab_core.jobs.store import Job, JobError, find, job_id
from spab_core.maps.bifurcation import (
    SWEEPS,
    Bifurcation,
    interval_table,
    line_table,
    line_verdict,
    load_bifurcation,
)
from spab_core.plotting.lines import bifurcation_figure
from spab_core.shipped.manifest import ARTIFACTS, load_reference_bifurcation
from spab_core.ui.downloads import downloads
from spab_core.ui.verdict import assumed_line, grade_box, grade_label
from spab_core.ui.view import chosen_design, chosen_limits

_LABELS = {"rotor-mass": "kg", "bearing-number": "Λ"}


@st.cache_resource(max_entries=16, show_spinner=False)
def _load(path: Path, stamp: float, shipped: bool) -> Bifurcation:
    return load_reference_bifurcation(path.name, path.parent) if shipped else load_bifurcation(path)


def shipped_line(name: str) -> Bifurcation:
    """A shipped line, read and checked once for each version of the file. Raises ``InputError``."""
    path = ARTIFACTS / name
    return _load(path, path.stat().st_mtime if path.exists() else 0.0, True)


def line_of_job(job: Job) -> Bifurcation:
    """The line that a job has computed, judged by the chosen limits. Raises ``InputError``."""
    line = _load(job.result, job.finished or 0.0, False)
    return dataclasses.replace(line, limits=chosen_limits())


def done_with_more(kind: str, parameters: dict[str, Any]) -> Job | None:
    """A finished line that has the wanted sweeps and others besides. Raises ``InputError``."""
    wanted = set(parameters["sweeps"])
    for count in range(len(wanted) + 1, len(SWEEPS) + 1):
        for sweeps in combinations(SWEEPS, count):
            if wanted < set(sweeps):
                name = job_id(kind, parameters | {"sweeps": list(sweeps)})
                with contextlib.suppress(JobError):  # a damaged one serves nobody
                    job = find(name)
                    if job and job.state == "done":
                        return job
    return None


def line_command(line: Bifurcation, sweeps: Sequence[str], design_option: str = "") -> str:
    """The command that computes a line."""
    m, n = line.metadata, len(line.values)
    full = "" if m["early_stop"] else " --full-length"
    return (
        f"spab bifurcation{design_option} --vary {line.vary} --at {line.at:.12g} --range "
        f"{line.values[0]:.12g}:{line.values[-1]:.12g}:{n} --sweeps {','.join(sweeps)} --mesh "
        f"{m['mesh']} --method {m['method']} --transient {m['transient']} "
        f"--revolutions {m['revolutions']}{full} --out line.npz"
    )


def line_view(
    line: Bifurcation,
    coordinates: Sequence[str],
    sweeps: Sequence[str],
    mark: float | None,
    title: str,
    *,
    name: str,
    file: Path | None,
    command: str,
    height: int,
    beside: bool = False,
) -> None:
    """A line's figure with the list of its bands by what the motion is worth, and everything to
    take away.

    ``mark`` is the chosen point's value on the line; ``file`` its NPZ file, if there is one;
    ``beside``: the list stands beside the figure, not under it."""
    figure = bifurcation_figure(line, coordinates, sweeps, mark).update_layout(height=height)
    left, right = st.columns([3, 1], gap="medium") if beside else (st.container(), st.container())
    with left:
        words, button = st.columns([3, 1], vertical_alignment="center")
        words.markdown(f"**{title}**")
        with button:
            downloads(
                name,
                {"Figure": figure},
                {"Points": partial(line_table, line)},
                {"npz": file.read_bytes} if file else None,
                command,
            )
        st.plotly_chart(
            figure, key=f"{name}_figure", width="stretch", config={"displaylogo": False}
        )
    with right:
        _intervals(line, sweeps, name, 330 if beside else 150)


def _intervals(line: Bifurcation, sweeps: Sequence[str], name: str, height: int) -> None:
    shown = [s for s in line.branches if s in sweeps]
    for sweep in shown:
        worst, words = line_verdict(line, sweep)
        grade_box(f"**{sweep}** {words}" if len(shown) > 1 else words, worst)
    if line.design == chosen_design():
        assumed_line()
    table = interval_table(line, sweeps)
    failed = {s: int((line.branches[s].status != "ok").sum()) for s in shown}
    unit = _LABELS[line.vary]
    st.caption(
        "Bands by what the motion is worth, first and last point; shaded: "
        f"{next(iter(shown), '')}. Resonance and stability at rest are judged where a point is "
        "solved alone."
    )
    if len(shown) == 1:
        table = table.drop(columns="sweep")
    band_table(table, f"{name}_intervals", unit, height)
    if any(failed.values()):
        st.caption(
            "Without an exponent (the run failed): "
            + ", ".join(f"{n} of {s}" for s, n in failed.items() if n)
        )


def band_table(table: pd.DataFrame, key: str, unit: str, height: int = 330) -> None:
    """Show bands of a line (``maps.bifurcation.interval_table``), ``unit`` that of its values."""
    st.dataframe(
        table.assign(assessment=table["assessment"].map(grade_label)),
        hide_index=True,
        key=key,
        height=min(height, 38 + 35 * len(table)),
        column_config={
            "sweep": "sweep",
            "first": st.column_config.NumberColumn(f"from, {unit}", format="%.4g"),
            "last": st.column_config.NumberColumn(f"to, {unit}", format="%.4g"),
            "first_rpm": st.column_config.NumberColumn("from, rpm", format="%,.0f"),
            "last_rpm": st.column_config.NumberColumn("to, rpm", format="%,.0f"),
        },
    )
