"""What a background job can be (:mod:`spab_core.jobs.store`): one entry of :data:`KINDS` each.

Modules with scikit-learn are imported by the kinds that need them: a second that a worker of
another kind need not wait."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.private_folders import own_bytes
from spab_core.common.validation import check_number
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.maps.bifurcation import SWEEPS, check_line, compute_bifurcation, save_bifurcation
from spab_core.maps.sensitivity import (
    AXES,
    SCAN,
    SETTINGS,
    STEP,
    STEPS,
    check_margin,
    save_sensitivity,
    sensitivity,
    variations,
)
from spab_core.maps.stability_map import axis
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.point_file import save_point
from spab_core.trajectory.settings import Settings

Advance = Callable[[int], None]  # called with the number done since the last call
SetTotal = Callable[
    ..., None
]  # set_total(total, kept=0): how many there are, and how many an earlier run has left
SAMPLES = "samples.npz"  # of a ranking, in its folder
_FEW = 20  # tasks that are done before a second process has started


@dataclass(frozen=True)
class Kind:
    """A kind of job.

    Attributes
    ----------
    label : str
        What people read.
    check : callable
        Parameters as given -> the same complete and in one spelling, plain JSON values: equal
        requests become equal. Raises ``InputError``.
    run : callable
        ``run(folder, parameters, advance, set_total)`` does the work in the worker and writes
        ``result`` into the folder; what it keeps there for another start is its own; ``parts`` is
        deleted after the end. Raises ``InputError`` where it cannot.
    result : str
        File in the job's folder.
    grows : bool
        Whether the result is written more than once, better each time, so that one that is there
        need not be the last.
    resumes : bool
        Whether it keeps what it has solved, so that another start goes on from there.
    """

    label: str
    check: Callable[[dict], dict]
    run: Callable[[Path, dict, Advance, SetTotal], None]
    result: str = "result.npz"
    grows: bool = False
    resumes: bool = False

    @property
    def again(self) -> str:
        """What to do after it was stopped, in words."""
        return "start it again to go on" if self.resumes else "start it again from the beginning"


def workers_for(tasks: int) -> int:
    """Processes for so many tasks: those of this machine, at most two, one where starting a second
    does not pay.
    """
    return min(2, os.cpu_count() or 1) if tasks > _FEW else 1


def _taken(parameters: dict, **defaults) -> list:
    """Values in the order of ``defaults``; one that is ``...`` must be given.

    Raises ``InputError``.
    """
    unknown = sorted(set(parameters) - set(defaults))
    missing = [
        name for name, default in defaults.items() if default is ... and name not in parameters
    ]
    if unknown or missing:
        raise InputError(
            f"a job's parameters are {', '.join(defaults)}: "
            f"{', '.join(map(str, unknown or missing))[:60]!r} "
            f"{'is unknown' if unknown else 'is missing'}"
        )
    return [parameters.get(name, default) for name, default in defaults.items()]


def _settings(given) -> Settings:
    try:
        return Settings(**given)
    except TypeError:
        raise InputError(
            f"settings = {str(given)[:60]!r}: allowed are {', '.join(Settings().to_dict())}"
        ) from None


def _check_bifurcation(parameters: dict) -> dict:
    design, vary, at, line, sweeps, settings = _taken(
        parameters,
        design={},
        vary=...,
        at=...,
        range=...,
        sweeps=list(SWEEPS),
        settings={"revolutions": 300},
    )
    at = check_number("at", at, 0.0, 1e3)
    if not isinstance(sweeps, (list, tuple)):
        raise InputError(f"sweeps = {str(sweeps)[:60]!r} must be a list of {', '.join(SWEEPS)}")
    values = axis(line, "range")
    check_line(vary, at, values, sweeps)
    start, stop, count = line.split(":")
    return {
        "design": Design.from_dict(design).to_dict(),
        "vary": vary,
        "at": at,
        "range": f"{float(start)!r}:{float(stop)!r}:{int(count)}",
        "sweeps": [s for s in SWEEPS if s in sweeps],
        "settings": _settings(settings).to_dict(),
    }


def _run_bifurcation(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    values, sweeps = axis(parameters["range"], "range"), parameters["sweeps"]
    points, parts, first = len(values) * len(sweeps), folder / "parts", True

    def progress(count: int) -> None:
        nonlocal first
        if first:
            set_total(points, kept=count)
        else:
            advance(count)
        first = False

    result = compute_bifurcation(
        Design.from_dict(parameters["design"]),
        parameters["vary"],
        parameters["at"],
        values,
        Settings(**parameters["settings"]),
        sweeps=sweeps,
        workers=workers_for(points),
        checkpoint=parts,
        progress=progress,
    )
    save_bifurcation(result, folder / "result.npz")


def _check_point(parameters: dict) -> dict:
    design, mass, number, settings, paths = _taken(
        parameters, design={}, rotor_mass=..., bearing_number=..., settings={}, path_revolutions=30
    )
    check_point(mass, number)
    paths = check_number("path_revolutions", paths, 0, 1000)
    return {
        "design": Design.from_dict(design).to_dict(),
        "rotor_mass": float(mass),
        "bearing_number": float(number),
        "settings": _settings(settings).to_dict(),
        "path_revolutions": int(paths),
    }


def _run_point(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    settings = Settings(**parameters["settings"])
    compile_once()
    set_total(int(settings.transient + settings.revolutions))  # fewer where the run settles
    save_point(
        solve_point(
            Design.from_dict(parameters["design"]),
            parameters["rotor_mass"],
            parameters["bearing_number"],
            settings,
            path_revolutions=parameters["path_revolutions"],
            progress=advance,
        ),
        folder / "result.npz",
    )


def _check_sensitivity(parameters: dict) -> dict:
    design, mass, speed, along, step, scan, settings = _taken(
        parameters,
        design={},
        rotor_mass=...,
        speed_rpm=...,
        axis=AXES[0],
        step=STEP,
        scan=SCAN,
        settings=SETTINGS.to_dict(),
    )
    found = Design.from_dict(design)
    check_margin(found, mass, speed, along, scan)
    return {
        "design": found.to_dict(),
        "rotor_mass": float(mass),
        "speed_rpm": float(speed),
        "axis": along,
        "step": check_number("step", step, *STEPS),
        "scan": int(scan),
        "settings": _settings(settings).to_dict(),
    }


def _run_sensitivity(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    given = parameters | {
        "design": Design.from_dict(parameters["design"]),
        "settings": Settings(**parameters["settings"]),
    }
    set_total(1 + len(variations(given["design"], given["step"])))
    save_sensitivity(
        *sensitivity(**given, workers=min(2, os.cpu_count() or 1), progress=advance),
        folder / "result.json",
    )


def _check_ranking(parameters: dict) -> dict:
    from spab_core.surrogates.models import MODELS, model

    design, samples, models = _taken(parameters, design={}, samples=..., models=list(MODELS))
    if not isinstance(samples, str) or not re.fullmatch("[0-9a-f]{64}", samples):
        raise InputError(
            f"samples = {str(samples)[:60]!r} must be the SHA-256 of {SAMPLES}, which is put "
            "beside the job"
        )
    if not isinstance(models, list) or not models:
        raise InputError(f"models = {str(models)[:60]!r} must be a list of {', '.join(MODELS)}")
    return {
        "design": Design.from_dict(design).to_dict(),
        "samples": samples,
        "models": [model(str(name)).name for name in models],
    }


def _run_ranking(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.common.files import csv_bytes
    from spab_core.surrogates.models import DIVISORS, model
    from spab_core.surrogates.user_data import MAX_BYTES, SEEDS, load_samples, rank_samples

    data = own_bytes(folder / SAMPLES, MAX_BYTES)
    if hashlib.sha256(data).hexdigest() != parameters["samples"]:
        raise InputError(f"{SAMPLES} is not the file that this job was asked for")
    kinds = [model(name) for name in parameters["models"]]
    set_total(len(kinds) * len(DIVISORS) * len(SEEDS))
    scores = rank_samples(
        load_samples(folder / SAMPLES),
        Design.from_dict(parameters["design"]),
        kinds,
        progress=advance,
    )
    write_atomically(folder / "result.csv", csv_bytes(scores))


def _check_map(parameters: dict) -> dict:
    from spab_core.active_learning.quick_map import (
        SECONDS,
        SETTINGS,
        check_cluster,
        check_quick_map,
    )

    design, number, mass, seconds, seed, settings, cluster = _taken(
        parameters,
        design={},
        bearing_number=...,
        rotor_mass=...,
        seconds=SECONDS,
        seed=0,
        settings=SETTINGS.to_dict(),
        dask="",
    )
    check_quick_map(number, mass, seconds)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**32:
        raise InputError(f"seed = {str(seed)[:40]} must be a whole number from 0 to {2**32 - 1}")
    return {
        "design": Design.from_dict(design).to_dict(),
        "bearing_number": str(number),
        "rotor_mass": str(mass),
        "seconds": float(seconds),
        "seed": seed,
        "settings": _settings(settings).to_dict(),
        "dask": check_cluster(cluster),
    }


def _run_map(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.active_learning.quick_map import check_quick_map, quick_map
    from spab_core.active_learning.refine import save_refinement

    seconds, gone = parameters["seconds"], 0.0
    set_total(round(seconds))

    def progress(more: float) -> None:
        nonlocal gone
        before, gone = int(gone), min(gone + more, seconds)
        advance(int(gone) - before)

    number, mass = check_quick_map(parameters["bearing_number"], parameters["rotor_mass"], seconds)
    for result in quick_map(
        Design.from_dict(parameters["design"]),
        number,
        mass,
        Settings(**parameters["settings"]),
        seconds=seconds,
        seed=parameters["seed"],
        checkpoint=folder / "parts",
        workers=min(2, os.cpu_count() or 1),
        cluster=parameters["dask"] or None,
        progress=progress,
    ):
        save_refinement(result, folder / "result.npz")


def _check_intervals(parameters: dict) -> dict:
    from spab_core.shipped.manifest import REFERENCE_MAP, read_manifest
    from spab_core.shipped.model_store import INTERVALS_RECIPE, recipe_hash
    from spab_core.surrogates.models import DIVISORS, model

    name, divisor, seed, made_from = _taken(
        parameters, model=..., divisor=..., seed=0, made_from=None
    )
    if divisor not in DIVISORS:
        raise InputError(
            f"divisor = {str(divisor)[:20]} is not allowed: choose {', '.join(map(str, DIVISORS))}"
        )
    now = {
        "map": read_manifest().get(REFERENCE_MAP, {}).get("sha256"),
        "recipe": recipe_hash(INTERVALS_RECIPE),
    }
    if made_from not in (None, now):
        raise InputError("the shipped map or the models' code is another since; start it again")
    return {
        "model": model(str(name)).name,
        "divisor": divisor,
        "seed": int(check_number("seed", seed, 0, 999)),
        "made_from": now,
    }


def _run_intervals(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.shipped.manifest import load_reference_map
    from spab_core.shipped.model_store import shipped_certainty
    from spab_core.surrogates.models import model
    from spab_core.surrogates.uncertainty import STEPS, save_intervals, uncertain_map

    set_total(STEPS)
    m, kind, divisor, seed = (
        load_reference_map(),
        model(parameters["model"]),
        parameters["divisor"],
        parameters["seed"],
    )
    found = uncertain_map(
        m, kind, divisor, seed, progress=advance, known=shipped_certainty(m, kind, divisor, seed)[0]
    )
    save_intervals(found, folder / "result.npz")


KINDS = {
    "bifurcation": Kind("Bifurcation line", _check_bifurcation, _run_bifurcation, resumes=True),
    "point": Kind("Operating point", _check_point, _run_point),
    "map": Kind("Map of a bearing", _check_map, _run_map, grows=True, resumes=True),
    "sensitivity": Kind("What if", _check_sensitivity, _run_sensitivity, "result.json"),
    "ranking": Kind("Ranking on own data", _check_ranking, _run_ranking, "result.csv"),
    "intervals": Kind("Intervals of a surrogate", _check_intervals, _run_intervals),
}
