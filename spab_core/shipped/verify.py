"""Check a folder of shipped files: names, checksums, versions, and that the models reproduce the
shipped maps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spab_core.common.errors import InputError
from spab_core.design.model import Design, reference_design
from spab_core.maps.stability_map import StabilityMap
from spab_core.shipped.build import (
    MAX_FOLDER_BYTES,
    TABLES,
    TOLERANCE,
    _is_model,
    check_intervals,
    table_source,
)
from spab_core.shipped.manifest import (
    ARTIFACTS,
    BIFURCATIONS,
    CLASSIFIER_TABLES,
    FLOORED_PREDICTIONS,
    PREDICTIONS,
    REFERENCE_MAP,
    ArtifactError,
    checked_bytes,
    load_reference_bifurcation,
    load_reference_map,
    load_reference_scores,
    present_files,
    read_manifest,
)
from spab_core.shipped.model_files import SEED, intervals_file, load_shipped_model, model_file
from spab_core.shipped.model_store import predict_with
from spab_core.shipped.predicted_maps import load_shipped_map, maps_file
from spab_core.shipped.preset_maps import MAPS, load_preset_map
from spab_core.shipped.provenance import difference
from spab_core.surrogates.classifier import LABELS
from spab_core.surrogates.metrics import errors
from spab_core.surrogates.models import DIVISORS, FLOOR, MODELS, floored


@dataclass(frozen=True)
class Check:
    """One check of a folder of shipped files.

    Attributes
    ----------
    name : str
        What was checked.
    problem : str
        What is wrong; "" if nothing is.
    """

    name: str
    problem: str = ""

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problem


def verify(folder: Path = ARTIFACTS) -> Iterator[Check]:
    """Check a folder of shipped files; yield each check when it is done.

    Names and checksums match the manifest. Maps of presets are of their designs and of this solver.
    Map, lines, scores and predicted maps can be read and
    belong together. Versions, design, map and code of each model match, before it is opened. Models
    reproduce their noted predictions and the shipped maps, intervals cover as many cells as their
    table says, and the scores are those of the shipped maps.

    Parameters
    ----------
    folder : Path

    Yields
    ------
    Check
    """
    try:
        files = read_manifest(folder)
        present = present_files(folder)
    except (ArtifactError, OSError) as error:
        yield Check("manifest", str(error))
        return
    unnamed = sorted(set(present) - set(files))
    yield Check(
        "every file is named in the manifest", f"not named: {', '.join(unnamed)}" if unnamed else ""
    )
    for name in sorted(files):
        yield _checked(f"SHA-256 of {name}", checked_bytes, name, folder)
    for one in (one for one in MAPS if one.file in files):
        yield _checked(f"{one.file}: design, solver's code", load_preset_map, one, folder)
    try:
        m = load_reference_map(folder)
    except InputError as error:
        yield Check(REFERENCE_MAP, str(error))
        return
    yield Check(
        f"{REFERENCE_MAP}: design of the reference bearing",
        "" if m.design == reference_design() else "the map is of another design",
    )
    for name in BIFURCATIONS:
        if name in files:
            yield _checked(f"{name}: a line of the reference bearing", _check_line, name, folder)
    for name in (*TABLES, PREDICTIONS, FLOORED_PREDICTIONS):
        apart = (
            difference(files[name].get("made_from"), table_source(m, name))
            if name in files
            else "it is missing"
        )
        yield Check(
            f"{name}: versions, code, design, map",
            f"{apart}; `spab train --all` makes it again" if apart else "",
        )
    for name, (names, options) in TABLES.items():
        if name in CLASSIFIER_TABLES:
            yield _checked(
                f"{name}: every fraction, and counts and shares that agree",
                _check_classifiers,
                name,
                folder,
            )
        elif names is None:
            blocks = "split" in options  # whose predicted maps are not shipped
            yield _checked(
                f"{name}: every model and fraction"
                + ("" if blocks else ", and the errors of the shipped maps"),
                _check_scores,
                floored(m, options.get("floor")),
                name,
                folder,
                blocks,
            )
    for name, floor in ((PREDICTIONS, None), (FLOORED_PREDICTIONS, FLOOR)):
        yield _checked(f"{name}: every model and fraction", _check_maps, floored(m, floor), folder)
    for name in filter(_is_model, sorted(files)):
        yield _checked(
            f"{name}: versions, code, design, map; predicts "
            f"{'the shipped map' if name[0] == 's' else 'as noted'}",
            _check_model,
            m,
            name,
            files[name].get("made_from"),
            folder,
        )
    size = sum((folder / name).stat().st_size for name in present)
    yield Check(
        f"{size / 1e6:.1f} MB in all, at most {MAX_FOLDER_BYTES / 1e6:g}",
        "" if size <= MAX_FOLDER_BYTES else "too large for the repository",
    )


def _checked(name: str, check: Callable[..., object], *args: object) -> Check:
    try:
        check(*args)
    except (
        ValueError,
        KeyError,
        TypeError,
    ) as error:  # InputError, and what a table of other columns raises
        return Check(name, str(error) or type(error).__name__)
    return Check(name)


def _check_line(name: str, folder: Path) -> None:
    if (
        Design.from_dict(load_reference_bifurcation(name, folder).metadata["design"])
        != reference_design()
    ):
        raise ArtifactError("the line is of another design")


def _check_maps(m: StabilityMap, folder: Path) -> None:
    for kind in MODELS.values():
        for divisor in DIVISORS:
            if maps_file(m, kind, divisor):
                load_shipped_map(m, kind, divisor, SEED, folder)


def _check_classifiers(name: str, folder: Path) -> None:
    rows = load_reference_scores(folder, name).set_index(["model", "divisor", "seed"])
    if not rows.index.is_unique:
        raise ArtifactError("it has duplicate rows")
    for classifier in LABELS:
        for divisor in DIVISORS:
            if (classifier, divisor, SEED) not in rows.index:
                raise ArtifactError(
                    f"{classifier} n/{divisor} is missing; `spab train --all` makes it again"
                )
    called = rows[rows["called_best"] > 0]
    share = called["unsafe"] / called["called_best"]
    if not (np.abs(share - called["unsafe_share"]) <= TOLERANCE).all():
        raise ArtifactError("unsafe_share is not unsafe over called_best")


def _check_scores(m: StabilityMap, name: str, folder: Path, blocks: bool) -> None:
    scores = load_reference_scores(folder, name).set_index(["model", "divisor", "seed"])
    if not scores.index.is_unique or not np.isfinite(scores["rmse_held_out"]).all():
        raise ArtifactError("it has duplicate rows, or errors that are not numbers")
    for kind in MODELS.values():
        for divisor in DIVISORS:
            if (kind.name, divisor, SEED) not in scores.index:
                raise ArtifactError(
                    f"{kind.name} n/{divisor} is missing; `spab train --all` makes it again"
                )
            if blocks or not maps_file(m, kind, divisor):
                continue
            row = scores.loc[kind.name, divisor, SEED]
            for column, value in errors(
                m, load_shipped_map(m, kind, divisor, SEED, folder)
            ).items():
                if abs(float(row[column]) - value) > TOLERANCE:
                    raise ArtifactError(
                        f"{kind.name} n/{divisor}: {column} is {row[column]:.6g} in the table and "
                        f"{value:.6g} for the shipped map; `spab train --all` makes both again"
                    )


def _check_model(m: StabilityMap, name: str, noted: object, folder: Path) -> None:
    noted = noted if isinstance(noted, dict) else {}
    kind, divisor = MODELS.get(str(noted.get("model"))), noted.get("divisor")
    if kind is not None and isinstance(divisor, int) and name == intervals_file(kind, divisor):
        check_intervals(m, kind, divisor, folder)
        return
    if kind is None or not isinstance(divisor, int) or name != model_file(kind, divisor):
        raise ArtifactError(
            "the manifest does not say what it was made from: it is never opened; `spab train "
            "--all` makes the models again, `git clean` removes what is not of the repository"
        )
    predicted = predict_with(m, load_shipped_model(m, kind, divisor, SEED, folder), divisor)
    shipped = load_shipped_map(m, kind, divisor, SEED, folder)
    apart = float(np.nanmax(np.abs(predicted.mle - shipped.mle)))
    if not apart <= TOLERANCE:
        raise ArtifactError(f"it predicts up to {apart:.3g} per revolution from the shipped map")
