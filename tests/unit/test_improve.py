"""Better drawings: the front against brute force, predictions against solved machines, a whole
search in small.
"""

import json
import math

import numpy as np
import pandas as pd
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.design.model import load_design, save_design
from spab_core.design.presets import PRESETS
from spab_core.design.tolerances import Machine, parse_ranges, parse_tolerances, ranges_text
from spab_core.drawings import improve as better
from spab_core.drawings.improve import (
    Holds,
    Space,
    front_of,
    improve,
    load_improvement,
    save_improvement,
)
from spab_core.drawings.look import OVERLOADED, Look, look_at
from spab_core.drawings.screening import screen
from spab_core.linear_theory.equilibrium import static_equilibrium
from spab_core.reporting.drawings import improvement_section
from spab_core.trajectory.assessment import AVOID, GOOD
from spab_core.ui.drawings import _clicked

SPINDLE = Machine(PRESETS["fed_spindle_layered"].design, 4.0, 30000.0)
RANGES = {"bearing__clearance": (20.0, 32.0), "bearing__layer_permeability": (0.01, 0.1)}


def test_a_front_is_what_nobody_beats():
    rng = np.random.default_rng(0)
    costs, missed = rng.random((60, 2)).round(1), np.where(rng.random(60) < 0.3, 0.1, 0.0)
    front = front_of(costs, missed)
    allowed = np.flatnonzero(missed == 0.0)
    beaten = {
        k
        for k in allowed
        for other in allowed
        if (costs[other] <= costs[k]).all() and (costs[other] < costs[k]).any()
    }
    best = {tuple(costs[k]) for k in allowed if k not in beaten}
    assert {tuple(costs[k]) for k in front} == best and len(front) == len(best)
    assert (np.diff(costs[front, 0]) > 0).all() and (np.diff(costs[front, 1]) < 0).all()
    assert not len(front_of(costs, np.ones(60)))


def test_places_and_values():
    space = Space(SPINDLE, RANGES)
    assert space.values(np.array([0.5, 0.5])) == {
        "bearing__clearance": 26.0,
        "bearing__layer_permeability": pytest.approx(
            math.sqrt(0.001), rel=1e-5
        ),  # in the logarithm
    }
    for place in ([0.0, 0.0], [1.0, 1.0], [0.3, 0.7]):
        assert space.place(space.values(np.array(place))) == pytest.approx(place, abs=1e-5)
    assert space.machine_at(np.array([0.0, 0.0])).design.bearing.clearance == 20e-6
    assert parse_ranges(ranges_text(RANGES)) == RANGES


def test_a_prediction_is_near_what_is_solved():
    """Linear theory for a small unbalance, on another mesh than the solver's equilibrium."""
    small = SPINDLE.replace({"rotor__unbalance_eccentricity": 0.2})
    for machine, near in ((small, 0.02), (SPINDLE, 0.1)):
        said, solved = screen(machine, Look("speed", 1.2)), look_at(machine, Look(""))
        assert said["eccentricity"] == pytest.approx(solved["eccentricity"], rel=near)
        assert said["gas_flow"] == pytest.approx(solved["gas_flow"], rel=1e-3)
        assert said["stiffness"] == pytest.approx(solved["stiffness"], rel=1e-3)
        assert said["grade"] == solved["grade"] == GOOD
    resonant = SPINDLE._replace(speed_rpm=20000.0)
    assert screen(resonant, Look())["grade"] == look_at(resonant, Look(""))["grade"] == AVOID


def test_the_load_that_must_hold():
    fit = SPINDLE._replace(rotor_mass=10.0)
    number = fit.bearing_number
    most = max(
        k
        for k in range(1, 60)
        if (found := static_equilibrium(fit.design, 10.0 * k, number)) and found.eccentricity < 0.8
    )
    for load, grade in ((most, GOOD), (most + 1, AVOID)):
        assert Look(load=load).carries(fit) == (grade == GOOD)
    row = look_at(fit, Look("", load=most + 1))
    assert (row["grade"], row["trouble"]) == (AVOID, OVERLOADED)


