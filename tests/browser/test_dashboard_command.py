"""The dashboard as ``spab dashboard`` opens it for a user, not headless as other tests do."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_nothing_lies_over_the_first_page(chromium, tools, tmp_path):
    """Streamlit offers writers of apps who have a coding tool in their home folder to install
    something for it: over the inputs, to whoever looks at the page.
    """
    home = tmp_path / "home"
    (home / ".claude").mkdir(parents=True)
    port, log = tools.free_port(), tmp_path / "log"
    with log.open("w") as told:
        server = subprocess.Popen(
            [sys.executable, "-m", "spab_core.cli", "dashboard", "--port", str(port)],
            cwd=tmp_path,
            stdout=told,
            stderr=told,
            env=os.environ | {"PYTHONPATH": str(ROOT), "HOME": str(home), "BROWSER": "true"},
        )
    address = f"http://127.0.0.1:{port}"
    try:
        tools.until_up(address)
        with tools.browser_page() as page:
            page.goto(address)
            tools.settled(page)
            assert page.locator("[data-testid=stMain] h1").count() == 1
            assert not page.get_by_role("button", name="Install").count()
    finally:
        server.terminate()
        server.wait(timeout=20)
    assert f"The dashboard: {address}" in log.read_text()
