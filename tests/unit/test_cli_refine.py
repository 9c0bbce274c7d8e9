"""``spab refine``: a study on a map and live cells; keys, files, going on after a stop, one
sentence for bad input.
"""

import json
import sys
import types

import numpy as np
import pytest

from spab_core import save_design
from spab_core.active_learning.refine import load_refinement
from spab_core.cli import refine as cli_refine
from spab_core.cli.main import main
from spab_core.linear_theory import linear_table as features
from spab_core.maps.stability_map import load_map, save_map
from tests.maps import map_of, with_hole

LIVE = [
    "refine",
    "--bearing-number",
    "2:4:5",
    "--rotor-mass",
    "3:9:6",
    "--mesh",
    "6x24",
    "--transient",
    "30",
    "--revolutions",
    "30",
    "--budget",
    "20",
]


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "m.npz"
    save_map(with_hole(map_of(lambda number, mass: 0.2 * number - 0.05 * mass)), path)
    return str(path)


@pytest.mark.slow
def test_a_study_tells_its_errors(capsys, tmp_path, map_file):
    out = str(tmp_path / "r.npz")
    argv = ["refine", "--map", map_file, "--budget", "100", "--out", out]
    assert main([*argv, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (
        answer["solved"] == 100
        and answer["cells"] == 252
        and sum(answer["predicted_regimes"].values()) == 252
    )
    assert len(answer["suggested"]) == 24 and answer["suggested"][0]["in_doubt"] == "exponent"
    result = load_refinement(out)
    assert result.solved.sum() == 100 and result.metadata["study"] is True
    m, held_out = load_map(map_file), ~result.solved
    error = (result.mle - m.mle)[held_out & np.isfinite(m.mle)]
    assert (
        answer["rmse_held_out"] == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-4)
        and error.any()
    )
    assert answer["accuracy_held_out"] == pytest.approx(
        (result.regime == m.regime)[held_out].mean()
    )
    assert 0.9 < answer["chaos_f1_held_out"] <= 1.0
    assert main(argv) == 0
    text = capsys.readouterr().out
    assert "F1 of chaos" in text and text.count("solve next: bearing number") == 5
    assert (
        main([*argv[:4], "252", *argv[5:], "--json"]) == 0
    )  # the whole map: nothing held out, nothing left
    answer = json.loads(capsys.readouterr().out)
    assert (
        answer["rmse_held_out"] is None
        and answer["suggested"] == []
        and answer["without_exponent"] == 1
    )


@pytest.mark.slow
def test_live_cells_and_a_run_that_is_stopped(capsys, tmp_path, monkeypatch):
    whole, stopped = tmp_path / "whole.npz", tmp_path / "stopped.npz"
    assert main([*LIVE, "--out", str(whole), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["solved"] == 20 and not (tmp_path / "whole.npz.parts").exists()

    real = cli_refine.refine

    def interrupted(*arguments, **options):
        yield next(real(*arguments, **options))
        raise KeyboardInterrupt

    monkeypatch.setattr(cli_refine, "refine", interrupted)
    with pytest.raises(SystemExit) as stop:
        main([*LIVE, "--out", str(stopped)])
    assert stop.value.code == 130 and "the same command goes on" in capsys.readouterr().err
    assert list((tmp_path / "stopped.npz.parts").glob("chunk-*.npz")) and not stopped.exists()
    monkeypatch.setattr(cli_refine, "refine", real)
    assert main([*LIVE, "--seed", "1", "--out", str(stopped)]) == 2  # another seed is another run
    assert "refine_seed" in capsys.readouterr().err
    assert main([*LIVE, "--out", str(stopped), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) | {"out": ""} == answer | {"out": ""}
    first, second = load_refinement(whole), load_refinement(stopped)
    assert np.array_equal(first.batch, second.batch)
    assert np.array_equal(first.values["mle"], second.values["mle"], equal_nan=True)


@pytest.mark.parametrize(
    "argv, words",
    [
        (["--budget", "15"], ["budget", "15", "16"]),
        (["--budget", "31"], ["budget", "31", "30"]),
        (["--seed", "-1"], ["seed", "-1"]),
        (["--workers", "0"], ["--workers", "0"]),
        (["--bearing-number", "2:4"], ["--bearing-number", "start:stop:count"]),
        (["--rotor-mass", "0:9:6"], ["rotor mass", "0"]),
        (["--rotor-mass", "3:9:1"], ["5 cells", "16"]),
        (["--mesh", "1x1"], ["mesh"]),
        (["--revolutions", "1"], ["revolutions", "1"]),
        (["--design", "/nowhere.toml"], ["/nowhere.toml"]),
        (["--out", "/nowhere/r.npz"], ["--out", "/nowhere"]),
        (
            ["--map", "/nowhere.npz"],
            ["--bearing-number", "--rotor-mass", "--mesh", "not allowed with --map"],
        ),
    ],
)
def test_wrong_input_is_one_sentence(capsys, tmp_path, argv, words):
    assert main([*LIVE, "--out", str(tmp_path / "r.npz"), *argv]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert all(word in lines[-1] for word in words), lines[-1]
    assert "Traceback" not in "".join(lines) and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "argv, words",
    [
        (["--budget", "20"], ["plane is missing", "--map"]),
        (["--budget", "20", "--bearing-number", "2:4:5"], ["plane is missing"]),
        (["--budget", "20", "--map", "/nowhere.npz"], ["/nowhere.npz"]),
        (["--budget", "9", "--map", "MAP"], ["budget", "9"]),
        (["--budget", "400", "--map", "MAP"], ["budget", "252"]),
        (
            ["--budget", "20", "--map", "MAP", "--dask", "tcp://127.0.0.1:9"],
            ["--dask", "not allowed with --map"],
        ),
        (
            ["--budget", "20", "--map", "MAP", "--tolerance", "1e-3"],
            ["--tolerance", "not allowed with --map"],
        ),
    ],
)
def test_wrong_studies_are_one_sentence(capsys, tmp_path, map_file, argv, words):
    assert (
        main(
            [
                "refine",
                *(map_file if a == "MAP" else a for a in argv),
                "--out",
                str(tmp_path / "r.npz"),
            ]
        )
        == 2
    )
    lines = capsys.readouterr().err.strip().splitlines()
    assert all(word in lines[-1] for word in words), lines[-1]
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_bearing_of_ones_own_says_that_linear_theory_comes_first(
    capsys, tmp_path, monkeypatch, design
):
    made = features.linear_table  # on fewer nodes, to be quick
    monkeypatch.setattr(features, "linear_table", lambda own, plane: made(own, plane, (4, 4)))
    save_design(design.replace(rotor__gravity=9.0), tmp_path / "own.toml")
    assert (
        main([*LIVE, "--out", str(tmp_path / "own.npz"), "--design", str(tmp_path / "own.toml")])
        == 0
    )
    assert "linear stability of this bearing" in capsys.readouterr().err
    features.table_for.cache_clear()
    assert main([*LIVE, "--out", str(tmp_path / "shipped.npz")]) == 0
    assert "linear stability" not in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_solves_the_same_cells(capsys, tmp_path, monkeypatch):
    """A real Dask cluster of one worker process."""
    monkeypatch.setitem(
        sys.modules, "__main__", types.ModuleType("__main__")
    )  # new processes would run this one's again
    distributed = pytest.importorskip(
        "distributed", reason="the extra spab-core[dask] is not installed"
    )
    assert main([*LIVE, "--out", str(tmp_path / "here.npz")]) == 0
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        assert (
            main([*LIVE, "--out", str(tmp_path / "there.npz"), "--dask", cluster.scheduler_address])
            == 0
        )
    here, there = load_refinement(tmp_path / "here.npz"), load_refinement(tmp_path / "there.npz")
    assert np.array_equal(here.batch, there.batch) and np.array_equal(here.mle, there.mle)
    monkeypatch.setattr("spab_core.maps.parallel.CLUSTER_SECONDS", 1)
    capsys.readouterr()
    assert main([*LIVE, "--out", str(tmp_path / "nowhere.npz"), "--dask", "tcp://127.0.0.1:9"]) == 2
    error = capsys.readouterr().err
    assert "--dask" in error.splitlines()[-1] and "Traceback" not in error
