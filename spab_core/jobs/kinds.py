"""The kinds of background jobs (:mod:`spab_core.jobs.store`): one entry of :data:`KINDS` each.

Modules that load scikit-learn are imported inside the kinds that need them, so that workers of
other kinds start a second earlier.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Protocol

from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.private_folders import own_bytes
from spab_core.common.validation import check_choice, check_number
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
from spab_core.trajectory.assessment import DEFAULT_LIMITS, Limits
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.point_file import save_point
from spab_core.trajectory.settings import Settings

Values = dict[str, Any]  # plain JSON values by name


class Advance(Protocol):
    """Callback that takes how many more are done, and what is being done now if that changed."""

    def __call__(self, count: int, doing: str = "") -> None: ...


class SetTotal(Protocol):
    """Callback that takes how much there is to do, and how much of it an earlier run has done."""

    def __call__(self, total: int, kept: int = 0) -> None: ...


SAMPLES = "samples.npz"  # of a ranking, in its folder
_FEW = 20  # tasks that are done before a second process has started


@dataclass(frozen=True)
class JobKind:
    """A kind of job.

    Attributes
    ----------
    label : str
        Its name on pages.
    request : type
        Dataclass of the job's parameters. It fills in defaults and writes every value in one way,
        as plain JSON, so that equal requests compare equal. Raises ``InputError``.
    run : callable
        ``run(folder, parameters, advance, set_total)`` does the work in the worker and writes
        ``result`` into the folder. It may keep there what another start needs; the subfolder
        ``parts`` is deleted at the end. Raises ``InputError`` if the work cannot be done.
    result : str
        Name of the result's file in the job's folder.
    grows : bool
        Whether the result is written repeatedly, better each time, so that an existing one need not
        be the last.
    resumes : bool
        Whether another start resumes from the solved part.
    short : bool
        Whether it has a lane of its own beside the long ones, which it does not wait for.
    """

    label: str
    request: type[Any]
    run: Callable[[Path, Values, Advance, SetTotal], None]
    result: str = "result.npz"
    grows: bool = False
    resumes: bool = False
    short: bool = False

    @property
    def again(self) -> str:
        """Advice after the job was stopped, in words."""
        return "start it again to go on" if self.resumes else "start it again from the beginning"

    def check(self, parameters: Values) -> Values:
        """Return the parameters with defaults filled in, as plain JSON values; raise ``InputError``
        if one is wrong.
        """
        known = [f.name for f in fields(self.request)]
        required = {
            f.name for f in fields(self.request) if MISSING is f.default is f.default_factory
        }
        for names, problem in (
            (parameters.keys() - set(known), "unknown"),
            (required - parameters.keys(), "missing"),
        ):
            if names:
                raise InputError(
                    f"a job's parameters are {', '.join(known)}: "
                    f"{', '.join(sorted(map(str, names)))[:60]!r} is {problem}"
                )
        return asdict(self.request(**parameters))


def workers_for(tasks: int) -> int:
    """Return how many processes to use: at most two or the cores of this machine; one if starting a
    second does not pay.
    """
    return min(2, os.cpu_count() or 1) if tasks > _FEW else 1


def _design(given: Any) -> Values:
    return Design.from_dict(given).to_dict()


def _floor(given: Any) -> float | None:
    from spab_core.surrogates.models import FLOORS

    return None if given is None else check_number("floor", given, *FLOORS, "per revolution")


def _limits(given: Any) -> Values:
    """Return what a designer allows as plain values."""
    try:
        return asdict(Limits(**given))
    except TypeError:
        raise InputError(
            f"limits = {str(given)[:60]!r}: allowed are {', '.join(asdict(DEFAULT_LIMITS))}"
        ) from None


def _settings(given: Any, design: Any) -> Values:
    """Return the settings of runs of a design as plain values."""
    try:
        settings = Settings(**given)
    except TypeError:
        raise InputError(
            f"settings = {str(given)[:60]!r}: allowed are {', '.join(Settings().to_dict())}"
        ) from None
    settings.check_design(Design.from_dict(design))
    return settings.to_dict()


@dataclass(kw_only=True)
class _BifurcationRequest:
    design: Any = field(default_factory=dict)
    vary: Any
    at: Any
    range: Any
    sweeps: Any = SWEEPS
    settings: Any = field(default_factory=lambda: {"revolutions": 300})

    def __post_init__(self) -> None:
        self.design = _design(self.design)
        self.at = check_number("at", self.at, 0.0, 1e3)
        if not isinstance(self.sweeps, (list, tuple)):
            raise InputError(
                f"sweeps = {str(self.sweeps)[:60]!r} must be a list of {', '.join(SWEEPS)}"
            )
        check_line(self.vary, self.at, axis(self.range, "range"), self.sweeps)
        start, stop, count = self.range.split(":")
        self.range = f"{float(start)!r}:{float(stop)!r}:{int(count)}"
        self.sweeps = [s for s in SWEEPS if s in self.sweeps]
        self.settings = _settings(self.settings, self.design)


def _run_bifurcation(
    folder: Path, parameters: Values, advance: Advance, set_total: SetTotal
) -> None:
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


@dataclass(kw_only=True)
class _PointRequest:
    design: Any = field(default_factory=dict)
    rotor_mass: Any
    bearing_number: Any
    settings: Any = field(default_factory=dict)
    path_revolutions: Any = 30

    def __post_init__(self) -> None:
        check_point(self.rotor_mass, self.bearing_number)
        self.path_revolutions = int(
            check_number("path_revolutions", self.path_revolutions, 0, 1000)
        )
        self.design = _design(self.design)
        self.rotor_mass, self.bearing_number = float(self.rotor_mass), float(self.bearing_number)
        self.settings = _settings(self.settings, self.design)


def _run_point(folder: Path, parameters: Values, advance: Advance, set_total: SetTotal) -> None:
    settings, design = Settings(**parameters["settings"]), Design.from_dict(parameters["design"])
    compile_once(settings, design)
    set_total(int(settings.transient + settings.revolutions))  # fewer where the run settles
    save_point(
        solve_point(
            design,
            parameters["rotor_mass"],
            parameters["bearing_number"],
            settings,
            path_revolutions=parameters["path_revolutions"],
            progress=advance,
        ),
        folder / "result.npz",
    )


@dataclass(kw_only=True)
class _SensitivityRequest:
    design: Any = field(default_factory=dict)
    rotor_mass: Any
    speed_rpm: Any
    axis: Any = AXES[0]
    step: Any = STEP
    scan: Any = SCAN
    settings: Any = field(default_factory=SETTINGS.to_dict)
    limits: Any = field(default_factory=dict)

    def __post_init__(self) -> None:
        design = Design.from_dict(self.design)
        self.limits = _limits(self.limits)
        check_margin(design, self.rotor_mass, self.speed_rpm, self.axis, self.scan)
        self.design = design.to_dict()
        self.rotor_mass, self.speed_rpm = float(self.rotor_mass), float(self.speed_rpm)
        self.step, self.scan = check_number("step", self.step, *STEPS), int(self.scan)
        self.settings = _settings(self.settings, self.design)


def _run_sensitivity(
    folder: Path, parameters: Values, advance: Advance, set_total: SetTotal
) -> None:
    given = parameters | {
        "design": Design.from_dict(parameters["design"]),
        "settings": Settings(**parameters["settings"]),
        "limits": Limits(**parameters["limits"]),
    }
    set_total(1 + len(variations(given["design"], given["step"])))
    save_sensitivity(
        *sensitivity(**given, workers=min(2, os.cpu_count() or 1), progress=advance),
        folder / "result.json",
    )


def _check_seed(seed: Any) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**32:
        raise InputError(f"seed = {str(seed)[:40]} must be a whole number from 0 to {2**32 - 1}")
    return seed


def _texts(given: Any, name: str) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise InputError(f"{name} = {str(given)[:60]!r} must be texts by the names of values")
    return {str(key): text for key, text in given.items()}


def _look(p: Values, **more: Any) -> Any:
    """Return how a request's machines are solved and judged."""
    from spab_core.drawings.look import Look

    settings, limits = Settings(**p["settings"]), Limits(**p["limits"])
    return Look(p["axis"], p["reach"], settings=settings, limits=limits, **more)


