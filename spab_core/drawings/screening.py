"""A machine by linear theory alone: predicted motion, grade and margin in a hundredth of a second.

The journal rests at its static equilibrium and answers the unbalance with a small ellipse. With Z
the bearing's dynamic stiffness (:mod:`spab_core.linear_theory.impedance`), M the mass number, m the
journal's share of it, K the shaft's stiffness and p = i nu at nu times the shaft speed, the journal
moves by q,

    (Z(p) + m M p² + K D/(K + D)) q = K F/(K + D)
    D = (1 - m) M p²,   F = (1 - m) M rho nu² (1, -i)

Its largest eccentricity is that of the equilibrium plus the ellipse's half axis. Along the line to
the margin Z is that of the machine's own speed, and a whirl is expected where the shaft turns twice
as fast as the rotor vibrates on its film.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.design.tolerances import Machine
from spab_core.drawings.look import Look, softest
from spab_core.linear_theory.impedance import Impedance, impedance
from spab_core.linear_theory.summary import derive
from spab_core.solver.film import AZIMUTHS, suitable_mesh
from spab_core.trajectory.assessment import AVOID, GRADES, Motion, assess

STEPS = 9  # of the line, equally spaced in the logarithm


def unbalance_response(z: Impedance, speeds: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Return the half axis of the journal's ellipse, over C.

    Parameters
    ----------
    z : Impedance
    speeds, masses : ndarray, (n,)
        Over those of the machine.

    Returns
    -------
    ndarray, (n,)
    """
    d = z.design
    share, rho = d.rotor.journal_mass_fraction, d.unbalance_number
    number = d.mass_number(z.rotor_mass, z.bearing_number) * masses
    p = 1j * speeds
    at, which = np.unique(speeds, return_inverse=True)
    stiffness = np.array([z.at(1j * speed) for speed in at])[which]
    force = (1.0 - share) * number * rho * speeds**2
    if d.rigid:
        inertia, felt = number * p**2, force
    else:
        disc, shaft = (1.0 - share) * number * p**2, d.shaft_stiffness_number
        inertia = share * number * p**2 + disc * shaft / (disc + shaft)
        felt = force * shaft / (disc + shaft)
    left = stiffness + inertia[:, None, None] * np.eye(2)
    q = np.linalg.solve(left, felt[:, None, None] * np.array([[1.0], [-1j]]))[:, :, 0]
    x, y = q[:, 0], q[:, 1]
    return np.asarray(0.5 * (np.abs(x + 1j * y) + np.abs(x - 1j * y)))


@one_thread
def screen(machine: Machine, look: Look) -> dict[str, Any]:
    """Predict a machine by linear theory; nothing of it is solved.

    Parameters
    ----------
    machine : Machine
    look : Look

    Returns
    -------
    dict
        ``grade`` (0 good, 1 to be watched, 2 to be avoided), ``least_film`` (m), ``eccentricity``,
        ``gas_flow`` (normal litres a minute), ``stiffness`` (N/m, static, the softest direction),
        ``margin`` (relative, at most what the line reaches). Without an equilibrium: grade 2, nan.
    """
    nothing = dict.fromkeys(("least_film", "eccentricity", "gas_flow", "stiffness"), np.nan)
    mesh, number = suitable_mesh(machine.design, AZIMUTHS), machine.bearing_number
    try:
        z = impedance(machine.design, machine.rotor_mass, number, mesh)
        if z is None:
            return nothing | {"grade": AVOID, "margin": 0.0}
        rest = derive(machine.design, machine.rotor_mass, number, mesh, z)
    except (InputError, np.linalg.LinAlgError):
        return nothing | {"grade": AVOID, "margin": 0.0}
    if rest.gas_flow is None or rest.coefficients is None:
        return nothing | {"grade": AVOID, "margin": 0.0}
    line = np.geomspace(1.0, look.reach, STEPS)
    one = np.ones_like(line)
    speeds, masses = (one, line) if look.axis == "mass" else (line, one)
    orbit = unbalance_response(z, speeds, masses)
    least, clearance = look.limits.film(machine.design), machine.design.bearing.clearance
    largest = (1.0 - z.equilibrium.gap) * masses + orbit
    allowed = min(look.limits.eccentricity, 1.0 - least / clearance)
    slowest = min((mode.ratio for mode in rest.modes if mode.forward), default=np.inf)
    whirl = 2.0 * slowest * np.sqrt(masses) ** (-1.0 if look.axis == "mass" else 0.0) < speeds
    beyond = np.flatnonzero((largest > allowed) | (whirl & (line > 1.0)))
    e = min(float(largest[0]), 1.0)
    motion = Motion("periodic", 1, "ok", 0.0, e, min(float(orbit[0]), 1.0), 0.0)
    judged = assess(machine.design, motion, rest, look.limits)
    grade = GRADES.index(judged.grade) if look.carries(machine) else AVOID
    reach = float(line[beyond[0] - 1] if len(beyond) and beyond[0] else line[-1])
    return {
        "grade": grade,
        "least_film": clearance * (1.0 - e),
        "eccentricity": e,
        "gas_flow": rest.gas_flow.normal_litres,
        "stiffness": softest(rest.coefficients.stiffness[0]),
        "margin": 0.0 if largest[0] > allowed else reach - 1.0,
    }
