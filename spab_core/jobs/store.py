"""Jobs and their state on disk: submit, find, list, cancel, delete.

A job outlives the page that started it, and the server. It is a folder with ``job.json`` (request
and state), ``log.txt``, checkpoints and the result. The folder's name contains a hash of the
request, the solver and the version, so nothing is computed twice. Only the holder of ``.lock``
writes ``job.json``: the worker (:mod:`spab_core.jobs.worker`) while it lives, else the process that
starts it. A state "running" with a free lock means that the worker was killed. A job is cancelled
by a file ``cancel`` in its folder: the worker sees it and ends itself and its children, so that no
process is signalled by a number read from a file.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from filelock import FileLock, Timeout

from spab_core._version import __version__
from spab_core.common.errors import InputError
from spab_core.common.files import patiently, write_atomically
from spab_core.common.private_folders import own_bytes, private_folder, wanted_folder
from spab_core.common.processes import module_command
from spab_core.jobs.kinds import KINDS
from spab_core.solver.cache import solver_hash

VARIABLE = "SPAB_JOBS"
STATES = ("queued", "running", "cancelled", "failed", "done")
ACTIVE = ("queued", "running")
STOPPED = "the worker was stopped"
_ID = re.compile(r"[a-z][a-z0-9-]{0,30}-[0-9a-f]{16}")
NAME_LENGTH = 60  # characters
_NAME = "name.txt"  # in a job's folder
_MAX_BYTES = 1_000_000  # of a job.json
_START_SECONDS = 120.0  # for a worker to show up, on a busy machine
CANCEL_SECONDS = 10.0  # for a worker to end
# Windows: the worker gets no console, nor the Ctrl+C of ours, and yields to the dashboard
_FLAGS = sum(
    getattr(subprocess, name, 0)
    for name in ("CREATE_NO_WINDOW", "CREATE_NEW_PROCESS_GROUP", "BELOW_NORMAL_PRIORITY_CLASS")
)
_workers: dict[str, subprocess.Popen[bytes]] = {}  # started by this process
# job.json, with the types of its values
_FIELDS: dict[str, tuple[type, ...]] = {
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
    """The job does not exist, is damaged, or is in a state that does not allow the operation."""


@dataclass(frozen=True)
class Job:
    """A job with its present state.

    Attributes
    ----------
    id, kind : str
        ``kind`` is a key of :data:`spab_core.jobs.kinds.KINDS`.
    parameters : dict
        Checked, with defaults filled in.
    state : str
        One of :data:`STATES`.
    done, total : int
        In the kind's own units; ``total`` is 0 until it is known.
    created, started, finished : float
        Seconds since 1970; the latter two are None until then. ``started`` is the last start.
    message : str
        What went wrong, what the job waits for, or what it is doing.
    folder : Path
        Holds the kind's result once ``state`` is done.
    size : int
        Bytes on disk.
    seconds_left : float or None
        Estimated from the pace so far.
    name : str
        What the user calls it (:func:`rename`); "" for nothing.
    """

    id: str
    kind: str
    parameters: dict[str, Any]
    state: str
    created: float
    folder: Path
    size: int
    done: int = 0
    total: int = 0
    started: float | None = None
    finished: float | None = None
    message: str = ""
    seconds_left: float | None = None
    name: str = ""

    @property
    def active(self) -> bool:
        """Whether it is queued or running."""
        return self.state in ACTIVE

    @property
    def result(self) -> Path:
        """The file that the job writes."""
        return self.folder / KINDS[self.kind].result


def jobs_folder() -> Path:
    """Return the folder of jobs, created if needed: $SPAB_JOBS, else $XDG_DATA_HOME/spab/jobs, else
    ~/.local/share/spab/jobs. Raise :class:`JobError` if it cannot be used.
    """
    path = wanted_folder(VARIABLE, "XDG_DATA_HOME", ".local/share", "spab/jobs", "jobs", JobError)
    return private_folder(path, VARIABLE, "jobs", JobError)


def job_id(kind: str, parameters: dict[str, Any]) -> str:
    """Return the id of a request. Raise ``InputError`` for an unknown kind or wrong parameters."""
    return _request(kind, parameters)[0]


def _request(kind: str, parameters: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    if kind not in KINDS:
        raise JobError(f"there is no job of the kind {str(kind)[:40]!r}: choose {', '.join(KINDS)}")
    checked = KINDS[kind].check(parameters)
    text = json.dumps([kind, checked, solver_hash(), __version__], sort_keys=True)
    return f"{kind}-{hashlib.sha256(text.encode()).hexdigest()[:16]}", checked


def _folder(name: str) -> Path:
    if not isinstance(name, str) or not _ID.fullmatch(name):
        raise JobError(
            f"{str(name)[:60]!r} is no job's id: an id is a kind, a dash and 16 hexadecimal digits"
        )
    return jobs_folder() / name


def read_state(folder: Path) -> dict[str, Any] | None:
    """Return the content of job.json; None if there is none.

    Raise :class:`JobError` if it is damaged or cannot be opened.
    """
    try:
        data = json.loads(own_bytes(folder / "job.json", _MAX_BYTES))
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
            f"job {folder.name}: job.json cannot be opened: {error.strerror or error}"
        ) from None
    except (ValueError, RecursionError):
        fits = False
    if not fits:
        raise JobError(
            f"job {folder.name}: its job.json is damaged, or of another version; start the job "
            "again, or delete it"
        )
    return cast("dict[str, Any]", data)


def _is_one(value: object, types: tuple[type, ...]) -> bool:
    """Return whether the value has one of the types and, if it is a number, is a possible count or
    date.
    """
    return (
        isinstance(value, types)
        and not isinstance(value, bool)
        and (not isinstance(value, (int, float)) or 0 <= value <= _LARGEST)
    )


def write_state(folder: Path, data: dict[str, Any]) -> None:
    """Write job.json; the caller holds the job's lock."""
    write_atomically(folder / "job.json", json.dumps(data, indent=1).encode())


