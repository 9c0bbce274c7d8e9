"""Long work in a worker process, with its state on disk: it outlives the page that asked for it,
and the server.

A job is a folder: ``job.json`` (request and state), ``log.txt``, what the work keeps, its result.
The name holds a hash of the request, the solver and the version, so nothing is computed twice. Who
holds ``.lock`` writes ``job.json``: the worker while it lives, else whoever starts it. A state
"running" with a free lock is therefore a worker that was stopped from outside. To cancel is to
leave a file ``cancel``; the worker sees it and ends itself and the processes it has started, so
none is signalled by a number that was read from a file."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
from filelock import FileLock, Timeout
from joblib.externals.loky.process_executor import TerminatedWorkerError

from spab_core._version import __version__
from spab_core.common import private_folders as private_folder
from spab_core.common.errors import InputError
from spab_core.common.files import patiently, write_atomically
from spab_core.jobs.kinds import KINDS
from spab_core.maps.checkpoints import remove_checkpoint, remove_temporaries
from spab_core.solver.cache import solver_hash

VARIABLE = "SPAB_JOBS"
STATES = ("queued", "running", "cancelled", "failed", "done")
ACTIVE = ("queued", "running")
STOPPED = "the worker was stopped"
_ID = re.compile(r"[a-z][a-z0-9-]{0,30}-[0-9a-f]{16}")
_MAX_BYTES = 1_000_000  # of a job.json
_START_SECONDS = 120.0  # for a worker to show up, on a busy machine
_WRITE_SECONDS, _LOOK_SECONDS = 0.25, 0.2
_CANCEL_SECONDS = 10.0
# a worker on Windows has no console whose Ctrl+C or end would be its own, and the dashboard goes
# first
_FLAGS = sum(
    getattr(subprocess, name, 0)
    for name in ("CREATE_NO_WINDOW", "CREATE_NEW_PROCESS_GROUP", "BELOW_NORMAL_PRIORITY_CLASS")
)
_workers: dict[str, subprocess.Popen] = {}  # started by this process
# job.json, with the types of its values
_FIELDS: dict[str, tuple] = {
    "kind": (str,),
    "parameters": (dict,),
    "state": (str,),
    "done": (int,),
    "total": (int,),
    "kept": (int,),
    "created": (int, float),
    "queued": (int, float),
    "started": (int, float, type(None)),
    "finished": (int, float, type(None)),
    "message": (str,),
    "pid": (int, type(None)),
}
_LARGEST = 3e10  # of any number there: a date in the year 2920; Windows knows none after 3000


class JobError(InputError):
    """A job that is not there, damaged or in a state that does not allow it; the message says
    which.
    """


@dataclass(frozen=True)
class Job:
    """A job as it stands.

    Attributes
    ----------
    id, kind : str
        ``kind`` is one of ``job_kinds.KINDS``.
    parameters : dict
        Complete, as checked.
    state : str
        One of :data:`STATES`.
    done, total : int
        Of the work's own units; ``total`` is 0 as long as it is not known.
    created, started, finished : float
        Seconds since 1970; the latter two None before. ``started`` is the last start.
    message : str
        What went wrong, or what is waited for.
    folder : Path
        With the kind's result where ``state`` is done.
    size : int
        Bytes on disk.
    seconds_left : float or None
        An estimate from the pace so far.
    """

    id: str
    kind: str
    parameters: dict
    state: str
    done: int
    total: int
    created: float
    started: float | None
    finished: float | None
    message: str
    folder: Path
    size: int
    seconds_left: float | None

    @property
    def active(self) -> bool:
        """Whether it is queued or running."""
        return self.state in ACTIVE

    @property
    def result(self) -> Path:
        """The file that it makes."""
        return self.folder / KINDS[self.kind].result


def jobs_folder() -> Path:
    """$SPAB_JOBS, else $XDG_DATA_HOME/spab/jobs, else ~/.local/share/spab/jobs; made if need be.

    Raises :class:`JobError`.
    """
    path = private_folder.wanted_folder(
        VARIABLE, "XDG_DATA_HOME", ".local/share", "spab/jobs", "jobs", JobError
    )
    return private_folder.private_folder(path, VARIABLE, "jobs", JobError)


def job_id(kind: str, parameters: dict) -> str:
    """The name of a request. Raises ``InputError`` for an unknown kind or wrong parameters."""
    return _request(kind, parameters)[0]


def _request(kind: str, parameters: dict) -> tuple[str, dict]:
    if kind not in KINDS:
        raise JobError(
            f"there is no job of the kind {str(kind)[:40]!r}: choose {' or '.join(KINDS)}"
        )
    checked = KINDS[kind].check(parameters)
    text = json.dumps([kind, checked, solver_hash(), __version__], sort_keys=True)
    return f"{kind}-{hashlib.sha256(text.encode()).hexdigest()[:16]}", checked


def _folder(name: str) -> Path:
    if not isinstance(name, str) or not _ID.fullmatch(name):
        raise JobError(
            f"{str(name)[:60]!r} is no job's id: it is a kind, a dash and 16 hexadecimal digits"
        )
    return jobs_folder() / name


def _read(folder: Path) -> dict | None:
    """What job.json says; None where there is none.

    Raises :class:`JobError` for one that is damaged.
    """
    try:
        data = json.loads(private_folder.own_bytes(folder / "job.json", _MAX_BYTES))
        fits = (
            isinstance(data, dict)
            and data.keys() == _FIELDS.keys()
            and all(_is_one(data[name], types) for name, types in _FIELDS.items())
            and data["state"] in STATES
            and data["kind"] in KINDS
            and folder.name.startswith(data["kind"] + "-")
        )
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise JobError(
            f"job {folder.name}: job.json is not opened: {error.strerror or error}"
        ) from None
    except (ValueError, RecursionError):
        fits = False
    if not fits:
        raise JobError(
            f"job {folder.name}: its job.json is damaged, or of another version; start it again, "
            "or delete it"
        )
    return data


def _is_one(value: object, types: tuple) -> bool:
    """Whether the value is of one of the types and, where it is a number, one that can be counted
    or dated with.
    """
    number = isinstance(value, (int, float))
    return (
        isinstance(value, types)
        and not isinstance(value, bool)
        and (not number or 0 <= value <= _LARGEST)
    )


def _write(folder: Path, data: dict) -> None:
    write_atomically(folder / "job.json", json.dumps(data, indent=1).encode())


def _alive(folder: Path) -> bool:
    """Whether a worker holds the job's lock."""
    try:
        with FileLock(folder / ".lock", timeout=0):
            return False
    except Timeout:
        return True


