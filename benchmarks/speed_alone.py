"""What each measure that is there for speed or memory alone saves a user: the dashboard with it and
without, in turns, in one run.

    python benchmarks/speed_alone.py [--turns 5] [--users 20] [--minutes 1.5] [--only browser|load]

This checkout is served several times, each time with one measure taken out of its sources as they
are imported:

pictures    plain pictures until the browser has Plotly (ui/plain_picture.py)
arenas      few arenas, large blocks given back, no allocator of pyarrow's (ui/memory.py)
garbage     modules and caches not searched for garbage (ui/memory.py)
together    both of ui/memory.py

Pictures are measured in Chromium: seconds of a first view in a new browser and again, of a click,
and megabytes sent; the others under users at once, sessions over Streamlit's websocket (load.py).
ui/clicks.py is not here: Streamlit tells no click on a heatmap, so there is nothing without it."""

import argparse
import asyncio
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "docs")]
from load import load, memory  # noqa: E402
from playwright.sync_api import Browser, Page, TimeoutError, sync_playwright  # noqa: E402
from take_pictures import find_chromium, server  # noqa: E402

PICTURE = "spab_core/ui/plain_picture.py"
SHARED = "spab_core/ui/shared.py"
_CUSTOMIZE = """
from importlib.machinery import SourceFileLoader

def get_data(self, path, read=SourceFileLoader.get_data):
    data = read(self, path)
    for name, there, instead in {!r}:
        if path.endswith(name):
            data = data.replace(there.encode(), instead.encode())
    return data

SourceFileLoader.get_data = get_data
"""
_ALWAYS = (PICTURE, "return bool(st.session_state.get(_READY))", "return True")
_NOWHERE = (PICTURE, "    if html:\n", "    if False:\n")
_ARENAS = (SHARED, "    bound_memory()\n", "")
_GARBAGE = (SHARED, "    spare_lasting_objects(title)\n", "")
WITHOUT = {  # file, what stands there, what stands there instead
    "as it is": (),
    "pictures": (_ALWAYS, _NOWHERE),
    "arenas": (_ARENAS,),
    "garbage": (_GARBAGE,),
    "together": (_ARENAS, _GARBAGE),
}
BROWSER, LOAD = ("as it is", "pictures"), ("as it is", "arenas", "garbage", "together")

_SEEN = """() => document.querySelector('.st-key-map .heatmaplayer image')
    || [...document.querySelectorAll('.st-key-map_box .spab-picture img')]
        .some(image => image.complete && image.checkVisibility())"""
_ANSWERS = {
    "as it is": "() => document.querySelector('.st-key-map_box[data-answers]')",
    "pictures": "() => document.querySelector('.st-key-map .js-plotly-plot')?.spabClicked",
}
_AT = """([x, y]) => {
    const places = document.querySelectorAll('.st-key-map_box .spab-plot, .st-key-map .nsewdrag');
    const r = [...places].find(p => p.checkVisibility()).getBoundingClientRect();
    return [r.left + x * r.width, r.top + y * r.height]; }"""
_ANOTHER = """old => [...document.querySelectorAll('[data-testid=stCaptionContainer]')].some(
    c => c.innerText.startsWith('Solved live') && c.innerText !== old)"""


def environment_without(measure: str, folder: Path) -> dict[str, str]:
    """Return the environment of a server that lacks a measure, with jobs and models of its own."""
    for name, there, _ in WITHOUT[measure]:
        assert there in (ROOT / name).read_text(), f"{name} does not say {there!r} any more"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(_CUSTOMIZE.format(WITHOUT[measure]))
    names = {"SPAB_JOBS": "jobs", "SPAB_CACHE": "models", "PYTHONPYCACHEPREFIX": "compiled"}
    return {key: str(folder / name) for key, name in names.items()} | {
        "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])
    }


