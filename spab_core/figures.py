"""Plotly figures from results. Colours are the Okabe-Ito set, diverging and sequential scales safe for colour-blind eyes."""

from __future__ import annotations

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.bifurcation import Bifurcation, chaotic_intervals
from spab_core.learning_curve import COMMITTEE, summary
from spab_core.point import OperatingPoint
from spab_core.refine import LABELS, Refinement
from spab_core.stability_map import StabilityMap
from spab_core.surrogates import MODELS, PredictedMap
from spab_core.uncertainty import MapUncertainty

JOURNAL, DISC, SECTION, NEUTRAL = "#0072B2", "#E69F00", "#D55E00", "#808080"
MLE_LIMIT = 0.6  # the colours saturate there; exponents of settled cells go far below
BEARING_NUMBER_LABEL, MASS_LABEL = "Bearing number Λ", "Rotor mass on one bearing, kg"


def _square(figure, title):
    circle = np.linspace(0, 2 * np.pi, 181)
    figure.add_scatter(x=np.cos(circle), y=np.sin(circle), mode="lines", name="clearance", hoverinfo="skip",
                       line={"color": NEUTRAL, "width": 1.5, "dash": "dash"})
    figure.update_layout(
        title={"text": title, "font_size": 14}, xaxis={"title": "X / C", "range": [-1.08, 1.08], "constrain": "domain"},
        yaxis={"title": "Y / C", "range": [-1.08, 1.08], "scaleanchor": "x", "constrain": "domain"},
        margin={"l": 50, "r": 10, "t": 40, "b": 40}, height=340, legend={"orientation": "h", "y": -0.22, "x": 0})
    return figure


def orbit_figure(point: OperatingPoint) -> go.Figure:
    """Journal and disc orbits of the last recorded revolutions, with the section points."""
    path = point.trajectory.path.reshape(-1, 8).astype(np.float32)
    figure = go.Figure()
    if not point.design.rigid:
        figure.add_scatter(x=path[:, 2], y=path[:, 3], mode="lines", name="disc", line={"color": DISC, "width": 1})
    figure.add_scatter(x=path[:, 0], y=path[:, 1], mode="lines", name="journal", line={"color": JOURNAL, "width": 1})
    figure = _square(figure, f"Orbits, last {len(point.trajectory.path)} revolutions")
    reach = max(1.08, 1.05 * float(np.abs(path[:, :4]).max())) if len(path) else 1.08
    return figure.update_layout(xaxis_range=[-reach, reach], yaxis_range=[-reach, reach])


def section_figure(point: OperatingPoint) -> go.Figure:
    """Poincaré section of the journal: one point a revolution."""
    section = point.trajectory.section
    figure = go.Figure()
    figure.add_scatter(x=section[:, 0], y=section[:, 1], mode="markers", name="journal at τ = 2πk",
                       marker={"color": SECTION, "size": 5})
    return _square(figure, f"Poincaré section, {len(section)} revolutions")


