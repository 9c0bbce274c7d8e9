"""Surrogate map: a model trained on some of the map's cells predicts the rest; solved, predicted
and error side by side.
"""

from functools import partial
from typing import Any

import numpy as np
import streamlit as st

from spab_core.common.words import capital
from spab_core.plotting.surrogates import reliability_figure, uncertainty_figure
from spab_core.reporting.export import prediction_table
from spab_core.shipped.predicted_maps import prediction_npz
from spab_core.surrogates.classifier import ASSESSMENT, REGIME, Labels, regimes_by_threshold
from spab_core.surrogates.metrics import errors, label_scores, regime_scores, uncertainty_scores
from spab_core.surrogates.models import DIVISORS, MODELS
from spab_core.surrogates.ranking import comparison_words, error_by_regime
from spab_core.surrogates.uncertainty import reliability
from spab_core.trajectory.assessment import GRADE_WORDS
from spab_core.trajectory.regimes import REGIMES
from spab_core.ui.clicks import clickable, mark_place
from spab_core.ui.downloads import downloads
from spab_core.ui.jobs import job_panel
from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import (
    errors_in_words,
    intervals_of_job,
    marked_surrogate_figure,
    page_head,
    predicted_map,
    reference_map,
    scores_of_assessment,
    time_text,
)
from spab_core.ui.solving import live_point
from spab_core.ui.target import floor_option, target_choice, target_words
from spab_core.ui.view import TARGETS, choice, chosen_point, number_field, set_point

page_head("surrogate maps")

state = st.session_state
floor = TARGETS[state["target"]]
with errors_in_words():
    m = reference_map(floor)


def _chosen_cell() -> tuple[int, int]:
    return m.nearest(state["rotor_mass"], state["bearing_number"])


def _compare() -> None:
    state["beside"] = True


def _classifier_boxes(labels: Labels, scores: dict[str, Any]) -> None:
    """Show how well a classifier does on the held-out cells."""
    words = {value: GRADE_WORDS.get(value, value) for value in labels.values}
    name, called = capital(labels.name), int(scores["called_best"])
    boxes = st.columns(4)
    boxes[0].metric(
        f"{name} right, classifier",
        f"{scores['accuracy']:.1%}",
        help="Held-out cells. Not of the model above: extra trees on linear theory, trained on the "
        f"{labels.name}s of the same cells, whatever model is chosen",
    )
    boxes[1].metric(
        f"{name} right, balanced",
        f"{scores['balanced_accuracy']:.1%}",
        help="Mean of the shares right of each: "
        + ", ".join(f"{text} {scores[f'recall_{k}']:.1%}" for k, text in words.items()),
    )
    boxes[2].metric(
        f"Called {labels.best}, is not",
        f"{scores['unsafe_share']:.1%}" if called else "none called",
        help=f"The unsafe error: {scores['unsafe']:,} of the {called:,} cells called {labels.best}",
    )
    boxes[3].metric(
        f"Called {labels.best}, is {words[labels.worst]}",
        f"{scores['worst_called_best']:,} of {called:,}",
        help=f"Cells called {labels.best} that are {words[labels.worst]}",
    )


def _clicked(number: float, mass: float) -> None:
    set_point(mass, number)
    _compare()


st.markdown("# Surrogate maps of the example bearing")
point_bar(of_example=True)
a, b, e, c, d = st.columns([1.5, 2.6, 1.3, 0.75, 0.85], vertical_alignment="bottom")
names = list(MODELS)
name = a.selectbox(
    "Model",
    names,
    key="model",
    format_func=lambda k: f"{MODELS[k].label} ({MODELS[k].group})",
    help="Paper: the four of Kuo, Lee and Wang. Interpolation: what a designer would do without "
    "them.",
)
divisor = choice(
    "Cells trained on, of n solved ones",
    DIVISORS,
    place=b,
    key="divisor",
    format_func=lambda k: f"n/{k}",
)
target_choice("target", e)
seed = int(
    number_field(
        "Seed",
        0,
        999,
        place=c,
        key="draw",
        help="Which cells are taken to train on: another number, other cells",
    )
)

