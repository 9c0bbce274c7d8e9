"""Trajectories as they were before (``benchmarks/golden.py --write``).

Numbers of periodic orbits alone: an attracting orbit forgets the last bits, in which processors and
versions of numba differ (without fused multiply-add the values agree to 2e-12, that of a stiff
vibration to 2e-10 of itself). Chaos and tori do not: of those the regime is asserted.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from spab_core import Settings, reference_design, solve_point

VALUES = json.loads(Path(__file__).with_name("golden.json").read_text("utf-8"))


@pytest.mark.parametrize(
    "case", VALUES, ids=lambda c: f"{c['rotor_mass']:.3g}-{c['bearing_number']:.3g}"
)
def test_trajectories_stay_as_they_were(case):
    design = reference_design().replace(**case["design"])
    settings = Settings(**case["settings"])
    point = solve_point(
        design, case["rotor_mass"], case["bearing_number"], settings, path_revolutions=2
    )
    assert point.trajectory.status == case["status"]
    assert (point.regime.text if point.regime else None) == case["regime"]
    if "section" in case:
        assert point.mle.value == pytest.approx(case["exponent"], rel=1e-8, abs=1e-9)
        section = point.trajectory.section[-len(case["section"]) :]
        assert np.abs(section - case["section"]).max() < 1e-9
