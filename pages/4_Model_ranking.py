"""Model ranking: errors of all models over the training fractions, the paper's tables beside ours,
and a suggestion.
"""

import hashlib
from typing import Any

import numpy as np
import pandas as pd
import streamlit as st

from spab_core.common.words import capital
from spab_core.jobs.kinds import SAMPLES
from spab_core.plotting.surrogates import fraction_figure
from spab_core.surrogates.classifier import ASSESSMENT, REGIME
from spab_core.surrogates.models import DIVISORS, MODELS
from spab_core.surrogates.paper import PAPER_RMSE
from spab_core.surrogates.ranking import classifier_table, ranking, spread, suggestion, table
from spab_core.surrogates.samples import PER, read_samples, samples_bytes
from spab_core.trajectory.assessment import GRADE_WORDS
from spab_core.ui.downloads import downloads
from spab_core.ui.jobs import job_panel
from spab_core.ui.point_bar import example_line
from spab_core.ui.shared import (
    block_scores,
    classifier_scores,
    errors_in_words,
    page_head,
    reference_map,
    reference_ranking,
    reference_scores,
)
from spab_core.ui.target import floor_option, target_choice, target_words
from spab_core.ui.view import CELLS, METRICS, TARGETS, choice, chosen_design, design_words

page_head("model ranking")


def _percent(label: str, help: str | None = None) -> Any:
    """A column of shares."""
    return st.column_config.NumberColumn(label, format="percent", help=help)


def _cells(label: str, help: str | None = None) -> Any:
    """A column of numbers of cells, means over the seeds."""
    return st.column_config.NumberColumn(label, format="%.0f", help=help)


def _unsafe_words(known: dict[str, pd.DataFrame]) -> str:
    """How many of the cells called good from the smallest fraction are not, by where they lie."""
    found = {where: classifier_table(s, ASSESSMENT).iloc[-1] for where, s in known.items()}
    shares = "; ".join(f"{where} {row['unsafe_share']:.1%}" for where, row in found.items())
    return (
        f"Of the cells called good from {next(iter(found.values())).name} of the cells, are not: "
        f"{shares}. So solve a point that is predicted good before you rely on it."
    )


floor = TARGETS[st.session_state["ranked"]]
with errors_in_words():
    m, scores, blocks, best_first = (
        reference_map(floor),
        reference_scores(floor),
        block_scores(floor),
        reference_ranking("held_out", floor),
    )

st.markdown("# Model ranking: which one predicts the map best?")
example_line()
st.success(suggestion(best_first))
e, a, b, c = st.columns([1.3, 1, 2.2, 0.9], vertical_alignment="bottom")
target_choice("ranked", e)
metric = choice("Error", METRICS, place=a, key="metric", format_func=str.upper)
kind = choice(
    "Over",
    CELLS,
    place=b,
    key="cells",
    format_func=lambda k: {"held_out": "held-out cells", "all": "whole map (as the paper counts)"}[
        k
    ],
)

column = f"{metric}_{kind}"
found = table(scores, column)[best_first.index]  # the best first
fractions = [f"n/{k}" for k in DIVISORS if f"n/{k}" in found.index]
figure = fraction_figure(
    found.loc[fractions], spread(scores, column), f"{metric.upper()} per revolution"
)
ranked = reference_ranking(kind, floor)
with c:
    downloads(
        "ranking",
        {"Errors": figure},
        {
            "Ranking": ranked.rename_axis("model").reset_index,
            "Table": found.rename_axis("trained on").reset_index,
            "All trainings": scores.copy,
        },
        command=f"spab evaluate{floor_option(floor)} --out scores.csv",
    )
st.caption(target_words(m, floor))
left, right = st.columns(2, gap="medium")
with left:
    st.plotly_chart(figure, key="lines", width="stretch")
    st.caption(
        f"Means over {scores['seed'].nunique()} seeds of the training cells, bars: one standard "
        "deviation. Solid: the paper's models, dotted: interpolation, dashed: others."
    )
