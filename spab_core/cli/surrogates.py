"""The commands of ``spab`` that predict: evaluate, predict."""

from __future__ import annotations

import contextlib
import io
import json
import sys

import numpy as np
from tqdm import tqdm

from spab_core.common.errors import InputError
from spab_core.common.files import check_output, write_atomically
from spab_core.common.validation import check_number
from spab_core.design.limits import check_point
from spab_core.maps.stability_map import StabilityMap, load_map
from spab_core.shipped.manifest import ARTIFACTS, load_reference_map
from spab_core.shipped.model_store import find_certainty, find_model, predict_with
from spab_core.shipped.predicted_maps import prediction_npz
from spab_core.surrogates.classifier import predict_regimes
from spab_core.surrogates.metrics import SEEDS, errors, evaluate
from spab_core.surrogates.models import DIVISORS, MODELS, SPLITS, Model, model
from spab_core.surrogates.ranking import ranking, suggestion, table
from spab_core.surrogates.uncertainty import CONFIDENCE, TooFewCells

UNCERTAIN = "theory-trees"  # whose intervals are evaluated unless others are asked for


def add_commands(commands, number, whole) -> None:
    """Add the commands to the parser's; ``number`` and ``whole`` read a float and an integer."""

    def command(name, text):
        sub = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
        sub.add_argument(
            "--map",
            metavar="FILE.npz",
            help="map file; left out: the shipped map of the reference design",
        )
        sub.add_argument("--json", action="store_true", help="print one JSON object")
        return sub

    sub = command(
        "evaluate",
        "errors of surrogate models trained on fractions of a map, by the paper's protocol",
    )
    sub.add_argument(
        "--models",
        help=f"names, separated by commas; left out: all, with --uncertainty {UNCERTAIN}",
    )
    sub.add_argument(
        "--split",
        default="random",
        help="random: training cells drawn from the whole plane; blocks: whole "
        "rectangles of the plane withheld, errors measured there",
    )
    sub.add_argument(
        "--uncertainty",
        action="store_true",
        help="regime classifier, 90 %% intervals and probability of instability instead of errors",
    )
    sub.add_argument(
        "--divisors",
        default=",".join(map(str, DIVISORS)),
        help="training sets of n/2, n/3, ...: 2,3,...",
    )
    sub.add_argument(
        "--seeds", type=whole, default=len(SEEDS), help="how many draws of the training cells"
    )
    sub.add_argument("--workers", type=whole, default=1, help="processes")
    sub.add_argument("--out", metavar="FILE.csv", help="write the scores, one row a training")
    sub.set_defaults(run=_evaluate)

    sub = command(
        "predict",
        "predict a point or the whole map by a surrogate: shipped, trained before on this "
        "machine, or now",
    )
    sub.add_argument("--model", required=True, help=", ".join(MODELS))
    sub.add_argument("--divisor", type=whole, default=2, help="train on n/DIVISOR of the cells")
    sub.add_argument(
        "--seed", type=whole, default=0, help="of the draw of the training cells and of the model"
    )
    sub.add_argument("--rotor-mass", type=number, help="kg on one bearing")
    sub.add_argument("--bearing-number", type=number)
    sub.add_argument(
        "--out", metavar="FILE.npz", help="write the predicted map: mle, trained, and the axes"
    )
    sub.set_defaults(run=_predict)


@contextlib.contextmanager
def step_bar():
    """A bar for what takes more than half a second; yields a function of the steps done and the
    steps in all.
    """
    with tqdm(unit="step", leave=False, delay=0.5) as bar:

        def step(done, total):
            bar.total = total
            bar.update(done - bar.n)

        yield step


def _load(args) -> StabilityMap:
    return load_reference_map() if args.map is None else load_map(args.map)


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


def _evaluate(args) -> dict:
    names = args.models or (UNCERTAIN if args.uncertainty else ",".join(MODELS))
    kinds = [model(name.strip()) for name in names.split(",")]
    if args.split not in SPLITS:
        raise InputError(
            f"--split = {args.split[:40]!r} is not allowed: choose {', '.join(SPLITS)}"
        )
    divisors = _whole_numbers(args.divisors, "--divisors", 2, 100_000)
    check_number("--seeds", args.seeds, 1, 1000)
    check_number("--workers", args.workers, 1, 1024)
    if args.out is not None:
        check_output(args.out, "--out")
    m = _load(args)
    with tqdm(
        total=len(kinds) * len(divisors) * args.seeds, unit="training", smoothing=0.05
    ) as bar:
        scores = evaluate(
            m,
            kinds,
            divisors,
            range(args.seeds),
            split=args.split,
            uncertainty=args.uncertainty,
            workers=args.workers,
            progress=bar.update,
        )
    if args.out is not None:
        text = io.StringIO()
        scores.to_csv(text, index=False, lineterminator="\n")
        write_atomically(args.out, text.getvalue().encode())
    answer = {
        "split": args.split,
        "scores": json.loads(scores.to_json(orient="records", double_precision=15)),
    }
    where = "held-out cells" if args.split == "random" else "withheld rectangles"
    if args.uncertainty:
        if not args.json:
            print(
                f"Means over draws, {where}; width: median of the {CONFIDENCE:.0%} intervals, per "
                "revolution"
            )
            means = scores.drop(columns="seed").groupby(["model", "divisor"], sort=False).mean()
            print(means.T.to_string(float_format="{:.4f}".format))
        return answer
    answer["suggestion"] = suggestion(ranking(scores))
    if not args.json:
        for title, column in (
            ("RMSE per revolution", "rmse_held_out"),
            ("MAE per revolution", "mae_held_out"),
            ("Regime accuracy by thresholds of the predicted exponent", "regime_accuracy"),
            ("F1 of chaos, likewise", "chaos_f1"),
        ):
            print(f"{title}, {where}")
            print(table(scores, column).to_string(float_format="{:.4f}".format))
        print(answer["suggestion"])
    return answer