def test_a_look_of_an_earlier_version_is_read():
    look = Look("mass", spacing=1.2)
    assert Look.from_dict(json.loads(json.dumps(look.to_dict()))) == look
    old = {k: v for k, v in look.to_dict().items() if k != "spacing"}
    assert Look.from_dict(old) == Look("mass")
    with pytest.raises(InputError, match="spacing"):
        Look(spacing=1.0).check()


def test_what_must_hold():
    rows = {
        "grade": np.array([0, 0, 0, 1, 0]),
        "eccentricity": np.array([0.1, 0.1, 0.1, 0.6, math.nan]),
        "gas_flow": np.array([5.0, 12.0, 5.0, 5.0, math.nan]),
        "stiffness": np.array([2e7, 2e7, 5e6, 2e7, 2e7]),
        "least_film": np.full(5, 8e-6),
    }
    missed = Holds(gas_flow=10.0, stiffness=1e7).violation(rows)
    allowed = Holds("watch").violation(rows)
    assert allowed.tolist() == [0.0] * 5
    assert Holds("watch", least_film=1e-5).violation(rows).tolist() == pytest.approx([0.2] * 5)
    assert missed.tolist() == pytest.approx([0.0, 0.2, 0.5, 1.3, 3.0])
    with pytest.raises(InputError, match="gas flow"):
        Holds(gas_flow=-1.0)


def test_a_fed_wall_without_its_storage_is_never_good():
    dense = SPINDLE.replace({"bearing__porosity": 0.0})
    assert "give the porosity" in better.outside_words(dense)
    assert look_at(dense, Look(""))["grade"] != GOOD
    assert better.outside_words(SPINDLE) == ""


@pytest.fixture
def small(monkeypatch):
    """A search of some dozen machines."""
    for name, value in (
        ("FIRST", 8),
        ("SURVIVORS", 6),
        ("POPULATION", 5),
        ("CAPS", 2),
        ("FRONT", 2),
        ("DRAWN", 4),
        ("SCREENED_RANGE", (1, 1000)),
        ("SOLVED_RANGE", (1, 1000)),
    ):
        monkeypatch.setattr(better, name, value)


@pytest.mark.slow
def test_a_search_in_small(small, tmp_path):
    given = parse_tolerances({"bearing.clearance": "± 1 µm"})
    look, ran = Look("speed", 1.25), []
    asked = (SPINDLE, RANGES, ("film", "flow"), look, Holds(), given)
    kept = {"screened": 18, "solved": 16, "seed": 1, "checkpoint": tmp_path / "parts"}
    found = improve(*asked, **kept, progress=ran.append)
    assert found.screened <= 28 and found.solved <= 26 and sum(ran) <= better.steps(18, 16, True)
    assert 1 <= found.count <= 2 and (found.rows["grade"] == GOOD).all()
    # the front's machines are what they are said to be, and no worse than the one to begin with
    k = found.best
    again = look_at(found.machine_at(k), look)
    for name in ("gas_flow", "least_film", "margin", "ends"):
        assert again[name] == pytest.approx(found.rows[name][k])
    # three points of a line of the front, two on the finer mesh
    assert not np.isfinite(found.rows["ends"]).any()
    assert (found.rows["points"] == 4).all() and (found.finer["points"] == 3).all()
    inside = (found.values >= [20.0, 0.01]).all() and (found.values <= [32.0, 0.1]).all()
    assert inside and found.before["grade"] == GOOD
    assert found.rows["gas_flow"].min() < found.before["gas_flow"]
    assert found.rows["least_film"].max() > found.before["least_film"]
    assert found.confirmed.any() and (found.finer["grade"] >= 0).all()
    assert ((found.shares >= 0.0) & (found.shares <= 1.0)).all()
    ran.clear()
    twice = improve(*asked, **kept, progress=ran.append)  # nothing is solved again
    assert twice.values.tolist() == found.values.tolist()
    assert twice.rows["seconds"].tolist() == found.rows["seconds"].tolist()
    save_improvement(found, tmp_path / "front.json")
    back = load_improvement(tmp_path / "front.json")
    assert json.dumps(back.record(), allow_nan=False) == json.dumps(found.record())
    assert any("What was bought" in text for text in back.sentences())
    (tmp_path / "front.json").write_text("[]")
    with pytest.raises(InputError, match="cannot read"):
        load_improvement(tmp_path / "front.json")


