"""The commands of ``spab`` that predict: evaluate, predict."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterable

import numpy as np
import pandas as pd
from tqdm import tqdm

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.progress import step_bar
from spab_core.common.errors import InputError
from spab_core.common.files import check_output, csv_bytes, write_atomically
from spab_core.common.validation import check_choice, check_number
from spab_core.common.words import capital, count
from spab_core.design.limits import check_point
from spab_core.maps.stability_map import StabilityMap, load_map
from spab_core.shipped.manifest import ARTIFACTS, load_reference_map
from spab_core.shipped.model_store import find_certainty, find_model, predict_with
from spab_core.shipped.predicted_maps import prediction_npz
from spab_core.surrogates.classifier import ASSESSMENT, LABELS, REGIME, Labels, predict_labels
from spab_core.surrogates.metrics import SEEDS, errors, evaluate
from spab_core.surrogates.models import (
    DIVISORS,
    MODELS,
    SPLITS,
    Model,
    floor_of,
    floored,
    model,
)
from spab_core.surrogates.ranking import ranking, suggestion, table
from spab_core.surrogates.uncertainty import CONFIDENCE, TooFewCells

UNCERTAIN = "theory-trees"  # whose intervals are evaluated unless others are asked for


def add_commands(commands: Commands) -> None:
    """Add the commands to the parser's."""
    sub = options.add_command(
        commands,
        "evaluate",
        "errors of surrogate models trained on fractions of a map, by the paper's protocol",
        _evaluate,
        "--map",
    )
    sub.add_argument(
        "--models",
        help=f"names, separated by commas; default: all, with --uncertainty {UNCERTAIN}",
    )
    sub.add_argument(
        "--split",
        default="random",
        help="random: training cells from all over the plane; blocks: whole rectangles of the "
        "plane are withheld, and errors are measured there",
    )
    sub.add_argument(
        "--uncertainty",
        action="store_true",
        help="90 %% intervals and probability of instability instead of errors",
    )
    sub.add_argument(
        "--assessment",
        action="store_true",
        help="classifier of the assessment (good, to be watched, not recommended) instead of "
        "errors",
    )
    sub.add_argument(
        "--classifiers",
        action="store_true",
        help="classifiers of the regime and of the assessment instead of errors",
    )
    sub.add_argument(
        "--divisors",
        default=",".join(map(str, DIVISORS)),
        help="training sets of n/2, n/3, ...: 2,3,...",
    )
    sub.add_argument(
        "--seeds",
        type=options.whole,
        default=len(SEEDS),
        help="number of seeds, each with its own training cells",
    )
    options.add(sub, "--floor", "--workers")
    sub.add_argument("--out", metavar="FILE.csv", help="write the scores, one row a training")

    sub = options.add_command(
        commands,
        "predict",
        "predict a point or the whole map with a surrogate model: shipped, cached, or trained now",
        _predict,
        "--map",
    )
    sub.add_argument("--model", required=True, help=", ".join(MODELS))
    options.add(sub, "--divisor", default=2)
    options.add(sub, "--seed", "--floor", "--rotor-mass")
    options.add_speed(sub, required=False)
    sub.add_argument(
        "--out", metavar="FILE.npz", help="write the predicted map: mle, trained, and the axes"
    )


def _load(args: Namespace) -> StabilityMap:
    m = load_reference_map(ARTIFACTS) if args.map is None else load_map(args.map)
    return floored(m, args.floor)


def _whole_numbers(text: str, name: str, low: int, high: int) -> list[int]:
    values = []
    for part in text.split(","):
        try:
            value = int(part)
        except ValueError:
            raise InputError(
                f"{name} = {text[:60]!r} must be whole numbers separated by commas, such as 2,4,8"
            ) from None
        check_number(name, value, low, high)
        values.append(value)
    return values


