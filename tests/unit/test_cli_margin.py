"""``spab margin`` and ``spab export``: keys, files, and one sentence with exit code 2 for every
wrong input.
"""

import io
import json

import numpy as np
import pandas as pd
import pytest
from scipy.io import netcdf_file

from spab_core.cli import margin as cli
from spab_core.cli.main import main
from spab_core.maps.margin import margin
from spab_core.maps.solved_margin import DIRECTIONS, KINDS
from spab_core.maps.stability_map import save_map
from spab_core.shipped.manifest import ARTIFACTS, REFERENCE_MAP, load_reference_map
from tests.commands import answer, refused
from tests.maps import map_of_regimes


@pytest.fixture
def small(tmp_path):
    m = map_of_regimes([1.0, 2.0, 3.0], [1.0, 2.0], [[0, 2], [0, 3], [4, 1]])
    m.metadata.update(mesh="3x16", transient=10, revolutions=10)
    save_map(m, tmp_path / "small.npz")
    return m, str(tmp_path / "small.npz")


POINT = ("--rotor-mass", "4.52", "--bearing-number", "3.45")
SOLVED = ("margin", "--preset", "fed_spindle_layered", "--rotor-mass", "4", "--rpm", "20000")
QUICK = ("--points", "2", "--precision", "0.1")


