"""The pages "My map" and "What if" without a browser: real jobs on small work, wrong values, lists
and comparison.
"""

import re

import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.design.model import reference_design
from spab_core.design.presets import PRESETS
from spab_core.jobs.store import list_jobs, submit
from spab_core.plotting.theme import GRADE_MARKS
from spab_core.shipped import preset_maps
from spab_core.shipped.preset_maps import MAPS, load_preset_map
from spab_core.trajectory import compiling
from spab_core.trajectory.assessment import GRADES
from spab_core.ui import solving
from spab_core.ui.verdict import grade_label
from spab_core.ui.view import OWN_LAYERS
from tests.app.conftest import complaints, figures, start, until_done, until_margin, verdicts
from tests.conftest import ROOT

MAP, WHAT_IF, SWEEPS = (
    str(next((ROOT / "pages").glob(f"*_{name}.py")))
    for name in ("My_map", "What_if", "Bifurcation")
)
SMALL = {"own_numbers": "2:4:6", "own_masses": "3:9:6"}
QUICK = {"mesh": "2x16", "transient": 40, "revolutions": 30}
pytestmark = pytest.mark.usefixtures("own_jobs")


def opened(page, **state):
    at = AppTest.from_file(page, default_timeout=120)
    for key, value in state.items():
        at.session_state[key] = value
    return at.run()


def words(at):
    return " ".join(
        x.value
        for kind in ("markdown", "caption", "success", "warning", "error", "info")
        for x in at.get(kind)
    )


@pytest.mark.slow
@pytest.mark.usefixtures("unasked")
def test_a_bearing_is_mapped_its_margin_told_and_the_job_listed():
    at = opened(MAP, **SMALL, own_minutes=5.0, bearing_number=3.0, rotor_mass=6.0)
    assert not at.exception and "The map that comes with spab" in words(at)
    at.button(key="own_map_start").click().run()
    at = until_margin(until_done(at))
    assert not at.exception and not complaints(at)
    names = {trace.get("name") for trace in figures(at)[0]["data"]}
    assert "solved (36)" in names and "chosen point" in names
    assert {m.label: m.value for m in at.metric}["Solved cells"] == "36"
    # the margin is that of the solved lines, without a click; nothing of the map is a margin
    assert "Solved margin: " in words(at) and "redicted limit" not in words(at)
    assert "The cell of this point is solved: " in words(at)
    tiles = {m.label: m.value for m in at.metric}
    shares = [tiles[name] for name in ("Good", "To be watched", "Not recommended")]
    assert sum(float(value[:-2]) for value in shares) == pytest.approx(100.0, abs=0.15)
    assert tiles["Failed runs"] == "0.0 %"
    for layer in OWN_LAYERS:
        at.button_group(key="own_layer").set_value(layer).run()
        (heatmap,) = (t for t in figures(at)[0]["data"] if t["type"] == "heatmap")
        assert not at.exception and "probability of this assessment" in heatmap["hovertemplate"]
    at.number_input(key="rotor_mass").set_value(20.0).run()
    assert "outside this map" in words(at)
    (job,) = list_jobs()
    assert job.state == "done"
    at.number_input(key="own_minutes").set_value(7.0).run()  # of another map
    assert "solved (36)" in {trace.get("name") for trace in figures(at)[0]["data"]}


@pytest.mark.slow
def test_two_maps_are_compared():
    submit(
        "map",
        {"bearing_number": "2:4:4", "rotor_mass": "3:9:5", "seconds": 300.0, "settings": QUICK},
    )
    until_done(opened(MAP))  # one map of a design at a time
    at = opened(MAP, own_numbers="2:3:4", own_masses="3:9:5")
    at.button(key="own_map_start").click().run()  # with the page's own settings: another job
    at = until_done(at)
    assert (
        not at.exception
        and len(figures(at)) == 3
        and len(at.selectbox(key="own_other").options) == 1
    )


