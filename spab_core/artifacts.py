"""What is shipped in artifacts/: every file named in manifest.json with its SHA-256, checked before it is read."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path

import pandas as pd

from spab_core.bifurcation import Bifurcation, load_bifurcation
from spab_core.design import InputError, write_atomically
from spab_core.refine import Refinement, load_refinement
from spab_core.stability_map import StabilityMap, load_map

ARTIFACTS = Path(__file__).resolve().parent.parent / "artifacts"
REFERENCE_MAP = "reference_map.npz"
SCORES = "surrogate_scores.csv"
REFINED = "refined_map.npz"
BIFURCATIONS = ("bifurcation_rotor_mass.npz", "bifurcation_bearing_number.npz")  # at Lambda 3.45, at 4.52 kg


class ArtifactError(InputError):
    """A shipped file that is missing, changed or not in the manifest."""


def sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_manifest(folder: Path = ARTIFACTS) -> dict:
    """Write manifest.json for all files of the folder; returns what it holds."""
    files = {p.name: {"sha256": sha256(p), "bytes": p.stat().st_size}
             for p in sorted(folder.iterdir()) if p.name != "manifest.json" and not p.name.startswith(".")}
    manifest = {"files": files}
    write_atomically(folder / "manifest.json", (json.dumps(manifest, indent=1) + "\n").encode())
    return manifest


def checked_path(name: str, folder: Path = ARTIFACTS) -> Path:
    """Path of a shipped file after its checksum is checked.

    Raises
    ------
    ArtifactError
        Where the file or the manifest is missing or damaged, or the checksums differ.
    """
    try:
        files = json.loads((folder / "manifest.json").read_text("utf-8"))["files"]
        expected = files[name]["sha256"]
    except (OSError, ValueError, KeyError, TypeError):
        raise ArtifactError(f"{name} is not named in {folder / 'manifest.json'}: restore the folder from the repository, "
                            "or run `make manifest` after replacing a file on purpose") from None
    path = folder / name
    try:
        found = sha256(path)
    except OSError as error:
        raise ArtifactError(f"cannot read {path}: {error.strerror or error}") from None
    if found != expected:
        raise ArtifactError(f"{path} is not the file that the manifest names (its SHA-256 differs): restore it from the "
                            "repository, or run `make manifest` after replacing it on purpose")
    return path


def load_reference_map(folder: Path = ARTIFACTS) -> StabilityMap:
    """The shipped map of the reference design. Raises :class:`ArtifactError` or ``MapError``."""
    return load_map(checked_path(REFERENCE_MAP, folder))


def load_reference_bifurcation(name: str, folder: Path = ARTIFACTS) -> Bifurcation:
    """A shipped line of :data:`BIFURCATIONS`. Raises :class:`ArtifactError` or ``InputError``."""
    return load_bifurcation(checked_path(name, folder))


def load_reference_scores(folder: Path = ARTIFACTS) -> pd.DataFrame:
    """The shipped scores of all surrogates on the reference map (``evaluation.evaluate``). Raises :class:`ArtifactError`."""
    try:
        scores = pd.read_csv(io.BytesIO(checked_path(SCORES, folder).read_bytes()))
        if scores.empty or not {"model", "divisor", "seed", "rmse_held_out", "converged"} <= set(scores.columns):
            raise ValueError("columns are missing")
    except (OSError, ValueError) as error:
        raise ArtifactError(f"cannot read {SCORES}: {error}") from None
    return scores


def load_reference_refinement(folder: Path = ARTIFACTS) -> Refinement:
    """The shipped map refined from n/16 of its cells. Raises :class:`ArtifactError` or ``MapError``."""
    return load_refinement(checked_path(REFINED, folder))


if __name__ == "__main__":
    for file_name, entry in write_manifest()["files"].items():
        print(file_name, entry["bytes"], entry["sha256"])
