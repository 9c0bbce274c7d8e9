"""Seconds from an empty clone to a usable map and to the first answers, on a machine without
kernels.

    python benchmarks/first_run.py

Clones the commit at hand into a temporary folder, makes its venv with ``make .venv/.ready``, starts
the server as ``make run`` does, without opening a browser, and looks at the page in Chromium. The
kernels' folder, jobs and models are empty ones of the clone's. Packages come from the index or
cache that pip is set up with: the venv's seconds are as good as that is."""

import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))
from take_pictures import browser_page, free_port  # noqa: E402


def main():
    rows, began = [], time.perf_counter()

    def took(what):
        rows.append((what, time.perf_counter() - began - sum(seconds for _, seconds in rows)))
        print(f"{rows[-1][1]:7.1f} s  {what}", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder) / "spab"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(home)], check=True)
        took("clone, from this disk")
        subprocess.run(
            ["make", "--silent", ".venv/.ready"], cwd=home, check=True, stdout=subprocess.DEVNULL
        )
        took("venv and packages")
        port = free_port()
        own = {
            "NUMBA_CACHE_DIR": f"{folder}/kernels",
            "SPAB_JOBS": f"{folder}/jobs",
            "SPAB_CACHE": f"{folder}/models",
        }
        server = subprocess.Popen(
            [".venv/bin/spab", "dashboard", "--port", str(port), "--headless"],
            cwd=home,
            env=os.environ | own,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            address = f"http://127.0.0.1:{port}"
            while True:
                try:
                    urllib.request.urlopen(f"{address}/_stcore/health", timeout=1).close()
                    break
                except OSError:
                    time.sleep(0.05)
                    assert server.poll() is None, "the server has ended"
            took("server up")
            with browser_page() as page:
                took("Chromium open")
                page.goto(address)
                page.wait_for_selector("[data-answers]", timeout=120_000)
                took("map there, takes clicks")
                page.get_by_text("From the shipped map").wait_for(timeout=120_000)
                took("first answer: known")
                page.get_by_text("Solved live").wait_for(timeout=900_000)
                took("first answer: solved")
        finally:
            server.terminate()
            server.wait(20)
    print(f"{sum(seconds for _, seconds in rows):7.1f} s  in all")


if __name__ == "__main__":
    main()
