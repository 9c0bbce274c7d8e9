"""Trained models are opened only where every check holds; everything else is refused in words and
trained again.
"""

import dataclasses
import io
import json
import os
import pickle
import shutil
import stat
import warnings
from pathlib import Path

import joblib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import InputError
from spab_core.shipped import model_cache
from spab_core.shipped.build import STEP, rebuild, rounded
from spab_core.shipped.manifest import PREDICTIONS, ArtifactError, read_manifest, write_manifest
from spab_core.shipped.model_files import (
    cache_name,
    dump,
    intervals_file,
    load_shipped_certainty,
    load_shipped_model,
    model_file,
    plain,
    predictions,
)
from spab_core.shipped.model_store import find_certainty, find_model, predict_point, train_on_map
from spab_core.shipped.predicted_maps import find_map, load_shipped_map
from spab_core.shipped.provenance import (
    MEANING,
    design_hash,
    difference,
    map_hash,
    model_source,
    recipe_hash,
    versions,
)
from spab_core.surrogates.models import MODELS, model
from spab_core.surrogates.uncertainty import uncertain_map
from tests.maps import map_of, striped_map, with_hole

pytestmark = pytest.mark.usefixtures("one_table")
TREE = model("tree")
TREE_FILE = model_file(TREE, 2)


class Bomb:
    """Makes a file when it is unpickled."""

    def __init__(self, marker):
        self.marker = str(marker)

    def __reduce__(self):
        return os.mkdir, (self.marker,)


def bomb(marker):
    buffer = io.BytesIO()
    joblib.dump(Bomb(marker), buffer, compress=("xz", 6))
    return buffer.getvalue()


def wave(number, mass):
    return np.sin(number) * mass / 25.0 - 0.1


@pytest.fixture(scope="module")
def m():
    return with_hole(map_of(wave))


@pytest.fixture(scope="module")
def shipped(tmp_path_factory, m):
    folder = tmp_path_factory.mktemp("shipped")
    rebuild(
        m,
        folder,
        models=[MODELS[k] for k in ("tree", "mlp", "linear")],
        divisors=(2, 4),
        seeds=(0, 1),
    )
    return folder


@pytest.fixture
def folder(tmp_path, shipped):
    """A copy to spoil."""
    target = tmp_path / "shipped"
    target.mkdir()
    for path in shipped.iterdir():
        (target / path.name).write_bytes(path.read_bytes())
    return target


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def edit_manifest(folder, change):
    manifest = json.loads((folder / "manifest.json").read_text())
    change(manifest["files"])
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize("name", ["tree", "mlp"])
def test_a_shipped_model_and_map_are_what_training_gives(m, shipped, name):
    trained = train_on_map(m, model(name), 4)
    loaded = load_shipped_model(m, model(name), 4, folder=shipped)
    assert np.array_equal(
        loaded.predict(*np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij"))[
            np.isfinite(m.mle)
        ],
        trained.mle[np.isfinite(m.mle)],
    )
    assert (loaded.training_cells, loaded.converged) == (
        trained.surrogate.training_cells,
        trained.surrogate.converged,
    )
    served = load_shipped_map(m, model(name), 4, folder=shipped)
    assert (
        np.array_equal(served.mle, rounded(trained.mle), equal_nan=True)
        and served.origin == "shipped"
    )
    assert np.nanmax(np.abs(served.mle - trained.mle)) <= STEP / 2
    assert (
        np.array_equal(served.trained, trained.trained)
        and served.surrogate.training_cells == trained.trained.sum()
    )
    assert served.surrogate.predict(3.3, 7.0) == trained.surrogate.predict(
        3.3, 7.0
    )  # opened when asked


def test_interpolations_ship_a_map_and_no_model(m, shipped):
    assert load_shipped_map(m, model("linear"), 2, folder=shipped).mle.shape == m.shape
    with pytest.raises(ArtifactError, match="is not shipped"):
        load_shipped_model(m, model("linear"), 2, folder=shipped)


