"""Hash source code by its syntax tree: the same for every layout, folder and Python version.

Models and results on disk are named by it, so they stay valid when code is reformatted, commented
or moved, and on another Python version.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import threading
from collections.abc import Iterable
from typing import Any

# fields that follow from others, tell a spelling, or are new in later Pythons
_SILENT = {"ctx", "kind", "type_comment", "type_params"}
_PARSING = threading.Lock()


def _parse(source: bytes) -> list[ast.stmt]:
    """Return a source's statements, no other tree built meanwhile.

    Python 3.11 counts a tree's depth in one place for all threads, and another one begun in the
    middle (``ast.literal_eval`` of NumPy and Dask is such too) is a ``SystemError``. That happens
    only where the garbage collector calls Python back, as Dask has it do.
    """
    with _PARSING:
        collecting = gc.isenabled()
        gc.disable()
        try:
            return ast.parse(source).body
        finally:
            if collecting:
                gc.enable()


def _left_out(node: object) -> bool:
    """Return whether a statement is left out: an import, a docstring, the part run as a script."""
    if isinstance(node, ast.If):
        return ast.unparse(node.test).replace('"', "'") == "__name__ == '__main__'"
    return isinstance(node, (ast.Import, ast.ImportFrom)) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    )


def _pieces(values: list[ast.expr]) -> list[ast.expr | str]:
    """Return the parts of an f-string with adjacent texts joined and empty ones dropped, since
    Python versions split them differently.
    """
    joined: list[Any] = [""]
    for value in values:
        if not isinstance(value, ast.Constant):
            joined += [value, ""]
        else:
            joined[-1] += str(value.value)
    return [piece for piece in joined if piece != ""]


def _canonical(node: object) -> str:
    if isinstance(node, list):
        return f"[{','.join(_canonical(item) for item in node if not _left_out(item))}]"
    if not isinstance(node, ast.AST):
        return f"{type(node).__name__}:{node!r}"
    said: dict[str, Any] = {
        name: value
        for name, value in ast.iter_fields(node)
        if name not in _SILENT and value not in (None, [])
    }
    if isinstance(node, ast.JoinedStr):
        said["values"] = _pieces(node.values)
    fields = ",".join(f"{name}={_canonical(said[name])}" for name in sorted(said))
    return f"{type(node).__name__}({fields})"


def source_hash(sources: Iterable[bytes]) -> str:
    """Hash Python sources by their top-level statements, whatever their files and order.

    Comments, docstrings, layout, imports and the block ``if __name__ == "__main__"`` are ignored.

    Parameters
    ----------
    sources : iterable of bytes
        Contents of the files.

    Returns
    -------
    str
        Hex SHA-256.

    Raises
    ------
    SyntaxError
        For a source that is not Python.
    """
    statements = []
    for source in sources:
        statements += [_canonical(node) for node in _parse(source) if not _left_out(node)]
    statements.sort()
    return hashlib.sha256("\n".join(statements).encode("utf-8", "surrogatepass")).hexdigest()
