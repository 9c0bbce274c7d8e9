"""What a background job can be (:mod:`spab_core.jobs`): one entry of :data:`KINDS` each."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from spab_core.artifacts import REFERENCE_MAP, load_reference_map, read_manifest
from spab_core.bifurcation import SWEEPS, check_line, compute_bifurcation, save_bifurcation
from spab_core.design import Design, InputError, check_number
from spab_core.map_engine import remove_parts
from spab_core.point import solve_point
from spab_core.point_file import save_point
from spab_core.simulate import Settings, check_point
from spab_core.stability_map import axis

Advance = Callable[[int], None]  # called with the number done since the last call
SetTotal = Callable[..., None]  # set_total(total, kept=0): how many there are, and how many an earlier run has left
_FEW = 20  # tasks that are done before a second process has started


@dataclass(frozen=True)
class Kind:
    """A kind of job.

    Attributes
    ----------
    label : str
        What people read.
    check : callable
        Parameters as given -> the same complete and in one spelling, plain JSON values: equal requests become equal. Raises
        ``InputError``.
    run : callable
        ``run(folder, parameters, advance, set_total)`` does the work in the worker and writes ``result`` into the folder; what
        it keeps there for another start is its own. Raises ``InputError`` where it cannot.
    result : str
        File in the job's folder.
    """

    label: str
    check: Callable[[dict], dict]
    run: Callable[[Path, dict, Advance, SetTotal], None]
    result: str = "result.npz"


def workers_for(tasks: int) -> int:
    """Processes for so many tasks: those of this machine, at most two, one where starting a second does not pay."""
    return min(2, os.cpu_count() or 1) if tasks > _FEW else 1


def _taken(parameters: dict, **defaults) -> list:
    """Values in the order of ``defaults``; one that is ``...`` must be given. Raises ``InputError``."""
    unknown = sorted(set(parameters) - set(defaults))
    missing = [name for name, default in defaults.items() if default is ... and name not in parameters]
    if unknown or missing:
        raise InputError(f"a job's parameters are {', '.join(defaults)}: {', '.join(map(str, unknown or missing))[:60]!r} "
                         f"{'is unknown' if unknown else 'is missing'}")
    return [parameters.get(name, default) for name, default in defaults.items()]


def _settings(given) -> Settings:
    try:
        return Settings(**given)
    except TypeError:
        raise InputError(f"settings = {str(given)[:60]!r}: allowed are {', '.join(Settings().to_dict())}") from None


def _check_bifurcation(parameters: dict) -> dict:
    design, vary, at, line, sweeps, settings = _taken(parameters, design={}, vary=..., at=..., range=..., sweeps=list(SWEEPS),
                                                      settings={"revolutions": 300})
    at = check_number("at", at, 0.0, 1e3)
    if not isinstance(sweeps, (list, tuple)):
        raise InputError(f"sweeps = {str(sweeps)[:60]!r} must be a list of {', '.join(SWEEPS)}")
    values = axis(line, "range")
    check_line(vary, at, values, sweeps)
    start, stop, count = line.split(":")
    return {"design": Design.from_dict(design).to_dict(), "vary": vary, "at": at,
            "range": f"{float(start)!r}:{float(stop)!r}:{int(count)}", "sweeps": [s for s in SWEEPS if s in sweeps],
            "settings": _settings(settings).to_dict()}


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

    result = compute_bifurcation(Design.from_dict(parameters["design"]), parameters["vary"], parameters["at"], values,
                                 Settings(**parameters["settings"]), sweeps=sweeps, workers=workers_for(points), parts=parts,
                                 progress=progress)
    save_bifurcation(result, folder / "result.npz")
    remove_parts(parts)


def _check_point(parameters: dict) -> dict:
    design, mass, number, settings, paths = _taken(parameters, design={}, rotor_mass=..., bearing_number=..., settings={},
                                                   path_revolutions=30)
    check_point(mass, number)
    paths = check_number("path_revolutions", paths, 0, 1000)
    return {"design": Design.from_dict(design).to_dict(), "rotor_mass": float(mass), "bearing_number": float(number),
            "settings": _settings(settings).to_dict(), "path_revolutions": int(paths)}


def _run_point(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    settings = Settings(**parameters["settings"])
    set_total(int(settings.transient + settings.revolutions))  # fewer where the run settles
    save_point(solve_point(Design.from_dict(parameters["design"]), parameters["rotor_mass"], parameters["bearing_number"],
                           settings, path_revolutions=parameters["path_revolutions"], progress=advance), folder / "result.npz")


def _check_intervals(parameters: dict) -> dict:
    from spab_core.pretrained import recipe_hash  # scikit-learn: two seconds that the other kinds need not wait
    from spab_core.surrogates import DIVISORS, model

    name, divisor, seed, made_from = _taken(parameters, model=..., divisor=..., seed=0, made_from=None)
    if divisor not in DIVISORS:
        raise InputError(f"divisor = {str(divisor)[:20]} is not allowed: choose {', '.join(map(str, DIVISORS))}")
    now = {"map": read_manifest().get(REFERENCE_MAP, {}).get("sha256"), "recipe": recipe_hash()}
    if made_from not in (None, now):
        raise InputError("the shipped map or the models' code is another since; start it again")
    return {"model": model(name).name, "divisor": divisor, "seed": int(check_number("seed", seed, 0, 999)), "made_from": now}


def _run_intervals(folder: Path, parameters: dict, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.surrogates import model
    from spab_core.uncertainty import STEPS, save_intervals, uncertain_map

    set_total(STEPS)
    found = uncertain_map(load_reference_map(), model(parameters["model"]), parameters["divisor"], parameters["seed"],
                          progress=advance)
    save_intervals(found, folder / "result.npz")


KINDS = {
    "bifurcation": Kind("Bifurcation line", _check_bifurcation, _run_bifurcation),
    "point": Kind("Operating point", _check_point, _run_point),
    "intervals": Kind("Intervals of a surrogate", _check_intervals, _run_intervals),
}
