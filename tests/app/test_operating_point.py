"""The page "Operating point" without a browser: controls at their ends, wrong values, comparison,
every tab, failed points.
"""

import json
import math
import re
import shlex

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from spab_core import solve_point
from spab_core.cli.main import main
from spab_core.design.form import FIELDS, to_form, unused
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import design_toml, reference_design
from spab_core.trajectory.expected_time import expected_seconds
from spab_core.trajectory.point_file import load_point
from spab_core.trajectory.settings import Settings
from spab_core.ui import point as ui
from spab_core.ui.view import POINT_TABS
from tests.app.conftest import complaints, decoded, figures, verdicts
from tests.conftest import ROOT

PAGE = str(next((ROOT / "pages").glob("*_Operating_point.py")))
COARSE = {"mesh": "2x16", "transient": 30, "revolutions": 20}
pytestmark = pytest.mark.usefixtures("own_jobs")


def page(**state):
    at = AppTest.from_file(PAGE, default_timeout=240)
    for name, value in (COARSE | state).items():
        at.session_state[name] = value
    return at.run()


def numbers(array):
    """How many finite numbers an array of a figure has."""
    return int(np.isfinite(decoded(array)).sum())


@pytest.mark.parametrize(
    "mass, number, name", [(18.0, 4.5, "Chaotic"), (20.0, 2.0, "Repeats every")]
)
def test_every_tab_of_a_chaotic_and_a_periodic_point(mass, number, name):
    at = page(rotor_mass=mass, bearing_number=number, mesh="3x16", transient=200, revolutions=200)
    assert not at.exception and len(verdicts(at)) == 1 and verdicts(at)[0].startswith(name)
    assert len(at.metric) == 5 and at.number_input(key="rpm").value > 0.0
    count = {"Overview": 3, "Orbits": 2}
    settings = Settings("3x16", transient=200, revolutions=200)
    where = (reference_design(), mass, number, settings)
    path = solve_point(*where, path_revolutions=ui.LIVE_PATHS).trajectory.path
    outside = np.hypot(path[..., 2], path[..., 3]).max() > 1.0
    for tab in POINT_TABS:
        at.session_state["tab"] = tab
        at.run()
        assert not at.exception and not complaints(at)
        drawn = figures(at)
        assert len(drawn) == count.get(tab, 1), tab
        for figure in drawn:  # no plot is empty, every axis has a title
            # the exponent of a settled orbit: an estimate after each product with its matrix
            least = 2 if tab == "Exponent" else 20
            assert sum(numbers(t["y"]) for t in figure["data"]) > least, tab
            if tab != "Film 3-D":
                titles = [
                    a["title"]["text"] for k, a in figure["layout"].items() if k.startswith("yaxis")
                ]
                assert titles and all(titles)
        assert any("revolutions from rest" in c.value for c in at.caption)
        # why the disc is outside the circle, and what the running exponent ends at
        words = " ".join(c.value for c in at.caption)
        circle = "the clearance, which holds the journal alone" in words
        assert circle == (outside and tab in ("Overview", "Orbits"))
        assert ("(dotted) is its end" in words) == (tab == "Exponent")
        if tab == "Spectrum":
            told = next(c.value for c in at.caption if c.value.startswith("Strongest lines"))
            assert "order 1.00" in told and "µm" in told


def test_the_film_is_animated_and_honest_about_its_scale():
    at = page(tab="Film 3-D")
    pressure = figures(at)[0]
    assert 2 < len(pressure["frames"]) <= 36
    d = reference_design().bearing
    assert any(f"{0.25 * d.radius / d.clearance:,.0f} times wider" in c.value for c in at.caption)
    at.button_group(key="film_colour").select("Film thickness").run()
    assert not at.exception and figures(at)[0]["data"][0] != pressure["data"][0]


@pytest.mark.parametrize(
    "key, low, high", [("bearing_number", *BEARING_NUMBER_RANGE), ("rotor_mass", *ROTOR_MASS_RANGE)]
)
def test_the_point_at_its_ends(key, low, high):
    for value in (low, high):
        at = page()
        at.number_input(key=key).set_value(value).run()
        assert not at.exception and len(verdicts(at)) == 1


