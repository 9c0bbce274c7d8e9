"""The dashboard's server shares a few arenas of memory among all threads (spab_core/ui/memory.py)."""

import os
import platform
import subprocess
import sys

import pytest

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


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="arenas are glibc's")
def test_threads_share_two_arenas_once_the_server_has_asked():
    """Twelve threads that allocate at once: left alone they get arenas of their own, which is why it is asked for."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("MALLOC_", "GLIBC_TUNABLES"))}
    environment["OPENBLAS_NUM_THREADS"] = "1"

    def arenas(how):
        done = subprocess.run([sys.executable, "-W", "ignore", "-c", PROGRAM, how], capture_output=True, text=True,
                              env=environment, check=True)
        return int(done.stdout)

    assert arenas("bound") <= 2 < arenas("alone")
