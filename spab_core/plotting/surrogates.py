"""Plotly figures of surrogates: predicted maps, their errors and uncertainty, rankings, refinement,
the map's audit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.active_learning.committee import LABELS
from spab_core.active_learning.learning_curve import COMMITTEE, summary
from spab_core.active_learning.refine import Refinement
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.theme import (
    BEARING_NUMBER_LABEL,
    JOURNAL,
    LOG_TICKS,
    MASS_LABEL,
    MLE_LIMIT,
    NEUTRAL,
    PINK,
    REGIME_COLOURS,
    SECTION,
    add_legend_square,
    class_layer,
)
from spab_core.surrogates.models import MODELS, PredictedMap
from spab_core.surrogates.uncertainty import MapIntervals
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES

ERROR_AXES: dict[str, Any] = {"xaxis": "x3", "yaxis": "y3"}  # of the third map


def surrogate_figure(m: StabilityMap, predicted: PredictedMap) -> go.Figure:
    """Solved map, predicted map and the absolute error of the prediction, side by side on the same
    axes.

    Parameters
    ----------
    m : StabilityMap
    predicted : PredictedMap

    Returns
    -------
    Figure
        Three heatmaps, the error on :data:`ERROR_AXES`; the first two share the diverging scale of
        :func:`map_figure`. Training cells have no error to show.
    """
    error = np.where(predicted.trained, np.nan, np.abs(predicted.mle - m.mle))
    top = max(float(np.nanquantile(error, 0.98)), 1e-3) if np.isfinite(error).any() else 1.0
    figure = make_subplots(
        rows=1,
        cols=3,
        shared_yaxes=True,
        horizontal_spacing=0.02,
        subplot_titles=("Solved", f"Predicted: {predicted.model.label}", "Error of held-out cells"),
    )
    figure.update_layout(
        coloraxis={
            "colorscale": "RdBu_r",
            "cmin": -MLE_LIMIT,
            "cmax": MLE_LIMIT,
            "colorbar": {
                "title": "MLE per revolution",
                "thickness": 12,
                "x": 1.01,
                "title_side": "right",
            },
        },
        coloraxis2={
            "colorscale": "Cividis",
            "cmin": 0.0,
            "cmax": top,
            "colorbar": {
                "title": "|error| per revolution",
                "thickness": 12,
                "x": 1.1,
                "title_side": "right",
            },
        },
    )
    for k, (z, axis) in enumerate(
        ((m.mle, "coloraxis"), (predicted.mle, "coloraxis"), (error, "coloraxis2")), start=1
    ):
        figure.add_heatmap(
            x=m.bearing_number,
            y=m.rotor_mass,
            z=z.T.astype(np.float32),
            coloraxis=axis,
            row=1,
            col=k,
            hovertemplate="Λ %{x:.3f}, %{y:.2f} kg: %{z:.3f}<extra></extra>",
        )
        figure.update_xaxes(title=BEARING_NUMBER_LABEL, showgrid=False, row=1, col=k)
    told = np.where(
        predicted.trained,
        "trained on",
        np.where(np.isnan(error), NO_EXPONENT, np.char.mod("%.3f", error)),
    )
    figure.data[-1].update(
        text=told.T, hovertemplate="Λ %{x:.3f}, %{y:.2f} kg: %{text}<extra></extra>"
    )
    figure.update_yaxes(showgrid=False)
    figure.update_yaxes(title=MASS_LABEL, row=1, col=1)
    figure.update_xaxes(range=_ends(m.bearing_number))  # or a mark at the edge would widen them
    figure.update_yaxes(range=_ends(m.rotor_mass))
    return figure.update_layout(
        height=400,
        margin={"l": 60, "r": 10, "t": 40, "b": 50},
        dragmode="zoom",
        uirevision="maps",
        datarevision=1,
    )


def _ends(values: np.ndarray) -> list[float]:
    """Both ends of an axis whose cells lie around these values."""
    half = 0.5 * (values[-1] - values[0]) / max(len(values) - 1, 1) or 0.5
    return [values[0] - half, values[-1] + half]


def uncertainty_figure(m: StabilityMap, found: MapIntervals) -> go.Figure:
    """Width of the 90 % intervals and probability of instability over the plane, side by side."""
    width = found.high - found.low
    top = max(
        float(np.nanquantile(width, 0.9)), 1e-3
    )  # the strongly damped corner is tens of times wider
    figure = make_subplots(
        rows=1,
        cols=2,
        shared_yaxes=True,
        horizontal_spacing=0.14,
        subplot_titles=("Width of the 90 % interval", "Probability of instability (not periodic)"),
    )
    for k, (z, scale, highest, x, title) in enumerate(
        (
            (width, "Cividis", top, 0.435, "per revolution"),
            (found.unstable, "RdBu_r", 1.0, 1.01, "probability"),
        ),
        start=1,
    ):
        figure.add_heatmap(
            x=m.bearing_number,
            y=m.rotor_mass,
            z=z.T.astype(np.float32),
            colorscale=scale,
            zmin=0.0,
            zmax=highest,
            colorbar={"title": title, "thickness": 12, "x": x, "title_side": "right"},
            hovertemplate="Λ %{x:.3f}, %{y:.2f} kg: %{z:.3f}<extra></extra>",
            row=1,
            col=k,
        )
        figure.update_xaxes(title=BEARING_NUMBER_LABEL, showgrid=False, row=1, col=k)
    figure.update_yaxes(showgrid=False)
    figure.update_yaxes(title=MASS_LABEL, row=1, col=1)
    return figure.update_layout(
        height=400, margin={"l": 60, "r": 10, "t": 40, "b": 50}, dragmode="zoom"
    )


def reliability_figure(bins: pd.DataFrame) -> go.Figure:
    """Observed share of unstable cells over the predicted one, from ``uncertainty.reliability``."""
    figure = go.Figure()
    figure.add_scatter(
        x=[0, 1],
        y=[0, 1],
        mode="lines",
        name="perfect",
        line={"color": NEUTRAL, "dash": "dash", "width": 1},
    )
    figure.add_scatter(
        x=bins["predicted"],
        y=bins["observed"],
        mode="lines+markers",
        name="held-out cells",
        line={"color": JOURNAL},
        customdata=bins["cells"],
        hovertemplate="told %{x:.2f}, found %{y:.2f}, %{customdata:,} cells<extra></extra>",
    )
    return figure.update_layout(
        xaxis={"title": "probability of instability told", "range": [-0.02, 1.02]},
        yaxis={"title": "share found unstable", "range": [-0.02, 1.02]},
        height=340,
        margin={"l": 60, "r": 10, "t": 20, "b": 50},
        legend={"x": 0.02, "y": 0.98},
    )


_MODEL_COLOURS = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#808080",
    "#56B4E9",
    "#CC79A7",
    "#a08000",
    "#6050c0",
    "#30a0a0",
    "#8a5a44",
    "#c03050",
)


def fraction_figure(means: pd.DataFrame, deviations: pd.DataFrame, label: str) -> go.Figure:
    """A metric over the training fraction, a line for each model with its spread over the seeds.

    Parameters
    ----------
    means, deviations : DataFrame
        Rows n/2 ... n/8, a column for each model (``ranking.table`` without its last three rows,
        ``ranking.spread``).
    label : str
        Of the vertical axis, with its unit.
    """
    figure = go.Figure()
    order = list(MODELS)
    for name in means.columns:
        k = order.index(name)
        dash = {"paper": "solid", "interpolation": "dot", "better": "dash"}[MODELS[name].group]
        figure.add_scatter(
            x=list(means.index),
            y=means[name],
            mode="lines+markers",
            name=MODELS[name].label,
            line={"color": _MODEL_COLOURS[k % len(_MODEL_COLOURS)], "dash": dash},
            error_y=_spread(deviations[name]),
        )
    return figure.update_layout(
        xaxis={"title": "cells trained on, of n"},
        yaxis={"title": f"{label} (log scale)", "type": "log", "tickvals": LOG_TICKS},
        height=420,
        margin={"l": 60, "r": 10, "t": 20, "b": 50},
    )


_WHERE = "Λ %{x:.3f}, %{y:.2f} kg"
REFINE_LAYERS = ("Regime", "MLE", "Probability unstable")


def refinement_figure(r: Refinement, layer: str = "Regime") -> go.Figure:
    """A predicted plane with the solved cells on it and those to solve next.

    Parameters
    ----------
    r : Refinement
    layer : str
        One of :data:`REFINE_LAYERS`.
    """
    figure = go.Figure()
    shown = _prediction_layer(figure, r, layer)
    figure.add_heatmap(
        x=r.bearing_number, y=r.rotor_mass, **shown | {"z": shown["z"].T.astype(np.float32)}
    )
    _add_solved_cells(figure, r)
    row, column = np.unravel_index(r.suggested, r.batch.shape)
    figure.add_scatter(
        x=r.bearing_number[row],
        y=r.rotor_mass[column],
        mode="markers",
        name=f"solve next ({len(row)})",
        hovertemplate=f"solve next: {_WHERE}<extra></extra>",
        marker={
            "color": PINK,
            "size": 12,
            "symbol": "star",
            "line": {"color": "#000000", "width": 1},
        },
    )
    return figure.update_layout(
        xaxis={"title": BEARING_NUMBER_LABEL, "showgrid": False, "range": _ends(r.bearing_number)},
        yaxis={"title": MASS_LABEL, "showgrid": False, "range": _ends(r.rotor_mass)},
        margin={"l": 60, "r": 10, "t": 30, "b": 50},
        height=560,
        dragmode="zoom",
        datarevision=1,
        legend={
            "orientation": "h",
            "y": 1.0,
            "yanchor": "bottom",
            "x": 0,
            "itemsizing": "constant",
        },
    )


def _prediction_layer(figure: go.Figure, r: Refinement, layer: str) -> dict[str, Any]:
    """Return values and colours of the predicted plane's heatmap; regimes go into the legend."""
    bar = {"thickness": 14, "len": 0.9, "title_side": "right"}
    if layer == "Regime":
        labels = {label: label or f"{NO_EXPONENT} (run fails)" for label in LABELS}
        return class_layer(
            figure, ((labels[label], REGIME_COLOURS[label], r.regime == label) for label in LABELS)
        ) | {
            "text": np.where(r.regime == "", NO_EXPONENT, r.regime).T,
            "hovertemplate": f"{_WHERE}: %{{text}} predicted<extra></extra>",
        }
    if layer == "MLE":
        return {
            "z": r.mle,
            "zmin": -MLE_LIMIT,
            "zmax": MLE_LIMIT,
            "colorscale": "RdBu_r",
            "colorbar": {"title": "MLE per revolution, predicted", **bar},
            "hovertemplate": f"{_WHERE}: MLE %{{z:.3f}} predicted<extra></extra>",
        }
    return {
        "z": r.unstable,
        "zmin": 0.0,
        "zmax": 1.0,
        "colorscale": "Cividis",
        "colorbar": {"title": "probability of chaos or failure", **bar},
        "hovertemplate": f"{_WHERE}: probability %{{z:.2f}}<extra></extra>",
    }


