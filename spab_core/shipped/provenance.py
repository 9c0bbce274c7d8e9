"""Note what a trained model or predicted map was made from (design, map, versions, training code)
and compare it with the present.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
import platform
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from spab_core.common.source_hash import source_hash
from spab_core.design.model import Design
from spab_core.linear_theory import linear_table as features
from spab_core.maps.stability_map import FIELDS, OPTIONAL, StabilityMap
from spab_core.surrogates import classifier, uncertainty
from spab_core.surrogates import models as surrogates
from spab_core.surrogates import theory_trees as theory_models
from spab_core.surrogates.models import Model

LIBRARIES = ("numpy", "scipy", "scikit-learn", "joblib", "numba")

MEANING = {"scikit-learn": 2, "numpy": 1}  # how many numbers of a version say what a pickle means

RECIPE = (
    features,
    surrogates,
    theory_models,
)  # modules whose code makes a trained model what it is

INTERVALS_RECIPE = (*RECIPE, classifier, uncertainty)


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions noted with a model: Python's major and minor, the libraries' in full."""
    return {"python": ".".join(platform.python_version_tuple()[:2])} | {
        name: importlib.metadata.version(name) for name in LIBRARIES
    }


def _meaning(name: str, version: object) -> str:
    return ".".join(str(version).split(".")[: MEANING[name]])[:20]


def design_hash(design: Design) -> str:
    """Return the SHA-256 of a design's values."""
    return hashlib.sha256(json.dumps(design.told(), sort_keys=True).encode()).hexdigest()


def map_hash(m: StabilityMap) -> str:
    """Return the SHA-256 of a map's axes and cells, without its metadata (date, versions)."""
    digest = hashlib.sha256()
    for name, dtype in {"bearing_number": np.float64, "rotor_mass": np.float64, **FIELDS}.items():
        array = np.ascontiguousarray(getattr(m, name), dtype)
        if name in OPTIONAL and np.isnan(array).all():
            continue  # of a map that was made before there was such an array
        digest.update(f"{name} {array.shape} {array.dtype.str}".encode() + array.tobytes())
    return digest.hexdigest()


def mask_hash(trained: np.ndarray) -> str:
    """Return the SHA-256 of a mask of training cells."""
    return hashlib.sha256(np.packbits(trained).tobytes()).hexdigest()


@functools.cache
def recipe_hash(modules: tuple[ModuleType, ...] = RECIPE) -> str:
    """Return the hash of modules' code, whatever its layout or folder
    (:mod:`spab_core.common.source_hash`).
    """
    return source_hash(Path(str(module.__file__)).read_bytes() for module in modules)


def made_from(m: StabilityMap, recipe: tuple[ModuleType, ...] = RECIPE) -> dict[str, Any]:
    """Return everything that results of surrogates on a map depend on: ``versions``, ``recipe``,
    ``design``, ``map``.
    """
    return {
        "versions": versions(),
        "recipe": recipe_hash(recipe),
        "design": design_hash(m.design),
        "map": map_hash(m),
    }


def model_source(m: StabilityMap, kind: Model, divisor: int, seed: int) -> dict[str, Any]:
    """Return :func:`made_from` with ``model``, ``divisor`` and ``seed`` of a trained model."""
    return made_from(m) | {"model": kind.name, "divisor": divisor, "seed": seed}


def intervals_source(m: StabilityMap, kind: Model, divisor: int, seed: int) -> dict[str, Any]:
    """Return :func:`model_source` for the models behind intervals."""
    return model_source(m, kind, divisor, seed) | {"recipe": recipe_hash(INTERVALS_RECIPE)}


def classifiers_source(m: StabilityMap) -> dict[str, Any]:
    """Return :func:`made_from` for scores of classifiers, with a hash of the map's
    ``assessments``, whose rules may change.
    """
    grades = hashlib.sha256("\n".join(m.grades().ravel().tolist()).encode()).hexdigest()
    return made_from(m, INTERVALS_RECIPE) | {"assessments": grades}


def difference(noted: object, wanted: dict[str, Any]) -> str | None:
    """Return the first difference between ``noted`` and ``wanted`` as a clause; None if they agree.

    Of a version only as many numbers as in :data:`MEANING` count.

    Parameters
    ----------
    noted : object
        Entry of a manifest or side file; may be any JSON value.
    wanted : dict
        Result of :func:`made_from` or :func:`model_source`, or part of it.
    """
    if not isinstance(noted, dict):
        return "there is no note of what it was made from"
    found = noted.get("versions")
    for name, now in (
        (name, _meaning(name, wanted["versions"][name])) for name in MEANING if "versions" in wanted
    ):
        before = _meaning(name, found.get(name) if isinstance(found, dict) else None)
        if before != now:
            return f"it was made with {name} {before} and this is {name} {now}"
    words = {
        "design": "it was made for another design",
        "map": "it was made from another map",
        "recipe": "the code that makes it has changed since",
        "assessments": "cells of the map are assessed otherwise since",
        "solver": "the solver's code has changed since",
    }
    for key in wanted.keys() - {"versions"}:
        if noted.get(key) != wanted[key]:
            return words.get(key, f"it has {key} {str(noted.get(key))[:40]} and not {wanted[key]}")
    return None