@dataclass(kw_only=True)
class _ToleranceRequest:
    design: Any = field(default_factory=dict)
    rotor_mass: Any
    speed_rpm: Any
    tolerances: Any  # texts by names such as bearing.clearance
    axis: Any = AXES[0]
    reach: Any = None
    machines: Any = None
    half_width: Any = None
    wanted: Any = None
    seed: Any = 0
    settings: Any = field(default_factory=dict)
    limits: Any = field(default_factory=dict)
    dask: Any = ""

    def __post_init__(self) -> None:
        from spab_core.active_learning.quick_map import check_cluster
        from spab_core.design.tolerances import VALUES, Machine, parse_tolerances
        from spab_core.drawings import tolerance
        from spab_core.drawings.look import REACH

        machine = Machine.from_dict(vars(self))
        found = parse_tolerances(_texts(self.tolerances, "tolerances"))
        self.reach = REACH if self.reach is None else self.reach
        self.machines = tolerance.MACHINES if self.machines is None else self.machines
        self.half_width = tolerance.HALF_WIDTH if self.half_width is None else self.half_width
        self.wanted = tolerance.WANTED if self.wanted is None else self.wanted
        self.settings = _settings(self.settings, self.design)
        self.limits = _limits(self.limits)
        look = _look(vars(self))
        check = tolerance.check_study
        check(machine, found, look, self.machines, self.half_width, self.wanted)
        self.machines, self.seed = int(self.machines), _check_seed(self.seed)
        self.reach, self.half_width = float(self.reach), float(self.half_width)
        self.wanted, self.dask = float(self.wanted), check_cluster(self.dask)
        self.design = machine.design.to_dict()
        self.rotor_mass, self.speed_rpm = machine.rotor_mass, machine.speed_rpm
        self.tolerances = {VALUES[t.name].key: t.text for t in found}