def _starting(folder: Path, data: dict) -> bool:
    """Whether a worker was started that cannot have shown up yet."""
    if data["state"] != "queued" or data["pid"] is not None:
        return False
    worker = _workers.get(folder.name)
    if worker is not None:
        return worker.poll() is None
    return (
        abs(time.time() - data["queued"]) < _START_SECONDS
    )  # the clock may have been set back since


def _now(folder: Path, data: dict) -> dict:
    """What job.json says, with state and message as they are, whatever became of the worker."""
    if data["state"] in ACTIVE and not _alive(folder):
        data = _read(folder) or data  # it may have ended in between
        if data["state"] in ACTIVE:
            if (folder / "cancel").exists():
                return data | {"state": "cancelled", "message": ""}
            if not _starting(folder, data):
                return data | {
                    "state": "failed",
                    "message": f"{STOPPED}; {KINDS[data['kind']].again}",
                }
    if data["state"] == "done" and not (folder / KINDS[data["kind"]].result).is_file():
        return data | {"state": "failed", "message": "its result is gone; start it again"}
    return data


def _job(folder: Path, data: dict) -> Job:
    data, left = _now(folder, data), None
    if data["state"] == "running" and data["started"] and data["done"] > data["kept"]:
        pace = (time.time() - data["started"]) / (data["done"] - data["kept"])
        left = (
            max(pace * (data["total"] - data["done"]), 0.0) if pace > 0.0 else None
        )  # the clock may have been set back
    return Job(
        folder.name,
        data["kind"],
        data["parameters"],
        data["state"],
        data["done"],
        data["total"],
        data["created"],
        data["started"],
        data["finished"],
        data["message"],
        folder,
        _size(folder),
        left,
    )


def _size(folder: Path) -> int:
    size = 0
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):  # gone in between
            size += path.lstat().st_size
    return size


def find(name: str) -> Job | None:
    """A job by its id; None where it does not exist.

    Raises :class:`JobError` for a bad id or a damaged job.
    """
    folder = _folder(name)
    data = _read(folder)
    return _job(folder, data) if data else None


