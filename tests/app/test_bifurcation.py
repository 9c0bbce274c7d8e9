"""The page "Bifurcation" without a browser: shipped lines at once, every control at its ends, a
live line by a real job.
"""

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.design.limits import ROTOR_MASS_RANGE
from spab_core.jobs.store import list_jobs
from spab_core.maps.bifurcation import SWEEPS, load_bifurcation
from spab_core.plotting.lines import COORDINATES, SWEEP_COLOURS
from spab_core.plotting.theme import GRADE_MARKS
from spab_core.trajectory.assessment import GRADES
from spab_core.ui import lines
from spab_core.ui.verdict import grade_label
from tests.app.conftest import address, complaints, figures, start, until_done, verdicts
from tests.conftest import ROOT

PAGE = str(next((ROOT / "pages").glob("*_Bifurcation.py")))
TINY = {
    "line": "rotor-mass",
    "mesh": "2x16",
    "transient": "30",
    "revolutions": "20",
    "points": "3",
    "mass_from": "4",
    "mass_to": "6",
}
pytestmark = pytest.mark.usefixtures("own_jobs")


def opened(**address):
    at = AppTest.from_file(PAGE, default_timeout=120)
    for key, value in address.items():
        at.query_params[key] = value
    return at.run()


def panels(figure):
    """Titles of the vertical axes."""
    return [
        figure["layout"][key]["title"]["text"]
        for key in sorted(figure["layout"])
        if key.startswith("yaxis")
    ]


def words(at):
    return " ".join(
        x.value
        for kind in ("markdown", "caption", "success", "warning", "error")
        for x in at.get(kind)
    )


def test_the_papers_lines_open_at_once():
    at = opened()
    assert not at.exception and not complaints(at)
    over_mass, over_number = figures(at)
    for figure in (over_mass, over_number):
        assert panels(figure) == ["X₂ / C (journal)", "Y₂ / C (journal)", "MLE<br>per revolution"]
        assert "line" in {shape["type"] for shape in figure["layout"]["shapes"]}
    shaded = {shape["name"] for shape in over_mass["layout"]["shapes"] if shape["type"] == "rect"}
    assert "avoid" in shaded and shaded <= set(GRADES)
    notes = " ".join(note["text"] for note in over_mass["layout"]["annotations"])
    assert f"{GRADE_MARKS['avoid']} not recommended: " in notes  # words beside the colour
    assert over_mass["layout"]["xaxis3"]["title"]["text"] == "Rotor mass on one bearing, kg"
    assert over_number["layout"]["xaxis3"]["title"]["text"] == "Bearing number Λ"
    assert "rpm" in over_number["layout"]["xaxis99"]["title"]["text"]
    for table in (table.value for table in at.dataframe):
        assert list(table)[:4] == ["assessment", "why", "first", "last"]
        assert set(table["assessment"]) <= {grade_label(grade) for grade in GRADES}
        told = table[table["assessment"] != grade_label("good")]
        assert len(told) and all(told["why"])
    boxes = verdicts(at)
    assert len(boxes) == 2 and all("not recommended" in words for words in boxes)
    assert "chaos" in boxes[0] and "rubbing" in boxes[0] and "chaos" not in boxes[1]
    assert not at.success and not at.info
    assert any(
        "--vary rotor-mass --at 3.45 --range 0.1:25:500 --sweeps cold" in code.value
        for code in at.code
    )
    assert list_jobs() == []


def test_every_sweep_and_coordinate_alone_all_and_none():
    at = opened()
    for chosen in (*([k] for k in COORDINATES), list(COORDINATES), []):
        at.button_group(key="coordinates").set_value(chosen).run()
        assert not at.exception and not complaints(at)
        titles = [
            title[0] + {"₁": "1", "₂": "2"}[title[1]] for title in panels(figures(at)[0])[:-1]
        ]
        assert titles == (chosen or ["X2", "Y2"])
    for chosen in (*([k] for k in SWEEPS), list(SWEEPS), []):
        at.button_group(key="sweeps").set_value(chosen).run()
        assert not at.exception and not complaints(at)
        colours = {t["marker"]["color"] for t in figures(at)[0]["data"] if t["type"] == "scattergl"}
        assert colours == {SWEEP_COLOURS[k] for k in chosen or ["cold"]}


def test_where_the_servers_owner_wants_it_so_a_line_waits_for_its_button():
    at = opened(rotor_mass="8", bearing_number="4.5", line="rotor-mass")
    assert at.button(key="line_job_start") and not at.exception


@pytest.mark.usefixtures("unasked")
def test_who_has_a_point_of_their_own_sees_the_line_through_it():
    at = opened(rotor_mass="18", bearing_number="4.5")
    assert not at.exception and not complaints(at)
    (figure,) = figures(at)  # the exponent, as the map has it
    assert any(
        shape["type"] == "line" and shape["x0"] == 18.0 for shape in figure["layout"]["shapes"]
    )
    assert "Λ = 4.5" in words(at) and at.button(key="line_job_cancel")  # it begins by itself
    (job,) = list_jobs()
    assert job.parameters["range"] == "4.5:54.0:200"  # a quarter to three times the point
    at.button_group(key="line").set_value("paper").run()
    assert len(figures(at)) == 2  # and may still look at the paper's
    at.button_group(key="line").set_value("bearing-number").run()
    assert "at 18 kg" in words(at) and len(figures(at)) == 1
    ends = [at.number_input(key=f"number_{end}_shown").value for end in ("from", "to")]
    assert ends == [1.125, 13.5]
    assert not {"mass_from", "number_from"} & set(address(at))
    at.number_input(key="number_to_shown").set_value(9.0).run()
    assert address(at)["number_to"] == "9" and ends[0] == 1.125