with errors_in_words():
    predicted = predicted_map(name, divisor, seed, floor)

found = errors(m, predicted)
row, column = _chosen_cell()
shown, chosen = (
    (name, divisor, seed, floor),
    (float(m.bearing_number[row]), float(m.rotor_mass[column])),
)
figure = marked_surrogate_figure(mark_place("maps", shown, chosen), *shown)
lives = error_by_regime(m, predicted)
with d:
    # not the page's own figure: its mark may stand where it was before a click (mark_place)
    downloads(
        "surrogate",
        {"Maps": lambda: marked_surrogate_figure(chosen, *shown)},
        {
            "Predicted map": partial(prediction_table, m, predicted),
            "Errors": lives.rename_axis("where").reset_index,
        },
        {"npz": partial(prediction_npz, m, predicted)},
        f"spab predict --model {name} --divisor {divisor} --seed {seed}{floor_option(floor)} "
        "--out predicted.npz",
    )
spread = float(np.nanstd(m.mle))
# whether a motion is periodic, quasi-periodic or chaotic by what this model predicts alone
by_exponent = regimes_by_threshold(
    predicted.mle[predicted.held_out], m.mle[predicted.trained], m.regime[predicted.trained]
)
own_regimes = regime_scores(m.regime[predicted.held_out], by_exponent)
with st.container(horizontal=True, horizontal_alignment="distribute"):
    for label, value, text in (
        (
            "RMSE, held-out cells",
            f"{found['rmse_held_out']:.3f}",
            "Per revolution, over the cells not trained on",
        ),
        ("MAE, held-out cells", f"{found['mae_held_out']:.3f}", "Per revolution"),
        (
            "RMSE over deviation",
            f"{found['rmse_held_out'] / spread:.3f}",
            f"Held-out RMSE over the map's standard deviation, {spread:.3f} per revolution: 1 is "
            "no better than the mean of the map",
        ),
        (
            "RMSE, whole map",
            f"{found['rmse_all']:.3f}",
            "Training cells included, as the paper counts",
        ),
        (
            "Regime right, by its exponent",
            f"{own_regimes['regime_accuracy']:.1%}",
            "Share of held-out cells whose regime is right by two thresholds of this "
            "model's exponent, those that part its training cells best. "
            f"F1 of chaos {own_regimes['chaos_f1']:.3f}",
        ),
        ("Cells trained on", f"{predicted.surrogate.training_cells:,}", None),
    ):
        st.metric(label, value, help=text, width="content")
if predicted.surrogate.converged is False:
    st.warning(
        "The training of this network stopped at its limit of 500 epochs, before its own "
        "criterion was met."
    )

with st.container(key="wide_maps"):
    clickable(figure, "maps", _clicked, "x3", config={"displaylogo": False, "scrollZoom": True})

sure, cell, beside = None, _chosen_cell(), state["beside"]
number, mass = (
    float(f"{axis[k]:.6g}") for axis, k in zip((m.bearing_number, m.rotor_mass), cell, strict=True)
)
axes = zip(chosen_point(), (m.rotor_mass, m.bearing_number), strict=True)
if any(not 0.99 * along[0] <= value <= 1.01 * along[-1] for value, along in axes):
    st.caption("The chosen point lies off this map: its nearest cell is marked.")
a, b = st.columns([3, 1], vertical_alignment="center")
if beside:
    a.markdown(
        f"## Compared at Λ {number:.3f}, {m.design.speed_rpm(number):,.0f} rpm, {mass:.2f} kg"
    )
    if b.button(
        "Open this operating point",
        key="open_point",
        icon=":material/arrow_forward:",
        width="stretch",
        on_click=set_point,
        args=(mass, number),
    ):
        st.switch_page("pages/1_Operating_point.py")
    told = st.empty()
