"""The shipped bifurcation lines: what they cover, and that their points come out of this solver."""

import numpy as np
import pytest

from spab_core import Settings, reference_design, solve_point
from spab_core.maps.bifurcation import SWEEPS
from spab_core.plotting.lines import bifurcation_figure
from spab_core.shipped.manifest import ARTIFACTS, BIFURCATIONS, load_reference_bifurcation


@pytest.fixture(scope="module", params=BIFURCATIONS)
def line(request):
    return load_reference_bifurcation(request.param)


def test_lines_are_those_of_the_paper(line):
    assert (line.vary, line.at) in {("rotor-mass", 3.45), ("bearing-number", 4.52)}
    assert len(line.values) >= 500 and tuple(line.branches) == SWEEPS
    for branch in line.branches.values():
        assert (branch.status == "ok").mean() > 0.99
        assert np.array_equal(np.isfinite(branch.mle), branch.status == "ok")
        assert np.isfinite(branch.section[branch.status == "ok"]).all()
        assert np.abs(branch.section[..., :2]).max() < 1.0  # the journal stays inside the clearance


def test_lines_are_small():
    assert sum((ARTIFACTS / name).stat().st_size for name in BIFURCATIONS) < 4e6


@pytest.mark.slow
def test_points_of_a_line_come_out_of_this_solver(line):
    cold = line.branches["cold"]
    settled = np.flatnonzero(
        (cold.regime == "periodic") & (cold.mle < -0.05) & (cold.mle_standard_error < 0.005)
    )
    for k in np.random.default_rng(3).choice(settled, 4, replace=False):
        mass, number = (
            (line.values[k], line.at) if line.vary == "rotor-mass" else (line.at, line.values[k])
        )
        point = solve_point(reference_design(), mass, number, Settings(revolutions=300))
        assert (point.regime.name, point.regime.period) == (cold.regime[k], cold.period[k])
        assert point.mle.value == pytest.approx(cold.mle[k], abs=0.01)


@pytest.mark.parametrize("coordinate", ["X2", "Y2", "X1", "Y1"])
def test_diagrams_are_drawn(line, coordinate):
    figure = bifurcation_figure(line, [coordinate])
    sections = [t for t in figure.data if t.type == "scattergl"]
    assert len(sections) == len(SWEEPS) and all(len(t.x) > len(line.values) for t in sections)
    symbol = coordinate.replace("1", "₁").replace("2", "₂")
    assert (
        figure.layout.yaxis.title.text.startswith(f"{symbol} / C")
        and figure.layout.xaxis2.title.text
    )
    assert all(np.isfinite(np.asarray(t.y, float)).all() for t in sections)
