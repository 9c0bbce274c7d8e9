"""The plain pictures of map and orbits (plotting/plain_picture.py) show what the Plotly figures
show, where they show it.
"""

import base64
import io
import re

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from plotly.colors import sample_colorscale, unlabel_rgb

from spab_core.plotting.map import LAYERS, map_figure
from spab_core.plotting.plain_picture import picture_of_map, picture_of_orbits, ticks
from spab_core.surrogates.models import linear_table_of
from tests.maps import map_of, plane, with_hole


def sources(html):
    """Images in their order: cells, lines, cross."""
    return [base64.b64decode(text) for text in re.findall(r"base64,([^\"]+)", html)]


@pytest.fixture(scope="module")
def figure():
    m = with_hole(map_of(plane))
    return map_figure(m, "MLE", None, linear_table_of(m))


def test_cells_have_the_colours_of_the_scale(figure):
    """Each pixel against Plotly's own interpolation of the colour scale; no exponent: no colour."""
    heat = next(t for t in figure.data if t.type == "heatmap")
    z = np.asarray(heat.z, float)
    pixels = np.asarray(Image.open(io.BytesIO(sources(picture_of_map(figure).inside)[0])))[
        ::-1
    ]  # the lowest mass is the last row
    assert pixels.shape == (*z.shape, 4)
    assert np.array_equal(pixels[..., 3] == 0, np.isnan(z)) and np.isnan(z).any()
    for place in np.argwhere(~np.isnan(z))[:40]:
        share = np.clip((z[*place] - heat.zmin) / (heat.zmax - heat.zmin), 0.0, 1.0)
        expected = unlabel_rgb(sample_colorscale("RdBu_r", float(share))[0])
        assert np.allclose(pixels[*place, :3], expected, atol=1.0)


def test_lines_and_cross_stand_where_the_axes_say(figure):
    picture = picture_of_map(figure)
    line = next(
        t for t in figure.data if t.name == "linear stability threshold" and t.line.dash == "dash"
    )
    drawn = re.findall(r'd="([^"]+)"[^>]*dasharray', sources(picture.inside)[1].decode())[0]
    first = [float(v) for v in re.match(r"M(-?\d+) (-?\d+)", drawn).groups()]
    x, y = figure.layout.xaxis.range, figure.layout.yaxis.range
    shares = (line.x[0] - x[0]) / (x[1] - x[0]), (y[1] - line.y[0]) / (y[1] - y[0])
    assert first == pytest.approx([1000 * share for share in shares], abs=0.5)
    assert "--x:100.00%;--y:0.00%" in picture.marked(x[1], y[1])
    assert "--x:50.00%;--y:50.00%" in picture.marked(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))


@pytest.mark.parametrize("layer", LAYERS[:-1])
def test_every_layer_has_a_picture_with_axes_in_units(layer):
    m = map_of(plane)
    html = picture_of_map(map_figure(m, layer)).marked(
        float(m.bearing_number[0]), float(m.rotor_mass[0])
    )
    assert (
        "Bearing number Λ" in html
        and "Rotor mass on one bearing, kg" in html
        and "Shaft speed, rpm" in html
    )
    assert html.count("base64,") == 3 and ("linear-gradient" in html) == (
        layer not in ("Assessment", "Regime")
    )
    assert "border of chaos" in html and ("chaotic</i>" in html) == (
        layer == "Regime"
    )  # the legend
    assert ("not recommended</i>" in html) == (layer == "Assessment")


def test_the_legend_names_no_border_where_there_is_none():
    calm = map_figure(map_of(lambda number, mass: plane(number, mass) - 10.0))
    assert "border of chaos" not in {t.name for t in calm.data}
    assert "border of chaos" in {t.name for t in map_figure(map_of(plane)).data}


@pytest.mark.parametrize(
    ("layer", "ends"), [("Contact share", (0.0, 100.0)), ("Largest eccentricity", (0.5, 1.0))]
)
def test_what_is_worse_is_darker(layer, ends):
    heat = next(t for t in map_figure(map_of(plane), layer).data if t.type == "heatmap")
    assert (heat.zmin, heat.zmax) == ends
    shades = [sum(unlabel_rgb(c)) for c in (c for _, c in heat.colorscale)]
    assert shades == sorted(shades, reverse=True)


def test_orbits_are_drawn_to_scale():
    """A circle of half the clearance, of known points: where each stands in thousandths of the
    axes.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 5)
    figure = go.Figure(
        go.Scatter(
            x=0.5 * np.cos(angle),
            y=0.5 * np.sin(angle),
            mode="lines",
            name="journal",
            line={"color": "#0072B2", "width": 1},
        )
    )
    figure.update_layout(
        title="Orbits",
        height=270,
        margin={"t": 30},
        legend={"y": -0.3},
        xaxis={"title": "X / C", "range": [-1.25, 1.25]},
        yaxis={"title": "Y / C", "range": [-1.25, 1.25]},
    )
    html = picture_of_orbits(figure)
    grid, lines = (text.decode() for text in sources(html))
    assert 'd="M700 500L500 300L300 500L500 700L700 500"' in lines
    assert [float(v) for v in re.findall(r"M([0-9.]+) 0V", grid)] == [
        100,
        300,
        500,
        700,
        900,
    ]  # -1, -0.5, 0, 0.5, 1
    assert all(
        f">{text}</" in html for text in ("Orbits", "journal", "X / C", "Y / C", "−0.5", "0", "1")
    )
    assert "width:154px" in html  # as Plotly's: (270 - 30 - 29) / 1.3 - 8


@given(low=st.floats(-1e6, 1e6), width=st.floats(1e-3, 1e6), most=st.integers(3, 10))
def test_ticks_are_round_numbers_within_the_axis(low, width, most):
    """Multiples of 1, 2 or 5 times a power of ten, none missing and no more than asked for."""
    found, high = ticks(low, low + width, most), low + width
    assert len(found) <= most + 1
    slack = 1e-8 * max(abs(low), width)
    assert np.all((found >= low - slack) & (found <= high + slack))
    if len(found) > 1:
        step = np.diff(found)
        assert np.allclose(step, step[0], rtol=1e-6, atol=slack)
        assert found[0] - step[0] < low + slack and found[-1] + step[0] > high - slack
        lead = float(f"{step[0]:e}".split("e")[0])
        assert min(abs(lead - k) for k in (1, 2, 5, 10)) < 1e-3 or slack > 1e-4 * step[0]
