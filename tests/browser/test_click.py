"""A designer's first minute in real Chromium: the map is there, a click on a cell solves that cell
live.
"""

import re
import time
from pathlib import Path

import pytest

from spab_core.shipped.manifest import load_reference_map
from tests.browser.conftest import OUTPUT, Watched

pytestmark = [pytest.mark.browser, pytest.mark.slow]

AXES = """() => {
    const { xaxis, yaxis } = document.querySelector('.st-key-map .js-plotly-plot')._fullLayout;
    return {x: xaxis.range, y: yaxis.range}; }"""
MARKED = """() => {
    const plot = document.querySelector('.st-key-map .js-plotly-plot'), layout = plot._fullLayout;
    const uid = plot._fullData.find(t => t.name === 'chosen point').uid;
    const mark = plot.querySelector(`.trace${uid} path.point`).getBoundingClientRect();
    const box = plot.querySelector('.nsewdrag').getBoundingClientRect();
    return [layout.yaxis.p2d(mark.top + mark.height / 2 - box.top),
            layout.xaxis.p2d(mark.left + mark.width / 2 - box.left)]; }"""


PLACES = """() => ['.st-key-map_box .spab-plot', '.st-key-map .nsewdrag',
                     '.st-key-map_box .spab-cross',
                     '.st-key-orbit_box .spab-plot', '.st-key-orbit .nsewdrag'].map(name => {
    const r = document.querySelector(name)?.getBoundingClientRect();
    return r && [r.left, r.top, r.right, r.bottom]; })"""
ASKED = "**/PlotlyChart*"


def test_the_map_answers_before_plotly_is_there(address, tools):
    """The plain picture stands where Plotly draws later (to three pixels), takes clicks like it,
    and gives way to it.

    Plotly is not sent for before the pointer rests, and its script is held back then until all is
    looked at."""
    m, held = load_reference_map(), []
    with tools.browser_page() as page:
        page.goto(address)  # compiles, draws
        tools.settled(page)
        page.route(ASKED, lambda route: held.append(route))
        page.goto(f"{address}/?rotor_mass=7&bearing_number=6")
        page.wait_for_selector("[data-answers]")
        page.get_by_text("Solved live").wait_for()
        page.wait_for_selector(".st-key-orbit_box .spab-plot")
        assert not held and not page.locator(".stPlotlyChart").count()
        picture, _, cross, orbit, _ = page.evaluate(PLACES)
        assert place_on(picture, cross, m) == pytest.approx([6.0, 7.0], abs=0.06)
        row, column = m.nearest(18.0, 4.5)
        page.mouse.click(*pixels_of(picture, m, row, column))
        page.get_by_text(point_words(m, row, column)).wait_for()
        assert "bearing_number=4.5&rotor_mass=18" in page.url
        page.wait_for_selector(".st-key-orbit_box .spab-plot")  # drawn last
        _, _, cross, orbit, _ = page.evaluate(PLACES)  # the words above the orbit are others now
        assert place_on(picture, cross, m) == pytest.approx([4.5, 18.0], abs=0.06)
        page.wait_for_selector(
            "[data-testid=stSkeleton]", state="attached"
        )  # in the charts' places
        assert held and page.locator(".st-key-map_box .spab-picture img").first.is_visible()
        Path(OUTPUT).mkdir(exist_ok=True)
        page.screenshot(path=OUTPUT / "plain_picture.png")
        for route in held:
            route.continue_()
        tools.settled(page)
        page.wait_for_selector(".st-key-orbit .nsewdrag", state="attached")  # drawn last
        assert not page.locator(".st-key-map_box .spab-picture img").first.is_visible()
        _, drawn, _, _, orbit_drawn = page.evaluate(PLACES)
        axes, mark = page.evaluate(AXES), page.evaluate(MARKED)
    assert picture == pytest.approx(drawn, abs=3.0) and orbit == pytest.approx(orbit_drawn, abs=3.0)
    assert mark == pytest.approx([18.0, 4.5], abs=0.06)
    half = 0.5 * (m.bearing_number[1] - m.bearing_number[0])
    assert axes["x"] == pytest.approx([m.bearing_number[0] - half, m.bearing_number[-1] + half])


def place_on(plot, cross, m):
    """Bearing number and rotor mass at the middle of a box within the plot's: cells are of one
    size.
    """
    found = []
    for k, axis in ((0, m.bearing_number), (1, m.rotor_mass)):
        share = ((cross[k] + cross[k + 2]) / 2 - plot[k]) / (plot[k + 2] - plot[k])
        found.append(
            float(axis[0] + ((1.0 - share if k else share) * len(axis) - 0.5) * (axis[1] - axis[0]))
        )
    return found


def pixels_of(picture, m, row, column):
    """Where a cell is on the picture; a browser tells whole pixels: a cell is one and a half of
    them high.
    """
    return [
        round(picture[k] + share * (picture[k + 2] - picture[k]))
        for k, share in ((0, (row + 0.5) / m.shape[0]), (1, 1.0 - (column + 0.5) / m.shape[1]))
    ]


