"""The commands of ``spab`` that train, keep and verify models: train, verify."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.progress import step_bar
from spab_core.cli.surrogates import held_out_text
from spab_core.common.errors import InputError
from spab_core.common.files import check_output, check_writable
from spab_core.common.validation import check_choice, check_number
from spab_core.common.words import count
from spab_core.maps.stability_map import StabilityMap, load_map
from spab_core.shipped import model_cache
from spab_core.shipped.build import TABLES, make_tables, rebuild, table_rows, trainings
from spab_core.shipped.manifest import ARTIFACTS, load_reference_map
from spab_core.shipped.model_files import describe, dump, keep_model, predictions
from spab_core.shipped.model_store import train_on_map
from spab_core.shipped.provenance import model_source
from spab_core.shipped.verify import verify
from spab_core.surrogates.metrics import SEEDS, errors
from spab_core.surrogates.models import DIVISORS, MODELS, floored, model


def add_commands(commands: Commands) -> None:
    """Add the commands to the parser's."""
    sub = options.add_command(
        commands,
        "train",
        "train one surrogate model and cache it, or with --all everything that is shipped",
        _train,
        "--map",
    )
    sub.add_argument("--model", help=", ".join(MODELS))
    options.add(sub, "--divisor")
    options.add(sub, "--seed", default=None)
    options.add(sub, "--floor")
    sub.add_argument(
        "--out",
        metavar="FILE.joblib",
        help="write the model there instead of the cache; FILE.joblib.json records what it was "
        "made from",
    )
    sub.add_argument(
        "--all",
        action="store_true",
        help="scores, predicted maps, the small models and the manifest of --folder",
    )
    sub.add_argument(
        "--tables",
        metavar="FILE,...",
        help="of what --all makes only these tables of scores, and the manifest: "
        + ", ".join(TABLES),
    )
    sub.add_argument(
        "--seeds",
        type=options.whole,
        help="with --all or --tables: number of seeds, each with its own cells; default: "
        f"{len(SEEDS)}",
    )
    options.add(
        sub, "--workers", default=None, help="with --all or --tables: processes; default: 1"
    )
    verifier = options.add_command(
        commands,
        "verify",
        "check the shipped files: checksums, versions, design, map, and that the models give the "
        "shipped predictions",
        _verify,
    )
    for command in (sub, verifier):
        command.add_argument(
            "--folder",
            metavar="DIR",
            help="of the shipped files; default: artifacts/ of this installation",
        )


def _folder(args: Namespace) -> Path:
    folder = ARTIFACTS if args.folder is None else Path(args.folder)
    if "\0" in str(folder) or not folder.is_dir():
        raise InputError(f"--folder = {str(folder)[:200]!r} is not a folder")
    return folder


def _map(args: Namespace, folder: Path) -> StabilityMap:
    return load_reference_map(folder) if args.map is None else load_map(args.map)


def _train(args: Namespace) -> Answer:
    whole = args.all or args.tables is not None
    if (args.all and args.tables is not None) or whole == (args.model is not None):
        raise InputError("give either --model with --divisor, or --all, or --tables")
    for option in ("divisor", "seed", "floor", "out") if whole else ("seeds", "workers"):
        if getattr(args, option) is not None:
            raise InputError(
                f"--{option} belongs to {'--model' if whole else '--all and --tables'}"
            )
    return _train_all(args) if whole else _train_one(args)


def _train_all(args: Namespace) -> Answer:
    seeds = len(SEEDS) if args.seeds is None else args.seeds
    workers = 1 if args.workers is None else args.workers
    check_number("--seeds", seeds, 1, 1000)
    check_number("--workers", workers, 1, options.MAX_WORKERS)
    tables = None if args.tables is None else options.listed(args.tables)
    for name in tables or ():
        check_choice("--tables", name, tuple(TABLES))
    folder = _folder(args)
    if args.map is not None and args.folder is None:
        raise InputError(
            f"--map with --{'all' if args.all else 'tables'} needs --folder: artifacts/ holds what "
            "is computed from the shipped map alone"
        )
    check_writable(folder, "what is trained")
    m = _map(args, folder)
    models = list(MODELS.values())
    total = (
        trainings(models, DIVISORS, range(seeds))
        if tables is None
        else table_rows(tables, DIVISORS, range(seeds))
    )
    with tqdm(total=total, unit="training", smoothing=0.05) as bar:
        how: dict[str, Any] = {
            "seeds": range(seeds),
            "workers": workers,
            "progress": bar.update,
        }
        written = (
            rebuild(m, folder, models=models, **how)
            if tables is None
            else make_tables(m, tables, folder, **how)
        )
    if not args.json:
        print(
            f"{folder}: {count(len(written), 'file')} and the manifest, "
            f"{sum(written.values()) / 1e6:.2f} MB"
        )
    return {"folder": str(folder), "files": written}


def _train_one(args: Namespace) -> Answer:
    kind, seed = model(args.model), 0 if args.seed is None else args.seed
    if args.divisor is None:
        raise InputError(
            "--divisor is missing: train on n/DIVISOR of the cells, such as --divisor 2"
        )
    check_number("--divisor", args.divisor, 1, 100_000)
    check_number("--seed", seed, 0, options.MAX_SEED)
    if args.out is not None:
        check_output(args.out, "--out", (".joblib",))
    m = floored(_map(args, _folder(args)), args.floor)
    with step_bar() as step:
        predicted = train_on_map(m, kind, args.divisor, seed, step)
    surrogate = predicted.surrogate
    if args.out is None:
        try:
            path = keep_model(m, surrogate, args.divisor)
        except model_cache.CacheError as error:
            raise InputError(f"{error}; or give --out") from None
    else:
        path = Path(args.out)
        noted = (
            model_source(m, kind, args.divisor, seed)
            | describe(surrogate)
            | predictions(m, surrogate)
        )
        model_cache.write(path, dump(surrogate.estimator), noted)
    found = {k: v for k, v in errors(m, predicted).items() if k.endswith("held_out")}
    if not args.json:
        told = f"; {held_out_text(found)}" if found else ""
        print(
            f"{kind.label} trained on {count(surrogate.training_cells, 'cell')} in "
            f"{surrogate.seconds:.2f} s{told}; kept in {path}"
        )
    return (
        {
            "model": kind.name,
            "divisor": args.divisor,
            "seed": seed,
            "floor": args.floor,
            "out": str(path),
            "bytes": path.stat().st_size,
            "train_seconds": surrogate.seconds,
            "predict_seconds": predicted.predict_seconds,
        }
        | describe(surrogate)
        | found
    )


def _verify(args: Namespace) -> Answer:
    found = []
    for check in verify(_folder(args)):
        found.append(
            {"check": check.name, "passed": check.passed, "problem": check.problem or None}
        )
        if not args.json:
            print(
                f"ok    {check.name}" if check.passed else f"WRONG {check.name}: {check.problem}",
                flush=True,
            )
    return {"passed": all(check["passed"] for check in found), "checks": found}
