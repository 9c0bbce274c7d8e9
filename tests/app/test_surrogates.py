"""The surrogate pages without a browser, on a small map with its scores: every model and fraction,
failures in words.
"""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import streamlit as st
from scipy.ndimage import minimum_filter
from streamlit.testing.v1 import AppTest

from spab_core.jobs.store import cancel, list_jobs
from spab_core.maps.stability_map import FIELDS, load_map, save_map
from spab_core.plotting.theme import CHOSEN
from spab_core.shipped import build, model_store, predicted_maps
from spab_core.shipped.build import rebuild
from spab_core.shipped.manifest import (
    BLOCK_CLASSIFIERS,
    CLASSIFIERS,
    FLOORED_SCORES,
    REFERENCE_MAP,
    SCORES,
    load_reference_map,
    load_reference_scores,
    write_manifest,
)
from spab_core.surrogates.classifier import regimes_by_threshold
from spab_core.surrogates.metrics import errors, evaluate
from spab_core.surrogates.models import DIVISORS, FLOOR, MODELS, floored, predict_map
from spab_core.ui import shared
from tests.app.conftest import complaints, until_done
from tests.conftest import ROOT

PAGE = {
    name: str(next((ROOT / "pages").glob(f"*_{name}.py")))
    for name in ("Surrogate_map", "Model_ranking")
}