def list_jobs() -> list[Job]:
    """All jobs, the latest first; a damaged one is listed as failed, with what is wrong as its
    message.
    """
    found = []
    for folder in _folders(jobs_folder()):
        try:
            data = _read(folder)
            if data:
                found.append(_job(folder, data))
        except JobError as error:
            made = folder.lstat().st_mtime
            found.append(
                Job(
                    folder.name,
                    folder.name.rpartition("-")[0],
                    {},
                    "failed",
                    0,
                    0,
                    made,
                    None,
                    None,
                    str(error),
                    folder,
                    _size(folder),
                    None,
                )
            )
    return sorted(found, key=lambda job: (-job.created, job.id))


def _folders(root: Path) -> Iterator[Path]:
    return (
        path
        for path in root.iterdir()
        if _ID.fullmatch(path.name) and path.is_dir() and not path.is_symlink()
    )


def submit(kind: str, parameters: dict, files: dict[str, bytes] | None = None) -> Job:
    """Start a job, or find it: one that is queued, running or done is returned as it is, any other
    goes on from what is kept.

    Parameters
    ----------
    kind : str
        Of ``job_kinds.KINDS``.
    parameters : dict
        Plain JSON values.
    files : dict
        What the job needs besides, by file name: put into its folder. The parameters hold their
        hashes, or two different requests would be taken for one.

    Raises
    ------
    InputError
        For an unknown kind, wrong parameters, or a folder that cannot be used.
    """
    name, parameters = _request(kind, parameters)
    folder = _folder(name)
    with contextlib.suppress(JobError):  # a damaged one is started again
        job = find(name)
        if job and (job.active or job.state == "done"):
            return job
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        with FileLock(
            folder / ".lock", timeout=_CANCEL_SECONDS
        ):  # a worker just cancelled may still hold it
            for file, content in (files or {}).items():
                write_atomically(folder / file, content)
            _start(folder, kind, parameters)
    except Timeout:
        pass  # someone else was faster
    except OSError as error:
        raise JobError(
            f"the job cannot be started in {folder}: {error.strerror or error}"
        ) from None
    found = find(name)
    if found is None:
        raise JobError(f"job {name} was deleted as it started; start it again")
    return found


