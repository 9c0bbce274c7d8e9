"""Surrogate map: a model trained on some of the map's cells predicts the rest; solved, predicted and error side by side."""

import numpy as np
import streamlit as st

from spab_core.evaluation import error_by_regime, errors, uncertainty_scores
from spab_core.figures_surrogates import reliability_figure, surrogate_figure, uncertainty_figure
from spab_core.surrogates import DIVISORS, MODELS
from spab_core.ui.shared import (
    errors_in_words,
    page_head,
    predicted_map,
    reference_map,
    time_text,
    uncertain_reference_map,
)
from spab_core.uncertainty import reliability

page_head("surrogate map")

with errors_in_words():
    m = reference_map()

st.markdown("#### Surrogate map of the reference bearing")
a, b, c = st.columns([2, 2.4, 1], vertical_alignment="bottom")
names = list(MODELS)
name = a.selectbox("Model", names, key="model",
                   format_func=lambda k: f"{MODELS[k].label} ({MODELS[k].group})",
                   help="Paper: the four of Kuo, Lee and Wang. Interpolation: what a designer would do without them.")
divisor = b.segmented_control("Cells trained on, of n solved ones", DIVISORS, key="divisor",
                              format_func=lambda k: f"n/{k}") or 8
seed = c.number_input("Draw", 0, 999, key="draw", help="Which cells are drawn to train on: another number, other cells")

with errors_in_words():
    predicted = predicted_map(name, divisor, int(seed))

found, deviation = errors(m, predicted), float(np.nanstd(m.mle))
cells = st.columns(5)
cells[0].metric("RMSE, held-out cells", f"{found['rmse_held_out']:.3f}",
                help="Per revolution, over the cells that were not trained on")
cells[1].metric("MAE, held-out cells", f"{found['mae_held_out']:.3f}", help="Per revolution")
cells[2].metric("RMSE over deviation", f"{found['rmse_held_out'] / deviation:.3f}",
                help=f"Held-out RMSE over the map's standard deviation, {deviation:.3f} per revolution: 1 is no better than "
                     "the mean of the map")
cells[3].metric("RMSE, whole map", f"{found['rmse_all']:.3f}",
                help="Training cells included, as the paper counts")
cells[4].metric("Cells trained on", f"{predicted.surrogate.training_cells:,}")
if predicted.surrogate.converged is False:
    st.warning("The training of this network stopped at its limit of 500 epochs, before its own criterion was met.")

st.plotly_chart(surrogate_figure(m, predicted), key="maps", width="stretch")
if predicted.note:
    st.warning(f"Trained on this machine: {predicted.note}.")
st.caption(f"{time_text(predicted)} Colours end at the 98th percentile of the error; training cells are blank "
           "there. Cells without an exponent are left out.")

st.markdown("##### Where the error lives (held-out cells)")
st.dataframe(error_by_regime(m, predicted), width="content", column_config={
    "cells": st.column_config.NumberColumn("cells", format="localized"),
    "rmse": st.column_config.NumberColumn("RMSE per revolution", format="%.4f"),
    "mae": st.column_config.NumberColumn("MAE per revolution", format="%.4f"),
    "share": st.column_config.NumberColumn("share of squared error", format="percent")})

if st.toggle("How sure is it? Regimes, intervals and probability of instability (trains for some seconds more)", key="sure"):
    with errors_in_words():
        sure = uncertain_reference_map(name, divisor, int(seed))
    scores, tested = uncertainty_scores(m, sure), sure.regimes.held_out
    bins, _ = reliability(m.regime[tested] != "periodic", sure.unstable[tested])
    cells = st.columns(5)
    cells[0].metric("Regime accuracy", f"{scores['regime_accuracy']:.1%}",
                    help="Held-out cells; a classifier of its own, trained on the same cells, whatever the model above")
    cells[1].metric("F1 of chaos", f"{scores['chaos_f1']:.3f}", help="Likewise")
    cells[2].metric("Coverage of 90 % intervals", f"{scores['coverage']:.1%}",
                    help="Share of held-out cells inside; " + ", ".join(
                        f"{r} {scores[f'coverage_{r}']:.1%}" for r in ("periodic", "quasi-periodic", "chaotic")))
    cells[3].metric("Median width", f"{scores['width']:.3f}", help="Of the intervals, per revolution")
    cells[4].metric("Calibration error", f"{scores['calibration_error']:.4f}",
                    help="Of the probability of instability: mean gap between the share told and found, ten bins")
    st.plotly_chart(uncertainty_figure(m, sure), key="sure_maps", width="stretch")
    left, right = st.columns([3, 2], gap="medium")
    left.plotly_chart(reliability_figure(bins), key="reliability", width="stretch")
    right.dataframe(bins, hide_index=True, column_config={
        k: st.column_config.NumberColumn(k, format="%.2f") for k in ("low", "high", "predicted", "observed")})
    st.caption("Intervals: split conformal, calibrated on a quarter of the training cells, for each predicted regime apart. "
               "Unstable: the exponent is not negative, the motion not periodic.")
