"""``spab design …``: keys, files, units, one sentence and exit code 2 for every wrong input."""

import json
import re
import zipfile

import numpy as np
import pandas as pd
import pytest

from spab_core.cli.main import main
from spab_core.design.model import load_design, reference_design, save_design
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.coefficients import (
    FILM_WHIRL,
    NAMES,
    coefficients,
    coefficients_over_speed,
)
from spab_core.linear_theory.impedance import impedance
from spab_core.linear_theory.modes import FILM_MODE, SHAFT_MODE
from spab_core.linear_theory.ross_table import coefficient_table
from spab_core.linear_theory.summary import derive
from spab_core.solver.film import Mesh
from tests.commands import answer, refused

MESH = ["--mesh", "3x16"]
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
    expected = derive(d, 4.5, 3.0, Mesh(3, 16)).record() | {"design": d.to_dict(), "mesh": "3x16"}
    assert {name: one[name] for name in expected} == expected
    assert one["assessment"] == "avoid" and one["regime"] == "periodic" and one["period"] == 2
    assert one["motion_least_film_m"] < 5e-6 < 25e-6 < one["least_film_m"]


def test_show_says_that_a_rotor_lies_on_its_wall(capsys):
    argv = ["design", "show", "--preset", "spab60", "--rotor-mass", "25", "--rpm", "600"]
    found = answer(capsys, *argv)
    assert found["contact_load_share"] == pytest.approx(0.975, abs=0.005)
    assert found["assessment"] == "avoid"
    assert "not lifted off: the wall carries 97 % of the weight" in found["assessment_reasons"]
    assert main(argv) == 0
    assert "Not lifted off: the wall carries 97 % of the weight" in capsys.readouterr().out


def test_a_table_over_the_speeds_and_the_frequencies_given(capsys, tmp_path):
    """Its frequencies are those of --whirl over the highest speed, at each speed."""
    argv = [*TABLE, "--preset", "fed_spindle_layered", *MESH, "--rpm", "15000:20000:2"]
    out = tmp_path / "c.json"
    found = answer(capsys, *argv, "--whirl", "0:2:5", "--out", str(out))
    assert found["axis"] == "speed and frequency" and len(found["rows"]) == 10
    fastest = 20000 * np.pi / 30.0
    for k, speed in enumerate((0.75 * fastest, fastest)):
        rows = found["rows"][5 * k : 5 * k + 5]
        assert [row["speed"] for row in rows] == pytest.approx([speed] * 5)
        frequencies = [row["frequency"] for row in rows]
        assert frequencies == pytest.approx(list(fastest * np.linspace(0.0, 2.0, 5)))
    element = json.loads(out.read_text())["BearingElement_spab"]
    assert np.shape(element["kxx"]) == (2, 5)
    told = " ".join(found["notes"])
    assert "Fewer than 5 speeds: " in told and "whirl frequencies: " not in told


@pytest.mark.parametrize("count", [1, 3])
def test_few_whirl_frequencies_are_told(count, capsys, tmp_path):
    ends = f"0.5:{0.5 if count == 1 else 1}:{count}"
    point = [*TABLE, "--bearing-number", "3", "--whirl", ends, *MESH]
    assert main([*point, "--out", str(tmp_path / "c.csv")]) == 0
    assert "Fewer than 5 whirl frequencies: programs that interpolate" in capsys.readouterr().out


def test_show_judges_by_the_limits_given(capsys):
    argv = ["design", "show", *POINT, "--bearing-number", "3", *MESH]
    assert "limit 9.0 µm" in " ".join(
        answer(capsys, *argv, "--least-film", "9")["assessment_reasons"]
    )
    message = refused(capsys, *argv, "--least-film", "2000")
    assert "least film = 2000 µm is out of range: allowed is from 0 to 1000 µm" in message


def test_show_a_file_and_a_rigid_preset_as_text(capsys, tmp_path):
    path = str(tmp_path / "d.toml")
    save_design(preset("fed_spindle_layered").design, path)
    assert main(["design", "show", "--design", path, *POINT, "--rpm", "20000", *MESH]) == 0
    text = capsys.readouterr().out
    assert "20,000 rpm" in text and "normal litres" in text and "kxx" in text and "decays" in text
    (motion,) = re.findall(r"Motion with unbalance: .*least film ([\d.]+) µm, .* N\n", text)
    assert 1.0 < float(motion) < 25.0
    found = answer(
        capsys, "design", "show", "--preset", "rigid_balanced", *POINT, "--rpm", "15000", *MESH
    )
    assert found["rigid"] is True and found["shaft_stiffness_number"] is None
    assert found["design"]["rotor"]["shaft_stiffness"] == "inf"


