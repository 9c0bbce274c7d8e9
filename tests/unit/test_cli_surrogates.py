"""``spab evaluate`` and ``spab predict``: keys, files, and one sentence for bad input."""

import csv
import json

import numpy as np
import pytest

from spab_core.cli.main import main
from spab_core.maps.stability_map import save_map
from tests.maps import map_of


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "m.npz"
    save_map(map_of(lambda number, mass: 0.2 * number - 0.05 * mass), path)
    return str(path)


@pytest.mark.slow
def test_evaluate_writes_a_row_for_each_training(capsys, tmp_path, map_file):
    out = tmp_path / "scores.csv"
    argv = [
        "evaluate",
        "--map",
        map_file,
        "--models",
        "tree,linear",
        "--divisors",
        "2,4",
        "--seeds",
        "3",
    ]
    assert main([*argv, "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert (
        len(rows) == len(answer["scores"]) == 12 and "Linear interpolation" in answer["suggestion"]
    )
    assert float(rows[0]["rmse_held_out"]) == pytest.approx(
        answer["scores"][0]["rmse_held_out"], rel=1e-13
    )
    assert main(argv) == 0
    text = capsys.readouterr().out
    assert "n/4" in text and "Max - Min" in text


@pytest.mark.slow
def test_predict_a_point_and_the_whole_map(capsys, tmp_path, map_file):
    out = tmp_path / "p.npz"
    argv = [
        "predict",
        "--map",
        map_file,
        "--model",
        "cubic",
        "--bearing-number",
        "4.1",
        "--rotor-mass",
        "11",
    ]
    assert main([*argv, "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (
        answer["mle_per_revolution"] == pytest.approx(0.2 * 4.1 - 0.05 * 11.0, abs=0.05)
        and answer["inside_map"]
    )
    with np.load(out) as data:
        assert (
            data["mle"].shape == data["trained"].shape == (14, 18) and data["trained"].sum() == 126
        )
    assert main([*argv[:6], "50", *argv[7:]]) == 0  # outside: answered, and said
    assert "outside the map" in capsys.readouterr().err


@pytest.mark.slow
def test_predict_says_how_sure_it_is(capsys, tmp_path, map_file):
    argv = ["predict", "--model", "theory-trees", "--bearing-number", "4.1", "--rotor-mass", "11"]
    assert main([*argv, "--map", map_file, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    low, high = answer["interval_90"]
    assert low < high and high - low < 2.0 and low - 0.5 < answer["mle_per_revolution"] < high + 0.5
    assert (
        answer["regime"] == "chaotic" and 0.5 < answer["probability_unstable"] <= 1.0
    )  # the exponent is 0.27 there
    assert main([*argv, "--map", map_file]) == 0
    text = capsys.readouterr().out
    assert "90% interval" in text and "chaotic, by the classifier" in text and "instability" in text
    small = tmp_path / "small.npz"
    save_map(map_of(lambda number, mass: 0.2 * number - 0.05 * mass, 8, 8), small)
    assert (
        main([*argv, "--map", str(small), "--json"]) == 0
    )  # 32 training cells: no interval, and said
    found = capsys.readouterr()
    assert "too few" in found.err and json.loads(found.out)["interval_90"] is None


@pytest.mark.slow
def test_evaluate_regimes_and_intervals_and_blocks(capsys, tmp_path, map_file):
    out = tmp_path / "u.csv"
    argv = ["evaluate", "--map", map_file, "--divisors", "2", "--seeds", "2"]
    assert main([*argv, "--uncertainty", "--models", "tree", "--out", str(out), "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)["scores"]
    assert len(scores) == 2 and scores[0]["coverage_quasi-periodic"] is None  # this map has none
    assert all(0.5 < s["coverage"] <= 1.0 and 0.8 < s["classifier_accuracy"] <= 1.0 for s in scores)
    assert main([*argv, "--uncertainty", "--models", "tree"]) == 0
    text = capsys.readouterr().out
    assert text.index("Regimes by the classifier") < text.index("classifier_accuracy")
    with out.open() as file:
        assert float(next(csv.DictReader(file))["coverage"]) == pytest.approx(scores[0]["coverage"])
    assert main([*argv, "--assessment", "--out", str(out), "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)["scores"]
    assert [(s["model"], s["seed"]) for s in scores] == [("assessment", 0), ("assessment", 1)]
    assert all(0.8 < s["accuracy"] <= 1.0 for s in scores)
    assert main([*argv, "--classifiers", "--split", "blocks", "--json"]) == 0
    both = json.loads(capsys.readouterr().out)["scores"]
    assert [s["model"] for s in both] == ["regime"] * 2 + ["assessment"] * 2
    assert all(s["recall_undecided"] is None and 0 <= s["unsafe"] <= s["called_best"] for s in both)
    assert main([*argv, "--classifiers"]) == 0
    text = capsys.readouterr().out
    assert "Assessment by its classifier" in text and "recall_good" in text
    assert (
        main([*argv, "--models", "nearest,tree", "--split", "blocks"]) == 0
    )  # one fraction: no spread to rank by
    text = capsys.readouterr().out
    assert (
        "RMSE per revolution, withheld rectangles" in text
        and "F1 of chaos" in text
        and "Best by RMSE" in text
    )


@pytest.mark.parametrize(
    "argv, words",
    [
        (["evaluate", "--split", "diagonal"], ["--split", "diagonal", "random, blocks"]),
        (["evaluate", "--split", "blocks", "--divisors", "64"], ["1/64", "at least 8 cells"]),
        (["evaluate", "--uncertainty", "--divisors", "8"], ["31 training cells", "at least 80"]),
        (["evaluate", "--assessment", "--models", "tree"], ["--models", "not allowed"]),
        (["evaluate", "--assessment", "--uncertainty"], ["--uncertainty", "--assessment"]),
        (["evaluate", "--models", "oracle"], ["model", "oracle", "forest"]),
        (["evaluate", "--divisors", "2,x"], ["--divisors", "2,x", "whole numbers"]),
        (["evaluate", "--divisors", "1"], ["--divisors", "1", "from 2"]),
        (["evaluate", "--divisors", "64"], ["1/64", "at least 8 cells"]),
        (["evaluate", "--seeds", "0"], ["--seeds", "0", "from 1"]),
        (["evaluate", "--map", "/nowhere.npz"], ["/nowhere.npz"]),
        (["evaluate", "--out", "/nowhere/x.csv"], ["--out", "/nowhere"]),
        (["predict", "--model", "tree"], ["nothing to predict"]),
        (["predict", "--model", "tree", "--rotor-mass", "3"], ["belong together"]),
        (
            ["predict", "--model", "tree", "--rotor-mass", "-3", "--bearing-number", "2"],
            ["rotor mass", "-3"],
        ),
        (
            ["predict", "--model", "tree", "--rotor-mass", "nan", "--bearing-number", "2"],
            ["rotor mass", "nan"],
        ),
        (
            [
                "predict",
                "--model",
                "tree",
                "--rotor-mass",
                "3",
                "--bearing-number",
                "2",
                "--divisor",
                "0",
            ],
            ["--divisor", "0"],
        ),
        (
            [
                "predict",
                "--model",
                "tree",
                "--rotor-mass",
                "3",
                "--bearing-number",
                "2",
                "--seed",
                "-1",
            ],
            ["--seed", "-1"],
        ),
    ],
)
def test_wrong_input_is_one_sentence(capsys, map_file, argv, words):
    full = argv if "--map" in argv else [*argv, "--map", map_file]
    assert main(full) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert all(word in lines[-1] for word in words), lines[-1]
    assert "Traceback" not in "".join(lines)
