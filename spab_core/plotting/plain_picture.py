"""Figures of a map or of orbits as plain pictures, shown at once: Plotly takes a browser over a
second to draw its own.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from PIL import Image
from plotly.colors import hex_to_rgb, unlabel_rgb

_STYLE = """<style>
.spab-picture{position:relative;display:flex;flex-direction:column;font-size:12px;line-height:1}
.spab-picture :is(i,b){font-style:normal;font-weight:400;white-space:nowrap}
.spab-picture b{font-size:14px}
.spab-plot{flex:1;position:relative;pointer-events:auto;cursor:crosshair;color:rgba(128,132,149,1)}
.spab-plot *{position:absolute;pointer-events:none;user-select:none}
.spab-plot img{inset:0;width:100%;height:100%;max-width:none;image-rendering:pixelated}
.spab-plot .spab-cross{inset:auto;width:20px;height:20px;left:var(--x);top:var(--y);
translate:-50% -50%}
.spab-key{align-self:flex-start;display:flex;flex-wrap:wrap;padding-left:5px}
.spab-key i{display:flex;align-items:center;height:29px;gap:5px;margin-right:7.5px}
.spab-key s{width:30px}
.spab-key s.spab-square{width:11px;height:11px;margin:0 10px}
</style>"""
_GRID = "rgba(128,132,149,0.2)"
_KEY, _PAD = 29, 8  # pixels: height of a row of the legend, Plotly's between a plot and its axes


def _channels(scale: Iterable[tuple[float, str]]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and colours, (n, 3), of a colour scale."""
    colours = [hex_to_rgb(c) if c.startswith("#") else unlabel_rgb(c) for _, c in scale]
    return np.array([p for p, _ in scale], float), np.array(colours, float)


def _limits(trace: go.Heatmap) -> tuple[float, float]:
    """Values at the ends of a heatmap's colours."""
    z = np.asarray(trace.z, float)
    low, high = (
        (np.nanmin(z) if trace.zmin is None else trace.zmin),
        (np.nanmax(z) if trace.zmax is None else trace.zmax),
    )
    return float(low), float(high if high > low else low + 1.0)


def _image(trace: go.Heatmap) -> str:
    """A heatmap's cells as a PNG of one pixel each, in base64."""
    z, (low, high) = np.asarray(trace.z, float)[::-1], _limits(trace)
    place, colours = _channels(trace.colorscale)
    share = np.nan_to_num(np.clip((z - low) / (high - low), 0.0, 1.0))
    rgba = np.stack(
        [np.interp(share, place, c) for c in colours.T] + [np.where(np.isnan(z), 0.0, 255.0)],
        axis=-1,
    )
    file = io.BytesIO()
    Image.fromarray(rgba.round().astype(np.uint8)).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def ticks(low: float, high: float, most: int) -> np.ndarray:
    """Multiples of 1, 2 or 5 times a power of ten within an axis, at most so many and at least half
    as many or so.
    """
    rough = abs(high - low) / most
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= rough)
    ends: np.ndarray = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
    ends *= step
    return ends


def _line(trace: go.Scatter, x_range: Sequence[float], y_range: Sequence[float]) -> str:
    """A line as an SVG path in thousandths of the axes."""
    x = 1000.0 * (np.asarray(trace.x, float) - x_range[0]) / (x_range[1] - x_range[0])
    y = 1000.0 * (y_range[1] - np.asarray(trace.y, float)) / (y_range[1] - y_range[0])
    there = ~(np.isnan(x) | np.isnan(y))
    places = np.rint(np.column_stack([x, y])[there]).astype(int)
    begins = there & ~np.append(False, there[:-1])
    pens = begins[there]
    moves = np.append(True, (np.diff(places, axis=0) != 0).any(axis=1))[: len(places)]
    drawn = pens | moves
    # one formatting of all: a curve has thousands of points
    path = "".join(np.where(pens[drawn], "M%d %d", "L%d %d").tolist())
    path %= tuple(places[drawn].ravel().tolist())
    dash = ' stroke-dasharray="9"' if trace.line.dash == "dash" else ""
    return (
        f'<path d="{path}" fill="none" stroke="{trace.line.color}" '
        f'stroke-width="{trace.line.width}"{dash} '
        'vector-effect="non-scaling-stroke"/>'
    )


