"""The server's memory, kept flat under many users and quick to be looked through.

Streamlit runs each page on a new thread. Left alone, glibc gives every few threads an arena that
grows by what its largest run needed, and pyarrow's allocator every thread a segment of its own;
neither is given back. After each run Streamlit has Python look for garbage in all there is, while
everybody waits: modules and caches, nearly all of it, are left out of that here."""

from __future__ import annotations

import ctypes
import gc
from collections import Counter

import pyarrow as pa
import streamlit as st

_ARENA_MAX, _MMAP_THRESHOLD = -8, -3  # M_ARENA_MAX and M_MMAP_THRESHOLD of glibc's malloc.h
ARENAS = 2
LARGE = (
    1 << 18
)  # bytes; larger blocks, the figures' texts, go back to the system as soon as they are freed


@st.cache_resource(show_spinner=False)
def bound_memory() -> None:
    """Have all threads share :data:`ARENAS` arenas, once in the life of a server; without glibc
    nothing but pyarrow's pool.
    """
    pa.set_memory_pool(pa.system_memory_pool())
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # another C library
        return
    mallopt(_ARENA_MAX, ARENAS)
    mallopt(_MMAP_THRESHOLD, LARGE)


@st.cache_resource(show_spinner=False)
def _runs() -> Counter[str]:
    return Counter()


def spare_lasting_objects(page: str) -> None:
    """Called as a page begins: what lives before its second run, its modules and caches too, is not
    searched any more.
    """
    runs = _runs()
    runs[page] += 1
    if runs[page] == 2:
        gc.collect()
        gc.freeze()
