"""Rotors on spherical porous gas bearings: what they do at a rotor mass and bearing number, and how far trouble is.

Module          What it answers
--------------  ------------------------------------------------------------------------------------------------
design          What is drawn: bearing, gas, rotor, contact in SI units; TOML files; dimensionless groups
presets         Designs to start from
film            The film mesh and the discretised Reynolds equation, readable
rotor           Disc, journal, shaft and contact, readable
_kernel_cache   Where compiled kernels are kept, one folder for each state of the sources
simd, kernels   The same equations compiled, eight latitudes to a register; their tangent and curvature
linear          The linear system of an implicit step, solved exactly by blocks
dtm             The paper's scheme: differential transformation in time
integrate       Steps, step control, tangent; any system by ``bind``
simulate        One trajectory from the cold start -> Trajectory
floquet         When a run has settled on a periodic orbit: its leading multiplier
lyapunov        Growth of the tangent -> Exponent
regimes         Section and exponent -> Regime
point           The three together at one operating point -> OperatingPoint
revolution      One revolution in full: film thickness, pressure and forces, and the run-up that led there
spectrum        Amplitudes over orders of the running speed
cost            How long a point takes, told before it is solved
stability       Static equilibrium, stiffness, linear whirl threshold
coefficients    The bearing's eight linearised coefficients, against whirl frequency and speed; as a table, as ROSS reads it
form            The design in the units of a drawing; balance grades; the bearing number from rpm
derived         What a design means at an operating point: equilibrium, gas flow, stiffness, damping, whirl
npz             NPZ files: written the same to the byte, read with care
stability_map   A plane of operating points -> StabilityMap; save, load, check
compiling       Has the kernels compiled before they are wanted, by one process at a time
map_engine      Computes maps: chunks, resume, processes or a Dask cluster
bifurcation     A line of operating points, swept cold, up and down -> Bifurcation
features        What linear theory knows of a point of the plane -> LinearTable, tabulated and interpolated
margin          How far a point of a map is from instability and chaos; where linear theory sees another border
theory_models   Regressors that start from linear theory
surrogates      Models that predict a map from some of its cells: the paper's, interpolation, better ones
classifier      Regimes from the labels of some cells, or from predicted exponents
uncertainty     Conformal intervals, probability of instability and its reliability
evaluation      How well they do: the paper's metrics, tables and ranking
what_if         What a changed drawing does to the margin; what a run-up crosses
foreign         Exponents from elsewhere, read from CSV, to train and rank surrogates on
committee       What the solved cells of a plane say of all others -> Prediction; how well on a solved map
oracles         Values of picked cells: out of a solved map, or solved live with resume
refine          Where to solve next: cells worth solving -> Refinement
quick_map       A map of one's own bearing in minutes
artifacts       What is shipped, with checksums
learning_curve  What refining saves: errors over the number of solved cells, chosen and drawn at random
private_folder  Folders of this user alone
model_cache     Where models trained on this machine are kept
pretrained      Trained models and predicted maps: shipped, kept, or trained now; checked before they are opened
release         Everything shipped that is computed from the map: rebuilt to the bit, verified
point_file      A solved operating point as a file
job_kinds       What a background job can be
jobs            Long work in a worker process, its state on disk: queued, running, cancelled, failed, done
figures         Plotly figures from results; of lines in figures_lines, of coefficients in figures_bearing
figures_surrogates  Those of surrogates, of refining and of the map's audit
figures_point   Those of one operating point
ui              The only part that knows Streamlit
report          Design, points, figures, versions and command lines in one HTML file or PDF
export          Results as files for others: figures as HTML and PNG, maps as NetCDF and CSV
cli             The command ``spab``
"""

# ruff: noqa: E402
from spab_core import _kernel_cache

_kernel_cache.choose()  # before any kernel is imported

from spab_core._version import __version__
from spab_core.bifurcation import (
    Bifurcation,
    chaotic_intervals,
    compute_bifurcation,
    load_bifurcation,
    save_bifurcation,
)
from spab_core.design import Design, DesignError, InputError, load_design, reference_design, save_design
from spab_core.map_engine import compute_map
from spab_core.point import OperatingPoint, solve_point
from spab_core.simulate import Settings, simulate
from spab_core.stability import concentric_stiffness, linear_spectrum, static_equilibrium, whirl_thresholds
from spab_core.stability_map import StabilityMap, load_map, save_map

__all__ = [
    "Bifurcation", "Design", "DesignError", "InputError", "OperatingPoint", "Settings", "StabilityMap", "__version__",
    "chaotic_intervals", "compute_bifurcation", "compute_map", "concentric_stiffness", "linear_spectrum", "load_bifurcation",
    "load_design", "load_map", "reference_design", "save_bifurcation", "save_design", "save_map", "simulate", "solve_point",
    "static_equilibrium", "whirl_thresholds",
]