def exponent_figure(point: OperatingPoint) -> go.Figure:
    """Running estimate of the exponent with its final standard error."""
    figure = go.Figure()
    if point.mle:
        trace = point.mle.trace
        n = np.arange(1, len(trace) + 1)
        low, high = point.mle.value - point.mle.standard_error, point.mle.value + point.mle.standard_error
        figure.add_hrect(y0=low, y1=high, fillcolor=JOURNAL, opacity=0.15, line_width=0)
        figure.add_hline(y=point.mle.value, line={"color": JOURNAL, "dash": "dot", "width": 1})
        figure.add_scatter(x=n, y=trace, mode="lines", line={"color": JOURNAL}, name="running estimate", showlegend=False)
        settled = trace[len(trace) // 10:]
        span = max(float(np.ptp(settled)), 0.02)
        figure.update_yaxes(range=[min(settled.min(), low, 0) - 0.3 * span, max(settled.max(), high, 0) + 0.3 * span])
    figure.add_hline(y=0, line={"color": NEUTRAL, "dash": "dash", "width": 1})
    return figure.update_layout(
        title={"text": "Running exponent (dotted: final value, band: ± one standard error)", "font_size": 14}, height=340,
        xaxis={"title": "revolutions with a tangent" if point.trajectory.settled else "revolutions measured"},
        yaxis={"title": "MLE per revolution"},
        margin={"l": 60, "r": 10, "t": 40, "b": 40})


_SWEEP_COLOURS = {"cold": NEUTRAL, "up": JOURNAL, "down": SECTION}
_LINE_LABELS = {"rotor-mass": MASS_LABEL, "bearing-number": BEARING_NUMBER_LABEL}


def bifurcation_figure(line: Bifurcation, coordinate: str = "X2") -> go.Figure:
    """Section points along a line of operating points with the exponent under them on the same axis.

    Parameters
    ----------
    line : Bifurcation
    coordinate : str
        ``X2``, ``Y2`` (journal), ``X1`` or ``Y1`` (disc).

    Returns
    -------
    Figure
        One trace a sweep and panel; chaotic intervals of the first sweep shaded.
    """
    column = ("X2", "Y2", "X1", "Y1").index(coordinate)
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.04, row_heights=[0.68, 0.32])
    for name, branch in line.branches.items():
        points = branch.section[:, :, column]
        x = np.repeat(line.values, points.shape[1])
        # a periodic orbit repeats its points: once each is enough
        _, once = np.unique(np.column_stack([x, np.round(points.ravel(), 3)]), axis=0, return_index=True)
        common = {"marker": {"color": _SWEEP_COLOURS[name], "size": 2}, "mode": "markers", "legendgroup": name}
        figure.add_scattergl(x=x[once].astype(np.float32), y=points.ravel()[once], name=name, row=1, col=1, **common)
        figure.add_scatter(x=line.values.astype(np.float32), y=branch.mle.astype(np.float32), mode="lines", name=name,
                           legendgroup=name, showlegend=False, line={"color": _SWEEP_COLOURS[name], "width": 1}, row=2, col=1)
    first = next(iter(line.branches.values()))
    step = float(np.diff(line.values).min()) if len(line.values) > 1 else 0.0
    for start, stop in chaotic_intervals(line.values, first.regime):
        figure.add_vrect(x0=start - step / 2, x1=stop + step / 2, fillcolor=SECTION, opacity=0.12, line_width=0)
    figure.add_hline(y=0, line={"color": NEUTRAL, "dash": "dash", "width": 1}, row=2, col=1)
    at = f"Λ = {line.at:g}" if line.vary == "rotor-mass" else f"{line.at:g} kg"
    body = "journal" if column < 2 else "disc"
    figure.update_xaxes(range=[line.values.min() - step, line.values.max() + step])
    figure.update_xaxes(title=_LINE_LABELS[line.vary], row=2, col=1)
    figure.update_yaxes(title=f"{coordinate} / C ({body})", row=1, col=1)
    figure.update_yaxes(title="MLE per revolution", range=[-1.0, 0.6], row=2, col=1)
    return figure.update_layout(
        title={"text": f"Section at τ = 2πk, {at}; shaded: chaotic ({next(iter(line.branches))})", "font_size": 14}, height=620,
        margin={"l": 70, "r": 10, "t": 45, "b": 50}, legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.55,
                                                              "itemsizing": "constant"})


