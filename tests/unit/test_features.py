"""The table of linear stability against eigenvalues computed at the points themselves."""

import math

import numpy as np
import pytest

from spab_core.common.errors import InputError
from spab_core.design.model import reference_design
from spab_core.linear_theory import parallel_table
from spab_core.linear_theory.linear_table import (
    COLUMNS,
    FEATURES,
    MESH,
    PLANE,
    LinearFeatures,
    _without_gaps,
    linear_table,
    load_table,
    save_table,
    shipped_table,
    table_for,
)
from spab_core.linear_theory.parallel_table import table_by_rows
from spab_core.linear_theory.whirl import linear_spectrum
from spab_core.shipped.manifest import load_reference_map


@pytest.mark.parametrize(
    "number, mass", [(0.05, 5.0), (0.12, 20.0), (0.7, 9.3), (3.0, 2.1), (8.5, 25.0)]
)
def test_the_shipped_table_is_of_this_solver(number, mass):
    eigenvalues, equilibrium = linear_spectrum(reference_design(), mass, number, MESH)
    rate, frequency, eccentricity = shipped_table().at(np.array([number]), np.array([mass]))[0]
    expected = 2.0 * math.pi * eigenvalues[0].real
    assert rate == pytest.approx(expected, rel=0.03, abs=0.02)  # between nodes: interpolated
    assert frequency == pytest.approx(abs(eigenvalues[0].imag), rel=0.03, abs=0.02)
    assert eccentricity == pytest.approx(equilibrium.eccentricity, rel=0.03)


def test_linear_theory_is_the_exponent_of_a_strongly_damped_rotor():
    """A solved cell of the shipped map where the film is almost rigid: (8.1 kg, bearing number
    0.1).
    """
    m = load_reference_map()
    cell = m.nearest(8.1, 0.1)
    rate = shipped_table().at(
        np.array([m.bearing_number[cell[0]]]), np.array([m.rotor_mass[cell[1]]])
    )[0, 0]
    assert rate < -5.0 and m.mle[cell] == pytest.approx(rate, rel=0.02)


def test_a_table_of_another_design(tmp_path):
    design = reference_design().replace(rotor__shaft_stiffness=2.0e7)
    plane = ((0.5, 2.0), (2.0, 4.0))
    table = linear_table(design, plane, (3, 2))
    eigenvalues, _ = linear_spectrum(design, 4.0, 1.0, MESH)
    # row by row, in any order, it is the same but for the start of each equilibrium's search
    done = []
    rows = table_by_rows(
        design, plane, (3, 2), lambda calls: (f(*a) for f, a, _ in list(calls)[::-1]), done.append
    )
    assert np.allclose(rows.bearing_number, table.bearing_number) and sum(done) == 3
    for name in COLUMNS:
        assert np.allclose(getattr(rows, name), getattr(table, name), rtol=1e-6)
    assert table.rate[1, 1] == pytest.approx(2.0 * math.pi * eigenvalues[0].real, rel=1e-6)
    save_table(table, tmp_path / "t.npz")
    again = load_table((tmp_path / "t.npz").read_bytes())
    assert again.design == design and np.allclose(again.rate, table.rate, rtol=1e-6)
    outside = again.at(np.array([0.01, 1.0]), np.array([4.0, 99.0]))
    assert outside[0] == pytest.approx(
        again.at(np.array([0.5]), np.array([4.0]))[0]
    )  # the nearest point of the table
    assert outside[1] == pytest.approx(again.at(np.array([1.0]), np.array([4.0]))[0])


def test_a_row_without_equilibrium_has_the_values_of_the_nearest(design, monkeypatch):
    def made(own, plane, nodes):
        if plane[0][0] > 1.9:
            raise InputError("no static equilibrium")
        return linear_table(own, plane, nodes)

    def run(calls):
        return (f(*a) for f, a, _ in calls)

    monkeypatch.setattr(parallel_table, "_one_row", made)
    table = table_by_rows(design, ((0.5, 2.0), (2.0, 4.0)), (3, 2), run)
    assert np.array_equal(table.rate[2], table.rate[1]) and np.isfinite(table.rate).all()
    with pytest.raises(InputError, match="no static equilibrium"):
        table_by_rows(design, ((2.0, 3.0), (2.0, 4.0)), (3, 2), run)


def test_the_shipped_table_is_used_where_it_fits(monkeypatch):
    made = []
    monkeypatch.setattr(
        "spab_core.linear_theory.linear_table.linear_table",
        lambda *asked: made.append(asked) or shipped_table(),
    )
    table_for.cache_clear()
    assert table_for(reference_design()) is shipped_table() and not made
    table_for(reference_design(), ((1.0, 12.0), (0.5, 5.0)))
    other = reference_design().replace(rotor__gravity=0.0)
    table_for(other)
    assert made == [(reference_design(), ((0.05, 12.0), (0.1, 25.0))), (other, PLANE)]
    table_for.cache_clear()


def test_nodes_without_equilibrium_take_the_nearest():
    values = np.arange(24.0).reshape(4, 2, 3)
    values[3, 1] = np.nan
    assert _without_gaps(values.copy())[3, 1].tolist() in (
        values[3, 0].tolist(),
        values[2, 1].tolist(),
    )
    with pytest.raises(InputError, match="no static equilibrium"):
        _without_gaps(np.full((2, 2, 3), np.nan))


def test_features_by_name():
    design, points = reference_design(), np.array([[0.3, 4.0], [6.0, 20.0]])
    found = dict(zip(FEATURES, LinearFeatures(shipped_table()).transform(points).T, strict=True))
    assert found["M"] == pytest.approx([design.mass_number(m, b) for b, m in points])
    assert (
        found["rotor mass"].tolist() == [4.0, 20.0] and (found["static eccentricity"] > 0.0).all()
    )
