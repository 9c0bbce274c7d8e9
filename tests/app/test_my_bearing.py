"""My bearing: what is typed becomes the design of every page; numbers beside it; wrong values and
files in one sentence.
"""

import io
import json
import math

import numpy as np
import pandas as pd
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.common.units import from_rpm
from spab_core.design.form import FIELDS, eccentricity_of_grade
from spab_core.design.model import design_toml, load_design, reference_design
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.coefficients import NAMES, Coefficients
from spab_core.linear_theory.summary import derive
from spab_core.ui import bearing, view
from tests.app.conftest import address, complaints, decoded, figures, verdicts
from tests.conftest import ROOT

PAGE = str(next((ROOT / "pages").glob("*_My_bearing.py")))


@pytest.fixture
def page():
    st.cache_resource.clear()
    return run(AppTest.from_file(PAGE, default_timeout=60))


def run(at):
    """Run the page, or with an element's new value; no exception may show."""
    at = at.run()
    assert not at.exception
    return at


def design_of(at):
    """The design that the page's session holds, from the address that would be copied."""
    changes = {k: view._design_value(k, v) for k, v in address(at).items() if "." in k}
    return view._changed(changes)


def metric(at, label):
    return next(m.value for m in at.metric if m.label.startswith(label))


def type_in(at, name, value):
    return run(at.number_input(key=f"my_{name}").set_value(value))


def test_first_view_is_the_reference_with_its_numbers(page):
    assert len(
        [
            n
            for n in page.number_input
            if n.key.startswith("my_") and n.key.removeprefix("my_") in FIELDS
        ]
    ) == sum(not field.choices for field in FIELDS.values())
    found = derive(reference_design(), 4.52, 3.45)
    assert metric(page, "Eccentricity") == f"{found.eccentricity:.3f}"
    assert metric(page, "Attitude angle") == f"{found.attitude_angle:.1f}°"
    (words,) = verdicts(page)
    assert "Half-speed whirl" in words and "not recommended" in words
    assert "Unstable at rest: a whirl at 4,947 cycles/min" in words and not page.query_params
    data = json.loads(page.get("plotly_chart")[0].proto.spec)["data"]
    assert len(data) == 8 and {t["name"] for t in data} == {"xx", "xy", "yx", "yy"}
    assert any(list(table.value.columns) == list(NAMES) for table in page.dataframe)
    assert page.selectbox(key="my_preset").value == "spab60"


def test_a_typed_value_is_the_design_of_the_dashboard_and_the_machine_keeps_its_speed(page):
    rpm = page.number_input(key="rpm").value
    before = metric(page, "Eccentricity")
    type_in(page, "bearing__clearance", 30.0)
    assert address(page)["bearing.clearance"] == "3e-05"
    assert design_of(page) == reference_design().replace(bearing__clearance=30e-6)
    assert page.number_input(key="rpm").value == rpm
    number = page.number_input(key="bearing_number").value
    assert (
        number == pytest.approx(design_of(page).bearing_number(from_rpm(rpm)), rel=1e-5)
        and number > 4.0
    )
    assert (
        metric(page, "Eccentricity") != before and metric(page, "Bearing number") == f"{number:.3g}"
    )
    assert page.selectbox(key="my_preset").value is None
    type_in(page, "bearing__clearance", 35.0)
    assert (
        not [k for k in page.query_params if "." in k]
        and page.selectbox(key="my_preset").value == "spab60"
    )


@pytest.mark.parametrize(("given_as", "kept"), [("gauge", 5.0), ("absolute", 6.01325)])
def test_another_ambient_pressure_leaves_the_supply_as_it_is_given(page, given_as, kept):
    type_in(page, "bearing__supply_pressure_ratio", 6.01325)
    if given_as == "absolute":
        run(page.button_group(key="supply_as").set_value("absolute"))
    type_in(page, "gas__ambient_pressure", 0.9)
    ratio = design_of(page).bearing.supply_pressure_ratio
    assert ratio == pytest.approx((kept + (0.9 if given_as == "gauge" else 0.0)) / 0.9, rel=1e-6)
    assert page.number_input(key="supply").value == pytest.approx(kept, rel=1e-6)
    shown = page.number_input(key="my_bearing__supply_pressure_ratio").value
    assert shown == pytest.approx(0.9 * ratio, rel=1e-6)


