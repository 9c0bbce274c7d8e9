"""The home page without a browser: every layer, a click, typed values at their ends, failures in
words.
"""

import contextlib
import json
import time

import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.cli.main import _build_parser
from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import reference_design
from spab_core.maps.margin import margin
from spab_core.maps.solved_margin import solve_margin
from spab_core.plotting.map import LAYERS, SURROGATE
from spab_core.plotting.theme import CHOSEN
from spab_core.shipped.manifest import load_reference_map
from spab_core.surrogates.models import MODELS
from spab_core.trajectory.assessment import Limits
from spab_core.ui import margin as margin_panel
from spab_core.ui import shared, solving
from spab_core.ui.jobs import SOLVES
from tests.app.conftest import address, complaints, verdicts
from tests.conftest import ROOT

APP = str(ROOT / "app.py")


@pytest.fixture
def app():
    """The page with Plotly's charts in it, which the browser has sent for."""
    st.cache_resource.clear()
    at = AppTest.from_file(APP, default_timeout=240)
    at.session_state["plotly_wanted"] = True
    return at.run()


def charts(at):
    """The page's figures: map, orbits."""
    found = [json.loads(c.proto.spec) for c in at.get("plotly_chart")]
    found.sort(key=lambda figure: all(t["type"] != "heatmap" for t in figure["data"]))
    return dict(enumerate(found))


def mark(at):
    """Bearing number and rotor mass of the mark on the map."""
    trace = next(t for t in charts(at)[0]["data"] if t.get("name") == CHOSEN)
    return [*trace["x"], *trace["y"]]


def test_first_view(app):
    assert not app.exception
    assert len(verdicts(app)) == 1 and verdicts(app)[0].startswith(
        "Half-speed whirl, locked to the rotation; 87 % of the clearance, least film 4.6 µm: not "
        "recommended."
    )
    assert {m.label for m in app.metric} == {
        "Exponent (MLE) per revolution",
        "Largest eccentricity",
        "Contact share",
    }
    figures = charts(app)
    assert len(figures) == 2
    m = load_reference_map()
    cells = next(t for t in figures[0]["data"] if t["type"] == "heatmap")
    assert np.shape(cells["text"]) == m.shape[::-1]
    row, column = m.nearest(18.0, 4.5)
    assert m.regime[row, column] == "chaotic"
    assert cells["text"][column][row] == "chaotic<br>not recommended"
    assert mark(app) == [3.45, 4.52]
    for figure in figures.values():
        assert (
            figure["layout"]["xaxis"]["title"]["text"]
            and figure["layout"]["yaxis"]["title"]["text"]
        )
    assert figures[0]["layout"]["xaxis2"]["title"]["text"] == "Shaft speed, rpm"
    low, high = figures[0]["layout"]["xaxis"]["range"]
    assert figures[0]["layout"]["xaxis2"]["range"] == pytest.approx(
        [m.design.speed_rpm(low), m.design.speed_rpm(high)]
    )
    assert not app.query_params


def test_until_plotly_is_wanted_there_are_plain_pictures():
    """The same words, map and orbits as pictures; then the browser asks for the charts, which take
    their places.
    """
    st.cache_resource.clear()
    at = AppTest.from_file(APP, default_timeout=240).run()
    assert not at.exception and not complaints(at) and len(verdicts(at)) == 1
    assert not at.get("plotly_chart")
    pictures = [h.proto.body for h in at.get("html") if "spab-picture" in h.proto.body]
    pictures.sort(key=lambda html: "Orbits" in html)
    assert (
        len(pictures) == 2
        and "border of chaos" in pictures[0]
        and "Orbits, last 48 revolutions" in pictures[1]
    )
    picture = shared.map_picture("Assessment", "theory-trees", 8, 0)
    assert pictures[0].endswith(picture.marked(3.45, 4.52))
    assert picture.shape == load_reference_map().shape
    at.session_state["plotly_wanted"] = True
    at.run()
    assert not at.exception and len(at.get("plotly_chart")) == 2 and mark(at) == [3.45, 4.52]
    assert (
        sum("spab-picture" in h.proto.body for h in at.get("html")) == 2
    )  # until Plotly has drawn


