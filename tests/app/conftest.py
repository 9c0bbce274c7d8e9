"""Background jobs of one test of a page."""

import time

import pytest
import streamlit as st

from spab_core.jobs import cancel, list_jobs


@pytest.fixture
def own_jobs(tmp_path, monkeypatch):
    """Jobs of this test alone; none is left at work."""
    monkeypatch.setenv("SPAB_JOBS", str(tmp_path / "jobs"))
    st.cache_resource.clear()
    yield
    for job in list_jobs():
        if job.active:
            cancel(job.id)


def until_done(at, seconds=150):
    """The page run again once no job is at work."""
    end = time.monotonic() + seconds
    while any(job.active for job in list_jobs()):
        assert time.monotonic() < end
        time.sleep(0.1)
    return at.run()
