"""Rotors on spherical or cylindrical porous gas bearings: their motion at a rotor mass and bearing
number, and the margin to instability.

Data flows down this table; no package imports from a later one. The docstring of each package lists
its modules.

Package          What it answers
---------------  ---------------------------------------------------------------------------
common           What every other package may use, and what knows nothing of rotors.
design           What is drawn: bearing, gas, rotor and contact.
solver           Film and rotor advanced in time by compiled kernels, with the exact tangent.
linear_theory    Small motions about the static equilibrium.
trajectory       One operating point, from the cold start to its regime.
maps             Many operating points: planes and lines, margins to instability.
surrogates       Models that predict a map from some of its cells.
active_learning  Where to solve next.
drawings         What the tolerances of a drawing mean; better drawings.
shipped          What artifacts/ holds, and which trained models are opened.
jobs             Background jobs: long work in a process of its own, its state on disk.
plotting         Plotly figures from results.
reporting        Results as files for others.
cli              The command ``spab``.
ui               The dashboard's parts: the only package that knows Streamlit.
"""

# ruff: noqa: E402
from spab_core.solver import cache as _cache

_cache.choose()  # before any kernel is imported

from spab_core._version import __version__
from spab_core.common.errors import DesignError, InputError
from spab_core.design.model import Design, load_design, reference_design, save_design
from spab_core.linear_theory.equilibrium import concentric_stiffness, static_equilibrium
from spab_core.linear_theory.whirl import linear_spectrum, whirl_thresholds
from spab_core.maps.bifurcation import (
    Bifurcation,
    chaotic_intervals,
    compute_bifurcation,
    load_bifurcation,
    save_bifurcation,
)
from spab_core.maps.compute import compute_map
from spab_core.maps.solved_margin import SolvedMargin, solve_margin
from spab_core.maps.stability_map import StabilityMap, load_map, save_map
from spab_core.surrogates.samples import Samples, read_samples
from spab_core.trajectory.assessment import Assessment, Limits
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.run import simulate
from spab_core.trajectory.settings import Settings

__all__ = [
    "Assessment",
    "Bifurcation",
    "Design",
    "DesignError",
    "InputError",
    "Limits",
    "OperatingPoint",
    "Samples",
    "Settings",
    "SolvedMargin",
    "StabilityMap",
    "__version__",
    "chaotic_intervals",
    "compute_bifurcation",
    "compute_map",
    "concentric_stiffness",
    "linear_spectrum",
    "load_bifurcation",
    "load_design",
    "load_map",
    "read_samples",
    "reference_design",
    "save_bifurcation",
    "save_design",
    "save_map",
    "simulate",
    "solve_margin",
    "solve_point",
    "static_equilibrium",
    "whirl_thresholds",
]
