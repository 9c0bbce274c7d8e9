"""Tolerances and better drawings on their page, with real jobs."""

import pytest
from streamlit.testing.v1 import AppTest

from tests.app.conftest import address, complaints, until_done
from tests.conftest import ROOT

pytestmark = pytest.mark.usefixtures("own_jobs")
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


@pytest.mark.slow
def test_machines_are_drawn_and_judged():
    at = opened(tolerances="rotor_mass ± 1 %", machines="64", rotor_mass="1", bearing_number="0.5")
    assert not at.exception and not complaints(at)
    at.button(key="tol_job_start").click().run()
    at = until_done(at)
    assert not at.exception and not complaints(at)
    told = " ".join(x.value for x in at.markdown)
    assert "Of 64 machines drawn" in told and "What drives it" in told
