"""A designer's journey in real Chromium: a machine in mind, its values typed, verdict and solved
margin on the first page; its name, its report, what was computed.
"""

import time

import pytest

from spab_core.common.units import from_rpm
from spab_core.design.model import reference_design
from spab_core.maps.solved_margin import solve_margin
from spab_core.trajectory.point import solve_point
from spab_core.ui.margin import NEAR
from tests.browser.conftest import OUTPUT

pytestmark = [pytest.mark.browser, pytest.mark.slow]

VALUES = {  # what a designer has: five values and no click, as the supply is taken as gauge
    "Rotor mass, kg": "4",
    "Shaft speed, rpm": "20000",
    "Supply, bar gauge": "6",
    "Radius R, mm": "40",
    "Radial clearance C, µm": "25",
}


def test_from_the_first_page_to_verdict_and_margin(chromium, tools, tmp_path, monkeypatch, unasked):
    monkeypatch.setenv("SPAB_JOBS", str(tmp_path))
    tmp_path.chmod(0o700)
    ambient = reference_design().gas.ambient_pressure
    design = reference_design().replace(
        bearing__radius=0.04,
        bearing__clearance=25e-6,
        bearing__supply_pressure_ratio=(6e5 + ambient) / ambient,
    )
    number = float(f"{design.bearing_number(from_rpm(20_000.0)):.6g}")
    with tools.dashboard() as address, tools.browser_page() as page:
        page.goto(address)
        tools.settled(page)
        assert "example bearing SPAB-60" in page.inner_text("[data-testid=stMain]")
        began = time.monotonic()
        for label, value in VALUES.items():
            field = page.get_by_label(label, exact=True)
            field.fill(value)
            field.press("Enter")
            page.wait_for_timeout(200)
            page.wait_for_selector(
                "[data-testid='stApp'][data-test-script-state='notRunning']", timeout=60_000
            )
        exact = solve_point(design, 4.0, number)
        verdict = page.locator("[data-testid=stAlert]", has_text=exact.assessment().motion)
        verdict.wait_for(timeout=300_000)
        seen = time.monotonic() - began
        page.get_by_text("Solved margin: none, the point itself is to be avoided").wait_for(
            timeout=300_000
        )
        print(f"verdict after {seen:.1f} s, margin after {time.monotonic() - began:.1f} s")
        told = page.inner_text("[data-testid=stMain]")
        page.screenshot(path=OUTPUT / "my_machine.png")
        near = solve_margin(design, 4.0, number, **NEAR)
        assert near.headline() in told
        assert "Assumed, not typed: unbalance eccentricity 13 µm (G 22)" in told
        assert "No map of this design yet" in told and not page.locator(".heatmaplayer").count()
        for words in ("bearing.radius=0.04", "bearing.clearance=2.5e-05", "rotor_mass=4"):
            assert words in page.url, page.url

        page.get_by_test_id("stSidebar").get_by_role(
            "link", name="Report and saved results"
        ).click()
        page.wait_for_url("**/Report?**")
        tools.settled(page)
        page.get_by_label("Author", exact=True).fill("A. Designer")
        page.get_by_label("Author", exact=True).press("Enter")
        tools.settled(page)
        with page.expect_download(timeout=60_000) as found:
            page.get_by_role("button", name="Report, HTML").click()
        report = found.value.path().read_text("utf-8")
        shown = report[report.index("<body>") :]
        assert len(report) < 3e6 and "A. Designer" in shown and "39.24 N" in shown
        box = shown[shown.index('class="box') : shown.index("</div>")]
        assert exact.assessment().motion in box and "rpm" in box and "13 µm (G 22)" in box
