"""Whole operating points of the reference design against an independent code (docs/model.md).

That code used finite volumes with central differences on 6x24, 8x32 and 12x48 half bands, explicit
steps and two trajectories for the exponent; bands cover its three meshes and its sampling. Points
whose motion still changes on those meshes are tested by convergence instead."""

import dataclasses

import pytest

from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

TABLE = [  # kg, Lambda, regime, MLE per revolution, its band, e over 0.9
    (20.0, 2.0, "periodic-1", -0.635, 0.02, False),
    (7.0, 6.0, "periodic-2", -0.452, 0.01, False),
    (10.0, 5.0, "periodic-2", -0.53, 0.03, False),
    (12.0, 8.0, "periodic-4", -0.11, 0.04, True),
    (2.0, 5.0, "quasi-periodic", 0.0, 0.005, False),
    (18.0, 4.5, "chaotic", 0.37, 0.06, True),
    (24.0, 4.0, "chaotic", 0.39, 0.06, True),
    (15.0, 5.0, "chaotic", 0.35, 0.06, True),
]


@pytest.mark.slow
@pytest.mark.parametrize("row", TABLE, ids=lambda r: f"{r[0]}kg-L{r[1]}")
def test_default_settings_give_the_independent_values(design, row):
    mass, bearing_number, regime, mle, band, contact = row
    settings = Settings(revolutions=400)
    if regime == "chaotic":  # 400 revolutions leave a standard error of 0.03, half the band
        settings = dataclasses.replace(settings, revolutions=1600)
    point = solve_point(design, mass, bearing_number, settings)
    assert point.trajectory.status == "ok"
    assert point.regime.text == regime
    assert point.mle.value == pytest.approx(mle, abs=band)
    assert (point.thin_film_share > 0.0) == contact


@pytest.mark.slow
@pytest.mark.parametrize(
    "mass, bearing_number, regime, tolerance",
    [
        (4.52, 1.5, "periodic-1", 0.001),
        (4.52, 3.0, "periodic-2", 0.001),  # a half-speed whirl that locks in
        (15.2, 1.5, "periodic-1", 0.002),
        # they swing through a thin film
        (10.6, 5.6, "periodic-4", 0.02),
        (6.2, 8.25, "periodic-4", 0.02),
    ],
)
def test_the_usual_mesh_has_converged(design, mass, bearing_number, regime, tolerance):
    """Exponents on the mesh that is taken by itself, and on one of twice the azimuths, one latitude
    more and half the step."""
    usual, fine = (
        solve_point(design, mass, bearing_number, settings)
        for settings in (Settings(), Settings("4x32", tolerance=1e-4))
    )
    assert usual.regime.text == fine.regime.text == regime
    assert usual.mle.value == pytest.approx(fine.mle.value, abs=tolerance)


@pytest.mark.parametrize("mass, bearing_number", [(4.1, 2.4), (3.5, 2.65), (17.4, 4.45)])
def test_a_run_too_short_to_tell_is_undecided(design, mass, bearing_number):
    """Two tori, and a chaos, that once were each called the other: fewer than 100 revolutions tell
    nothing, however often they are measured on.
    """
    settings = Settings("3x16", transient=30, revolutions=20)
    assert solve_point(design, mass, bearing_number, settings).regime.name == "undecided"


@pytest.mark.parametrize("mass, bearing_number", [(4.1, 2.4), (3.5, 2.65)])
def test_a_torus_is_chaotic_at_no_length(design, mass, bearing_number):
    """The tangent of a torus grows like the time: over 200 revolutions by 0.011 each at the second
    point, which is over the limit of 0.01.
    """
    for revolutions in (50, 100, 150, 200, 250, 300):
        settings = Settings("3x16", transient=200, revolutions=revolutions)
        assert solve_point(design, mass, bearing_number, settings).regime.name != "chaotic"
    long = solve_point(design, mass, bearing_number, Settings("3x16", revolutions=1200))
    assert long.regime.text == "quasi-periodic" and abs(long.mle.value) < 0.005
