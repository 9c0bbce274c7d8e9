"""Report and saved results without a browser: what is kept is listed with what it found, opened,
named and deleted; the bar of inputs with gauge and absolute supply; what was assumed.
"""

import dataclasses

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.design.model import reference_design
from spab_core.jobs.store import cancel, list_jobs, submit
from spab_core.maps.bifurcation import load_bifurcation
from spab_core.ui import running, saved, shared
from tests.app.conftest import address, complaints, until_done
from tests.conftest import ROOT

PAGE = str(next((ROOT / "pages").glob("*_Report.py")))
pytestmark = pytest.mark.usefixtures("own_jobs")
TINY = {"mesh": "2x16", "transient": 30, "revolutions": 20}
OWN = reference_design().replace(bearing__clearance=30e-6)
LINE = {
    "design": OWN.to_dict(),
    "vary": "rotor-mass",
    "at": 3.0,
    "range": "4:6:3",
    "sweeps": ["cold"],
    "settings": TINY,
}
POINT = {"design": OWN.to_dict(), "rotor_mass": 4.0, "bearing_number": 3.0, "settings": TINY}


def opened(**query):
    at = AppTest.from_file(PAGE, default_timeout=120)
    at.query_params.update(query)
    return at.run()


def words(at):
    return " ".join(x.value for kind in ("markdown", "caption", "info") for x in at.get(kind))


@pytest.fixture
def made(monkeypatch):
    """What the page's download buttons offer, by the files' names."""
    found, real = {}, st.download_button
    monkeypatch.setattr(
        st,
        "download_button",
        lambda label, data, name, *a, **k: (
            found.update({name: data}) or real(label, data, name, *a, **k)
        ),
    )
    return found


def test_a_job_at_work_is_seen_on_another_page(monkeypatch):
    """With its name, how far it is and how long it takes; nothing of it is computed here."""
    line = dataclasses.replace(submit("bifurcation", LINE), state="running", done=1, total=3)
    cancel(line.id)
    monkeypatch.setattr(running, "active_jobs", lambda: [line])
    other = str(next((ROOT / "pages").glob("*_About_the_model.py")))
    at = AppTest.from_file(other, default_timeout=120).run()
    (bar,) = at.sidebar.get("progress")
    assert not at.exception and bar.proto.text.startswith(f"{running.label(line)}, 1 of 3")
    assert bar.proto.value == 33 and "## Running" in [x.value for x in at.sidebar.markdown]
    monkeypatch.setattr(running, "active_jobs", lambda: [])
    assert not AppTest.from_file(other, default_timeout=120).run().sidebar.get("progress")


def test_results_are_listed_opened_named_and_deleted(made, tmp_path):
    at = opened()
    assert not at.exception and "Nothing is saved yet" in words(at)
    point, line = submit("point", POINT), submit("bifurcation", LINE)
    cancel(line.id)
    at.run()
    more = at.button(key=f"more_{line.id}")
    assert more.label == "Continue" and f"{line.id}.npz" not in made
    more.click().run()
    at = until_done(at)
    assert f"more_{line.id}" not in {button.key for button in at.button}
    (tmp_path / "line.npz").write_bytes(made[f"{line.id}.npz"]())
    assert load_bifurcation(tmp_path / "line.npz").values.tolist() == [4.0, 5.0, 6.0]
    assert not at.exception and not complaints(at)
    told = words(at)
    speed = f"{OWN.speed_rpm(3.0):,.0f} rpm"
    assert f"4 kg at {speed}" in told and f"4 to 6 kg at {speed}" in told
    assert "own design (C 30 µm)" in told and "3 points, " in told
    at.text_input(key=f"name_{line.id}").set_value("the first try").run()
    assert "**the first try**" in words(at)
    at.button(key=f"open_{line.id}").click().run()
    state = at.session_state
    assert address(at)["bearing.clearance"] == "3e-05"
    assert (state["line"], state["mass_from"], state["mass_to"], state["points"]) == (
        "rotor-mass",
        4.0,
        6.0,
        3,
    )
    assert (state["mesh"], state["transient"], state["revolutions"]) == ("2x16", 30, 20)
    page = AppTest.from_file(str(next((ROOT / "pages").glob("*_Bifurcation.py"))))
    page.query_params.update(address(at))
    page = page.run(timeout=60)
    assert not page.exception and len(list_jobs()) == 2  # it is found, not computed again
    for job in (point, line):
        at.button(key=f"delete_{job.id}").click().run()
    assert not at.exception and list_jobs() == []


