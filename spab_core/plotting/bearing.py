"""Plotly figures of one bearing: its linearised coefficients, and what it carries."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.common.units import to_rpm
from spab_core.linear_theory.coefficients import NAMES, Coefficients
from spab_core.linear_theory.held import LoadCurves
from spab_core.plotting.theme import DISC, JOURNAL, NEUTRAL, SECTION

_LINES = {
    "xx": (JOURNAL, "solid"),
    "yy": ("#56B4E9", "dash"),
    "xy": (SECTION, "solid"),
    "yx": (DISC, "dash"),
}


def coefficient_figure(found: Coefficients, axis: str, mark: float | None = None) -> go.Figure:
    """Stiffness and damping side by side.

    Parameters
    ----------
    found : Coefficients
    axis : str
        ``frequency``: against whirl frequency over shaft speed; ``speed``: against shaft speed in
        rpm.
    mark : float, optional
        Value on that axis where a line is drawn, if it is in range: the rotor's own whirl, or its
        speed.
    """
    x = found.whirl_ratio if axis == "frequency" else to_rpm(found.speed)
    figure = make_subplots(
        1, 2, subplot_titles=("Stiffness k, N/m", "Damping c, N s/m"), horizontal_spacing=0.12
    )
    for name in NAMES:
        colour, dash = _LINES[name[1:]]
        first = name[0] == "k"
        figure.add_scatter(
            x=x,
            y=found.column(name),
            mode="lines",
            name=name[1:],
            legendgroup=name[1:],
            showlegend=first,
            line={"color": colour, "dash": dash, "width": 2},
            row=1,
            col=1 if first else 2,
            hovertemplate=f"{name} %{{y:.4s}}<extra></extra>",
        )
    if mark is not None and x.min() <= mark <= x.max():
        figure.add_vline(x=mark, line={"color": NEUTRAL, "dash": "dot", "width": 1})
    figure.update_xaxes(title="whirl / shaft speed" if axis == "frequency" else "shaft speed, rpm")
    figure.update_yaxes(exponentformat="SI")
    return figure.update_layout(
        height=275,
        margin={"l": 50, "r": 10, "t": 50, "b": 45},
        hovermode="x unified",
        legend={"orientation": "h", "y": 1.12, "yanchor": "bottom", "x": 0},
    )


def load_figure(curves: LoadCurves, rest: tuple[float | None, float] | None = None) -> go.Figure:
    """Force against radial and, of a sphere, axial displacement, side by side.

    Parameters
    ----------
    curves : LoadCurves
    rest : tuple, optional
        Radial eccentricity and axial displacement at rest, where lines are drawn.
    """
    columns = 2 if len(curves.axial) else 1
    titles = ("Radial force, N", "Axial force, N")[:columns]
    figure = make_subplots(1, columns, subplot_titles=titles, horizontal_spacing=0.12)
    parts = (
        (curves.radial, curves.radial_force, "radial eccentricity", JOURNAL),
        (curves.axial, curves.axial_force, "axial displacement over C", SECTION),
    )
    for k, (x, y, title, colour) in enumerate(parts[:columns]):
        figure.add_scatter(
            x=x,
            y=y,
            mode="lines+markers",
            line={"color": colour, "width": 2},
            showlegend=False,
            row=1,
            col=k + 1,
            hovertemplate="%{x:.3f}: %{y:.4s} N<extra></extra>",
        )
        figure.update_xaxes(title=title, row=1, col=k + 1)
        if rest is not None and rest[k] is not None and len(x) and abs(rest[k] or 0.0) <= x[-1]:
            figure.add_vline(
                x=abs(rest[k] or 0.0),
                line={"color": NEUTRAL, "dash": "dot", "width": 1},
                row=1,
                col=k + 1,
            )
    figure.update_yaxes(exponentformat="SI")
    return figure.update_layout(height=275, margin={"l": 50, "r": 10, "t": 50, "b": 45})
