"""``spab train`` and ``spab verify``: what is shipped is rebuilt to the bit, and every spoilt file
is told.
"""

import dataclasses
import json
import os
import shutil
import subprocess
import sys

import joblib
import numpy as np
import pytest

from spab_core.cli import surrogates as cli_surrogates
from spab_core.cli.main import main
from spab_core.maps.stability_map import FIELDS, save_map
from spab_core.shipped import build as release
from spab_core.shipped import verify as verifier
from spab_core.shipped.build import MAX_FOLDER_BYTES, _choose, rebuild
from spab_core.shipped.manifest import (
    ARTIFACTS,
    CLASSIFIERS,
    PREDICTIONS,
    REFERENCE_MAP,
    SCORES,
    ArtifactError,
    load_reference_map,
    load_reference_scores,
    sha256,
    write_manifest,
)
from spab_core.shipped.model_files import predictions
from spab_core.shipped.provenance import difference
from spab_core.shipped.verify import verify
from spab_core.surrogates.models import DIVISORS, MODELS, Surrogate
from tests.conftest import ROOT
from tests.maps import map_of

ALL_TABLES = dict(release.TABLES)


@pytest.fixture(scope="module", autouse=True)
def some_models(one_table):
    """A model of each group; the others are trained alike."""
    with pytest.MonkeyPatch.context() as patch:
        for name in set(MODELS) - {"mlp", "svr", "tree", "forest", "linear", "theory-trees"}:
            patch.delitem(MODELS, name)
        yield


