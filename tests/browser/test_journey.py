"""A designer's way through the pages in real Chromium.

Pictures go to test-output/.
"""

import io
import re
import time

import numpy as np
import pandas as pd
import pytest

from spab_core.shipped.manifest import load_reference_map
from spab_core.shipped.predicted_maps import load_shipped_map
from spab_core.surrogates.models import MODELS
from spab_core.ui.navigation import LABELS
from tests.browser.conftest import OUTPUT, Watched

pytestmark = [pytest.mark.browser, pytest.mark.slow]

NUMBER, MASS = 4.5, 18.0  # in the chaotic band


@pytest.fixture
def own_page(chromium, tools, tmp_path, monkeypatch):
    """A page on a server with jobs of its own; what the browser complains of fails the test."""
    monkeypatch.setenv("SPAB_JOBS", str(tmp_path))
    tmp_path.chmod(0o700)
    with tools.dashboard() as address, tools.browser_page() as page:
        watched = Watched(address)
        yield watched.add(page), address
    watched.check()


def click_cell(page, number, mass, axis=""):
    """Click a cell in the first figure's subplot with these axes."""
    position = page.evaluate(
        """([x, y, axis]) => {
        const plot = document.querySelector(
            ':is(.st-key-map, .st-key-maps, .st-key-own_figure) .js-plotly-plot');
        const layout = plot._fullLayout;
        const place = plot.querySelector(`.nsewdrag[data-subplot="x${axis}y${axis}"]`);
        const box = place.getBoundingClientRect();
        return [box.left + layout['xaxis' + axis].d2p(x), box.top + layout['yaxis' + axis].d2p(y)];
    }""",
        [number, mass, axis],
    )
    # a browser tells whole pixels, those below: a cell is one and a half of them wide
    position = [round(at) for at in position]
    page.mouse.move(*position)
    page.wait_for_timeout(300)
    page.mouse.click(*position)


def go_to(page, tools, name):
    """Open the page of this name in addresses by its link in the sidebar."""
    page.get_by_test_id("stSidebar").get_by_role("link", name=LABELS[name], exact=True).click()
    page.wait_for_url(f"**/{name}?**")
    tools.settled(page)


def at_point(page):
    assert f"bearing_number={NUMBER:g}" in page.url and f"rotor_mass={MASS:g}" in page.url, page.url


def test_journey(address, tools):
    """Map, click, point, bifurcation, surrogate, download, copied link, and back to the point."""
    m, watched = load_reference_map(), Watched(address)
    with tools.browser_page() as page:
        watched.add(page).goto(address)
        tools.settled(page)
        click_cell(page, NUMBER, MASS)
        page.wait_for_url(f"**bearing_number={NUMBER:g}**")
        tools.settled(page)
        at_point(page)
        page.get_by_text("Chaotic: never repeats").first.wait_for()
        page.screenshot(path=OUTPUT / "journey_1_map.png")

        go_to(page, tools, "Operating_point")
        at_point(page)
        assert float(page.get_by_label("Bearing number Λ", exact=True).input_value()) == NUMBER
        page.get_by_text("Chaotic: never repeats").first.wait_for()
        page.screenshot(path=OUTPUT / "journey_2_point.png")

        go_to(page, tools, "Bifurcation")
        at_point(page)
        page.get_by_text(
            "Over rotor mass at Λ = 4.5"
        ).first.wait_for()  # the line through the point, not the paper's
        page.screenshot(path=OUTPUT / "journey_3_bifurcation.png")

        go_to(page, tools, "Surrogate_map")
        at_point(page)
        page.get_by_role("radio", name="n/4").or_(
            page.get_by_role("button", name="n/4")
        ).first.click()
        page.wait_for_url("**divisor=4**")
        tools.settled(page)
        other = m.nearest(12.0, 6.0)
        number, mass = float(m.bearing_number[other[0]]), float(m.rotor_mass[other[1]])
        click_cell(page, number, mass, "3")
        page.get_by_text(f"Compared at Λ {number:.3f}").wait_for(timeout=60_000)
        page.get_by_text("interval, ").wait_for(timeout=120_000)  # a background job found it
        tools.settled(page)
        predicted = load_shipped_map(m, MODELS["theory-trees"], 4)
        assert f"Predicted {predicted.mle[other]:+.3f}, solved live" in page.inner_text("body")
        page.screenshot(path=OUTPUT / "journey_4_surrogate.png")

        page.get_by_test_id("stPopoverButton").filter(has_text="Download").click()
        for label, name in (
            ("Predicted map, CSV", "surrogate_predicted_map.csv"),
            ("Data, NPZ", "surrogate.npz"),
        ):
            with page.expect_download() as found:
                page.get_by_role("button", name=label).click()
            assert found.value.suggested_filename == name
            data = found.value.path().read_bytes()
            mle = (
                np.load(io.BytesIO(data))["mle"].ravel()
                if name.endswith("npz")
                else pd.read_csv(io.BytesIO(data))["predicted_mle"]
            )
            assert np.allclose(mle, predicted.mle.ravel(), equal_nan=True)
        page.keyboard.press("Escape")

        link = page.url
        copy = watched.add(page.context.browser.new_page(viewport={"width": 1440, "height": 900}))
        copy.goto(link)
        tools.settled(copy)
        copy.get_by_text("interval, ").wait_for(timeout=60_000)  # the comparison too
        text = copy.inner_text("body")
        assert f"Compared at Λ {number:.3f}" in text
        assert f"{mass:.2f} kg" in text and f"{predicted.surrogate.training_cells:,}" in text
        assert "In the address" not in text and copy.url == link
        copy.screenshot(path=OUTPUT / "journey_5_copied_link.png")

        page.get_by_role("button", name="Open this operating point").click()
        page.wait_for_url("**/Operating_point?**")
        tools.settled(page)
        field = page.get_by_label("Bearing number Λ", exact=True)
        assert float(field.input_value()) == pytest.approx(number, abs=5e-4)
    watched.check()


