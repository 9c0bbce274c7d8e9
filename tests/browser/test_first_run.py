"""A fresh machine in real Chromium: an answer that is known stands there at once, the solve takes
its place by itself.
"""

import os
from unittest.mock import patch

import pytest

from spab_core.shipped.manifest import load_reference_map
from spab_core.trajectory import compiling
from tests.browser.conftest import OUTPUT

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_what_is_known_gives_way_to_the_solve(chromium, tmp_path, tools):
    """With an empty kernel folder: this compiles the solver once more, by a process of the
    server's.
    """
    m = load_reference_map()
    cell = m.nearest(18.0, 4.5)
    with (
        patch.dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path)),
        tools.dashboard() as address,
        tools.browser_page() as page,
    ):
        page.goto(f"{address}/?bearing_number=4.5&rotor_mass=18")
        page.get_by_text(m.cell_text(*cell)).wait_for(timeout=60_000)
        page.get_by_text(f"some {compiling.SECONDS} s in all").wait_for()
        told = page.inner_text("body")
        assert "From the shipped map" in told and "Predicted" in told and "90% interval" in told
        assert "Solved live" not in told
        assert not list(tmp_path.glob("*/*/stepping.advance*.nbi"))
        page.screenshot(path=OUTPUT / "first_run_known.png")
        old = page.get_by_text("s so far").inner_text()  # counts on by itself
        page.wait_for_function(
            "old => !document.body.innerText.includes(old)", arg=old, timeout=60_000
        )
        page.get_by_role("link", name="Model ranking").click()  # another page answers meanwhile
        page.get_by_text("which one predicts the map best?").wait_for(timeout=60_000)
        page.get_by_role("link", name="Start").first.click()
        page.get_by_text("Not solved yet").wait_for(timeout=60_000)
        page.get_by_text("Solved live").wait_for(timeout=600_000)
        assert list(tmp_path.glob("*/*/stepping.advance*.nbi"))
        told = page.inner_text("body")
        page.screenshot(path=OUTPUT / "first_run_solved.png")
    assert "Not solved yet" not in told and "s so far" not in told and "Contact share" in told
