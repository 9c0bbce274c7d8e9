"""Processes of ours: modules of the package run by another Python; an end with the parent."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time

import psutil

from spab_core.common.paths import IMPORTED_FROM


def module_command(name: str, *arguments: str) -> tuple[list[str], dict[str, str]]:
    """Return command and environment that run a module of this very package, from any folder."""
    before = os.environ.get("PYTHONPATH")
    path = os.pathsep.join([str(IMPORTED_FROM), *([before] if before else [])])
    return [sys.executable, "-P", "-m", name, *arguments], os.environ | {"PYTHONPATH": path}


def end_with_parent(parent: int) -> None:
    """End this process once the one that started it has ended, also where that was killed.

    A worker process calls it first, with the number of its parent."""

    def watch() -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            # known by number and time of start: Windows keeps a dead parent's number and gives it
            # to others
            process = psutil.Process(parent)
            while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
                time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
