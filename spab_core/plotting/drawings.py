"""Plotly figures of tolerances and better drawings: shares of the grades, what drives them, the
spread of a number over the machines, the front.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from spab_core.design.tolerances import value_of
from spab_core.drawings.improve import WISHES, Improvement, Wish
from spab_core.drawings.tolerance import ToleranceStudy
from spab_core.plotting.theme import DISC, GRADE_COLOURS, JOURNAL, NEUTRAL, SECTION
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES

_INK = {"good": "#ffffff", "watch": "#1a1a1a", "avoid": "#ffffff"}  # on the grades' colours


def shares_figure(study: ToleranceStudy) -> go.Figure:
    """One bar of the three shares, with the interval of each in its hover text."""
    figure = go.Figure()
    for name, (share, low, high) in study.shares().items():
        told = f"{100 * share:.0f} %" if share >= 0.04 else ""
        figure.add_bar(
            y=[""],
            x=[100 * share],
            orientation="h",
            name=f"{GRADE_WORDS[name]} {100 * share:.1f} % ({100 * low:.0f}–{100 * high:.0f})",
            marker={"color": GRADE_COLOURS[name]},
            text=[told],
            textposition="inside",
            insidetextanchor="middle",
            textfont={"color": _INK[name], "size": 18},
            hovertemplate=f"{GRADE_WORDS[name]}: {100 * share:.1f} % of the machines, "
            f"{100 * low:.1f} to {100 * high:.1f} %<extra></extra>",
        )
    return figure.update_layout(
        barmode="stack",
        height=150,
        margin={"l": 10, "r": 10, "t": 60, "b": 30},
        xaxis={"range": [0, 100], "ticksuffix": " %", "fixedrange": True},
        yaxis={"fixedrange": True, "showticklabels": False},
        legend={"orientation": "h", "y": 1.05, "yanchor": "bottom", "x": 0, "traceorder": "normal"},
    )


def drivers_figure(what: str, table: pd.DataFrame) -> go.Figure:
    """What drives the failures: the total index of each tolerance with its spread, the part that
    acts alone in the bar's strong colour, the largest on top.

    Parameters
    ----------
    what : str
        What is explained, such as "not good".
    table : DataFrame
        Of :func:`spab_core.drawings.drivers.drivers`.
    """
    rows = table.iloc[::-1]
    labels = [value_of(key).label for key in rows["value"]]
    figure = go.Figure()
    for column, name, colour, width in (
        ("total", "with all interactions (total)", DISC, 0.7),
        ("first", "alone (first order)", JOURNAL, 0.36),
    ):
        figure.add_bar(
            y=labels,
            x=rows[column],
            orientation="h",
            width=width,
            name=name,
            marker={"color": colour},
            error_x={
                "type": "data",
                "array": rows[f"{column}_spread"],
                "color": NEUTRAL,
                "thickness": 1.5,
                "visible": column == "total",
            },
            hovertemplate=f"%{{y}}, {name}: %{{x:.2f}}<extra></extra>",
        )
    return figure.update_layout(
        barmode="overlay",
        height=130 + 44 * max(len(labels), 1),
        margin={"l": 10, "r": 10, "t": 50, "b": 45},
        xaxis={"title": f"share of the variance of “{what}”", "range": [0, 1.05]},
        yaxis={"automargin": True},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
    )


def spread_figure(study: ToleranceStudy, column: str) -> go.Figure:
    """The distribution of a number over the machines drawn, stacked by grade, with the drawing's
    own value.

    Parameters
    ----------
    study : ToleranceStudy
    column : str
        ``margin`` or ``least_film``.
    """
    factor, title = (
        (100.0, f"margin up in {study.look.axis}, %")
        if column == "margin"
        else (1e6, "least film, µm")
    )
    values = factor * study.rows[column]
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    size = max((high - low) / 24.0, 1e-9)
    figure = go.Figure()
    for k, name in enumerate(GRADES):
        figure.add_histogram(
            x=values[(study.rows["grade"] == k) & np.isfinite(values)],
            xbins={"start": low, "end": high + size, "size": size},
            name=GRADE_WORDS[name],
            marker={"color": GRADE_COLOURS[name]},
            hovertemplate=f"%{{x}}: %{{y}} machines {GRADE_WORDS[name]}<extra></extra>",
        )
    own = factor * float(study.nominal[column])
    if np.isfinite(own):
        figure.add_vline(
            x=own,
            line={"color": NEUTRAL, "dash": "dash"},
            annotation={"text": "as drawn", "font": {"color": NEUTRAL}, "yanchor": "bottom"},
        )
    return figure.update_layout(
        barmode="stack",
        height=300,
        margin={"l": 10, "r": 10, "t": 50, "b": 45},
        xaxis={"title": title},
        yaxis={"title": "machines"},
        legend={"orientation": "h", "y": 1.05, "yanchor": "bottom", "x": 0},
    )


def front_figure(found: Improvement, chosen: int | None = None) -> go.Figure:
    """The front of two wishes: a point for each drawing, the one to begin with beside it.

    Parameters
    ----------
    found : Improvement
    chosen : int, optional
        The drawing that is looked at.
    """
    first, second = (WISHES[name] for name in found.wishes)

    def title(w: Wish) -> str:
        label = f"{w.label} up in {found.look.axis}" if w.column == "margin" else w.label
        return f"{label}, {w.unit}"

    x, y = (w.factor * found.rows[w.column] for w in (second, first))
    sure = found.confirmed
    figure = go.Figure()
    figure.add_scatter(
        x=x,
        y=y,
        mode="lines",
        line={"color": NEUTRAL, "dash": "dot", "width": 1},
        hoverinfo="skip",
        showlegend=False,
    )
    for mask, name, symbol in (
        (sure, "holds, on a finer mesh too", "circle"),
        (~sure, "does not hold on a finer mesh", "circle-open"),
    ):
        if not mask.any():
            continue
        numbers = np.flatnonzero(mask)
        shares = [
            f"<br>{100 * found.shares[k, 0]:.0f} % good within the tolerances"
            if np.isfinite(found.shares[k, 0])
            else ""
            for k in numbers
        ]
        figure.add_scatter(
            x=x[mask],
            y=y[mask],
            mode="markers",
            name=name,
            marker={
                "color": [GRADE_COLOURS[GRADES[g]] for g in found.rows["grade"][mask]],
                "size": 12,
                "symbol": symbol,
                "line": {"color": NEUTRAL, "width": 1},
            },
            customdata=np.column_stack([numbers, numbers + 1]).tolist(),
            text=shares,
            hovertemplate=f"drawing %{{customdata[1]}}<br>{title(first)}: %{{y:.3g}}<br>"
            f"{title(second)}: %{{x:.3g}}%{{text}}<extra></extra>",
        )
    before = [w.factor * float(found.before[w.column]) for w in (second, first)]
    if np.isfinite(before).all():
        grade = GRADES[found.before["grade"]]
        figure.add_scatter(
            x=[before[0]],
            y=[before[1]],
            mode="markers",
            name=f"as it is ({GRADE_WORDS[grade]})",
            marker={"color": GRADE_COLOURS[grade], "size": 13, "symbol": "x"},
            hovertemplate=f"as it is<br>{title(first)}: %{{y:.3g}}<br>{title(second)}: "
            "%{x:.3g}<extra></extra>",
        )
    if chosen is not None:
        figure.add_scatter(
            x=[x[chosen]],
            y=[y[chosen]],
            mode="markers",
            name="chosen",
            hoverinfo="skip",
            marker={
                "color": "rgba(0,0,0,0)",
                "size": 21,
                "line": {"color": SECTION, "width": 3},
            },
        )
    return figure.update_layout(
        height=380,
        margin={"l": 10, "r": 10, "t": 50, "b": 45},
        xaxis={"title": title(second)},
        yaxis={"title": title(first)},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
    )
