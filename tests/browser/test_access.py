"""What a keyboard and a screen reader find: axe-core on every page, and a machine typed without a
mouse.
"""

import pytest

from tests.browser.conftest import OUTPUT

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-core is not there")
pytestmark = [pytest.mark.browser, pytest.mark.slow]
GRAVE = ("serious", "critical")
RULES = {"resultTypes": ["violations"], "runOnly": ["wcag2a", "wcag2aa", "best-practice"]}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_page_has_a_serious_finding(theme, chromium, tools):
    found = {}
    with tools.dashboard() as address, tools.browser_page(theme=theme) as page:
        shown = tools.pages() if theme == "light" else {"start": "", "report": "Report"}
        for name, place in shown.items():
            page.goto(f"{address}/{place}")
            tools.settled(page)
            assert page.locator("h1").count() == 1, name
            # what is told by pictures is told by words as well
            assert not page.locator("img:not([alt])").count(), name
            spoken = page.locator("[data-testid=stIconMaterial]:not([aria-hidden=true])")
            assert not spoken.count(), name
            for v in axe.Axe().run(page, options=RULES).response["violations"]:
                if v["impact"] in GRAVE:
                    found[f"{name}: {v['id']}"] = [node["html"][:200] for node in v["nodes"][:4]]
    assert not found, found


def test_a_machine_is_entered_by_the_keyboard_alone(chromium, tools):
    """From the mass on, each value in the order of the page; where the keyboard is can be seen."""
    with tools.dashboard() as address, tools.browser_page() as page:
        page.goto(address)
        tools.settled(page)
        values = {
            "Rotor mass, kg": "4",
            "Shaft speed, rpm": "20000",
            "Supply, bar gauge": "6",
            "Radius R, mm": "40",
            "Radial clearance C, µm": "25",
        }
        passed, at = [], ""
        for label, value in values.items():
            while at != label:
                page.keyboard.press("Tab")
                at = page.evaluate("document.activeElement.getAttribute('aria-label') || ''")
                passed.append(at)
                assert len(passed) < 150, passed
            page.keyboard.press("Control+a")
            page.keyboard.type(value)
            page.keyboard.press("Enter")
            tools.settled(page)
        page.get_by_text("Repeats every revolution; 73 %").first.wait_for(timeout=60_000)
        page.keyboard.press("Tab")
        ring = page.evaluate(
            """() => { const s = getComputedStyle(document.activeElement);
            return s.outlineStyle + s.boxShadow; }"""
        )
        assert ring != "nonenone"
        page.screenshot(path=OUTPUT / "keyboard.png")
