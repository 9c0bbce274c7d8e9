"""Plotly figures of lines of operating points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.design.model import Design
from spab_core.maps.bifurcation import Bifurcation, chaotic_intervals
from spab_core.plotting.theme import BEARING_NUMBER_LABEL, JOURNAL, MASS_LABEL, NEUTRAL, SECTION

COORDINATES = ("X2", "Y2", "X1", "Y1")  # of the journal, of the disc; the columns of Branch.section
SWEEP_COLOURS = {"cold": NEUTRAL, "up": JOURNAL, "down": SECTION}
_CHAOTIC = "#CC79A7"
_LINE_LABELS = {"rotor-mass": MASS_LABEL, "bearing-number": BEARING_NUMBER_LABEL}
_SUBSCRIPT = str.maketrans("12", "₁₂")
_MLE_ROOM = (-1.0, 0.6)  # per revolution; strongly damped points lie below


def bifurcation_figure(
    line: Bifurcation,
    coordinates: Sequence[str] = ("X2",),
    sweeps: Sequence[str] | None = None,
    mark: float | None = None,
) -> go.Figure:
    """Section points along a line of operating points with the exponent under them on the same
    axis.

    Parameters
    ----------
    line : Bifurcation
    coordinates : sequence of str
        Of :data:`COORDINATES`, a panel each; none: the exponent alone.
    sweeps : sequence of str, optional
        Which to show; left out, all of the line's.
    mark : float, optional
        Value of the line at which a vertical line is drawn.

    Returns
    -------
    Figure
        One trace a sweep and panel; chaotic intervals of the first sweep shaded. Over bearing
        numbers a second axis on top has the speed in rpm.
    """
    shown = [name for name in line.branches if sweeps is None or name in sweeps]
    rows, height = len(coordinates) + 1, 0.32 if len(coordinates) < 2 else 0.24
    figure = make_subplots(
        rows=rows,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.045,
        row_heights=[*[(1 - height) / max(rows - 1, 1)] * (rows - 1), height],
    )
    speed = Design.from_dict(line.metadata["design"]).speed_rpm(1.0)
    over_speed = line.vary == "bearing-number"
    where = "Λ %{x:.4g} (%{customdata:,.0f} rpm)" if over_speed else "%{x:.4g} kg"
    for name in shown:
        branch, colour = line.branches[name], SWEEP_COLOURS[name]
        for row, coordinate in enumerate(coordinates, 1):
            x, y = _points(line.values, branch.section[:, :, COORDINATES.index(coordinate)])
            figure.add_scattergl(
                x=x,
                y=y,
                name=name,
                legendgroup=name,
                showlegend=row == 1,
                mode="markers",
                row=row,
                col=1,
                marker={"color": colour, "size": 2.5 if len(line.values) > 150 else 4},
                hovertemplate="%{x:.4g}: %{y:.4f}<extra></extra>",
            )
        figure.add_scatter(
            x=line.values.astype(np.float32),
            y=branch.mle.astype(np.float32),
            mode="lines",
            name=name,
            legendgroup=name,
            showlegend=rows == 1,
            line={"color": colour, "width": 1},
            row=rows,
            col=1,
            customdata=(speed * line.values).astype(np.float32),
            text=branch.regime,
            hovertemplate=f"{where}<br>%{{text}}, MLE %{{y:+.3f}}<extra>{name}</extra>",
        )
        figure.update_yaxes(title="MLE<br>per revolution", range=_MLE_ROOM, row=rows, col=1)
    step = float(np.diff(line.values).min()) if len(line.values) > 1 else 0.0
    low, high = float(line.values.min()) - step, float(line.values.max()) + step
    figure.add_hline(y=0, line={"color": NEUTRAL, "dash": "dash", "width": 1}, row=rows, col=1)
    shapes = list(figure.layout.shapes)
    for start, stop in (
        chaotic_intervals(line.values, line.branches[shown[0]].regime) if shown else []
    ):
        shapes.append(
            {
                "type": "rect",
                "xref": "x",
                "yref": "paper",
                "x0": start - step / 2,
                "x1": stop + step / 2,
                "y0": 0,
                "y1": 1,
                "fillcolor": _CHAOTIC,
                "opacity": 0.25,
                "line_width": 0,
                "layer": "below",
            }
        )
    if mark is not None and low <= mark <= high:
        shapes.append(
            {
                "type": "line",
                "xref": "x",
                "yref": "paper",
                "x0": mark,
                "x1": mark,
                "y0": 0,
                "y1": 1,
                "line": {"color": "#009E73", "width": 2, "dash": "dot"},
            }
        )
        figure.add_annotation(
            x=mark,
            xref="x",
            y=0,
            yref="paper",
            yanchor="bottom",
            xanchor="left",
            text="chosen point",
            showarrow=False,
            font={"color": "#009E73", "size": 12},
        )
    figure.update_xaxes(range=[low, high])
    figure.update_xaxes(title=_LINE_LABELS[line.vary], row=rows, col=1)
    for row, coordinate in enumerate(coordinates, 1):
        body = "journal" if coordinate.endswith("2") else "disc"
        figure.update_yaxes(
            title=f"{coordinate.translate(_SUBSCRIPT)} / C ({body})", row=row, col=1
        )
    if over_speed:
        _rpm_axis(figure, low, high, speed)
    legend = len(shown) > 1
    return figure.update_layout(
        shapes=shapes,
        height=620,
        showlegend=legend,
        margin={"l": 70, "r": 10, "t": 10 + 45 * over_speed + 25 * legend, "b": 45},
        legend={
            "orientation": "h",
            "yref": "container",
            "y": 1.0,
            "yanchor": "top",
            "x": 0,
            "itemsizing": "constant",
        },
    )


def _points(values: np.ndarray, section: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Section points (n, k) as flat x and y: a periodic orbit repeats its points, once each is
    enough.
    """
    y = np.sort(section, axis=1)  # nan, where a run failed, comes last
    seen = np.round(y, 3)
    kept = np.isfinite(y)
    kept[:, 1:] &= seen[:, 1:] != seen[:, :-1]
    return np.repeat(values.astype(np.float32), y.shape[1])[kept.ravel()], y[kept]


def _rpm_axis(figure: go.Figure, low: float, high: float, speed: float) -> None:
    """A second axis on top, in rpm at round numbers; it follows the first one's zoom."""
    width = (high - low) * speed
    step = 10.0 ** np.floor(np.log10(max(width, 1e-9) / 4))
    step *= next(k for k in (5, 2, 1) if width / (k * step) >= 4)
    ticks = np.arange(np.ceil(low * speed / step), high * speed / step) * step
    ticks = ticks[ticks >= 0]
    figure.add_scatter(
        x=[None], y=[None], xaxis="x99", yaxis="y", showlegend=False, hoverinfo="skip"
    )
    figure.update_layout(
        xaxis99={
            "overlaying": "x",
            "side": "top",
            "matches": "x",
            "tickvals": ticks / speed,
            "ticktext": [f"{rpm:,.0f}" for rpm in ticks],
            "title": {"text": "Speed, rpm", "standoff": 4},
            "showgrid": False,
            "anchor": "y",
        }
    )
