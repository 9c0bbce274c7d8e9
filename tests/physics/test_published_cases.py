"""Published cases on the film that is shipped; docs/published_cases.md tells them with their
deviations (``python benchmarks/published_cases.py`` prints them).

Sources: H.-J. Butenschön, Das hydrodynamische, zylindrische Gleitlager endlicher Breite unter
instationärer Belastung, dissertation, Karlsruhe 1976; H. G. Elrod and A. Burgdorfer, Proc. 1st
Int. Symp. on Gas-Lubricated Bearings, 1959; J. S. Ausman, J. Basic Eng. 83 (1961) 188; G. B. DuBois
and F. W. Ocvirk, NACA report 1157; openAirBearing 0.2.1 (github.com/Aalto-Arotor/openAirBearing),
whose numbers ``benchmarks/open_air_bearing.py`` computes."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks import published_cases as cases
from spab_core.solver.film import Mesh

OPEN_AIR_BEARING = Path(__file__).parents[2] / "benchmarks" / "open_air_bearing.py"


@pytest.mark.parametrize(
    "case", cases.POROUS, ids=lambda c: f"{1e3 * c.length:g}mm-e{c.eccentricity}"
)
def test_porous_journal_of_open_air_bearing(case):
    """Load of a fed porous cylinder without rotation to 0.02 %, its gas flow to 0.01 %."""
    load, flow = cases.porous(case, Mesh(8, 32))
    assert load == pytest.approx(case.load, rel=2e-4)
    assert flow == pytest.approx(case.flow, rel=1e-4)


@pytest.mark.slow
def test_porous_journal_against_open_air_bearing_itself():
    """openAirBearing run now (three seconds), in the Python that has it (CONTRIBUTING.md); with
    SPAB_REQUIRE_OPENAIRBEARING, as in CI, its absence is a failure.
    """
    python = os.environ.get("SPAB_OPENAIRBEARING_PYTHON")
    if not python:
        missing = (
            "openAirBearing needs Plotly 6 and so a Python of its own: name it in "
            "SPAB_OPENAIRBEARING_PYTHON (benchmarks/open_air_bearing.py)"
        )
        (pytest.fail if os.environ.get("SPAB_REQUIRE_OPENAIRBEARING") else pytest.skip)(missing)
    run = subprocess.run(
        [python, str(OPEN_AIR_BEARING)], capture_output=True, text=True, timeout=300, check=True
    )
    theirs = json.loads(run.stdout)
    for case in cases.POROUS:
        of_length = theirs[f"{case.length:g}"]
        k = cases.ECCENTRICITIES.index(case.eccentricity)
        load, flow = cases.porous(case, Mesh(8, 32))
        assert load == pytest.approx(of_length["load_n"][k], rel=2e-4)
        assert flow == pytest.approx(of_length["flow_l_min"][k], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("case", cases.ROTATING, ids=lambda c: f"{c[0]:.3g}-{c[1]}")
def test_rotating_cylinder_of_butenschoen(case):
    """Sommerfeld number to 0.3 % and angle to 0.15 degrees, as far as five latitudes by 96 azimuths
    see the border where the film breaks.
    """
    ratio, eccentricity, sommerfeld, angle = case
    found = cases.rotating(ratio, eccentricity, Mesh(5, 96))
    assert found[0] == pytest.approx(sommerfeld, rel=3e-3)
    assert found[1] == pytest.approx(angle, abs=0.15)


@pytest.mark.parametrize("case", cases.SQUEEZED, ids=lambda c: f"{c[0]:.3g}-{c[1]}")
def test_squeezed_cylinder_of_butenschoen(case):
    """Sommerfeld number of a pure squeeze to 0.3 %."""
    ratio, eccentricity, sommerfeld = case
    assert cases.squeezed(ratio, eccentricity, Mesh(5, 96)) == pytest.approx(sommerfeld, rel=3e-3)


@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
@pytest.mark.parametrize("eccentricity", [0.3, 0.6, 0.9])
def test_load_at_endless_speed(shape, eccentricity):
    """PH is carried round: the load of Elrod and Burgdorfer, extended to the band, to 0.03 %.

    The rest is the layer at the edges, as 1/√Λ: two speeds give the limit. On 16 latitudes, which
    resolve it."""
    found = cases.endless_speed(shape, eccentricity)
    assert found == pytest.approx(cases.endless_speed_exact(shape, eccentricity), rel=3e-4)


@pytest.mark.parametrize("bearing_number, real, imaginary", cases.AUSMAN)
@pytest.mark.parametrize("whirl", [0.0, 0.2, 1.0])
def test_small_eccentricity_of_ausman(bearing_number, real, imaginary, whirl):
    """Stiffness of the concentric cylinder, L/D 1: printed digits at rest, the formula with a
    whirl, which sees Λ(1 - 2ν).
    """
    exact = cases.ausman(bearing_number * (1.0 - 2.0 * whirl))
    if not whirl:
        assert exact == pytest.approx(complex(real, imaginary), abs=1e-6)
    assert cases.small_eccentricity(bearing_number, whirl, Mesh(12, 8)) == pytest.approx(
        exact, rel=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
def test_narrow_bearing_of_dubois_and_ocvirk(shape):
    """To 0.7 % up to an eccentricity of 0.95 at 1 degree, at 90 degrees to the displacement; of
    second order in the width: half the width, a quarter of what is missing.
    """
    for eccentricity in (0.1, 0.5, 0.9, 0.95):
        load, angle = cases.narrow(shape, eccentricity, 1.0)
        assert load == pytest.approx(1.0, abs=7e-3)
        assert angle == pytest.approx(90.0, abs=0.5)
    missing = [1.0 - cases.narrow(shape, 0.5, width)[0] for width in (2.4, 1.2)]
    assert np.log2(missing[0] / missing[1]) == pytest.approx(2.0, abs=0.02)
