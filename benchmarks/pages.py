"""Seconds that a user waits for the dashboard in Chromium on a warm server: alone, and with a
second user at once.

    python benchmarks/pages.py [--floor | --margins | --against CHECKOUT]

The second user is measured twice: at another machine, whose browser takes nothing from this one's
cores, as a session over Streamlit's websocket that fetches the scripts, opens pages and sets points
without a pause longer than half a second; and in a second Chromium on the same cores, which are the
server's too, that begins each action in the same moment. All are measured in turns, as the
machine's clock drifts.

With ``--floor`` only what Streamlit and Plotly take by themselves, alone and with a second browser
that opens the page in the same moment: the first view of an empty page, and of one with a chart of
two points.

With ``--margins``: from an address that is opened to the verdict, to the first margin (the nearest
trouble, solved between 0.8 and 1.25 times speed and mass) and to the whole one, for the machine of
4 kg at 20,000 rpm and for points of the example bearing, each new to the server.

With ``--against`` the same walk alone, in turns on this dashboard and on that of another checkout,
served by the Python in its ``.venv``. Pages go by the names of their files; those that only one of
them has are left out."""

import argparse
import asyncio
import math
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path

from playwright.async_api import async_playwright
from session import User
from tornado.httpclient import AsyncHTTPClient

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))
from take_pictures import dashboard, find_chromium, server  # noqa: E402

VIEW = ("verdict", "map seen", "map answers clicks")
GOALS = {f"{which}: {what}": 2.0 for which in ("new browser", "first view") for what in VIEW} | {
    "click to live verdict": 1.0,
    "click on the plain picture": 1.0,
    "another layer drawn": 2.0,
}
SWITCH, NEW, VIEWS, TURNS = 1.0, 3, 4, 3
OWN = "bearing.radius=0.04&bearing.clearance=2.5e-05&bearing.supply_pressure_ratio=6.92154"
MARGINS = [  # names and addresses of points
    ("4 kg at 20,000 rpm", f"{OWN}&rotor_mass=4&bearing_number=5.8721"),
    *(
        (f"example, {mass:g} kg, Λ {number:g}", f"rotor_mass={mass:g}&bearing_number={number:g}")
        for mass, number in ((4.1, 1.9), (3.2, 7.4), (12.0, 2.2), (18.0, 5.0))
    ),
]
DONE = "document.body.innerText.includes('Solved live')"
CLICKS = [(7.0, 6.0), (18.0, 4.5), (2.0, 5.0)]  # kg, bearing number
DRAWN = """layer => { const plot = document.querySelector('.st-key-map .js-plotly-plot');
    return plot && plot.calcdata && plot._fullData.some(t => t.type === 'heatmap')
        && plot._fullData.some(t => t.name === 'chaotic') === (layer === 'Regime'); }"""
SHOWN = """[...document.querySelectorAll('.st-key-map_box .spab-picture img')]
    .some(image => image.complete && image.checkVisibility())"""
SEEN = f"() => document.querySelector('.heatmaplayer image') || {SHOWN}"
ANSWERS = f"() => document.querySelector('.st-key-map_box[data-answers]') && {SHOWN}"
PICTURE = """([x, y]) => {
    const r = document.querySelector('.st-key-map_box .spab-plot').getBoundingClientRect();
    return [r.left + x * r.width, r.top + y * r.height]; }"""
AT_REST = """old => { const title = document.querySelector('[data-testid=stMain] :is(h1, h4)');
    return title && title.innerText !== old
        && document.querySelector('[data-test-script-state=notRunning]'); }"""


async def now(together):
    """The moment that an action begins, for both users where there are two."""
    if together:
        await together.wait()
    return time.perf_counter()


async def click_cell(page, mass, number, together):
    """Click the map at a point; seconds until the answer to another point stands there."""
    position = await page.evaluate(
        """([x, y]) => {
        const plot = document.querySelector('.st-key-map .js-plotly-plot');
        const layout = plot._fullLayout;
        const box = plot.querySelector('.nsewdrag').getBoundingClientRect();
        return [box.left + layout.xaxis.d2p(x), box.top + layout.yaxis.d2p(y)]; }""",
        [number, mass],
    )
    await page.mouse.move(*position)
    await page.wait_for_timeout(300)
    return await click(page, position, together)


async def click(page, position, together):
    """Seconds from a click to the answer to another point."""
    old = await page.get_by_text("Solved live").inner_text()
    began = await now(together)
    await page.mouse.click(*position)
    await page.wait_for_function(
        """old => [...document.querySelectorAll('[data-testid=stCaptionContainer]')].some(
        c => c.innerText.startsWith('Solved live') && c.innerText !== old)""",
        arg=old,
        timeout=60_000,
    )
    return time.perf_counter() - began


