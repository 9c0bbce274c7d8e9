"""Plotly figures of one operating point: orbits, section, exponent, spectrum, signals, film and
forces.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from spab_core.plotting.theme import DISC, GREEN, JOURNAL, NEUTRAL, PINK, SECTION
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.revolution import FORCES, Revolution, Surface, forces, surface
from spab_core.trajectory.spectrum import Spectrum

QUANTITIES = ("Pressure", "Film thickness")  # that may colour the film
FILM_SHARE = 0.25  # of the bearing's radius: what one clearance is drawn as
MAX_ORDER = 4.0
_MAX_SECTION = 400  # points drawn over an orbit
_COLOURS = {"film": JOURNAL, "contact": SECTION, "unbalance": DISC, "gravity": GREEN, "shaft": PINK}
_TITLE = {"font_size": 14}
# of legends: rows grow downwards, away from the title of the axis
_BELOW = {"orientation": "h", "y": -0.17, "yanchor": "top", "x": 0}


def _square(figure: go.Figure, title: str, reach: float = 1.08) -> go.Figure:
    circle = np.linspace(0, 2 * np.pi, 181)
    figure.add_scatter(
        x=np.cos(circle),
        y=np.sin(circle),
        mode="lines",
        name="clearance",
        hoverinfo="skip",
        line={"color": NEUTRAL, "width": 1.5, "dash": "dash"},
    )
    figure.update_layout(
        title={"text": title, **_TITLE},
        xaxis={"title": "X / C", "range": [-reach, reach], "constrain": "domain"},
        yaxis={
            "title": "Y / C",
            "range": [-reach, reach],
            "scaleanchor": "x",
            "constrain": "domain",
        },
        margin={"l": 50, "r": 10, "t": 40, "b": 40},
        height=340,
        legend=_BELOW,
    )
    return figure


def _reach(*paths: np.ndarray) -> float:
    """Half width of a square around the clearance circle and all positions in (n, >= 4) states."""
    return max([1.08, *(1.05 * float(np.abs(p[:, :4]).max()) for p in paths if len(p))])


def orbit_figure(point: OperatingPoint, run_up: np.ndarray | None = None) -> go.Figure:
    """Journal and disc orbits of the last recorded revolutions.

    Parameters
    ----------
    point : OperatingPoint
    run_up : ndarray, (n, 8), optional
        Rotor states of the first revolutions: drawn dimmed under the orbits, and the section points
        over them.
    """
    path = point.trajectory.path.reshape(-1, 8).astype(np.float32)
    figure, early = (
        go.Figure(),
        np.empty((0, 8), np.float32) if run_up is None else run_up.astype(np.float32),
    )
    if len(early):
        dimmed = (
            {"opacity": 0.4, "line": {"color": NEUTRAL, "width": 0.8}}
            if len(path)
            else {"line": {"color": JOURNAL}}
        )
        figure.add_scatter(x=early[:, 0], y=early[:, 1], mode="lines", name="run-up", **dimmed)
    if not point.design.rigid:
        figure.add_scatter(
            x=path[:, 2], y=path[:, 3], mode="lines", name="disc", line={"color": DISC, "width": 1}
        )
    figure.add_scatter(
        x=path[:, 0],
        y=path[:, 1],
        mode="lines",
        name="journal",
        line={"color": JOURNAL, "width": 1},
    )
    if run_up is not None:
        _section(figure, point, 4)
    title = (
        f"Orbits, last {len(point.trajectory.path)} revolutions"
        if len(path)
        else f"Journal: {point.trajectory.status}"
    )
    return _square(figure, title, _reach(path, early))


def orbit_words(point: OperatingPoint) -> str:
    """Return a sentence where the disc is drawn outside the circle of the clearance, else ""."""
    path = point.trajectory.path.reshape(-1, 8)
    if point.design.rigid or not len(path) or np.hypot(path[:, 2], path[:, 3]).max() <= 1.0:
        return ""
    return (
        "The dashed circle is the clearance, which holds the journal alone: the disc rides on the "
        "shaft outside the bearing, and its orbit may be larger."
    )


def exponent_words(point: OperatingPoint) -> str:
    """Return a sentence on what the running exponent is, and that it ends at the final value."""
    if point.mle is None:
        return ""
    if point.trajectory.settled:
        return (
            "The orbit settled: the curve is the rate of its leading Floquet multiplier as "
            "estimated after so many products with the monodromy matrix, and the final value "
            "(dotted) is its end."
        )
    return (
        "The curve is the mean of all revolutions measured so far; the final value (dotted) is its "
        "end, and the band one standard error to each side."
    )


def _section(figure: go.Figure, point: OperatingPoint, size: int) -> None:
    section = point.trajectory.section[-_MAX_SECTION:]
    figure.add_scatter(
        x=section[:, 0],
        y=section[:, 1],
        mode="markers",
        name="at τ = 2πk",
        marker={"color": SECTION, "size": size},
    )


def section_figure(point: OperatingPoint) -> go.Figure:
    """Poincaré section of the journal: one point a revolution."""
    figure = go.Figure()
    _section(figure, point, 5)
    shown = min(len(point.trajectory.section), _MAX_SECTION)
    return _square(figure, f"Poincaré section, {shown} revolutions")


def body_figure(point: OperatingPoint, body: str, run_up: np.ndarray) -> go.Figure:
    """One body's orbit, ``journal`` or ``disc``, its run-up dimmed, its section points marked.

    Parameters
    ----------
    point : OperatingPoint
    body : str
    run_up : ndarray, (n, 8)
    """
    first, colour = (0, JOURNAL) if body == "journal" else (2, DISC)
    path, figure = point.trajectory.path.reshape(-1, 8), go.Figure()
    section = point.trajectory.section[-_MAX_SECTION:]
    marks = {
        "mode": "markers",
        "marker": {"color": JOURNAL if body == "disc" else SECTION, "size": 4},
    }
    for name, states, style in (
        (
            "run-up",
            run_up,
            {"mode": "lines", "opacity": 0.45, "line": {"color": NEUTRAL, "width": 0.8}},
        ),
        (body, path, {"mode": "lines", "line": {"color": colour, "width": 1}}),
        ("at τ = 2πk", section, marks),
    ):
        if len(states):
            figure.add_scatter(
                x=states[:, first].astype(np.float32),
                y=states[:, first + 1].astype(np.float32),
                name=name,
                **style,
            )
    return _square(
        figure,
        f"{body.capitalize()}, last {len(point.trajectory.path)} revolutions",
        _reach(path, run_up),
    ).update_layout(height=460)


def exponent_figure(point: OperatingPoint) -> go.Figure:
    """Running estimate of the exponent with its final standard error."""
    figure = go.Figure()
    if point.mle:
        trace = point.mle.trace
        n = np.arange(1, len(trace) + 1)
        low, high = (
            point.mle.value - point.mle.standard_error,
            point.mle.value + point.mle.standard_error,
        )
        figure.add_hrect(y0=low, y1=high, fillcolor=JOURNAL, opacity=0.15, line_width=0)
        figure.add_hline(y=point.mle.value, line={"color": JOURNAL, "dash": "dot", "width": 1})
        figure.add_scatter(
            x=n,
            y=trace,
            mode="lines",
            line={"color": JOURNAL},
            name="running estimate",
            showlegend=False,
        )
        settled = trace[len(trace) // 10 :]
        span = max(float(np.ptp(settled)), 0.02)
        figure.update_yaxes(
            range=[
                min(settled.min(), low, 0) - 0.3 * span,
                max(settled.max(), high, 0) + 0.3 * span,
            ]
        )
    figure.add_hline(y=0, line={"color": NEUTRAL, "dash": "dash", "width": 1})
    return figure.update_layout(
        title={
            "text": "Running exponent (dotted: final value, band: ± one standard error)",
            "font_size": 14,
        },
        height=340,
        xaxis={
            "title": "products with the monodromy matrix"
            if point.trajectory.settled
            else "revolutions measured"
        },
        yaxis={"title": "MLE per revolution"},
        margin={"l": 60, "r": 10, "t": 40, "b": 40},
    )


def spectrum_figure(
    spectra: dict[str, Spectrum], clearance: float, title: str = "Amplitude spectrum"
) -> go.Figure:
    """Amplitudes in µm over orders of the running speed, the half-speed line marked.

    Parameters
    ----------
    spectra : dict
        By the coordinate's name; amplitudes over C.
    clearance : float
        C in m.
    """
    figure, top = go.Figure(), 0.0
    for (name, s), colour, dash in zip(
        spectra.items(),
        (JOURNAL, SECTION, DISC, GREEN, NEUTRAL),
        ("solid", "dot", "solid", "dot", "solid"),
        strict=False,
    ):
        shown = s.order <= MAX_ORDER
        amplitude = 1e6 * clearance * s.amplitude[shown]
        top = max(top, float(amplitude.max()))
        figure.add_scatter(
            x=s.order[shown].astype(np.float32),
            y=np.maximum(amplitude, 1e-9).astype(np.float32),
            mode="lines",
            name=name,
            line={"color": colour, "width": 1.5, "dash": dash},
            hovertemplate="order %{x:.2f}: %{y:.3g} µm",
        )
    figure.add_vline(
        x=0.5,
        line={"color": NEUTRAL, "dash": "dash", "width": 1.5},
        annotation_text="½ speed",
        annotation_position="top right",
        annotation_font_color=NEUTRAL,
    )
    high = np.log10(max(top, 1e-6)) + 0.3
    return figure.update_layout(
        title={"text": title, **_TITLE},
        height=340,
        margin={"l": 60, "r": 10, "t": 40, "b": 40},
        xaxis={"title": "order of the running speed", "range": [0, MAX_ORDER], "dtick": 0.5},
        yaxis={
            "title": "amplitude, µm",
            "type": "log",
            "range": [high - 4.3, high],
            "exponentformat": "power",
            "dtick": 1,
        },
        legend=_BELOW,
        showlegend=True,
        hovermode="x",
    )


def signals_figure(point: OperatingPoint, revolutions: int = 8) -> go.Figure:
    """X2, Y2, X1, Y1 over the last recorded revolutions, and Z where the journal moves along the
    axis.
    """
    path, along = point.trajectory.path[-revolutions:], point.trajectory.axial_path[-revolutions:]
    count, samples, _ = path.shape
    states, n = (
        path.reshape(-1, 8),
        np.arange(count * samples) / samples + point.trajectory.completed - count,
    )
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for row, first, body, index in ((1, 0, "journal", 2), (2, 2, "disc", 1)):
        for k, (axis, colour) in enumerate((("X", JOURNAL), ("Y", SECTION))):
            figure.add_scatter(
                x=n,
                y=states[:, first + k].astype(np.float32),
                mode="lines",
                name=f"{axis}{'₁₂'[index - 1]}",
                line={"color": colour, "width": 1.5, "dash": "solid" if row == 1 else "dot"},
                row=row,
                col=1,
            )
        figure.update_yaxes(title=f"{body}, / C", row=row, col=1)
    if along.size:
        figure.add_scatter(
            x=n,
            y=along[..., 0].ravel().astype(np.float32),
            mode="lines",
            name="Z",
            line={"color": NEUTRAL, "width": 1.5},
            row=1,
            col=1,
        )
    figure.update_xaxes(title="revolutions since the start", row=2, col=1)
    return figure.update_layout(
        title={"text": f"Positions over the last {count} revolutions", **_TITLE},
        height=465,
        margin={"l": 60, "r": 10, "t": 40, "b": 40},
        hovermode="x",
        legend=_BELOW,
    )


def forces_figure(revolution: Revolution) -> go.Figure:
    """Film, contact, unbalance, gravity and shaft forces over one revolution, in N."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    found = forces(revolution)
    total = np.sum([found[name] for name in FORCES], axis=0)
    for row, axis in ((1, "X"), (2, "Y")):
        common = {
            "x": revolution.angle,
            "mode": "lines",
            "row": row,
            "col": 1,
            "showlegend": row == 1,
        }
        for name, values in found.items():
            if np.isfinite(values).all():
                dash = {"gravity": "dash", "shaft": "dot"}.get(name, "solid")
                figure.add_scatter(
                    y=values[:, row - 1].astype(np.float32),
                    name=name,
                    legendgroup=name,
                    line={"color": _COLOURS[name], "dash": dash, "width": 1.5},
                    **common,
                )
        figure.add_scatter(
            y=total[:, row - 1].astype(np.float32),
            name="sum without shaft = m a",
            legendgroup="sum",
            line={"color": NEUTRAL, "width": 3},
            opacity=0.5,
            **common,
        )
        figure.update_yaxes(title=f"{axis}, N", row=row, col=1)
    figure.update_xaxes(title="shaft angle, degrees", range=[0, 360], dtick=45, row=2, col=1)
    return figure.update_layout(
        title={"text": "Forces over one revolution", **_TITLE},
        height=465,
        hovermode="x",
        margin={"l": 60, "r": 10, "t": 40, "b": 40},
        legend=_BELOW,
    )


