"""``spab evaluate`` and ``spab predict``: keys, files, and one sentence for bad input."""

import csv
import json

import numpy as np
import pytest

from spab_core.cli import main
from spab_core.stability_map import save_map
from tests.unit.test_surrogates import map_of


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "m.npz"
    save_map(map_of(lambda number, mass: 0.2 * number - 0.05 * mass), path)
    return str(path)


def test_evaluate_writes_a_row_for_each_training(capsys, tmp_path, map_file):
    out = tmp_path / "scores.csv"
    argv = ["evaluate", "--map", map_file, "--models", "tree,linear", "--divisors", "2,4", "--seeds", "3"]
    assert main([*argv, "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(answer["scores"]) == 12 and "Linear interpolation" in answer["suggestion"]
    assert float(rows[0]["rmse_held_out"]) == pytest.approx(answer["scores"][0]["rmse_held_out"], rel=1e-13)
    assert main(argv) == 0
    text = capsys.readouterr().out
    assert "n/4" in text and "Max - Min" in text


def test_predict_a_point_and_the_whole_map(capsys, tmp_path, map_file):
    out = tmp_path / "p.npz"
    argv = ["predict", "--map", map_file, "--model", "cubic", "--bearing-number", "4.1", "--rotor-mass", "11"]
    assert main([*argv, "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["mle_per_revolution"] == pytest.approx(0.2 * 4.1 - 0.05 * 11.0, abs=0.05) and answer["inside_map"]
    with np.load(out) as data:
        assert data["mle"].shape == data["trained"].shape == (14, 18) and data["trained"].sum() == 126
    assert main([*argv[:6], "50", *argv[7:]]) == 0  # outside: answered, and said
    assert "outside the map" in capsys.readouterr().err


@pytest.mark.parametrize("argv, words", [
    (["evaluate", "--models", "oracle"], ["model", "oracle", "forest"]),
    (["evaluate", "--divisors", "2,x"], ["--divisors", "2,x", "whole numbers"]),
    (["evaluate", "--divisors", "1"], ["--divisors", "1", "from 2"]),
    (["evaluate", "--divisors", "64"], ["1/64", "at least 8 cells"]),
    (["evaluate", "--seeds", "0"], ["--seeds", "0", "from 1"]),
    (["evaluate", "--map", "/nowhere.npz"], ["/nowhere.npz"]),
    (["evaluate", "--out", "/nowhere/x.csv"], ["--out", "/nowhere"]),
    (["predict", "--model", "tree"], ["nothing to predict"]),
    (["predict", "--model", "tree", "--rotor-mass", "3"], ["belong together"]),
    (["predict", "--model", "tree", "--rotor-mass", "-3", "--bearing-number", "2"], ["rotor mass", "-3"]),
    (["predict", "--model", "tree", "--rotor-mass", "nan", "--bearing-number", "2"], ["rotor mass", "nan"]),
    (["predict", "--model", "tree", "--rotor-mass", "3", "--bearing-number", "2", "--divisor", "0"], ["--divisor", "0"]),
    (["predict", "--model", "tree", "--rotor-mass", "3", "--bearing-number", "2", "--seed", "-1"], ["--seed", "-1"]),
])
def test_wrong_input_is_one_sentence(capsys, map_file, argv, words):
    full = argv if "--map" in argv else [*argv, "--map", map_file]
    assert main(full) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert all(word in lines[-1] for word in words), lines[-1]
    assert "Traceback" not in "".join(lines)
