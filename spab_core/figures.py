"""Plotly figures from results. Colours are the Okabe-Ito set, diverging and sequential scales safe for colour-blind eyes."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

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