def test_the_margin_stands_on_the_page(app):
    words = " ".join(x.value for x in app.markdown)
    found = margin(load_reference_map(), 4.52, 3.45)
    assert found.headline() in words and all(text in words for text in found.sentences())
    assert "Linear stability threshold at this speed: 23.2 kg" in words
    assert "Regimes alone, read off the map" in words and "Solved margin" not in words
    assert any("Linearly unstable, yet" in c.value for c in app.caption)


@pytest.mark.parametrize("layer", LAYERS)
def test_every_layer_is_drawn(app, layer):
    if layer != LAYERS[0]:
        before = charts(app)[0]["data"]
        app.button_group(key="layer").select(layer).run()
        assert charts(app)[0]["data"] != before
    assert not app.exception and not complaints(app)
    data = charts(app)[0]["data"]
    assert sum(t["type"] == "heatmap" for t in data) == 1
    assert {"border of chaos", "linear stability threshold", CHOSEN} <= {
        t.get("name") for t in data
    }
    if layer == "Assessment":
        assert {"good", "to be watched", "not recommended"} == {
            t["name"] for t in data if t.get("marker", {}).get("symbol") == "square"
        }
    if layer == "Regime":
        assert {"periodic-1", "quasi-periodic", "chaotic"} <= {t.get("name") for t in data}
    heatmap = next(t for t in data if t["type"] == "heatmap")
    if layer in ("MLE", "Surrogate prediction"):
        assert heatmap["zmin"] == -heatmap["zmax"]  # the diverging scale is centred on zero
    assert "MLE %{" in heatmap["hovertemplate"] and ("predicted" in heatmap["hovertemplate"]) == (
        layer == SURROGATE
    )
    assert ("customdata" in heatmap) == (
        layer != "MLE"
    )  # the exponent, where the colours are of something else
    assert address(app).get("layer", LAYERS[0]) == layer


def test_the_predicted_layer_is_of_the_chosen_model_and_fraction(app):
    app.button_group(key="layer").select(SURROGATE).run()
    seen = set()
    for model, divisor in (("mlp", 8), ("tree", 8), ("tree", 2)):
        app.session_state["model"], app.session_state["divisor"] = model, divisor
        app.run()
        assert not app.exception and not complaints(app)
        assert any(
            f"Predicted by {MODELS[model].label} from n/{divisor}" in c.value for c in app.caption
        )
        seen.add(json.dumps(next(t for t in charts(app)[0]["data"] if t["type"] == "heatmap")["z"]))
    assert len(seen) == 3


@pytest.mark.parametrize(("mass", "number"), [(25.0, 0.05), (0.1, 8.5)])
def test_typed_values_are_solved_and_marked(app, mass, number):
    app.number_input(key="rotor_mass").set_value(mass)
    app.number_input(key="bearing_number").set_value(number).run()
    assert not app.exception
    assert any(f"at Λ {number:.4g} and {mass:.4g} kg" in c.value for c in app.caption)
    assert len(verdicts(app)) == 1 and any("edge of the map" in x.value for x in app.markdown)
    assert mark(app) == [number, mass]
    assert app.number_input(key="rpm").value == pytest.approx(
        load_reference_map().design.speed_rpm(number), rel=1e-5
    )


def test_a_typed_speed_sets_the_bearing_number(app):
    design = load_reference_map().design
    app.number_input(key="rpm").set_value(10_200.0).run()
    assert not app.exception and not complaints(app)
    assert design.speed_rpm(app.session_state["bearing_number"]) == pytest.approx(
        10_200.0, rel=1e-5
    )
    assert app.number_input(key="rpm").value == pytest.approx(10_200.0, rel=1e-5)
    assert address(app)["bearing_number"] == f"{app.session_state['bearing_number']:.6g}"
    app.number_input(key="rpm").set_value(None).run()  # emptied: the speed stays
    assert not app.exception and app.number_input(key="rpm").value == pytest.approx(
        10_200.0, rel=1e-5
    )
    app.number_input(key="rotor_mass").set_value(None).run()  # emptied: the usual mass
    assert not app.exception and app.number_input(key="rotor_mass").value == 4.52
    for speed in map(reference_design().speed_rpm, BEARING_NUMBER_RANGE):
        app.number_input(key="rpm").set_value(speed).run()
        assert not app.exception and len(verdicts(app)) == 1


