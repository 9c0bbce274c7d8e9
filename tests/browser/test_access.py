"""What a keyboard, a screen reader and a telephone find: axe-core on every page, its width, and a
machine typed without a mouse.
"""

import pytest

from tests.browser.conftest import OUTPUT, Watched

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-core is not there")
pytestmark = [pytest.mark.browser, pytest.mark.slow]
GRAVE = ("serious", "critical")
RULES = {"resultTypes": ["violations"], "runOnly": ["wcag2a", "wcag2aa", "best-practice"]}
# a formula wider than a telephone scrolls in its own box, which Chromium (from 130 on) and Firefox
# reach by the keyboard without a tabindex; axe-core does not know
NARROW = RULES | {"rules": {"scrollable-region-focusable": {"enabled": False}}}


OVER = """() => [document.scrollingElement, document.querySelector("[data-testid='stMain']")]
    .map(box => box.scrollWidth - box.clientWidth)"""


# of a page with the bar of inputs: their names, and what results stand above them
INPUTS = """() => {
    const main = document.querySelector("[data-testid='stMain']");
    const bar = main.querySelector(".st-key-point_bar");
    if (!bar) return null;
    const inputs = [...bar.querySelectorAll("input[aria-label]")].slice(0, 4);
    const results = "[data-testid=stAlert],[data-testid=stMetric],[data-testid=stDataFrame]," +
        ".js-plotly-plot,.spab-picture";
    const end = Math.max(...inputs.map(e => e.getBoundingClientRect().bottom));
    const above = [...main.querySelectorAll(results)].filter(e => {
        const box = e.getBoundingClientRect();
        return box.height > 0 && box.top < end;
    });
    return [inputs.map(e => e.getAttribute("aria-label")),
        above.map(e => e.outerHTML.slice(0, 300))];
}"""
# share of the width beside the sidebar that inputs, verdict and map take, and whether verdict and
# the map's whole plane are on the first screen
FIRST_SCREEN = """() => {
    const [verdict, map, plane, main] = [".st-key-verdict", ".st-key-map_box",
        ".st-key-map_box :is(.spab-plot, .nsewdrag)", "[data-testid='stMain']"]
        .map(name => document.querySelector(name).getBoundingClientRect());
    return [(map.right - verdict.left) / main.width,
        verdict.bottom < innerHeight && plane.bottom < innerHeight];
}"""
BAR = ["Rotor mass, kg", "Shaft speed, rpm", "Bearing number Λ", "Supply, bar gauge"]
# what is white and large enough to be a box, legends of figures among them
WHITE = """() => {
    const white = colour => {
        // url("#g249...") of a gradient has digits too
        const c = colour.startsWith("rgb") ? colour.match(/[\\d.]+/g).map(Number) : [0];
        return Math.min(...c.slice(0, 3)) > 240 && (c[3] ?? 1) > 0.5;
    };
    const boxes = document.querySelectorAll("[data-testid='stMain'] *");
    return [...boxes].filter(e => {
        const style = getComputedStyle(e), box = e.getBoundingClientRect();
        if (box.width * box.height < 400 || style.visibility === "hidden") return false;
        if (e.tagName !== "rect") return white(style.backgroundColor);
        return white(style.fill) && style.fillOpacity * style.opacity > 0.5;
    }).map(e => e.outerHTML.slice(0, 200));
}"""


@pytest.mark.parametrize(("theme", "width", "height"), [("light", 1440, 900), ("dark", 400, 800)])
def test_no_page_has_a_serious_finding(theme, width, height, address, tools):
    """On a desk in light, on a telephone in dark; what is wider than a page scrolls in its own
    box, the page does not. On a telephone the inputs come first, in dark nothing is a white box.
    """
    found, passed, watched = {}, [], Watched(address)
    rules = NARROW if width < 640 else RULES
    with tools.browser_page(width, height, theme) as page:
        watched.add(page)
        for name, place in tools.pages().items():
            page.goto(f"{address}/{place}?bearing_number=4.5&rotor_mass=18")
            tools.settled(page)
            page.screenshot(path=OUTPUT / f"{theme}_{name}.png")
            assert page.locator("h1").count() == 1, name
            assert not page.locator("[data-testid='stException']").count(), name
            assert "Traceback" not in page.inner_text("body"), name
            # what is told by pictures is told by words as well
            assert not page.locator("img:not([alt])").count(), name
            spoken = page.locator("[data-testid=stIconMaterial]:not([aria-hidden=true])")
            assert not spoken.count(), name
            if width < 640 and (inputs := page.evaluate(INPUTS)):
                assert inputs[0] == (BAR[:3] if len(inputs[0]) == 3 else BAR), name
                assert not inputs[1], f"{name}: above the inputs"
                passed.append(name)
            for size in ((width, height), (1920, 1080)) if name == "start" and width > 640 else ():
                page.set_viewport_size({"width": size[0], "height": size[1]})
                tools.settled(page)
                used, seen = page.evaluate(FIRST_SCREEN)
                assert used > 0.9 and seen, (size, used, seen)
                page.set_viewport_size({"width": width, "height": height})
            if now := findings(page, theme, rules):
                page.wait_for_timeout(1500)  # what was still being drawn
                now = findings(page, theme, rules)
            found |= {f"{name}: {what}": where for what, where in now.items()}
    assert not found, found
    assert width >= 640 or {"start", "my_map", "what_if"} <= set(passed)
    watched.check()


def findings(page, theme, rules):
    """What is wrong with what stands on the page, and where."""
    found = {}
    if theme == "dark" and (boxes := page.evaluate(WHITE)):
        found["white boxes"] = boxes[:4]
    if max(over := page.evaluate(OVER)) > 0:
        found["scrolls sideways"] = over
    for v in axe.Axe().run(page, options=rules).response["violations"]:
        if v["impact"] in GRAVE:
            found[v["id"]] = [node["html"][:200] for node in v["nodes"][:4]]
    return found


def test_a_machine_is_entered_by_the_keyboard_alone(address, tools):
    """From the mass on, each value in the order of the page; where the keyboard is can be seen."""
    with tools.browser_page() as page:
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
        go_by_keyboard(page, "Report and saved results", "Shift+Tab")
        page.wait_for_url("**/Report?**")
        tools.settled(page)
        with page.expect_download(timeout=120_000) as report:
            go_by_keyboard(page, "Report, HTML")
        assert report.value.suggested_filename == "report.html"


def go_by_keyboard(page, name, key="Tab"):
    """Reach the link or button of this name and press it."""
    for _ in range(150):
        page.keyboard.press(key)
        if page.evaluate("document.activeElement.innerText").strip().endswith(name):
            return page.keyboard.press("Enter")
    raise AssertionError(f"{name} is not reached by {key}")