def _add_solved_cells(figure: go.Figure, r: Refinement) -> None:
    """Add the solved cells in black; a second heatmap, as thousands of markers take a browser half
    a second to draw.
    """
    figure.add_heatmap(
        x=r.bearing_number,
        y=r.rotor_mass,
        z=np.where(r.solved, np.float32(1.0), np.float32(np.nan)).T,
        colorscale=[[0, "#000000"], [1, "#000000"]],
        showscale=False,
        hoverinfo="skip",
    )
    add_legend_square(figure, f"solved ({int(r.solved.sum()):,})", "#000000")
    # the grey edge shows the black square on a dark page
    figure.data[-1].marker.update(size=7, line={"color": "#999999", "width": 1})


def learning_curve_figure(rows: pd.DataFrame, judged: str = "unsolved") -> go.Figure:
    """RMSE and F1 of chaos over the number of solved cells, chosen and drawn at random, with their
    spread over the seeds.

    Parameters
    ----------
    rows : DataFrame
        Of ``learning_curve.learning_curve``.
    judged : str
        ``unsolved`` or ``withheld``: which cells are predicted.
    """
    table = summary(rows, judged)
    solved = rows.groupby("divisor")["solved"].first()
    figure = make_subplots(
        rows=1,
        cols=2,
        horizontal_spacing=0.1,
        subplot_titles=("RMSE per revolution (log scale)", "F1 of chaos"),
    )
    for k, metric in enumerate(("rmse", "chaos_f1"), start=1):
        for strategy, name, colour in (
            ("refine", "chosen by spab refine", SECTION),
            ("random", "drawn at random", JOURNAL),
        ):
            found = table.loc[(strategy, COMMITTEE)][metric]
            figure.add_scatter(
                x=solved[found.index],
                y=found["mean"],
                mode="lines+markers",
                name=name,
                legendgroup=strategy,
                showlegend=k == 1,
                line={"color": colour},
                error_y=_spread(found["std"]),
                row=1,
                col=k,
            )
        _add_best_model(figure, table.loc["random"][metric]["mean"], solved, metric, k)
        figure.update_xaxes(
            title="solved cells (log scale)",
            type="log",
            tickvals=list(solved),
            ticktext=[f"n/{d}<br>{c:,}" for d, c in solved.items()],
            row=1,
            col=k,
        )
    figure.update_yaxes(type="log", tickvals=LOG_TICKS, row=1, col=1)
    return figure.update_layout(
        height=400,
        margin={"l": 60, "r": 10, "t": 50, "b": 70},
        legend={"orientation": "h", "y": 1.12, "yanchor": "bottom", "x": 0},
    )


