"""A refinement as one map: solved cells untouched, predicted ones told apart."""

import numpy as np

from spab_core.artifacts import load_reference_map, load_reference_refinement
from spab_core.design import InputError, parse_design, reference_design
from spab_core.presets import PRESETS
from spab_core.quick_map import as_map, check_quick_map, usual_plane
from spab_core.stability_map import FIELDS, load_map, save_map


def test_solved_cells_are_untouched_and_the_whole_is_a_map(tmp_path):
    refined = load_reference_refinement()
    m = as_map(refined)
    for name in FIELDS:
        assert np.array_equal(getattr(m, name)[refined.solved], refined.values[name][refined.solved])
    open_cells = ~refined.solved
    assert np.array_equal(m.regime[open_cells], refined.regime[open_cells]) and not m.revolutions[open_cells].any()
    periodic = m.regime == "periodic"
    assert (m.period[periodic] > 0).all() and not m.period[~periodic].any() and np.isfinite(m.mle).all()
    save_map(m, tmp_path / "filled.npz")  # its checks hold: regime, status and exponent fit together
    assert np.array_equal(load_map(tmp_path / "filled.npz").regime, m.regime)
    assert (m.regime == load_reference_map().regime).mean() > 0.97


def test_the_usual_plane_of_every_preset_is_allowed():
    for design in (reference_design(), *(preset.design for preset in PRESETS.values())):
        number, mass = check_quick_map(*usual_plane(design), 300.0)
        assert number.size * mass.size == 42_500
        load = design.load_number(mass[-1]) / max(design.bearing.supply_pressure_ratio, 1.0)
        assert abs(load - 0.672) < 0.01 or design.rotor.gravity == 0.0


def test_wrong_planes():
    for number, mass, seconds in (("0:1:10", "1:2:10", 60.0), ("1:2:10", "1:2000:10", 60.0), ("1:2:1000", "1:2:1000", 60.0),
                                  ("1:2:10", "1:2:10", 1.0), ("1:2", "1:2:10", 60.0), ("1:2:2", "1:2:2", 60.0)):
        try:
            check_quick_map(number, mass, seconds)
        except InputError as error:
            assert "allowed" in str(error) or "start:stop:count" in str(error)
        else:
            raise AssertionError((number, mass, seconds))


def test_no_gravity_has_a_plane_too():
    design = parse_design("[rotor]\ngravity = 0.0")
    assert check_quick_map(*usual_plane(design), 60.0)[1][-1] > 1.0
