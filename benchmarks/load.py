"""Many users at once on a server of its own: the 95th percentile of a click, errors shown, memory
of the server.

    python benchmarks/load.py --users 20 --minutes 10

Each user is a session over Streamlit's websocket (session.py) on 127.0.0.1: opens pages, sets the
operating point, changes layers, thinks for a second or so between. A click lasts from its message
to the end of the page's run."""

from __future__ import annotations

import argparse
import asyncio
import random
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "docs")]
from session import User  # noqa: E402
from take_pictures import server  # noqa: E402

LAYERS = ("Regime", "MLE")
THINK = (0.5, 4.0)  # seconds between two clicks
EVERY = 10.0  # seconds between two looks at the memory


async def act(user: User, draw: random.Random) -> tuple[str, float]:
    """One click of a user: its name and its seconds."""
    what = draw.choices(("open", "mass", "number", "layer", "divisor"), (2, 3, 3, 2, 1))[0]
    if what in ("mass", "number"):
        key, value = (
            ("rotor_mass", round(draw.uniform(1.0, 24.0), 1))
            if what == "mass"
            else ("bearing_number", round(draw.uniform(0.5, 8.0), 2))
        )
        if key in user.ids:
            return f"set {key}", await user.set(key, value)
    if what == "layer" and "layer" in user.ids:
        return "layer", await user.set("layer", [draw.choice(LAYERS)])
    if what == "divisor" and "draw" in user.ids:
        return "open a point", await user.open("", f"rotor_mass={draw.uniform(1, 24):.1f}")
    page = draw.choice(sorted(user.hashes)) if user.hashes else ""
    return f"open {page or 'home'}", await user.open(page)


async def one(port: int, number: int, until: float, clicks: list, errors: list, red: list) -> None:
    """A user until the time is up."""
    draw = random.Random(number)
    user = User(port)
    await asyncio.sleep(draw.uniform(0.0, 10.0))  # they do not all come in the same second
    await user.connect()
    try:
        await user.open("")
        while time.monotonic() < until:
            await asyncio.sleep(draw.uniform(*THINK))
            began = time.monotonic()
            name, seconds = await act(user, draw)
            clicks.append((began, name, seconds))
    except Exception as error:
        errors.append(f"user {number} on {user.page or 'home'}: {type(error).__name__}: {error}")
    finally:
        errors += user.errors
        red += user.red
        user.close()


def memory(pid: int) -> float:
    """Resident megabytes of a process."""
    text = Path(f"/proc/{pid}/status").read_text()
    return int(text.split("VmRSS:")[1].split()[0]) / 1e3


async def watch(pid: int, began: float, until: float, seen: list) -> None:
    """Note the memory from time to time."""
    while time.monotonic() < until:
        seen.append((time.monotonic() - began, memory(pid)))
        await asyncio.sleep(EVERY)


async def load(port: int, pid: int, users: int, seconds: float) -> tuple[list, list, list, list]:
    """All users at once."""
    began = time.monotonic()
    clicks: list = []
    errors: list = []
    red: list = []
    seen: list = []
    await asyncio.gather(
        watch(pid, began, began + seconds, seen),
        *(one(port, k, began + seconds, clicks, errors, red) for k in range(users)),
    )
    return clicks, errors, red, seen


def main() -> None:
    """Serve, load, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--users", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=10.0)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as own, (Path(own) / "log.txt").open("w") as log:
        folders = {name: str(Path(own) / name) for name in ("SPAB_JOBS", "SPAB_CACHE")}
        with server(log=log, **folders) as (process, port):
            clicks, errors, red, seen = asyncio.run(
                load(port, process.pid, args.users, 60.0 * args.minutes)
            )
            alive = process.poll() is None
        told = (Path(own) / "log.txt").read_text()
    took = np.array([seconds for _, _, seconds in clicks])
    print(
        f"{args.users} users, {args.minutes:g} min: {len(took)} clicks; seconds of a click: median "
        f"{np.median(took):.2f}, 95 % under {np.percentile(took, 95):.2f}, longest {took.max():.2f}"
    )
    for name in sorted({name for _, name, _ in clicks}):
        these = np.array([seconds for _, n, seconds in clicks if n == name])
        print(
            f"  {name}: {len(these)}, median {np.median(these):.2f}, 95 % "
            f"{np.percentile(these, 95):.2f}"
        )
    print("memory, MB: " + ", ".join(f"{t:.0f} s {size:.0f}" for t, size in seen))
    after = [size for t, size in seen if t >= 60.0]
    if len(after) > 1:
        print(
            f"after the first minute {after[0]:.0f} MB, at the end {after[-1]:.0f} MB: "
            f"{100 * (after[-1] / after[0] - 1):+.1f} %"
        )
    print(
        f"server {'lives' if alive else 'HAS DIED'}; tracebacks in its log: "
        f"{told.count('Traceback')}; "
        f"exceptions and lost sessions: {len(errors)}; other words in red: {len(red)}"
    )
    for words in sorted(set(errors))[:10] + sorted(set(red))[:10]:
        print(f"  {words[:300]}")


if __name__ == "__main__":
    main()
