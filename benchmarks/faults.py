"""Kills commands, workers and the dashboard at random moments, gives the same command again, and
compares the end.

    python benchmarks/faults.py --kills 50 --seed 1

Each kind of work runs in a folder of its own until the moment comes; then its process is killed
(SIGKILL) and started again. At every kill: no file under its final name is cut short, nothing
finished before is gone, no process of the killed one lives on. Where a run reaches its end its
files must be those of an undisturbed one, to the bit; then the next begins in an empty folder."""

from __future__ import annotations

import argparse
import asyncio
import collections
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
import zipfile
from pathlib import Path

import joblib
import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parent.parent)]
from session import User  # noqa: E402

from spab_core.jobs import store as jobs  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
OPTIONS = ["--mesh", "2x16", "--transient", "30", "--revolutions", "20"]
PLANE = ["--bearing-number", "2:4.5:10", "--rotor-mass", "3:18:15"]
LARGE = [
    "--bearing-number",
    "2:4.5:30",
    "--rotor-mass",
    "3:18:30",
]  # as long as the start of the command
LINE = {
    "vary": "rotor-mass",
    "at": 3.0,
    "range": "4:12:30",
    "settings": {"mesh": "2x16", "transient": 30, "revolutions": 40, "early_stop": False},
}
COMMANDS = {
    "map": ["map", *LARGE, *OPTIONS, "--workers", "2", "--out", "out.npz"],
    "refine": ["refine", *PLANE, *OPTIONS, "--budget", "60", "--seed", "1", "--out", "out.npz"],
    "train": ["train", "--model", "neighbours", "--divisor", "8", "--out", "out.joblib"],
}
MADE = (
    "date",
    "wall_seconds",
    "worker_seconds",
    "workers",
    "seconds",
)  # how a file was made, not what it says
WAIT = 120.0


def contents(path: Path) -> dict:
    """Raw bytes of every array of an NPZ file by name; its metadata as a dictionary, without how it
    was made.
    """
    with zipfile.ZipFile(path) as file:
        found = {name: file.read(name) for name in file.namelist() if name != "metadata.npy"}
    with np.load(path, allow_pickle=False) as file:
        about = json.loads(str(file["metadata"])) if "metadata" in file else {}
    return found | {"metadata": {k: v for k, v in about.items() if k not in MADE}}


def answer(folder: Path) -> dict:
    """What the finished work in a folder says: of a model its predictions, of anything else every
    array.
    """
    model = folder / "out.joblib"
    if not model.exists():
        return contents(next(p for p in (folder / "out.npz", folder / "result.npz") if p.exists()))
    at = np.random.default_rng(0).uniform([0.1, 0.2], [8.0, 24.0], (500, 2))
    estimator = joblib.load(model)  # written by this script's own command
    return {"predictions": np.asarray(estimator.predict(at)).tobytes()}


def check_whole(folder: Path) -> set[str]:
    """Names of the finished parts in a folder; every file under its final name must be whole."""
    for path in folder.rglob("*"):
        if not path.is_file() or path.name.startswith(
            "."
        ):  # .name.xyz.tmp is a file that was being written
            continue
        if path.suffix == ".npz":
            contents(path)
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".joblib":
            joblib.load(path)
    return {path.name for path in folder.rglob("chunk-*.npz")}


def family(pid: int) -> set[int]:
    """A process and all that it has started."""
    children = collections.defaultdict(list)
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            children[int(fields[1])].append(int(path.parent.name))
    found, open_ = set(), [pid]
    while open_:
        found.add(open_[-1])
        open_ += children[open_.pop()]
    return found


def lives(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def kill(pid: int) -> None:
    """Kill a process; what it has started must end by itself."""
    left = family(pid) - {pid}
    os.kill(pid, signal.SIGKILL)
    end = time.monotonic() + 30.0
    while any(map(lives, left)):
        assert time.monotonic() < end, f"processes of the killed one live on: {left}"
        time.sleep(0.1)


class Work:
    """One kind of work; ``begin`` starts it or goes on, ``done`` is asked between."""

    def __init__(self, name: str, base: Path):
        self.name, self.base, self.turn, self.kills, self.ends = name, base, 0, 0, 0
        self.expected: dict | None = None
        self.seconds = 0.0
        self.fresh()

    def fresh(self) -> None:
        """A new empty folder."""
        self.turn += 1
        self.folder = self.base / f"{self.name}-{self.turn}"
        self.folder.mkdir(mode=0o700)
        self.parts: set[str] = set()

    def environment(self) -> dict[str, str]:
        """Of its processes."""
        return os.environ | {"PYTHONPATH": str(ROOT), "SPAB_JOBS": str(self.folder)}

    def begin(self) -> None:
        """Start the process."""
        with (self.base / "log.txt").open("a") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "spab_core.cli.main", *COMMANDS[self.name]],
                cwd=self.folder,
                env=self.environment(),
                stdout=log,
                stderr=log,
            )

    def done(self) -> bool:
        """Whether the work has reached its end."""
        if self.process.poll() is None:
            return False
        assert self.process.returncode == 0, (
            f"{self.name}: exit {self.process.returncode}, see {self.base / 'log.txt'}"
        )
        return True

    def stop(self) -> None:
        """Kill it."""
        kill(self.process.pid)
        self.process.wait()

    def result(self) -> Path:
        """Folder of the result."""
        return self.folder

    def finish(self) -> None:
        """Compare with the first end, which was undisturbed."""
        found = answer(self.result())
        if self.expected is None:
            self.expected = found
        assert found == self.expected, (
            f"{self.name}: another result than an undisturbed run in {self.folder}"
        )
        self.ends += 1
        self.fresh()

    def after_kill(self) -> None:
        """What must hold then."""
        self.kills += 1
        parts = check_whole(self.folder)
        assert (
            parts >= self.parts
            or (self.result() / "result.npz").exists()
            or (self.folder / "out.npz").exists()
        ), f"{self.name}: finished parts are gone: {self.parts - parts}"
        self.parts = parts

    def until_done(self) -> None:
        """Wait for the end."""
        end = time.monotonic() + WAIT
        while not self.done():
            assert time.monotonic() < end, f"{self.name} does not end"
            time.sleep(0.02)