def of_preset(page, name, porosity=None, **state):
    """A page opened at a preset's own design and point."""
    one = PRESETS[name]
    design = one.design if porosity is None else one.design.replace(bearing__porosity=porosity)
    at = AppTest.from_file(page, default_timeout=120)
    usual = reference_design().to_dict()
    for section, values in design.to_dict().items():
        for key, value in values.items():
            if usual[section].get(key) != value:
                at.query_params[f"{section}.{key}"] = repr(value)
    at.query_params["rotor_mass"] = repr(one.rotor_mass)
    at.query_params["bearing_number"] = repr(
        float(design.bearing_number(one.speed_rpm * np.pi / 30.0))
    )
    for key, value in state.items():
        at.session_state[key] = value
    at.run()
    assert not at.exception
    return at


@pytest.fixture
def no_solver(monkeypatch):
    """As while another process compiles: pages show what is known, and nothing is solved."""
    monkeypatch.setattr(compiling, "seconds_so_far", lambda: 12.0)
    monkeypatch.setattr(solving, "is_compiled", lambda *a, **k: False)


def test_a_preset_shows_the_map_that_comes_with_spab_with_and_without_storage(no_solver):
    cells = int(load_preset_map(MAPS[0]).solved.sum())
    at = of_preset(MAP, "fed_spindle")
    assert f"**Shipped example: Fed porous spindle**, {cells} cells solved of 5,120" in words(at)
    assert "The cell of this point is " in words(at) and not complaints(at)
    assert words(at).count("Assumed, not typed: ") == 1
    # a new map reaches from a quarter of the point to three times it
    point = {"own_numbers": 20_000.0, "own_masses": 4.0}
    for key, value in point.items():
        for end, factor in (("from", 0.25), ("to", 3.0)):
            shown = at.number_input(key=f"{key}_{end}").value
            assert shown == pytest.approx(factor * value, rel=1e-4)
    solved = [{t.get("name") for t in figure["data"]} for figure in figures(at)]
    assert len(solved) == 3 and all(f"solved ({cells})" in names for names in solved)
    assert [e.label for e in at.expander if e.proto.expanded] == [
        "The same bearing with another wall"
    ]
    assert [text.partition(": ")[2] for text in at.selectbox(key="own_other").options] == [
        "Fed porous spindle, quasi-steady wall",
        "Fed spindle, layered",
    ]
    # what storage does: the share to be avoided
    with_gas, without = (x.value for x in at.caption if "of the plane." in x.value[-15:])
    avoid = [float(re.search(r"not recommended ([0-9.]+) %", t)[1]) for t in (with_gas, without)]
    assert avoid[0] > 2.0 * avoid[1]
    at = of_preset(MAP, "fed_spindle", porosity=0.0)
    assert "**Shipped example: Fed porous spindle, quasi-steady wall**" in words(at)
    at = of_preset(MAP, "fed_spindle", porosity=0.14)  # another design: nothing is shown of it
    assert "Shipped example" not in words(at) and not figures(at)


def test_a_stale_map_is_not_shown_but_said(no_solver, monkeypatch):
    st.cache_resource.clear()
    monkeypatch.setattr(preset_maps, "code_hash", lambda: "another")
    at = of_preset(MAP, "fed_spindle")
    assert not figures(at) and "solver's code has changed since; `make preset-maps`" in words(at)
    st.cache_resource.clear()


def test_other_pages_show_a_preset_by_its_map_too(no_solver):
    at = of_preset(str(ROOT / "app.py"), "fed_spindle")
    assert "Shipped example: Fed porous spindle. Dots are solved cells" in words(at)
    # until the kernels for its wall are there
    assert "**Shipped example: Fed porous spindle.** The cell of this point is" in words(at)
    told = [b.proto.text for b in at.get("progress") if "ompil" in b.proto.text]
    assert told[0] == (
        "Compiling the solver for a wall that stores gas: 12 s so far, some "
        f"{compiling.STORING_SECONDS} s in all, once on this machine"
    )
    at = of_preset(SWEEPS, "fed_spindle", line="rotor-mass")
    assert "solved or predicted. The section and the other sweeps" in words(at) and figures(at)


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("own_numbers", "1:2", "start:stop:count"),
        ("own_numbers", "0:2:10", "bearing number = 0 is out of range"),
        ("own_masses", "1:2:100000", "out of range"),
        ("own_masses", "x", "start:stop:count"),
        ("own_dask", "nowhere", "no address"),
    ],
)
def test_a_wrong_plane_is_a_sentence(key, value, told):
    at = opened(MAP, **SMALL | {key: value})
    assert not at.exception and told in at.error[0].value