def view(page: Page, address: str, measure: str, note: Callable[[str, float], None]) -> None:
    """Open the page, click once; seconds of what is waited for, megabytes received."""
    received = [0]

    def listen(socket) -> None:
        socket.on("framereceived", lambda data: received.__setitem__(0, received[0] + len(data)))

    page.on("websocket", listen)
    began = time.perf_counter()
    page.goto(address)
    page.wait_for_function("() => document.body.innerText.includes('Solved live')")
    note("verdict", time.perf_counter() - began)
    page.wait_for_function(_SEEN)
    note("map seen", time.perf_counter() - began)
    page.wait_for_function(_ANSWERS[measure])
    note("map answers clicks", time.perf_counter() - began)
    page.wait_for_timeout(1000)
    note("MB by the websocket, first view", received[0] / 1e6)
    for k in range(2):
        lost = 0
        while lost < 5:
            shares = [0.3 + 0.2 * k, 0.35 + 0.1 * np.random.default_rng().random()]
            place = page.evaluate(_AT, shares)
            old = page.get_by_text("Solved live").first.inner_text()
            page.mouse.move(*place)
            page.wait_for_timeout(300)
            received[0] = 0
            began = time.perf_counter()
            page.mouse.click(*place)
            try:
                page.wait_for_function(_ANOTHER, arg=old, timeout=10_000)
                break
            except TimeoutError:
                lost += 1
        else:
            raise SystemExit(f"{measure}: five clicks without an answer")
        note("clicks without an answer", lost)
        note("click to verdict", time.perf_counter() - began)
        page.wait_for_timeout(1500)
        note("MB by the websocket, a click", received[0] / 1e6)


def in_browser(turns: int, folder: Path) -> None:
    """Print the browser's table."""
    found: dict[str, dict[str, list[float]]] = {measure: {} for measure in BROWSER}
    with ExitStack() as stack, sync_playwright() as play:
        ports = {}
        for measure in BROWSER:
            own = environment_without(measure, folder / measure)
            ports[measure] = stack.enter_context(server(**own))[1]
        browser = play.chromium.launch(executable_path=find_chromium(), args=["--no-sandbox"])
        for turn in range(turns + 1):
            for measure in BROWSER:
                walk(browser, ports[measure], measure, found[measure] if turn else {})
    first = {what: statistics.median(s) for what, s in found["as it is"].items()}
    print(f"{'':44s}" + "".join(f"{measure:>22s}" for measure in BROWSER))
    for what, own in first.items():
        if what.endswith("without an answer"):
            told = "".join(f"{sum(found[measure][what]):12.0f}" + " " * 10 for measure in BROWSER)
        else:
            medians = [statistics.median(found[measure][what]) for measure in BROWSER]
            told = "".join(f"{value:12.2f} ({value / own:5.2f} x)" for value in medians)
        print(f"{what:44s}{told}", flush=True)


def walk(browser: Browser, port: int, measure: str, found: dict[str, list[float]]) -> None:
    """A new browser's first view, and one more of it."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.set_default_timeout(240_000)
    for which in ("new browser", "again"):
        page = context.new_page()
        view(
            page,
            f"http://127.0.0.1:{port}",
            measure,
            lambda what, value, which=which: found.setdefault(f"{which}: {what}", []).append(value),
        )
        page.close()
    context.close()


def under_load(users: int, minutes: float, folder: Path) -> None:
    """Print the table of many users, the first copy measured again at the end."""
    print(f"{users} users, {minutes:g} min each: clicks, median and 95 % of their seconds, MB")
    for k, measure in enumerate((*LOAD, LOAD[0])):
        with server(**environment_without(measure, folder / f"load {k}")) as (process, port):
            asyncio.run(load(port, process.pid, 2, 60.0))  # compiles, fills caches
            clicks, errors, _, _ = asyncio.run(load(port, process.pid, users, 60.0 * minutes))
            held = memory(process.pid)
        took = np.array([seconds for _, _, seconds in clicks])
        name = f"without {measure}" if k % len(LOAD) else measure
        print(
            f"{name:22s}{len(took):7d}{np.median(took):9.2f}{np.percentile(took, 95):9.2f}"
            f"{held:9.0f}" + (f"  {len(errors)} errors: {errors[0][:100]}" if errors else ""),
            flush=True,
        )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--users", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=1.5)
    parser.add_argument("--only", choices=("browser", "load"))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if args.only != "load":
            in_browser(args.turns, Path(folder))
        if args.only != "browser":
            under_load(args.users, args.minutes, Path(folder))


if __name__ == "__main__":
    main()
