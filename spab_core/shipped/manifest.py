"""Read the files in artifacts/; check each against its SHA-256 in manifest.json first."""

from __future__ import annotations

import hashlib
import io
import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from spab_core.common.errors import InputError
from spab_core.common.files import check_writable, write_atomically
from spab_core.common.paths import HOME
from spab_core.maps.bifurcation import Bifurcation, load_bifurcation
from spab_core.maps.stability_map import StabilityMap, load_map

if TYPE_CHECKING:
    from spab_core.active_learning.refine import Refinement

ARTIFACTS = HOME / "artifacts"
AUDIT = HOME / "docs" / "audit.csv"
REFERENCE_MAP = "reference_map.npz"
SCORES = "surrogate_scores.csv"
BLOCK_SCORES = "surrogate_scores_blocks.csv"  # on withheld rectangles of the plane
UNCERTAINTY = "surrogate_uncertainty.csv"  # regimes, intervals, probability of instability
# how well regime and assessment are told by classifiers
CLASSIFIERS = "surrogate_classifiers.csv"
BLOCK_CLASSIFIERS = "surrogate_classifiers_blocks.csv"
CLASSIFIER_TABLES = (CLASSIFIERS, BLOCK_CLASSIFIERS)
PREDICTIONS = "surrogate_maps.npz"
# the same of the map whose exponents end at models.FLOOR
FLOORED_SCORES = "surrogate_scores_floored.csv"
FLOORED_BLOCK_SCORES = "surrogate_scores_blocks_floored.csv"
FLOORED_PREDICTIONS = "surrogate_maps_floored.npz"  # of the paper's models and figures alone
# measured by benchmarks/surrogates.py: not part of what is rebuilt to the bit
SECONDS = "surrogate_seconds.csv"
MANIFEST = "manifest.json"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")  # of a file there
REFINED = "refined_map.npz"
BIFURCATIONS = (
    "bifurcation_rotor_mass.npz",
    "bifurcation_bearing_number.npz",
)  # at Lambda 3.45, at 4.52 kg


class ArtifactError(InputError):
    """A shipped file that is missing, changed or not in the manifest."""


