"""A designer's first minute in real Chromium: the map is there, a click on a cell solves that cell live."""

import importlib.util
import time
from pathlib import Path

import pytest

from spab_core.artifacts import load_reference_map
from tests.conftest import ROOT

pytestmark = [pytest.mark.browser, pytest.mark.slow]

OUTPUT = ROOT / "test-output"
AXES = """() => { const { xaxis, yaxis } = document.querySelector('.js-plotly-plot')._fullLayout;
    return {x: xaxis.range, y: yaxis.range}; }"""
MARKED = """() => { const plot = document.querySelector('.js-plotly-plot'), layout = plot._fullLayout;
    const uid = plot._fullData.find(t => t.name === 'chosen point').uid;
    const mark = plot.querySelector(`.trace${uid} path.point`).getBoundingClientRect();
    const box = plot.querySelector('.nsewdrag').getBoundingClientRect();
    return [layout.yaxis.p2d(mark.top + mark.height / 2 - box.top),
            layout.xaxis.p2d(mark.left + mark.width / 2 - box.left)]; }"""


def _pictures():
    spec = importlib.util.spec_from_file_location("take_pictures", ROOT / "docs" / "take_pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PLACES = """() => ['.spab-still > div', '.js-plotly-plot .nsewdrag', '.spab-still .spab-cross'].map(name => {
    const r = document.querySelector(name)?.getBoundingClientRect();
    return r && [r.left, r.top, r.right, r.bottom]; })"""


def test_the_map_is_seen_before_plotly_is_there(chromium):
    """The plain picture stands where Plotly draws the map later (to three pixels), with the cross, and gives way to it."""
    tools, held = _pictures(), []
    with tools.dashboard() as address, tools.browser_page() as page:
        page.goto(address)  # compiles, draws
        tools.settled(page)
        page.route("**/PlotlyChart*", lambda route: held.append(route))
        page.goto(f"{address}/?rotor_mass=18&bearing_number=4.5")
        page.get_by_text("Solved live").wait_for()
        page.wait_for_function("() => document.querySelector('.spab-still .spab-cross').complete")
        page.wait_for_selector("[data-testid=stSkeleton]", state="attached")  # in the chart's place
        assert held and page.locator(".spab-still img").first.is_visible()
        Path(OUTPUT).mkdir(exist_ok=True)
        page.screenshot(path=OUTPUT / "still.png")
        still, _, cross = page.evaluate(PLACES)
        for route in held:
            route.continue_()
        tools.settled(page)
        assert not page.locator(".spab-still img").first.is_visible()
        drawn, axes = page.evaluate(PLACES)[1], page.evaluate(AXES)
    assert still == pytest.approx(drawn, abs=3.0)
    right, down = (((cross[k] + cross[k + 2]) / 2 - still[k]) / (still[k + 2] - still[k]) for k in (0, 1))
    assert axes["x"][0] + right * (axes["x"][1] - axes["x"][0]) == pytest.approx(4.5, abs=0.06)
    assert axes["y"][1] - down * (axes["y"][1] - axes["y"][0]) == pytest.approx(18.0, abs=0.06)


def test_click_a_cell(chromium):
    tools = _pictures()
    m = load_reference_map()
    messages, requests = [], []
    with tools.dashboard() as address, tools.browser_page() as page:
        page.on("console", lambda entry: messages.append(entry.text) if entry.type == "error" else None)
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(address)
        tools.settled(page)
        seconds = [click_cell(page, m, *m.nearest(mass, number)) for mass, number in ((7.0, 6.0), (10.0, 5.0), (18.0, 4.5))]
        tools.settled(page)
        marked = zoomed_and_marked(page, m)
        Path(OUTPUT).mkdir(exist_ok=True)
        page.screenshot(path=OUTPUT / "clicked.png")
        text, shown = page.inner_text("body"), page.url
    assert marked == [pytest.approx([18.0, 4.5], abs=0.06)] * 2
    row, column = m.nearest(18.0, 4.5)
    assert point_words(m, row, column) in text
    assert "Chaotic" in text and "Unstable here (chaotic)" in text
    assert f"bearing_number={m.bearing_number[row]:.6g}" in shown and "rotor_mass=18" in shown
    assert not messages, messages
    assert all(url.startswith((address, address.replace("http", "ws"), "data:", "blob:")) for url in requests), requests
    print("click to answer: " + ", ".join(f"{s:.2f} s" for s in seconds))


def zoomed_and_marked(page, m):
    """Zoom in, click two cells, zoom out: (rotor mass, bearing number) at the mark's place on the screen, zoomed and whole."""
    box = page.evaluate("""() => { const r = document.querySelector('.js-plotly-plot .nsewdrag').getBoundingClientRect();
        return [r.left, r.top, r.width, r.height]; }""")
    page.mouse.move(box[0] + 0.3 * box[2], box[1] + 0.1 * box[3])
    page.mouse.down()
    page.mouse.move(box[0] + 0.8 * box[2], box[1] + 0.7 * box[3], steps=5)
    page.mouse.up()
    page.wait_for_timeout(1000)
    zoomed = page.evaluate(AXES)
    assert zoomed["x"][0] > m.bearing_number[0] and zoomed["y"][1] < m.rotor_mass[-1]
    for mass, number in ((14.0, 5.0), (18.0, 4.5)):
        click_cell(page, m, *m.nearest(mass, number))
        page.wait_for_timeout(500)
        assert page.evaluate(AXES) == zoomed  # the figure was not sent again
    found = page.evaluate(MARKED)
    page.mouse.dblclick(box[0] + 0.9 * box[2], box[1] + 0.9 * box[3])  # back to the whole map, not to another point
    page.get_by_text(point_words(m, *m.nearest(18.0, 4.5))).wait_for()
    page.wait_for_timeout(1500)
    assert page.evaluate(AXES) != zoomed
    return [found, page.evaluate(MARKED)]


def click_cell(page, m, row, column):
    """Click the cell and wait until its own answer is there; returns the seconds between."""
    number, mass = float(m.bearing_number[row]), float(m.rotor_mass[column])
    position = page.evaluate("""([x, y]) => {
        const plot = document.querySelector('.js-plotly-plot'), layout = plot._fullLayout;
        const box = plot.querySelector('.plot-container .nsewdrag').getBoundingClientRect();
        return [box.left + layout.xaxis.d2p(x), box.top + layout.yaxis.d2p(y)];
    }""", [number, mass])
    page.mouse.move(*position)
    page.wait_for_timeout(300)
    began = time.monotonic()
    page.mouse.click(*position)
    page.get_by_text(point_words(m, row, column)).wait_for(timeout=60_000)  # the caption comes last and names the point
    return time.monotonic() - began


def point_words(m, row, column):
    """What the caption under the live point says of a cell."""
    return f"at Λ {m.bearing_number[row]:.4g} and {m.rotor_mass[column]:.4g} kg"