@pytest.mark.slow
@pytest.mark.usefixtures("unasked")
def test_sensitivity_of_the_margin():
    own = {"bearing.wall_thickness": 4.501e-3}
    at = opened(WHAT_IF, bearing_number=3.0, rotor_mass=8.0, _design=own)
    assert not at.exception and not figures(at) and at.button(key="what_job_cancel")
    at.button(key="what_job_cancel").click().run()  # it has begun by itself
    at.number_input(key="what_scan").set_value(4).run()
    start(at, "what_job")
    at = until_done(at)
    assert not at.exception and not complaints(at)
    assert words(at).count("Assumed, not typed: ") == 1
    (box,) = at.error  # 8 kg at this speed whirl and rub
    assert "Not recommended at 8,899 rpm (rubbing)" in box.value and "ends at" in box.value
    (figure,) = figures(at)
    assert {t["type"] for t in figure["data"]} == {"bar"} and len(figure["data"][0]["y"]) == 4
    assert len(at.dataframe[0].value) == 8 and "rpm" in words(at)


def test_a_run_up_lists_what_it_crosses():
    # all but the reference design, whose values nobody needs to assume
    own = {"bearing.wall_thickness": 4.501e-3}
    point = {"bearing_number": 3.0, "rotor_mass": 8.0, "_design": own}
    at = opened(WHAT_IF, **point, what_tab="Run-up", run_count=10)
    start(at, "run_job")
    at = until_done(at)
    assert not at.exception and not complaints(at)
    table = at.dataframe[0].value
    assert list(table) == ["assessment", "why", "first_rpm", "last_rpm"]
    labels = {grade_label(grade) for grade in GRADES}
    assert set(table["assessment"]) <= labels and len(set(table["assessment"])) > 1
    # a band begins where the one before ended, one step on
    steps = table["first_rpm"].to_numpy()[1:] - table["last_rpm"].to_numpy()[:-1]
    assert np.allclose(steps, steps[0])
    assert words(at).count("Assumed, not typed: ") == 1
    (box,) = at.error  # the worst of the run-up decides the colour
    assert "By the motion alone: not recommended" in box.value
    (figure,) = figures(at)
    bands = [shape["name"] for shape in figure["layout"]["shapes"]]
    assert len(bands) == len(table) and set(bands) <= set(GRADES)
    marks = " ".join(note["text"] for note in figure["layout"]["annotations"])
    assert GRADE_MARKS["avoid"] in marks and "not recommended" in marks


@pytest.mark.slow
def test_two_designs_side_by_side():
    at = opened(WHAT_IF, what_tab="Two designs")
    for name in PRESETS:
        at.selectbox(key="two_preset").set_value(name).run()
        assert not at.exception and len(figures(at)) == 2
    table = at.dataframe[0].value
    assert (
        list(table.columns) == ["This design", f"Other: {PRESETS[name].label}"]
        and "Exponent (MLE) per revolution" in table.index
    )
    assert set(table.loc["assessment"]) <= {grade_label(grade) for grade in GRADES}
    assert any("Better judged: " in x or "Both are" in x for x in verdicts(at))


@pytest.mark.parametrize("content", [b"[bearing]\nradius = -1", b"\xff\xfe", b"x" * 2_000_000])
def test_a_wrong_file_of_another_design_is_a_sentence(content):
    at = opened(WHAT_IF, what_tab="Two designs")
    assert not at.exception and len(figures(at)) == 2
    at.file_uploader(key="two_file").set_value(("other.toml", content, "application/toml")).run()
    assert (
        not at.exception
        and len(complaints(at)) == 1
        and "other.toml" in at.error[0].value
        and not figures(at)
    )


def test_a_run_up_downwards_is_a_sentence():
    at = opened(WHAT_IF, what_tab="Run-up")
    assert not at.exception and not complaints(at)
    at.number_input(key="run_from_shown").set_value(20_000.0).run()
    assert not at.exception and "range" in at.error[0].value
