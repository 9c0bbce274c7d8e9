"""How long a point takes, told before it is solved: fits to runs on one core (docs/numerics.md,
``benchmarks/live.py --costs``).
"""

from __future__ import annotations

from spab_core.design.model import reference_design
from spab_core.solver.film import AUTO, MORE_AZIMUTHS, suitable_mesh
from spab_core.trajectory.settings import Settings

# seconds a revolution of some 25 steps of rodas: for each node, and for each inverse or product of
# blocks of N x N in the linear system, over N³; a fourth above the middle of what was measured
_NODE, _BLOCK = 3.2e-6, 1e-9
# seconds a step of dtm for each node; its steps a revolution, limited by diffusion in the film,
# times the bearing number: for the fourth power of the latitudes and the square of the azimuths
_EXPLICIT_NODE = 0.11e-6
_LATITUDES, _AZIMUTHS = 22.0, 1.1


def expected_seconds(settings: Settings, bearing_number: float) -> float:
    """Estimate the seconds that one point takes at most; a run that settles early takes less.

    Parameters
    ----------
    settings : Settings
        The mesh ``auto`` counts as that of the reference design with more azimuths.
    bearing_number : float
        The explicit method's steps shrink with it.
    """
    mesh = settings.mesh
    m, n = suitable_mesh(reference_design(), MORE_AZIMUTHS) if mesh == AUTO else mesh
    if settings.method == "dtm":
        steps = (_LATITUDES * m**4 + _AZIMUTHS * n**2) / bearing_number
        revolution = _EXPLICIT_NODE * m * n * steps
    else:  # inverses, and products for all pairs of latitudes after each
        revolution = _NODE * m * n + _BLOCK * n**3 * (m + m * (m - 1) * (m - 2) / 3)
    return revolution * (settings.transient + settings.revolutions)
