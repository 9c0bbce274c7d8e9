"""Tolerances and better drawings on their page, with real jobs."""

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.jobs.store import cancel, list_jobs
from spab_core.ui.drawings import show_request
from tests.app.conftest import address, complaints, until_done
from tests.conftest import ROOT

pytestmark = pytest.mark.usefixtures("own_jobs")
MUST_HOLD = ("wish", "worst_grade", "most_flow", "least_stiffness", "held_film", "load")
PAGE = str(ROOT / "pages" / "12_Tolerances_and_improvements.py")


def opened(**query):
    at = AppTest.from_file(PAGE, default_timeout=120)
    for key, value in query.items():
        at.query_params[key.replace("__", ".")] = value
    return at.run()


def test_tolerances_are_typed_and_stand_in_the_address():
    at = opened(tolerances="bearing.clearance ± 2 µm; speed ± 1 %")
    assert not at.exception and not complaints(at)
    assert at.multiselect(key="tolerances_of").value == ["bearing__clearance", "speed"]
    assert at.text_input(key="tolerance_bearing__clearance").value == "± 2 µm"
    at.text_input(key="tolerance_speed").set_value("± 100 rpm normal").run()
    at.run()
    assert address(at)["tolerances"] == "bearing.clearance ± 2 µm; speed ± 100 rpm normal"
    at.text_input(key="tolerance_speed").set_value("± 2 µm").run()
    assert "is not allowed" in complaints(at)[0]
    at = opened(tolerances="bearing.clearance 2")
    assert "In the address" in complaints(at)[0] and not at.exception
    at = opened(draw_tab="A better drawing", ranges="bearing.clearance 20:30")
    assert at.number_input(key="low_bearing__clearance").value == 20.0
    at.number_input(key="high_bearing__clearance").set_value(10.0).run()
    assert "the larger one" in complaints(at)[0]


def test_a_request_for_better_drawings_comes_back_into_its_fields(monkeypatch):
    """What must hold and what is wanted, from the page to the job's request and back."""
    at = opened(
        draw_tab="A better drawing",
        ranges="bearing.clearance 20:30",
        wish="film, stiffness",
        worst_grade="watch",
        most_flow="12",
        least_stiffness="8",
        held_film="6",
        load="3",
    )
    assert not at.exception and not complaints(at)
    at.button(key="better_job_start").click().run()
    (job,) = list_jobs()
    cancel(job.id)
    asked = job.parameters
    assert asked["wishes"] == ["film", "stiffness"] and asked["grade"] == "watch"
    assert (asked["most_gas_flow"], asked["load"]) == (12.0, 3.0)
    assert asked["least_stiffness"] == pytest.approx(8e6)
    assert asked["least_film"] == pytest.approx(6e-6)
    given = {key: at.session_state[key] for key in MUST_HOLD}
    monkeypatch.setattr(st, "session_state", {})
    show_request("improve", asked)
    assert {key: st.session_state[key] for key in MUST_HOLD} == given


@pytest.mark.slow
def test_machines_are_drawn_and_judged():
    at = opened(tolerances="rotor_mass ± 1 %", machines="64", rotor_mass="1", bearing_number="0.5")
    assert not at.exception and not complaints(at)
    at.button(key="tol_job_start").click().run()
    at = until_done(at)
    assert not at.exception and not complaints(at)
    told = " ".join(x.value for x in at.markdown)
    assert "Of 64 machines drawn" in told and "What drives it" in told
