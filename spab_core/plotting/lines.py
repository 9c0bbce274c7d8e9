"""Plotly figures of lines of operating points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.maps.bifurcation import Bifurcation, bands
from spab_core.plotting.bands import add_grade_bands
from spab_core.plotting.theme import (
    BEARING_NUMBER_LABEL,
    CHOSEN,
    GREEN,
    JOURNAL,
    MASS_LABEL,
    NEUTRAL,
    SECTION,
)
from spab_core.trajectory.assessment import GRADE_WORDS, KINDS

COORDINATES = ("X2", "Y2", "X1", "Y1")  # of the journal, of the disc; the columns of Branch.section
SWEEP_COLOURS = {"cold": NEUTRAL, "up": JOURNAL, "down": SECTION}
_LINE_LABELS = {"rotor-mass": MASS_LABEL, "bearing-number": BEARING_NUMBER_LABEL}
_SUBSCRIPT = str.maketrans("12", "₁₂")
_ALL_PANELS: dict[str, Any] = {"xref": "x", "yref": "paper", "y0": 0, "y1": 1}
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
        One trace a sweep and panel; bands of what the first sweep's motions are worth behind them.
        Over bearing numbers a second axis on top has the speed in rpm.
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
    speed, over_speed = line.design.speed_rpm(1.0), line.vary == "bearing-number"
    for name in shown:
        _add_sweep(figure, line, name, coordinates, speed)
    _title_axes(figure, line, coordinates)
    step = float(np.diff(line.values).min()) if len(line.values) > 1 else 0.0
    low, high = float(line.values.min()) - step, float(line.values.max()) + step
    figure.add_hline(y=0, line={"color": NEUTRAL, "dash": "dash", "width": 1}, row=rows, col=1)
    if shown:
        add_grade_bands(figure, line.values, bands(*line.judged(shown[0])))
    if mark is not None and low <= mark <= high:
        _add_mark(figure, mark)
    figure.update_xaxes(range=[low, high])
    if over_speed:
        _rpm_axis(figure, low, high, speed)
    return figure.update_layout(
        height=620,
        showlegend=True,
        margin={"l": 70, "r": 10, "t": 35 + 45 * over_speed, "b": 45},
        legend={
            "orientation": "h",
            "yref": "container",
            "y": 1.0,
            "yanchor": "top",
            "x": 0,
            "itemsizing": "constant",
        },
    )


def _add_sweep(
    figure: go.Figure, line: Bifurcation, name: str, coordinates: Sequence[str], speed: float
) -> None:
    """Add one sweep: its section points in each panel, its exponent in the last.

    ``speed``: in rpm, at the bearing number 1.
    """
    branch, colour, last = line.branches[name], SWEEP_COLOURS[name], len(coordinates) + 1
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
    over_speed = line.vary == "bearing-number"
    where = "Λ %{x:.4g} (%{customdata:,.0f} rpm)" if over_speed else "%{x:.4g} kg"
    figure.add_scatter(
        x=line.values.astype(np.float32),
        y=branch.mle.astype(np.float32),
        mode="lines",
        name=name,
        legendgroup=name,
        showlegend=last == 1,
        line={"color": colour, "width": 1},
        row=last,
        col=1,
        customdata=(speed * line.values).astype(np.float32),
        text=[
            f"{regime}, {GRADE_WORDS[grade]}{kind and ': '}{KINDS.get(kind, '')}"
            for regime, grade, kind in zip(branch.regime, *line.judged(name), strict=True)
        ],
        hovertemplate=f"{where}<br>%{{text}}<br>MLE %{{y:+.3f}}<extra>{name}</extra>",
    )


def _title_axes(figure: go.Figure, line: Bifurcation, coordinates: Sequence[str]) -> None:
    """Name the axes of all panels."""
    last = len(coordinates) + 1
    for row, coordinate in enumerate(coordinates, 1):
        body = "journal" if coordinate.endswith("2") else "disc"
        title = f"{coordinate.translate(_SUBSCRIPT)} / C ({body})"
        figure.update_yaxes(title=title, row=row, col=1)
    figure.update_yaxes(title="MLE<br>per revolution", range=_MLE_ROOM, row=last, col=1)
    figure.update_xaxes(title=_LINE_LABELS[line.vary], row=last, col=1)


def _add_mark(figure: go.Figure, value: float) -> None:
    """Mark the chosen point by a vertical line through all panels."""
    style = {"color": GREEN, "width": 2, "dash": "dot"}
    figure.add_shape(type="line", x0=value, x1=value, line=style, **_ALL_PANELS)
    figure.add_annotation(
        x=value,
        xref="x",
        y=0,
        yref="paper",
        yanchor="bottom",
        xanchor="left",
        text=CHOSEN,
        showarrow=False,
        font={"color": GREEN, "size": 12},
    )


def add_window(figure: go.Figure, start: float, stop: float, label: str) -> go.Figure:
    """Outline an interval of the line, such as another work's chaos, through all panels of a
    :func:`bifurcation_figure`; return the figure.
    """
    figure.add_shape(
        type="rect",
        x0=start,
        x1=stop,
        line={"color": SECTION, "width": 2, "dash": "dash"},
        **_ALL_PANELS,
    )
    before = start - figure.layout.xaxis.range[0] > figure.layout.xaxis.range[1] - stop
    figure.add_annotation(
        x=start if before else stop,  # where more room is
        xref="x",
        y=0,
        yref="paper",
        yanchor="bottom",
        xanchor="right" if before else "left",
        text=label,
        showarrow=False,
        font={"color": SECTION, "size": 12},
    )
    return figure


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
