"""How long a point takes, told before it is solved: fits to runs on one core (docs/numerics.md,
benchmarks/live.py).
"""

from __future__ import annotations

from spab_core.solver.simd import HALF, WIDTH
from spab_core.trajectory.settings import Settings

# seconds a column, of a revolution and of a step, for up to 4, 8 and 16 latitudes: the width of a
# compiled row
_COLUMN = {"rodas": (15e-6, 55e-6, 250e-6), "dtm": (0.55e-6, 1.7e-6, 6e-6)}
# dtm's steps are limited by diffusion in the film: steps by latitudes and azimuths, and the bearing
# number under which they shrink
_LATITUDE = 8.0
_AZIMUTH = 0.057
_LIMIT = 2.5


def expected_seconds(settings: Settings, bearing_number: float) -> float:
    """Estimate the seconds that one point takes at most; a run that settles early takes less.

    Parameters
    ----------
    settings : Settings
    bearing_number : float
        The explicit method's steps shrink with it.
    """
    m, n = settings.mesh
    seconds = (
        n
        * _COLUMN[settings.method][(m > HALF) + (m > WIDTH)]
        * (settings.transient + settings.revolutions)
    )
    if settings.method == "dtm":
        seconds *= (_LATITUDE * m**3.4 + _AZIMUTH * n**2) * (1.0 + _LIMIT / bearing_number)
    return seconds