def surrogate_figure(m: StabilityMap, predicted: PredictedMap) -> go.Figure:
    """Solved map, predicted map and the absolute error of the prediction, side by side on the same axes.

    Parameters
    ----------
    m : StabilityMap
    predicted : PredictedMap

    Returns
    -------
    Figure
        Three heatmaps; the first two share the diverging scale of :func:`map_figure`. Training cells have no error to show.
    """
    error = np.where(predicted.trained, np.nan, np.abs(predicted.mle - m.mle))
    top = max(float(np.nanquantile(error, 0.98)), 1e-3) if np.isfinite(error).any() else 1.0
    figure = make_subplots(rows=1, cols=3, shared_yaxes=True, horizontal_spacing=0.02,
                           subplot_titles=("Solved", f"Predicted: {predicted.model.label}", "Error of held-out cells"))
    figure.update_layout(
        coloraxis={"colorscale": "RdBu_r", "cmin": -MLE_LIMIT, "cmax": MLE_LIMIT,
                   "colorbar": {"title": "MLE per revolution", "thickness": 12, "x": 1.01, "title_side": "right"}},
        coloraxis2={"colorscale": "Cividis", "cmin": 0.0, "cmax": top,
                    "colorbar": {"title": "|error| per revolution", "thickness": 12, "x": 1.1, "title_side": "right"}})
    for k, (z, axis) in enumerate(((m.mle, "coloraxis"), (predicted.mle, "coloraxis"), (error, "coloraxis2")), start=1):
        figure.add_heatmap(x=m.bearing_number, y=m.rotor_mass, z=z.T.astype(np.float32), coloraxis=axis, row=1, col=k,
                           hovertemplate="Λ %{x:.3f}, %{y:.2f} kg: %{z:.3f}<extra></extra>")
        figure.update_xaxes(title=BEARING_NUMBER_LABEL, showgrid=False, row=1, col=k)
    figure.update_yaxes(showgrid=False)
    figure.update_yaxes(title=MASS_LABEL, row=1, col=1)
    return figure.update_layout(height=430, margin={"l": 60, "r": 10, "t": 40, "b": 50}, dragmode="zoom")


def uncertainty_figure(m: StabilityMap, found: MapUncertainty) -> go.Figure:
    """Width of the 90 % intervals and probability of instability over the plane, side by side."""
    width = found.high - found.low
    top = max(float(np.nanquantile(width, 0.9)), 1e-3)  # the strongly damped corner is tens of times wider
    figure = make_subplots(rows=1, cols=2, shared_yaxes=True, horizontal_spacing=0.14,
                           subplot_titles=("Width of the 90 % interval", "Probability of instability (not periodic)"))
    for k, (z, scale, highest, x, title) in enumerate(((width, "Cividis", top, 0.435, "per revolution"),
                                                       (found.unstable, "RdBu_r", 1.0, 1.01, "probability")), start=1):
        figure.add_heatmap(x=m.bearing_number, y=m.rotor_mass, z=z.T.astype(np.float32), colorscale=scale, zmin=0.0,
                           zmax=highest, colorbar={"title": title, "thickness": 12, "x": x, "title_side": "right"},
                           hovertemplate="Λ %{x:.3f}, %{y:.2f} kg: %{z:.3f}<extra></extra>", row=1, col=k)
        figure.update_xaxes(title=BEARING_NUMBER_LABEL, showgrid=False, row=1, col=k)
    figure.update_yaxes(showgrid=False)
    figure.update_yaxes(title=MASS_LABEL, row=1, col=1)
    return figure.update_layout(height=400, margin={"l": 60, "r": 10, "t": 40, "b": 50}, dragmode="zoom")


def reliability_figure(bins: pd.DataFrame) -> go.Figure:
    """Observed share of unstable cells over the probability told, from ``uncertainty.reliability``."""
    figure = go.Figure()
    figure.add_scatter(x=[0, 1], y=[0, 1], mode="lines", name="perfect", line={"color": NEUTRAL, "dash": "dash", "width": 1})
    figure.add_scatter(x=bins["predicted"], y=bins["observed"], mode="lines+markers", name="held-out cells",
                       line={"color": JOURNAL}, customdata=bins["cells"],
                       hovertemplate="told %{x:.2f}, found %{y:.2f}, %{customdata:,} cells<extra></extra>")
    return figure.update_layout(xaxis={"title": "probability of instability told", "range": [-0.02, 1.02]},
                                yaxis={"title": "share found unstable", "range": [-0.02, 1.02]}, height=340,
                                margin={"l": 60, "r": 10, "t": 20, "b": 50}, legend={"x": 0.02, "y": 0.98})