@pytest.fixture(scope="module")
def small_folder(tmp_path_factory):
    """artifacts/ with a few hundred cells of the shipped map and scores of models on them."""
    folder = tmp_path_factory.mktemp("artifacts")
    m = load_reference_map()
    rows, columns = (slice(None, None, max(n // 16, 1)) for n in m.shape)
    cells = {name: getattr(m, name)[rows, columns].copy() for name in FIELDS}
    cells["mle"][2, 3], cells["regime"][2, 3], cells["status"][2, 3] = np.nan, "", "touchdown"
    small = dataclasses.replace(
        m, bearing_number=m.bearing_number[rows], rotor_mass=m.rotor_mass[columns], **cells
    )
    save_map(small, folder / REFERENCE_MAP)
    kinds = [MODELS[k] for k in ("mlp", "svr", "tree", "forest", "linear")]
    for name, floor in ((SCORES, None), (FLOORED_SCORES, FLOOR)):
        scores = evaluate(small, kinds, (2, 8), (0, 1), floor=floor)
        scores.to_csv(folder / name, index=False)
    write_manifest(folder)
    return folder


@pytest.fixture
def small(small_folder, monkeypatch):
    monkeypatch.setattr(shared, "ARTIFACTS", small_folder)
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
        assert not at.exception and not complaints(at)
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


def test_another_target_is_chosen_and_told(small):
    """What is learnt, measured and drawn ends at the floor; nothing of the other target is left."""
    m = load_map(small / REFERENCE_MAP)
    at = open_page("Surrogate_map")
    at.selectbox(key="model").select("tree").run()
    shown = {}
    for target, of in (("full", m), ("floored", floored(m, FLOOR))):
        at.button_group(key="target").select(target).run()
        assert not at.exception and not complaints(at) and not at.warning
        predicted = predict_map(of, MODELS["tree"], 8)
        found = {metric.label: metric.value for metric in at.metric}
        expected = errors(of, predicted)["rmse_held_out"]
        assert found["RMSE, held-out cells"] == f"{expected:.3f}"
        own = regimes_by_threshold(
            predicted.mle, of.mle[predicted.trained], of.regime[predicted.trained]
        )
        right = (own == of.regime)[predicted.held_out].mean()
        assert found["Regime right, by its exponent"] == f"{right:.1%}"
        shown[target] = " ".join(c.value for c in at.caption)
    assert "Exponents as solved" in shown["full"] and "count as -1" in shown["floored"]
    assert "--floor -1" in " ".join(c.value for c in at.code)


def test_the_ranking_is_of_the_chosen_target(small):
    at = open_page("Model_ranking")
    for target, name in (("floored", FLOORED_SCORES), ("full", SCORES)):
        at.button_group(key="ranked").select(target).run()
        assert not at.exception and not complaints(at)
        scores = load_reference_scores(small, name)
        forest = scores[scores["model"] == "forest"]
        assert at.dataframe[0].value.loc["Random forest", "rmse"] == pytest.approx(
            forest["rmse_held_out"].mean()
        )
        assert ("--floor -1" in at.code[0].value) is (target == "floored")


@pytest.fixture
def shipped(small, tmp_path, monkeypatch):
    """The small map's folder with predicted maps and models of the tree."""
    folder = shutil.copytree(small, tmp_path / "shipped")
    monkeypatch.setattr(build, "TABLES", {})  # the scores that are there stay
    rebuild(
        load_map(folder / REFERENCE_MAP),
        folder,
        models=[MODELS["tree"], MODELS["mlp"]],
        divisors=(2, 8),
        seeds=(0,),
    )
    monkeypatch.setattr(shared, "ARTIFACTS", folder)
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "cache"))  # nothing was trained before
    return folder


def test_shipped_predictions_are_shown_without_training(shipped, monkeypatch):
    def refuse(*args, **options):
        raise AssertionError("trained")

    monkeypatch.setattr(model_store, "predict_map", refuse)
    at = open_page("Surrogate_map")
    assert at.exception  # the forest is not in this folder: so the check below can fail
    at.selectbox(key="model").select("tree").run()
    assert not at.exception and not complaints(at) and not at.warning
    assert any("shipped with spab" in c.value for c in at.caption)
    at.number_input(key="draw").set_value(1).run()
    assert at.exception  # other cells are not shipped


def test_predictions_of_another_map_are_not_shown_and_it_says_so(shipped):
    m = load_map(shipped / REFERENCE_MAP)
    save_map(dataclasses.replace(m, mle=m.mle + 0.25), shipped / REFERENCE_MAP)
    write_manifest(shipped)
    st.cache_resource.clear()
    at = open_page("Surrogate_map")
    at.selectbox(key="model").select("tree").run()
    assert (
        not at.exception
        and "another map" in at.warning[0].value
        and "spab train --all" in at.warning[0].value
    )
    assert any("Trained in" in c.value for c in at.caption)


def test_a_click_on_the_error_map_compares_with_the_live_solve(own_jobs):
    """On the shipped map, whose intervals a real job computes; an outlier of the predicted map must
    be outside.

    One in the midst of settled limit cycles, where every processor solves the same: not at the edge
    of chaos."""
    m = load_reference_map()
    # AppTest cannot click a chart: the page's own callback runs as the click would have it
    # (tests/browser clicks)
    source, before = (
        Path(PAGE["Surrogate_map"]).read_text("utf-8"),
        '\nst.markdown("# Surrogate maps',
    )
    assert source.count(before) == 1
    clicking = source.replace(
        before, f'\nif "test_click" in state:\n    _clicked(*state.pop("test_click")){before}'
    )
    at = AppTest.from_string(clicking, default_timeout=120).run()
    assert not any(h.value.startswith("## Compared") for h in at.markdown) and not list_jobs()
    predicted = predicted_maps.load_shipped_map(m, MODELS["theory-trees"], 8)
    error = np.where(predicted.trained, 0.0, np.abs(predicted.mle - m.mle))
    settled = minimum_filter(
        (m.regime == "periodic") & (m.mle_standard_error < 1e-3), 3, mode="constant"
    )
    cell = np.unravel_index(
        np.nanargmax(np.where(settled & (m.bearing_number[:, None] > 1.0), error, 0.0)), m.shape
    )
    assert error[cell] > 0.25
    number, mass = float(m.bearing_number[cell[0]]), float(m.rotor_mass[cell[1]])
    at.session_state["test_click"] = number, mass
    at.run()
    assert not at.exception and not complaints(at)
    assert f"## Compared at Λ {number:.3f}" in "".join(h.value for h in at.markdown)
    assert at.session_state["rotor_mass"] == pytest.approx(mass) and at.session_state[
        "bearing_number"
    ] == pytest.approx(number)
    assert (
        f"Predicted {predicted.mle[cell]:+.3f}" in at.info[0].value
        and "interval" not in at.info[0].value
    )
    until_done(at)
    assert not at.exception and not complaints(at)
    assert "outside the model's 90% interval" in at.warning[0].value
    row, column = (int(k[-1]) for k in np.nonzero(predicted.trained))
    at.session_state["test_click"] = float(m.bearing_number[row]), float(m.rotor_mass[column])
    at.run()
    assert "The model was trained on this cell" in (*at.success, *at.warning)[0].value
    at.button_group(key="divisor").select(2).run()
    mark = next(t for t in figure(at)["data"] if t.get("name") == CHOSEN)
    assert [*mark["x"], *mark["y"]] == [m.bearing_number[row], m.rotor_mass[column]] and mark[
        "xaxis"
    ] == "x3"
    assert not at.exception and not complaints(at)


def test_the_chosen_point_is_compared_by_a_button_and_opened(own_jobs):
    at = AppTest.from_file(PAGE["Surrogate_map"], default_timeout=120)
    at.query_params["rotor_mass"], at.query_params["model"] = "7.03", "forest"
    at.run()
    at.button(key="compare_here").click().run()
    assert at.session_state["rotor_mass"] == 7.03  # the chosen point stays, until it is opened
    assert (
        not at.exception
        and not complaints(at)
        and "7.00 kg" in "".join(h.value for h in at.markdown)
    )
    assert {j.parameters["model"] for j in list_jobs()} == {"forest"}
    assert at.button(key="open_point").label == "Open this operating point"


def test_how_sure_it_is(own_jobs):
    at = open_page("Surrogate_map")
    at.selectbox(key="model").select("tree").run()
    at.toggle(key="sure").set_value(True).run()
    assert (
        not at.exception
        and len(list_jobs()) == 1
        and not [x for x in at.metric if "Coverage" in x.label]
    )
    until_done(at)
    assert not at.exception and not complaints(at)
    found = {metric.label: metric.value for metric in at.metric}
    assert 88.0 < float(found["Coverage of 90 % intervals"].rstrip("%")) < 92.0
    assert 95.0 < float(found["Regime right, classifier"].rstrip("%")) <= 100.0
    row = load_reference_scores(name=CLASSIFIERS).set_index(["model", "divisor", "seed"])
    for name, best in (("regime", "periodic"), ("assessment", "good")):
        share = float(found[f"Called {best}, is not"].rstrip("%"))
        assert share == pytest.approx(100 * row.loc[(name, 8, 0), "unsafe_share"], abs=0.5)
    assert len([t for t in figure(at, 1)["data"] if t["type"] == "heatmap"]) == 2
    assert figure(at, 2)["data"][1]["name"] == "held-out cells"
    solved = int(np.isfinite(load_reference_map().mle).sum())
    assert at.dataframe[1].value["cells"].sum() == solved - solved // 8


@pytest.mark.parametrize("off", [False, True])
def test_a_point_off_the_map_is_marked_at_its_nearest_cell_and_told(small, off):
    at = AppTest.from_file(PAGE["Surrogate_map"], default_timeout=120)
    at.query_params["rotor_mass"], at.query_params["bearing_number"] = "2.5", "11" if off else "3"
    at.run()
    assert not at.exception
    assert any("lies off this map" in caption.value for caption in at.caption) == off


@pytest.mark.parametrize("address", [{"model": "oracle"}, {"divisor": "9"}, {"draw": "-1"}])
def test_wrong_values_in_the_address_are_told_and_the_usual_ones_taken(small, address):
    at = AppTest.from_file(PAGE["Surrogate_map"], default_timeout=120)
    for key, value in address.items():
        at.query_params[key] = value
    at.run()
    assert (
        not at.exception
        and len(complaints(at)) == 1
        and "The usual value is taken" in at.error[0].value
    )
    assert at.metric and at.selectbox(key="model").value == "theory-trees"


def test_scores_on_withheld_rectangles_stand_beside_the_others(small):
    at = open_page("Model_ranking")
    assert not at.exception and any(
        "spab evaluate --split blocks --floor -1" in c.value for c in at.caption
    )
    scores = evaluate(
        load_map(small / REFERENCE_MAP),
        [MODELS[k] for k in ("tree", "linear")],
        (2,),
        (0, 1),
        split="blocks",
        floor=FLOOR,
    )
    path = small / shared.FLOORED_BLOCK_SCORES
    try:
        scores.to_csv(path, index=False)
        write_manifest(small)
        at = open_page("Model_ranking")
        assert not at.exception and not complaints(at)
        beside = at.dataframe[2].value
        assert list(beside.index) == ["cells at random", "rectangles"]
        assert beside["Decision tree"]["rectangles"] == pytest.approx(
            scores[scores.model == "tree"]["rmse_held_out"].mean()
        )
        at.button_group(key="ranked").select("full").run()  # the table of the other target is not
        assert any("`spab evaluate --split blocks` computes" in c.value for c in at.caption)
        path.write_text("changed")
        at = open_page("Model_ranking")
        assert not at.exception and path.name in at.error[0].value
    finally:
        path.unlink()
        write_manifest(small)


def test_classifiers_stand_apart_from_the_models():
    """Of the shipped map; the models' tables tell nothing of regimes."""
    at = open_page("Model_ranking")
    assert not at.exception and not complaints(at)
    grades, regimes = (
        frame.value for frame in at.dataframe if "unsafe_share" in frame.value.columns
    )
    for name, frame in (("assessment", grades), ("regime", regimes)):
        assert list(frame["trained on"]) == [f"n/{k}" for k in DIVISORS] * 2
        for table, where in ((CLASSIFIERS, "at random"), (BLOCK_CLASSIFIERS, "in rectangles")):
            scores = load_reference_scores(name=table)
            rows = scores[(scores["model"] == name) & (scores["divisor"] == 4)]
            shown = frame[(frame["trained on"] == "n/4") & (frame["where"] == where)].iloc[0]
            assert shown["balanced_accuracy"] == pytest.approx(rows["balanced_accuracy"].mean())
            assert shown["unsafe"] == pytest.approx(rows["unsafe"].mean())
            assert shown["unsafe_share"] == pytest.approx(
                rows["unsafe"].sum() / rows["called_best"].sum()
            )
    others = [frame.value for frame in at.dataframe if "unsafe_share" not in frame.value.columns]
    assert not [c for f in others for c in f.columns if "regime" in c or "accuracy" in c]


def test_model_ranking(small):
    at = open_page("Model_ranking")
    assert not at.exception and at.success[0].value.startswith("Best by RMSE")
    assert {t["name"] for t in figure(at)["data"]} == {
        MODELS[k].label for k in ("mlp", "svr", "tree", "forest", "linear")
    }
    assert {"Average", "Standard deviation", "Max - Min"} <= set(at.dataframe[1].value.index)
    beside = at.dataframe[2].value
    assert beside["Random forest, paper"].iloc[0] == 0.45 and len(beside.columns) == 8
    for key, value in (("metric", "mae"), ("cells", "all")):
        at.button_group(key=key).select(value).run()
        assert not at.exception and not complaints(at)
    assert "MAE" in figure(at)["layout"]["yaxis"]["title"]["text"]


def test_missing_scores_are_said_in_words(small, monkeypatch, tmp_path):
    (tmp_path / REFERENCE_MAP).write_bytes((small / REFERENCE_MAP).read_bytes())
    write_manifest(tmp_path)
    monkeypatch.setattr(shared, "ARTIFACTS", tmp_path)
    at = open_page("Model_ranking")
    assert not at.exception and FLOORED_SCORES in at.error[0].value


def test_own_data_are_ranked_by_a_job(own_jobs, small):
    """A CSV of 100 points, all models: a wrong file is a sentence, the job can be cancelled."""
    number, mass = (
        a.ravel() for a in np.meshgrid(np.linspace(0.5, 8.0, 10), np.linspace(1.0, 20.0, 10))
    )
    table = pd.DataFrame({"Λ": number, "m_r": mass, "MLE": np.sin(number) * mass})
    at = open_page("Model_ranking")
    at.file_uploader(key="own_data").set_value(("mine.csv", b"a,b\n1,2\n", "text/csv")).run()
    assert not at.exception and "no column 'bearing_number'" in at.error[0].value
    at.file_uploader(key="own_data").set_value(
        ("mine.csv", table.to_csv(index=False).encode(), "text/csv")
    ).run()
    assert (
        not at.exception
        and not complaints(at)
        and any("100 points. The linear theory" in c.value for c in at.caption)
    )
    at.button(key="own_ranking_start").click().run()
    (job,) = list_jobs()
    cancel(job.id)  # what it computes is tested with the job
    assert (
        job.kind == "ranking"
        and not at.exception
        and any("Cancelled" in w.value for w in at.run().warning)
    )