def _evaluate(args: Namespace) -> Answer:
    given = [k for k in ("uncertainty", "assessment", "classifiers") if getattr(args, k)]
    if len(given) > 1:
        raise InputError(f"--{given[0]} and --{given[1]} exclude each other")
    models: list[Model | Labels]
    if args.assessment or args.classifiers:
        if args.models:
            raise InputError(f"--models: not allowed with --{given[0]}, which is of classifiers")
        models = [ASSESSMENT] if args.assessment else list(LABELS.values())
    else:
        names = args.models or (UNCERTAIN if args.uncertainty else ",".join(MODELS))
        models = [model(name) for name in options.listed(names)]
    check_choice("--split", args.split, SPLITS)
    divisors = _whole_numbers(args.divisors, "--divisors", 2, 100_000)
    check_number("--seeds", args.seeds, 1, 1000)
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    if args.out is not None:
        check_output(args.out, "--out", (".csv",))
    m = _load(args)
    trainings = len(models) * len(divisors) * args.seeds
    with tqdm(total=trainings, unit="training", smoothing=0.05) as bar:
        scores = evaluate(
            m,
            models,
            divisors,
            range(args.seeds),
            split=args.split,
            uncertainty=args.uncertainty,
            workers=args.workers,
            progress=bar.update,
        )
    if args.out is not None:
        write_atomically(args.out, csv_bytes(scores))
    answer = {
        "split": args.split,
        "floor": floor_of(m),
        "scores": json.loads(scores.to_json(orient="records", double_precision=15)),
    }
    where = "held-out cells" if args.split == "random" else "withheld rectangles"
    if args.uncertainty:
        text = _uncertainty_text(scores, where)
    elif args.assessment or args.classifiers:
        text = _classifiers_text(scores, models, where)
    else:
        answer["suggestion"] = suggestion(ranking(scores))
        text = [*_errors_text(scores, where), answer["suggestion"]]
    if not args.json:
        print("\n".join(text))
    return answer


def _means(scores: pd.DataFrame, index: list[str]) -> str:
    means = scores.drop(columns="seed").groupby(index, sort=False).mean(numeric_only=True)
    text: str = means.T.to_string(float_format="{:.4f}".format, na_rep="")
    return text


def _uncertainty_text(scores: pd.DataFrame, where: str) -> list[str]:
    """What intervals hold, by model; and apart from it the classifier that all of them share."""
    shared = [name for name in scores.columns if name.startswith("classifier_")]
    one = scores[scores["model"] == scores["model"].iloc[0]]
    return [
        f"Means over seeds, {where}; width: median of the {CONFIDENCE:.0%} intervals, per "
        "revolution",
        _means(scores.drop(columns=shared), ["model", "divisor"]),
        "Regimes by the classifier, the same for every model",
        _means(one[["divisor", "seed", *shared]], ["divisor"]),
    ]


def _classifiers_text(scores: pd.DataFrame, models: list[Model | Labels], where: str) -> list[str]:
    """How well each classifier does, by fraction."""
    text = []
    for labels in models:
        assert isinstance(labels, Labels)
        rows = scores[scores["model"] == labels.name].drop(columns="model")
        text += [
            f"{capital(labels.name)} by its classifier: means over seeds, {where}; unsafe: cells "
            f"called {labels.best} that are not",
            _means(rows.dropna(axis="columns", how="all"), ["divisor"]),
        ]
    return text


def _errors_text(scores: pd.DataFrame, where: str) -> list[str]:
    """The paper's tables of errors, and regimes by each model's own exponent."""
    text = []
    for title, column in (
        ("RMSE per revolution", "rmse_held_out"),
        ("MAE per revolution", "mae_held_out"),
        ("Regime accuracy by thresholds of the predicted exponent", "regime_accuracy"),
        ("F1 of chaos, by the same thresholds", "chaos_f1"),
    ):
        text += [
            f"{title}, {where}",
            table(scores, column).to_string(float_format="{:.4f}".format),
        ]
    return text