def _lines(figure: go.Figure) -> str:
    """All its lines, as an image."""
    x, y = figure.layout.xaxis.range, figure.layout.yaxis.range
    return _svg(
        1000,
        "".join(
            _line(t, x, y)
            for t in figure.data
            if t.type == "scatter" and t.mode == "lines" and t.line.color and len(t.x) > 1
        ),
    )


def _legend(figure: go.Figure, style: str) -> str:
    """Names of traces beside a square or a piece of their lines."""
    told = []
    for t in figure.data:
        if t.type != "scatter" or t.showlegend is False:
            continue
        look = (
            f'class="spab-square" style="background:{t.marker.color}"'
            if t.mode == "markers"
            else f'style="border-top:{t.line.width}px '
            f'{"dashed" if t.line.dash == "dash" else "solid"} {t.line.color}"'
        )
        told.append(f"<i><s {look}></s>{html.escape(t.name)}</i>")
    return f'<div class="spab-key" style="{style}">{"".join(told)}</div>'


def _svg(size: int, paths: str, kind: str = "") -> str:
    """A square SVG as an image: Streamlit drops what is drawn within HTML."""
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size} {size}" '
        f'preserveAspectRatio="none">{paths}</svg>'
    )
    source = base64.b64encode(text.encode()).decode()
    return f'<img alt="" decoding="sync" class="{kind}" src="data:image/svg+xml;base64,{source}">'


def _axes(layout: go.Layout, low: int, left: int) -> str:
    """Numbers and titles of the axes; ``low``, ``left``: pixels from the plot to the titles below
    and beside it.
    """
    told = [
        f'<b style="left:50%;bottom:-{low}px;translate:-50%">'
        f"{html.escape(layout.xaxis.title.text)}</b>",
        f'<b style="left:-{left}px;top:50%;translate:-50% '
        f'-50%;rotate:-90deg">{html.escape(layout.yaxis.title.text)}</b>',
    ]
    axes = [(layout.xaxis, "g", "bottom:-31px")]
    if "xaxis2" in layout:
        told.append(
            '<b style="left:50%;top:-39px;translate:-50%">'
            f"{html.escape(layout.xaxis2.title.text)}</b>"
        )
        axes.append((layout.xaxis2, ",.0f", "top:-20px"))
    for axis, numbers, place in axes:
        a, b = axis.range
        told += [
            f'<i style="left:{100 * (v - a) / (b - a):.2f}%;{place};translate:-50%">'
            f"{_number(v, numbers)}</i>"
            for v in ticks(a, b, 6)
        ]
    a, b = layout.yaxis.range
    told += [
        f'<i style="right:calc(100% + 14px);top:{100 * (b - v) / (b - a):.2f}%;translate:0 '
        f'-50%">{_number(v)}</i>'
        for v in ticks(a, b, 6)
    ]
    return "".join(told)


def _number(value: float, kind: str = "g") -> str:
    return f"{round(value, 9) + 0.0:{kind}}".replace("-", "−")


def _bar(trace: go.Heatmap) -> str:
    """The colour bar."""
    if trace.showscale is False:
        return ""
    place, colours = _channels(trace.colorscale)
    stops = ",".join(
        f"rgb({r:.0f},{g:.0f},{b:.0f}) {100 * p:.1f}%"
        for p, (r, g, b) in zip(place, colours, strict=True)
    )
    low, high = _limits(trace)
    numbers = "".join(
        f'<i style="left:16px;top:{100 * (high - v) / (high - low):.2f}%;translate:0 '
        f'-50%">{_number(v)}</i>'
        for v in ticks(low, high, 6)
    )
    title = html.escape(trace.colorbar.title.text)
    return (
        '<div style="left:calc(100% + '
        f'13px);top:10px;bottom:10px;width:13px;background:linear-gradient(0deg,{stops})">'
        f'{numbers}<b style="left:49px;top:50%;translate:-50% -50%;rotate:-90deg">{title}</b></div>'
    )


