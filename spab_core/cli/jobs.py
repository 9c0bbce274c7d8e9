"""The commands ``spab jobs …``: background jobs listed, cancelled, deleted."""

from __future__ import annotations

import json
from argparse import Namespace
from typing import Any

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.jobs.store import Job, cancel, delete, list_jobs


def add_commands(commands: Commands) -> None:
    """Add ``jobs`` and its commands to the parser's."""
    text = "background work started from the dashboard"
    subs = options.add_group(commands, "jobs", text)
    options.add_command(subs, "list", "all jobs, the latest first", _list)
    for name, words, run in (
        ("cancel", "stop a queued or running job; what it has solved stays", _cancel),
        ("delete", "delete a job with its result", _delete),
    ):
        options.add_command(subs, name, words, run).add_argument(
            "id", metavar="ID", help="as listed"
        )


def _finite(parameters: dict[str, Any]) -> Any:
    """Return the parameters as plain JSON: an infinite stiffness becomes "inf"."""
    return json.loads(
        json.dumps(parameters), parse_constant=lambda word: word.lower().removesuffix("inity")
    )


def _record(job: Job) -> Answer:
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
    size = job.size / 1e6
    return f"{job.id:<32} {job.state:<9} {progress:>16} {size:8.2f} MB  {job.message}".rstrip()


def _list(args: Namespace) -> Answer:
    found = list_jobs()
    if not args.json:
        print("\n".join(map(_line, found)) or "no jobs")
    return {"jobs": [_record(job) for job in found]}


def _cancel(args: Namespace) -> Answer:
    job = cancel(args.id)
    if not args.json:
        print(_line(job))
    return _record(job)


def _delete(args: Namespace) -> Answer:
    delete(args.id)
    if not args.json:
        print(f"{args.id}: deleted")
    return {"deleted": args.id}
