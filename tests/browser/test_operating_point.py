"""The operating point in real Chromium: from the map to it, a new verdict at once, every tab drawn,
the film moves.
"""

import time

import pytest

from spab_core.ui.view import POINT_TABS
from tests.browser.conftest import OUTPUT, Watched

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_the_operating_point(address, tools):
    with tools.browser_page() as page:
        watched = Watched(address)
        watched.add(page).goto(address)
        tools.settled(page)
        page.get_by_role("link", name="Motion in detail").first.click()
        # Start has such words and numbers too
        page.get_by_role("heading", name="Motion in detail", level=1).wait_for()
        tools.settled(page)
        page.get_by_text("revolutions from rest").wait_for(timeout=120_000)

        metric = page.locator("[data-testid=stMetricValue]").first
        before, began = metric.inner_text(), time.monotonic()
        page.locator("[data-testid=stNumberInputStepUp]").first.click()
        page.wait_for_function(
            "old => ![null, undefined, old].includes("
            "document.querySelector('[data-testid=stMetricValue]')?.innerText)",
            arg=before,
            timeout=30_000,
        )
        print(f"click to verdict: {time.monotonic() - began:.2f} s")

        for name in POINT_TABS:
            page.get_by_role("tab", name=name).click()
            page.wait_for_selector("[data-testid=stTabs] .js-plotly-plot .main-svg", timeout=60_000)
            page.wait_for_selector("[data-testid=stStatusWidget]", state="detached", timeout=60_000)
            page.wait_for_timeout(500)
            page.screenshot(
                path=OUTPUT / f"point_{name.replace(' ', '_').lower()}.png", timeout=120_000
            )

        page.get_by_role("tab", name="Film 3-D").click()
        label = page.locator(".slider-label").first
        label.wait_for(timeout=60_000)
        assert label.text_content().startswith("shaft angle 0")
        page.locator(".updatemenu-button").first.click(no_wait_after=True)
        page.wait_for_function(
            "() => parseInt(document.querySelector('.slider-label').textContent.slice(12)) >= 30",
            timeout=120_000,
        )
        copied = page.url
    assert "tab=Film" in copied and "rotor_mass=4.6" in copied
    watched.check()
