"""The licences of everything installed beside spab, from the packages' own metadata:
docs/licences.md (``make licences``).
"""

import re
from collections import Counter
from importlib.metadata import Distribution, distributions
from pathlib import Path

LIST = Path(__file__).resolve().parent.parent / "docs" / "licences.md"
LOCK = LIST.parent.parent / "requirements.lock"
PREFIX = "License :: OSI Approved :: "


def licence(found: Distribution) -> str:
    """A package's licence: its SPDX expression, else its classifiers, else the first line of its
    text.
    """
    about = found.metadata
    if about.get("License-Expression"):
        return about["License-Expression"]
    classified = [
        c.removeprefix(PREFIX) for c in about.get_all("Classifier") or [] if c.startswith(PREFIX)
    ]
    if classified:
        return ", ".join(classified)
    lines = [line.strip() for line in (about.get("License") or "").splitlines() if line.strip()]
    return lines[0] if lines else "not told"


def table(locked: set[str]) -> str:
    """The document: one row a locked package that is installed here."""
    rows = sorted(
        {
            (d.metadata["Name"].lower().replace("_", "-"), d.version, licence(d))
            for d in distributions()
        }
    )
    rows = [row for row in rows if row[0] in locked]
    count = ", ".join(f"{name} {n}" for name, n in Counter(row[2] for row in rows).most_common())
    head = (
        "# Licences\n\nOf every package in `requirements.lock` that is installed here, as its own "
        "metadata tell it (`make licences`). spab itself is under the MIT licence.\n\n"
        f"{len(rows)} packages: {count}.\n\n| package | version | licence |\n|---|---|---|\n"
    )
    return head + "".join(f"| {name} | {version} | {told} |\n" for name, version, told in rows)


if __name__ == "__main__":
    names = {name.lower() for name in re.findall(r"^([\w.-]+)==", LOCK.read_text(), re.MULTILINE)}
    LIST.write_text(table(names))
    print(f"{LIST}: {len(LIST.read_text().splitlines())} lines")
