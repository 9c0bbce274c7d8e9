"""The home page without a browser: every layer, a click, typed values at their ends, failures in words."""

import contextlib
import json

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest
from streamlit.util import AttributeDictionary

from spab_core import artifacts
from spab_core.artifacts import load_reference_map
from spab_core.figures_map import LAYERS
from spab_core.stability_map import StabilityMap
from spab_core.ui import shared
from tests.conftest import ROOT

APP = str(ROOT / "app.py")


@pytest.fixture
def app():
    st.cache_resource.clear()
    return AppTest.from_file(APP, default_timeout=240).run()


def charts(at):
    """The page's figures in order: map, orbits, section, exponent."""
    return {k: json.loads(c.proto.spec) for k, c in enumerate(at.get("plotly_chart"))}


def verdict(at):
    return [box.value for kind in ("success", "warning", "error") for box in at.get(kind)]


def click(at, point_index):
    at.session_state["map"] = AttributeDictionary({"selection": {"points": [{"point_index": point_index}]}})
    return at


def test_first_view(app):
    assert not app.exception
    assert len(verdict(app)) == 1 and verdict(app)[0].endswith(".")
    assert {m.label for m in app.metric} == {"MLE per revolution", "Standard error", "Max. eccentricity", "Time in contact"}
    figures = charts(app)
    assert len(figures) == 4
    m = load_reference_map()
    cells = next(t for t in figures[0]["data"] if t.get("name") == "cells")
    assert cells["type"] == "scattergl" and len(cells["text"]) == m.mle.size
    for figure in figures.values():
        assert figure["layout"]["xaxis"]["title"]["text"] and figure["layout"]["yaxis"]["title"]["text"]
    assert "rpm" in " ".join(x.value for x in app.markdown)


@pytest.mark.parametrize("layer", LAYERS)
def test_every_layer_is_drawn(app, layer):
    if layer != LAYERS[0]:
        app.button_group(key="layer").select(layer).run()
    assert not app.exception
    data = charts(app)[0]["data"]
    assert any(t["type"] == "heatmap" for t in data)
    if layer == "Regime":
        assert {"periodic-1", "quasi-periodic", "chaotic"} <= {t.get("name") for t in data}
    if layer == "MLE":
        heatmap = next(t for t in data if t["type"] == "heatmap")
        assert heatmap["zmin"] == -heatmap["zmax"]  # the diverging scale is centred on zero


def test_typed_values_are_solved_at_their_ends(app):
    app.number_input(key="rotor_mass").set_value(25.0)
    app.number_input(key="bearing_number").set_value(0.05).run()
    assert not app.exception
    assert "Λ 0.050" in " ".join(x.value for x in app.markdown)
    assert len(verdict(app)) == 1


def test_an_operating_point_without_exponent_is_said_in_words(app):
    """Three tonnes would overcome the asperities; within the allowed tonne, 25 kg without asperities touches down."""
    app.number_input(key="rotor_mass").set_value(1000.0)
    app.number_input(key="bearing_number").set_value(0.01).run()
    assert not app.exception
    assert len(verdict(app)) == 1


def test_touchdown_is_said_in_words(monkeypatch):
    st.cache_resource.clear()
    m = load_reference_map()
    design = m.design.replace(contact__force_at_closure=0.0)
    monkeypatch.setattr(StabilityMap, "design", design)
    at = AppTest.from_file(APP, default_timeout=240)
    at.session_state["rotor_mass"], at.session_state["bearing_number"] = 25.0, 0.5
    at.run()
    assert not at.exception
    assert ["No exponent: the journal touched the wall."] == verdict(at)
    assert not at.metric
    st.cache_resource.clear()


def test_a_first_run_says_that_it_compiles(monkeypatch):
    st.cache_resource.clear()
    said = []
    monkeypatch.setattr(shared, "is_compiled", lambda: False)
    monkeypatch.setattr(shared.st, "spinner", lambda text: said.append(text) or contextlib.nullcontext())
    assert not AppTest.from_file(APP, default_timeout=240).run().exception
    assert said == ["First run on this machine: compiling the solver. This takes about a minute, once."]


def test_a_damaged_map_is_said_in_words(monkeypatch, tmp_path):
    st.cache_resource.clear()
    monkeypatch.setattr(artifacts.load_reference_map, "__defaults__", (tmp_path,))
    at = AppTest.from_file(APP, default_timeout=60).run()
    assert not at.exception
    assert any("manifest" in e.value for e in at.error)
    st.cache_resource.clear()


def test_a_click_takes_the_cell(app):
    """The overlay's point index is the cell's position in the map, bearing number first."""
    m = load_reference_map()
    row, column = len(m.bearing_number) // 2, len(m.rotor_mass) // 3
    # AppTest cannot click a chart: run the page's own callback with the state a click leaves behind
    source = (ROOT / "app.py").read_text().replace('left, right = st.columns', '_clicked()\nleft, right = st.columns', 1)
    at = AppTest.from_string(source, default_timeout=240)
    click(at, row * len(m.rotor_mass) + column).run()
    assert not at.exception
    assert at.session_state["bearing_number"] == pytest.approx(m.bearing_number[row], abs=1e-5)
    assert at.session_state["rotor_mass"] == pytest.approx(m.rotor_mass[column], abs=1e-5)