async def journey(browser, address, shift, together=None):
    """One user's walk; seconds by action.

    ``shift`` moves the clicked cells: a point solved before is not solved again.
    """
    found: dict[str, list[float]] = {}

    def took(action, began):
        found.setdefault(action, []).append(time.perf_counter() - began)

    for k in range(NEW + VIEWS):
        if k < NEW:  # later ones find the scripts in the browser
            context = await browser.new_context(viewport={"width": 1440, "height": 900})
        page = await context.new_page()
        began = await now(together)
        await page.goto(address)

        async def until(what, there, which="new browser" if k < NEW else "first view", began=began):
            await there
            took(f"{which}: {what}", began)

        await asyncio.gather(
            until(VIEW[0], page.get_by_text("Solved live").wait_for(timeout=60_000)),
            until(VIEW[1], page.wait_for_function(SEEN, timeout=60_000)),
            until(VIEW[2], page.wait_for_function(ANSWERS, timeout=60_000)),
        )
        place = await page.evaluate(PICTURE, [0.2 + 0.06 * k, 0.2 + 0.04 * shift])
        found.setdefault("click on the plain picture", []).append(
            await click(page, place, together)
        )
        await page.wait_for_timeout(1000)
        if k < NEW - 1:
            await context.close()
        elif k < NEW + VIEWS - 1:
            await page.close()
    began = await now(together)
    await page.mouse.move(*await page.evaluate(PICTURE, [0.5, 0.5]))
    await page.wait_for_function(DRAWN, arg="MLE", timeout=60_000)
    took("pointer rests: hover and zoom", began)
    await page.wait_for_timeout(1000)
    for mass, number in CLICKS:
        seconds = await click_cell(page, mass + 0.1 * shift, number + 0.03 * shift, together)
        found.setdefault("click to live verdict", []).append(seconds)
        await page.wait_for_timeout(500)
    for layer in ("Regime", "MLE"):
        began = await now(together)
        await (
            page.get_by_role("radio", name=layer, exact=True)
            .or_(page.get_by_text(layer, exact=True))
            .first.click()
        )
        await page.wait_for_function(DRAWN, arg=layer, timeout=60_000)
        took("another layer drawn", began)
        await page.wait_for_timeout(500)
    links = page.locator(
        "[data-testid=stSidebarNavLink], [data-testid=stSidebar] [data-testid=stPageLink-NavLink]"
    )
    names = [
        (await links.nth(k).get_attribute("href")).rstrip("/").rpartition("/")[2]
        for k in range(await links.count())
    ]
    for k in [*range(1, len(names)), 0]:
        old = await page.locator("[data-testid=stMain] :is(h1, h4)").first.inner_text()
        began = await now(together)
        await links.nth(k).click()
        await page.wait_for_function(AT_REST, arg=old, timeout=60_000)
        took(f"to page: {names[k] if k else 'Start'}", began)
        await page.wait_for_timeout(500)
    await context.close()
    return found


async def remote(address):
    """A user at another machine, until cancelled."""
    http, k = AsyncHTTPClient(), 0
    while True:
        index = (await http.fetch(address)).body.decode()
        for script in re.findall(r'"\./(static/[^"]+)"', index):
            await http.fetch(f"{address}/{script}")
        user = User(int(address.rpartition(":")[2]))
        await user.connect()
        await user.open("")
        for layer in ("Regime", "MLE", "Regime", "MLE"):
            k += 1
            await user.set("rotor_mass", 3.0 + 0.07 * (k % 300))
            await asyncio.sleep(0.5)
            await user.set("layer", [layer])
            await asyncio.sleep(0.5)
        for name in list(user.hashes):
            await user.open(name)
            await asyncio.sleep(0.5)
        user.close()
        assert not user.errors, user.errors


async def measure(address):
    async with async_playwright() as p:
        browser = await p.chromium.launch(executable_path=find_chromium(), args=["--no-sandbox"])
        await journey(browser, address, 0)  # warms the server
        found: list[dict[str, list[float]]] = [
            {},
            {},
            {},
        ]  # alone, with a user elsewhere, with a second browser
        for turn in range(TURNS):
            walks = [[await journey(browser, address, 4 * turn + 1)]]
            other = asyncio.create_task(remote(address))
            walks.append([await journey(browser, address, 4 * turn + 2)])
            assert not other.done(), other.exception()
            other.cancel()
            both = asyncio.Barrier(2)
            walks.append(
                await asyncio.gather(
                    *(journey(browser, address, 4 * turn + k, both) for k in (3, 4))
                )
            )
            for kept, walked in zip(found, walks, strict=True):
                for one in walked:
                    for action, seconds in one.items():
                        kept.setdefault(action, []).extend(seconds)
        await browser.close()
    return found


EMPTY = "import streamlit as st\n\nst.write('Solved live')\n"
CHART = (
    EMPTY
    + "import plotly.graph_objects as go\n\nst.plotly_chart(go.Figure(go.Scatter(x=[1, 2], y=[3, "
    "4])))\n"
)