class WorkerKilled(Work):
    """A background job whose worker is killed."""

    def begin(self) -> None:
        os.environ["SPAB_JOBS"] = str(self.folder)
        self.job = jobs.submit("bifurcation", LINE).id

    def done(self) -> bool:
        os.environ["SPAB_JOBS"] = str(self.folder)
        job = jobs.find(self.job)
        assert job.state != "failed", f"job: {job.message}"
        return job.state == "done"

    def stop(self) -> None:
        worker = jobs._workers[self.job]
        if worker.poll() is None:
            kill(worker.pid)
        worker.wait()

    def result(self) -> Path:
        return self.folder / self.job


class ServerKilled(Work):
    """A map started on a page; the dashboard's server is killed, the job goes on, and the page
    opens again on a new server.
    """

    port = 0

    def begin(self) -> None:
        with (self.base / "log.txt").open("a") as log:
            self.process = subprocess.Popen(
                [
                    sys.executable,
                    "-m",
                    "streamlit",
                    "run",
                    "app.py",
                    "--server.port",
                    str(self.port),
                    "--server.headless",
                    "true",
                ],
                cwd=ROOT,
                env=self.environment(),
                stdout=log,
                stderr=log,
            )
        self.asked = False

    def done(self) -> bool:
        assert self.process.poll() is None, "the server has ended by itself"
        if not self.asked:
            try:
                urllib.request.urlopen(
                    f"http://127.0.0.1:{self.port}/_stcore/health", timeout=1
                ).close()
            except OSError:
                return False
            asyncio.run(self.click())
            self.asked = True
        return any(
            json.loads(p.read_text())["state"] == "done" for p in self.folder.glob("map-*/job.json")
        )

    async def click(self) -> None:
        user = User(self.port)
        await user.connect()
        await user.open("My_map")
        await user.set("own_numbers", "2:4:8")
        await user.set("own_masses", "3:9:12")
        if "own_map_start" in user.ids:
            await user.run(button="own_map_start")
        user.close()
        assert not user.errors and not user.red, (user.errors, user.red)

    def stop(self) -> None:
        workers = {json.loads(p.read_text())["pid"] for p in self.folder.glob("map-*/job.json")}
        os.kill(self.process.pid, signal.SIGKILL)  # and not what it has started: jobs outlive it
        self.process.wait()
        time.sleep(0.2)
        for path in self.folder.glob("map-*/job.json"):
            data = json.loads(path.read_text())
            assert (
                data["pid"] not in workers
                or data["state"] == "done"
                or data["pid"] is None
                or lives(data["pid"])
            ), "the job has ended with the server"

    def finish(self) -> None:
        self.process.terminate()
        self.process.wait()
        super().finish()

    def result(self) -> Path:
        return next(self.folder.glob("map-*"), self.folder)


KINDS = {"map": Work, "refine": Work, "train": Work, "worker": WorkerKilled, "app": ServerKilled}


def run(kills: int, seed: int, base: Path, kinds: list[str], tell=print) -> dict[str, Work]:
    """Kill ``kills`` times at moments drawn by ``seed``; the works, each with its kills and its
    ends, all compared.
    """
    draw = random.Random(seed)
    works = {name: KINDS[name](name, base) for name in kinds}
    before = os.environ.get("SPAB_JOBS")
    try:
        for work in works.values():  # undisturbed
            began = time.monotonic()
            work.begin()
            work.until_done()
            work.seconds = time.monotonic() - began
            work.finish()
            tell(f"{work.name}: {work.seconds:.1f} s undisturbed")
        done = 0
        while done < kills:
            work = works[kinds[done % len(kinds)]]
            moment = time.monotonic() + draw.uniform(0.0, 1.05 * work.seconds)
            work.begin()
            while not (ended := work.done()) and time.monotonic() < moment:
                time.sleep(0.01)
            if ended:
                work.finish()
                continue
            work.stop()
            work.after_kill()
            done += 1
            tell(f"{done}: {work.name}, {len(work.parts)} parts kept")
        for work in works.values():
            work.begin()
            work.until_done()
            work.finish()
    finally:
        if before is None:
            os.environ.pop("SPAB_JOBS", None)
        else:
            os.environ["SPAB_JOBS"] = before
    return works


def main() -> None:
    """Run and print how many kills and ends of each kind there were."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--port", type=int, default=8622, help="of the dashboard's server")
    args = parser.parse_args()
    ServerKilled.port = args.port
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as base:
        works = run(args.kills, args.seed, Path(base), args.kinds.split(","))
    for work in works.values():
        print(f"{work.name}: killed {work.kills} times, {work.ends} ends, all the same to the bit")
    print(f"{sum(w.kills for w in works.values())} kills in {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
