"""Where the dashboard, the shipped files and the documents lie."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent.parent
IMPORTED_FROM = _PACKAGE.parent  # the folder on the path in which Python finds spab_core
# app.py, pages/, artifacts/ and docs/: packed into the package where it was installed from a wheel,
# else beside it
HOME = _PACKAGE / "dashboard" if (_PACKAGE / "dashboard").is_dir() else _PACKAGE.parent