async def first_views(address, drawn, count=VIEWS + 1, together=None):
    """Seconds of first views in one browser, which is new for the first; ``together``: a barrier
    before each.
    """
    async with async_playwright() as p:
        browser = await p.chromium.launch(executable_path=find_chromium(), args=["--no-sandbox"])
        context, found = await browser.new_context(viewport={"width": 1440, "height": 900}), []
        for _ in range(count):
            page = await context.new_page()
            began = await now(together)
            await page.goto(address)
            await page.wait_for_function(drawn, timeout=60_000)
            found.append(time.perf_counter() - began)
            await page.wait_for_timeout(1000)
            await page.close()
        await browser.close()
    return found


async def at_once(address, drawn, users):
    together = asyncio.Barrier(users)
    return await asyncio.gather(
        *(first_views(address, drawn, together=together) for _ in range(users))
    )


def floor():
    for name, text, drawn in (
        ("empty page", EMPTY, "() => document.body.innerText.includes('Solved live')"),
        ("chart of two points", CHART, "() => document.querySelector('.js-plotly-plot')?.calcdata"),
    ):
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder) / "page.py"
            script.write_text(text)
            with dashboard(script=script) as address:
                asyncio.run(first_views(address, drawn, 1))  # warms the server
                ((first, *later),) = asyncio.run(at_once(address, drawn, 1))
                two = asyncio.run(at_once(address, drawn, 2))
        again, with_second = statistics.median(later), statistics.median(two[0][1:] + two[1][1:])
        print(
            f"{name}: new browser {first:.2f} s, again {again:.2f} s; with a second browser "
            f"{with_second:.2f} s, {with_second / again:.1f} times as long"
        )


async def walks(addresses):
    """What each of some dashboards takes, walked alone in turns: lists of seconds by action."""
    async with async_playwright() as p:
        browser = await p.chromium.launch(executable_path=find_chromium(), args=["--no-sandbox"])
        found = [{} for _ in addresses]
        for turn in range(TURNS + 1):
            for kept, address in zip(found, addresses, strict=True):
                walked = await journey(browser, address, turn)
                for action, seconds in walked.items() if turn else ():  # the first warms the server
                    kept.setdefault(action, []).extend(seconds)
        await browser.close()
    return found


async def first_margins(address):
    """Seconds to verdict, first margin and whole margin of some points."""
    async with async_playwright() as p:
        browser = await p.chromium.launch(executable_path=find_chromium(), args=["--no-sandbox"])
        for name, query in MARGINS:
            context = await browser.new_context(viewport={"width": 1440, "height": 900})
            page, took = await context.new_page(), []
            began = time.perf_counter()
            await page.goto(f"{address}/?{query}")
            # looked for four times a second: at each frame it would take a core of its own
            for there in (
                "Solved live",
                "Solved margin:",
                "All limits, and what was not looked at",
            ):
                await page.wait_for_function(
                    "words => document.body.innerText.includes(words)",
                    arg=there,
                    timeout=120_000,
                    polling=250,
                )
                took.append(time.perf_counter() - began)
            headline = await page.get_by_text("Solved margin:").first.inner_text()
            print(
                f"{name}: verdict after {took[0]:.1f} s, first margin {took[1]:.1f} s, whole "
                f"margin {took[2]:.1f} s. {headline}"
            )
            await context.close()
        await browser.close()


def margins():
    with tempfile.TemporaryDirectory() as folder, server(SPAB_JOBS=folder) as (_, port):
        address = f"http://127.0.0.1:{port}"
        asyncio.run(first_views(address, f"() => {DONE}", 1))  # warms the server
        asyncio.run(first_margins(address))


def against(other):
    with dashboard() as address, dashboard(root=other, python=other / ".venv/bin/python") as before:
        new, old = asyncio.run(walks([address, before]))
    print(f"{'':34s} {'that one':>9s} {'this one':>9s}")
    for action in (action for action in new if action in old):
        a, b = statistics.median(old[action]), statistics.median(new[action])
        print(f"{action:34s} {a:8.2f}s {b:8.2f}s {b / a:6.2f} x")
    for name, one, rest in (("that", old, new), ("this", new, old)):
        print(f"only {name} one:", ", ".join(action for action in one if action not in rest))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--floor", action="store_true")
    parser.add_argument("--margins", action="store_true")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT")
    asked = parser.parse_args()
    if asked.floor:
        return floor()
    if asked.margins:
        return margins()
    if asked.against:
        return against(asked.against.resolve())
    with dashboard() as address:
        one, beside, both = asyncio.run(measure(address))
    print(f"{'':34s} {'alone':>7s} {'goal':>6s} {'second elsewhere':>17s} {'on these cores':>17s}")
    for action, seconds in one.items():
        goal, alone = (
            GOALS.get(action, SWITCH if action.startswith("to page") else math.inf),
            statistics.median(seconds),
        )
        told = [f"{action:34s} {alone:6.2f}s {goal:5.1f}s"]
        for found in (beside, both):
            together = statistics.median(found[action])
            told.append(f"{together:8.2f}s {together / alone:5.1f} x")
        print(
            *told,
            "" if alone <= goal and statistics.median(beside[action]) < 2.0 * alone else " missed",
        )


if __name__ == "__main__":
    main()