def _predict(args: Namespace) -> Answer:
    kind = model(args.model)
    speed = args.bearing_number if args.rpm is None else args.rpm
    if (speed is None) != (args.rotor_mass is None):
        raise InputError(
            "speed and mass belong together: give --rotor-mass with --bearing-number or --rpm, or "
            "none of them for the whole map"
        )
    if speed is None and args.out is None:
        raise InputError(
            "nothing to predict: give --rotor-mass with --bearing-number or --rpm, or --out for "
            "the whole map"
        )
    if args.rpm is None:
        _point(args)  # before the map is read
    check_number("--seed", args.seed, 0, options.MAX_SEED)
    check_number("--divisor", args.divisor, 1, 100_000)
    if args.out is not None:
        check_output(args.out, "--out", (".npz",))
    m, folder = _load(args), ARTIFACTS if args.map is None else None
    if args.rpm is not None:
        args.bearing_number = options.bearing_number_at(args, m.design)
    point = _point(args)
    answer: Answer = {} if point is None else {"inside_map": _inside(m, *point)}
    with step_bar() as step:
        found = find_model(m, kind, args.divisor, args.seed, folder=folder, progress=step)
    _say(found.notes)
    predicted = predict_with(m, found.surrogate, args.divisor)
    surrogate, new = predicted.surrogate, found.origin == "trained"
    held_out = {k: v for k, v in errors(m, predicted).items() if k.endswith("held_out")}
    answer |= held_out | {
        "model": kind.name,
        "floor": floor_of(m),
        "training_cells": surrogate.training_cells,
        "origin": found.origin,
        "train_seconds": surrogate.seconds if new else None,
        "converged": surrogate.converged,
    }
    text = []
    if point is not None:
        answer["mle_per_revolution"] = float(surrogate.predict(*map(np.asarray, point)))
        answer |= _certainty(args, m, kind, *point, inside=answer["inside_map"])
        text += _point_text(answer)
    how = f"in {surrogate.seconds:.2f} s" if new else f"({found.origin})"
    text.append(f"{kind.label} trained on {count(surrogate.training_cells, 'cell')} {how}")
    if held_out:
        text.append(held_out_text(held_out))
    if args.out is not None:
        write_atomically(args.out, prediction_npz(m, predicted))
        answer["out"] = args.out
        text.append(f"predicted map in {args.out}")
    if not args.json:
        print("; ".join(text))
    return answer


def _point(args: Namespace) -> tuple[float, float] | None:
    """Return the bearing number and rotor mass asked for, checked; None for the whole map."""
    if args.bearing_number is None:
        return None
    check_point(args.rotor_mass, args.bearing_number)
    return args.bearing_number, args.rotor_mass


def _inside(m: StabilityMap, bearing_number: float, rotor_mass: float) -> bool:
    """Return whether the point lies in the map; say so where it does not."""
    (b0, b1), (m0, m1) = (
        (float(axis.min()), float(axis.max())) for axis in (m.bearing_number, m.rotor_mass)
    )
    inside = b0 <= bearing_number <= b1 and m0 <= rotor_mass <= m1
    if not inside:
        _say(
            [
                f"the point lies outside the map (bearing number {b0:g} to {b1:g}, rotor mass "
                f"{m0:g} to {m1:g} kg): the model extrapolates, and no interval holds there"
            ]
        )
    return inside


def _say(notes: Iterable[str]) -> None:
    for note in notes:
        print(f"spab: {note}", file=sys.stderr)


def _point_text(answer: Answer) -> list[str]:
    cut = "" if answer["floor"] is None else f" (exponents end at {answer['floor']:g})"
    text = [f"MLE {answer['mle_per_revolution']:+.4f} per revolution, predicted{cut}"]
    regime = f"{answer['regime']}, by the classifier"
    if not answer["interval_90"]:
        return [*text, regime]
    low, high = answer["interval_90"]
    return [
        *text,
        f"{CONFIDENCE:.0%} interval {low:+.4f} to {high:+.4f}",
        regime,
        f"probability of instability (not periodic) {answer['probability_unstable']:.3f}",
    ]


def held_out_text(held_out: dict[str, float]) -> str:
    """Return the errors on held-out cells in words."""
    rmse, mae = held_out["rmse_held_out"], held_out["mae_held_out"]
    return f"held-out RMSE {rmse:.4f}, MAE {mae:.4f} per revolution"


def _certainty(
    args: Namespace,
    m: StabilityMap,
    kind: Model,
    bearing_number: float,
    rotor_mass: float,
    inside: bool,
) -> Answer:
    """Return regime, interval and probability of instability at a point, from the same training
    cells as the prediction; neither of the last two outside the map, where nothing was calibrated.
    """
    at = np.array([bearing_number]), np.array([rotor_mass])
    try:
        if not inside:
            raise TooFewCells("outside the map")
        found, notes = find_certainty(
            m, kind, args.divisor, args.seed, folder=ARTIFACTS if args.map is None else None
        )
    except TooFewCells as error:
        if inside:
            _say([f"no interval: {error}"])
        classifier = predict_labels(m, REGIME, args.divisor, args.seed).classifier
        return {
            "regime": str(classifier.predict(np.column_stack(at))[0]),
            "interval_90": None,
            "probability_unstable": None,
        }
    _say(notes)
    low, high = found.calibrated.intervals(*at)
    return {
        "regime": str(found.regimes.predict(np.column_stack(at))[0]),
        "interval_90": [float(low[0]), float(high[0])],
        "probability_unstable": float(found.calibrated.unstable(*at)[0]),
    }
