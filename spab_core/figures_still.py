"""A map's figure as a plain picture, which a browser shows at once: Plotly takes it over a second to draw its own."""

from __future__ import annotations

import base64
import html
import io
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from PIL import Image
from plotly.colors import hex_to_rgb, unlabel_rgb

# pixels from the figure's edges to its axes, as Plotly has them beside a colour bar, and over a legend of two rows instead
_LEFT, _TOP, _RIGHT, _BOTTOM = 67, 55, {True: 80, False: 5}, {True: 96, False: 125}
_STYLE = """<style>
.spab-still{position:relative;font-size:12px;line-height:1;pointer-events:none;color:rgba(128,132,149,1)}
.spab-still *{position:absolute} .spab-still :is(i,b){font-style:normal;font-weight:400;white-space:nowrap}
.spab-still b{font-size:14px} .spab-still img{inset:0;width:100%;height:100%;max-width:none;image-rendering:pixelated}
.spab-still .spab-cross{inset:auto;width:20px;height:20px;left:var(--x);top:var(--y);translate:-50% -50%}
</style>"""


def _channels(scale) -> tuple[np.ndarray, np.ndarray]:
    """Positions and colours, (n, 3), of a colour scale."""
    colours = [hex_to_rgb(c) if c.startswith("#") else unlabel_rgb(c) for _, c in scale]
    return np.array([p for p, _ in scale], float), np.array(colours, float)


def _limits(trace: go.Heatmap) -> tuple[float, float]:
    """Values at the ends of a heatmap's colours."""
    z = np.asarray(trace.z, float)
    return (np.nanmin(z) if trace.zmin is None else trace.zmin), (np.nanmax(z) if trace.zmax is None else trace.zmax)


def _image(trace: go.Heatmap) -> str:
    """A heatmap's cells as a PNG of one pixel each, in base64."""
    z, (low, high) = np.asarray(trace.z, float)[::-1], _limits(trace)
    place, colours = _channels(trace.colorscale)
    share = np.nan_to_num(np.clip((z - low) / ((high - low) or 1.0), 0.0, 1.0))
    rgba = np.stack([np.interp(share, place, c) for c in colours.T] + [np.where(np.isnan(z), 0.0, 255.0)], axis=-1)
    file = io.BytesIO()
    Image.fromarray(rgba.round().astype(np.uint8)).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def ticks(low: float, high: float, most: int) -> np.ndarray:
    """Multiples of 1, 2 or 5 times a power of ten within an axis, at most so many and at least half as many or so."""
    rough = abs(high - low) / most
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= rough)
    return step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)


def _line(trace: go.Scatter, x_range, y_range) -> str:
    """A line as an SVG path in thousandths of the axes."""
    x = 1000.0 * (np.asarray(trace.x, float) - x_range[0]) / (x_range[1] - x_range[0])
    y = 1000.0 * (y_range[1] - np.asarray(trace.y, float)) / (y_range[1] - y_range[0])
    words, pen = [], "M"
    for a, b in zip(x, y, strict=True):
        if np.isnan(a) or np.isnan(b):
            pen = "M"
            continue
        words.append(f"{pen}{a:.0f} {b:.0f}")
        pen = "L"
    dash = ' stroke-dasharray="9"' if trace.line.dash == "dash" else ""
    return (f'<path d="{"".join(words)}" fill="none" stroke="{trace.line.color}" stroke-width="{trace.line.width}"{dash} '
            'vector-effect="non-scaling-stroke"/>')


def _svg(size: int, paths: str, kind: str = "") -> str:
    """A square SVG as an image: Streamlit drops what is drawn within HTML."""
    text = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size} {size}" preserveAspectRatio="none">{paths}</svg>'
    source = base64.b64encode(text.encode()).decode()
    return f'<img alt="" decoding="sync" class="{kind}" src="data:image/svg+xml;base64,{source}">'