def _triangles(around: int, across: int) -> dict[str, np.ndarray]:
    """Corners of the triangles of a regular grid of points, as ``Mesh3d`` takes them."""
    a = (np.arange(around - 1)[:, None] * across + np.arange(across - 1)).ravel()
    b, c, d = a + 1, a + across, a + across + 1
    corners = np.column_stack([a, c, b, b, c, d]).reshape(-1, 3).astype(np.int32)
    return {"i": corners[:, 0], "j": corners[:, 1], "k": corners[:, 2]}


def _wall(film: Surface) -> dict[str, np.ndarray]:
    """The bearing's wall as lines: both edges, the equator, 24 meridians."""
    circle, gap, n = np.linspace(0.0, 2.0 * np.pi, 91), [np.nan], len(film.height)
    azimuth = [np.r_[circle, gap]] * 3 + [
        np.r_[np.full(n, a), gap] for a in np.arange(24) * (np.pi / 12.0)
    ]
    a = np.concatenate(azimuth)
    radius, height = (
        np.concatenate(
            [np.full(92, values[k]) for k in (0, n // 2, -1)] + [np.r_[values, gap]] * 24
        )
        for values in (film.radius, film.height)
    )
    points = (radius * np.cos(a), radius * np.sin(a), height + 0.0 * a)
    return dict(zip("xyz", (p.astype(np.float32) for p in points), strict=True))


def _journal(film: Surface, thickness: np.ndarray, flare: np.ndarray) -> dict[str, np.ndarray]:
    """Points of the journal's surface, flat, a drawn film of (azimuths, latitudes) within the wall;
    ``flare`` is how much of it lies along the axis: the sphere's normal, none on a cylinder.
    """
    cos, sin = np.cos(film.azimuth)[:, None], np.sin(film.azimuth)[:, None]
    inward = FILM_SHARE * thickness
    across, up = film.radius * (1.0 - inward), film.height - flare * inward
    points = np.broadcast_arrays(across * cos, across * sin, up)
    return dict(zip("xyz", (a.ravel().astype(np.float32) for a in points), strict=True))


def film_figure(revolution: Revolution, colour: str = "Pressure") -> go.Figure:
    """The journal's surface within the band over one revolution, 24 frames; the gap is drawn a few
    hundred times wider.

    Parameters
    ----------
    revolution : Revolution
    colour : str
        One of :data:`QUANTITIES`: gauge pressure in kPa or film thickness in µm. The height is the
        film in either case.
    """
    film, d = surface(revolution), revolution.design
    if colour == QUANTITIES[0]:
        values, quantity, unit = (
            1e-3 * d.gas.ambient_pressure * (film.pressure - 1.0),
            "gauge pressure",
            "kPa",
        )
        limit = float(np.abs(values).max())
        scale = {"colorscale": "RdBu_r", "cmin": -limit, "cmax": limit}
    else:
        values, quantity, unit = 1e6 * d.bearing.clearance * film.thickness, "thickness", "µm"
        scale = {"colorscale": "Cividis", "cmin": 0.0, "cmax": float(values.max())}

    flare = np.zeros_like(film.height) if d.bearing.cylindrical else film.height

    def journal(k: int) -> dict[str, np.ndarray]:
        return _journal(film, film.thickness[k], flare) | {
            "intensity": values[k].ravel().astype(np.float32)
        }

    first = go.Mesh3d(
        **journal(0),
        **_triangles(len(film.azimuth), len(film.height)),
        **scale,
        name="journal",
        colorbar={
            "title": f"{quantity}, {unit}",
            "thickness": 12,
            "len": 0.8,
            "x": 1.0,
            "title_side": "right",
        },
        lighting={"ambient": 0.85, "diffuse": 0.3, "specular": 0.05},
        hovertemplate=f"%{{intensity:.3g}} {unit}<extra></extra>",
    )
    names = [f"{angle:.0f}" for angle in film.angle]
    frames = [
        go.Frame(data=[go.Mesh3d(**journal(k))], traces=[0], name=name)
        for k, name in enumerate(names)
    ]
    figure = go.Figure([first, *_wall_and_axes(film)], frames=frames)
    hidden, flat = {"visible": False, "range": [-1.2, 1.2]}, float(film.height.max())
    return figure.update_layout(
        height=380,
        margin={"l": 0, "r": 0, "t": 0, "b": 80},
        uirevision="film",
        scene={
            "xaxis": hidden,
            "yaxis": hidden,
            "zaxis": {"visible": False, "range": [-1.2 * flat, 1.2 * flat]},
            "aspectmode": "manual",
            "aspectratio": {"x": 1.0, "y": 1.0, "z": flat},
            "camera": {"eye": {"x": 0.6, "y": -0.92, "z": 0.8}},
        },
        **_player(names),
    )


def _wall_and_axes(film: Surface) -> list[go.Scatter3d]:
    """The bearing's wall and the names of the directions."""
    return [
        go.Scatter3d(
            **_wall(film),
            mode="lines",
            line={"color": NEUTRAL, "width": 3},
            hoverinfo="skip",
            name="wall",
            showlegend=False,
        ),
        go.Scatter3d(
            x=[1.13, 0.0, 0.0],
            y=[0.0, 1.13, -1.13],
            z=[0.0] * 3,
            mode="text",
            text=["X", "Y", "−Y, gravity"],
            textfont={"color": NEUTRAL, "size": 13},
            hoverinfo="skip",
            name="axes",
            showlegend=False,
        ),
    ]


def _player(names: list[str]) -> dict[str, Any]:
    """Buttons and slider that play the frames of these names."""
    still = {
        "mode": "immediate",
        "transition": {"duration": 0},
        "frame": {"duration": 0, "redraw": True},
    }
    play = still | {"frame": {"duration": 90, "redraw": True}, "fromcurrent": True}
    return {
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.0,
                "y": 0.0,
                "xanchor": "left",
                "yanchor": "top",
                "pad": {"t": 28},
                "showactive": False,
                "bgcolor": "#e0e0e0",
                "font": {"color": "#202020"},
                "buttons": [
                    {"label": "▶ Play", "method": "animate", "args": [None, play]},
                    {"label": "❚❚ Pause", "method": "animate", "args": [[None], still]},
                ],
            }
        ],
        "sliders": [
            {
                "x": 0.3,
                "len": 0.68,
                "y": 0.0,
                "pad": {"t": 5},
                "tickcolor": NEUTRAL,
                "currentvalue": {"prefix": "shaft angle ", "suffix": "°"},
                "steps": [{"label": n, "method": "animate", "args": [[n], still]} for n in names],
            }
        ],
    }