else:
    a.info("Click a cell of the error map: the prediction there is compared with the live solve.")
    b.button(
        f"Compare at Λ {number:.4g}, {mass:.4g} kg",
        key="compare_here",
        width="stretch",
        on_click=_compare,
    )
if beside or state["sure"]:
    job = job_panel(
        "intervals",
        {"model": name, "divisor": divisor, "seed": seed, "floor": floor},
        "Compute its 90 % intervals",
        "intervals",
        auto=True,
    )
    with errors_in_words():
        sure = intervals_of_job(job) if job else None
if beside:
    with told.container(), errors_in_words():
        point = live_point(m.design, mass, number)
if beside and point is not None:
    interval = (float(sure.low[cell]), float(sure.high[cell])) if sure else None
    inside, words = comparison_words(
        float(predicted.mle[cell]), point.mle, interval, bool(predicted.trained[cell]), floor
    )
    {True: told.success, False: told.warning, None: told.info}[inside](words)

if predicted.note:
    st.warning(f"Trained on this machine: {predicted.note}.")
st.caption(
    f"{time_text(predicted)} Colours end at the 98th percentile of the error; training cells are "
    f"blank there. Cells without an exponent are left out. {target_words(m, floor)}"
)

st.markdown("## Where the error lives (held-out cells)")
st.dataframe(
    lives,
    width="content",
    column_config={
        "cells": st.column_config.NumberColumn("cells", format="localized"),
        "rmse": st.column_config.NumberColumn("RMSE per revolution", format="%.4f"),
        "mae": st.column_config.NumberColumn("MAE per revolution", format="%.4f"),
        "share": st.column_config.NumberColumn("share of squared error", format="percent"),
    },
)

st.toggle("How sure is it? Regimes, intervals and probability of instability", key="sure")
if state["sure"] and sure is None:
    st.caption("Its intervals are being computed: progress stands under the maps.")
elif sure and state["sure"]:
    scores, tested = uncertainty_scores(m, sure), sure.held_out
    bins, _ = reliability(m.regime[tested] != "periodic", sure.unstable[tested])
    cells = st.columns(4)
    cells[0].metric(
        "Coverage of 90 % intervals",
        f"{scores['coverage']:.1%}",
        help="Share of held-out cells inside; "
        + ", ".join(f"{r} {scores[f'coverage_{r}']:.1%}" for r in REGIMES),
    )
    cells[1].metric(
        "Median width", f"{scores['width']:.3f}", help="Of the intervals, per revolution"
    )
    cells[2].metric(
        "Calibration error",
        f"{scores['calibration_error']:.4f}",
        help="Of the probability of instability: mean gap between the share told and found, ten "
        "bins",
    )
    cells[3].metric(
        "F1 of chaos, classifier",
        f"{scores['classifier_chaos_f1']:.3f}",
        help="Of the classifier of regimes",
    )
    with errors_in_words():
        worth = scores_of_assessment(divisor, seed)
    _classifier_boxes(ASSESSMENT, worth)
    _classifier_boxes(REGIME, label_scores(REGIME, m.regime[tested], sure.regime[tested]))
    st.plotly_chart(uncertainty_figure(m, sure), key="sure_maps", width="stretch")
    left, right = st.columns([3, 2], gap="medium")
    left.plotly_chart(reliability_figure(bins), key="reliability", width="stretch")
    right.dataframe(
        bins,
        hide_index=True,
        column_config={
            k: st.column_config.NumberColumn(k, format="%.2f")
            for k in ("low", "high", "predicted", "observed")
        },
    )
    st.caption(
        "Intervals: split conformal, calibrated on a quarter of the training cells, for each "
        "predicted regime apart. Regimes and probability are those of a classifier (extra trees on "
        "linear theory), the same for every model. Unstable: the exponent is not negative, the "
        "motion not periodic."
    )
