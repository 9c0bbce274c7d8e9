"""The stability map as a Plotly figure: its layers, the border of chaos, the linear threshold, a layer that answers clicks."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from contourpy import contour_generator
from scipy.ndimage import gaussian_filter

from spab_core.features import LinearTable
from spab_core.figures import BEARING_NUMBER_LABEL, MASS_LABEL, MLE_LIMIT
from spab_core.regimes import Regime
from spab_core.stability_map import StabilityMap
from spab_core.surrogates import PredictedMap

LAYERS = ("MLE", "Regime", "Contact share", "Largest eccentricity", "Surrogate prediction")
SURROGATE = LAYERS[-1]
_REGIMES = (  # label, colour, whether (regime, period) belongs
    ("periodic-1", "#56B4E9", lambda r, p: (r == "periodic") & (p == 1)),
    ("periodic-2", "#0072B2", lambda r, p: (r == "periodic") & (p == 2)),
    ("periodic-3 and more", "#00334d", lambda r, p: (r == "periodic") & (p > 2)),
    ("quasi-periodic", "#F0E442", lambda r, p: r == "quasi-periodic"),
    ("chaotic", "#D55E00", lambda r, p: r == "chaotic"),
    ("no exponent (run failed)", "#999999", lambda r, p: r == ""),
)
_SMOOTHED = 1.2  # cells: chaos in single cells leaves no island in the border
_HOVER = ("Λ %{x:.3f} (%{customdata[0]:,.0f} rpm), %{y:.2f} kg<br><b>%{text}, MLE %{customdata[1]:+.3f} ± "
          "%{customdata[2]:.3f}</b><br>contact %{customdata[3]:.1f} %, largest eccentricity %{customdata[4]:.3f}")


def _hover(m: StabilityMap, predicted: PredictedMap | None) -> dict:
    """Numbers in binary and short names: a sentence for each of 42,500 cells would be megabytes."""
    rpm = np.repeat(m.design.speed_rpm(1.0) * m.bearing_number, len(m.rotor_mass))
    arrays, template = [m.mle, m.mle_standard_error, 100 * m.contact_share, m.max_eccentricity], _HOVER
    if predicted is not None:
        arrays.append(predicted.mle)
        template += "<br>MLE predicted %{customdata[5]:+.3f}"
    cells = list(zip(*(a.ravel().tolist() for a in (m.regime, m.period, m.status)), strict=True))
    names = {(r, p, s): Regime(r, p).text if r else f"no exponent ({s})" for r, p, s in set(cells)}
    return {"customdata": np.column_stack([rpm, *(a.ravel() for a in arrays)]).astype(np.float32),
            "text": [names[c] for c in cells], "hovertemplate": template + "<extra></extra>"}


def _layer(m: StabilityMap, layer: str, predicted: PredictedMap | None) -> dict:
    """The heatmap's values and colours, apart from those of the regimes."""
    bar = {"thickness": 12, "len": 1.0, "title_side": "right", "xpad": 4}
    if layer == "Contact share":
        return {"z": 100.0 * m.contact_share, "zmin": 0.0, "colorscale": "Cividis",
                "colorbar": {"title": "time in contact, %", **bar}}
    if layer == "Largest eccentricity":
        return {"z": m.max_eccentricity, "zmin": 0.0, "zmax": 1.0, "colorscale": "Cividis",
                "colorbar": {"title": "largest eccentricity over C", **bar}}
    z, title = m.mle, "MLE per revolution (> 0 chaotic)"
    if layer == SURROGATE:
        if predicted is None:
            raise ValueError("the surrogate's layer needs a predicted map")
        z, title = predicted.mle, f"MLE predicted, n/{predicted.divisor}"
    return {"z": z, "zmin": -MLE_LIMIT, "zmax": MLE_LIMIT, "colorscale": "RdBu_r", "colorbar": {"title": title, **bar}}


def _add_layer(figure: go.Figure, m: StabilityMap, layer: str, predicted: PredictedMap | None) -> None:
    if layer == "Regime":
        code, scale = np.full(m.shape, np.nan), []
        for k, (label, colour, belongs) in enumerate(_REGIMES):
            mask = belongs(m.regime, m.period)
            code[mask] = k
            scale += [(k / len(_REGIMES), colour), ((k + 1) / len(_REGIMES), colour)]
            if mask.any():
                figure.add_scatter(x=[None], y=[None], mode="markers", name=label, showlegend=True,
                                   marker={"color": colour, "size": 11, "symbol": "square"})
        shown: dict = {"z": code, "zmin": -0.5, "zmax": len(_REGIMES) - 0.5, "colorscale": scale,
                 "showscale": False}
    else:
        shown = _layer(m, layer, predicted)
    figure.add_heatmap(x=m.bearing_number, y=m.rotor_mass, hoverinfo="skip", **shown | {"z": shown["z"].T.astype(np.float32)})


