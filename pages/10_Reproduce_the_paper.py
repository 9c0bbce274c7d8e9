"""Reproduce the paper: its figures and tables beside ours, and which of its claims hold."""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
import streamlit as st

from spab_core.maps.bifurcation import Bifurcation, chaotic_intervals, line_table
from spab_core.plotting.lines import add_window, bifurcation_figure
from spab_core.plotting.theme import MLE_LIMIT
from spab_core.reporting.export import map_table, prediction_table
from spab_core.shipped.manifest import ARTIFACTS, BIFURCATIONS, REFERENCE_MAP
from spab_core.shipped.predicted_maps import FIGURE_DIVISORS, measured_seconds
from spab_core.surrogates.metrics import errors
from spab_core.surrogates.models import DIVISORS, FLOOR, MODELS
from spab_core.surrogates.paper import (
    CITATION,
    DOI,
    LINE_FIGURES,
    PAPER_CHAOS,
    PAPER_RMSE,
    claims,
    figure_number,
    over_deviation,
)
from spab_core.ui.downloads import downloads
from spab_core.ui.lines import line_command, shipped_line
from spab_core.ui.navigation import page_link
from spab_core.ui.point_bar import example_line
from spab_core.ui.shared import (
    errors_in_words,
    marked_map_figure,
    marked_surrogate_figure,
    page_head,
    predicted_map,
    reference_map,
    reference_scores,
)
from spab_core.ui.target import floor_option, target_choice, target_words
from spab_core.ui.view import PAPER_MODELS, PAPER_PARTS, choice

PARTS = dict(
    zip(
        PAPER_PARTS,
        (
            "Claim by claim",
            "Figures 1 to 4, 6, 7",
            "Figure 10",
            "Figures 11 to 22",
            "Tables 1, 2",
        ),
        strict=True,
    )
)
SAID = {True: "**holds**", False: "**does not hold**", None: "**no difference**"}
NAMES = {"mlp": "MLP", "svr": "SVM", "tree": "DT", "forest": "RF"}  # the paper's
LINE_UNITS = {"rotor-mass": " kg", "bearing-number": ""}
ALIKE = 0.95  # of a line's points, to say that it is chaotic where the paper's is
Row = Sequence[str]

page_head("reproduce the paper")
state = st.session_state


def _table(head: Row, rows: Iterable[Row], key: str) -> None:
    """A table whose sentences wrap; with a key that begins with ``wide_`` it scrolls sideways on a
    narrow screen.
    """
    lines = [head, ["---"] * len(head), *rows]
    with st.container(key=key):
        st.markdown("\n".join(f"| {' | '.join(row)} |" for row in lines))


def _deviation(floor: float | None) -> float:
    return float(np.nanstd(reference_map(floor).mle))


def _line(vary: str) -> Bifurcation:
    return shipped_line(_line_file(vary))


def _line_file(vary: str) -> str:
    return BIFURCATIONS[list(LINE_FIGURES).index(vary)]


def _line_claim(vary: str) -> tuple[bool, str]:
    """Whether our line, every point from rest, is chaotic where the paper's is, and our words."""
    line, (start, stop) = _line(vary), PAPER_CHAOS[vary]
    regime = line.branches["cold"].regime
    inside = (start <= line.values) & (line.values < stop)
    same = float(((regime == "chaotic") == inside).mean())
    found = _intervals(chaotic_intervals(line.values, regime), LINE_UNITS[vary])
    within = pd.Series(regime[inside]).value_counts(normalize=True)
    return same > ALIKE, (
        f"chaotic {found}; as in the paper at {same:.0%} of {len(regime)} points. Between "
        f"{start:g} and {stop:g}{LINE_UNITS[vary]}: "
        + ", ".join(f"{share:.0%} {name}" for name, share in within.items())
    )


def _intervals(found: list[tuple[float, float]], unit: str) -> str:
    if not found:
        return "nowhere"
    shown = ", ".join(f"{a:.2f} to {b:.2f}" if a < b else f"{a:.2f}" for a, b in found)
    return f"{shown}{unit}"


