"""The commands ``spab jobs …``: background jobs listed, cancelled, deleted; and what a long command
says when stopped.
"""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from joblib.externals.loky.process_executor import TerminatedWorkerError
from tqdm import tqdm

from spab_core.common.errors import InputError
from spab_core.jobs.store import Job, cancel, delete, list_jobs


@contextlib.contextmanager
def kept_when_stopped(bar: tqdm, parts: Path, what: str) -> Iterator[None]:
    """Say where the finished ``what`` are kept, if the run under the bar is stopped or loses a
    worker process.

    Raises
    ------
    SystemExit
        130, where the user stopped it.
    InputError
        Where a worker died, or a file could not be written.
    """
    kept = f"{what} are kept in {parts}: the same command goes on from them"
    try:
        yield
    except KeyboardInterrupt:
        bar.close()
        print(f"spab: stopped; {kept}", file=sys.stderr)
        raise SystemExit(130) from None
    except TerminatedWorkerError:
        bar.close()
        raise InputError(f"a worker process died (killed, or out of memory); {kept}") from None
    except OSError as error:  # a full disk, or a folder that can no longer be written
        bar.close()
        raise InputError(f"{error.filename or parts}: {error.strerror or error}; {kept}") from None


def add_commands(commands) -> None:
    """Add ``jobs`` and what belongs to it to the parser's commands."""
    text = "long work that the dashboard has started in the background"
    parser = commands.add_parser("jobs", help=text, description=text, allow_abbrev=False)
    subs = parser.add_subparsers(dest="jobs_command", required=True, parser_class=type(parser))
    for name, words, run in (
        ("list", "all jobs, the latest first", _list),
        ("cancel", "stop a job that is queued or running; what it has solved is kept", _cancel),
        ("delete", "delete a job with its result", _delete),
    ):
        sub = subs.add_parser(name, help=words, description=words, allow_abbrev=False)
        if run is not _list:
            sub.add_argument("id", metavar="ID", help="as listed")
        sub.add_argument("--json", action="store_true", help="print one JSON object")
        sub.set_defaults(run=run)


def _finite(parameters: dict) -> dict:
    """Parameters as plain JSON: an infinite stiffness becomes "inf"."""
    return json.loads(
        json.dumps(parameters), parse_constant=lambda word: word.lower().removesuffix("inity")
    )


def _record(job: Job) -> dict:
    return {
        "id": job.id,
        "state": job.state,
        "done": job.done,
        "total": job.total,
        "bytes": job.size,
        "created": job.created,
        "started": job.started,
        "finished": job.finished,
        "seconds_left": job.seconds_left,
        "message": job.message,
        "folder": str(job.folder),
        "parameters": _finite(job.parameters),
    }


def _line(job: Job) -> str:
    progress = f"{job.done:,} of {job.total:,}" if job.total else ""
    return f"{job.id:<32} {job.state:<9} {progress:>16} {job.size / 1e6:8.2f} MB  {job.message}".rstrip()


def _list(args) -> dict:
    found = list_jobs()
    if not args.json:
        print("\n".join(map(_line, found)) or "no jobs")
    return {"jobs": [_record(job) for job in found]}


def _cancel(args) -> dict:
    job = cancel(args.id)
    if not args.json:
        print(_line(job))
    return _record(job)


def _delete(args) -> dict:
    delete(args.id)
    if not args.json:
        print(f"{args.id}: deleted")
    return {"deleted": args.id}