def test_what_was_assumed_stands_under_the_verdict_of_an_own_line():
    at = opened(**TINY, **{"bearing.clearance": "3e-05"})
    start(at, "line_job")
    at = until_done(at)
    assert not at.exception and verdicts(at)
    assert sum(c.value.startswith("Assumed, not typed: ") for c in at.caption) == 1
    at.button_group(key="line").set_value("paper").run()  # which is of no design of theirs
    assert not at.exception and len(figures(at)) == 2 and "Assumed" not in words(at)


@pytest.mark.usefixtures("unasked")
def test_a_design_of_their_own_has_no_map_to_look_at():
    at = opened(**{"bearing.clearance": "3e-05"})
    assert not at.exception and not complaints(at)
    assert not figures(at) and at.button(key="line_job_cancel")
    at.button_group(key="line").set_value("paper").run()
    assert len(figures(at)) == 2  # of the reference bearing: their point is none of it
    shapes = [shape for figure in figures(at) for shape in figure["layout"]["shapes"]]
    assert not any(shape["type"] == "line" and shape["x0"] in (4.52, 3.45) for shape in shapes)


@pytest.mark.parametrize("line, along", [("rotor-mass", "mass"), ("bearing-number", "number")])
def test_every_control_at_its_ends(line, along):
    at = opened(line=line)
    for key in (
        "bearing_number",
        "rotor_mass",
        f"{along}_from_shown",
        f"{along}_to_shown",
        "points",
        "transient",
        "revolutions",
    ):
        widget = at.number_input(key=key)
        usual = widget.value
        for end in (widget.min, widget.max) if key != "rotor_mass" else ROTOR_MASS_RANGE:
            at.number_input(key=key).set_value(end).run()
            assert not at.exception
            upside_down = (
                at.number_input(key=f"{along}_from_shown").value
                >= at.number_input(key=f"{along}_to_shown").value
            )
            assert bool(complaints(at)) == upside_down, (key, end)
            assert not complaints(at) or "start before stop" in complaints(at)[0]
        at.number_input(key=key).set_value(usual).run()
    at.button_group(key="method").set_value("dtm").run()
    assert not at.exception and not complaints(at)


@pytest.mark.parametrize("mesh", ["4", "4x", "x", "1x16", "4x4800", "four by eight"])
def test_a_wrong_mesh_is_a_sentence(mesh):
    at = opened(line="rotor-mass")
    at.selectbox(key="mesh").options.append(mesh)  # as if typed
    at.selectbox(key="mesh").set_value(mesh).run()
    assert not at.exception and at.error and "mesh" in at.error[0].value


def test_a_live_line_is_computed_once():
    at = opened(**TINY)
    start(at, "line_job")
    assert not at.exception and not complaints(at) and at.button(key="line_job_cancel")
    assert len(list_jobs()) == 1
    again = opened(**TINY)  # a reload meets the same job
    assert len(list_jobs()) == 1
    for page in (until_done(at), again.run()):
        assert not page.exception and not complaints(page)
        (figure,) = figures(page)
        assert panels(figure)[0] == "X₂ / C (journal)" and len(page.dataframe) + len(page.info) == 1
    (job,) = list_jobs()
    assert job.state == "done" and list(load_bifurcation(job.result).values) == [4.0, 5.0, 6.0]
    assert any("--mesh 2x16" in code.value and "--range 4:6:3" in code.value for code in at.code)


@pytest.mark.usefixtures("unasked")
def test_a_line_with_more_sweeps_serves_those_with_fewer():
    at = opened(**TINY, sweeps="cold,down")
    start(at, "line_job")
    until_done(at)
    at.button_group(key="sweeps").set_value(["down"]).run()
    assert not at.exception and len(figures(at)) == 1 and len(list_jobs()) == 1
    assert {t["marker"]["color"] for t in figures(at)[0]["data"] if t["type"] == "scattergl"} == {
        SWEEP_COLOURS["down"]
    }
    at.button_group(key="sweeps").set_value(["up"]).run()
    assert at.button(key="line_job_cancel")  # it begins by itself


def test_cancelled_is_shown_as_cancelled_and_goes_on():
    at = opened(**TINY | {"points": "300", "transient": "400"})
    start(at, "line_job")
    at.button(key="line_job_cancel").click().run()
    assert not at.exception and [job.state for job in list_jobs()] == ["cancelled"]
    assert "Cancelled" in at.warning[0].value and at.button(key="line_job_start").label == "Go on"
    at.button(key="line_job_start").click().run()
    assert [job.active for job in list_jobs()] == [True] and not at.warning


def test_a_damaged_job_can_be_started_again():
    at = opened(**TINY)
    start(at, "line_job")
    at.button(key="line_job_cancel").click().run()
    (job,) = list_jobs()
    (job.folder / "job.json").write_text("{")
    at.run()
    assert (
        not at.exception
        and "damaged" in at.error[0].value
        and at.button(key="line_job_start").label == "Try again"
    )
    at.button(key="line_job_start").click().run()
    assert not at.exception and not complaints(at) and len(figures(until_done(at))) == 1


def test_a_damaged_result_and_missing_files_are_sentences(tmp_path, monkeypatch):
    at = opened(**TINY)
    start(at, "line_job")
    until_done(at)
    (job,) = list_jobs()
    job.result.write_bytes(b"none")
    st.cache_resource.clear()
    at.run()
    assert not at.exception and "cannot read" in at.error[0].value
    monkeypatch.setattr(lines, "ARTIFACTS", tmp_path)
    at = opened()
    assert not at.exception and len(complaints(at)) == 1