def _spread(deviation: pd.Series) -> dict[str, Any]:
    """Return error bars of standard deviations; none where there is one seed only."""
    return {"type": "data", "array": deviation.fillna(0.0), "thickness": 1, "width": 3}


def _add_best_model(
    figure: go.Figure, means: pd.Series, solved: pd.Series, metric: str, column: int
) -> None:
    """Mark the best score of the models other than the committee, by (model, divisor)."""
    others = means.drop(COMMITTEE)
    if not len(others):
        return
    best = others.idxmin() if metric == "rmse" else others.idxmax()
    figure.add_scatter(
        x=[solved[best[1]]],
        y=[others[best]],
        mode="markers+text",
        text=[MODELS[best[0]].label],
        textposition="bottom left",
        name="best other model, random cells",
        legendgroup="other",
        showlegend=column == 1,
        marker={"color": NEUTRAL, "size": 11, "symbol": "diamond"},
        row=1,
        col=column,
    )


def audit_figure(rows: pd.DataFrame) -> go.Figure:
    """Exponents of audited cells over those of the map, by the regime that the audit found
    (``manifest.load_audit``).
    """
    figure, ends = go.Figure(), [-1.6, 0.6]
    figure.add_scatter(
        x=ends,
        y=ends,
        mode="lines",
        name="equal",
        line={"color": NEUTRAL, "dash": "dash", "width": 1},
    )
    for regime in REGIMES:
        found = rows[rows["regime"] == regime]
        if found.empty:
            continue
        other = found["map_regime"] != regime
        figure.add_scatter(
            x=found["map_mle"],
            y=found["mle"],
            mode="markers",
            name=f"{regime} ({len(found)})",
            error_y={"type": "data", "array": found["error"], "thickness": 1, "width": 0},
            marker={
                "color": REGIME_COLOURS[regime],
                "line": {"color": NEUTRAL, "width": 1},
                "size": np.where(other, 11, 6),
                "symbol": np.where(other, "x", "circle"),
            },
            customdata=found[["bearing_number", "rotor_mass_kg", "map_regime"]],
            hovertemplate="Λ %{customdata[0]:.3f}, %{customdata[1]:.2f} kg<br>map: "
            "%{customdata[2]}, "
            f"%{{x:.4f}}<br>audit: {regime}, %{{y:.4f}}<extra></extra>",
        )
    outside = int((rows["map_mle"] < ends[0]).sum())
    return figure.update_layout(
        title={
            "text": f"Cells solved again (crosses: another regime; {outside} strongly damped "
            "cells are left of the axes)",
            "font_size": 14,
        },
        height=430,
        xaxis={"title": "MLE of the map, per revolution", "range": ends},
        yaxis={"title": "MLE of the audit, per revolution", "range": ends},
        margin={"l": 60, "r": 10, "t": 40, "b": 50},
    )
