"""Where numba keeps compiled kernels: one folder for each state of the sources.

Numba's own test for a stale kernel looks at the file of that kernel alone; a change in a kernel
that it calls, in another file, would go unseen and old machine code would run on new data."""

import contextlib
import functools
import hashlib
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numba

from spab_core.common.source_hash import source_hash

_PREFIX = "spab-kernels-"
_ROOM = 50_000_000  # bytes; the kernels take about ten million
_LONGEST = 140  # characters below the folder, in numba's names of files
_HERE = Path(__file__).resolve().parent
_KERNELS = sorted(
    path for path in _HERE.glob("*.py") if path.name not in ("__init__.py", "cache.py")
)
_ANSWERS = (
    "common/validation",
    "design/limits",
    "design/model",
    "linear_theory/equilibrium",
    "linear_theory/spectrum",
    "linear_theory/whirl",
    "trajectory/lyapunov",
    "trajectory/periodic_orbit",
    "trajectory/point",
    "trajectory/regimes",
    "trajectory/run",
    "trajectory/settings",
    "trajectory/shooting",
    "trajectory/starts",
)  # what else an operating point depends on


def _short(text: str) -> str:
    return hashlib.sha256(f"{numba.__version__} {text}".encode()).hexdigest()[:16]


def _kernel_hash() -> str:
    """Short hash of the kernels' files to the byte: numba keeps line numbers too, and a stale
    kernel must never be run.
    """
    return _short(
        " ".join(
            f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}" for path in _KERNELS
        )
    )


@functools.cache
def code_hash() -> str:
    """Hash of the code (:mod:`spab_core.common.source_hash`) that an operating point depends on,
    whatever version of numba compiles it.
    """
    paths = [*_KERNELS, *(_HERE.parent / f"{name}.py" for name in _ANSWERS)]
    return source_hash(path.read_bytes() for path in paths)


def solver_hash() -> str:
    """Short hash of :func:`code_hash` and the version of numba."""
    return _short(code_hash())


def _usable(folder: Path) -> bool:
    """Whether the folder exists or can be made, belongs to this user alone, can be written and has
    room for the kernels.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        mine = not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
        room = any(folder.glob("*/*.nbc")) or shutil.disk_usage(folder).free > _ROOM
        # tried, with a path as long as numba's: os.access knows neither Windows' access lists nor
        # its 260 characters
        trial = folder / f"{os.getpid()}".ljust(_LONGEST, "-")
        trial.touch()
        trial.unlink(missing_ok=True)
        return mine and room
    except OSError:
        return False


def _drop_damaged(folder: Path) -> None:
    """Delete kernels cut short by a loss of power, which numba would not read past; it compiles
    them again.
    """
    for path in folder.glob("*/*.nb[ci]"):
        with contextlib.suppress(OSError):  # gone in between
            with path.open("rb") as file:
                file.seek(max(path.stat().st_size - 1, 0))
                whole = file.read(1) == b"."  # how every pickle ends
            if not whole:
                path.unlink()


def choose() -> None:
    """Set numba's cache to the first usable folder: NUMBA_CACHE_DIR, beside the sources, the home, a
    private temporary one.
    """
    name = _PREFIX + _kernel_hash()
    bases = [_HERE / "__pycache__"]
    if os.environ.get("NUMBA_CACHE_DIR"):
        bases.insert(0, Path(os.environ["NUMBA_CACHE_DIR"]))
    with contextlib.suppress(RuntimeError):  # no home at all
        bases.append(Path.home() / ".cache")
    for base in bases:
        if _usable(base / name):
            for old in base.glob(_PREFIX + "*"):  # kernels of earlier sources
                if old.name != name:
                    shutil.rmtree(old, ignore_errors=True)
            _drop_damaged(base / name)
            numba.config.CACHE_DIR = str(base / name)
            return
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX)) / name
    folder.mkdir()
    numba.config.CACHE_DIR = str(folder)


def folder_for_others() -> dict[str, str]:
    """Return the environment in which another process takes the folder of this one."""
    return {"NUMBA_CACHE_DIR": str(Path(numba.config.CACHE_DIR).parent)}


def is_kept(dispatcher: Any, *arguments: object) -> bool:
    """Whether a kernel need not be compiled for such arguments: it is loaded, or numba's cache has
    it for this processor.

    Parameters
    ----------
    dispatcher
        Made by ``numba.njit(cache=True)``.
    *arguments
        What it would be called with; their types count.
    """
    signature = tuple(numba.typeof(argument) for argument in arguments)
    if signature in dispatcher.overloads:
        return True
    try:
        cache = dispatcher._cache
        return (
            cache._index_key(signature, dispatcher.targetctx.codegen())
            in cache._cache_file._load_index()
        )
    except Exception:  # numba's private interface may change: then compiling is just not announced
        return True