_MODEL_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#808080", "#56B4E9", "#CC79A7", "#a08000", "#6050c0", "#30a0a0",
                  "#000000", "#c03050")


def fraction_figure(means: pd.DataFrame, deviations: pd.DataFrame, label: str) -> go.Figure:
    """A metric over the training fraction, a line for each model with its spread over the seeds.

    Parameters
    ----------
    means, deviations : DataFrame
        Rows n/2 ... n/8, a column for each model (``evaluation.table`` without its last three rows, ``evaluation.spread``).
    label : str
        Of the vertical axis, with its unit.
    """
    figure = go.Figure()
    order = list(MODELS)
    for name in means.columns:
        k = order.index(name)
        dash = {"paper": "solid", "interpolation": "dot", "better": "dash"}[MODELS[name].group]
        figure.add_scatter(x=list(means.index), y=means[name], mode="lines+markers", name=MODELS[name].label,
                           line={"color": _MODEL_COLOURS[k % len(_MODEL_COLOURS)], "dash": dash},
                           error_y={"type": "data", "array": deviations[name].fillna(0.0), "thickness": 1, "width": 3})
    return figure.update_layout(xaxis={"title": "cells trained on, of n"},
                                yaxis={"title": f"{label} (log scale)", "type": "log",
                                       "tickvals": [digit * 10.0**k for k in range(-3, 2) for digit in (1, 2, 5)]},
                                height=420, margin={"l": 60, "r": 10, "t": 20, "b": 50})


REFINE_LAYERS = ("Regime", "MLE", "Probability unstable")
_LABEL_COLOURS = dict(zip(LABELS, ("#56B4E9", "#F0E442", "#D55E00", "#999999"), strict=True))


def refinement_figure(r: Refinement, layer: str = "Regime") -> go.Figure:
    """A predicted plane with the solved cells on it and those to solve next.

    Parameters
    ----------
    r : Refinement
    layer : str
        One of :data:`REFINE_LAYERS`.
    """
    figure = go.Figure()
    common = {"x": r.bearing_number, "y": r.rotor_mass}
    bar = {"thickness": 14, "len": 0.9, "title_side": "right"}
    where = "Λ %{x:.3f}, %{y:.2f} kg"
    if layer == "Regime":
        code = np.zeros(r.batch.shape, np.float32)
        scale = []
        for k, (label, colour) in enumerate(_LABEL_COLOURS.items()):
            code[r.regime == label] = k
            scale += [(k / len(LABELS), colour), ((k + 1) / len(LABELS), colour)]
            if (r.regime == label).any():
                figure.add_scatter(x=[None], y=[None], mode="markers", name=label or "no exponent (run fails)", showlegend=True,
                                   marker={"color": colour, "size": 12, "symbol": "square"})
        figure.add_heatmap(z=code.T, zmin=-0.5, zmax=len(LABELS) - 0.5, colorscale=scale, showscale=False,
                           text=np.where(r.regime == "", "no exponent", r.regime).T,
                           hovertemplate=f"{where}: %{{text}} predicted<extra></extra>", **common)
    elif layer == "MLE":
        figure.add_heatmap(z=r.mle.T.astype(np.float32), zmin=-MLE_LIMIT, zmax=MLE_LIMIT, colorscale="RdBu_r",
                           colorbar={"title": "MLE per revolution, predicted", **bar},
                           hovertemplate=f"{where}: MLE %{{z:.3f}} predicted<extra></extra>", **common)
    else:
        figure.add_heatmap(z=r.unstable.T.astype(np.float32), zmin=0.0, zmax=1.0, colorscale="Cividis",
                           colorbar={"title": "probability of chaos or failure", **bar},
                           hovertemplate=f"{where}: probability %{{z:.2f}}<extra></extra>", **common)
    row, column = np.nonzero(r.solved)
    figure.add_scattergl(x=r.bearing_number[row].astype(np.float32), y=r.rotor_mass[column].astype(np.float32), mode="markers",
                         name=f"solved ({len(row):,})", hoverinfo="skip", marker={"color": "#000000", "size": 2.5})
    row, column = np.unravel_index(r.suggested, r.batch.shape)
    figure.add_scatter(x=r.bearing_number[row], y=r.rotor_mass[column], mode="markers", name=f"solve next ({len(row)})",
                       hovertemplate=f"solve next: {where}<extra></extra>",
                       marker={"color": "#CC79A7", "size": 12, "symbol": "star", "line": {"color": "#000000", "width": 1}})
    ranges = []
    for values in (r.bearing_number, r.rotor_mass):
        half = 0.5 * (values[-1] - values[0]) / max(len(values) - 1, 1) or 0.5
        ranges.append([values[0] - half, values[-1] + half])
    figure.update_layout(
        xaxis={"title": BEARING_NUMBER_LABEL, "showgrid": False, "range": ranges[0]},
        yaxis={"title": MASS_LABEL, "showgrid": False, "range": ranges[1]},
        margin={"l": 60, "r": 10, "t": 30, "b": 50}, height=560, dragmode="zoom",
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "itemsizing": "constant"})
    return figure