@pytest.mark.slow
def test_where_nothing_is_good_that_is_said(small):
    hot = SPINDLE._replace(speed_rpm=20000.0)  # on a resonance wherever this may move
    found = improve(
        hot, {"bearing__clearance": (24.9, 25.1)}, look=Look("speed", 1.05), screened=18, solved=16
    )
    assert found.count == 0 and found.best is None
    assert "No drawing" in found.sentences()[-1]
    assert json.dumps(found.record(), allow_nan=False)


def front_page(path):
    from pathlib import Path

    import streamlit as st

    from spab_core.drawings.improve import load_improvement
    from spab_core.ui.drawings import show_front
    from spab_core.ui.shared import page_head
    from spab_core.ui.view import chosen_design, chosen_point

    page_head("test")
    show_front(load_improvement(Path(path)))
    st.text((chosen_design(), *chosen_point()))


@pytest.mark.slow
def test_the_front_of_the_command_is_that_of_page_and_report(small, tmp_path, capsys):
    """Every drawing of the front is chosen by a click or in the field, and used everywhere."""
    out, best, given = (tmp_path / name for name in ("front.json", "best.toml", "own.toml"))
    save_design(SPINDLE.design, given)
    asked = f"--design {given} --rotor-mass 4 --rpm 30000 --wish film --wish flow --reach 1.05"
    some = f"--screened 18 --solved 16 --seed 1 --out {out} --best-out {best} --json"
    clearance = ["--vary", "bearing.clearance", "20:32 µm"]
    layer = ["--vary", "bearing.layer_permeability", "0.01:0.1 10⁻¹⁵ m²"]
    assert main(["design", "improve", *asked.split(), *clearance, *layer, *some.split()]) == 0
    answer, found = json.loads(capsys.readouterr().out), load_improvement(out)
    assert len(answer["front"]) == found.count >= 1
    assert load_design(best) == found.machine_at(found.best).design
    section = improvement_section(found)
    assert section.figures
    bought = pd.DataFrame(section.tables["What was bought with it"])
    pd.testing.assert_frame_equal(bought, pd.DataFrame(found.bought(found.best)))

    at = AppTest.from_function(front_page, args=(str(out),), default_timeout=120).run()
    assert not at.exception and at.selectbox(key="drawing").value == found.best + 1
    for k in range(found.count):
        clicked = {"selection": {"points": [{"customdata": [k]}]}}
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(st, "session_state", {"front": clicked})
            _clicked(found)
            assert st.session_state["drawing"] == k + 1
        at.selectbox(key="drawing").set_value(k + 1).run()
        assert not at.exception
        at.button(key="use_drawing").click().run()
        machine = found.machine_at(k)
        number = float(f"{machine.bearing_number:.6g}")
        assert at.text[-1].value == str((machine.design, 4.0, number))


def test_the_command_refuses_in_a_sentence(capsys):
    machine = ["design", "improve", "--rotor-mass", "4", "--rpm", "30000"]
    clearance = ["--vary", "bearing.clearance", "20:30 µm"]
    for more, word in (
        (["--vary", "bearing.clearance", "20:30"], "not understood"),
        (["--vary", "bearing.shape", "1:2"], "there is no value"),
        (["--vary", "bearing.clearance", "20:4000 µm"], "reaches 4000"),
        (clearance * 2, "given twice"),
        ([*clearance, "--wish", "flow"], "two different wishes"),
        ([*clearance, "--wish", "flow", "--wish", "beauty"], "wish"),
        ([*clearance, "--solved", "3"], "solved"),
        ([*clearance, "--most-gas-flow", "-3"], "gas flow"),
        ([*clearance, "--held-film", "-1"], "least film"),
        ([*clearance, "--load", "0.5"], "load"),
    ):
        assert main(machine + more) == 2
        err = capsys.readouterr().err
        assert word in err and "Traceback" not in err, err