def _predict(args) -> dict:
    kind = model(args.model)
    point = (args.bearing_number, args.rotor_mass)
    if (point[0] is None) != (point[1] is None):
        raise InputError(
            "--bearing-number and --rotor-mass belong together: give both, or neither for the "
            "whole map"
        )
    if point[0] is None and args.out is None:
        raise InputError(
            "nothing to predict: give --bearing-number and --rotor-mass, or --out for the whole map"
        )
    check_number("--seed", args.seed, 0, 2**32 - 1)
    check_number("--divisor", args.divisor, 1, 100_000)
    if args.out is not None:
        check_output(args.out, "--out")
    m = _load(args)
    answer: dict = {}
    if point[0] is not None:
        check_point(point[1], point[0])
        inside = [
            bool(axis.min() <= value <= axis.max())
            for axis, value in zip((m.bearing_number, m.rotor_mass), point, strict=True)
        ]
        if not all(inside):
            number, mass = (
                (float(axis.min()), float(axis.max())) for axis in (m.bearing_number, m.rotor_mass)
            )
            print(
                f"spab: the point lies outside the map (bearing number {number[0]:g} to "
                f"{number[1]:g}, rotor mass "
                f"{mass[0]:g} to {mass[1]:g} kg): the model extrapolates",
                file=sys.stderr,
            )
        answer["inside_map"] = all(inside)
    with step_bar() as step:
        found = find_model(
            m,
            kind,
            args.divisor,
            args.seed,
            folder=ARTIFACTS if args.map is None else None,
            progress=step,
        )
    for note in found.notes:
        print(f"spab: {note}", file=sys.stderr)
    predicted = predict_with(m, found.surrogate, args.divisor)
    answer |= {
        name: value for name, value in errors(m, predicted).items() if name.endswith("held_out")
    }
    new = found.origin == "trained"
    answer |= {
        "model": kind.name,
        "training_cells": predicted.surrogate.training_cells,
        "origin": found.origin,
        "train_seconds": predicted.surrogate.seconds if new else None,
        "converged": predicted.surrogate.converged,
    }
    text = [
        f"{kind.label} trained on {predicted.surrogate.training_cells:,} cells "
        + (f"in {predicted.surrogate.seconds:.2f} s" if new else f"({found.origin})")
    ]
    if "rmse_held_out" in answer:
        text.append(
            f"held-out RMSE {answer['rmse_held_out']:.4f}, MAE {answer['mae_held_out']:.4f} per "
            "revolution"
        )
    if point[0] is not None:
        answer["mle_per_revolution"] = float(predicted.surrogate.predict(*point))
        answer |= _certainty(args, m, kind, *point)
        text.insert(0, f"MLE {answer['mle_per_revolution']:+.4f} per revolution, predicted")
        text.insert(1, f"{answer['regime']}, by the classifier")
        if answer["interval_90"]:
            low, high = answer["interval_90"]
            text.insert(1, f"{CONFIDENCE:.0%} interval {low:+.4f} to {high:+.4f}")
            text.insert(
                3, f"probability of instability (not periodic) {answer['probability_unstable']:.3f}"
            )
    if args.out is not None:
        write_atomically(args.out, prediction_npz(m, predicted))
        answer["out"] = args.out
        text.append(f"predicted map in {args.out}")
    if not args.json:
        print("; ".join(text))
    return answer


def _certainty(args, m: StabilityMap, kind: Model, number: float, mass: float) -> dict:
    """Regime, interval and probability of instability at a point, from the same training cells as
    the prediction.
    """
    at = np.array([number]), np.array([mass])
    try:
        found, notes = find_certainty(
            m, kind, args.divisor, args.seed, folder=ARTIFACTS if args.map is None else None
        )
    except TooFewCells as error:
        print(f"spab: no interval: {error}", file=sys.stderr)
        classifier = predict_regimes(m, args.divisor, args.seed).classifier
        return {
            "regime": str(classifier.predict(np.column_stack(at))[0]),
            "interval_90": None,
            "probability_unstable": None,
        }
    for note in notes:
        print(f"spab: {note}", file=sys.stderr)
    low, high = found.calibrated.intervals(*at)
    return {
        "regime": str(found.regimes.predict(np.column_stack(at))[0]),
        "interval_90": [float(low[0]), float(high[0])],
        "probability_unstable": float(found.calibrated.unstable(*at)[0]),
    }