def learning_curve_figure(rows: pd.DataFrame, judged: str = "unsolved") -> go.Figure:
    """RMSE and F1 of chaos over the number of solved cells, chosen and drawn at random, with their spread over the seeds.

    Parameters
    ----------
    rows : DataFrame
        Of ``learning_curve.learning_curve``.
    judged : str
        ``unsolved`` or ``withheld``: which cells are predicted.
    """
    table = summary(rows, judged)
    solved = rows.groupby("divisor")["solved"].first()
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.1,
                           subplot_titles=("RMSE per revolution (log scale)", "F1 of chaos"))
    for k, metric in enumerate(("rmse", "chaos_f1"), start=1):
        for strategy, name, colour in (("refine", "chosen by spab refine", SECTION), ("random", "drawn at random", JOURNAL)):
            found = table.loc[(strategy, COMMITTEE)][metric]
            figure.add_scatter(x=solved[found.index], y=found["mean"], mode="lines+markers", name=name, legendgroup=strategy,
                               showlegend=k == 1, line={"color": colour}, row=1, col=k,
                               error_y={"type": "data", "array": found["std"].fillna(0.0), "thickness": 1, "width": 3})
        others = table.loc["random"][metric]["mean"].drop(COMMITTEE)
        if len(others):
            best = others.idxmin() if metric == "rmse" else others.idxmax()
            figure.add_scatter(x=[solved[best[1]]], y=[others[best]], mode="markers+text", text=[MODELS[best[0]].label],
                               textposition="bottom left", name="best other model, random cells", legendgroup="other",
                               showlegend=k == 1, marker={"color": NEUTRAL, "size": 11, "symbol": "diamond"}, row=1, col=k)
        figure.update_xaxes(title="solved cells (log scale)", type="log", tickvals=list(solved),
                            ticktext=[f"n/{d}<br>{c:,}" for d, c in solved.items()], row=1, col=k)
    figure.update_yaxes(type="log", tickvals=[digit * 10.0**k for k in range(-3, 2) for digit in (1, 2, 5)], row=1, col=1)
    return figure.update_layout(height=400, margin={"l": 60, "r": 10, "t": 50, "b": 70},
                                legend={"orientation": "h", "y": 1.12, "yanchor": "bottom", "x": 0})
