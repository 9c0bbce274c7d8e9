"""Where numba keeps compiled kernels: one folder for each state of the sources.

Numba's own test for a stale kernel looks at the file of that kernel alone; a change in a kernel that it calls, in another
file, would go unseen and old machine code would run on new data.
"""

import contextlib
import functools
import hashlib
import os
import shutil
import tempfile
from pathlib import Path

import numba

_PREFIX = "spab-kernels-"
_KERNELS = ("dtm", "film", "integrate", "kernels", "linear", "rotor", "rows", "simd")
_SOLVER = (*_KERNELS, "design", "floquet", "lyapunov", "point", "regimes", "simulate")


def _hash(paths) -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(paths):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


@functools.cache
def solver_hash() -> str:
    """Short hash of the sources, and the version of numba, that a computed operating point depends on."""
    return _hash(Path(__file__).parent / f"{name}.py" for name in _SOLVER)


def _usable(folder: Path) -> bool:
    """Whether the folder exists or can be made, belongs to this user alone, and can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        mine = not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
        return mine and os.access(folder, os.W_OK)
    except OSError:
        return False


def choose() -> None:
    """Point numba to the first usable place: NUMBA_CACHE_DIR, beside the sources, the home, a private temporary folder."""
    name = _PREFIX + _hash(Path(__file__).parent / f"{module}.py" for module in _KERNELS)
    bases = [Path(__file__).parent / "__pycache__"]
    if os.environ.get("NUMBA_CACHE_DIR"):
        bases.insert(0, Path(os.environ["NUMBA_CACHE_DIR"]))
    with contextlib.suppress(RuntimeError):  # no home at all
        bases.append(Path.home() / ".cache")
    for base in bases:
        if _usable(base / name):
            for old in base.glob(_PREFIX + "*"):  # kernels of earlier sources
                if old.name != name:
                    shutil.rmtree(old, ignore_errors=True)
            numba.config.CACHE_DIR = str(base / name)
            return
    numba.config.CACHE_DIR = tempfile.mkdtemp(prefix=_PREFIX)