def test_outside_the_map_there_is_no_margin(app):
    app.number_input(key="rotor_mass").set_value(30.0).run()
    assert not app.exception
    assert any(
        "No margin" in x.value and "allowed is from 0.1 to 25 kg" in x.value for x in app.markdown
    )


def test_wrong_values_in_the_address_are_told():
    st.cache_resource.clear()
    at = AppTest.from_file(APP, default_timeout=240)
    at.query_params["rotor_mass"], at.query_params["layer"], at.query_params["x"] = (
        "-3",
        "Colour",
        "1",
    )
    at.run()
    assert not at.exception and len(complaints(at)) == 3
    assert at.session_state["rotor_mass"] == 4.52 and at.session_state["layer"] == "Assessment"


@pytest.mark.slow
@pytest.mark.usefixtures("unasked")
def test_a_margin_solves_itself_and_is_kept():
    st.cache_resource.clear()
    at = AppTest.from_file(APP, default_timeout=240)
    at.query_params["bearing.clearance"] = "3e-05"
    at.run()
    key = reference_design().replace(bearing__clearance=30e-6), 4.52, 3.45
    end = time.monotonic() + 200
    while margin_panel.kept_margin(*key) is None:
        assert time.monotonic() < end
        at.run()  # a page that nobody looks at any more stops its margin
        time.sleep(1.0)
    at.run()
    assert not at.exception and not complaints(at)

    def told():
        return [x.value for x in at.markdown if "olved margin" in x.value or "looked at" in x.value]

    headline, words = told()
    exact = solve_margin(*key)
    assert headline == f"**{exact.headline()}**" and "±" in headline
    assert all(text in words for text in exact.sentences())
    at.run()
    assert told() == [headline, words]
    at.number_input(key="rotor_mass").set_value(5.0).run()
    assert not told()


def test_a_margin_that_has_ended_is_not_solved_again(monkeypatch):
    """The fragment that watched it asks for the page, which shows it, and starts nothing."""
    st.cache_resource.clear()
    key = reference_design(), 4.52, 3.45, Limits()
    margin_panel._store().keep(key, "a margin")

    class PageRunsAgainError(Exception):
        pass

    def again():
        raise PageRunsAgainError

    monkeypatch.setattr(st, "rerun", again)
    with pytest.raises(PageRunsAgainError):
        margin_panel._watch(key)
    assert not margin_panel._store()._runs


def test_a_margin_is_solved_when_its_button_is_pressed(monkeypatch):
    """Where the server's owner wants it so, SPAB_SOLVES=asked: a margin takes both cores."""
    st.cache_resource.clear()
    monkeypatch.setenv(SOLVES, "asked")
    at = AppTest.from_file(APP, default_timeout=240).run()
    assert not at.get("progress")
    at.button(key="solve_margin").click().run()
    assert not at.exception and "solve_margin" not in {button.key for button in at.button}
    assert any("Solving the margin" in bar.proto.text for bar in at.get("progress"))
    at.number_input(key="rotor_mass").set_value(5.0).run()  # another point is asked for anew
    assert not at.get("progress") and at.button(key="solve_margin")


def test_an_own_design_is_solved_and_the_map_says_whose_it_is():
    st.cache_resource.clear()
    at = AppTest.from_file(APP, default_timeout=240)
    at.query_params["bearing.clearance"] = "2.9e-05"
    at.run()
    assert not at.exception and not complaints(at)
    assert "example bearing" in at.info[0].value and "No map of this design" in at.info[0].value
    assert not any(
        "Margin" in x.value for x in at.markdown
    )  # the map's margin is not this design's
    charts = [json.loads(chart.proto.spec)["data"] for chart in at.get("plotly_chart")]
    assert charts and not any(trace["type"] == "heatmap" for data in charts for trace in data)
    assert any("Assumed, not typed: unbalance" in c.value for c in at.caption)
    before = at.metric[0].value
    assert {"Operating_point", "My_map", "Report"} <= {x.proto.page for x in at.get("page_link")}
    assert at.number_input(key="rpm").value == pytest.approx(
        reference_design().speed_rpm(3.45) * (2.9 / 3.5) ** 2
    )
    at.button(key="use_reference").click().run()
    assert not at.exception and not at.info and any("Margin" in x.value for x in at.markdown)
    assert at.metric[0].value != before and not at.query_params