def _show_claims() -> None:
    """What the paper says, and whether it is so here, with both kinds of exponents."""
    m = reference_map()
    solved, cut = (claims(reference_scores(f), _deviation(f)) for f in (None, FLOOR))
    st.markdown("## The models")
    _table(
        ("The paper", "Ours, exponents as solved", f"Ours, floor {FLOOR:g}"),
        [
            (a.text, f"{SAID[a.holds]}: {a.found}", f"{SAID[b.holds]}: {b.found}")
            for a, b in zip(solved, cut, strict=True)
        ],
        "wide_model_claims",
    )
    st.caption(
        "Errors over all cells, training cells included, as the paper counts, averages of ten "
        "seeds, over the standard deviation of the exponents "
        f"({_deviation(None):.2f} per revolution as solved, {_deviation(FLOOR):.2f} with the "
        "floor). The paper's numbers are in the unit of its map, which it does not state; its "
        "SVM's 0.98 to 0.99 is taken as one standard deviation. *No difference*: by chance only, "
        "paired t test over the seeds, 5 %."
    )
    for floor in (None, FLOOR):
        st.caption(target_words(reference_map(floor), floor))
    st.markdown("## The motion and the map")
    chaotic = m.regime == "chaotic"
    number, mass = (
        np.broadcast_to(a, m.shape)[chaotic]
        for a in (m.bearing_number[:, None], m.rotor_mass[None, :])
    )
    half = 0.5 * float(m.rotor_mass[0] + m.rotor_mass[-1])
    heavy, slow = float((mass > half).mean()), bool((number < 1.0).any())
    lines = {vary: _line_claim(vary) for vary in LINE_FIGURES}
    minutes = m.metadata["wall_seconds"] / 60.0
    trained = [measured_seconds(MODELS[k], d, ARTIFACTS) for k in PAPER_MODELS for d in DIVISORS]
    train, predict = np.array(trained).T
    _table(
        ("The paper", "Ours"),
        [
            (
                "Λ = 3.45: chaotic for 22.66 ≤ m < 23.52 kg, elsewhere not (figures 1, 2, 6)",
                "{}: {}".format(SAID[lines["rotor-mass"][0]], lines["rotor-mass"][1]),
            ),
            (
                "4.52 kg: chaotic for 1.0 ≤ Λ < 2.4 (figures 3, 4, 7)",
                "{}: {}".format(SAID[lines["bearing-number"][0]], lines["bearing-number"][1]),
            ),
            (
                "Unstable mostly at larger rotor masses (figure 10)",
                f"{SAID[heavy > 0.5]}: {heavy:.0%} of the chaotic cells are heavier than "
                f"{half:.1f} kg",
            ),
            (
                "At small bearing numbers chaotic at smaller rotor masses (figure 10, bottom left)",
                f"{SAID[slow]}: the smallest Λ of a chaotic cell is {number.min():.2f}; at small Λ "
                "the film damps the rotor most",
            ),
            (
                "1 to 2 minutes a point, about a month for the map; its models train in minutes "
                "and predict in seconds",
                f"the map took {minutes:.0f} minutes on two cores; the {len(trained)} models of "
                f"the paper train in {train.sum():.0f} s together and predict the map in "
                f"{predict.max():.1f} s at most. Other machines and other programs: context, no "
                "ratio",
            ),
        ],
        "wide_map_claims",
    )
    st.caption(
        "The paper does not publish its bearing's constants. Ours is the reference design, another "
        "bearing with an unbalance and a porous wall as the model has them: windows of chaos need "
        "not agree, the kind of route may be compared."
    )