def _add_line(figure: go.Figure, name: str, x, y, z, level: float, dash: str) -> None:
    """A level of z (x, y) as a black line on a white one, to be seen on every colour; found here, not in the browser."""
    pieces = contour_generator(x, y, z.T).lines(level)
    gap = np.full((1, 2), np.nan)
    path = np.concatenate([part for piece in pieces for part in (piece, gap)] or [gap])
    for line, shown in (({"color": "#ffffff", "width": 4.5}, False), ({"color": "#000000", "width": 2, "dash": dash}, True)):
        figure.add_scatter(x=path[:, 0], y=path[:, 1], mode="lines", line=line, name=name, showlegend=shown,
                           legendgroup=name, hoverinfo="skip")


def map_figure(m: StabilityMap, layer: str = "MLE", predicted: PredictedMap | None = None,
               table: LinearTable | None = None) -> go.Figure:
    """The stability map with the border of chaos and an invisible layer of points that answers clicks.

    Parameters
    ----------
    m : StabilityMap
    layer : str
        One of :data:`LAYERS`.
    predicted : PredictedMap
        Needed for the layer :data:`SURROGATE`.
    table : LinearTable
        Of the map's design: its linear stability threshold is drawn too.

    Returns
    -------
    Figure
        One heatmap; the trace named "cells" has one point a cell, in the order of ``mle.ravel()``. The second horizontal
        axis is the shaft speed.
    """
    figure = go.Figure()
    _add_layer(figure, m, layer, predicted)
    chaos = gaussian_filter((m.regime == "chaotic").astype(float), _SMOOTHED, mode="nearest")
    _add_line(figure, "border of chaos", m.bearing_number, m.rotor_mass, chaos, 0.5, "solid")
    if table is not None:
        _add_line(figure, "linear stability threshold", table.bearing_number, table.rotor_mass,
                  (table.bearing_number[:, None] * table.rate).astype(np.float32), 0.0, "dash")
    b, kg = np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij")
    figure.add_scattergl(
        x=b.ravel().astype(np.float32), y=kg.ravel().astype(np.float32), mode="markers", name="cells", showlegend=False,
        marker={"size": 9, "opacity": 0, "symbol": "x", "line": {"color": "#ffffff", "width": 1.5}}, **_hover(m, predicted),
        selected={"marker": {"opacity": 1, "size": 14, "color": "#000000"}}, unselected={"marker": {"opacity": 0}})
    (x0, x1), y_range = _span(m.bearing_number), _span(m.rotor_mass)
    rpm = m.design.speed_rpm(1.0)
    figure.add_scatter(x=[None], y=[None], xaxis="x2", showlegend=False, hoverinfo="skip")  # an axis is drawn with a trace only
    figure.update_layout(
        xaxis={"title": BEARING_NUMBER_LABEL, "showgrid": False, "zeroline": False, "range": [x0, x1]},
        # both horizontal axes are zoomed together: they lie over each other
        xaxis2={"title": {"text": "Shaft speed, rpm", "standoff": 6}, "overlaying": "x", "side": "top", "tickmode": "auto",
                "showgrid": False, "zeroline": False, "range": [rpm * x0, rpm * x1], "tickformat": ",.0f"},
        yaxis={"title": MASS_LABEL, "showgrid": False, "zeroline": False, "range": y_range},
        uirevision="map", clickmode="event+select", dragmode="zoom", margin={"l": 55, "r": 5, "t": 55, "b": 95}, height=590,
        legend={"orientation": "h", "yref": "container", "y": 0, "yanchor": "bottom", "x": 0, "bgcolor": "#ffffff",
                "font": {"color": "#000000"}, "itemclick": False, "itemdoubleclick": False})
    return figure


def _span(axis: np.ndarray) -> list[float]:
    """From half a cell before the first to half a cell behind the last."""
    half = 0.5 * float(axis[-1] - axis[0]) / max(len(axis) - 1, 1) or 0.5
    return [float(axis[0]) - half, float(axis[-1]) + half]


def mark_point(figure: go.Figure, bearing_number: float, rotor_mass: float) -> go.Figure:
    """Add a cross at an operating point (rotor mass in kg) to a map's figure; returns the figure."""
    cross = {"symbol": "x", "size": 13, "color": "#000000", "line": {"color": "#ffffff", "width": 1.5}}
    return figure.add_scatter(x=[bearing_number], y=[rotor_mass], mode="markers", name="chosen point", showlegend=False,
                              hoverinfo="skip", marker=cross)