@pytest.mark.slow
def test_every_design_value_at_its_ends():
    """Either the design is taken, or a sentence says why not and the value stays."""
    at, usual = page(), to_form(reference_design())
    for name, field in FIELDS.items():
        if field.choices or name in unused(reference_design()):
            continue
        scale = 1.01325 if field.over_ambient else 1.0  # bar
        for end in (field.low * scale, field.high * scale):
            if end == usual[name]:
                continue
            at.number_input(key=f"my_{name}").set_value(end).run()
            assert not at.exception, name
            refused = any(e.value.endswith("stays as it was.") for e in at.error)
            assert refused != (name.replace("__", ".") in at.session_state["_design"]), name
            at.button(key="design_reset").click()
            at.number_input(key="bearing_number").set_value(3.45).run()
            assert at.session_state["_design"] == {}


def test_what_a_solve_costs_is_a_sentence():
    costs = []
    for more in ({}, {"mesh": "6x64", "revolutions": 5000, "transient": 5000}):
        at = page(bearing_number=1.0, **more)
        costs += [c.value for c in at.caption if " on this mesh: " in c.value]
    assert costs[0].startswith("Under a second on this mesh: it is solved while you wait.")
    assert re.match(r"About \d+ (s|min) at most on this mesh: it runs in the background", costs[1])


def test_a_wrong_design_is_said_and_not_taken():
    at = page(_design={"bearing.radius": 0.01})
    assert any(  # N and µm beside what the form has over p_a R² and C
        "In this bearing f₀ = 1,013 N (p_a R² = 10.13 N), s = 0.7 µm (C = 35 µm)." == c.value
        for c in at.caption
    )
    at.number_input(key="my_bearing__clearance").set_value(
        600.0
    ).run()  # more than a twentieth of the radius
    assert not at.exception and at.session_state["_design"] == {"bearing.radius": 0.01}
    assert any(
        "twentieth of the radius" in e.value and e.value.endswith("stays as it was.")
        for e in at.error
    )
    at.button(key="design_reset").click().run()
    assert at.number_input(key="my_bearing__clearance").value == 35.0
    assert not any("twentieth" in e.value for e in at.error)


def test_the_rigid_shaft():
    at = page(rotor_mass=10.0, tab="Orbits")
    at.checkbox(key="my_rigid").check().run()
    assert not at.exception and math.isinf(at.session_state["_design"]["rotor.shaft_stiffness"])
    assert at.number_input(key="my_rotor__shaft_stiffness").disabled and len(figures(at)) == 1
    at.checkbox(key="my_rigid").uncheck().run()
    assert not at.exception and at.session_state["_design"] == {} and len(figures(at)) == 2


def test_comparison_with_the_reference():
    at = page(rotor_mass=18.0, bearing_number=4.5)
    assert at.toggle(key="compare").disabled
    at.number_input(key="my_bearing__clearance").set_value(30.0).run()
    before = at.metric[0].value
    at.toggle(key="compare").set_value(True).run()
    assert (
        not at.exception
        and len(verdicts(at)) == 2
        and len(at.metric) == 10
        and at.metric[0].value == before
    )
    assert [at.metric[k].value for k in (0, 2)] != [at.metric[k].value for k in (5, 7)]
    headings = [m.value for m in at.markdown if m.value.startswith("**") and "rpm" in m.value]
    assert (
        "Λ 6.125" in headings[0] and "Λ 6.125" in headings[1]
    )  # the machine has kept its speed: 4.5 (35/30)²
    at.button_group(key="same").select("speed").run()
    headings = [m.value for m in at.markdown if m.value.startswith("**") and "rpm" in m.value]
    assert headings[0].split(", ")[-1] == headings[1].split(", ")[-1] and "Λ 4.500" in headings[1]
    for tab in POINT_TABS:
        at.session_state["tab"] = tab
        at.run()
        assert not at.exception and len(figures(at)) == {"Overview": 6, "Orbits": 4}.get(tab, 2)


def test_a_comparison_out_of_range_is_said_in_words():
    at = page(compare=True, same="speed", bearing_number=50.0, _design={"bearing.clearance": 60e-6})
    assert not at.exception and any(
        "bearing number" in e.value and "out of range" in e.value for e in at.error
    )


def test_a_failed_point_shows_its_run_up():
    """Without asperities 25 kg touch the wall (tests/app/test_home.py)."""
    at = page(rotor_mass=25.0, bearing_number=0.5, _design={"contact.force_at_closure": 0.0})
    assert (
        not at.exception
        and verdicts(at)[0].startswith("The run failed (the journal touched the wall)")
        and not at.metric
    )
    assert len(figures(at)) == 1 and any(
        numbers(t["x"]) > 20 for t in figures(at)[0]["data"] if t["name"] == "run-up"
    )
    for tab in POINT_TABS[1:]:
        at.session_state["tab"] = tab
        at.run()
        assert not at.exception and not figures(at) and len(at.info) == 1