def _start(folder: Path, kind: str, parameters: dict) -> None:
    """Queue the job and start its worker, unless that has happened; called with the job's lock
    held.
    """
    try:
        data = _read(folder)
    except JobError:
        data = None
    if data and (
        (data["state"] == "done" and (folder / KINDS[kind].result).is_file())
        or (_starting(folder, data) and not (folder / "cancel").exists())
    ):
        return
    now = time.time()
    (folder / "cancel").unlink(missing_ok=True)
    _write(
        folder,
        {
            "kind": kind,
            "parameters": parameters,
            "state": "queued",
            "done": 0,
            "total": 0,
            "kept": 0,
            "created": data["created"] if data else now,
            "queued": now,
            "started": None,
            "finished": None,
            "message": "",
            "pid": None,
        },
    )
    package = str(Path(__file__).resolve().parent.parent.parent)
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    with (folder / "log.txt").open("ab") as log:
        worker = _workers[folder.name] = subprocess.Popen(
            [sys.executable, "-P", "-m", "spab_core.jobs.store", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            cwd=folder,
            env=os.environ | {"PYTHONPATH": path},
            start_new_session=True,
            creationflags=_FLAGS,
        )
    threading.Thread(target=worker.wait, daemon=True).start()  # or it would stay as a zombie


def cancel(name: str) -> Job:
    """Stop a job; what it has kept stays. One that is not queued or running is left as it is.

    Raises
    ------
    JobError
        For a bad id, a job that does not exist, or one that does not stop within seconds.
    """
    job = find(name)
    if job is None:
        raise JobError(f"there is no job {name}")
    if job.active:
        (job.folder / "cancel").touch()
        until = time.monotonic() + _CANCEL_SECONDS
        while (job := find(name) or job).active or _alive(job.folder):
            if time.monotonic() > until:
                raise JobError(f"job {name} has been told to stop and has not yet")
            time.sleep(0.05)
    return job


def delete(name: str) -> None:
    """Delete a job with all its files.

    Raises :class:`JobError` for a bad id, no such job, or one queued or running.
    """
    folder = _folder(name)
    if not folder.is_dir() or folder.is_symlink():
        raise JobError(f"there is no job {name}")
    data = None
    with contextlib.suppress(JobError):
        data = _read(folder)
    if _alive(folder) or (data and _now(folder, data)["state"] in ACTIVE):
        raise JobError(f"job {name} is at work: cancel it before it is deleted")
    try:
        patiently(lambda: shutil.rmtree(folder))  # Windows: its last process may not have ended yet
    except OSError as error:
        raise JobError(f"job {name} cannot be deleted: {error.strerror or error}") from None


class _Report:
    """The worker's side of job.json; work and watch write from two threads, nothing after the end."""

    def __init__(self, folder: Path, data: dict):
        self.folder, self.data, self.closed = folder, data, False
        self.lock, self.written = threading.Lock(), 0.0

    def write(self, **changes) -> None:
        with self.lock:
            if not self.closed:
                self.data |= changes
                self.written = time.monotonic()
                _write(self.folder, self.data)

    def advance(self, count: int) -> None:
        self.data["done"] += int(count)
        if time.monotonic() - self.written > _WRITE_SECONDS:
            self.write()

    def set_total(self, total: int, kept: int = 0) -> None:
        self.write(total=int(total), done=int(kept), kept=int(kept))

    def end(self, state: str, message: str = "") -> bool:
        """Whether this was the end: the first one counts."""
        with self.lock:
            if self.closed:
                return False
            self.closed = True
            try:
                _write(
                    self.folder,
                    self.data | {"state": state, "message": message, "finished": time.time()},
                )
            except (
                OSError
            ) as error:  # a full disk: the job is found stopped, and goes on from what is kept
                print(
                    f"job.json could not be written ({error.strerror or error}): {state}",
                    message,
                    file=sys.stderr,
                )
            return True

    def watch(self) -> None:
        """End this process and its children once a file ``cancel`` is there."""
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
    """Wait until no other job of the folder runs and none queued before waits."""
    root = report.folder.parent
    lock = FileLock(root / ".running.lock", timeout=0)
    while True:
        with contextlib.suppress(Timeout):
            lock.acquire()
            if not any(_waits(folder, report) for folder in _folders(root)):
                break
            lock.release()
        if not report.data["message"]:
            report.write(message="waiting for another job to end")
        time.sleep(_LOOK_SECONDS)
    try:
        yield
    finally:
        lock.release()


def _waits(folder: Path, report: _Report) -> bool:
    """Whether the job in the folder is in the queue before this one."""
    if folder == report.folder:
        return False
    with contextlib.suppress(JobError):
        data = _read(folder)
        if (
            data
            and data["state"] == "queued"
            and (data["queued"], folder.name) < (report.data["queued"], report.folder.name)
        ):
            return _now(folder, data)["state"] == "queued"
    return False


def _work(folder: Path) -> int:
    """Do a job, in its worker process; returns the exit code."""
    if not folder.is_dir():
        return 0  # deleted since
    lock = FileLock(folder / ".lock", timeout=_CANCEL_SECONDS)
    try:
        lock.acquire()
        data = _read(folder)
    except (Timeout, JobError) as error:
        print(error, file=sys.stderr)
        return 2
    if data is None or data["state"] != "queued" or (folder / "cancel").exists():
        return 0  # it has been done, or called off
    remove_temporaries(folder, "*")
    if hasattr(os, "nice"):
        os.nice(5)  # the dashboard goes first
    report = _Report(folder, data)
    report.write(pid=os.getpid())
    threading.Thread(target=report.watch, daemon=True).start()
    try:
        with _turn(report):
            report.write(state="running", started=time.time(), message="")
            kind = KINDS[data["kind"]]
            if (
                kind.grows or not (folder / kind.result).is_file()
            ):  # else it was stopped between its result and its end
                kind.run(folder, data["parameters"], report.advance, report.set_total)
        report.end("done")
        remove_checkpoint(folder / "parts")  # now that nobody needs them to go on
        return 0
    except InputError as error:
        report.end("failed", str(error))
    except TerminatedWorkerError:
        report.end(
            "failed",
            f"a process at work died (killed, or out of memory); {KINDS[data['kind']].again}",
        )
    except OSError as error:
        traceback.print_exc()
        report.end(
            "failed",
            f"{error.filename or folder}: {error.strerror or error}; {KINDS[data['kind']].again}; "
            "the rest "
            f"is in {folder / 'log.txt'}",
        )
    except Exception as error:
        traceback.print_exc()
        report.end(
            "failed",
            f"unexpected: {type(error).__name__}: {error}; the rest is in {folder / 'log.txt'}",
        )
    return 1


if __name__ == "__main__":
    raise SystemExit(_work(Path(sys.argv[1]).absolute()))
