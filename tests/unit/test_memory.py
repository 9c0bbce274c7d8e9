"""The memory of the dashboard's server: shared arenas, and what is not searched for garbage
(spab_core/ui/memory.py).
"""

import gc
import os
import platform
import subprocess
import sys
import weakref

import pytest

from spab_core.ui.memory import spare_lasting_objects

PROGRAM = """
import ctypes, sys, tempfile, threading
import pyarrow as pa
from spab_core.ui.memory import bound_memory

if sys.argv[1] == "bound":
    bound_memory()
    assert pa.default_memory_pool().backend_name == "system"
libc, held = ctypes.CDLL(None), threading.Barrier(12)
libc.malloc.restype, libc.fopen.restype = ctypes.c_void_p, ctypes.c_void_p

def take():
    libc.malloc(ctypes.c_size_t(50_000))
    held.wait()

threads = [threading.Thread(target=take) for _ in range(12)]
[t.start() for t in threads], [t.join() for t in threads]
with tempfile.NamedTemporaryFile() as file:
    out = ctypes.c_void_p(libc.fopen(file.name.encode(), b"w"))
    libc.malloc_info(0, out), libc.fclose(out)
    print(open(file.name).read().count("<heap nr="))
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="arenas are glibc's")
def test_threads_share_two_arenas_once_the_server_has_asked():
    """Twelve threads that allocate at once: left alone they get arenas of their own, which is why
    it is asked for.
    """
    environment = {
        k: v for k, v in os.environ.items() if not k.startswith(("MALLOC_", "GLIBC_TUNABLES"))
    }
    environment["OPENBLAS_NUM_THREADS"] = "1"

    def arenas(how):
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", PROGRAM, how],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
        )
        return int(done.stdout)

    assert arenas("bound") <= 2 < arenas("alone")


def searched(thing):
    """Whether Python's garbage collector looks through it."""
    return any(other is thing for other in gc.get_objects())


def test_what_lasts_is_searched_for_garbage_twice_a_page_and_no_more():
    """What lives before the second run is left out; what comes later is not, and is still
    collected.
    """

    class Node:
        pass

    page, lasting = f"a page of {os.getpid()}", [Node()]
    spare_lasting_objects(page)
    assert searched(lasting)
    try:
        spare_lasting_objects(page)
        assert not searched(lasting) and not searched(sys.modules)
        node, later = Node(), [Node()]
        node.itself, gone = node, weakref.ref(node)
        del node
        spare_lasting_objects(page)
        assert searched(later)
        gc.collect()
        assert gone() is None
    finally:
        gc.unfreeze()
