"""Conical motion: exact relations to the first family, whose threshold is known exactly, and the
equations of a tilting rotor themselves.
"""

import math

import numpy as np
import pytest

from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.design.model import design_toml
from spab_core.linear_theory.conical import (
    conical_modes,
    conical_thresholds,
    inertia_numbers,
)
from spab_core.linear_theory.impedance import impedance
from spab_core.linear_theory.summary import derive
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.solver.film import Mesh
from spab_core.trajectory.assessment import assess
from tests.conftest import quiet

NUMBER, SPAN = 8.5, 0.3
MESH = Mesh(4, 8)  # a concentric film has one harmonic
LEVER = 2.0 * (0.5 * SPAN) ** 2
MACHINE = quiet("rigid_balanced").replace(
    rotor__gravity=0.0, rotor__span=SPAN, rotor__transverse_inertia=0.2
)


def critical_mass():
    (threshold,) = whirl_thresholds(MACHINE, NUMBER, MESH)
    assert threshold.whirl_ratio == pytest.approx(0.5, abs=1e-6)
    return threshold.critical_mass


@pytest.mark.parametrize("disc", [0.0, 0.1, 0.4])
def test_threshold_is_that_of_the_mass_in_its_place(disc):
    """I_t - I_p/ν over 2 a² at ν = 1/2 is the critical mass of the first family."""
    machine = MACHINE.replace(rotor__polar_inertia=disc * 0.2)
    (found,) = conical_thresholds(machine, NUMBER, MESH)
    assert found.whirl_ratio == pytest.approx(0.5, abs=1e-5) and found.stable_side == "below"
    assert found.transverse_inertia * (1.0 - 2.0 * disc) == pytest.approx(
        LEVER * critical_mass(), rel=1e-5
    )


@pytest.mark.slow
@pytest.mark.parametrize("disc", [0.0, 0.1])
def test_a_wall_that_stores_gas_lowers_both_families_alike(disc):
    """Pneumatic hammer, above half the speed: I_t - I_p/ν over 2 a² is again the critical mass, now
    at its own ν.
    """
    stored = MACHINE.replace(bearing__porosity=0.15, rotor__polar_inertia=disc * 0.2)
    (threshold,) = whirl_thresholds(stored, NUMBER, MESH)
    (found,) = conical_thresholds(stored, NUMBER, MESH)
    assert found.whirl_ratio == pytest.approx(threshold.whirl_ratio, rel=1e-4)
    assert found.transverse_inertia * (1.0 - disc / found.whirl_ratio) == pytest.approx(
        LEVER * threshold.critical_mass, rel=1e-4
    )
    assert threshold.critical_mass < 0.5 * critical_mass()


@pytest.mark.parametrize("disc", [0.6, 2.0])
def test_a_disc_stiffened_by_its_spin_never_whirls(disc):
    """From I_p = I_t/2 on (I_t - 2 I_p) is negative: no inertia makes half-speed whirl grow."""
    machine = MACHINE.replace(rotor__polar_inertia=disc * 0.2)
    assert conical_thresholds(machine, NUMBER, MESH) == []
    assert derive(machine, 1.0, NUMBER, MESH).conical.stable


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_rates_solve_the_equations_of_the_tilting_rotor(gravity):
    """det(p² J_t + p J_p S + Z(p)) = 0 at every mode, under gravity too; in the middle a circular
    forward whirl feels J_t - J_p/ν.
    """
    machine = MACHINE.replace(rotor__polar_inertia=0.05, rotor__gravity=gravity)
    z = impedance(machine, 8.0, NUMBER, Mesh(4, 16))
    transverse, polar = inertia_numbers(machine, NUMBER)
    spin = polar * np.array([[0.0, 1.0], [-1.0, 0.0]])
    modes = conical_modes(z)[:4]
    assert len(modes) == 4
    for mode in modes:
        p = mode.root
        rotor = p * p * transverse * np.eye(2) + p * spin
        size = abs(np.linalg.det(rotor)) + abs(np.linalg.det(z.at(p)))
        assert abs(np.linalg.det(rotor + z.at(p))) < 1e-8 * size
    forward = next(mode for mode in modes if mode.forward)
    nu = forward.root / 1j  # complex where it decays
    circular = z.at(forward.root)[0] @ np.array([1.0, -1j])
    missing = circular - nu * nu * (transverse - polar / nu)
    assert (abs(missing) < 1e-8 * abs(circular)) == (gravity == 0.0)


def test_without_spin_a_heavy_inertia_has_the_rate_of_its_mass():
    found = derive(MACHINE.replace(rotor__transverse_inertia=LEVER * 5.0), 5.0, NUMBER, MESH)
    assert found.conical.growth == pytest.approx(found.whirl.growth, rel=1e-8)
    assert found.conical.ratio == pytest.approx(found.whirl.ratio, rel=1e-8)


def test_the_less_stable_family_is_in_the_verdict(tmp_path, capsys):
    """A rotor whose mass is safe and whose inertia is not: every verdict says so."""
    mass = 0.5 * critical_mass()
    machine = MACHINE.replace(rotor__transverse_inertia=1.2 * LEVER * critical_mass())
    found = derive(machine, mass, NUMBER, MESH)
    assert found.whirl.stable and not found.conical.stable
    assert found.leading == ("conical whirl", found.conical)
    assert found.verdict().startswith("Unstable at rest: a conical whirl at")
    judged = assess(machine, None, found)
    assert any("unstable at rest: a conical whirl" in reason for reason in judged.reasons)
    keys = found.record()
    assert keys["conical_whirl_growth_per_revolution"] == found.conical.growth > 0.0
    assert keys["conical_whirl_ratio"] == pytest.approx(0.5, abs=0.05)
    assert not any(
        "conical" in k
        for k in derive(MACHINE.replace(rotor__transverse_inertia=0.0), mass, NUMBER, MESH).record()
    )
    path = tmp_path / "machine.toml"
    path.write_text(design_toml(machine))
    point = ["--design", str(path), "--bearing-number", str(NUMBER), "--mesh", "3x16"]
    assert main(["whirl-threshold", *point]) == 0
    assert "conical motion, at rest in the middle: stable below" in capsys.readouterr().out


def test_without_inertias_there_is_no_conical_motion():
    bare = MACHINE.replace(rotor__transverse_inertia=0.0)
    assert conical_modes(impedance(bare, 1.0, NUMBER, MESH)) == []
    with pytest.raises(InputError, match=r"rotor\.transverse_inertia and rotor\.span"):
        conical_thresholds(bare, NUMBER, MESH)
    assert math.isfinite(derive(bare, 1.0, NUMBER, MESH).whirl.growth)