def test_keys_and_words_of_a_margin_read_off_the_shipped_map(capsys):
    found = answer(capsys, "margin", *POINT, "--map")
    assert found == json.loads(json.dumps(margin(load_reference_map(), 4.52, 3.45).record()))
    assert not found["predicted"]
    for limit in found["limits"]:
        assert limit["low"] < limit["value"] < limit["high"] and not limit["predicted"]
    assert main(["margin", *POINT, "--map"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [found["headline"], *found["sentences"]]


@pytest.mark.slow
def test_a_solved_margin_answers_the_contract(capsys, monkeypatch):
    solve, asked, solved = cli.solve_margin, [], []

    def once(*values, progress, **options):
        """What was solved for the first command is told by the second, which asks for the same."""
        asked.append((values, options))
        if not solved:
            solved.append(solve(*values, progress=progress, **options))
        return solved[0]

    monkeypatch.setattr(cli, "solve_margin", once)
    found = answer(capsys, *SOLVED, *QUICK)
    assert found["assessment"] in ("good", "watch", "avoid")
    assert {
        "assessment_reasons",
        "least_film_m",
        "contact_share",
        "thin_film_share",
        "peak_contact_force_n",
        "regime",
        "here",
        "lines",
        "beside",
    } <= found.keys()
    assert found["speed_rpm"] == pytest.approx(20000.0)
    assert {(line["axis"], line["direction"]) for line in found["lines"]} == {
        (axis, direction) for axis, towards in DIRECTIONS.items() for direction in towards
    }
    at = {"speed": 20000.0, "mass": 4.0}
    assert found["limits"]
    for limit in found["limits"]:
        assert limit["axis"] in at and limit["what"] in KINDS and limit["predicted"] is False
        assert limit["low"] < limit["value"] < limit["high"]
        assert (limit["value"] > at[limit["axis"]]) == (limit["direction"] == "up")
        assert limit["begins"] == (limit["what"] not in found["here"])
    assert main([*SOLVED, *QUICK]) == 0
    told = capsys.readouterr().out
    assert found["headline"] in told and "predicted" not in told.lower()
    assert len(asked) == 2 and asked[0] == asked[1]


def test_a_predicted_map_says_so_and_has_no_plus_minus(capsys, small, tmp_path):
    m, _ = small
    m.revolutions[:] = 0
    save_map(m, tmp_path / "predicted.npz")
    options = ("--rotor-mass", "1.2", "--bearing-number", "2.2")
    found = answer(capsys, "margin", "--map", str(tmp_path / "predicted.npz"), *options)
    assert found["predicted"] and all(limit["predicted"] for limit in found["limits"])
    words = " ".join([found["headline"], *found["sentences"]])
    assert "redicted" in found["headline"] and "±" not in words and "predicted from about" in words


def test_margin_by_speed_of_another_map(capsys, small):
    m, path = small
    found = answer(
        capsys,
        "margin",
        "--map",
        path,
        "--rotor-mass",
        "1.2",
        "--rpm",
        str(m.design.speed_rpm(2.2)),
    )
    assert found["bearing_number"] == pytest.approx(2.2)
    assert (
        found["instability"]["number_above"]["beyond"] == "touchdown"
        and found["instability"]["mass_below"] is None
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("--rotor-mass", "30", "--bearing-number", "3", "--map"),
            "rotor mass in this map = 30 kg is out of range",
        ),
        (("--rotor-mass", "3", "--bearing-number", "nan", "--map"), "bearing number in this map"),
        (("--rotor-mass", "3000", "--bearing-number", "3"), "rotor mass = 3000 kg is out of"),
        (("--rotor-mass", "3", "--bearing-number", "nan"), "bearing number = nan is out of range"),
        (("--rotor-mass", "3", "--rpm", "inf"), "--rpm = inf rpm is out of range"),
        (("--rotor-mass", "3", "--rpm", "-1"), "--rpm = -1 rpm is out of range"),
        (("--rotor-mass", "3"), "one of the arguments --bearing-number --rpm is required"),
        (("--rotor-mass", "3", "--rpm", "9000", "--bearing-number", "3"), "not allowed with"),
        (("--rotor-mass", "3", "--rpm", "9000", "--map", "/no/such.npz"), "cannot read the map"),
        (("--rotor-mass", "3", "--rpm", "9000", "--points", "1"), "points = 1 is out of range"),
        (("--rotor-mass", "3", "--rpm", "9000", "--precision", "0"), "precision = 0 is out of"),
        (("--rotor-mass", "3", "--rpm", "9000", "--workers", "0"), "--workers = 0 is out of"),
        (("--rotor-mass", "3", "--rpm", "9000", "--preset", "no"), "no preset 'no'"),
        (("--rotor-mass", "3", "--rpm", "9000", "--transient", "5"), "transient = 5 revolutions"),
        (
            ("--rotor-mass", "3", "--rpm", "9000", "--preset", "spab60", "--design", "a.toml"),
            "give either --design or --preset",
        ),
        (
            ("--rotor-mass", "3", "--rpm", "9000", "--preset", "spab60", "--map"),
            "give either --map, or --design or --preset",
        ),
    ],
)
def test_margin_refuses(capsys, options, words):
    assert words in refused(capsys, "margin", *options)


def test_export(capsys, small, tmp_path):
    m, path = small
    table, file = tmp_path / "map.csv", tmp_path / "map.nc"
    answer(capsys, "export", path, "--out", str(table))
    found = pd.read_csv(io.BytesIO(table.read_bytes()))
    assert len(found) == m.mle.size and np.allclose(
        found["rotor_mass_kg"], np.tile(m.rotor_mass, 3)
    )
    assert answer(capsys, "export", path, "--out", str(file))["bytes"] == file.stat().st_size
    with netcdf_file(file, mmap=False) as read:
        assert np.array_equal(read.variables["mle"][:], m.mle, equal_nan=True)


@pytest.mark.parametrize(
    ("source", "out", "words"),
    [
        (REFERENCE_MAP, "map.xlsx", "must end in .nc or .csv"),
        (REFERENCE_MAP, "no/folder/map.nc", "cannot be written"),
        ("manifest.json", "map.nc", "cannot read the map"),
    ],
)
def test_export_refuses(capsys, tmp_path, source, out, words):
    assert words in refused(capsys, "export", str(ARTIFACTS / source), "--out", str(tmp_path / out))
    assert not list(tmp_path.iterdir())