@pytest.mark.parametrize("mesh", ["abc", "4x47", "9999x9999", ""])
def test_a_wrong_mesh_is_said_in_words(mesh):
    at = page(mesh=mesh)
    assert not at.exception and any("mesh" in e.value for e in at.main.error) and not at.metric
    at.session_state["mesh"] = "2x16"
    at.run()
    assert not at.exception and at.metric


def test_solver_controls_at_their_ends():
    at = page()
    for key, low, high in (("transient", 30, 40), ("revolutions", 20, 60)):
        for value in (low, high):
            at.number_input(key=key).set_value(value).run()
            assert not at.exception and len(verdicts(at)) == 1
    at.button_group(key="method").select("dtm").run()
    assert not at.exception and at.metric and "--method dtm" in at.code[-1].value


def test_long_work_is_asked_for_as_a_job():
    at = page(method="dtm", mesh="4x24", transient=200, revolutions=200)
    assert not at.exception and not at.metric and not figures(at)
    assert at.button(key="own_start").label.startswith("Solve in the background")


def test_expected_seconds_follow_the_measured_runs():
    """Milliseconds a revolution at 18 kg, one core (``benchmarks/live.py --costs``)."""
    for mesh, method, number, measured in (
        ("2x16", "rodas", 4.5, 0.074),
        ("3x16", "rodas", 4.5, 0.126),
        ("3x24", "rodas", 4.5, 0.236),
        ("8x16", "rodas", 4.5, 0.727),
        ("4x48", "rodas", 4.5, 1.81),
        ("8x32", "rodas", 4.5, 3.01),
        ("2x16", "dtm", 4.5, 0.430),
        ("3x16", "dtm", 1.5, 5.14),
        ("6x16", "dtm", 4.5, 47.2),
        ("4x48", "dtm", 4.5, 30.7),
        ("4x48", "dtm", 1.5, 85.1),
    ):
        told = expected_seconds(Settings(mesh, method, 200, 200), number) / 400
        assert 0.9 * measured < 1e3 * told < 1.7 * measured, (mesh, method)
    assert expected_seconds(Settings(transient=200, revolutions=200), 3.45) < ui.LIVE_SECONDS


def test_downloads_hold_everything(tmp_path, design):
    point = solve_point(
        design, 18.0, 4.5, Settings("2x16", transient=30, revolutions=20), path_revolutions=20
    )
    path = tmp_path / "point.npz"
    path.write_bytes(ui.point_npz(point))
    again = load_point(path)
    assert again.mle.value == point.mle.value and again.design == point.design
    with np.load(path, allow_pickle=False) as data:
        assert {"run_up", "film_pressure", "film_thickness", "force_film", "force_contact"} <= set(
            data.files
        )
        assert data["film_pressure"].shape == data["film_thickness"].shape == (73, 16, 2)
    table = ui.orbit_table(point)
    assert len(table) == 20 * 96 and table["tau"].iloc[0] == pytest.approx(2 * math.pi * 30)
    for title, make in ui.figures_of(point).items():
        assert len(make().data), title


def test_the_command_gives_the_same_answer(tmp_path, monkeypatch, capsys):
    at = page(
        rotor_mass=18.0, bearing_number=4.5, mesh="3x16", _design={"bearing.clearance": 30e-6}
    )
    words = shlex.split(at.code[-1].value)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(
        design_toml(reference_design().replace(bearing__clearance=30e-6))
    )
    assert words[0] == "spab" and main([*words[1:], "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert at.metric[0].value.startswith(f"{told['mle_per_revolution']:+.3f} ± ")
    assert (tmp_path / "orbit.csv").exists()


def test_comparing_leaves_the_film_of_one_design_as_high_as_it_was():
    """Figures of films are kept for all users: two side by side are shown lower, not made lower."""
    heights = []
    for compare in (False, True, False):
        at = page(tab="Film 3-D", compare=compare, _design={"bearing.clearance": 30e-6})
        assert not at.exception and len(figures(at)) == 1 + compare
        heights.append(figures(at)[0]["layout"]["height"])
    assert heights == [380] * 3