def test_two_quick_clicks_over_a_slow_line(address, tools):
    """There and back: the second click comes from a browser that has not got the answer to the
    first, and the page ends where the second went.
    """
    m, held, slow, sides = load_reference_map(), [], [], []

    def connect(browser):
        sides.append(browser)
        server = browser.connect_to_server()
        browser.on_message(server.send)
        server.on_message(lambda answer: held.append(answer) if slow else browser.send(answer))

    here, there = m.nearest(18.0, 4.5), m.nearest(9.0, 6.5)
    with tools.browser_page() as page:
        page.route_web_socket(re.compile("_stcore/stream"), connect)
        page.goto(f"{address}/?bearing_number={m.bearing_number[here[0]]:.6g}&rotor_mass=18")
        page.wait_for_selector("[data-answers]")
        page.get_by_text(point_words(m, *here)).wait_for(timeout=240_000)
        picture = page.evaluate(PLACES)[0]
        page.wait_for_timeout(500)
        slow.append(True)
        for cell in (there, here):
            page.mouse.click(*pixels_of(picture, m, *cell))
            page.wait_for_timeout(1500)
        slow.clear()
        for answer in held:
            sides[-1].send(answer)
        page.wait_for_timeout(500)
        page.get_by_text("Regime", exact=True).first.click()  # the page tells what its fields have
        tools.settled(page)
        page.get_by_text(point_words(m, *here)).wait_for()
        assert page.get_by_role("spinbutton", name="Rotor mass, kg").input_value() == "18.000"
        assert "rotor_mass=18" in page.url, page.url


def test_plotly_comes_when_it_is_wanted_at_once(address, tools):
    """A drag on the picture, or the wheel, is for zooming: the charts come without a pause, and the
    point stays.
    """
    with tools.browser_page() as page:
        for drag in (True, False):
            page.goto(f"{address}/?bearing_number=6&rotor_mass=7")
            page.wait_for_selector("[data-answers]")
            page.get_by_text("Solved live").wait_for(timeout=240_000)
            picture = page.evaluate(PLACES)[0]
            page.mouse.move(picture[0] + 100, picture[1] + 100)
            if drag:
                page.mouse.down()
                page.mouse.move(picture[0] + 200, picture[1] + 250, steps=4)
                page.mouse.up()
            else:
                page.mouse.wheel(0, 100)
            for k in range(100):  # a pointer that never rests would not ask for them by itself
                page.mouse.move(picture[0] + 200 + k, picture[1] + 250)
                if page.locator(".stPlotlyChart").count():
                    break
                page.wait_for_timeout(100)
            assert page.locator(".stPlotlyChart").count()
            tools.settled(page)
            assert "bearing_number=6&rotor_mass=7" in page.url


def test_click_a_cell(address, tools):
    m = load_reference_map()
    with tools.browser_page() as page:
        watched = Watched(address)
        watched.add(page).goto(address)
        tools.settled(page)
        seconds = [
            click_cell(page, m, *m.nearest(mass, number))
            for mass, number in ((7.0, 6.0), (10.0, 5.0), (18.0, 4.5))
        ]
        tools.settled(page)
        marked = zoomed_and_marked(page, m)
        Path(OUTPUT).mkdir(exist_ok=True)
        page.screenshot(path=OUTPUT / "clicked.png")
        tools.settled(page)  # a margin that comes while the box opens may close it again
        page.get_by_text("The borders of regimes around the point, off this map").click()
        page.get_by_text("Not periodic here (chaotic)").wait_for()
        text, shown = page.inner_text("body"), page.url
    assert marked == [pytest.approx([18.0, 4.5], abs=0.06)] * 2
    row, column = m.nearest(18.0, 4.5)
    assert point_words(m, row, column) in text
    assert "Chaotic: never repeats" in text
    assert f"bearing_number={m.bearing_number[row]:.6g}" in shown and "rotor_mass=18" in shown
    watched.check()
    print("click to answer: " + ", ".join(f"{s:.2f} s" for s in seconds))


def zoomed_and_marked(page, m):
    """Zoom in, click two cells, zoom out: (rotor mass, bearing number) at the mark's place on the
    screen, zoomed and whole.
    """
    box = page.evaluate("""() => {
        const r = document.querySelector('.st-key-map .nsewdrag').getBoundingClientRect();
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
    page.mouse.dblclick(
        box[0] + 0.9 * box[2], box[1] + 0.9 * box[3]
    )  # back to the whole map, not to another point
    page.get_by_text(point_words(m, *m.nearest(18.0, 4.5))).wait_for()
    page.wait_for_timeout(1500)
    assert page.evaluate(AXES) != zoomed
    return [found, page.evaluate(MARKED)]


def click_cell(page, m, row, column):
    """Click the cell and wait until its own answer is there; returns the seconds between."""
    number, mass = float(m.bearing_number[row]), float(m.rotor_mass[column])
    position = page.evaluate(
        """([x, y]) => {
        const plot = document.querySelector('.st-key-map .js-plotly-plot');
        const layout = plot._fullLayout;
        const box = plot.querySelector('.plot-container .nsewdrag').getBoundingClientRect();
        return [box.left + layout.xaxis.d2p(x), box.top + layout.yaxis.d2p(y)];
    }""",
        [number, mass],
    )
    page.mouse.move(*position)
    page.wait_for_timeout(300)
    began = time.monotonic()
    page.mouse.click(*position)
    page.get_by_text(point_words(m, row, column)).wait_for(
        timeout=60_000
    )  # the caption comes last and names the point
    return time.monotonic() - began


def point_words(m, row, column):
    """What the caption under the live point says of a cell."""
    return f"at Λ {m.bearing_number[row]:.4g} and {m.rotor_mass[column]:.4g} kg"