def sha256(path: Path) -> str:
    """Return the hex SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_manifest(folder: Path = ARTIFACTS) -> dict[str, dict[str, Any]]:
    """Return the entries of the manifest by file name.

    Returns
    -------
    dict
        ``sha256``, ``bytes`` and, for files computed from a map, ``made_from``
        (:mod:`spab_core.shipped.provenance`).

    Raises
    ------
    ArtifactError
        If it is missing or no manifest.
    """
    try:
        files: dict[str, dict[str, Any]] = json.loads((folder / MANIFEST).read_text("utf-8"))[
            "files"
        ]
        if not all(
            isinstance(entry["sha256"], str) and _NAME.fullmatch(name)
            for name, entry in files.items()
        ):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ArtifactError(
            f"{folder / MANIFEST} is missing or no manifest: restore the folder from the "
            "repository, or run "
            "`python -m spab_core.shipped.manifest` after replacing a file on purpose"
        ) from None
    return files


def present_files(folder: Path = ARTIFACTS) -> list[str]:
    """Return the names of the files that a manifest must name, sorted."""
    return sorted(
        p.name for p in folder.iterdir() if p.name != MANIFEST and not p.name.startswith(".")
    )


def write_manifest(
    folder: Path = ARTIFACTS, made_from: dict[str, dict[str, Any]] | None = None
) -> dict[str, Any]:
    """Write manifest.json for all files of the folder.

    Parameters
    ----------
    folder : Path
    made_from : dict
        By file name: what the files were computed from. A file left out keeps its entry if its
        bytes are unchanged, else the entry is dropped.

    Returns
    -------
    dict
        The manifest.
    """
    try:
        before = read_manifest(folder)
    except ArtifactError:
        before = {}
    files: dict[str, dict[str, Any]] = {}
    for name in present_files(folder):
        path = folder / name
        entry = files[name] = {"sha256": sha256(path), "bytes": path.stat().st_size}
        old = before.get(name, {})
        source = (made_from or {}).get(
            name, old.get("made_from") if old.get("sha256") == entry["sha256"] else None
        )
        if source is not None:
            entry["made_from"] = source
    manifest = {"files": files}
    write_atomically(folder / MANIFEST, (json.dumps(manifest, indent=1) + "\n").encode())
    return manifest


def checked_bytes(name: str, folder: Path = ARTIFACTS) -> bytes:
    """Return a shipped file's bytes after checking their SHA-256; the file is read once, so it
    cannot be swapped in between.

    Raises
    ------
    ArtifactError
        If the file or the manifest is missing or damaged, or the checksums differ.
    """
    files = read_manifest(folder)
    path = folder / name
    if name not in files:
        raise ArtifactError(
            f"{name} is not named in {folder / MANIFEST}: restore the folder from the repository, "
            "or run `python -m spab_core.shipped.manifest` after replacing a file on purpose"
        )
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ArtifactError(f"cannot read {path}: {error.strerror or error}") from None
    if hashlib.sha256(data).hexdigest() != files[name]["sha256"]:
        raise ArtifactError(
            f"{path} is not the file that the manifest names (its SHA-256 differs): restore it "
            "from the repository, or run `python -m spab_core.shipped.manifest` after replacing it "
            "on purpose"
        )
    return data


def checked_path(name: str, folder: Path = ARTIFACTS) -> Path:
    """Return the path of a shipped file after checking its SHA-256. Raises as
    :func:`checked_bytes`.
    """
    checked_bytes(name, folder)
    return folder / name


def load_reference_map(folder: Path = ARTIFACTS) -> StabilityMap:
    """Load the shipped map of the reference design. Raises ``ArtifactError`` or ``MapError``."""
    return load_map(checked_path(REFERENCE_MAP, folder))


def load_reference_bifurcation(name: str, folder: Path = ARTIFACTS) -> Bifurcation:
    """Load a shipped line of :data:`BIFURCATIONS`. Raises ``ArtifactError`` or ``InputError``."""
    return load_bifurcation(checked_path(name, folder))


def load_reference_scores(folder: Path = ARTIFACTS, name: str = SCORES) -> pd.DataFrame:
    """Load shipped scores on the reference map (``metrics.evaluate``).

    ``name`` is one of :data:`SCORES`, :data:`BLOCK_SCORES`, those with a floor, and
    :data:`CLASSIFIERS`, :data:`BLOCK_CLASSIFIERS`. Raises :class:`ArtifactError`.
    """
    wanted = {"model", "divisor", "seed"}
    if name in CLASSIFIER_TABLES:
        wanted |= {"accuracy", "balanced_accuracy", "called_best", "unsafe", "unsafe_share"}
    else:
        wanted |= {"rmse_held_out", "converged"}
    try:
        scores = pd.read_csv(io.BytesIO(checked_bytes(name, folder)))
        if scores.empty or not wanted <= set(scores.columns):
            raise ValueError("columns are missing")
    except (OSError, ValueError) as error:
        raise ArtifactError(f"cannot read {name}: {error}") from None
    return scores


def load_reference_refinement(folder: Path = ARTIFACTS) -> Refinement:
    """Load the shipped map refined from n/16 of its cells.

    Raises :class:`ArtifactError` or ``MapError``.
    """
    from spab_core.active_learning.refine import load_refinement  # it loads scikit-learn

    return load_refinement(checked_path(REFINED, folder))


def load_audit(path: Path) -> pd.DataFrame:
    """Load the cells of the map that benchmarks/audit_map.py solved again, finer and longer.

    Raises :class:`ArtifactError`.
    """
    try:
        rows = pd.read_csv(path, keep_default_na=False, na_values={"mle": "", "error": ""})
        if missing := {"map_regime", "map_mle", "regime", "mle", "error"} - set(rows.columns):
            raise ValueError(f"no column {sorted(missing)[0]!r}")
    except (OSError, ValueError) as error:
        told = getattr(error, "strerror", None) or error
        raise ArtifactError(
            f"cannot read {path} ({told}): `python benchmarks/audit_map.py` makes it"
        ) from None
    return rows


def _main() -> int:
    try:
        check_writable(ARTIFACTS, MANIFEST)
        for name, entry in write_manifest()["files"].items():
            print(name, entry["bytes"], entry["sha256"])
    except (InputError, OSError) as error:
        print(f"manifest: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(_main())