def test_a_flipped_byte_or_another_file_is_refused_before_it_is_opened(m, folder, tmp_path):
    good, marker = (folder / TREE_FILE).read_bytes(), tmp_path / "opened"
    for data in (good[:100] + bytes([good[100] ^ 1]) + good[101:], bomb(marker)):
        (folder / TREE_FILE).write_bytes(data)
        with pytest.raises(ArtifactError, match="SHA-256"):
            load_shipped_model(m, TREE, 2, folder=folder)
    write_manifest(folder)  # `make manifest` names the bytes, but not what they were made from
    with pytest.raises(ArtifactError, match="there is no note"):
        load_shipped_model(m, TREE, 2, folder=folder)
    assert not marker.exists()
    forged = model_source(m, TREE, 2, 0) | {"training_cells": 125, "converged": None}
    write_manifest(
        folder, {TREE_FILE: forged}
    )  # whoever writes the manifest is trusted: docs/artifacts.md
    with pytest.raises(ArtifactError, match="is not used"):
        load_shipped_model(m, TREE, 2, folder=folder)
    assert marker.exists()  # so this test can fail


def changed(source, path, value):
    *outer, last = path
    inner = source
    for key in outer:
        inner = inner[key]
    inner[last] = value


@pytest.mark.parametrize(
    "path, value, words",
    [
        (
            ("versions", "scikit-learn"),
            "0.1.9",
            ["made with scikit-learn 0.1 and this is scikit-learn 1."],
        ),
        (("versions", "numpy"), "1.26.0", ["made with numpy 1 and this is numpy 2"]),
        (("versions",), None, ["scikit-learn"]),
        (("design",), "0" * 64, ["another design"]),
        (("map",), "0" * 64, ["another map"]),
        (("recipe",), "0", ["code"]),
        (("model",), "forest", ["model", "forest"]),
        (("divisor",), 3, ["divisor", "3"]),
        (("seed",), 1, ["seed", "1"]),
    ],
)
def test_another_origin_is_refused_before_it_is_opened(
    m, folder, tmp_path, cache, path, value, words
):
    (folder / TREE_FILE).write_bytes(bomb(tmp_path / "opened"))
    source = model_source(m, TREE, 2, 0)
    source["versions"] = dict(source["versions"])
    changed(source, path, value)
    write_manifest(folder, {TREE_FILE: source | {"training_cells": 125, "converged": None}})
    with pytest.raises(ArtifactError) as error:
        load_shipped_model(m, TREE, 2, folder=folder)
    for word in [*words, "is not opened", "spab train --model tree --divisor 2"]:
        assert word in str(error.value)
    found = find_model(m, TREE, 2, folder=folder)  # trained again instead, and said
    assert found.origin == "trained" and words[0] in found.notes[0]
    assert not (tmp_path / "opened").exists()


@pytest.mark.parametrize(
    "name, version",
    [
        ("python", "2.7"),
        ("scikit-learn", versions()["scikit-learn"] + ".post7"),
        ("numpy", "2.999"),
        ("scipy", "0"),
        ("numba", "0"),
    ],
)
def test_versions_that_do_not_change_what_a_file_means_are_no_reason(m, folder, name, version):
    edit_manifest(
        folder, lambda files: files[TREE_FILE]["made_from"]["versions"].update({name: version})
    )
    assert load_shipped_model(m, TREE, 2, folder=folder).training_cells == 125


@pytest.mark.parametrize(
    "noted", [None, [], [0.0] * 16, ["x"] * 16, [[0.0]], "all but one"], ids=str
)
def test_a_model_that_predicts_something_else_is_refused_once_and_trained_again(
    m, folder, cache, noted
):
    def spoil(files):
        source = files[TREE_FILE]["made_from"]
        good = source["predictions"]
        source["predictions"] = [*good[:-1], good[-1] + 1e-5] if noted == "all but one" else noted

    edit_manifest(folder, spoil)
    with pytest.raises(ArtifactError, match=r"is not used.*spab train --model tree --divisor 2"):
        load_shipped_model(m, TREE, 2, folder=folder)
    first, again = (find_model(m, TREE, 2, folder=folder) for _ in range(2))
    assert (first.origin, again.origin) == ("trained", "kept") and not again.notes
    assert len(first.notes) <= 1 and all(
        "is not used" in note for note in first.notes
    )  # told once for each sentence


