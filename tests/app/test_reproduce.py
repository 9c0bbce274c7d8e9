"""Reproduce the paper without a browser: its figures and tables from what is shipped, nothing
trained.
"""

import json

import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.shipped import model_store
from spab_core.shipped.manifest import (
    FLOORED_SCORES,
    SCORES,
    load_reference_map,
    load_reference_scores,
)
from spab_core.surrogates.models import FLOOR, floored
from spab_core.surrogates.paper import PAPER_RMSE
from spab_core.ui import shared
from spab_core.ui.view import PAPER_MODELS, PAPER_PARTS
from tests.app.conftest import address, complaints
from tests.conftest import ROOT

PAGE = str(ROOT / "pages" / "10_Reproduce_the_paper.py")


@pytest.fixture(autouse=True, scope="module")
def shipped_files():
    """Those of the repository, whatever other tests have read."""
    st.cache_resource.clear()
    yield
    st.cache_resource.clear()


@pytest.fixture(autouse=True)
def nothing_is_trained(monkeypatch):
    def refuse(*args, **options):
        raise AssertionError("trained")

    monkeypatch.setattr(model_store, "predict_map", refuse)


def opened(**address):
    at = AppTest.from_file(PAGE, default_timeout=120)
    for key, value in address.items():
        at.query_params[key] = value
    at.run()
    assert not at.exception and not complaints(at)
    return at


def figure(at):
    return json.loads(at.get("plotly_chart")[0].proto.spec)


def words(at):
    return "\n".join(block.value for block in at.markdown)


def rows(at, heading):
    """Cells of the table row that begins with this text."""
    (line,) = [x for x in words(at).splitlines() if x.startswith(f"| {heading}")]
    return [cell.strip() for cell in line.strip("| ").split(" | ")]


def test_every_part_is_chosen_in_place():
    at = opened()
    assert words(at).startswith("# Reproduce the paper") and "10.1109/ACCESS" in words(at)
    for part in PAPER_PARTS:
        at.button_group(key="paper").select(part).run()
        assert not at.exception and not complaints(at)
        assert address(at).get("paper", PAPER_PARTS[0]) == part
        assert len(at.get("plotly_chart")) == (part in ("lines", "map", "predictions"))


def test_claims_are_told_for_both_kinds_of_exponents():
    at = opened()
    said, solved, cut = rows(at, "The SVM cannot be accepted")
    assert "0.98 to 0.99" in said
    for text, name, floor in ((solved, SCORES, None), (cut, FLOORED_SCORES, FLOOR)):
        scores = load_reference_scores(name=name)
        svr = scores[scores["model"] == "svr"].groupby("divisor")["rmse_all"].mean()
        over = svr / np.nanstd(floored(load_reference_map(), floor).mle)
        assert f"{over.min():.2f} to {over.max():.2f}" in text
        assert ("does not hold" in text) is bool(over.max() < 0.78)
    assert "holds" in solved and "not" not in solved and "does not hold" in cut
    assert rows(at, "At small bearing numbers")[1].startswith("**does not hold**")


@pytest.mark.parametrize(
    "vary, x_title, window, figures",
    [
        ("rotor-mass", "otor mass", [22.66, 23.52], ("1", "2", "6")),
        ("bearing-number", "Λ", [1.0, 2.4], ("3", "4", "7")),
    ],
)
def test_the_papers_lines_with_its_chaos(vary, x_title, window, figures):
    at = opened(paper="lines", paper_line=vary)
    layout = figure(at)["layout"]
    outlined = [s for s in layout["shapes"] if s.get("line", {}).get("dash") == "dash"]
    assert [[s["x0"], s["x1"]] for s in outlined if s["yref"] == "paper"] == [window]
    assert [layout[k]["title"]["text"][:2] for k in ("yaxis", "yaxis2", "yaxis3")] == [
        "X₂",
        "Y₂",
        "ML",
    ]
    assert x_title in layout["xaxis3"]["title"]["text"]
    told = [rows(at, name)[1] for name in ("X₂", "Y₂", "MLE")]
    assert told == [f"figure {n}" for n in figures]
    assert rows(at, "chaotic")[1].startswith(f"{window[0]:.2f} to {window[1]:.2f}")


def test_figure_10_has_the_papers_grid():
    at = opened(paper="map")
    assert rows(at, "cells, Λ × mass")[1:] == ["170 × 250", "170 × 250"]
    heat = next(t for t in figure(at)["data"] if t["type"] == "heatmap")
    assert "revolution" in heat["colorbar"]["title"]["text"]


@pytest.mark.parametrize("target", ["full", "floored"])
def test_every_predicted_figure_is_shipped(target):
    at = opened(paper="predictions", target=target)
    numbers, scores = [], load_reference_scores(name=SCORES if target == "full" else FLOORED_SCORES)
    scores = scores[scores["seed"] == 0].set_index(["model", "divisor"])
    for divisor in (2, 4, 8):
        at.button_group(key="paper_divisor").select(divisor).run()
        for name in PAPER_MODELS:
            at.button_group(key="paper_model").select(name).run()
            assert not at.exception and not complaints(at)
            heading = next(x for x in words(at).splitlines() if x.startswith("## Figure"))
            numbers.append(int(heading.split()[2].rstrip(":")))
            found = rows(at, "RMSE, whole map")
            assert found[1].startswith(f"{PAPER_RMSE[name][divisor - 2]:.2f}")
            row = scores.loc[name, divisor]
            assert float(found[3]) == pytest.approx(row["rmse_all"], abs=6e-4)
            assert len([t for t in figure(at)["data"] if t["type"] == "heatmap"]) == 3
    assert numbers == list(range(11, 23))


def test_the_papers_tables_beside_ours():
    at = opened(paper="tables")
    first, second = (d.value for d in at.dataframe)
    assert list(first["RF, paper"])[:7] == list(PAPER_RMSE["forest"])
    assert first["RF, paper"]["Average"] == pytest.approx(0.57, abs=0.005)
    deviation = np.nanstd(load_reference_map().mle)
    scores = load_reference_scores()
    eighth = scores[(scores["model"] == "svr") & (scores["divisor"] == 8)]
    for table, metric in ((first, "rmse"), (second, "mae")):
        ours = eighth[f"{metric}_all"].mean() / deviation
        assert table["SVM, as solved"]["n/8"] == pytest.approx(ours)
    assert not [c for c in second.columns if "paper" in c]  # whose values its text does not have
    assert "Standard deviation" in first.index


def test_missing_scores_are_said_in_words(monkeypatch, tmp_path):
    st.cache_resource.clear()
    monkeypatch.setattr(shared, "ARTIFACTS", tmp_path)
    at = AppTest.from_file(PAGE, default_timeout=60).run()
    assert not at.exception and "manifest" in at.error[0].value
