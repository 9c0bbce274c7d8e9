"""A solved margin as a figure: what stands along speed and mass around the operating point."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.maps.solved_margin import SolvedMargin
from spab_core.plotting.theme import CHOSEN, GRADE_COLOURS
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES, KINDS

HEIGHT = 150  # pixels
_TITLES = {"speed": "rpm", "mass": "kg"}


def stretches(found: SolvedMargin, axis: str) -> list[tuple[float, float, str, list[str]]]:
    """Return what stands along a line through the operating point.

    Parameters
    ----------
    found : SolvedMargin
    axis : str
        "speed" or "mass".

    Returns
    -------
    list of (low, high, grade, kinds)
        By rising value, rpm or kg; the grade of what is known to be there, and its kinds of
        trouble. A kind is followed to its first change, and to that of its grade.
    """
    told = []
    for line in found.lines:
        if line.axis != axis or not line.points:
            continue
        kinds, at = dict(found.here), _at(found, axis)
        limits = [x for x in found.limits if (x.axis, x.direction) == (axis, line.direction)]
        for limit in sorted(limits, key=lambda x: abs(x.change)):
            told.append((at, limit.value, dict(kinds)))
            at = limit.value
            if limit.after:
                kinds[limit.what] = limit.after
            else:
                kinds.pop(limit.what, None)
        told.append((at, line.end, dict(kinds)))
    return sorted(
        (min(a, b), max(a, b), max(kinds.values(), key=GRADES.index, default="good"), list(kinds))
        for a, b, kinds in told
    )


def _at(found: SolvedMargin, axis: str) -> float:
    p = found.point
    return p.design.speed_rpm(p.bearing_number) if axis == "speed" else p.rotor_mass


def margin_figure(found: SolvedMargin) -> go.Figure:
    """Draw a bar along speed and one along mass, coloured by what a designer may expect there."""
    figure = make_subplots(2, 1, vertical_spacing=0.42)
    named = set()
    for row, axis in enumerate(_TITLES, 1):
        for low, high, grade, kinds in stretches(found, axis):
            words = ", ".join(KINDS[kind] for kind in kinds) or "no trouble"
            figure.add_bar(
                x=[high - low],
                base=[low],
                y=[_TITLES[axis]],
                orientation="h",
                marker={"color": GRADE_COLOURS[grade], "line_width": 0},
                name=GRADE_WORDS[grade],
                legendgroup=grade,
                legendrank=GRADES.index(grade),
                showlegend=grade not in named,
                hovertemplate=f"{low:,.4g} to {high:,.4g}<br>{words}<extra></extra>",
                row=row,
                col=1,
            )
            named.add(grade)
        figure.add_scatter(
            x=[_at(found, axis)],
            y=[_TITLES[axis]],
            mode="markers",
            marker={
                "symbol": "x",
                "size": 11,
                "color": "#000000",
                "line": {"color": "#ffffff", "width": 1.5},
            },
            name=CHOSEN,
            showlegend=row == 1,
            hovertemplate="this point: %{x:,.5g}<extra></extra>",
            row=row,
            col=1,
        )
        figure.update_xaxes(tickformat=",", row=row, col=1)
    return figure.update_layout(
        height=HEIGHT,
        barmode="overlay",
        bargap=0.1,
        margin={"l": 5, "r": 5, "t": 5, "b": 5},
        legend={"orientation": "h", "y": 1.25, "x": 0, "yanchor": "bottom"},
    )
