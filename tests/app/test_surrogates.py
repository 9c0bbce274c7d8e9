"""The surrogate pages without a browser, on a small map with its scores: every model and fraction, failures in words."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core import artifacts, pretrained
from spab_core.artifacts import REFERENCE_MAP, SCORES, load_reference_map, write_manifest
from spab_core.evaluation import evaluate
from spab_core.release import rebuild
from spab_core.stability_map import FIELDS, load_map, save_map
from spab_core.surrogates import DIVISORS, MODELS
from spab_core.ui import shared
from tests.conftest import ROOT

PAGE = {name: str(next((ROOT / "pages").glob(f"*_{name}.py"))) for name in ("Surrogate_map", "Model_ranking")}


@pytest.fixture(scope="module")
def small_folder(tmp_path_factory):
    """artifacts/ with a few hundred cells of the shipped map and the scores of two models on them."""
    folder = tmp_path_factory.mktemp("artifacts")
    m = load_reference_map()
    rows, columns = (slice(None, None, max(n // 16, 1)) for n in m.shape)
    cells = {name: getattr(m, name)[rows, columns].copy() for name in FIELDS}
    cells["mle"][2, 3], cells["regime"][2, 3], cells["status"][2, 3] = np.nan, "", "touchdown"
    small = dataclasses.replace(m, bearing_number=m.bearing_number[rows], rotor_mass=m.rotor_mass[columns], **cells)
    save_map(small, folder / REFERENCE_MAP)
    scores = evaluate(small, [MODELS[k] for k in ("mlp", "svr", "tree", "forest", "linear")], (2, 8), (0, 1))
    scores.to_csv(folder / SCORES, index=False)
    write_manifest(folder)
    return folder


@pytest.fixture
def small(small_folder, monkeypatch):
    for module in (artifacts, shared):
        monkeypatch.setattr(module, "ARTIFACTS", small_folder)
    for loader in (artifacts.load_reference_map, artifacts.load_reference_scores):
        monkeypatch.setattr(loader, "__defaults__", (small_folder,))
    st.cache_resource.clear()
    yield small_folder
    st.cache_resource.clear()


def open_page(name):
    return AppTest.from_file(PAGE[name], default_timeout=120).run()


def figure(at, k=0):
    return json.loads(at.get("plotly_chart")[k].proto.spec)


@pytest.mark.parametrize("name", list(MODELS))
def test_every_model_and_fraction(small, name):
    at = open_page("Surrogate_map")
    at.selectbox(key="model").select(name).run()
    errors, solved = {}, int(np.isfinite(load_map(small / REFERENCE_MAP).mle).sum())
    for divisor in DIVISORS:
        at.button_group(key="divisor").select(divisor).run()
        assert not at.exception and not at.error
        found = {metric.label: metric.value for metric in at.metric}
        errors[divisor] = float(found["RMSE, held-out cells"])
        assert np.isfinite(errors[divisor]) and int(found["Cells trained on"]) == solved // divisor
        assert len([t for t in figure(at)["data"] if t["type"] == "heatmap"]) == 3
    assert len(set(errors.values())) > 1  # another fraction is another prediction


def test_first_view_of_the_surrogate_map(small):
    at = open_page("Surrogate_map")
    assert not at.exception
    titles = [a["text"] for a in figure(at)["layout"]["annotations"]]
    assert titles == ["Solved", "Predicted: Trees on linear theory", "Error of held-out cells"]
    assert "kg" in figure(at)["layout"]["yaxis"]["title"]["text"]
    lives = at.dataframe[0].value
    assert set(lives.columns) == {"cells", "rmse", "mae", "share"} and "at a border" in lives.index
    assert lives.drop(index="at a border")["share"].sum() == pytest.approx(1.0)


@pytest.fixture
def shipped(small, tmp_path, monkeypatch):
    """The small map's folder with predicted maps and models of the tree."""
    folder = shutil.copytree(small, tmp_path / "shipped")
    rebuild(load_map(folder / REFERENCE_MAP), folder, models=[MODELS["tree"], MODELS["mlp"]], divisors=(2, 8), seeds=(0,))
    monkeypatch.setattr(shared, "ARTIFACTS", folder)
    monkeypatch.setattr(artifacts.load_reference_map, "__defaults__", (folder,))
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "cache"))  # nothing was trained before
    return folder


