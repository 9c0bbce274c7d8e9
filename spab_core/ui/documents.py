"""The documents of docs/ on a page: their markdown as it stands, pictures two in a row."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import streamlit as st

from spab_core.common.errors import InputError
from spab_core.common.paths import HOME

DOCS = HOME / "docs"
_PICTURE = re.compile(r"!\[(?P<words>[^\]]*)\]\((?P<path>[^)\s]+)\)\s*")


def read_sections(name: str, needed: Iterable[str] = (), folder: Path = DOCS) -> dict[str, str]:
    """A document's sections: text by heading (of the second level), what stands before the first
    one under "".

    Parameters
    ----------
    name : str
        Of the file.
    needed : iterable of str
        Headings that must be there.
    folder : Path

    Raises
    ------
    InputError
        Where the document cannot be read, or such a heading is missing.
    """
    try:
        text = (folder / name).read_text("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot read {folder / name} ({getattr(error, 'strerror', None) or error}): restore "
            "it from the repository"
        ) from None
    begin, *rest = re.split(r"^## ", text, flags=re.MULTILINE)
    sections = {"": re.sub(r"^# .*\n+", "", begin)}
    for part in rest:
        heading, _, body = part.partition("\n")
        sections[heading.strip()] = body
    for heading in needed:
        if heading not in sections:
            raise InputError(
                f"{folder / name} has no section {heading!r}: restore it from the repository"
            )
    return sections


def show_sections(sections: dict[str, str], folder: Path = DOCS) -> None:
    """Draw sections of a document; pictures' paths are those of ``folder``."""
    for heading, body in sections.items():
        lines = ([f"## {heading}", ""] if heading else []) + body.splitlines()
        for pictures, group in groupby(lines, key=lambda line: bool(_PICTURE.fullmatch(line))):
            found = list(group)
            if pictures:
                _show_pictures(found, folder)
            elif any(line.strip() for line in found):
                st.markdown("\n".join(found))


def _picture(path: Path, words: str) -> str:
    """A picture with its words for those who do not see it."""
    source = base64.b64encode(path.read_bytes()).decode()
    told = html.escape(words)
    return (
        f'<img alt="{told}" style="max-width:100%" src="data:image/png;base64,{source}">'
        f'<p aria-hidden="true" style="font-size:.875rem;opacity:.82">{told}</p>'
    )


def _show_pictures(lines: list[str], folder: Path) -> None:
    for k in range(0, len(lines), 2):
        for place, line in zip(st.columns(2), lines[k : k + 2], strict=False):
            picture = _PICTURE.fullmatch(line)
            assert picture is not None
            path = folder / picture["path"]
            if path.is_file():
                place.html(_picture(path, picture["words"]))
            else:
                place.caption(f"{picture['words']}: the picture {picture['path']} is missing.")
