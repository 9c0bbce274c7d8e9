"""Processes that end with the one that started them."""

from __future__ import annotations

import contextlib
import os
import threading
import time

import psutil


def end_with_parent(parent: int) -> None:
    """End this worker process when its ``parent`` (a process id) ends, even where that is killed;
    call it first.
    """

    def watch() -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            # by number and time of start: Windows tells a dead parent's number for ever, and gives
            # it to others
            process = psutil.Process(parent)
            while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
                time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