class Warns:
    """Warns when it is unpickled."""

    def __reduce__(self):
        return warnings.warn, ("of another time", FutureWarning)


class Breaks:
    def __reduce__(self):
        return open, ("/nowhere/at/all",)


@pytest.mark.parametrize(
    "content, words",
    [(Warns(), "of another time"), (Breaks(), "FileNotFoundError"), ([1, 2], "predict")],
)
def test_a_file_that_does_not_open_well_is_refused_in_a_sentence(m, folder, content, words):
    noted = read_manifest(folder)[TREE_FILE]["made_from"]
    (folder / TREE_FILE).write_bytes(dump(content))
    write_manifest(folder, {TREE_FILE: noted})
    with pytest.raises(ArtifactError, match=words) as error:
        load_shipped_model(m, TREE, 2, folder=folder)
    assert "spab train" in str(error.value)


def test_predictions_are_noted_all_over_the_plane(m):
    trained = train_on_map(
        map_of(lambda number, mass: number + 100.0 * mass), model("nearest"), 2
    ).surrogate
    found = np.array(predictions(m, trained)["predictions"])
    numbers, masses = found % 100.0, found // 100.0
    assert found.shape == (16,) and np.ptp(numbers) > 4.0 and np.ptp(masses) > 12.0


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["versions", "python", "map", "design", "seed"]), inner, max_size=4
        )
    ),
    max_leaves=8,
)


@given(json_values)
def test_no_foreign_note_passes(noted):
    wanted = {"versions": dict.fromkeys(MEANING, "2.4.1"), "design": "a", "map": "b", "seed": 0}
    assert isinstance(difference(noted, wanted), str)
    assert difference(wanted | {"more": noted}, wanted) is None


def test_hashes_tell_cells_and_designs_apart_and_nothing_else(m):
    assert map_hash(m) == map_hash(dataclasses.replace(m, metadata={"date": "another"}))
    assert map_hash(m) == map_hash(dataclasses.replace(m, mle=np.asfortranarray(m.mle)))
    cell = m.mle.copy()
    cell[0, 0] = np.nextafter(cell[0, 0], 9.0)
    assert map_hash(m) != map_hash(dataclasses.replace(m, mle=cell))
    assert map_hash(m) != map_hash(dataclasses.replace(m, rotor_mass=m.rotor_mass + 1e-9))
    assert design_hash(m.design) != design_hash(m.design.replace(bearing__clearance=34e-6))


def test_no_code_of_this_project_is_in_shipped_model_files(m):
    """A class of ours in a pickle could change, or move, under the file."""
    for kind in MODELS.values():
        if kind.group != "interpolation":
            assert b"spab_core" not in pickle.dumps(plain(train_on_map(m, kind, 4).surrogate)), (
                kind.name
            )


def test_another_recipe_is_another_hash(tmp_path):
    assert recipe_hash() != recipe_hash((dataclasses,))


# the models behind intervals

THEORY = model("theory-trees")


@pytest.fixture(scope="module")
def striped():
    return with_hole(striped_map())


@pytest.fixture(scope="module")
def sure(tmp_path_factory, striped):
    folder = tmp_path_factory.mktemp("sure")
    rebuild(striped, folder, models=[THEORY], divisors=(8,), seeds=(0,))
    return folder


def never(*_, **__):
    raise AssertionError("something was trained")


