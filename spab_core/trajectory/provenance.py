"""What a result says of how it was made: design, settings, versions, date."""

from __future__ import annotations

import datetime
import platform
from typing import Any

import numpy as np

from spab_core.design.model import Design
from spab_core.solver.cache import solver_hash
from spab_core.solver.film import AUTO, MORE_AZIMUTHS, parse_mesh, suitable_mesh
from spab_core.trajectory.settings import Settings


def film_nodes(metadata: dict[str, Any]) -> str:
    """Say on what mesh a map or line was solved: the one that was asked for, or those that its
    design takes.
    """
    mesh = parse_mesh(metadata["mesh"])
    if mesh != AUTO:
        return f"{mesh} film nodes"
    design = Design.from_dict(metadata["design"])
    more = suitable_mesh(design, MORE_AZIMUTHS)
    return f"{suitable_mesh(design)} film nodes ({more} where the film is thin)"


def map_metadata(design: Design, settings: Settings, shape: tuple[int, ...]) -> dict[str, Any]:
    """Return the metadata of a map or point file: design, settings, units, versions, date."""
    import numba
    import scipy

    from spab_core._version import __version__

    return {
        "design": design.to_dict(),
        **settings.to_dict(),
        "dimensions": ["bearing_number", "rotor_mass"],
        "shape": list(shape),
        "mle_unit": "per revolution, natural logarithm",
        "rotor_mass_unit": "kg on one bearing",
        "versions": {
            "spab": __version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
            "scipy": scipy.__version__,
        },
        "solver": solver_hash(),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