def _axes(layout: go.Layout) -> str:
    """Numbers and titles of the axes."""
    told = [f'<b style="left:50%;bottom:-56px;translate:-50%">{html.escape(layout.xaxis.title.text)}</b>',
            f'<b style="left:50%;top:-39px;translate:-50%">{html.escape(layout.xaxis2.title.text)}</b>',
            f'<b style="left:-54px;top:50%;translate:-50% -50%;rotate:-90deg">{html.escape(layout.yaxis.title.text)}</b>']
    for axis, most, numbers, place in ((layout.xaxis, 6, "g", "bottom:-31px"), (layout.xaxis2, 6, ",.0f", "top:-20px")):
        low, high = axis.range
        told += [f'<i style="left:{100 * (v - low) / (high - low):.2f}%;{place};translate:-50%">{v:{numbers}}</i>'
                 for v in ticks(low, high, most)]
    low, high = layout.yaxis.range
    return "".join(told + [f'<i style="right:calc(100% + 14px);top:{100 * (high - v) / (high - low):.2f}%;translate:0 -50%">'
                           f'{v:g}</i>' for v in ticks(low, high, 6)])


def _bar(trace: go.Heatmap) -> str:
    """The colour bar, without its inner numbers."""
    if trace.showscale is False:
        return ""
    place, colours = _channels(trace.colorscale)
    stops = ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f}) {100 * p:.1f}%" for p, (r, g, b) in zip(place, colours, strict=True))
    low, high = _limits(trace)
    numbers = "".join(f'<i style="left:calc(100% + 29px);{at}:9px;translate:0 {by}50%">{v:.3g}</i>'
                      for at, by, v in (("bottom", "", low), ("top", "-", high)))
    title = html.escape(trace.colorbar.title.text)
    return (f'<i style="left:calc(100% + 13px);top:10px;bottom:10px;width:13px;background:linear-gradient(0deg,{stops})"></i>'
            f'{numbers}<b style="left:calc(100% + 62px);top:50%;translate:-50% -50%;rotate:-90deg">{title}</b>')


@dataclass(frozen=True)
class Still:
    """The picture without its cross.

    Attributes
    ----------
    body : str
        HTML.
    x, y : tuple of float
        Ranges of the axes.
    """

    body: str
    x: tuple[float, float]
    y: tuple[float, float]

    def marked(self, x: float, y: float) -> str:
        """HTML of any width, a ``div`` of the class ``spab-still`` with its style; a cross at (x, y)."""
        left, top = ((x - self.x[0]) / (self.x[1] - self.x[0]), (self.y[1] - y) / (self.y[1] - self.y[0]))
        place = f"--x:{100 * left:.2f}%;--y:{100 * top:.2f}%"
        return f'{_STYLE}<div class="spab-still" aria-hidden="true" style="{place}">{self.body}</div>'


def still(figure: go.Figure) -> Still:
    """The picture of a figure of ``figures_map.map_figure``: a heatmap, lines over it, a second horizontal axis."""
    heat = next(t for t in figure.data if t.type == "heatmap")
    layout, x, y = figure.layout, figure.layout.xaxis.range, figure.layout.yaxis.range
    lines = "".join(_line(t, x, y) for t in figure.data if t.type == "scatter" and t.mode == "lines" and t.line.color)
    cross = "".join(f'<path d="M5 5L15 15M15 5L5 15" stroke="{colour}" stroke-width="{width}"/>'
                    for colour, width in (("#fff", 6), ("#000", 4)))
    bar = heat.showscale is not False
    box = f"left:{_LEFT}px;right:{_RIGHT[bar]}px;top:{_TOP}px;height:{layout.height - _TOP - _BOTTOM[bar]}px"
    return Still(f'<div style="{box}"><img alt="" decoding="sync" src="data:image/png;base64,{_image(heat)}">'
                 f'{_svg(1000, lines)}{_svg(20, cross, "spab-cross")}{_axes(layout)}{_bar(heat)}</div>', tuple(x),
                 tuple(y))