@pytest.mark.slow
def test_a_point_with_its_interval_is_predicted_without_training(striped, sure, monkeypatch, cache):
    expected = uncertain_map(striped, THEORY, 8)
    surrogate = train_on_map(striped, THEORY, 8).surrogate
    monkeypatch.setattr("spab_core.surrogates.uncertainty.train", never)
    monkeypatch.setattr("spab_core.surrogates.models.train", never)
    monkeypatch.setattr("spab_core.surrogates.classifier.LabelTrees.fit", never)
    for row, column in ((5, 7), (30, 20), (39, 49)):
        number, mass = striped.bearing_number[row], striped.rotor_mass[column]
        found = predict_point(striped, mass, number, THEORY, 8, folder=sure)
        assert (found.low, found.high, found.probability_unstable) == (
            expected.low[row, column],
            expected.high[row, column],
            expected.unstable[row, column],
        )
        assert found.regime == expected.regime[row, column]
        assert found.mle == surrogate.predict(number, mass) and found.training_cells == 249
    whole = uncertain_map(
        striped, THEORY, 8, known=find_certainty(striped, THEORY, 8, folder=sure)[0]
    )
    assert np.array_equal(whole.low, expected.low, equal_nan=True)


@pytest.mark.slow
def test_damaged_intervals_are_refused_once_and_trained_again(striped, sure, tmp_path, cache):
    name, folder = intervals_file(THEORY, 8), shutil.copytree(sure, tmp_path / "copy")
    good = load_shipped_certainty(striped, THEORY, 8, folder=folder)
    for how in (
        lambda files: files[name]["made_from"].update(recipe="0"),
        lambda files: files[name]["made_from"].update(predictions=[0.0] * 96),
    ):
        shutil.copy(sure / "manifest.json", folder)
        edit_manifest(folder, how)
        with pytest.raises(ArtifactError, match="trained again"):
            load_shipped_certainty(striped, THEORY, 8, folder=folder)
        (found, notes), (_, silent) = (
            find_certainty(striped, THEORY, 8, folder=folder) for _ in range(2)
        )
        assert len(notes) == 1 and silent == ()
        at = striped.bearing_number[:20], striped.rotor_mass[:20]
        assert np.array_equal(found.calibrated.intervals(*at), good.calibrated.intervals(*at))
    shutil.copy(sure / "manifest.json", folder)
    (folder / name).write_bytes(bomb(tmp_path / "opened"))
    with pytest.raises(ArtifactError, match="SHA-256"):
        load_shipped_certainty(striped, THEORY, 8, folder=folder)
    noted = read_manifest(folder)[name]["made_from"]
    (folder / name).write_bytes(dump([1, 2, 3]))
    write_manifest(folder, {name: noted})
    with pytest.raises(ArtifactError, match="cannot be used"):
        load_shipped_certainty(striped, THEORY, 8, folder=folder)
    assert not (tmp_path / "opened").exists()


def test_a_point_that_cannot_be_is_refused(striped, sure):
    with pytest.raises(InputError, match="rotor mass"):
        predict_point(striped, -1.0, 3.0, THEORY, 8, folder=sure)


def test_predicted_maps_of_other_cells_or_maps_are_not_shown(m, folder):
    with pytest.raises(ArtifactError, match="another map"):
        load_shipped_map(map_of(wave), TREE, 2, folder=folder)
    with pytest.raises(ArtifactError, match="seed"):
        load_shipped_map(m, TREE, 2, seed=1, folder=folder)
    with pytest.raises(ArtifactError, match=r"no map of n/3"):
        load_shipped_map(m, TREE, 3, folder=folder)
    with pytest.raises(ArtifactError, match="Random forest"):
        load_shipped_map(m, model("forest"), 2, folder=folder)
    with np.load(folder / PREDICTIONS) as data:
        arrays = dict(data)
    metadata = json.loads(str(arrays["metadata"]))
    for spoilt, words in (
        (metadata | {"masks": ["0"] * 2}, "draws other training cells"),
        ([], "metadata is no JSON object"),
        (metadata | {"masks": []}, "cannot read the map predicted by Decision tree"),
        (metadata | {"divisors": 7}, "cannot read the map predicted by Decision tree"),
    ):
        np.savez(folder / PREDICTIONS, **(arrays | {"metadata": np.array(json.dumps(spoilt))}))
        write_manifest(folder)
        with pytest.raises(ArtifactError, match=words):
            load_shipped_map(m, TREE, 2, folder=folder)
    np.savez(
        folder / PREDICTIONS, **(arrays | {"tree": np.array([object()], dtype=object)})
    )  # a pickle inside
    write_manifest(folder)
    with pytest.raises(ArtifactError, match="neither numbers nor text"):
        load_shipped_map(m, TREE, 2, folder=folder)