def _alive(folder: Path) -> bool:
    """Return whether a worker holds the job's lock."""
    try:
        with FileLock(folder / ".lock", timeout=0):
            return False
    except Timeout:
        return True


def _starting(folder: Path, data: dict[str, Any]) -> bool:
    """Return whether a worker was started and has not reported yet."""
    if data["state"] != "queued" or data["pid"] is not None:
        return False
    worker = _workers.get(folder.name)
    if worker is not None:
        return worker.poll() is None
    return bool(abs(time.time() - data["queued"]) < _START_SECONDS)  # the clock may be set back


def state_now(folder: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Return the content of job.json, corrected if the worker was stopped or the result was
    deleted.
    """
    if data["state"] in ACTIVE and not _alive(folder):
        data = read_state(folder) or data  # it may have ended in between
        if data["state"] in ACTIVE:
            if (folder / "cancel").exists():
                return data | {"state": "cancelled", "message": ""}
            if not _starting(folder, data):
                message = f"{STOPPED}; {KINDS[data['kind']].again}"
                return data | {"state": "failed", "message": message}
    if data["state"] == "done" and not (folder / KINDS[data["kind"]].result).is_file():
        return data | {"state": "failed", "message": "its result is gone; start it again"}
    return data


def _job(folder: Path, data: dict[str, Any]) -> Job:
    data, left = state_now(folder, data), None
    if data["state"] == "running" and data["started"] and data["done"] > data["kept"]:
        pace = (time.time() - data["started"]) / (data["done"] - data["kept"])
        if pace > 0.0:  # the clock may have been set back
            left = max(pace * (data["total"] - data["done"]), 0.0)
    shown = {name: data[name] for name in _FIELDS if name not in ("kept", "queued", "pid")}
    return Job(
        id=folder.name,
        folder=folder,
        size=_size(folder),
        seconds_left=left,
        name=_name(folder),
        **shown,
    )


def _name(folder: Path) -> str:
    try:
        return " ".join(own_bytes(folder / _NAME, 10 * NAME_LENGTH).decode().split())
    except (OSError, ValueError):
        return ""  # it has none, or none that can be read


def _size(folder: Path) -> int:
    size = 0
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):  # gone in between
            size += path.lstat().st_size
    return size


def find(name: str) -> Job | None:
    """Return a job by its id; None if it does not exist.

    Raise :class:`JobError` for a bad id or a damaged job.
    """
    folder = _folder(name)
    data = read_state(folder)
    return _job(folder, data) if data else None


def list_jobs() -> list[Job]:
    """Return all jobs, the latest first; damaged ones as failed, with the reason in ``message``."""
    found = []
    for folder in job_folders(jobs_folder()):
        try:
            data = read_state(folder)
            if data:
                found.append(_job(folder, data))
        except JobError as error:
            kind, made = folder.name.rpartition("-")[0], folder.lstat().st_mtime
            found.append(
                Job(
                    id=folder.name,
                    kind=kind,
                    parameters={},
                    state="failed",
                    created=made,
                    folder=folder,
                    size=_size(folder),
                    message=str(error),
                )
            )
    return sorted(found, key=lambda job: (-job.created, job.id))


def active_jobs() -> list[Job]:
    """Return the jobs that are queued or running, the first started first; damaged ones are left
    out.
    """
    found = []
    for folder in job_folders(jobs_folder()):
        with contextlib.suppress(JobError):
            data = read_state(folder)
            if data and data["state"] in ACTIVE:
                found.append(_job(folder, data))
    return sorted((job for job in found if job.active), key=lambda job: (job.created, job.id))


def rename(name: str, title: str) -> None:
    """Give a job a name of the user's, "" to take it away.

    Parameters
    ----------
    name : str
        The job's id.
    title : str
        At most :data:`NAME_LENGTH` characters.

    Raises
    ------
    JobError
        For a bad id, an unknown job, a name that is too long or cannot be written.
    """
    folder, title = _folder(name), " ".join(title.split())
    if len(title) > NAME_LENGTH:
        raise JobError(f"a job's name has at most {NAME_LENGTH} characters, not {len(title)}")
    if not folder.is_dir() or folder.is_symlink():
        raise JobError(f"there is no job {name}")
    try:
        if title:
            write_atomically(folder / _NAME, title.encode())
        else:
            (folder / _NAME).unlink(missing_ok=True)
    except OSError as error:
        raise JobError(f"job {name} cannot be renamed: {error.strerror or error}") from None


def job_folders(root: Path) -> Iterator[Path]:
    """Yield the folders of jobs in ``root``; links are not followed."""
    return (
        path
        for path in root.iterdir()
        if _ID.fullmatch(path.name) and path.is_dir() and not path.is_symlink()
    )


def submit(kind: str, parameters: dict[str, Any], files: dict[str, bytes] | None = None) -> Job:
    """Start a job and return it; one that is queued, running or done is returned as it is, one that
    was stopped resumes.

    Parameters
    ----------
    kind : str
        A key of :data:`spab_core.jobs.kinds.KINDS`.
    parameters : dict
        Plain JSON values.
    files : dict
        Input files of the job, by name, written into its folder. The parameters must contain their
        hashes, so that requests with different files have different ids.

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
        # a worker just cancelled may still hold the lock
        with FileLock(folder / ".lock", timeout=CANCEL_SECONDS):
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
        raise JobError(f"job {name} was deleted while it started; start it again")
    return found


def _start(folder: Path, kind: str, parameters: dict[str, Any]) -> None:
    """Queue the job and start its worker, unless it is done or starting; the caller holds the
    job's lock.
    """
    try:
        data = read_state(folder)
    except JobError:
        data = None
    if data and (
        (data["state"] == "done" and (folder / KINDS[kind].result).is_file())
        or (_starting(folder, data) and not (folder / "cancel").exists())
    ):
        return
    now = time.time()
    (folder / "cancel").unlink(missing_ok=True)
    created = data["created"] if data else now
    write_state(
        folder,
        {
            "kind": kind,
            "parameters": parameters,
            "state": "queued",
            "done": 0,
            "total": 0,
            "kept": 0,
            "created": created,
            "queued": now,
            "started": None,
            "finished": None,
            "message": "",
            "pid": None,
        },
    )
    command, environment = module_command("spab_core.jobs.worker", str(folder))
    with (folder / "log.txt").open("ab") as log:
        worker = _workers[folder.name] = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            cwd=folder,
            env=environment,
            start_new_session=True,
            creationflags=_FLAGS,
        )
    threading.Thread(target=worker.wait, daemon=True).start()  # or it would stay as a zombie


def cancel(name: str) -> Job:
    """Stop a job that is queued or running, and return it; its checkpoints stay.

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
        until = time.monotonic() + CANCEL_SECONDS
        while (job := find(name) or job).active or _alive(job.folder):
            if time.monotonic() > until:
                raise JobError(
                    f"job {name} was told to stop and still runs after {CANCEL_SECONDS:g} s"
                )
            time.sleep(0.05)
    return job


def delete(name: str) -> None:
    """Delete a job with all its files.

    Raise :class:`JobError` for a bad id, an unknown job, or one that is queued or running.
    """
    folder = _folder(name)
    if not folder.is_dir() or folder.is_symlink():
        raise JobError(f"there is no job {name}")
    data = None
    with contextlib.suppress(JobError):
        data = read_state(folder)
    if _alive(folder) or (data and state_now(folder, data)["state"] in ACTIVE):
        raise JobError(f"job {name} is queued or running: cancel it before you delete it")
    try:
        patiently(lambda: shutil.rmtree(folder))  # Windows: its last process may not have ended yet
    except OSError as error:
        raise JobError(f"job {name} cannot be deleted: {error.strerror or error}") from None
