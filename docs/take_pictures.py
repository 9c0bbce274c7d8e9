"""Pictures of the dashboard, taken in real Chromium, for the README and docs: ``make pictures``."""

import io
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parent.parent


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def until_up(address):
    """Wait until a server answers, half a minute at most."""
    for _ in range(300):
        try:
            urllib.request.urlopen(f"{address}/_stcore/health", timeout=1).close()
            break
        except OSError:
            time.sleep(0.1)


@contextmanager
def server(
    script="app.py", root=ROOT, log=subprocess.DEVNULL, python=sys.executable, **environment
):
    """A script of a checkout served by Streamlit on a free port of this machine; yields the process
    and the port.
    """
    port = free_port()
    options = ["--server.port", str(port), "--server.headless", "true"]
    process = subprocess.Popen(
        [str(python), "-m", "streamlit", "run", str(script), *options],
        cwd=root,
        stdout=log,
        stderr=log,
        env=os.environ | {"PYTHONPATH": str(root)} | environment,
    )
    try:
        until_up(f"http://127.0.0.1:{port}")
        yield process, port
    finally:
        process.terminate()
        process.wait(timeout=20)


@contextmanager
def dashboard(script="app.py", root=ROOT, python=sys.executable):
    """The app, or another script, served as :func:`server` does; yields its address."""
    with server(script, root, python=python) as (_, port):
        yield f"http://127.0.0.1:{port}"


def find_chromium():
    """Path of Chromium or Chrome on this machine, or None."""
    return next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )


@contextmanager
def browser_page(width=1440, height=900, theme="light"):
    """A page in the machine's own Chromium, whose user likes pages light or dark."""
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=find_chromium(), args=["--no-sandbox"])
        size = {"width": width, "height": height}
        page = browser.new_page(viewport=size, color_scheme=theme)
        yield page
        browser.close()


QUIET = """() => {
    const quiet = document.querySelector(
            "[data-testid='stApp'][data-test-script-state='notRunning']")
        && !document.querySelector("[data-testid='stSpinner'], [data-testid='stSkeleton']")
        && !document.body.innerText.includes('Compiling the solver')
        && document.querySelector("[data-testid='stMain'] h1")
        && ![...document.querySelectorAll('.spab-picture')].some(p => p.checkVisibility())
        && [...document.querySelectorAll('.stPlotlyChart')].every(
            c => !c.checkVisibility() || c.querySelector('.main-svg'));
    if (!quiet) window.spabQuiet = 0;
    else window.spabQuiet ||= Date.now();
    return quiet && Date.now() - window.spabQuiet > 600; }"""


def settled(page, seconds=180):
    """Wait until for 0.6 s the script has not run, nothing is awaited, the compiler neither, and
    every figure is drawn; a background job may still work."""
    page.evaluate("() => { window.spabQuiet = 0; }")
    page.wait_for_function(QUIET, polling=50, timeout=1000 * seconds)


def pages():
    """Address of each page by its name, home first: its own file, then pages/ in their order."""
    return {"start": ""} | {
        path.stem.partition("_")[2].lower(): path.stem.partition("_")[2]
        for path in sorted((ROOT / "pages").glob("*.py"))
    }


def _compare(page):
    """On the surrogate map: compare the chosen point and wait for its interval."""
    page.get_by_role("button", name="Compare at").click()
    page.get_by_text("interval, ").wait_for(timeout=120_000)


def _map(page):
    """On My map: two minutes of a real map."""
    page.get_by_label("Minutes", exact=True).fill("2")
    page.get_by_label("Minutes", exact=True).press("Enter")
    settled(page)
    page.get_by_role("button", name="Map this bearing").click()
    page.get_by_text("Solve this point").wait_for(timeout=300_000)


def _what_if(page):
    """On What if: how the margin moves with the drawing."""
    ask = page.get_by_role("button", name="Compute the sensitivity")
    if ask.count():  # it starts by itself where it is short
        ask.click()
    page.locator(".st-key-tornado .main-svg").first.wait_for(timeout=300_000)


def shoot(page, path):
    """A screenshot in 256 colours: a third of the bytes, and no difference to be seen."""
    page.mouse.move(0, 0)
    page.wait_for_timeout(300)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(
        path, optimize=True
    )
    print(f"{path.relative_to(ROOT)} {path.stat().st_size:,}")


POINT = "bearing_number=4.5&rotor_mass=18"  # of the pictures: in the chaotic band
OWN = "bearing_number=3.45&rotor_mass=4.52&bearing.clearance=3e-05"  # of those of one's own bearing
OF_OWN = ("my_map", "my_bearing", "what_if", "tolerances_and_improvements")
BEFORE = {"surrogate_map": _compare, "my_map": _map, "what_if": _what_if}


def main(wanted):
    target = ROOT / "docs" / "pictures"
    target.mkdir(exist_ok=True)
    with (
        TemporaryDirectory() as jobs,
        patch.dict(os.environ, SPAB_JOBS=jobs),
        dashboard() as address,
        browser_page() as page,
    ):
        for name, place in pages().items():
            if wanted and name not in wanted:
                continue
            page.goto(f"{address}/{place}?{OWN if name in OF_OWN else POINT}")
            settled(page)
            if name in BEFORE:
                BEFORE[name](page)
                settled(page)
            shoot(page, target / f"{name}{'' if place else '_light'}.png")
    if wanted and "start" not in wanted:
        return
    with dashboard() as address, browser_page(theme="dark") as page:
        page.goto(f"{address}/?{POINT}")
        settled(page)
        shoot(page, target / "start_dark.png")


if __name__ == "__main__":
    main(sys.argv[1:])  # names of pages; none: all