def test_a_map_without_shipped_predictions_is_trained_and_says_why(m, shipped, cache):
    other = map_of(wave)
    found = find_map(other, TREE, 2, folder=shipped)
    assert found.origin == "trained" and "another map" in found.note
    assert np.array_equal(found.mle, train_on_map(other, TREE, 2).mle)
    again = find_map(other, TREE, 2, folder=shipped)
    assert (
        again.origin == "kept"
        and np.array_equal(again.mle, found.mle)
        and np.array_equal(again.trained, found.trained)
    )
    drawn = find_map(m, TREE, 2, seed=5, folder=shipped)  # never shipped: nothing to excuse
    assert drawn.origin == "trained" and drawn.note == ""
    assert find_map(m, TREE, 2, folder=shipped).origin == "shipped"


def test_progress_counts_trees_and_changes_no_bit(m):
    steps = []
    forest = model("forest")
    counted = train_on_map(m, forest, 4, 3, lambda done, total: steps.append((done, total)))
    assert [done for done, _ in steps] == sorted(done for done, _ in steps) and {
        total for _, total in steps
    } == {100}
    assert steps[0] == (0, 100) and steps[-1] == (100, 100) and len(set(steps)) == 11
    alone = train_on_map(m, forest, 4, 3)
    assert np.array_equal(counted.mle, alone.mle, equal_nan=True) and (
        dump(counted.surrogate.estimator) == dump(alone.surrogate.estimator)
    )


# the cache of this machine


def kept_files(m, kind=TREE, divisor=2, seed=0):
    path = model_cache.wanted_folder() / cache_name(m, kind, divisor, seed)
    return path, path.with_name(f"{path.name}.json")


def test_a_model_is_trained_once_and_kept_in_a_private_folder(m, tmp_path, cache):
    first, second = (find_model(m, model("forest"), 4, folder=tmp_path) for _ in range(2))
    assert (
        (first.origin, second.origin) == ("trained", "kept")
        and not first.notes
        and not second.notes
    )
    points = np.linspace(1.0, 8.0, 20), np.linspace(2.0, 24.0, 20)
    assert np.array_equal(first.surrogate.predict(*points), second.surrogate.predict(*points))
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700
    other = map_of(wave)
    assert find_model(other, model("forest"), 4, folder=tmp_path).origin == "trained"
    assert (
        find_model(m, model("forest"), 4, folder=tmp_path).origin == "kept"
    )  # maps do not drive each other out


def spoil(m, how, marker):
    path, side = kept_files(m)
    noted = json.loads(side.read_text())
    if how == "flipped byte":
        path.write_bytes(path.read_bytes()[:-9] + b"x" + path.read_bytes()[-8:])
    elif how == "foreign file":
        path.write_bytes(bomb(marker))
    elif how == "side file gone":
        path.write_bytes(bomb(marker))
        side.unlink()
    elif how == "side file damaged":
        path.write_bytes(bomb(marker))
        side.write_text(side.read_text()[:-20])
    elif how == "link":
        path.rename(path.with_name("elsewhere"))
        path.symlink_to("elsewhere")
    elif how == "pipe":
        path.unlink()
        os.mkfifo(path)
    else:  # scikit-learn, map
        path.write_bytes(bomb(marker))
        changed(noted["made_from"], how, "1.0")
        model_cache.write(path, path.read_bytes(), noted["made_from"])


