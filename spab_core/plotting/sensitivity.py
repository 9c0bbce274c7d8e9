"""Plotly figures of what-if answers: how a margin moves with the drawing, what a run-up crosses."""

from __future__ import annotations

from typing import Any

import pandas as pd
import plotly.graph_objects as go

from spab_core.maps.bifurcation import Bifurcation, bands
from spab_core.maps.sensitivity import MachineMargin
from spab_core.plotting.bands import add_grade_bands
from spab_core.plotting.theme import JOURNAL, NEUTRAL, PINK, SECTION
from spab_core.trajectory.assessment import GRADE_WORDS, KINDS

_UNITS = {"speed": "rpm", "mass": "kg"}


def _bar_words(row: Any, axis: str) -> str:
    """What a changed design is worth, and what begins or ends on each side."""
    if pd.isna(row.distance):
        return ""
    told = [GRADE_WORDS[row.assessment] + (f": {KINDS[row.why]}" if row.why else "")]
    told += [
        f"{way}: {KINDS[what]} at {value:,.5g} {_UNITS[axis]}"
        for way, value, what in (
            ("below", row.below, row.below_what),
            ("above", row.above, row.above_what),
        )
        if what
    ]
    return "<br>".join(told)


def tornado_figure(base: MachineMargin, table: pd.DataFrame) -> go.Figure:
    """How the distance to what is to be avoided moves with each value of the drawing, the largest
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
        point itself is to be avoided.
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
            text=[_bar_words(row, base.axis) for row in rows.itertuples()],
            textposition="none",
            customdata=reach,
            hovertemplate=f"%{{y}} {label}: margin %{{customdata:.1f}} %<br>%{{text}}"
            "<extra></extra>",
        )
    figure.add_vline(x=start, line={"color": NEUTRAL, "width": 1})
    figure.add_vline(x=0.0, line={"color": SECTION, "dash": "dash", "width": 1})
    return figure.update_layout(
        barmode="overlay",
        height=120 + 55 * max(len(names), 1),
        margin={"l": 110, "r": 10, "t": 30, "b": 50},
        xaxis={"title": f"margin in {base.axis}, % (under 0: not recommended)"},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0},
    )


def run_up_figure(line: Bifurcation, sweep: str = "up") -> go.Figure:
    """A machine's run-up: largest eccentricity and contact share over the speed, before bands of
    what the motion is worth.

    Parameters
    ----------
    line : Bifurcation
        Over bearing numbers.
    sweep : str
        Of the line's branches.
    """
    branch, speed_rpm = line.branches[sweep], line.design.speed_rpm(1.0) * line.values
    figure = go.Figure()
    add_grade_bands(figure, speed_rpm, bands(*line.judged(sweep)))
    figure.add_scatter(
        x=speed_rpm,
        y=branch.max_eccentricity,
        mode="lines+markers",
        name="largest eccentricity",
        line={"color": JOURNAL},
        marker={"size": 4},
        text=[
            f"{regime or status}, {GRADE_WORDS[grade]}{kind and ': '}{KINDS.get(kind, '')}"
            for regime, status, grade, kind in zip(
                branch.regime, branch.status, *line.judged(sweep), strict=True
            )
        ],
        hovertemplate="%{x:,.0f} rpm: %{y:.3f}<br>%{text}<extra></extra>",
    )
    figure.add_scatter(
        x=speed_rpm,
        y=100.0 * branch.contact_share,
        mode="lines",
        name="contact share",
        yaxis="y2",
        line={"color": PINK, "dash": "dot"},
    )
    return figure.update_layout(
        height=360,
        margin={"l": 60, "r": 60, "t": 30, "b": 50},
        xaxis={"title": "Speed, rpm", "showgrid": False},
        yaxis={"title": "largest eccentricity, over C", "range": [0.0, 1.1], "dtick": 0.25},
        yaxis2={
            "title": "contact share, %",
            "overlaying": "y",
            "side": "right",
            "range": [0.0, 110.0],
            "dtick": 25,
            "showgrid": False,
        },
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0},
    )