with right:
    st.dataframe(
        ranked.assign(tied=np.where(ranked["tied"], "yes", "")).rename(
            index=lambda k: MODELS[k].label
        ),
        height=420,
        column_config={
            "_index": st.column_config.Column("model", width=140),
            "rmse": st.column_config.NumberColumn("RMSE", format="%.4f"),
            "mae": st.column_config.NumberColumn("MAE", format="%.4f"),
            "spread": st.column_config.NumberColumn(
                "spread", format="%.4f", help="Standard deviation of the RMSE over fractions"
            ),
            "rank_rmse": "by RMSE",
            "rank_mae": "by MAE",
            "rank_spread": "by spread",
            "tied": st.column_config.Column(
                "tied",
                help="Its RMSE differs from the best one by chance only "
                "(paired t test over the seeds, 5 %)",
            ),
        },
    )

st.markdown(
    f"## {metric.upper()} per revolution, {'held-out cells' if kind == 'held_out' else 'whole map'}"
)
st.dataframe(
    found.rename(columns=lambda k: MODELS[k].label).style.format("{:.4f}"),
    width="stretch",
    column_config={"_index": st.column_config.Column("trained on", width=150)},
)
unfinished = scores[scores["converged"].eq(False)]
if len(unfinished):
    total = int((scores["model"] == "mlp").sum())
    st.caption(
        f"The MLP stopped at its limit of 500 epochs in {len(unfinished)} of {total} trainings."
    )

st.markdown("## Whole rectangles withheld: held-out RMSE per revolution")
if blocks is None:
    st.caption(
        "No scores on withheld rectangles are shipped: `spab evaluate --split blocks"
        f"{floor_option(floor)}` computes them."
    )
else:
    same = scores[scores["divisor"].isin(blocks["divisor"])]
    rows = {
        title: table(s, "rmse_held_out").loc["Average"]
        for title, s in (("cells at random", same), ("rectangles", blocks))
    }
    order = [k for k in best_first.index if k in set(blocks["model"])]
    beside = pd.DataFrame(rows).T[order].rename(columns=lambda k: MODELS[k].label)
    st.dataframe(beside.style.format("{:.3f}", na_rep=""), width="stretch")
    which = ", ".join(f"n/{k}" for k in sorted(blocks["divisor"].unique()))
    st.caption(
        f"Exponents as chosen above, averages over {which}. A quarter of 10 × 10 rectangles of the "
        "plane holds no training cell, errors are measured there: what interpolation knows does "
        "not reach inside."
    )

st.markdown("## Classifiers: is a cell good, and what is its motion?")
with errors_in_words():
    told = {
        "at random": classifier_scores("random"),
        "in rectangles": classifier_scores("blocks"),
    }
known = {where: s for where, s in told.items() if s is not None}
if not known:
    st.caption("No scores of classifiers are shipped: `spab evaluate --classifiers` computes them.")
else:
    for labels in (ASSESSMENT, REGIME):
        st.markdown(f"### {capital(labels.name)}")
        rows = pd.concat(
            [
                classifier_table(s, labels).rename_axis("trained on").assign(where=where)
                for where, s in known.items()
            ]
        )
        words = {value: GRADE_WORDS.get(value, value) for value in labels.values}
        st.dataframe(
            rows.reset_index()[
                ["trained on", "where", "unsafe_share", "unsafe", "called_best"]
                + ["worst_called_best", "accuracy", "balanced_accuracy"]
                + [f"recall_{value}" for value in labels.values]
            ],
            hide_index=True,
            height=35 * (len(rows) + 1) + 3,
            column_config={
                "where": "held-out cells",
                "unsafe_share": _percent(
                    f"called {labels.best}, is not",
                    help=f"Share of the cells called {labels.best} that are not: the unsafe error",
                ),
                "unsafe": _cells("cells", help=f"Called {labels.best} that are not"),
                "called_best": _cells(f"of called {labels.best}", help="Means over the seeds"),
                "worst_called_best": _cells(
                    f"{words[labels.worst]} among them",
                    help=f"Cells called {labels.best} that are {words[labels.worst]}",
                ),
                "accuracy": _percent("right"),
                "balanced_accuracy": _percent(
                    "right, balanced", help="Mean of the columns to come"
                ),
                **{
                    f"recall_{value}": _percent(
                        f"of {text}", help=f"Share of the cells that are {text} and called so"
                    )
                    for value, text in words.items()
                },
            },
        )
    seeds = max(s["seed"].nunique() for s in known.values())
    st.caption(
        "Not of the models above: extra trees on linear theory, trained on the labels of the same "
        f"cells, whatever model and exponents are chosen. Means over {seeds} seeds. The assessment "
        "is that of the motion alone, by the usual limits. " + _unsafe_words(known)
    )
    downloads(
        "classifiers",
        {},
        {f"Classifiers, {where}": s.copy for where, s in known.items()},
        command="spab evaluate --classifiers --out classifiers.csv",
    )