def test_a_wrong_value_is_told_and_changes_nothing(page):
    type_in(page, "bearing__clearance", 0.01)
    assert (
        "Radial clearance C = 0.01 µm is out of range" in page.error[0].value
        and "stays as it was" in page.error[0].value
    )
    assert design_of(page) == reference_design()
    type_in(page, "bearing__clearance", None)
    assert "is empty" in page.error[0].value
    type_in(page, "bearing__radius", 10.0)
    type_in(page, "bearing__clearance", 600.0)
    assert "twentieth" in page.error[0].value
    type_in(page, "bearing__clearance", 35.0)
    type_in(page, "bearing__radius", 60.0)
    type_in(page, "bearing__clearance", 34.0)
    assert (
        not any("stays as it was" in e.value for e in page.error)
        and design_of(page).bearing.clearance == 34e-6
    )


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_shown(page, name):
    other = next(n for n in PRESETS if n != name)
    run(page.selectbox(key="my_preset").set_value(other))
    run(page.selectbox(key="my_preset").set_value(name))
    p = preset(name)
    assert design_of(page) == p.design and page.selectbox(key="my_preset").value == name
    assert page.number_input(key="rpm").value == pytest.approx(p.speed_rpm, rel=1e-5)
    assert page.number_input(key="rotor_mass").value == p.rotor_mass
    assert page.checkbox(key="my_rigid").value == p.design.rigid
    assert metric(page, "Shaft stiffness") == (
        "rigid" if p.design.rigid else f"{p.design.shaft_stiffness_number:.3g}"
    )


def test_a_rigid_shaft_and_back(page):
    run(page.checkbox(key="my_rigid").check())
    assert design_of(page).rigid and page.number_input(key="my_rotor__shaft_stiffness").disabled
    run(page.checkbox(key="my_rigid").uncheck())
    assert design_of(page) == reference_design()


def test_unbalance_as_a_balance_grade(page):
    run(page.button_group(key="my_unbalance_as").select("grade G"))
    assert page.number_input(key="my_grade").value == pytest.approx(
        0.8 * 13e-3 * reference_design().speed(3.45), rel=1e-4
    )
    run(page.number_input(key="my_grade_rpm").set_value(20000.0))
    run(page.number_input(key="my_grade").set_value(2.5))
    of_grade = float(f"{eccentricity_of_grade(2.5, 20000.0, 0.2):.6g}")
    assert design_of(page).rotor.unbalance_eccentricity == of_grade
    assert (
        page.number_input(key="my_grade").value == 2.5
        and page.number_input(key="my_grade_rpm").value == 20000.0
    )
    run(page.number_input(key="my_grade").set_value(-1.0))
    assert "Balance quality grade G = -1 mm/s is out of range" in page.error[0].value
    assert design_of(page).rotor.unbalance_eccentricity == of_grade


def test_speed_in_rpm_or_as_bearing_number(page):
    run(page.number_input(key="rpm").set_value(12000.0))
    number = reference_design().bearing_number(400.0 * math.pi)
    assert float(address(page)["bearing_number"]) == pytest.approx(number, rel=1e-5)
    run(page.number_input(key="bearing_number").set_value(2.0))
    assert page.number_input(key="rpm").value == pytest.approx(
        reference_design().speed_rpm(2.0), rel=1e-5
    )
    speed = page.number_input(key="rpm").value
    run(page.number_input(key="rpm").set_value(1e9))
    assert "shaft speed = 1e+09 rpm is out of range: allowed is from 29." in page.error[0].value
    assert page.number_input(key="rpm").value == speed and address(page)["bearing_number"] == "2"


def test_a_design_out_of_the_address(page):
    at = AppTest.from_file(PAGE, default_timeout=60)
    at.query_params["bearing.radius"] = "0.05"
    run(at)
    assert (
        at.number_input(key="my_bearing__radius").value == 50.0
        and design_of(at).bearing.radius == 0.05
    )


class File(io.BytesIO):
    name = "given.toml"


def upload(at, data):
    """A file handed in: AppTest knows no file uploader, so its callback is called with the file in
    its place.
    """
    script = "\n".join(
        [
            "import streamlit as st",
            "from spab_core.ui import design_form as form",
            "from spab_core.ui.shared import page_head",
            "page_head('test')",
            "from tests.app.test_my_bearing import File",
            "st.session_state['my_file'] = File(st.session_state['given'])",
            "st.session_state.setdefault('my_error', None)",
            "form._uploaded()",
            "st.text(st.session_state['my_error'] or 'taken')",
            "from spab_core.ui.view import chosen_design",
            "from spab_core.design.model import design_toml",
            "st.code(design_toml(chosen_design()))",
            "st.text(str(st.session_state.get('name')) + st.session_state.get('my_notes', ''))",
            "form.design_fields()",
        ]
    )
    at = AppTest.from_string(script)
    at.session_state["given"] = data
    return run(at)


