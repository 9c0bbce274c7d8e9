"""The panel of a background job without a page around it."""

import json
import time

import pytest
from streamlit.testing.v1 import AppTest

from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import list_jobs

pytestmark = pytest.mark.usefixtures("own_jobs")


def page():
    import streamlit as st

    from spab_core.ui.jobs import job_panel

    settings = {"mesh": "2x16", "transient": 2000, "revolutions": 2000, "early_stop": False}
    long = settings | {"mesh": "3x16", "transient": 20000, "revolutions": 20000}
    point = {"rotor_mass": 10.0, "bearing_number": 3.0, "settings": long}
    line = {"vary": "rotor-mass", "at": 3.0, "range": "4:9:300", "settings": settings}
    kind = st.radio("kind", ["point", "bifurcation"], key="kind")
    job_panel(kind, {"point": point, "bifurcation": line}[kind], "Start", "job")


@pytest.mark.parametrize(
    ("kind", "words", "label"),
    [
        ("point", "Nothing of it was kept: it starts from the beginning.", "Start again"),
        ("bifurcation", "What has been solved is kept.", "Go on"),
    ],
)
def test_a_cancelled_job_says_what_is_kept(kind, words, label):
    at = AppTest.from_function(page, default_timeout=60).run()
    at.radio(key="kind").set_value(kind).run()
    at.button(key="job_start").click().run()
    end = time.monotonic() + 60
    while (job := list_jobs()[0]).done == 0:
        assert time.monotonic() < end and job.active, job
        time.sleep(0.02)
    at.button(key="job_cancel").click().run()
    (job,) = list_jobs()
    assert job.state == "cancelled" and 0 < job.done < job.total
    assert at.warning[0].value == f"Cancelled at {job.done:,} of {job.total:,}. {words}"
    assert (job.folder / "parts").is_dir() == KINDS[kind].resumes
    assert at.button(key="job_start").label == label
    at.button(key="job_start").click().run()
    while not list_jobs()[0].total:
        assert time.monotonic() < end
        time.sleep(0.02)
    kept = json.loads((job.folder / "job.json").read_text())["kept"]
    assert (kept > 0) == KINDS[kind].resumes