def _show_lines() -> None:
    """Section and exponent along the paper's two lines."""
    vary = choice(
        "Along",
        tuple(LINE_FIGURES),
        key="paper_line",
        format_func={
            "rotor-mass": "rotor mass at Λ = 3.45: figures 1, 2, 6",
            "bearing-number": "bearing number at 4.52 kg: figures 3, 4, 7",
        }.__getitem__,
    )
    x2, y2, mle = LINE_FIGURES[vary]
    line = _line(vary)
    start, stop = PAPER_CHAOS[vary]
    unit = LINE_UNITS[vary]
    figure = add_window(
        bifurcation_figure(line, ("X2", "Y2"), ["cold"]), start, stop, "chaotic in the paper"
    )
    left, right = st.columns([2.6, 1], gap="medium")
    with left:
        st.plotly_chart(
            figure.update_layout(height=600),
            key="paper_lines",
            width="stretch",
            config={"displaylogo": False},
        )
    with right:
        _table(
            ("", "paper", "ours"),
            [
                ("X₂", f"figure {x2}", "top"),
                ("Y₂", f"figure {y2}", "middle"),
                ("MLE", f"figure {mle}", "bottom"),
                (
                    "chaotic",
                    f"{start:.2f} to {stop:.2f}{unit}",
                    _intervals(chaotic_intervals(line.values, line.branches["cold"].regime), unit),
                ),
            ],
            "line_facts",
        )
        st.caption(
            "Ours: every point from rest, chaotic points shaded; first and last chaotic point of "
            "each interval. Coordinates over the clearance, once a revolution; the exponent per "
            "revolution, natural logarithm. The paper's bearing has other, unpublished constants "
            "and no unbalance: compare how chaos is reached, not where."
        )
        downloads(
            "paper_line",
            {"Figure": figure},
            {"Points": lambda: line_table(line)},
            {"npz": (ARTIFACTS / _line_file(vary)).read_bytes},
            line_command(line, ["cold"]),
        )
        page_link("Bifurcation", "Up and down sweeps, other lines")


def _show_map() -> None:
    """The map of exponents."""
    m = reference_map()
    figure = marked_map_figure(None, "MLE", "forest", 8, 0)
    left, right = st.columns([2.6, 1], gap="medium")
    with left:
        st.plotly_chart(figure, key="paper_map", width="stretch", config={"displaylogo": False})
    with right:
        solved = m.mle[np.isfinite(m.mle)]
        regimes = pd.Series(m.regime.ravel()).value_counts()
        _table(
            ("", "paper, figure 10", "ours"),
            [
                ("cells, Λ × mass", "170 × 250", f"{m.shape[0]} × {m.shape[1]}"),
                (
                    "Λ",
                    "not stated in its text",
                    f"{m.bearing_number[0]:g} to {m.bearing_number[-1]:g}",
                ),
                (
                    "mass",
                    "not stated in its text",
                    f"{m.rotor_mass[0]:g} to {m.rotor_mass[-1]:g} kg",
                ),
                ("chaotic", "mostly large masses", f"{regimes.get('chaotic', 0):,} cells"),
                ("exponent", "unit not stated", f"{solved.min():.1f} to {solved.max():.2f}"),
            ],
            "map_facts",
        )
        st.caption(
            "Ours: red positive, blue negative exponents; colours end at "
            f"±{MLE_LIMIT:g} per revolution. In the paper red and light green are unstable, blue "
            "and light blue stable; its corner of small Λ and small mass is unstable, here "
            "motions at the smallest Λ are the most damped."
        )
        downloads(
            "paper_map",
            {"Map": figure},
            {"Map": lambda: map_table(m)},
            {"npz": (ARTIFACTS / REFERENCE_MAP).read_bytes},
        )
        page_link("Surrogate_map", "Any model, fraction and seed on this map")


