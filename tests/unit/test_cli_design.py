"""``spab design …``: keys, files, units, and one sentence with exit code 2 for every wrong input."""

import json

import numpy as np
import pandas as pd
import pytest

from spab_core.cli.main import main
from spab_core.design.model import load_design, reference_design, save_design
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.coefficients import NAMES, coefficients, impedance
from spab_core.linear_theory.summary import derive
from spab_core.solver.film import Mesh
from tests.commands import answer, refused

MESH = ["--mesh", "3x24"]
POINT = ["--rotor-mass", "4.5"]
SHOW, TABLE = ["design", "show", *POINT], ["design", "coefficients", *POINT]


def test_presets(capsys):
    found = answer(capsys, "design", "presets")["presets"]
    assert [row["name"] for row in found] == list(PRESETS) and found[0][
        "bearing_number"
    ] == pytest.approx(3.371, abs=1e-3)
    assert main(["design", "presets"]) == 0
    text = capsys.readouterr().out
    assert all(p.label in text for p in PRESETS.values())


@pytest.mark.parametrize("name", PRESETS)
def test_a_new_file_is_the_preset(capsys, tmp_path, name):
    out = str(tmp_path / "my.toml")
    assert answer(capsys, "design", "new", "--preset", name, "--out", out)["out"] == out
    assert load_design(out) == preset(name).design


def test_show_speed_and_bearing_number_agree(capsys):
    d = reference_design()
    one = answer(capsys, "design", "show", *POINT, "--bearing-number", "3", *MESH)
    two = answer(capsys, "design", "show", *POINT, "--rpm", repr(d.speed_rpm(3.0)), *MESH)
    assert one["eccentricity"] == pytest.approx(two["eccentricity"], rel=1e-9)
    expected = derive(d, 4.5, 3.0, Mesh(3, 24)).record()
    assert one == expected | {"design": d.to_dict(), "mesh": "3x24"}


def test_show_a_file_and_a_rigid_preset_as_text(capsys, tmp_path):
    path = str(tmp_path / "d.toml")
    save_design(preset("fed_spindle").design, path)
    assert main(["design", "show", "--design", path, *POINT, "--rpm", "20000", *MESH]) == 0
    text = capsys.readouterr().out
    assert "20,000 rpm" in text and "normal litres" in text and "kxx" in text and "decays" in text
    found = answer(
        capsys, "design", "show", "--preset", "rigid_balanced", *POINT, "--rpm", "15000", *MESH
    )
    assert found["rigid"] is True and found["shaft_stiffness_number"] is None
    assert found["design"]["rotor"]["shaft_stiffness"] == "inf"


def test_coefficients_against_whirl_frequency(capsys, tmp_path):
    out = tmp_path / "c.csv"
    found = answer(
        capsys, *TABLE, "--bearing-number", "3", "--whirl", "0:2:5", "--out", str(out), *MESH
    )
    rows = pd.read_csv(out)
    assert found["axis"] == "frequency" and list(rows) == ["frequency", *NAMES, "whirl_ratio"]
    expected = coefficients(
        impedance(reference_design(), 4.5, 3.0, Mesh(3, 24)), np.linspace(0, 2, 5)
    )
    for name in NAMES:
        np.testing.assert_allclose(rows[name], expected.column(name))
    np.testing.assert_allclose(
        rows["frequency"], reference_design().speed(3.0) * np.linspace(0, 2, 5)
    )


def test_coefficients_against_speed_as_a_workbook(capsys, tmp_path):
    out = tmp_path / "c.xlsx"
    argv = [*TABLE, "--rpm", "8000:12000:3", "--out", str(out), *MESH]
    found = answer(capsys, *argv)
    assert (
        found["axis"] == "speed" and found["missing_speeds_rad_s"] == [] and len(found["rows"]) == 3
    )
    assert found["rows"][0]["speed"] == pytest.approx(8000 * np.pi / 30)
    assert all(
        0.3 < row["whirl_ratio"] < 0.7 for row in found["rows"]
    )  # half-speed whirl is the least stable here
    before = out.read_bytes()
    assert main(argv) == 0 and "shaft speed" in capsys.readouterr().out
    assert out.read_bytes() == before
    synchronous = answer(capsys, *argv, "--whirl", "1")
    assert [row["whirl_ratio"] for row in synchronous["rows"]] == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    "argv, words",
    [
        (["design"], "design_command"),
        ([*SHOW], "rpm"),
        ([*SHOW, "--rpm", "1", "--bearing-number", "1"], "either"),
        ([*SHOW, "--rpm", "1e9"], "rpm"),
        ([*SHOW, "--rpm", "x"], "number"),
        ([*SHOW, "--bearing-number", "0"], "bearing number"),
        (["design", "show", "--rotor-mass", "0", "--rpm", "9000"], "rotor mass"),
        ([*SHOW, "--rpm", "9000", "--preset", "x"], "fed_spindle"),
        ([*SHOW, "--rpm", "9000", "--preset", "spab60", "--design", "a.toml"], "either"),
        ([*SHOW, "--rpm", "9000", "--design", "/nowhere.toml"], "cannot read"),
        ([*SHOW, "--rpm", "9000", "--mesh", "1x1"], "mesh"),
        ([*SHOW, "--rpm", "9000", "--mesh", "8x256x2"], "mesh"),
        (["design", "new", "--preset", "spab60", "--out", "/nowhere/x.toml"], "--out"),
        (["design", "new", "--preset", "none", "--out", "x.toml"], "fed_spindle"),
        ([*TABLE, "--rpm", "9000", "--out", "c.txt", "--whirl", "0:1:3"], ".xlsx"),
        ([*TABLE, "--rpm", "9000", "--out", "c.csv"], "range"),
        ([*TABLE, "--out", "c.csv"], "either"),
        ([*TABLE, "--rpm", "9000:9100:3", "--whirl", "0:1:3", "--out", "c.csv"], "alone"),
        ([*TABLE, "--rpm", "9000", "--whirl=-1:1:3", "--out", "c.csv"], "whirl ratio"),
        ([*TABLE, "--rpm", "9000", "--whirl", "0:1:2000", "--out", "c.csv"], "count"),
        ([*TABLE, "--rpm", "0:9100:3", "--out", "c.csv"], "rpm"),
        ([*TABLE, "--rpm", "a", "--whirl", "0:1:3", "--out", "c.csv"], "'a'"),
        ([*TABLE, "--rpm", "nan", "--whirl", "0:1:3", "--out", "c.csv"], "nan"),
    ],
)
def test_wrong_input_is_one_sentence(capsys, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, *argv)
    assert list(tmp_path.iterdir()) == []


def test_json_is_json(capsys):
    assert main(["design", "show", *POINT, "--rpm", "9000", *MESH, "--json"]) == 0
    json.loads(capsys.readouterr().out)
