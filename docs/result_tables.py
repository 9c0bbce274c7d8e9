"""Tables of docs/results.md from the shipped scores, written anew: ``make results``."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd

from spab_core.active_learning.learning_curve import (
    COMMITTEE,
    LEARNING_CURVE,
    load_learning_curve,
    summary,
)
from spab_core.common.files import write_atomically
from spab_core.common.words import small
from spab_core.shipped.manifest import (
    BLOCK_CLASSIFIERS,
    BLOCK_SCORES,
    CLASSIFIERS,
    FLOORED_BLOCK_SCORES,
    FLOORED_SCORES,
    SCORES,
    UNCERTAINTY,
    checked_path,
    load_reference_scores,
)
from spab_core.surrogates.classifier import LABELS
from spab_core.surrogates.models import MODELS
from spab_core.surrogates.ranking import classifier_table, spread, table

RESULTS = Path(__file__).resolve().parent / "results.md"
FRACTIONS = ("n/2", "n/4", "n/8")
Rows = Iterator[list[str]]


def percent(share: float) -> str:
    """Return a share in percent, to a tenth."""
    return f"{100.0 * share:.1f} %"


def number(value: float) -> str:
    """Return a number to three decimals."""
    return f"{value:.3f}"


def model_words(name: str) -> str:
    """Return a model's name in a table, those of the paper marked."""
    model = MODELS[name]
    label = model.label if model.label.isupper() else small(model.label)
    return label + (" (paper)" if model.group == "paper" else "")


def errors(name: str) -> Rows:
    """Yield a row for each model, the best first: RMSE ± standard deviation, averages."""
    scores = load_reference_scores(name=name)
    rmse, mae = (table(scores, f"{metric}_held_out") for metric in ("rmse", "mae"))
    deviation = spread(scores, "rmse_held_out")
    for model in rmse.loc["Average"].sort_values().index:
        values = [f"{rmse.loc[f, model]:.3f} ± {deviation.loc[f, model]:.3f}" for f in FRACTIONS]
        averages = f"{rmse.loc['Average', model]:.3f}", f"{mae.loc['Average', model]:.4f}"
        yield [model_words(model), *values, *averages]


def block_errors(name: str) -> Rows:
    """Yield a row for each model from n/4, the best first: errors in withheld rectangles."""
    scores = load_reference_scores(name=name)
    means = scores[scores["divisor"] == 4].groupby("model").mean(numeric_only=True)
    for model, row in means.sort_values("rmse_held_out").iterrows():
        yield [
            model_words(str(model)),
            number(row["rmse_held_out"]),
            number(row["mae_held_out"]),
            percent(row["regime_accuracy"]),
            number(row["chaos_f1"]),
        ]


def uncertainty() -> Rows:
    """Yield the scores of intervals and of the classifier of regimes behind them."""
    scores = pd.read_csv(checked_path(UNCERTAINTY))
    means = scores.groupby("divisor").mean(numeric_only=True)
    for words, column, form, goal in (
        ("regime accuracy", "classifier_accuracy", percent, "95 % at n/4"),
        ("F1 of chaos", "classifier_chaos_f1", number, "0.95 at n/4"),
        ("coverage", "coverage", percent, "90 ± 1 %"),
        ("in periodic cells", "coverage_periodic", percent, "85 %"),
        ("in quasi-periodic cells", "coverage_quasi-periodic", percent, "85 %"),
        ("in chaotic cells", "coverage_chaotic", percent, "85 %"),
        ("in undecided cells", "coverage_undecided", percent, "85 %"),
        ("median width, per revolution", "width", number, ""),
        ("expected calibration error, ten bins", "calibration_error", number, ""),
    ):
        yield [words, *(form(means.loc[k, column]) for k in (2, 4, 8)), goal]


def classifiers(labels: str, best: str, worst: str) -> Rows:
    """Yield how well a classifier does, at random and in withheld rectangles."""
    kind = LABELS[labels]
    scores = [load_reference_scores(name=name) for name in (CLASSIFIERS, BLOCK_CLASSIFIERS)]
    found = [classifier_table(one, kind) for one in scores]
    rows = [one.loc[fraction] for one in found for fraction in FRACTIONS]
    yield [
        f"called {best}, is not",
        *(
            f"{percent(r['unsafe_share'])} ({r['unsafe']:.0f} of {r['called_best']:,.0f})"
            for r in rows
        ),
    ]
    yield [f"of these {worst}", *(f"{r['worst_called_best']:.0f}" for r in rows)]
    told = {"accuracy": "right", "balanced_accuracy": "right, balanced"}
    words = {"watch": "to be watched", "avoid": "to be avoided"}
    told |= {f"recall_{k}": f"right of {words.get(k, k)}" for k in kind.values}
    for column, text in told.items():
        yield [text, *(percent(r[column]) for r in rows)]


def with_spread(mean: float, deviation: float) -> str:
    """Return a mean and its standard deviation, which keeps a digit."""
    digits = 3 if deviation >= 0.00095 else 4
    return f"{mean:.{digits}f} ± {deviation:.{digits}f}"


def chosen() -> Rows:
    """Yield errors of the committee on chosen and on random cells."""
    curve = load_learning_curve(LEARNING_CURVE)
    means, counts = summary(curve), curve.groupby("divisor")["solved"].max()
    for divisor in sorted(counts.index, reverse=True):
        rows = [means.loc[(strategy, COMMITTEE, divisor)] for strategy in ("refine", "random")]
        yield [
            f"n/{divisor} ({counts[divisor]:,})",
            *(with_spread(*r[metric]) for metric in ("rmse", "chaos_f1") for r in rows),
        ]


SIX = " | ".join((*FRACTIONS, *(f"{f}, rectangles" for f in FRACTIONS)))
# by the first line of each
TABLES: dict[str, Callable[[], Rows]] = {
    "| | n/2 | n/4 | n/8 | average | MAE, average |": lambda: errors(SCORES),
    "| floor −1 | n/2 | n/4 | n/8 | average | MAE, average |": lambda: errors(FLOORED_SCORES),
    "| n/4 | RMSE | MAE | regime accuracy | F1 of chaos |": lambda: block_errors(BLOCK_SCORES),
    "| n/4, floor −1 | RMSE | MAE | regime accuracy | F1 of chaos |": lambda: block_errors(
        FLOORED_BLOCK_SCORES
    ),
    "| | n/2 | n/4 | n/8 | goal |": uncertainty,
    f"| assessment | {SIX} |": lambda: classifiers("assessment", "good", "to be avoided"),
    f"| regime | {SIX} |": lambda: classifiers("regime", "periodic", "chaotic"),
    "| solved | RMSE, chosen | RMSE, random | F1 of chaos, chosen | F1 of chaos, random |": chosen,
}


def with_tables(text: str) -> str:
    """Return a text of Markdown with the tables in it written anew."""
    lines = text.split("\n")
    for first, rows in TABLES.items():
        start = lines.index(first) + 2
        end = next(k for k in range(start, len(lines)) if not lines[k].startswith("|"))
        lines[start:end] = [f"| {' | '.join(row)} |".replace("  ", " ") for row in rows()]
    return "\n".join(lines)


def main() -> None:
    """Write the tables into docs/results.md."""
    write_atomically(RESULTS, with_tables(RESULTS.read_text("utf-8")).encode())


if __name__ == "__main__":
    main()