def test_shipped_predictions_are_shown_without_training(shipped, monkeypatch):
    def refuse(*args, **options):
        raise AssertionError("trained")
    monkeypatch.setattr(pretrained, "predict_map", refuse)
    at = open_page("Surrogate_map")
    assert at.exception  # the forest is not in this folder: so the check below can fail
    at.selectbox(key="model").select("tree").run()
    assert not at.exception and not at.error and not at.warning
    assert "shipped" in at.caption[0].value
    at.number_input(key="draw").set_value(1).run()
    assert at.exception  # other cells are not shipped


def test_predictions_of_another_map_are_not_shown_and_it_says_so(shipped):
    m = load_map(shipped / REFERENCE_MAP)
    save_map(dataclasses.replace(m, mle=m.mle + 0.25), shipped / REFERENCE_MAP)
    write_manifest(shipped)
    st.cache_resource.clear()
    at = open_page("Surrogate_map")
    at.selectbox(key="model").select("tree").run()
    assert not at.exception and "another map" in at.warning[0].value and "spab train --all" in at.warning[0].value
    assert "Trained in" in at.caption[0].value


def test_how_sure_it_is(small):
    at = open_page("Surrogate_map")
    at.button_group(key="divisor").select(2).run()
    at.toggle(key="sure").set_value(True).run()
    assert not at.exception and not at.error
    found = {metric.label: metric.value for metric in at.metric}
    assert 60.0 < float(found["Coverage of 90 % intervals"].rstrip("%")) <= 100.0  # a few dozen cells to calibrate with
    assert 60.0 < float(found["Regime accuracy"].rstrip("%")) <= 100.0
    assert len([t for t in figure(at, 1)["data"] if t["type"] == "heatmap"]) == 2
    assert figure(at, 2)["data"][1]["name"] == "held-out cells"
    bins, m = at.dataframe[1].value, load_map(small / REFERENCE_MAP)
    solved = int(np.isfinite(m.mle).sum())
    assert bins["cells"].sum() == solved - solved // 2


def test_intervals_from_too_few_cells_are_refused_in_words(small):
    at = open_page("Surrogate_map")
    at.toggle(key="sure").set_value(True).run()  # n/8 of this small map
    assert not at.exception and "too few for intervals" in at.error[0].value


def test_scores_on_withheld_rectangles_stand_beside_the_others(small):
    at = open_page("Model_ranking")
    assert not at.exception and any("spab evaluate --split blocks" in c.value for c in at.caption)
    scores = evaluate(load_map(small / REFERENCE_MAP), [MODELS[k] for k in ("tree", "linear")], (2,), (0, 1), split="blocks")
    path = small / shared.BLOCK_SCORES
    try:
        scores.to_csv(path, index=False)
        write_manifest(small)
        at = open_page("Model_ranking")
        assert not at.exception and not at.error
        beside = at.dataframe[2].value
        assert list(beside.index) == ["cells at random", "rectangles"]
        assert beside["Decision tree"]["rectangles"] == pytest.approx(scores[scores.model == "tree"]["rmse_held_out"].mean())
        path.write_text("changed")
        at = open_page("Model_ranking")
        assert not at.exception and shared.BLOCK_SCORES in at.error[0].value
    finally:
        path.unlink()
        write_manifest(small)


def test_model_ranking(small):
    at = open_page("Model_ranking")
    assert not at.exception and at.success[0].value.startswith("Best by RMSE")
    assert {t["name"] for t in figure(at)["data"]} == {MODELS[k].label for k in ("mlp", "svr", "tree", "forest", "linear")}
    assert {"Average", "Standard deviation", "Max - Min"} <= set(at.dataframe[1].value.index)
    beside = at.dataframe[2].value
    assert beside["Random forest, paper"].iloc[0] == 0.45 and len(beside.columns) == 8
    for key, value in (("metric", "mae"), ("cells", "all")):
        at.button_group(key=key).select(value).run()
        assert not at.exception and not at.error
    assert "MAE" in figure(at)["layout"]["yaxis"]["title"]["text"]


def test_missing_scores_are_said_in_words(small, monkeypatch, tmp_path):
    (tmp_path / REFERENCE_MAP).write_bytes((small / REFERENCE_MAP).read_bytes())
    write_manifest(tmp_path)
    monkeypatch.setattr(artifacts.load_reference_scores, "__defaults__", (tmp_path,))
    at = open_page("Model_ranking")
    assert not at.exception and SCORES in at.error[0].value