def test_leaving_a_page_while_its_job_works(own_page, tools, tmp_path):
    """Away and back: the same view, the same job at work, nothing asked for twice; cancelled it is
    shown as cancelled.
    """
    page, address = own_page
    page.goto(
        f"{address}/Bifurcation?bearing_number={NUMBER:g}&rotor_mass={MASS:g}&points=2000&sweeps=cold,up"
    )
    tools.settled(page)
    page.get_by_role("button", name="Compute 4,000 points").click()
    page.get_by_role("button", name="Cancel").wait_for(timeout=60_000)
    # the sidebar tells of the same job
    main = page.get_by_test_id("stMainBlockContainer")
    main.get_by_text(re.compile(r"[1-9][0-9]* of 4,000")).wait_for(timeout=120_000)
    go_to(page, tools, "Operating_point")
    at_point(page)
    assert "points=2000" in page.url and "sweeps=cold" in page.url
    go_to(page, tools, "Bifurcation")
    at_point(page)
    main.get_by_role("button", name="Cancel").click()
    main.get_by_text("Cancelled at").wait_for(timeout=60_000)
    main.get_by_role("button", name="Go on").wait_for()
    page.screenshot(path=OUTPUT / "cancelled.png")
    assert (
        len([folder for folder in tmp_path.iterdir() if folder.name.startswith("bifurcation")]) == 1
    )


def test_an_emptied_field_keeps_its_value(address, tools):
    watched = Watched(address)
    with tools.browser_page() as page:
        watched.add(page)
        for place, label in (
            ("", "Rotor mass, kg"),
            ("Operating_point", "Rotor mass, kg"),
            ("What_if", "Rotor mass, kg"),
            ("Bifurcation", "From, kg"),
            ("My_map", "Minutes"),
        ):
            page.goto(
                f"{address}/{place}?bearing_number={NUMBER:g}&rotor_mass={MASS:g}&mass_from=3&own_minutes=7"
            )
            tools.settled(page)
            field = page.get_by_label(label, exact=True)
            before = field.input_value()
            field.fill("")
            field.press("Enter")
            tools.settled(page)
            assert field.input_value() == before and float(before) in (MASS, 3.0, 7.0), place
            assert f"rotor_mass={MASS:g}&" in page.url and "mass_from=3&own_minutes=7" in page.url
    watched.check()


def test_a_click_on_my_map_tells_the_margin_of_the_cell(unasked, own_page, tools):
    """A small plane is mapped by a real job; a click on a cell, also on the dot of a solved one,
    moves point and margin.
    """
    page, address = own_page
    page.goto(f"{address}/My_map?bearing_number=3&rotor_mass=6")
    tools.settled(page)
    page.get_by_test_id("stPopoverButton").filter(has_text="Cells, cluster").click()
    for label, value in (("Bearing numbers", "2:4:5"), ("Rotor masses", "3:9:5")):
        field = page.get_by_role("textbox", name=label)
        field.fill(value)
        field.press("Enter")
        tools.settled(page)
    page.keyboard.press("Escape")
    for name, value in (("From, kg", 3.0), ("To, kg", 9.0)):
        assert float(page.get_by_label(name, exact=True).input_value()) == value
    page.get_by_role("button", name="Map this bearing").click()
    page.get_by_text("solved (25)").first.wait_for(timeout=120_000)
    # the job's last figure replaces the one before it
    page.get_by_role("button", name="Cancel").wait_for(state="hidden", timeout=60_000)
    tools.settled(page)
    click_cell(page, 2.5, 7.5)
    page.wait_for_url("**bearing_number=2.5&rotor_mass=7.5**")
    page.get_by_text("Solved margin").first.wait_for(timeout=60_000)
    mass = page.get_by_label("Rotor mass, kg", exact=True)
    end = time.monotonic() + 30.0
    while float(mass.input_value()) != 7.5:
        assert time.monotonic() < end
        page.wait_for_timeout(100)
    page.screenshot(path=OUTPUT / "my_map.png")