@dataclass(frozen=True)
class PlainPicture:
    """The picture without its cross.

    Attributes
    ----------
    inside : str
        HTML.
    height : int
        In pixels.
    x, y : tuple of float
        Ranges of the axes.
    shape : tuple of int
        Cells along x and y, of one size.
    """

    inside: str
    height: int
    x: tuple[float, float]
    y: tuple[float, float]
    shape: tuple[int, int]

    def marked(self, x: float, y: float) -> str:
        """HTML of any width, a ``div`` of the class ``spab-picture`` with its style; a cross at (x,
        y).
        """
        left, top = (
            (x - self.x[0]) / (self.x[1] - self.x[0]),
            (self.y[1] - y) / (self.y[1] - self.y[0]),
        )
        return _picture(self.inside, self.height, f"--x:{100 * left:.2f}%;--y:{100 * top:.2f}%")


def _picture(inside: str, height: int, style: str = "") -> str:
    return (
        f'{_STYLE}<div class="spab-picture" aria-hidden="true" style="height:{height}px;{style}">'
        f"{inside}</div>"
    )


# Margins below are, in pixels, where Plotly puts the axes of these figures.


def picture_of_map(figure: go.Figure) -> PlainPicture:
    """Draw a figure of :func:`spab_core.plotting.map.map_figure`: a heatmap, lines over it, a
    second horizontal axis.
    """
    heat = next(t for t in figure.data if t.type == "heatmap")
    layout = figure.layout
    cross = "".join(
        f'<path d="M5 5L15 15M15 5L5 15" stroke="{colour}" stroke-width="{width}"/>'
        for colour, width in (("#fff", 6), ("#000", 4))
    )
    right = 5 if heat.showscale is False else 80
    inside = (
        f'<div class="spab-plot" style="margin:55px {right}px 67px 67px">'
        f'<img alt="" decoding="sync" src="data:image/png;base64,{_image(heat)}">{_lines(figure)}'
        f"{_svg(20, cross, 'spab-cross')}{_axes(layout, 56, 54)}{_bar(heat)}</div>"
        f"{_legend(figure, 'margin-left:67px')}"
    )
    return PlainPicture(
        inside,
        layout.height,
        tuple(layout.xaxis.range),
        tuple(layout.yaxis.range),
        np.shape(heat.z)[::-1],
    )


def picture_of_orbits(figure: go.Figure) -> str:
    """Draw a figure of :func:`spab_core.plotting.point.orbit_figure`, lines in a square; return
    HTML as :meth:`PlainPicture.marked`.
    """
    layout = figure.layout
    # Plotly keeps a row of the legend free below the plot, and its distance, a share of the plot
    top, share = layout.margin.t, -layout.legend.y
    side = round((layout.height - top - _KEY) / (1.0 + share) - _PAD)
    below = layout.height - top - side - _KEY - 10
    low, high = layout.xaxis.range
    grid = "".join(
        f'<path d="M{at:.0f} 0V1000M0 {at:.0f}H1000" stroke="{_GRID}" '
        'vector-effect="non-scaling-stroke"/>'
        for at in 1000.0 * (ticks(low, high, 6) - low) / (high - low)
    )
    return _picture(
        '<b style="position:absolute;left:4px;top:4px;font-weight:600">'
        f"{html.escape(layout.title.text)}</b>"
        f'<div class="spab-plot" style="margin:{top}px 0 {below}px calc(50% + 20px - '
        f'{side / 2}px);width:{side}px">'
        f"{_svg(1000, grid)}{_lines(figure)}{_axes(layout, 51, 50)}</div>"
        f"{_legend(figure, 'margin:0 0 10px 45px')}",
        layout.height,
    )