@pytest.fixture(scope="module")
def small():
    """Some cells of the shipped map, one without an exponent."""
    m = load_reference_map()
    rows, columns = (slice(None, None, max(n // 12, 1)) for n in m.shape)
    cells = {name: getattr(m, name)[rows, columns].copy() for name in FIELDS}
    cells["mle"][2, 3], cells["regime"][2, 3], cells["status"][2, 3] = np.nan, "", "touchdown"
    return dataclasses.replace(
        m, bearing_number=m.bearing_number[rows], rotor_mass=m.rotor_mass[columns], **cells
    )


@pytest.fixture(scope="module")
def map_file(tmp_path_factory, small):
    path = tmp_path_factory.mktemp("map") / "m.npz"
    save_map(small, path)
    return path


@pytest.fixture(scope="module")
def built(tmp_path_factory, map_file):
    """A folder as `spab train --all` leaves it."""
    folder = tmp_path_factory.mktemp("built")
    assert (
        main(["train", "--all", "--map", str(map_file), "--folder", str(folder), "--seeds", "1"])
        == 0
    )
    return folder


@pytest.fixture
def folder(tmp_path, built):
    return shutil.copytree(built, tmp_path / "copy")


@pytest.mark.slow
def test_rebuilding_gives_the_same_bytes(tmp_path, map_file):
    """On one process and on two, with other string hashes and threads; in new interpreters, as the
    command does it: a pickle's bytes also tell which equal objects are one, and that another model
    was opened before."""
    names, sums = ("tree", "svr", "mlp", "forest", "boosting", "linear"), []
    code = (
        "import sys; from pathlib import Path; from spab_core.shipped import build as release\n"
        "from spab_core.shipped.build import rebuild\n"
        "kept = {release.SCORES, release.CLASSIFIERS}\n"
        "[release.TABLES.pop(k) for k in set(release.TABLES) - kept]\n"
        "from spab_core.maps.stability_map import load_map; from spab_core.surrogates.models "
        "import MODELS\n"
        f"rebuild(load_map(sys.argv[1]), Path(sys.argv[2]), models=[MODELS[k] for k in {names}], "
        "divisors=(4,), "
        "seeds=(0, 1), workers=int(sys.argv[3]))"
    )
    for k in range(2):
        target = tmp_path / str(k)
        target.mkdir()
        shutil.copy(map_file, target / REFERENCE_MAP)
        subprocess.run(
            [sys.executable, "-c", code, map_file, target, str(k + 1)],
            check=True,
            cwd=ROOT,
            timeout=300,
            env=os.environ | {"PYTHONHASHSEED": str(7 * k), "OMP_NUM_THREADS": str(k + 1)},
        )
        sums.append({path.name: sha256(path) for path in target.iterdir()})
    assert sums[0] == sums[1] and {
        SCORES,
        CLASSIFIERS,
        PREDICTIONS,
        "manifest.json",
        "surrogate_mlp_n4.joblib",
    } <= set(sums[0])
    for name in (SCORES, CLASSIFIERS):
        assert "seconds" not in (tmp_path / "0" / name).read_text().splitlines()[0]


@pytest.mark.slow
def test_what_train_all_wrote_is_verified(capsys, built):
    assert main(["verify", "--folder", str(built), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["passed"] and all(check["problem"] is None for check in answer["checks"])
    said = " ".join(check["check"] for check in answer["checks"])
    assert all(
        f"surrogate_{name}_n{k}.joblib" in said for name in ("tree", "svr", "mlp") for k in DIVISORS
    )
    with np.load(built / PREDICTIONS) as data:
        assert set(MODELS) < set(data) and {data[name].dtype for name in MODELS} == {
            np.dtype(np.float32)
        }


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def edit(path, change):
    manifest = json.loads(path.read_text())
    change(manifest["files"])
    path.write_text(json.dumps(manifest))


def other_model(folder):
    """A model that is named and noted well, but predicts something else."""
    path = folder / "surrogate_tree_n2.joblib"
    estimator = joblib.load(path)
    estimator.regressor_[-1].tree_.value[:] += 0.01
    joblib.dump(estimator, path, compress=("xz", 6))
    noted = json.loads((folder / "manifest.json").read_text())["files"][path.name]["made_from"]
    changed = Surrogate(MODELS["tree"], estimator, 0, noted["training_cells"], 0.0, None)
    noted |= predictions(load_reference_map(folder), changed)
    write_manifest(folder, {path.name: noted})


def other_scores(folder):
    lines = (folder / SCORES).read_text().splitlines()
    noted = json.loads((folder / "manifest.json").read_text())["files"][SCORES]["made_from"]
    (folder / SCORES).write_text("\n".join(lines[:3] + lines[4:]))
    write_manifest(folder, {SCORES: noted})


@pytest.mark.parametrize(
    "spoil, name, words",
    [
        (lambda f: flip(f / SCORES), SCORES, "SHA-256"),
        (lambda f: flip(f / PREDICTIONS), PREDICTIONS, "SHA-256"),
        (lambda f: flip(f / "surrogate_svr_n3.joblib"), "surrogate_svr_n3.joblib", "SHA-256"),
        (
            lambda f: (f / "surrogate_mlp_n3.joblib").unlink(),
            "surrogate_mlp_n3.joblib",
            "cannot read",
        ),
        (lambda f: (f / "more.joblib").write_bytes(b"x"), "named", "more.joblib"),
        (lambda f: (f / "manifest.json").write_text("[]"), "manifest", "no manifest"),
        (
            lambda f: edit(
                f / "manifest.json",
                lambda files: files["surrogate_tree_n5.joblib"]["made_from"]["versions"].update(
                    {"scikit-learn": "1.0"}
                ),
            ),
            "surrogate_tree_n5.joblib",
            "scikit-learn 1.0",
        ),
        (
            lambda f: edit(
                f / "manifest.json", lambda files: files[SCORES]["made_from"].update(map="0")
            ),
            SCORES,
            "another map",
        ),
        (other_model, "surrogate_tree_n2.joblib", "from the shipped map"),
        (other_scores, SCORES, "missing"),
        (lambda f: (flip(f / REFERENCE_MAP), write_manifest(f)), REFERENCE_MAP, "map"),
    ],
)
def test_whatever_is_spoilt_is_told_in_its_line(capsys, folder, spoil, name, words):
    spoil(folder)
    assert main(["verify", "--folder", str(folder)]) == 1
    wrong = [line for line in capsys.readouterr().out.splitlines() if line.startswith("WRONG")]
    assert any(name in line and words in line for line in wrong), wrong


def test_a_file_without_origin_is_never_opened(folder, tmp_path, capsys):
    class Bomb:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "opened"),)

    joblib.dump(Bomb(), folder / "surrogate_tree_n2.joblib")
    write_manifest(folder)  # as `make manifest` would
    assert main(["verify", "--folder", str(folder)]) == 1
    assert "never opened" in capsys.readouterr().out and not (tmp_path / "opened").exists()


def test_another_design_is_told(tmp_path):
    m = map_of(lambda number, mass: 0.2 * number - 0.05 * mass)
    metadata = m.metadata | {"design": m.design.replace(bearing__clearance=30e-6).to_dict()}
    save_map(dataclasses.replace(m, metadata=metadata), tmp_path / REFERENCE_MAP)
    write_manifest(tmp_path)
    assert any("another design" in check.problem for check in verify(tmp_path))


@pytest.mark.slow
def test_the_shipped_folder_is_verified():
    """In an interpreter of its own, which knows all models."""
    done = subprocess.run(
        [sys.executable, "-m", "spab_core.cli.main", "verify"],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_folder_with_another_map_is_left_alone(capsys, folder):
    before = {path.name: sha256(path) for path in folder.iterdir()}
    save_map(map_of(lambda number, mass: number - mass), folder.parent / "other.npz")
    assert (
        main(["train", "--all", "--map", str(folder.parent / "other.npz"), "--folder", str(folder)])
        == 2
    )
    assert "another map" in capsys.readouterr().err
    assert before == {path.name: sha256(path) for path in folder.iterdir()}


def test_some_tables_are_made_alone(capsys, folder, monkeypatch):
    """The classifiers' are complete and named; every other file keeps its bytes."""
    monkeypatch.setitem(release.TABLES, CLASSIFIERS, ALL_TABLES[CLASSIFIERS])
    before = {path.name: sha256(path) for path in folder.glob("*.*")}
    argv = ["train", "--tables", CLASSIFIERS, "--folder", str(folder), "--seeds", "1", "--json"]
    assert main(argv) == 0
    assert list(json.loads(capsys.readouterr().out)["files"]) == [CLASSIFIERS]
    after = {path.name: sha256(path) for path in folder.glob("*.*")}
    assert {name for name in after if before.get(name) != after[name]} == {
        CLASSIFIERS,
        "manifest.json",
    }
    scores = load_reference_scores(folder, CLASSIFIERS)
    assert len(scores) == 2 * len(DIVISORS) and set(scores["model"]) == {"regime", "assessment"}
    verifier._check_classifiers(CLASSIFIERS, folder)
    text = (folder / CLASSIFIERS).read_text()
    for spoilt, words in (
        (text.rsplit("assessment,8", 1)[0], "n/8 is missing"),
        (scores.assign(unsafe=scores["called_best"]).to_csv(index=False), "unsafe over"),
    ):
        noted = json.loads((folder / "manifest.json").read_text())["files"][CLASSIFIERS]
        (folder / CLASSIFIERS).write_text(spoilt)
        write_manifest(folder, {CLASSIFIERS: noted["made_from"]})
        with pytest.raises(ArtifactError, match=words):
            verifier._check_classifiers(CLASSIFIERS, folder)
    noted = json.loads((folder / "manifest.json").read_text())["files"][CLASSIFIERS]["made_from"]
    now = release.table_source(load_reference_map(folder), CLASSIFIERS)
    assert difference(noted, now) is None
    assert "assessed otherwise" in str(difference(noted | {"assessments": "0"}, now))


def test_models_that_no_longer_belong_are_removed(folder, small):
    rebuild(small, folder, models=[MODELS["tree"]], divisors=(2,), seeds=(0,))
    assert [p.name for p in folder.glob("*.joblib")] == ["surrogate_tree_n2.joblib"]


def test_the_smallest_kinds_are_shipped_as_long_as_there_is_room(monkeypatch):
    monkeypatch.setattr(release, "MAX_MODEL_BYTES", 100)
    monkeypatch.setattr(release, "ALWAYS", (("huge", 3),))
    files = {
        ("big", 2): b"x" * 90,
        ("big", 3): b"x" * 80,
        ("small", 2): b"x" * 10,
        ("small", 3): b"x",
        ("none", 2): None,
        ("huge", 2): b"x" * 101,
        ("huge", 3): b"x" * 300,
    }
    assert list(_choose(files, 1000)) == [
        ("huge", 3),
        ("small", 2),
        ("small", 3),
        ("big", 2),
        ("big", 3),
    ]
    assert list(_choose(files, 395)) == [("huge", 3), ("small", 2), ("small", 3), ("big", 3)]
    assert sum(p.stat().st_size for p in ARTIFACTS.iterdir()) <= MAX_FOLDER_BYTES


def test_train_one_model_into_the_cache_and_into_a_file(capsys, tmp_path, map_file, monkeypatch):
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "cache"))
    argv = ["train", "--model", "tree", "--divisor", "4", "--map", str(map_file)]
    assert main([*argv, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["out"].startswith(str(tmp_path / "cache")) and answer["rmse_held_out"] > 0.0
    predict = ["predict", *argv[1:], "--bearing-number", "4", "--rotor-mass", "9", "--json"]
    assert main(predict) == 0
    assert json.loads(capsys.readouterr().out)["origin"] == "kept"
    out = tmp_path / "tree.joblib"
    assert main([*argv, "--seed", "3", "--out", str(out)]) == 0
    side = json.loads((tmp_path / "tree.joblib.json").read_text())
    assert side["sha256"] == sha256(out) and side["made_from"]["seed"] == 3
    assert "held-out RMSE" in capsys.readouterr().out


def test_predict_takes_the_shipped_model_or_says_why_not(capsys, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cli_surrogates, "ARTIFACTS", folder)
    argv, answers = (
        [
            "predict",
            "--model",
            "tree",
            "--divisor",
            "4",
            "--bearing-number",
            "4",
            "--rotor-mass",
            "9",
            "--json",
        ],
        [],
    )
    for origin in ("shipped", "trained", "kept"):
        assert main(argv) == 0
        out = capsys.readouterr()
        answers.append(json.loads(out.out))
        assert answers[-1]["origin"] == origin
        assert ("SHA-256" in out.err) == (origin == "trained")  # told once in a process
        (folder / "surrogate_tree_n4.joblib").write_bytes(b"damaged")
    assert len({answer["mle_per_revolution"] for answer in answers}) == 1


def test_train_without_a_place_to_keep_it(capsys, map_file, monkeypatch):
    monkeypatch.setenv("SPAB_CACHE", "/dev/null/x")
    assert main(["train", "--model", "tree", "--divisor", "2", "--map", str(map_file)]) == 2
    assert "--out" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    "argv, words",
    [
        (["train"], ["--model", "--all"]),
        (["train", "--all", "--model", "tree"], ["--model", "--all"]),
        (["train", "--model", "oracle", "--divisor", "2"], ["oracle", "forest"]),
        (["train", "--model", "tree"], ["--divisor"]),
        (["train", "--model", "tree", "--divisor", "0"], ["--divisor", "0"]),
        (["train", "--model", "tree", "--divisor", "100"], ["1/100", "cells"]),
        (["train", "--model", "tree", "--divisor", "2", "--seed", "-1"], ["--seed", "-1"]),
        (["train", "--model", "tree", "--divisor", "2", "--seeds", "3"], ["--seeds", "--all"]),
        (
            ["train", "--model", "tree", "--divisor", "2", "--out", "/nowhere/x.joblib"],
            ["--out", "/nowhere"],
        ),
        (["train", "--all", "--divisor", "2"], ["--divisor", "--model"]),
        (["train", "--all", "--tables", SCORES], ["--tables", "--all"]),
        (["train", "--tables", f"{SCORES},x"], ["--tables", "x", SCORES]),
        (["train", "--tables", SCORES], ["--map", "--folder"]),
        (["train", "--all", "--out", "x"], ["--out", "--model"]),
        (["train", "--all", "--seeds", "0"], ["--seeds", "0"]),
        (["train", "--all", "--workers", "0"], ["--workers", "0"]),
        (["train", "--all", "--folder", "/nowhere"], ["--folder", "/nowhere"]),
        (["train", "--all"], ["--map", "--folder"]),
        (["train", "--all", "--folder", "."], ["manifest"]),
        (["verify", "--folder", "/nowhere"], ["--folder", "/nowhere"]),
        (["verify", "--folder", "a\0b"], ["--folder"]),
    ],
)
def test_wrong_input_is_one_sentence(capsys, map_file, argv, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    has_map = "verify" in argv or "." in argv
    assert main(argv if has_map else [*argv, "--map", str(map_file)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert all(word in lines[-1] for word in words), lines[-1]
    assert "Traceback" not in "".join(lines)
