"""Plain pictures in the places of charts until the browser has Plotly, which takes it two seconds
at a session's first view.

The picture of a map answers clicks by itself. Plotly is sent for when the pointer comes to rest, or
nothing happens for a while: what the user waits for is not held up by it, neither here nor in
another user's browser on the same machine."""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st
from streamlit.components.v2.types import ComponentRenderer

from spab_core.plotting.plain_picture import PlainPicture

_READY = "plotly_wanted"
_LISTENER = """
// ms before Plotly is asked for: after the page has come, after the user's last action
const IDLE = 3000, REST = 1000;
let stop = () => {};
export default function ({ data, setTriggerValue }) {
  stop();  // Streamlit may call again without a word to the one before
  let timer, asked = false, down = [0, 0];
  const ask = after => {
    clearTimeout(timer);
    if (asked) return;  // once, however long the wheel turns
    const now = () => { asked = true; setTriggerValue("plotly", true); };
    if (after) timer = setTimeout(now, after);
    else now();  // a pointer that moves on would put off a timer
  };
  const plot = event => event.target.closest?.(`.st-key-${data.chart}_box .spab-plot`);
  const index = (share, count) =>
    Math.min(Math.floor(Math.max(share, 0) * count), count - 1);
  const cell = (share, [low, high], count) =>
    low + (high - low) * (index(share, count) + 0.5) / count;
  const answers = {
    pointerdown: event => { down = [event.clientX, event.clientY]; },
    pointermove: () => ask(REST),
    keydown: () => ask(REST),
    wheel: event => { if (plot(event)) ask(0); },
    click: event => {
      const place = plot(event);
      if (!place) return;
      const moved = Math.hypot(event.clientX - down[0], event.clientY - down[1]);
      if (moved > 5) return ask(0);  // a drag, to zoom
      const box = place.getBoundingClientRect(), style = place.parentElement.style;
      const x = cell((event.clientX - box.left) / box.width, data.x, data.shape[0]);
      const y = cell((box.bottom - event.clientY) / box.height, data.y, data.shape[1]);
      style.setProperty("--x", `${100 * (x - data.x[0]) / (data.x[1] - data.x[0])}%`);
      style.setProperty("--y", `${100 * (data.y[1] - y) / (data.y[1] - data.y[0])}%`);
      setTriggerValue("cell", [x, y]);
      ask(IDLE);
    },
  };
  for (const [name, answer] of Object.entries(answers))
    document.addEventListener(name, answer, { passive: true });
  document.querySelector(`.st-key-${data.chart}_box`)?.setAttribute("data-answers", "");
  ask(IDLE);
  stop = () => {
    clearTimeout(timer);
    for (const [name, answer] of Object.entries(answers))
      document.removeEventListener(name, answer);
  };
  return stop;
}
"""


@st.cache_resource(show_spinner=False)
def _listener() -> ComponentRenderer:
    return st.components.v2.component("spab_picture", js=_LISTENER)


def plotly_wanted() -> bool:
    """Whether charts are to be sent to this session's browser, or their plain pictures."""
    return bool(st.session_state.get(_READY))


def want_plotly() -> None:
    """From the next run on charts are sent; pages without pictures call it too, since their charts
    bring Plotly.
    """
    st.session_state[_READY] = True


def show_picture(html: str | None, key: str, height: int) -> None:
    """A plain picture in place of a chart until the browser has drawn that; called in the chart's
    container, before the chart.

    Parameters
    ----------
    html : str or None
        Of ``plain_picture``. None keeps its place only, for a chart that is drawn already.
    key : str
        Of the container, which has no gap, that holds this and the chart.
    height : int
        Of both, in pixels.
    """
    place = st.container(key=f"{key}_picture")
    if html:
        place.html(
            f"<style>.st-key-{key}{{position:relative;min-height:{height}px}} "
            f".st-key-{key}>:has(>.st-key-{key}_picture)"
            "{position:absolute;inset:0;z-index:2;pointer-events:none} "
            f".st-key-{key} [data-testid=stSkeleton]{{visibility:hidden}} "
            f".st-key-{key}:has(.heatmaplayer image,.scatterlayer path) "
            f".st-key-{key}_picture{{display:none}}</style>{html}"
        )


def listen_to_picture(
    picture: PlainPicture, key: str, on_click: Callable[[float, float], None]
) -> None:
    """Have the picture of a map answer clicks, as :func:`clicks.clickable` has its chart, and send
    for Plotly in time.

    Parameters
    ----------
    picture : PlainPicture
    key : str
        Of the chart; the picture is in the container ``{key}_box``.
    on_click : callable
        Takes the x and y of the cell's centre.
    """

    def clicked() -> None:
        cell = st.session_state[f"{key}_picture_click"].cell
        if cell:
            on_click(float(cell[0]), float(cell[1]))

    _listener()(
        key=f"{key}_picture_click",
        data={"chart": key, "x": picture.x, "y": picture.y, "shape": picture.shape},
        on_cell_change=clicked,
        on_plotly_change=want_plotly,
    )
