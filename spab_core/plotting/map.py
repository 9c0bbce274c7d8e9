"""The stability map as a Plotly figure: its layers, the border of chaos, the linear threshold, a
layer that answers clicks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import plotly.graph_objects as go
from contourpy import contour_generator
from scipy.ndimage import gaussian_filter

from spab_core.linear_theory.linear_table import LinearTable
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.theme import (
    BEARING_NUMBER_LABEL,
    CHOSEN,
    GRADE_COLOURS,
    MASS_LABEL,
    MLE_LIMIT,
    MORE_IS_WORSE,
    NEUTRAL,
    PERIOD_COLOURS,
    REGIME_COLOURS,
    class_layer,
)
from spab_core.surrogates.models import PredictedMap
from spab_core.trajectory.assessment import GRADE_WORDS
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES, Regime

LAYERS = (
    "Assessment",
    "MLE",
    "Regime",
    "Contact share",
    "Largest eccentricity",
    "Surrogate prediction",
)
SURROGATE = LAYERS[-1]
HEIGHT = 560  # pixels
_SMOOTHED = 1.2  # cells: chaos in single cells leaves no island in the border


def hover(m: StabilityMap, own: str | None) -> dict[str, Any]:
    """Options of a map's heatmap: what stands under the pointer.

    Regime and exponent of the solver, and the template ``own`` of the layer's number z; None where
    z is the exponent."""
    cells = list(zip(*(a.T.ravel().tolist() for a in (m.regime, m.period, m.status)), strict=True))
    names = {
        (r, p, s): Regime(r, p).text if r else f"{NO_EXPONENT} ({s})" for r, p, s in set(cells)
    }
    told: dict[str, Any] = {
        "text": np.array([names[c] for c in cells], object).reshape(m.shape[::-1])
    }
    if own is not None:
        told["customdata"] = m.mle.T.astype(np.float32)
    mle = "%{z:+.3f}" if own is None else f"%{{customdata:+.3f}}{own}"
    return told | {
        "hovertemplate": f"Λ %{{x:.3f}}, %{{y:.2f}} kg<br><b>%{{text}}</b>, MLE "
        f"{mle}<extra></extra>"
    }


def _layer(
    figure: go.Figure, m: StabilityMap, layer: str, predicted: PredictedMap | None
) -> dict[str, Any]:
    """Return values and colours of a layer's heatmap; regimes go into the figure's legend."""
    if layer == "Assessment":
        found = m.grades()
        told = hover(m, "")
        told["text"] = told["text"] + "<br>" + np.vectorize(GRADE_WORDS.get)(found).T
        return told | class_layer(
            figure,
            [(GRADE_WORDS[g], colour, found == g) for g, colour in GRADE_COLOURS.items()],
        )
    if layer == "Regime":
        return hover(m, "") | class_layer(figure, _classes(m))
    bar = {"thickness": 12, "len": 1.0, "title_side": "right", "xpad": 4}
    if layer == "Contact share":
        return hover(m, "<br>contact share %{z:.1f} %") | {
            "z": 100.0 * m.contact_share,
            "zmin": 0.0,
            "zmax": 100.0,
            "colorscale": MORE_IS_WORSE,
            "colorbar": {"title": "contact share, %", **bar},
        }
    if layer == "Largest eccentricity":
        return hover(m, "<br>largest eccentricity %{z:.3f}") | {
            "z": m.max_eccentricity,
            "zmin": 0.5,
            "zmax": 1.0,
            "colorscale": MORE_IS_WORSE,
            "colorbar": {"title": "largest eccentricity over C", **bar},
        }
    z, title, own = m.mle, "MLE per revolution (> 0 chaotic)", None
    if layer == SURROGATE:
        if predicted is None:
            raise ValueError("the surrogate's layer needs a predicted map")
        z, title, own = (
            predicted.mle,
            f"MLE predicted, n/{predicted.divisor}",
            "<br>predicted %{z:+.3f}",
        )
    return hover(m, own) | {
        "z": z,
        "zmin": -MLE_LIMIT,
        "zmax": MLE_LIMIT,
        "colorscale": "RdBu_r",
        "colorbar": {"title": title, **bar},
    }


def _classes(m: StabilityMap) -> Iterator[tuple[str, str, np.ndarray]]:
    """Label, colour and cells of each regime; periodic motion by its period."""
    periodic = m.regime == "periodic"
    periods = (m.period == 1, m.period == 2, m.period > 2)
    labels = ("periodic-1", "periodic-2", "periodic-3 and more")
    for label, colour, mask in zip(labels, PERIOD_COLOURS, periods, strict=True):
        yield label, colour, periodic & mask
    for regime in REGIMES[1:]:
        yield regime, REGIME_COLOURS[regime], m.regime == regime
    yield f"{NO_EXPONENT} (run failed)", REGIME_COLOURS[""], m.regime == ""


def _add_line(
    figure: go.Figure,
    name: str,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    level: float,
    dash: str,
) -> None:
    """A level of z (x, y) as a black line on a white one, to be seen on every colour; found here,
    not in the browser. Where there is none, none is named in the legend.
    """
    pieces = contour_generator(x, y, z.T).lines(level)
    if not pieces:
        return
    gap = np.full((1, 2), np.nan)
    path = np.concatenate([part for piece in pieces for part in (piece, gap)])
    for line, shown, (along, up) in (
        ({"color": "#ffffff", "width": 4.5}, False, path.T),
        ({"color": "#000000", "width": 2, "dash": dash}, False, path.T),
        # in the legend a grey that is seen on a dark page too
        ({"color": NEUTRAL, "width": 2, "dash": dash}, True, ([None], [None])),
    ):
        figure.add_scatter(
            x=along,
            y=up,
            mode="lines",
            line=line,
            name=name,
            showlegend=shown,
            legendgroup=name,
            hoverinfo="skip",
        )


def map_figure(
    m: StabilityMap,
    layer: str = LAYERS[0],
    predicted: PredictedMap | None = None,
    table: LinearTable | None = None,
) -> go.Figure:
    """The stability map with the border of chaos.

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
        One heatmap, whose hover tells a cell; the second horizontal axis is the shaft speed.
    """
    figure = go.Figure()
    shown = _layer(figure, m, layer, predicted)
    figure.add_heatmap(
        x=m.bearing_number, y=m.rotor_mass, **shown | {"z": shown["z"].T.astype(np.float32)}
    )
    chaos = gaussian_filter((m.regime == "chaotic").astype(float), _SMOOTHED, mode="nearest")
    _add_line(figure, "border of chaos", m.bearing_number, m.rotor_mass, chaos, 0.5, "solid")
    if table is not None:
        _add_line(
            figure,
            "linear stability threshold",
            table.bearing_number,
            table.rotor_mass,
            (table.bearing_number[:, None] * table.rate).astype(np.float32),
            0.0,
            "dash",
        )
    (x0, x1), y_range = _span(m.bearing_number), _span(m.rotor_mass)
    rpm = m.design.speed_rpm(1.0)
    figure.add_scatter(
        x=[None], y=[None], xaxis="x2", showlegend=False, hoverinfo="skip"
    )  # an axis is drawn with a trace only
    figure.update_layout(
        xaxis={
            "title": BEARING_NUMBER_LABEL,
            "showgrid": False,
            "zeroline": False,
            "range": [x0, x1],
        },
        # both horizontal axes are zoomed together: they lie over each other
        xaxis2={
            "title": {"text": "Shaft speed, rpm", "standoff": 6},
            "overlaying": "x",
            "side": "top",
            "tickmode": "auto",
            "showgrid": False,
            "zeroline": False,
            "range": [rpm * x0, rpm * x1],
            "tickformat": ",.0f",
        },
        yaxis={"title": MASS_LABEL, "showgrid": False, "zeroline": False, "range": y_range},
        uirevision="map",
        datarevision=1,
        dragmode="zoom",
        margin={"l": 55, "r": 5, "t": 55, "b": 95},
        height=HEIGHT,
        legend={
            "orientation": "h",
            "yref": "container",
            "y": 0,
            "yanchor": "bottom",
            "x": 0,
            "itemclick": False,
            "itemdoubleclick": False,
        },
    )
    return figure


def _span(axis: np.ndarray) -> list[float]:
    """From half a cell before the first to half a cell behind the last."""
    half = 0.5 * float(axis[-1] - axis[0]) / max(len(axis) - 1, 1) or 0.5
    return [float(axis[0]) - half, float(axis[-1]) + half]


def mark_trace(bearing_number: float, rotor_mass: float, **options: Any) -> dict[str, Any]:
    """A cross at an operating point (rotor mass in kg), as a trace's dictionary."""
    return {
        "type": "scatter",
        "x": [bearing_number],
        "y": [rotor_mass],
        "mode": "markers",
        "name": CHOSEN,
        "showlegend": False,
        "hoverinfo": "skip",
        "marker": {
            "symbol": "x",
            "size": 13,
            "color": "#000000",
            "line": {"color": "#ffffff", "width": 1.5},
        },
        **options,
    }
