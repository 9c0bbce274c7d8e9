"""Operating points on pages: solved live or as a job, their verdict, the controls of the solver."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import streamlit as st

from spab_core.common.errors import InputError
from spab_core.common.files import with_units
from spab_core.common.npz import npz_bytes
from spab_core.design.model import Design
from spab_core.plotting import point as draw
from spab_core.solver.film import AUTO, MESH_LIMITS, Mesh
from spab_core.solver.stepping import METHODS
from spab_core.trajectory.expected_time import expected_seconds
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.point_file import load_point, path_units, point_arrays
from spab_core.trajectory.revolution import Revolution, forces, integrate_revolution, run_up
from spab_core.trajectory.run import path_table
from spab_core.trajectory.settings import Settings
from spab_core.trajectory.spectrum import Spectrum, spectrum
from spab_core.ui.jobs import job_panel
from spab_core.ui.solving import LIVE_PATHS, live_point
from spab_core.ui.verdict import point_numbers, point_verdict
from spab_core.ui.view import chosen_limits, limits_option

LIVE_SECONDS = 2.0  # what is expected to take longer runs as a job
MESHES = (str(AUTO), "2x16", "3x16", "3x24", "4x24", "4x32", "4x48", "6x64")
COORDINATES = ("X₂", "Y₂", "X₁", "Y₁")  # the rotor state's first four
_RUN_UP = 60  # revolutions
_Key = tuple[Design, float, float, Settings]


def chosen_settings() -> Settings:
    """Method, mesh and length that the user has chosen. Raises ``InputError``."""
    state = st.session_state
    return Settings(
        state["mesh"],
        state["method"],
        int(state["transient"]),
        int(state["revolutions"]),
    )


def duration(seconds: float) -> str:
    """Such as "12 s" or "3 min"."""
    if seconds < 1.0:
        return "under a second"
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


def solved_point(
    design: Design, rotor_mass: float, bearing_number: float, settings: Settings, key: str
) -> OperatingPoint | None:
    """The point solved now, or by a job with progress where that is expected to take over two
    seconds.

    Returns
    -------
    OperatingPoint or None
        None as long as the job is not done or the solver is compiled; that is on the page. Raises
        ``InputError``.
    """
    seconds = expected_seconds(settings, bearing_number)
    if seconds <= LIVE_SECONDS:
        return live_point(design, rotor_mass, bearing_number, settings)
    job = job_panel(
        "point",
        {
            "design": design.to_dict(),
            "rotor_mass": rotor_mass,
            "bearing_number": bearing_number,
            "settings": settings.to_dict(),
            "path_revolutions": LIVE_PATHS,
        },
        f"Solve in the background (up to about {duration(seconds)})",
        key,
    )
    return _load(str(job.result), job.result.stat().st_mtime) if job else None


@st.cache_resource(max_entries=16, show_spinner=False)
def _load(path: str, stamp: float) -> OperatingPoint:
    return load_point(Path(path))


@st.cache_resource(max_entries=32, show_spinner=False)
def _revolution(key: _Key, _point: OperatingPoint) -> Revolution:
    return integrate_revolution(_point)


@st.cache_resource(max_entries=32, show_spinner=False)
def _run_up_path(key: _Key, _point: OperatingPoint) -> np.ndarray:
    settings = _point.settings
    revolutions = min(_RUN_UP, settings.transient + settings.revolutions)
    return run_up(_point.design, _point.rotor_mass, _point.bearing_number, settings, revolutions)


@st.cache_resource(max_entries=8, show_spinner=False)
def _film(key: _Key, colour: str, _point: OperatingPoint) -> go.Figure:
    return draw.film_figure(_revolution(key, _point), colour)


def _key(p: OperatingPoint) -> _Key:
    return p.design, p.rotor_mass, p.bearing_number, p.settings


def revolution_of(point: OperatingPoint) -> Revolution:
    """One more revolution of a completed point, with its film. Raises ``InputError``."""
    return _revolution(_key(point), point)


def run_up_of(point: OperatingPoint) -> np.ndarray:
    """Rotor states of a point's first revolutions, (n, 8)."""
    return _run_up_path(_key(point), point)


def _spectra(point: OperatingPoint, coordinates: int) -> dict[str, Spectrum]:
    """Spectra of the first so many of :data:`COORDINATES`, as recorded, and of Z where the journal
    moves along the axis.
    """
    path, along = point.trajectory.path, point.trajectory.axial_path
    signals = {name: path[..., k] for k, name in enumerate(COORDINATES[:coordinates])}
    if along.size:
        signals["Z"] = along[..., 0]
    return {name: spectrum(signal.ravel(), path.shape[1]) for name, signal in signals.items()}


def spectrum_of(point: OperatingPoint, coordinates: int = 2) -> go.Figure:
    """Spectra of the first so many of :data:`COORDINATES`, and of Z."""
    return draw.spectrum_figure(_spectra(point, coordinates), point.design.bearing.clearance)


