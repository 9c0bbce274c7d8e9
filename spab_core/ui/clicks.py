"""Figures whose cells answer clicks: Plotly's own click event on a heatmap, which Streamlit's
selections leave out.

An invisible layer of one WebGL point a cell would do without this listener, but it was half of what
is sent and most of what is drawn, and a browser without WebGL had none."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import plotly.graph_objects as go
import streamlit as st
from streamlit.components.v2.types import ComponentRenderer

from spab_core.plotting.theme import CHOSEN

# Plotly's `plot.on`, `data`, `calcdata` and `_fullLayout` as of plotly.js 3; tests/browser click in
# every such figure.
_LISTENER = """
const timers = {};
export default function ({ data, setTriggerValue }) {
  const find = () => document.querySelector(`.st-key-${data.chart} .js-plotly-plot`);
  // the mark of the figure goes to the cell; Plotly keeps it there at every zoom
  const move = (plot, k, x, y) => {
    const trace = plot._fullData[k], node = plot.querySelector(`.trace${trace.uid} path.point`);
    for (const owner of [plot.data[k], trace]) Object.assign(owner, { x: [x], y: [y] });
    Object.assign(plot.calcdata[k][0], { x, y });
    node?.setAttribute("transform", `translate(${trace._xA.c2p(x)},${trace._yA.c2p(y)})`);
  };
  const marked = plot => plot._fullData.findIndex(trace => trace.name === data.mark);
  const choose = (plot, k, cell) => {
    move(plot, k, ...cell);
    setTriggerValue("cell", cell);
  };
  const clicked = event => {
    const point = event.points.find(
      p => p.fullData.type === "heatmap" && p.xaxis._id === data.axis);
    if (!point || event.event.detail > 1) return;  // of a double click: see below
    const plot = find(), k = marked(plot);
    plot.spabBefore = { at: [plot.data[k].x[0], plot.data[k].y[0]], when: Date.now() };
    choose(plot, k, [point.x, point.y]);
  };
  // a double click asks for the whole map: its first click, just before, did not count. Plotly may
  // leave out a click where the page is busy, but not this
  const doubled = () => {
    const plot = find(), before = plot.spabBefore;
    plot.spabBefore = null;
    if (before && Date.now() - before.when < 1000) choose(plot, marked(plot), before.at);
  };
  const listen = () => {  // another figure is another element
    const plot = find();
    if (!plot?.on || plot.spabClicked === clicked) return;
    if (plot.spabClicked) {
      plot.removeListener("plotly_click", plot.spabClicked);
      plot.removeListener("plotly_doubleclick", plot.spabDoubled);
    }
    [plot.spabClicked, plot.spabDoubled] = [clicked, doubled];
    plot.on("plotly_click", clicked);
    plot.on("plotly_doubleclick", doubled);
  };
  listen();
  clearInterval(timers[data.chart]);  // Streamlit may call again without a word to the one before
  const timer = timers[data.chart] = setInterval(listen, 100);
  return () => clearInterval(timer);
}
"""


@st.cache_resource(show_spinner=False)
def _listener() -> ComponentRenderer:
    return st.components.v2.component("spab_clicks", js=_LISTENER)


def mark_place(key: str, shown: Hashable, point: tuple[float, float]) -> tuple[float, float]:
    """Where a chart's mark is to be drawn: at the point, or where it was drawn if a click has moved
    it to the point since.

    Parameters
    ----------
    key : str
        Of the chart (:func:`clickable`).
    shown : hashable
        What the figure shows besides: where this differs from the last run's, the figure is a new
        one.
    point : tuple
        x and y of the chosen point.
    """
    state = st.session_state
    drawn = state.get(f"{key}_mark")  # (shown, where it was drawn, where it is)
    if drawn and state.pop(f"{key}_moved", False):
        drawn = (*drawn[:2], point)
    opened = f"{key}_click" not in state  # the page, now or again
    if opened or not drawn or (drawn[0], drawn[2]) != (shown, point):
        drawn = (shown, point, point)
    state[f"{key}_mark"] = drawn
    return drawn[1]


def clickable(
    figure: go.Figure,
    key: str,
    on_click: Callable[[float, float], None],
    axis: str = "x",
    **options: Any,
) -> None:
    """Show a figure with a heatmap; a click on one of its cells calls ``on_click`` with the cell's
    x and y before the next run.

    Parameters
    ----------
    figure : Figure
        The browser itself moves the trace named :data:`plotting.theme.CHOSEN` to the clicked cell.
        If the next run sends the same figure, with the mark at :func:`mark_place`, the browser
        keeps its zoom and its mark.
    key : str
        Of the chart.
    on_click : callable
        Takes the x and y of the cell's centre.
    axis : str
        Horizontal axis of the heatmap that answers: "x", "x2", ...
    options
        Of ``st.plotly_chart``.
    """
    st.plotly_chart(figure, key=key, width="stretch", **options)

    def clicked() -> None:
        cell = st.session_state[f"{key}_click"].cell
        if cell:
            on_click(float(cell[0]), float(cell[1]))
            st.session_state[f"{key}_moved"] = True

    _listener()(
        key=f"{key}_click",
        data={"chart": key, "mark": CHOSEN, "axis": axis},
        on_cell_change=clicked,
    )
