"""Processes that end with the one that started them."""

from __future__ import annotations

import contextlib
import os
import threading
import time

import psutil


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
