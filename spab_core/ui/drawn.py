"""Figures of whole maps, drawn once for all users: half a second and some megabytes that each run
would spend again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any

import plotly.graph_objects as go
import streamlit as st

_KEPT = 16  # a megabyte or two each


class _Drawn(go.Figure):
    """A figure whose dictionary is ready; its own properties are empty."""

    def __init__(self, ready: dict[str, Any]):
        super().__init__()
        self.__dict__["_ready"] = ready

    def to_dict(self) -> dict[str, Any]:
        """What is sent to the browser."""
        ready: dict[str, Any] = self.__dict__["_ready"]
        return ready


@st.cache_resource(show_spinner=False)
def _figures() -> tuple[dict[Hashable, dict[str, Any]], threading.Lock]:
    return {}, threading.Lock()


def drawn(key: Hashable, draw: Callable[[], go.Figure], *traces: dict[str, Any]) -> go.Figure:
    """A figure drawn now, or one of the last drawn for any user.

    Parameters
    ----------
    key : hashable
        All that the figure depends on.
    draw : callable
        Draws it; may raise, but not use the page.
    traces : dict
        Drawn over it, of this run alone.

    Returns
    -------
    Figure
        To be shown; only its dictionary is filled.
    """
    known, lock = _figures()
    with lock:  # users who come together wait for one drawing
        ready = known.pop(key, None) or draw().to_dict()
        known[key] = ready  # the last used is the last to go
        while len(known) > _KEPT:
            del known[next(iter(known))]
    return _Drawn(ready | {"data": [*ready["data"], *traces]})
