"""Plotly figures of what-if answers: how a margin moves with the drawing, what a run-up crosses."""

from __future__ import annotations

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from spab_core.maps.sensitivity import MachineMargin
from spab_core.plotting.theme import (
    GREEN,
    JOURNAL,
    NEUTRAL,
    REGIME_COLOURS,
    SECTION,
    add_legend_square,
)
from spab_core.trajectory.regimes import NO_EXPONENT

_UNITS = {"speed": "rpm", "mass": "kg"}


def _colour(regime: str) -> str:
    """Colour of a regime of an interval, where a failed run is ``NO_EXPONENT``."""
    return REGIME_COLOURS["" if regime == NO_EXPONENT else regime]


def tornado_figure(base: MachineMargin, table: pd.DataFrame) -> go.Figure:
    """How the distance to the nearest border moves with each value of the drawing, the largest
    effect on top.

    Parameters
    ----------
    base : MachineMargin
    table : DataFrame
        Of ``maps.sensitivity.sensitivity``.

    Returns
    -------
    Figure
        Bars from the margin of the design as it is, in % of the operating point; negative: the
        point itself is unstable.
    """
    figure = go.Figure()
    names = list(dict.fromkeys(table["value"]))[::-1]
    start = 100.0 * base.distance
    for lower, colour in ((True, JOURNAL), (False, SECTION)):
        rows = table[(table["factor"] < 1.0) == lower].set_index("value").reindex(names)
        factor = rows["factor"].dropna()
        label = f"{100.0 * (factor.iloc[0] - 1.0):+.0f} %" if len(factor) else ""
        reach = 100.0 * rows["distance"].to_numpy()
        figure.add_bar(
            y=names,
            x=reach - start,
            base=start,
            orientation="h",
            name=label,
            marker={"color": colour},
            customdata=np.column_stack([reach, rows["below"], rows["above"]]),
            hovertemplate=f"%{{y}} {label}: margin %{{customdata[0]:.1f}} %<br>borders at "
            f"%{{customdata[1]:,.4r}}"
            f" and %{{customdata[2]:,.4r}} {_UNITS[base.axis]}<extra></extra>",
        )
    figure.add_vline(x=start, line={"color": NEUTRAL, "width": 1})
    figure.add_vline(x=0.0, line={"color": SECTION, "dash": "dash", "width": 1})
    return figure.update_layout(
        barmode="overlay",
        height=120 + 55 * max(len(names), 1),
        margin={"l": 110, "r": 10, "t": 30, "b": 50},
        xaxis={"title": f"margin in {base.axis}, % of the operating point (under 0: unstable)"},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0},
    )


def run_up_figure(
    speed_rpm: np.ndarray, mle: np.ndarray, contact_share: np.ndarray, intervals: pd.DataFrame
) -> go.Figure:
    """A machine's run-up: exponent and time in contact over the speed, regimes as coloured bands.

    Parameters
    ----------
    speed_rpm, mle, contact_share : ndarray, (n,)
        Speed, exponent per revolution (nan where a run failed) and share of the time in contact.
    intervals : DataFrame
        Of ``maps.sensitivity.regime_intervals`` over the speed.
    """
    figure = go.Figure()
    half = 0.5 * float(np.diff(speed_rpm).min()) if len(speed_rpm) > 1 else 0.0
    for regime in dict.fromkeys(intervals["regime"]):
        add_legend_square(figure, regime, _colour(regime))
    for row in intervals.itertuples():
        figure.add_vrect(
            x0=row.start - half,
            x1=row.stop + half,
            fillcolor=_colour(row.regime),
            opacity=0.35,
            line_width=0,
            layer="below",
        )
    figure.add_scatter(
        x=speed_rpm,
        y=mle,
        mode="lines+markers",
        name="MLE",
        line={"color": JOURNAL},
        marker={"size": 4},
    )
    figure.add_scatter(
        x=speed_rpm,
        y=100.0 * contact_share,
        mode="lines",
        name="time in contact",
        yaxis="y2",
        line={"color": GREEN, "dash": "dot"},
    )
    figure.add_hline(y=0.0, line={"color": NEUTRAL, "dash": "dash", "width": 1})
    return figure.update_layout(
        height=360,
        margin={"l": 60, "r": 60, "t": 30, "b": 50},
        xaxis={"title": "Speed, rpm", "showgrid": False},
        yaxis={"title": "MLE per revolution", "range": [-1.0, 0.7]},
        yaxis2={
            "title": "time in contact, %",
            "overlaying": "y",
            "side": "right",
            "range": [0.0, 100.0],
            "showgrid": False,
        },
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0},
    )
