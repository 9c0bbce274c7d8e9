"""The process that does a job: ``python -m spab_core.jobs.worker FOLDER``.

It takes the job's lock, waits for its turn, runs the job's kind and writes state and progress into
``job.json``; a thread watches for the file ``cancel``."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
from filelock import FileLock, Timeout
from joblib.externals.loky.process_executor import TerminatedWorkerError

from spab_core.common.errors import InputError
from spab_core.common.processes import give_way
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import (
    CANCEL_SECONDS,
    JobError,
    job_folders,
    read_state,
    state_now,
    write_state,
)
from spab_core.maps.checkpoints import remove_checkpoint, remove_temporaries

_WRITE_SECONDS, _LOOK_SECONDS = 0.25, 0.2


class _Report:
    """Writes job.json for two threads, the work and the watch, until the job has ended."""

    def __init__(self, folder: Path, data: dict[str, Any]) -> None:
        self.folder, self.data, self.closed = folder, data, False
        self.lock, self.written = threading.Lock(), 0.0

    def write(self, **changes: object) -> None:
        """Change values of job.json, unless the job has ended."""
        with self.lock:
            if not self.closed:
                self.data |= changes
                self.written = time.monotonic()
                write_state(self.folder, self.data)

    def advance(self, count: int, doing: str = "") -> None:
        """Add to the work done and say what is done now; write job.json at most a few times a
        second.
        """
        self.data["done"] += int(count)
        if doing:
            self.data["message"] = doing
        if time.monotonic() - self.written > _WRITE_SECONDS:
            self.write()

    def set_total(self, total: int, kept: int = 0) -> None:
        """Set how much there is to do, and how much of it an earlier run has done."""
        self.write(total=int(total), done=int(kept), kept=int(kept))

    def end(self, state: str, message: str = "") -> bool:
        """End the job in ``state``; return False if it has already ended."""
        with self.lock:
            if self.closed:
                return False
            self.closed = True
            data = self.data | {"state": state, "message": message, "finished": time.time()}
            try:
                write_state(self.folder, data)
            except OSError as error:
                # a full disk: the job will be found stopped, and goes on from what is kept
                problem = f"job.json could not be written ({error.strerror or error}): {state}"
                print(problem, message, file=sys.stderr)
            return True

    def watch(self) -> None:
        """End this process and its children once the file ``cancel`` exists."""
        while not self.closed:
            if (self.folder / "cancel").exists() and self.end("cancelled"):
                if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
                    os.killpg(os.getpid(), signal.SIGTERM)
                else:  # Windows has no groups
                    for process in psutil.Process().children(recursive=True):
                        with contextlib.suppress(psutil.Error):
                            process.kill()
                os._exit(0)
            time.sleep(_LOOK_SECONDS)


@contextlib.contextmanager
def _turn(report: _Report) -> Iterator[None]:
    """Wait until no other job of the lane runs and no job queued earlier is waiting for it."""
    root, short = report.folder.parent, KINDS[report.data["kind"]].short
    lock = FileLock(root / (".short.lock" if short else ".running.lock"), timeout=0)
    while True:
        with contextlib.suppress(Timeout):
            lock.acquire()
            if not any(_waits(folder, report) for folder in job_folders(root)):
                break
            lock.release()
        if not report.data["message"]:
            names = [KINDS[kind].label.lower() for kind in _running(report)]
            report.write(message=f"waiting for {names[0] if names else 'another job'} to end")
        time.sleep(_LOOK_SECONDS)
    try:
        yield
    finally:
        lock.release()


def _running(report: _Report) -> Iterator[str]:
    """Yield the kinds of the jobs at work in the lane of this one."""
    for folder in job_folders(report.folder.parent):
        with contextlib.suppress(JobError):
            data = read_state(folder)
            if data and data["state"] == "running" and _same_lane(data, report):
                yield data["kind"]


def _same_lane(data: dict[str, Any], report: _Report) -> bool:
    return KINDS[data["kind"]].short == KINDS[report.data["kind"]].short


def _waits(folder: Path, report: _Report) -> bool:
    """Return whether the job in the folder was queued before this one and still waits."""
    if folder == report.folder:
        return False
    with contextlib.suppress(JobError):
        data = read_state(folder)
        if (
            data
            and data["state"] == "queued"
            and _same_lane(data, report)
            and (data["queued"], folder.name) < (report.data["queued"], report.folder.name)
        ):
            return bool(state_now(folder, data)["state"] == "queued")
    return False


def work(folder: Path) -> int:
    """Do the job in a folder; return the exit code: 0 done or nothing to do, 1 failed, 2
    unreadable.
    """
    if not folder.is_dir():
        return 0  # deleted since
    lock = FileLock(folder / ".lock", timeout=CANCEL_SECONDS)
    try:
        lock.acquire()
        data = read_state(folder)
    except (Timeout, JobError) as error:
        print(error, file=sys.stderr)
        return 2
    if data is None or data["state"] != "queued" or (folder / "cancel").exists():
        return 0  # done, or cancelled
    remove_temporaries(folder, "*")
    give_way(5)  # the dashboard goes first
    report = _Report(folder, data)
    report.write(pid=os.getpid())
    threading.Thread(target=report.watch, daemon=True).start()
    kind, log = KINDS[data["kind"]], f"details in {folder / 'log.txt'}"
    try:
        with _turn(report):
            report.write(state="running", started=time.time(), message="")
            # a result that is there: the worker was stopped between its result and its end
            if kind.grows or not (folder / kind.result).is_file():
                kind.run(folder, data["parameters"], report.advance, report.set_total)
        report.end("done")
        remove_checkpoint(folder / "parts")  # now that nobody needs them to go on
        return 0
    except InputError as error:
        message = str(error)
    except TerminatedWorkerError:
        message = f"a worker process died (killed, or out of memory); {kind.again}"
    except OSError as error:
        traceback.print_exc()
        place = error.filename or folder
        message = f"{place}: {error.strerror or error}; {kind.again}; {log}"
    except Exception as error:
        traceback.print_exc()
        message = f"unexpected error: {type(error).__name__}: {error}; {log}"
    report.end("failed", message)
    return 1


if __name__ == "__main__":
    raise SystemExit(work(Path(sys.argv[1]).absolute()))
