"""The hash of source code: what it says counts, how and where it is written does not, and every
Python finds the same.
"""

import ast
import gc
import runpy
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from spab_core.common import source_hash as module
from spab_core.common.source_hash import source_hash
from spab_core.shipped.provenance import INTERVALS_RECIPE
from spab_core.solver.cache import solver_hash

HERE = '''"""What it is for."""
from spab_core.design.model import Design
import numpy as np

SIZE = 0x10  # cells

def area(a: float, b=2.0, *rest, **more) -> float:
    """Of a rectangle."""
    import math
    return math.fabs(a * b), f"{a:.{SIZE}f} of" " it"

class Thing:
    """A thing."""
    x: int = 3

if __name__ == "__main__":
    print(area(1.0))
'''
MOVED = """import numpy as np


class Thing:
    x: int = 3  # three


if __name__ == '__main__':
    raise SystemExit(area(2.0))
"""
REFORMATTED = """from spab_core.parts.design import (
    Design,
)
SIZE = 16


def area(
    a: float,
    b=2.0,
    *rest,
    **more,
) -> float:
    '''Area of a rectangle.'''
    return (
        math.fabs(a * b),
        f'{a:.{SIZE}f} of it',
    )
"""


def hash_of(*texts):
    return source_hash(text.encode() for text in texts)


def test_layout_comments_imports_and_files_count_for_nothing():
    assert hash_of(HERE) == hash_of(REFORMATTED, MOVED) == hash_of(MOVED, REFORMATTED)


@pytest.mark.parametrize(
    "old, new",
    [
        ("0x10", "17"),
        ("b=2.0", "b=2"),
        ("a * b", "b * a"),
        ("**more", "**less"),
        (".{SIZE}f", ".{SIZE}g"),
        (" it", " them"),
        ("x: int = 3", "x: int = 3; y: int = 3"),
        ("class Thing", "class Other"),
        ("math.fabs(a * b)", "+math.fabs(a * b)"),
    ],
)
def test_what_the_code_says_counts(old, new):
    assert old in HERE and hash_of(HERE) != hash_of(HERE.replace(old, new))


def test_no_python_is_no_source():
    with pytest.raises(SyntaxError):
        hash_of("def")


def other_pythons():
    pyenv = sorted(Path.home().glob(".pyenv/versions/3.1[1-9]*/bin/python"))
    return [str(path) for path in pyenv] + [
        found for k in range(11, 16) if (found := shutil.which(f"python3.{k}"))
    ]


def test_every_python_finds_the_same():
    """The other Pythons of this machine; where there is none, the hashes of the shipped manifest
    were another one's.
    """
    files = [str(m.__file__) for m in INTERVALS_RECIPE] + [
        str(p) for p in Path(module.__file__).parent.glob("*.py")
    ]
    assert len(files) > 5
    code = (
        f"import runpy; hash = runpy.run_path({str(module.__file__)!r})['source_hash']\n"
        f"print(hash(open(path, 'rb').read() for path in {files!r}))"
    )
    here = source_hash(Path(path).read_bytes() for path in files)
    for python in other_pythons():
        found = subprocess.run(
            [python, "-I", "-c", code], capture_output=True, text=True, timeout=60
        )
        if (
            found.returncode == 0 or "Error" in found.stderr
        ):  # else a shim of a Python that is not installed
            assert found.stdout.strip() == here, (python, found.stderr)


def test_the_module_needs_no_package():
    assert {
        name
        for name in runpy.run_path(str(module.__file__))
        if name in ("numpy", "numba", "spab_core")
    } == set()
    assert len(solver_hash()) == 16


def test_threads_hash_at_the_same_time():
    """Python 3.11 raises SystemError where two threads at different depths build syntax trees at
    once: they change over when the garbage collector, called back as Dask's workers have it, runs
    in the middle of one.
    """
    sources = [path.read_bytes() for path in Path(module.__file__).parent.glob("*.py")]
    found = set()

    def hash_at(depth):
        if depth:
            hash_at(depth - 1)
        else:
            found.update(source_hash(sources) for _ in range(4))

    def change_over(phase, info):
        time.sleep(1e-6)

    gc.callbacks.append(change_over)
    usual, interval = gc.get_threshold(), sys.getswitchinterval()
    gc.set_threshold(20)
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(6) as pool:
            for done in [pool.submit(hash_at, 3 * number) for number in range(6)]:
                done.result()
    finally:
        sys.setswitchinterval(interval)
        gc.set_threshold(*usual)
        gc.callbacks.remove(change_over)
    assert len(found) == 1


def test_another_tree_built_in_the_middle_of_one_is_no_reason_to_fail():
    """NumPy and Dask build trees too (``ast.literal_eval``), in threads that change over where
    the garbage collector calls back: the same as one built by the callback.
    """
    sources = [path.read_bytes() for path in Path(module.__file__).parent.glob("*.py")]
    here = source_hash(sources)

    def build_another(phase, info):
        ast.literal_eval("[1]")

    usual = gc.get_threshold()
    gc.callbacks.append(build_another)
    gc.set_threshold(20)
    try:
        assert source_hash(sources) == here
    finally:
        gc.set_threshold(*usual)
        gc.callbacks.remove(build_another)