def test_what_every_kind_is_of():
    """Words of jobs that were never done, from their requests alone."""
    requests = {
        "sensitivity": ({"rotor_mass": 4.0, "speed_rpm": 9000.0}, "4 kg at 9,000 rpm"),
        "map": (
            {"bearing_number": "1:2:6", "rotor_mass": "3:9:6"},
            f"{reference_design().speed_rpm(1.0):,.0f} to ",
        ),
        "intervals": ({"model": "tree", "divisor": 8}, "tree, n/8, seed 0"),
    }
    for kind, (request, expected) in requests.items():
        assert expected in saved.place_of(submit(kind, request)), kind


def test_supply_as_gauge_and_absolute():
    at = opened(rotor_mass="30")  # solved ten times as fast at 100 bar as the usual 4.5 kg
    field = at.number_input(key="supply")
    assert field.label == "Supply, bar gauge" and field.value == 0.0
    at.number_input(key="supply").set_value(6.0).run()
    ratio = (6.0 + 1.01325) / 1.01325
    assert float(address(at)["bearing.supply_pressure_ratio"]) == pytest.approx(ratio, rel=1e-12)
    at.button_group(key="supply_as").set_value("absolute").run()
    field = at.number_input(key="supply")
    assert field.label == "Supply, bar absolute" and field.value == pytest.approx(7.01325)
    assert address(at)["supply_as"] == "absolute"
    assert float(address(at)["bearing.supply_pressure_ratio"]) == pytest.approx(ratio, rel=1e-12)
    for end in ("min", "max"):
        at.number_input(key="supply").set_value(getattr(field, end)).run()
        assert not at.exception and not complaints(at)


def test_what_was_not_typed_is_said_to_be_assumed():
    at = opened(**{"bearing.clearance": "3e-05"})
    (told,) = (c.value for c in at.caption if c.value.startswith("Assumed, not typed"))
    assert "unbalance eccentricity 13 µm (G " in told and "clearance" not in told
    assert not any(c.value.startswith("Assumed") for c in opened().caption)  # the example's own


def test_the_report_names_project_and_author(made):
    at = opened(project="Mill 3", author="A. Designer", **{"bearing.clearance": "3e-05"})
    assert not at.exception and not complaints(at)
    report = made["report.html"]().decode()
    shown = report[report.index("<body>") :]
    assert "Mill 3" in shown and "A. Designer" in shown and len(report) < 3e6
    box = shown[shown.index('class="box') :]
    assert "Rotor mass on one bearing" in box and "44.34 N" in box and "Assumed, not given" in box


@pytest.mark.parametrize("name", ["Operating_point", "Bifurcation", "My_map", "What_if"])
def test_an_own_design_is_never_drawn_on_the_map_of_the_example(name, monkeypatch):
    def shown(*_, **__):
        raise AssertionError("the example's map is asked for")

    st.cache_resource.clear()
    monkeypatch.setattr(shared, "load_reference_map", shown)  # what every page gets it by
    path = next((ROOT / "pages").glob(f"*_{name}.py"))
    at = AppTest.from_file(str(path), default_timeout=120)
    at.query_params["bearing.clearance"] = "3e-05"
    at.run()
    assert not at.exception
    if name == "My_map":  # and the example's is
        at = AppTest.from_file(str(path), default_timeout=120).run()
        assert at.exception