def strongest_lines(point: OperatingPoint) -> str:
    """The strongest lines of X2, Y2 and Z in words."""
    path, micron = point.trajectory.path, 1e6 * point.design.bearing.clearance
    told = []
    for name, found in _spectra(point, 2).items():
        lines = found.lines()
        told.append(
            f"{name}: "
            + (", ".join(f"{a * micron:.3g} µm at order {o:.2f}" for o, a in lines) or "none")
        )
    step = f"{1 / len(path):.3f}"
    return (
        f"Strongest lines of {'; '.join(told)}. Orders {step} apart, Hann window, peak amplitudes."
    )


def film_of(point: OperatingPoint, colour: str = draw.QUANTITIES[0]) -> go.Figure:
    """The film on the sphere, over one revolution."""
    return _film(_key(point), colour, point)


def figures_of(point: OperatingPoint) -> dict[str, Callable[[], go.Figure]]:
    """Every figure of a point, as functions by title; those of a failed run are fewer."""
    if point.mle is None:
        return {"Orbits": lambda: draw.orbit_figure(point, run_up_of(point))}
    return {
        "Orbits": lambda: draw.orbit_figure(point, run_up_of(point)),
        "Journal": lambda: draw.body_figure(point, "journal", run_up_of(point)),
        "Disc": lambda: draw.body_figure(point, "disc", run_up_of(point)),
        "Section": partial(draw.section_figure, point),
        "Spectrum": lambda: spectrum_of(point, 4),
        "Signals": partial(draw.signals_figure, point),
        "Film": partial(film_of, point),
        "Forces": lambda: draw.forces_figure(revolution_of(point)),
        "Exponent": partial(draw.exponent_figure, point),
    }


def orbit_table(point: OperatingPoint) -> pd.DataFrame:
    """The recorded orbit, a row a sample; the columns are those of ``spab simulate --orbit``."""
    return with_units(pd.DataFrame(path_table(point.trajectory)), path_units(point.design))


def point_npz(point: OperatingPoint) -> bytes:
    """Everything as NPZ: what ``point_file.load_point`` reads, run-up, film and forces (N) of one
    more revolution.
    """
    arrays = point_arrays(point) | {"run_up": run_up_of(point)}
    if point.trajectory.status == "ok":
        r = revolution_of(point)
        arrays |= {
            "revolution_tau": r.tau,
            "revolution_states": r.states,
            "film_thickness": r.thickness,
            "film_pressure": r.pressure,
        } | {f"force_{name}": values for name, values in forces(r).items()}
    return npz_bytes(arrays)


def simulate_command(design_option: str, point_options: str, settings: Settings) -> str:
    """The command line that solves the same."""
    return (
        f"spab simulate {point_options}{design_option} --mesh {settings.mesh} --method "
        f"{settings.method} --transient {settings.transient} "
        f"--revolutions {settings.revolutions}{limits_option(chosen_limits())} --orbit orbit.csv"
    )


def verdict_panel(point: OperatingPoint) -> None:
    """Verdict in a coloured box and the numbers under it."""
    point_verdict(point)
    with st.container(horizontal=True, horizontal_alignment="distribute"):
        for label, value, text in point_numbers(point):
            st.metric(label, value, help=text, width="content")


def solver_controls(cost: bool = True) -> None:
    """Method, mesh and length; with ``cost`` a sentence on what they cost at the chosen
    point.
    """
    state = st.session_state
    st.segmented_control(
        "Method",
        METHODS,
        key="method",
        help="rodas: implicit, order 4, long steps. dtm: the paper's "
        "differential transformation, explicit, its steps limited by stability",
        required=True,
    )
    low, high = (Mesh(*limit) for limit in zip(*MESH_LIMITS, strict=True))
    known = MESHES if state["mesh"] in MESHES else (*MESHES, state["mesh"])
    st.selectbox(
        "Mesh",
        known,
        key="mesh",
        accept_new_options=True,
        help=f"Latitudes x azimuths of the half band; auto takes those that the design and the "
        f"eccentricity ask for; or type your own, from {low} to {high}",
    )
    one, two = st.columns(2)
    one.number_input("Transient, revolutions", 30, 5000, None, key="transient", step=50)
    two.number_input("Measured, revolutions", 20, 5000, None, key="revolutions", step=50)
    if not cost:
        return
    try:
        seconds = expected_seconds(chosen_settings(), float(state["bearing_number"]))
    except InputError:
        return  # the page says what is wrong, where it can be seen
    where = (
        "it is solved while you wait"
        if seconds <= LIVE_SECONDS
        else "it runs in the background, with progress and cancel"
    )
    long = duration(seconds)
    told = f"About {long} at most" if seconds >= 1.0 else long.capitalize()
    st.caption(
        f"{told} on this mesh: {where}. The cost grows with revolutions and faster "
        "than the mesh: twice the azimuths of 3x16 take three times as long, twice the "
        "latitudes as well; dtm takes ten times as long and more."
    )
