"""A background job on a page: start, progress, time left, cancel, and its result when done."""

from __future__ import annotations

import os
from typing import Any, Literal

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import Job, JobError, active_jobs, cancel, find, job_id, submit
from spab_core.ui.running import time_left
from spab_core.ui.shared import errors_in_words

AUTO = 30.0  # seconds up to which a job is started without asking
SOLVES = "SPAB_SOLVES"  # "asked": what takes more than a point waits for its button
_EVERY = 0.7  # seconds between two looks at a job


def solves_unasked() -> bool:
    """Whether pages solve margins, sensitivities and lines by themselves."""
    return os.environ.get(SOLVES) != "asked"


def job_panel(
    kind: str,
    parameters: dict[str, Any],
    label: str,
    key: str,
    *,
    auto: bool = False,
    files: dict[str, bytes] | None = None,
) -> Job | None:
    """Show a job and what can be done with it.

    Parameters
    ----------
    kind, parameters
        The request; the same one finds its job again, on any page, after a reload or a restart of
        the server.
    label : str
        Of the start button.
    key : str
        Prefix of the widgets' keys.
    auto : bool
        Start it without asking, once: a cancelled or failed one waits for the user, and so does
        one whose kind is at work for something else.
    files : dict
        As in ``jobs.submit``.

    Returns
    -------
    Job or None
        None until it is done.
    """
    with errors_in_words():
        job, damage = _find(job_id(kind, parameters))
        others = auto and not job and any(other.kind == kind for other in active_jobs())
        if auto and not (job or damage or others):
            job = submit(kind, parameters, files)
    if job and job.active:
        st.fragment(_watch, run_every=_EVERY)(job.id, key)
        return None
    if job and job.state == "done":
        return job
    place = st.container()
    width: Literal["content", "stretch"] = "content"
    if job or damage:
        words, place = _row()
        label, width = _tell_end(words, job, damage), "stretch"
    if place.button(label, key=f"{key}_start", type="primary", width=width):
        with errors_in_words():
            submit(kind, parameters, files)
        st.rerun()
    return None


def _find(name: str) -> tuple[Job | None, str]:
    """The job, and what is wrong with its files if it cannot be read."""
    try:
        return find(name), ""
    except JobError as error:
        return None, str(error)


def _tell_end(place: DeltaGenerator, job: Job | None, damage: str) -> str:
    """Say how a job ended without a result; the label of the button that starts it again."""
    if not job or job.state != "cancelled":
        place.error(f"Failed: {job.message if job else damage}.".replace("..", "."))
        return "Try again"
    if KINDS[job.kind].resumes:
        place.warning(f"Cancelled{_count(job)}. What has been solved is kept.")
        return "Go on"
    place.warning(f"Cancelled{_count(job)}. Nothing of it was kept: it starts from the beginning.")
    return "Start again"


def _row() -> list[DeltaGenerator]:
    return st.columns([5, 1], vertical_alignment="center")


def _count(job: Job) -> str:
    return f" at {job.done:,} of {job.total:,}" if job.total else ""


def _watch(name: str, key: str) -> None:
    """What a fragment shows of an active job; the whole page runs again once it has ended."""
    with errors_in_words():
        job = find(name)
    if job is None or not job.active:
        st.rerun()
    words = ", ".join(
        filter(
            None,
            [
                job.message.capitalize(),
                f"{job.done:,} of {job.total:,}" if job.total else "",
                time_left(job.seconds_left),
            ],
        )
    )
    if job.state == "queued":
        words = f"Queued: {job.message}" if job.message else "Starting …"
    bar, stop = _row()
    bar.progress(min(job.done / job.total, 1.0) if job.total else 0.0, words or "Starting …")
    if stop.button("Cancel", key=f"{key}_cancel", width="stretch"):
        with errors_in_words():
            cancel(name)
        st.rerun()