def _show_predictions() -> None:
    """A map predicted by one of the paper's models, as in its figures 11 to 22."""
    a, b, c = st.columns([2.6, 1.2, 1.2], vertical_alignment="bottom")
    name = choice(
        "Model",
        PAPER_MODELS,
        place=a,
        key="paper_model",
        format_func=lambda k: f"{MODELS[k].label} ({NAMES[k]})",
    )
    divisor = choice(
        "Cells trained on",
        FIGURE_DIVISORS,
        place=b,
        key="paper_divisor",
        format_func=lambda k: f"n/{k}",
    )
    floor = target_choice("target", c)
    m, predicted = reference_map(floor), predicted_map(name, divisor, 0, floor)
    found, deviation = errors(m, predicted), _deviation(floor)
    figure = marked_surrogate_figure(None, name, divisor, 0, floor)
    st.markdown(f"## Figure {figure_number(name, divisor)}: {NAMES[name]} from n/{divisor}")
    with st.container(key="wide_predictions"):
        st.plotly_chart(
            figure, key="paper_predictions", width="stretch", config={"displaylogo": False}
        )
    paper = PAPER_RMSE[name][DIVISORS.index(divisor)]
    _table(
        ("", "paper", "ours, over the deviation", "ours, per revolution"),
        [
            (
                "RMSE, whole map",
                f"{paper:.2f} (table 1)",
                f"{found['rmse_all'] / deviation:.3f}",
                f"{found['rmse_all']:.3f}",
            ),
            (
                "RMSE, cells not trained on",
                "not told",
                f"{found['rmse_held_out'] / deviation:.3f}",
                f"{found['rmse_held_out']:.3f}",
            ),
            (
                "MAE, whole map",
                "in table 2",
                f"{found['mae_all'] / deviation:.3f}",
                f"{found['mae_all']:.3f}",
            ),
        ],
        "prediction_facts",
    )
    st.caption(
        f"Middle: (a) of the paper's figure; right: (b), here the size of the error and only of "
        f"cells that were not trained on. {target_words(m, floor)}"
    )
    downloads(
        "paper_prediction",
        {"Maps": figure},
        {"Predicted map": lambda: prediction_table(m, predicted)},
        command=f"spab predict --model {name} --divisor {divisor}{floor_option(floor)} "
        "--out predicted.npz",
    )


def _show_tables() -> None:
    """The paper's tables of errors."""
    for metric, number in (("rmse", 1), ("mae", 2)):
        st.markdown(f"## Table {number}: {metric.upper()}")
        ours = {
            label: over_deviation(reference_scores(floor), metric, _deviation(floor))
            for label, floor in (("as solved", None), (f"floor {FLOOR:g}", FLOOR))
        }
        fractions = [f"n/{k}" for k in DIVISORS]
        columns = {}
        for name in PAPER_MODELS:
            if metric == "rmse":
                said = pd.Series(PAPER_RMSE[name], index=fractions)
                summary = (said.mean(), said.std(ddof=1), said.max() - said.min())
                columns[NAMES[name], "paper"] = [*said, *summary]
            for label, found in ours.items():
                columns[NAMES[name], label] = list(found[name])
        shown = pd.DataFrame(columns, index=ours["as solved"].index)
        shown.columns = [f"{a}, {b}" for a, b in shown.columns]
        with st.container(key=f"wide_table_{number}"):
            st.dataframe(
                shown.style.format("{:.3f}"),
                width="stretch",
                column_config={"_index": st.column_config.Column("cells", width=140)},
            )
        with st.container(horizontal=True):
            downloads(
                f"paper_table_{number}",
                {},
                {f"Table {number}": shown.rename_axis("cells").reset_index},
                command="spab evaluate --out scores.csv",
            )
    st.caption(
        "Ours: averages of ten seeds over the whole map, training cells included as in the paper, "
        "over the standard deviation of the exponents. The paper's numbers are as printed; its "
        "averages and deviations agree with its columns. Its table 2 is not in the text that this "
        "page was made from: it says that the decision tree has the smallest average MAE and that "
        "the random forest's varies less over the fractions."
    )
    page_link("Model_ranking", "Errors on cells not trained on, other models, withheld rectangles")


st.markdown("# Reproduce the paper")
example_line()
st.markdown(
    f"{CITATION}, doi [{DOI}](https://doi.org/{DOI}). Its figures and tables beside ours; "
    "nothing here is computed while you wait. Figures 5, 8 and 9 are schemes without results."
)
part = choice("What of the paper", PAPER_PARTS, key="paper", format_func=PARTS.__getitem__)
with errors_in_words():
    {
        "claims": _show_claims,
        "lines": _show_lines,
        "map": _show_map,
        "predictions": _show_predictions,
        "tables": _show_tables,
    }[part]()