def _run_tolerance(folder: Path, parameters: Values, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.design.tolerances import Machine, parse_tolerances
    from spab_core.drawings.tolerance import save_study, tolerance_study

    p = parameters
    set_total(p["machines"])  # fewer where the interval is narrow enough
    study = tolerance_study(
        Machine.from_dict(p),
        parse_tolerances(p["tolerances"]),
        _look(p),
        most=p["machines"],
        half_width=p["half_width"],
        wanted=p["wanted"],
        seed=p["seed"],
        checkpoint=folder / "parts",
        workers=min(2, os.cpu_count() or 1),
        cluster=p["dask"] or None,
        progress=advance,
    )
    save_study(study, folder / "result.json")


@dataclass(kw_only=True)
class _ImproveRequest:
    design: Any = field(default_factory=dict)
    rotor_mass: Any
    speed_rpm: Any
    ranges: Any  # [low, high] in form units, by names such as bearing.clearance
    wishes: Any = None
    tolerances: Any = field(default_factory=dict)
    axis: Any = AXES[0]
    reach: Any = None
    load: Any = 1.0
    grade: Any = "good"
    most_gas_flow: Any = None  # normal litres a minute
    least_stiffness: Any = 0.0  # N/m
    least_film: Any = 0.0  # m
    screened: Any = None
    solved: Any = None
    seed: Any = 0
    settings: Any = field(default_factory=dict)
    limits: Any = field(default_factory=dict)
    dask: Any = ""

    def __post_init__(self) -> None:
        from spab_core.active_learning.quick_map import check_cluster
        from spab_core.design.tolerances import VALUES, parse_tolerances, value_of
        from spab_core.drawings import improve

        self.wishes = list(improve.USUAL_WISHES if self.wishes is None else self.wishes)
        self.reach = improve.REACH if self.reach is None else self.reach
        self.screened = improve.SCREENED if self.screened is None else self.screened
        self.solved = improve.SOLVED if self.solved is None else self.solved
        ranges = {}
        for key, bounds in _texts(self.ranges, "ranges").items():
            try:
                low, high = (float(b) for b in bounds)
            except (TypeError, ValueError):
                raise InputError(f"range of {key[:60]} must be two numbers") from None
            ranges[value_of(key).key] = [low, high]
        found = parse_tolerances(_texts(self.tolerances, "tolerances"))
        self.settings, self.ranges = _settings(self.settings, self.design), ranges
        self.tolerances = {VALUES[t.name].key: t.text for t in found}
        self.limits = _limits(self.limits)
        machine, look, _ = _improving(vars(self))
        by_name = {key.replace(".", "__"): (b[0], b[1]) for key, b in ranges.items()}
        improve.check_improve(
            machine, by_name, self.wishes, look, found, self.screened, self.solved
        )
        self.screened, self.solved = int(self.screened), int(self.solved)
        self.reach, self.load, self.seed = look.reach, look.load, _check_seed(self.seed)
        self.design, self.dask = machine.design.to_dict(), check_cluster(self.dask)
        self.rotor_mass, self.speed_rpm = machine.rotor_mass, machine.speed_rpm


def _improving(p: Values) -> tuple[Any, Any, Any]:
    """Return machine, look and what must hold of a request to improve."""
    from spab_core.design.tolerances import Machine
    from spab_core.drawings.improve import PRECISION, Holds

    flow = float("inf") if p["most_gas_flow"] is None else p["most_gas_flow"]
    look = _look(p, load=p["load"], precision=PRECISION)
    return (
        Machine.from_dict(p),
        look,
        Holds(p["grade"], flow, p["least_stiffness"], p["least_film"]),
    )


def _run_improve(folder: Path, parameters: Values, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.design.tolerances import parse_tolerances
    from spab_core.drawings.improve import improve, save_improvement, steps

    p = parameters
    machine, look, holds = _improving(p)
    tolerances = parse_tolerances(p["tolerances"])
    set_total(steps(p["screened"], p["solved"], bool(tolerances)))
    found = improve(
        machine,
        {key.replace(".", "__"): (b[0], b[1]) for key, b in p["ranges"].items()},
        p["wishes"],
        look,
        holds,
        tolerances,
        screened=p["screened"],
        solved=p["solved"],
        seed=p["seed"],
        checkpoint=folder / "parts",
        workers=min(2, os.cpu_count() or 1),
        cluster=p["dask"] or None,
        progress=advance,
    )
    save_improvement(found, folder / "result.json")


@dataclass(kw_only=True)
class _RankingRequest:
    design: Any = field(default_factory=dict)
    samples: Any  # SHA-256 of the file
    models: Any = None  # all
    floor: Any = None  # of the exponents, per revolution

    def __post_init__(self) -> None:
        from spab_core.surrogates.models import MODELS, model

        if not isinstance(self.samples, str) or not re.fullmatch("[0-9a-f]{64}", self.samples):
            raise InputError(
                f"samples = {str(self.samples)[:60]!r} must be the SHA-256 of {SAMPLES} in the "
                "job's folder"
            )
        names = list(MODELS) if self.models is None else self.models
        if not isinstance(names, list) or not names:
            raise InputError(f"models = {str(names)[:60]!r} must be a list of {', '.join(MODELS)}")
        self.design = _design(self.design)
        self.models = [model(str(name)).name for name in names]
        self.floor = _floor(self.floor)


def _run_ranking(folder: Path, parameters: Values, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.common.files import csv_bytes
    from spab_core.surrogates.models import DIVISORS, model
    from spab_core.surrogates.user_data import MAX_BYTES, SEEDS, load_samples, rank_samples

    data = own_bytes(folder / SAMPLES, MAX_BYTES)
    if hashlib.sha256(data).hexdigest() != parameters["samples"]:
        raise InputError(f"{SAMPLES} is not the file that this job was asked for")
    models = [model(name) for name in parameters["models"]]
    set_total(len(models) * len(DIVISORS) * len(SEEDS))
    scores = rank_samples(
        load_samples(folder / SAMPLES),
        Design.from_dict(parameters["design"]),
        models,
        floor=parameters["floor"],
        progress=advance,
    )
    write_atomically(folder / "result.csv", csv_bytes(scores))


@dataclass(kw_only=True)
class _MapRequest:
    design: Any = field(default_factory=dict)
    bearing_number: Any
    rotor_mass: Any
    seconds: Any = None  # those of a quick map, as for the settings
    seed: Any = 0
    settings: Any = None
    dask: Any = ""  # address of a scheduler; "": this machine

    def __post_init__(self) -> None:
        from spab_core.active_learning import quick_map

        seed, seconds = self.seed, quick_map.SECONDS if self.seconds is None else self.seconds
        quick_map.check_quick_map(self.bearing_number, self.rotor_mass, seconds)
        _check_seed(seed)
        self.design = _design(self.design)
        self.bearing_number, self.rotor_mass = str(self.bearing_number), str(self.rotor_mass)
        self.seconds = float(seconds)
        usual = quick_map.SETTINGS.to_dict()
        self.settings = _settings(usual if self.settings is None else self.settings, self.design)
        self.dask = quick_map.check_cluster(self.dask)


def _run_map(folder: Path, parameters: Values, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.active_learning.quick_map import check_quick_map, quick_map
    from spab_core.active_learning.refine import save_refinement

    seconds, gone = parameters["seconds"], 0.0
    set_total(round(seconds))

    def progress(more: float) -> None:
        nonlocal gone
        before, gone = round(gone), min(gone + more, seconds)
        advance(round(gone) - before)

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
        tell=lambda words: advance(0, words),
    ):
        save_refinement(result, folder / "result.npz")


@dataclass(kw_only=True)
class _IntervalsRequest:
    model: Any
    divisor: Any
    seed: Any = 0
    floor: Any = None  # of the exponents, per revolution
    made_from: Any = None  # hashes of map and code: the present ones

    def __post_init__(self) -> None:
        from spab_core.shipped.manifest import REFERENCE_MAP, read_manifest
        from spab_core.shipped.provenance import INTERVALS_RECIPE, recipe_hash
        from spab_core.surrogates.models import DIVISORS, model

        check_choice("divisor", self.divisor, DIVISORS)
        now = {
            "map": read_manifest().get(REFERENCE_MAP, {}).get("sha256"),
            "recipe": recipe_hash(INTERVALS_RECIPE),
        }
        if self.made_from not in (None, now):
            raise InputError(
                "the shipped map or the models' code has changed since; start it again"
            )
        self.model, self.made_from = model(str(self.model)).name, now
        self.seed = int(check_number("seed", self.seed, 0, 999))
        self.floor = _floor(self.floor)


def _run_intervals(folder: Path, parameters: Values, advance: Advance, set_total: SetTotal) -> None:
    from spab_core.shipped.manifest import load_reference_map
    from spab_core.shipped.model_store import shipped_certainty
    from spab_core.surrogates.models import floored, model
    from spab_core.surrogates.uncertainty import STEPS, save_intervals, uncertain_map

    set_total(STEPS)
    asked = (
        floored(load_reference_map(), parameters["floor"]),
        model(parameters["model"]),
        parameters["divisor"],
        parameters["seed"],
    )
    known, _ = shipped_certainty(*asked)
    found = uncertain_map(*asked, progress=advance, known=known)
    save_intervals(found, folder / "result.npz")


KINDS = {
    "bifurcation": JobKind("Bifurcation line", _BifurcationRequest, _run_bifurcation, resumes=True),
    "point": JobKind("Operating point", _PointRequest, _run_point, short=True),
    "map": JobKind("Map of a bearing", _MapRequest, _run_map, grows=True, resumes=True),
    "sensitivity": JobKind("What if", _SensitivityRequest, _run_sensitivity, "result.json"),
    "tolerance": JobKind(
        "Tolerances", _ToleranceRequest, _run_tolerance, "result.json", resumes=True
    ),
    "improve": JobKind(
        "Better drawing", _ImproveRequest, _run_improve, "result.json", resumes=True
    ),
    "ranking": JobKind("Ranking on own data", _RankingRequest, _run_ranking, "result.csv"),
    "intervals": JobKind("Intervals of a surrogate", _IntervalsRequest, _run_intervals, short=True),
}