st.markdown("## Beside the paper: RMSE over the whole map, divided by the map's standard deviation")
deviation = float(np.nanstd(m.mle))
whole = table(scores, "rmse_all")
beside = pd.DataFrame(
    {
        f"{MODELS[k].label}, {whose}": values
        for k in PAPER_RMSE
        for whose, values in (
            ("ours", (whole.loc[fractions, k] / deviation).to_numpy()),
            ("paper", PAPER_RMSE[k][: len(fractions)]),
        )
    },
    index=fractions,
)
st.dataframe(beside.style.format("{:.2f}"), width="stretch")
st.caption(
    f"Ours over {deviation:.3f} per revolution, the deviation of the exponents chosen above. The "
    "paper does not state its unit; its SVM column, 0.98 to 0.99, is taken as one standard "
    "deviation of its map, so its numbers stand as printed. Two different bearings: compare the "
    "pattern."
)

st.markdown("## On your own data")
st.caption(
    "Exponents measured or computed elsewhere, as CSV or XLSX: a column for Λ or the speed (rpm), "
    "one for the rotor mass (kg on one bearing), one for the exponent (MLE, natural logarithm), on "
    "a grid or not; or a matrix that begins with a cell such as mass/Lambda. Units may stand in "
    "the names: `rotor mass [g]`, `mle [1/s]`. The same protocol is run on them, "
    "with the exponents as chosen above."
)
left, right = st.columns([3, 1])
file = left.file_uploader(
    "Table, CSV or XLSX", ["csv", "txt", "tsv", "dat", "xlsx"], key="own_data"
)
per = right.selectbox(
    "Exponent per",
    [None, *PER],
    key="own_per",
    format_func=lambda name: {None: "as the file says", "tau": "τ (radian)"}.get(name, name),
    help="Left as it is: what the column says, such as mle [1/s], else per revolution",
)
if file is not None:
    with errors_in_words():
        samples = read_samples(file.getvalue(), chosen_design(), per=per)
        data = samples_bytes(samples)
        dropped = (
            f", {samples.left_out:,} rows without an exponent left out" if samples.left_out else ""
        )
        whose = design_words()
        st.caption(
            f"{len(samples.mle):,} points{dropped}. The linear theory that some models start from "
            f"is that of: {whose}."
        )
        for note in samples.notes:
            st.warning(f"{capital(note)}{'' if note.endswith('?') else '.'}")
        job = job_panel(
            "ranking",
            {
                "design": chosen_design().to_dict(),
                "samples": hashlib.sha256(data).hexdigest(),
                "floor": floor,
            },
            "Train and rank the models on them",
            "own_ranking",
            files={SAMPLES: data},
        )
        if job:
            own = pd.read_csv(job.result)
            own_best = ranking(own)
            st.success(suggestion(own_best))
            own_found = table(own, "rmse_held_out")[own_best.index]
            own_lines = [name for name in fractions if name in own_found.index]
            own_figure = fraction_figure(
                own_found.loc[own_lines], spread(own, "rmse_held_out"), "RMSE per revolution"
            )
            st.plotly_chart(own_figure, key="own_lines", width="stretch")
            st.dataframe(
                own_found.rename(columns=lambda k: MODELS[k].label).style.format("{:.4f}"),
                width="stretch",
            )
            downloads("own_ranking", {"RMSE": own_figure}, {"Scores": lambda: own})