def test_coefficients_against_whirl_frequency(capsys, tmp_path):
    out = tmp_path / "c.csv"
    point = [*TABLE, "--bearing-number", "3", "--whirl", "0:2:5", *MESH]
    found = answer(capsys, *point, "--out", str(out))
    rows = pd.read_csv(out)
    assert found["axis"] == "frequency" and b"\r" not in out.read_bytes()
    # its names stay in the first line and its numbers numbers; the units stand in a last column
    assert list(rows)[-1] == "units" and "k: N/m; c: N s/m" in rows["units"][0]
    assert rows["units"][1:].isna().all() and all(rows[name].dtype == float for name in NAMES)
    assert list(rows)[:11] == ["speed", "frequency", *NAMES, "whirl_ratio"]
    expected = coefficients(
        impedance(reference_design(), 4.5, 3.0, Mesh(3, 16)), np.linspace(0, 2, 5)
    )
    for name in NAMES:
        np.testing.assert_allclose(rows[name], expected.column(name))
    speed = reference_design().speed(3.0)
    np.testing.assert_allclose(rows["frequency"], speed * np.linspace(0, 2, 5))
    np.testing.assert_allclose(rows["speed"], speed)
    answer(capsys, *point, "--out", str(tmp_path / "c.json"))
    element = json.loads((tmp_path / "c.json").read_text())["BearingElement_spab"]
    assert "speed" not in element
    np.testing.assert_allclose(element["frequency"], rows["frequency"])
    np.testing.assert_allclose(element["cxy"], rows["cxy"])


def test_coefficients_over_speed_and_frequency(capsys, tmp_path):
    """What is written if nothing else is asked for: a BearingElement of ROSS, and what it is."""
    out = tmp_path / "c.json"
    found = answer(capsys, *TABLE, "--rpm", "8000:12000:5", "--out", str(out), *MESH)
    assert found["axis"] == "speed and frequency"
    content = json.loads(out.read_text())
    element, about = content["BearingElement_spab"], content["spab"]
    assert next(iter(content)) == "BearingElement_spab" and about["notes"] == found["notes"]
    speeds, frequencies = len(element["speed"]), len(element["frequency"])
    assert speeds == 5 and len(found["rows"]) == speeds * frequencies
    assert all(np.shape(element[name]) == (speeds, frequencies) for name in NAMES)
    assert max(element["frequency"]) > 2.0 * max(element["speed"])
    row = found["rows"][frequencies + 7]
    assert (element["speed"][1], element["frequency"][7]) == (row["speed"], row["frequency"])
    assert element["kyx"][1][7] == row["kyx"]
    assert about["rows"]["mode"] == ["film whirl"] * speeds
    assert all(0.3 < ratio < 0.7 for ratio in about["rows"]["mode_whirl_ratio"])
    assert any("F_y = -kyx x" in note for note in found["notes"])
    csv = tmp_path / "c.csv"
    answer(capsys, *TABLE, "--rpm", "8000:12000:5", "--out", str(csv), *MESH)
    assert pd.read_csv(csv).drop(columns="units").to_dict("records") == found["rows"]


def test_coefficients_against_speed_as_a_workbook(capsys, tmp_path):
    out = tmp_path / "c.xlsx"
    argv = [*TABLE, "--rpm", "8000:12000:3", "--out", str(out), *MESH]
    found = answer(capsys, *argv)
    assert (
        found["axis"] == "speed" and found["missing_speeds_rad_s"] == [] and len(found["rows"]) == 3
    )
    assert found["rows"][0]["speed"] == pytest.approx(8000 * np.pi / 30)
    for row in found["rows"]:
        assert row["mode"] == "film whirl" and 0.3 < row["whirl_ratio"] < 0.7
        assert row["whirl_ratio"] == pytest.approx(row["mode_whirl_ratio"])
        decay = -row["growth_rate"] * 2.0 * np.pi / row["frequency"]
        assert row["log_decrement"] == pytest.approx(decay)
    numbers = [[v for v in row.values() if not isinstance(v, str)] for row in found["rows"]]
    with zipfile.ZipFile(out) as file:
        sheet = file.read("xl/worksheets/sheet1.xml").decode()
        words = file.read("xl/sharedStrings.xml").decode()
    values = re.findall(r'<c r="[A-Z]+[2-4]"><v>([^<]*)</v>', sheet)
    np.testing.assert_allclose(np.reshape(values, (3, -1)).astype(float), numbers, rtol=1e-15)
    assert "F_y = -kyx x" in words  # on the second sheet
    before = out.read_bytes()
    assert main(argv) == 0
    printed = capsys.readouterr().out
    assert "over speed" in printed and "film whirl" in printed and "Fewer than 5" in printed
    assert out.read_bytes() == before
    synchronous = answer(capsys, *argv, "--whirl", "1")
    assert [row["whirl_ratio"] for row in synchronous["rows"]] == [1.0, 1.0, 1.0]
    assert "mode" not in synchronous["rows"][0]