@pytest.mark.parametrize(
    "how, words",
    [
        ("flipped byte", "SHA-256"),
        ("foreign file", "SHA-256"),
        ("side file gone", None),
        ("side file damaged", "side file"),
        ("link", "is not opened"),
        ("pipe", "not a regular file"),
        (("versions", "scikit-learn"), "scikit-learn 1.0"),
        (("map",), "another map"),
    ],
    ids=str,
)
def test_a_spoilt_file_in_the_cache_is_trained_again_and_never_opened(
    m, tmp_path, cache, how, words
):
    find_model(m, TREE, 2, folder=tmp_path)
    spoil(m, how, tmp_path / "opened")
    found = find_model(m, TREE, 2, folder=tmp_path)
    assert found.origin == "trained" and not (tmp_path / "opened").exists()
    assert words is None or words in found.notes[0]
    assert find_model(m, TREE, 2, folder=tmp_path).origin == "kept"  # mended


@pytest.mark.skipif(
    not hasattr(os, "getuid") or os.getuid() != 0, reason="only root can give files away"
)
@pytest.mark.parametrize("part", ["folder", "file"])
def test_what_belongs_to_another_user_is_not_opened(m, tmp_path, cache, part):
    find_model(m, TREE, 2, folder=tmp_path)
    path, side = kept_files(m)
    model_cache.write(path, bomb(tmp_path / "opened"), json.loads(side.read_text())["made_from"])
    os.chown(cache if part == "folder" else path, 12345, 12345)
    found = find_model(m, TREE, 2, folder=tmp_path)
    assert (
        found.origin == "trained"
        and "yours" in found.notes[0]
        and not (tmp_path / "opened").exists()
    )


@pytest.mark.parametrize("place", ["open to others", "a file", "no folder can be made", "no home"])
def test_without_a_private_folder_models_are_trained_and_not_kept(
    m, tmp_path, monkeypatch, cache, place
):
    if place == "open to others":
        cache.mkdir()
        cache.chmod(0o755)
    elif place == "a file":
        cache.write_text("")
    elif place == "no folder can be made":
        monkeypatch.setenv("SPAB_CACHE", "/dev/null/models")
    else:

        def homeless():
            raise RuntimeError("Could not determine home directory.")

        monkeypatch.delenv("SPAB_CACHE")
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        monkeypatch.setattr(Path, "home", homeless)
    for _ in range(2):
        found = find_model(m, TREE, 2, folder=tmp_path)
        assert (
            found.origin == "trained" and len(found.notes) == 1 and "SPAB_CACHE" in found.notes[0]
        )
    assert not cache.is_dir() or not list(cache.iterdir())


def test_which_folder_is_used(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SPAB_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert model_cache.wanted_folder() == tmp_path / ".cache" / "spab"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "x"))
    assert model_cache.wanted_folder() == tmp_path / "x" / "spab"
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "y"))
    assert model_cache.wanted_folder() == tmp_path / "y"


def test_the_least_recently_used_models_go_first(monkeypatch, cache):
    monkeypatch.setattr(model_cache, "MAX_BYTES", 250)
    for k, name in enumerate(("a.joblib", "b.joblib")):
        path = model_cache.keep(name, b"x" * 100, {})
        os.utime(path, (k, k))
    model_cache.read("a.joblib")  # used now
    model_cache.keep("c.joblib", b"x" * 100, {})
    assert (
        sorted(p.name for p in cache.glob("*.joblib")) == ["a.joblib", "c.joblib"]
        and len(list(cache.iterdir())) == 4
    )


def test_the_manifest_keeps_what_it_knows_of_unchanged_files(folder):
    before = read_manifest(folder)
    assert write_manifest(folder)["files"] == before and "made_from" in before[TREE_FILE]
