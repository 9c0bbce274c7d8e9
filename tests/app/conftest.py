"""What tests of pages share: the address, background jobs of one test."""

import base64
import functools
import json
import time

import numpy as np
import pytest
import streamlit as st
from streamlit.components.v2 import manifest_scanner

from spab_core.jobs.store import cancel, list_jobs
from spab_core.trajectory.compiling import compile_once


@pytest.fixture(scope="session", autouse=True)
def kernels():
    """Compiled, or pages would only tell what is known without."""
    compile_once()


@pytest.fixture(scope="session", autouse=True)
def packages():
    """AppTest reads what every package installed says of itself, at each new page: once will do."""
    with pytest.MonkeyPatch.context() as patch:
        scan = functools.cache(manifest_scanner.scan_component_manifests)
        patch.setattr(manifest_scanner, "scan_component_manifests", scan)
        yield


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


def until_margin(at, seconds=120):
    """The page run again once the margin that is at work there is solved."""
    end = time.monotonic() + seconds
    while not any("Each limit lies between" in x.value for x in at.markdown) or any(
        "Solving the margin" in (bar.proto.text or "") for bar in at.get("progress")
    ):
        assert time.monotonic() < end
        time.sleep(2.0)  # which waits while a page is drawn
        at = at.run()
    return at


def start(at, key):
    """Start a job by its panel's button, unless it has begun by itself."""
    if f"{key}_start" in {button.key for button in at.button}:
        at.button(key=f"{key}_start").click().run()


def complaints(at):
    """Errors that a page tells; a verdict, which has an icon, is none."""
    return [error.value for error in at.error if not error.icon]


def verdicts(at):
    """The boxes that say what a motion is worth."""
    boxes = [box for kind in ("success", "warning", "error") for box in at.get(kind)]
    return [box.value.replace("**", "") for box in boxes if box.icon]


def figures(at):
    """The page's Plotly figures as the browser gets them."""
    return [json.loads(chart.proto.spec) for chart in at.get("plotly_chart")]


def decoded(array):
    """An array of a figure, binary or not."""
    if isinstance(array, dict):
        array = np.frombuffer(base64.b64decode(array["bdata"]), array["dtype"])
    return np.array([np.nan if v is None else v for v in array], float)


def address(at):
    """What stands in the page's address: a text each, of which AppTest of Streamlit 1.64 makes a
    list.
    """
    return {
        key: value[-1] if isinstance(value, list) else value
        for key, value in at.query_params.items()
    }