def test_the_downloads_are_what_is_shown(app, monkeypatch):
    taken = {}
    real = st.delta_generator.DeltaGenerator.download_button

    def seen(
        self, label, data, name, *more, **options
    ):  # AppTest does not hand out what a button downloads
        taken[name] = data
        return real(self, label, data, name, *more, **options)

    monkeypatch.setattr(st.delta_generator.DeltaGenerator, "download_button", seen)
    monkeypatch.setattr(st, "download_button", lambda *a, **k: seen(st._main, *a, **k))
    app.button_group(key="layer").select("Regime").run()
    assert {
        "stability_map_map.html",
        "stability_map_map.png",
        "stability_map_map.csv",
        "stability_map.npz",
        "stability_map.nc",
    } <= taken.keys()
    assert taken["stability_map.npz"]().startswith(b"PK") and taken[
        "stability_map.nc"
    ]().startswith(b"CDF")
    page = taken["stability_map_map.html"]()
    assert b"chosen point" in page and b"quasi-periodic" in page
    assert len(taken["stability_map_map.csv"]().splitlines()) == load_reference_map().mle.size + 1
    command = app.code[0].value
    assert "spab margin --rotor-mass 4.52 --bearing-number 3.45" in command
    for line in command.splitlines():
        _build_parser().parse_args(line.split()[1:])  # raises SystemExit for what it does not know


def test_a_rotor_that_lies_on_the_wall_is_said_to(app):
    """A tonne at 30 rpm: no film carries it, and the asperities, which do, let it repeat."""
    app.number_input(key="rotor_mass").set_value(1000.0)
    app.number_input(key="bearing_number").set_value(0.01).run()
    assert not app.exception
    (words,) = verdicts(app)
    assert "not recommended" in words and "the wall carries 100 % of the weight" in words
    assert any("Why: contact share 100 %" in c.value for c in app.caption)
    assert float(app.metric[1].value) > 0.97  # largest eccentricity
    assert app.metric[2].value == "100.0 %"


def test_touchdown_is_said_in_words():
    st.cache_resource.clear()
    at = AppTest.from_file(APP, default_timeout=240)
    at.query_params["contact.force_at_closure"] = "0"
    at.query_params["rotor_mass"], at.query_params["bearing_number"] = "25", "0.5"
    at.run()
    assert not at.exception
    (words,) = verdicts(at)
    assert words.startswith("The run failed (the journal touched the wall): not recommended.")
    assert not at.metric


def test_a_first_run_says_that_it_compiles(monkeypatch):
    st.cache_resource.clear()
    said = []
    monkeypatch.setattr(solving, "is_compiled", lambda *of: False)
    monkeypatch.setattr(
        solving.st, "spinner", lambda text: said.append(text) or contextlib.nullcontext()
    )
    assert not AppTest.from_file(APP, default_timeout=240).run().exception
    assert said == ["First run on this machine: compiling the solver. This takes about 20 s, once."]


def test_a_damaged_map_is_said_in_words(monkeypatch, tmp_path):
    st.cache_resource.clear()
    monkeypatch.setattr(shared, "ARTIFACTS", tmp_path)
    at = AppTest.from_file(APP, default_timeout=60).run()
    assert not at.exception
    assert any("manifest" in e.value for e in at.error)
    st.cache_resource.clear()


def test_limits_of_ones_own_are_told_and_judge_the_point():
    at = AppTest.from_file(APP, default_timeout=240)
    at.query_params.update(rotor_mass="1", bearing_number="0.5")
    at.run()
    assert not at.exception and "limits of your own" not in " ".join(x.value for x in at.markdown)
    good = verdicts(at)[0]
    at.number_input(key="least_film").set_value(34.0).run()
    assert not at.exception and any("limits of your own" in x.value for x in at.markdown)
    assert "not recommended" in verdicts(at)[0] and "not recommended" not in good
    assert address(at)["least_film"] == "34"
    assert any("limit 34.0 µm" in x.value for x in at.caption)
