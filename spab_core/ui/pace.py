"""Work beside the pages, as that of a margin, gives way to a page that is being drawn: threads of
one process share the interpreter, whatever their priority.
"""

from __future__ import annotations

import time

DRAWING = 0.5  # seconds that a page takes, about
_began = -DRAWING


def page_begins() -> None:
    """Note that a page has begun to be drawn."""
    global _began
    _began = time.monotonic()


def let_pages_first() -> None:
    """Wait until no page has begun in the last :data:`DRAWING` seconds, for that long at most: on
    a server of many users one has always just begun.
    """
    end = time.monotonic() + DRAWING
    while (left := min(_began + DRAWING, end) - time.monotonic()) > 0.0:
        time.sleep(left)
