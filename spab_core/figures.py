"""Plotly figures from results. Colours are the Okabe-Ito set, diverging and sequential scales safe for colour-blind eyes."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.bifurcation import Bifurcation, chaotic_intervals
from spab_core.point import OperatingPoint
from spab_core.regimes import Regime
from spab_core.stability_map import StabilityMap

LAYERS = ("MLE", "Regime", "Contact share")
JOURNAL, DISC, SECTION, NEUTRAL = "#0072B2", "#E69F00", "#D55E00", "#808080"
MLE_LIMIT = 0.6  # the colours saturate there; exponents of settled cells go far below
_REGIMES = (  # label, colour, whether (regime, period) belongs
    ("periodic-1", "#56B4E9", lambda r, p: (r == "periodic") & (p == 1)),
    ("periodic-2", "#0072B2", lambda r, p: (r == "periodic") & (p == 2)),
    ("periodic-3 and more", "#00334d", lambda r, p: (r == "periodic") & (p > 2)),
    ("quasi-periodic", "#F0E442", lambda r, p: r == "quasi-periodic"),
    ("chaotic", "#D55E00", lambda r, p: r == "chaotic"),
    ("no exponent (run failed)", "#999999", lambda r, p: r == ""),
)
BEARING_NUMBER_LABEL, MASS_LABEL = "Bearing number Λ", "Rotor mass on one bearing, kg"


_HOVER = ("Λ %{x:.3f} (%{customdata[0]:,.0f} rpm), %{y:.2f} kg<br><b>%{text}, MLE %{customdata[1]:+.3f} ± "
          "%{customdata[2]:.3f}</b><br>contact %{customdata[3]:.1f} %, largest eccentricity %{customdata[4]:.3f}"
          "<extra></extra>")


def _hover(m: StabilityMap) -> dict:
    """Numbers in binary and short names: a sentence for each of 42,500 cells would be megabytes."""
    rpm = np.repeat(m.design.speed_rpm(1.0) * m.bearing_number, len(m.rotor_mass))
    columns = [rpm, *(a.ravel() for a in (m.mle, m.mle_standard_error, 100 * m.contact_share, m.max_eccentricity))]
    cells = list(zip(*(a.ravel().tolist() for a in (m.regime, m.period, m.status)), strict=True))
    names = {(r, p, s): Regime(r, p).text if r else f"no exponent ({s})" for r, p, s in set(cells)}
    return {"customdata": np.column_stack(columns).astype(np.float32), "text": [names[c] for c in cells],
            "hovertemplate": _HOVER}


def map_figure(m: StabilityMap, layer: str = "MLE") -> go.Figure:
    """The stability map with an invisible layer of points that answers clicks.

    Parameters
    ----------
    m : StabilityMap
    layer : str
        One of :data:`LAYERS`.

    Returns
    -------
    Figure
        Trace 0 is the heatmap; the trace named "cells" has one point a cell, in the order of ``mle.ravel()``.
    """
    figure = go.Figure()
    common = {"x": m.bearing_number, "y": m.rotor_mass, "hoverinfo": "skip"}
    bar = {"thickness": 14, "len": 0.9, "title_side": "right"}
    if layer == "Regime":
        code = np.full(m.shape, np.nan)
        scale = []
        for k, (label, colour, belongs) in enumerate(_REGIMES):
            mask = belongs(m.regime, m.period)
            code[mask] = k
            scale += [(k / len(_REGIMES), colour), ((k + 1) / len(_REGIMES), colour)]
            if mask.any():
                figure.add_scatter(x=[None], y=[None], mode="markers", name=label, showlegend=True,
                                   marker={"color": colour, "size": 12, "symbol": "square"})
        figure.add_heatmap(z=code.T.astype(np.float32), zmin=-0.5, zmax=len(_REGIMES) - 0.5, colorscale=scale, showscale=False,
                           **common)
    elif layer == "Contact share":
        figure.add_heatmap(z=(100 * m.contact_share.T).astype(np.float32), zmin=0, colorscale="Cividis",
                           colorbar={"title": "time in contact, %", **bar}, **common)
    else:
        figure.add_heatmap(z=m.mle.T.astype(np.float32), zmin=-MLE_LIMIT, zmax=MLE_LIMIT, colorscale="RdBu_r",
                           colorbar={"title": "MLE per revolution (> 0 chaotic)", **bar}, **common)
    b, kg = np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij")
    figure.add_scattergl(
        x=b.ravel().astype(np.float32), y=kg.ravel().astype(np.float32), mode="markers", name="cells", showlegend=False,
        marker={"size": 9, "opacity": 0}, **_hover(m),
        selected={"marker": {"opacity": 1, "size": 13, "color": "#000000"}}, unselected={"marker": {"opacity": 0}})
    figure.update_layout(
        xaxis={"title": BEARING_NUMBER_LABEL, "showgrid": False, "constrain": "domain"},
        yaxis={"title": MASS_LABEL, "showgrid": False}, uirevision="map", clickmode="event+select", dragmode="zoom",
        margin={"l": 60, "r": 10, "t": 30, "b": 50}, height=600,
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0})
    return figure


def mark_point(figure: go.Figure, bearing_number: float, rotor_mass: float) -> go.Figure:
    """Add a cross at an operating point (rotor mass in kg) to a map's figure; returns the figure."""
    cross = {"symbol": "x", "size": 13, "color": "#000000", "line": {"color": "#ffffff", "width": 1.5}}
    return figure.add_scatter(x=[bearing_number], y=[rotor_mass], mode="markers", name="chosen point", showlegend=False,
                              hoverinfo="skip", marker=cross)


def mark_cell(figure: go.Figure, index: int) -> go.Figure:
    """Show a cell of a map's figure as the selected one; returns the figure."""
    return figure.update_traces(selectedpoints=[index], selector={"name": "cells"})


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