def test_an_uploaded_file_is_the_design_or_is_refused():
    design = preset("small_high_speed").design
    at = upload(None, design_toml(design).encode())
    assert at.text[0].value == "taken" and at.code[0].value == design_toml(design).strip()
    at = upload(None, b"[bearing]\nradius = -1")
    assert "given.toml" in at.text[0].value and "bearing.radius" in at.text[0].value
    assert at.code[0].value == design_toml(reference_design()).strip()


def test_what_an_uploaded_file_leaves_out_and_may_mean_is_shown():
    data = b'name = "A"\nnotes = "b"\n[bearing]\nradius = 0.04\nclearance = 5e-05\n'
    at = upload(None, b"\xef\xbb\xbf" + data)
    assert at.text[0].value == "taken" and at.text[1].value == "Ab"
    left, doubt = (w.value for w in at.warning)
    assert "Of the reference design" in left and "bearing.wall_thickness = 0.0045 m" in left
    assert "diametral" in doubt and "write 2.5e-05" in doubt
    at = upload(None, design_toml(preset("small_high_speed").design).encode())
    assert not at.warning


def test_downloads_are_the_design_and_its_coefficients(page, monkeypatch, tmp_path):
    made = {}
    real = st.download_button

    def seen(
        label, data, file_name, *more, **options
    ):  # AppTest does not hand out what a button downloads
        made[file_name] = data
        return real(label, data, file_name, *more, **options)

    monkeypatch.setattr(st, "download_button", seen)
    monkeypatch.setattr(bearing, "SPEEDS", bearing.SPEEDS[:3])
    type_in(page, "bearing__radius", 55.0)
    (tmp_path / "my.toml").write_text(made["my.toml"])
    assert load_design(tmp_path / "my.toml") == reference_design().replace(bearing__radius=0.055)
    rows = pd.read_csv(io.BytesIO(made["bearing_frequency.csv"]()))
    assert list(rows)[:3] == ["speed", "frequency", "kxx"] and len(rows) == len(
        bearing.WHIRL_RATIOS
    )
    assert all(made[f"bearing_{k}.xlsx"]()[:2] == b"PK" for k in ("whirl", "synchronous"))
    element = json.loads(made["bearing.json"]())["BearingElement_spab"]
    assert np.shape(element["kyx"]) == (3, len(element["frequency"]))


def test_against_shaft_speed(page, monkeypatch):
    seen = []
    real = Coefficients.column
    monkeypatch.setattr(
        Coefficients, "column", lambda self, name: seen.append(len(self.speed)) or real(self, name)
    )
    run(page.button_group(key="against").select("shaft speed"))
    figure = json.loads(page.get("plotly_chart")[0].proto.spec)
    assert (
        figure["layout"]["xaxis"]["title"]["text"] == "shaft speed, rpm"
        and len(bearing.SPEEDS) in seen
    )


def test_no_equilibrium_is_said_in_words(page):
    type_in(page, "contact__force_at_closure", 0.0)
    run(page.number_input(key="rotor_mass").set_value(900.0))
    run(page.number_input(key="bearing_number").set_value(0.1))
    assert "No static equilibrium" in page.error[0].value and not page.get("plotly_chart")
    assert len(page.metric) == 5


def test_the_keys_of_the_page_are_not_those_of_the_view():
    assert not [key for key in view.VIEW if key.startswith("my_")]


def test_a_cylinder_in_form_and_address(page):
    """The shape is chosen, its length counts, the other extent is off; the address holds both."""
    run(page.segmented_control(key="my_bearing__shape").set_value("cylinder"))
    assert page.number_input(key="my_bearing__edge_latitude").disabled
    type_in(page, "bearing__length", 50.0)
    assert design_of(page).bearing.length == 0.05 and not complaints(page)
    kept = address(page)
    assert kept["bearing.shape"] == "cylinder" and kept["bearing.length"] == "0.05"
    found = derive(design_of(page), 4.52, float(page.session_state["bearing_number"]))
    assert metric(page, "Eccentricity") == f"{found.eccentricity:.3f}"
    again = AppTest.from_file(PAGE, default_timeout=240)
    for key, value in kept.items():
        again.query_params[key] = value
    assert design_of(run(again)) == design_of(page)
    bad = AppTest.from_file(PAGE, default_timeout=240)
    bad.query_params["bearing.shape"] = "cube"
    assert design_of(run(bad)) == reference_design()
    assert any("cube" in box.value for box in [*bad.warning, *bad.error])


