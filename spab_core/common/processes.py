"""Start modules of the package in a new process; end worker processes with their parent, and let
them give way to it.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time

import psutil

from spab_core.common.paths import IMPORTED_FROM


def module_command(name: str, *arguments: str) -> tuple[list[str], dict[str, str]]:
    """Return the command and environment that run a module of this installation from any folder."""
    before = os.environ.get("PYTHONPATH")
    path = os.pathsep.join([str(IMPORTED_FROM), *([before] if before else [])])
    return [sys.executable, "-P", "-m", name, *arguments], os.environ | {"PYTHONPATH": path}


def end_with_parent(parent: int) -> None:
    """End this process when its parent ends, even if the parent was killed.

    Call it first in a worker process, with the parent's process id.
    """

    def watch() -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            # known by number and time of start: Windows keeps a dead parent's number and gives it
            # to others
            process = psutil.Process(parent)
            while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
                time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def give_way(by: int) -> None:
    """Lower the priority of this process by a nice value, on Windows to below normal; keep it where
    the system does not allow that.
    """
    windows: int | None = getattr(psutil, "BELOW_NORMAL_PRIORITY_CLASS", None)
    with contextlib.suppress(psutil.Error, OSError):
        if hasattr(os, "nice"):
            os.nice(by)
        elif windows is not None:
            psutil.Process().nice(windows)
