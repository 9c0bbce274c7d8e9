"""What the paper says of its surrogates, and whether it holds for those of a map of ours.

P.-H. Kuo, R.-M. Lee, C.-C. Wang, IEEE Access 8 (2020), doi 10.1109/ACCESS.2020.3022854.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd
from scipy.stats import ttest_rel

from spab_core.surrogates.models import DIVISORS, MODELS
from spab_core.surrogates.ranking import SIGNIFICANT, table

CITATION = (
    "P.-H. Kuo, R.-M. Lee and C.-C. Wang, A High-Precision Random Forest-Based Maximum Lyapunov "
    "Exponent Prediction Model for Spherical Porous Gas Bearing Systems, IEEE Access 8 (2020)"
)
DOI = "10.1109/ACCESS.2020.3022854"
# its table 1, RMSE for n/2 ... n/8, in the unit of its map, which it does not tell
PAPER_RMSE = {
    "mlp": (0.85, 0.85, 0.85, 0.96, 0.87, 0.85, 0.84),
    "svr": (0.98, 0.99, 0.98, 0.98, 0.99, 0.99, 0.99),
    "tree": (0.51, 0.59, 0.64, 0.70, 0.72, 0.74, 0.78),
    "forest": (0.45, 0.51, 0.56, 0.58, 0.60, 0.63, 0.63),
}
# the intervals that it calls chaotic on its two lines (figures 6 and 7), by what varies along them
PAPER_CHAOS = {"rotor-mass": (22.66, 23.52), "bearing-number": (1.0, 2.4)}
# of what varies along a line: the figures with X2, Y2 and the exponent
LINE_FIGURES = {"rotor-mass": (1, 2, 6), "bearing-number": (3, 4, 7)}
ACCEPTED = PAPER_RMSE["tree"][-1]  # the largest error of a model that the paper recommends
_FIRST_FIGURE = {2: 11, 4: 15, 8: 19}  # by divisor: MLP, SVM, decision tree, random forest follow


def figure_number(name: str, divisor: int) -> int:
    """Return the number of the paper's figure with the map predicted by one of its models."""
    return _FIRST_FIGURE[divisor] + list(PAPER_RMSE).index(name)


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, looked at in a table of scores.

    Attributes
    ----------
    text : str
        What the paper says, with its numbers.
    holds : bool or None
        None: the two differ by chance only (paired t test over the draws, 5 %).
    found : str
        Our numbers; errors over the standard deviation of the exponents.
    """

    text: str
    holds: bool | None
    found: str


def over_deviation(scores: pd.DataFrame, metric: str, deviation: float) -> pd.DataFrame:
    """Return a table like the paper's of its four models, over a standard deviation.

    Parameters
    ----------
    scores : DataFrame
        Of ``metrics.evaluate``, with all of the paper's models and fractions.
    metric : str
        ``rmse`` or ``mae``: over all cells, training cells included, as the paper counts.
    deviation : float
        Of the map's exponents, per revolution.

    Returns
    -------
    DataFrame
        As ``ranking.table``.
    """
    four = scores[scores["model"].isin(PAPER_RMSE)]
    return table(four, f"{metric}_all")[list(PAPER_RMSE)] / deviation


def claims(scores: pd.DataFrame, deviation: float) -> list[Claim]:
    """Compare what the paper says of its four models with their scores on a map of ours.

    Parameters are those of :func:`over_deviation`.
    """
    rmse, mae = (over_deviation(scores, metric, deviation) for metric in ("rmse", "mae"))
    fractions = [f"n/{k}" for k in DIVISORS]
    order = list(rmse.loc["Average"].sort_values().index)
    return [
        Claim(
            "The random forest has the smallest RMSE (average 0.57 of 0.57 to 0.99)",
            order[0] == "forest",
            _each(rmse.loc["Average"], order),
        ),
        Claim(
            "By RMSE: random forest, decision tree, MLP, SVM",
            order == ["forest", "tree", "mlp", "svr"],
            ", ".join(MODELS[name].label for name in order),
        ),
        Claim(
            "The decision tree has the smallest MAE",
            mae.loc["Average"].idxmin() == "tree",
            _each(mae.loc["Average"], order),
        ),
        *(
            Claim(
                f"The forest's {metric.upper()} varies less over the fractions than the tree's "
                f"({numbers})",
                _steadier(scores, metric),
                f"Standard deviation {t.loc['Standard deviation', 'forest']:.4f} and "
                f"{t.loc['Standard deviation', 'tree']:.4f}, range "
                f"{t.loc['Max - Min', 'forest']:.4f} and {t.loc['Max - Min', 'tree']:.4f}",
            )
            for metric, t, numbers in (
                ("rmse", rmse, "standard deviation 0.066 and 0.094, range 0.18 and 0.27"),
                ("mae", mae, "its table 2"),
            )
        ),
        *(
            Claim(
                f"{said} cannot be accepted (RMSE {min(PAPER_RMSE[name]):.2f} to "
                f"{max(PAPER_RMSE[name]):.2f}; it accepts the tree's {ACCEPTED:.2f})",
                bool((rmse.loc[fractions, name] > ACCEPTED).all()),
                f"{rmse.loc[fractions, name].min():.2f} to {rmse.loc[fractions, name].max():.2f}"
                + (", worse than the mean of the map" if rmse[name].loc["Average"] > 1.0 else ""),
            )
            for name, said in (("mlp", "The MLP"), ("svr", "The SVM"))
        ),
        Claim(
            "Fewer training cells, larger errors of tree and forest",
            all(rmse.loc[fractions, name].is_monotonic_increasing for name in ("tree", "forest")),
            "; ".join(
                f"{MODELS[name].label} {rmse.loc['n/2', name]:.3f} to {rmse.loc['n/8', name]:.3f}"
                for name in ("tree", "forest")
            ),
        ),
        Claim(
            "From n/8 the forest still errs little (0.63), the tree slightly more (0.78)",
            bool(
                rmse.loc["n/8", "forest"] <= PAPER_RMSE["forest"][-1]
                and rmse.loc["n/8", "forest"] < rmse.loc["n/8", "tree"] <= ACCEPTED
            ),
            f"{rmse.loc['n/8', 'forest']:.3f} and {rmse.loc['n/8', 'tree']:.3f}",
        ),
    ]


def _steadier(scores: pd.DataFrame, metric: str) -> bool | None:
    """Whether the forest's error varies less over the fractions than the tree's."""
    found = scores.pivot_table(index="seed", columns=["model", "divisor"], values=f"{metric}_all")
    answers = set()
    for row in ("std", "range"):
        forest, tree = (
            t.std(axis=1, ddof=1) if row == "std" else t.max(axis=1) - t.min(axis=1)
            for t in (found["forest"], found["tree"])
        )
        chance = len(found) < 2 or not ttest_rel(forest, tree).pvalue <= SIGNIFICANT
        answers.add(None if chance else bool((forest - tree).mean() < 0.0))
    return answers.pop() if len(answers) == 1 else None


def _each(values: pd.Series, order: list[str]) -> str:
    return ", ".join(f"{MODELS[name].label} {values[name]:.3f}" for name in order)