def test_the_commands_of_the_readme_follow_one_whirl(capsys, tmp_path):
    """The fed spindle as it comes, its wall storing gas, in a workbook: 26 rows of one mode, a
    natural frequency on the gas spring that hardly moves and is driven by the pores' gas the more
    the faster the shaft. (The rows of the shaft's bending have a whirl ratio of 22 to 3.6.)
    """
    design, out = str(tmp_path / "my.toml"), str(tmp_path / "bearing.xlsx")
    answer(capsys, "design", "new", "--preset", "fed_spindle", "--out", design)
    assert load_design(design).bearing.porosity == 0.15
    argv = ["--design", design, "--rotor-mass", "4", "--rpm", "5000:30000:26", "--out", out]
    rows = pd.DataFrame(answer(capsys, "design", "coefficients", *argv, *MESH)["rows"])
    assert len(rows) == 26 and set(rows["mode"]) == {FILM_MODE}
    assert np.abs(np.diff(rows["frequency"])).max() < 0.01 * rows["frequency"].min()
    assert rows["whirl_ratio"].iloc[0] < 4.0 and rows["whirl_ratio"].iloc[-1] > 0.5
    steps = np.diff(rows["log_decrement"])
    assert (steps < 0.0).all() and steps.min() > 1.5 * steps.max()
    for name in NAMES:
        assert np.abs(np.diff(rows[name], 2)).max() < 0.02 * np.ptp(rows[name])


def test_words_of_a_workbook_change_no_unit_in_ross():
    """ROSS searches the first sheet for these and converts the table."""
    d = reference_design()
    table = coefficient_table(coefficients_over_speed(d, 4.5, [2.0, 3.0], FILM_WHIRL, Mesh(3, 16)))
    words = [*table, *table["mode"], FILM_MODE, SHAFT_MODE]
    assert not [w for w in words if re.search("rpm|lb|inches", w.lower())]


def test_a_rotor_on_its_wall_gets_no_table_without_that_word(capsys, tmp_path):
    argv = ["design", "coefficients", "--rotor-mass", "25", "--rpm", "600:1000:5", *MESH]
    for form, more in ((".csv", []), (".xlsx", ["--whirl", "1"])):
        out = str(tmp_path / f"c{form}")
        assert main([*argv, *more, "--out", out]) == 0
        assert "Not lifted off at 5 of 5 speeds" in capsys.readouterr().out
        found = answer(capsys, *argv, *more, "--out", out)
        assert all(row["contact_load_share"] > 0.9 for row in found["rows"])
        assert any("of the weight" in note for note in found["notes"])


@pytest.mark.parametrize(
    "argv, words",
    [
        (["design"], "spab design: the following arguments are required: COMMAND"),
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
        ([*TABLE, "--rpm", "9000:9100:3", "--whirl", "0:1:3", "--out", "c.xlsx"], "frequency"),
        ([*TABLE, "--rpm", "9000:9100:3", "--whirl=-1:1:3", "--out", "c.csv"], "whirl ratio"),
        ([*TABLE, "--rpm", "9000:9100:400", "--whirl", "0:1:400", "--out", "c.csv"], "rows"),
        (
            [*TABLE, "--rpm", "9000", "--whirl", "0:1:3", "--out", "c.xlsx"],
            "ROSS reads as one over",
        ),
        ([*TABLE, "--rpm", "9000:9100:3", "--whirl", "x", "--out", "c.csv"], "film-whirl"),
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
