"""Numbers over the whole allowed ranges: a few of the random designs of benchmarks/honesty.py, which says what is promised.

Source of the conservation law: docs/model.md (the discrete Reynolds equation is in flux form). Halving the step needs none:
the method is of order 4, so that a sixteenth of the tolerance halves the step.
"""

import dataclasses
import importlib.util

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.integrate import DEFAULT_TOLERANCE
from tests.conftest import ROOT

_spec = importlib.util.spec_from_file_location("honesty", ROOT / "benchmarks" / "honesty.py")
honesty = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(honesty)
CASES = (25, 26, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40)  # ok, touchdown and step-too-small among them


@pytest.fixture(scope="module")
def outcomes():
    return {case: honesty.check(case) for case in CASES}


@pytest.mark.parametrize("case", CASES)
def test_a_random_design_keeps_the_promises(outcomes, case):
    assert not outcomes[case][1]


def test_the_cases_are_not_all_of_one_kind(outcomes):
    assert {"ok", "touchdown", "step-too-small"} <= {name for name, _, _ in outcomes.values()}


def test_gas_that_is_lost_would_be_seen(design, monkeypatch):
    """A thousandth of the wall's flow left out of the count is found."""
    point = solve_point(design.replace(bearing__permeability=1e-13, bearing__supply_pressure_ratio=5.0), 4.0, 3.0,
                        honesty.SETTINGS)
    assert honesty.gas_lost(point) < 1e-8
    fluxes = honesty.film_fluxes
    monkeypatch.setattr(honesty, "film_fluxes", lambda *given: (f := fluxes(*given)) | {"wall": f["wall"] * (1.0 - 1e-3)})
    assert honesty.gas_lost(point) > honesty.CONSERVED


def test_a_changed_exponent_would_be_seen(design):
    point = solve_point(design, 4.0, 3.0, honesty.SETTINGS)
    assert not honesty.compare(point, point)
    other = dataclasses.replace(point, mle=dataclasses.replace(point.mle, value=1.1 * point.mle.value - 0.02))
    assert honesty.compare(point, other)


def test_draws_fill_the_ranges():
    drawn = [honesty.draw(seed) for seed in range(200)]
    masses = np.log10([mass for _, mass, _ in drawn])
    assert masses.min() < -2.7 and masses.max() > 2.7
    assert any(d.rigid for d, _, _ in drawn) and any(d.bearing.permeability == 0.0 for d, _, _ in drawn)


@pytest.mark.parametrize("case", [1])
def test_where_the_default_tolerance_is_too_coarse_a_finer_one_is_honest(case):
    """Design 1 bounces on its asperities: chaotic by the default tolerance (docs/reliability.md), not by finer ones."""
    found = [solve_point(*honesty.draw(case), Settings("4x24", transient=300, revolutions=300, tolerance=tolerance))
             for tolerance in (DEFAULT_TOLERANCE / 16.0, DEFAULT_TOLERANCE / 256.0)]
    assert not honesty.compare(*found)
    assert all(abs(p.mle.value) < 4.0 * p.mle.standard_error for p in found)


def test_a_run_cut_short_on_the_wall_looks_chaotic_and_a_longer_one_does_not():
    """Design 47 lies on its asperities and takes more than 80 revolutions to come to rest there (docs/reliability.md)."""
    point = solve_point(*honesty.draw(47), Settings("4x24", transient=200, revolutions=200))
    assert point.regime.name != "chaotic" and abs(point.mle.value) < 0.001
