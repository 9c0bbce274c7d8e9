"""The scripts of examples/ run, and the numbers they print are true."""

import csv
import json
import re
import runpy
import sys

import pandas as pd
import pytest

from tests.conftest import ROOT

EXAMPLES = ROOT / "examples"


@pytest.fixture
def printed(monkeypatch, capsys):
    """Run an example as a program; what it prints."""

    def run(name, *arguments):
        path = EXAMPLES / f"{name}.py"
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        runpy.run_path(str(path), run_name="__main__")
        return capsys.readouterr().out

    return run


def test_every_example_is_run_here():
    here = (ROOT / "tests/unit/test_examples.py").read_text("utf-8")
    names = {path.stem for path in EXAMPLES.glob("*.py")}
    assert len(names) == 5 and {name for name in names if f'printed("{name}"' in here} == names


def test_operating_point(printed):
    periodic, chaotic = printed("operating_point").splitlines()
    exponent = re.search(r"exponent ([+-]\d\.\d{3})", periodic)
    # -0.452 ± 0.01 by an independent code (docs/model.md)
    assert "periodic-2" in periodic and abs(float(exponent[1]) + 0.452) < 0.015, periodic
    assert "chaotic" in chaotic


def test_stability_map(printed):
    text = printed("stability_map")
    cells = re.search(r"periodic in both: (\d+), largest difference of exponents (\S+)", text)
    assert int(cells[1]) >= 10 and float(cells[2]) < 1e-3, text


def test_bifurcation_line(printed):
    text = printed("bifurcation_line")
    rows = [line.split() for line in text.splitlines() if re.match(r" +\d+\.\d", line)]
    assert len(rows) == 12 and "chaotic from" in text
    before = rows[: [row[1] for row in rows].index("chaotic")]
    cascade = [int(row[2]) for row in before if row[1] == "periodic"]
    # each doubled from the one before, in order (Feigenbaum)
    assert cascade == sorted(cascade) and {2, 4, 8} <= set(cascade) <= {2, 4, 8, 16}, text


@pytest.mark.slow
def test_bearing_for_ross(printed, tmp_path):
    text = printed("bearing_for_ross", tmp_path)
    # the mass is that of the eigenvalues of the whole system, which know no coefficients, at 30,000
    grows = int(re.search(r"it grows from (\d+) rpm", text)[1])
    assert abs(grows / 30_000 - 1) < 0.01, text
    table = pd.read_csv(tmp_path / "bearing.csv")
    assert list(table)[:4] == ["speed", "frequency", "kxx", "kxy"]
    element = json.loads((tmp_path / "bearing.json").read_text())["BearingElement_spab"]
    assert len(element["speed"]) == 5 and len(table) == 5 * len(element["frequency"])


def test_surrogate_model(printed):
    """The shipped scores, to their digits."""
    text = printed("surrogate_model")
    with (ROOT / "artifacts/surrogate_scores.csv").open(encoding="utf-8") as file:
        scores = {
            row["model"]: row
            for row in csv.DictReader(file)
            if (row["divisor"], row["seed"]) == ("8", "0")
        }
    rows = [line.split() for line in text.splitlines()[1:-1]]
    assert [row[0] for row in rows] == ["theory-trees", "tree", "linear", "nearest"]
    for name, _, rmse, mae, _ in rows:
        for told, kept in ((rmse, "rmse_held_out"), (mae, "mae_held_out")):
            expected = float(scores[name][kept])
            assert abs(float(told) - expected) < 2e-5, (name, text)