def test_what_the_wall_does_is_told(page):
    """The fed spindle at 4 kg, 20,000 rpm: the wall's numbers by the formulas of docs/model.md,
    what a quasi-steady wall would have hidden, and the assumptions' marks.
    """
    run(page.selectbox(key="my_preset").set_value("fed_spindle"))
    p = preset("fed_spindle")
    b, gas, omega = p.design.bearing, p.design.gas, p.speed_rpm * math.pi / 30.0
    assert (p.rotor_mass, p.speed_rpm) == (4.0, 20_000.0)
    sigma = b.porosity * gas.viscosity * omega * b.wall_thickness**2
    sigma /= b.permeability * gas.ambient_pressure
    assert metric(page, "Storage number σ_w") == f"{sigma:.3g}"
    # φ H_p over C, times the mean pressures' ratio: the wall's between the film's and the supply's
    pores = b.porosity * b.wall_thickness / b.clearance
    assert pores < float(metric(page, "Pores' gas / film's")) < pores * b.supply_pressure_ratio
    # a wave of ν decays over H_p (2 P/(ν σ_w))^½, P between the ambient's and the supply's
    reach = float(metric(page, "Waves reach").removesuffix(" mm"))
    whirl = float(metric(page, "Whirl / speed"))
    shortest = 1e3 * b.wall_thickness * math.sqrt(2.0 / (whirl * sigma))
    assert shortest < reach < shortest * math.sqrt(b.supply_pressure_ratio)
    (words,) = verdicts(page)
    assert "Taken as quasi-steady the wall would have made it look stable, the unsafe side" in words
    table = next(t.value for t in page.dataframe if "Holds" in t.value)
    found = derive(p.design, p.rotor_mass, p.design.bearing_number(omega)).assumptions
    assert list(table["Number"]) == [one.name for one in found] and len(table) == 6
    assert list(table["Holds"]) == [one.value <= one.limit for one in found]
    assert table["Holds"].all() and any("all hold" in box.label for box in page.expander)


def test_a_wall_that_is_taken_as_quasi_steady_is_marked(page):
    """No numbers of pores that are not given; the mark is off and the verdict says why."""
    run(page.selectbox(key="my_preset").set_value("fed_spindle"))
    type_in(page, "bearing__porosity", 0.0)
    assert not any(
        m.label.startswith(("Storage number", "Pores' gas", "Waves")) for m in page.metric
    )
    table = next(t.value for t in page.dataframe if "Holds" in t.value).set_index("Number")
    assert list(table.index[~table["Holds"]]) == [
        "storage number of the wall at a porosity of 0.15"
    ]
    (words,) = verdicts(page)
    assert "pneumatic hammer" in words and "unsafe side" not in words
    assert any("1 outside the theory" in box.label for box in page.expander)


def test_load_curves_are_drawn(page):
    """Of a fed sphere radially and along the axis, rising from nothing; at rest the radial curve
    carries the weight.
    """
    run(page.selectbox(key="my_preset").set_value("fed_spindle"))
    run(page.toggle(key="load_curves").set_value(True))
    figure = figures(page)[-1]
    radial, axial = figure["data"]
    titles = [note["text"] for note in figure["layout"]["annotations"]]
    assert titles == ["Radial force, N", "Axial force, N"]
    for curve in (radial, axial):
        force = decoded(curve["y"])
        assert abs(force[0]) < 1e-9 and (np.diff(force) > 0.0).all() and len(force) == 12
    at_rest = float(metric(page, "Eccentricity"))
    carried = np.interp(at_rest, decoded(radial["x"]), decoded(radial["y"]))
    assert carried == pytest.approx(4.0 * 9.81, rel=0.02)
    assert figure["layout"]["shapes"][0]["x0"] == pytest.approx(at_rest, abs=5e-4)
    run(page.segmented_control(key="my_bearing__shape").set_value("cylinder"))
    assert len(figures(page)[-1]["data"]) == 1
