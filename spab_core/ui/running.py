"""Jobs at work, seen from every page."""

from __future__ import annotations

import contextlib

import streamlit as st

from spab_core.common.errors import InputError
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import Job, active_jobs
from spab_core.ui.navigation import page_link

_EVERY = 3.0  # seconds between two looks


def label(job: Job) -> str:
    """A job's name, else its kind."""
    return job.name or (KINDS[job.kind].label if job.kind in KINDS else job.kind)


def time_left(seconds: float | None) -> str:
    """Such as "about 40 s left", in steps that do not flicker; "" where it is not known."""
    if seconds is None:
        return ""
    if seconds < 90:
        return f"about {max(5 * round(seconds / 5), 1)} s left"
    return f"about {round(seconds / 60)} min left"


def running_jobs() -> None:
    """Jobs at work, in the sidebar of every page; nothing where there are none."""
    try:
        found = active_jobs()
    except InputError:
        return  # the pages that need the folder say what is wrong
    if found:
        st.fragment(_running, run_every=_EVERY)()


def _running() -> None:
    found: list[Job] = []
    with contextlib.suppress(InputError):
        found = active_jobs()
    with st.container(key="nav_running", gap=None):
        st.markdown("## Running" if found else "## Ended")
        for job in found:
            told = (
                f"{job.done:,} of {job.total:,}" if job.total else "",
                "queued" if job.state == "queued" else time_left(job.seconds_left),
            )
            st.progress(
                min(job.done / job.total, 1.0) if job.total else 0.0,
                ", ".join(filter(None, (label(job), *told))),
            )
        page_link("Report", "Saved results")
