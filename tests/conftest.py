"""Shared fixtures: the kernels are compiled once per session (numba keeps them in its cache between
sessions).
"""

import importlib.util
import os
import shutil
from pathlib import Path

# the workers of pytest share the cores: threads of BLAS and OpenMP, two of each in every worker,
# would wait for one another, so that a quarter of a second's training took twenty; before numpy
# reads it
os.environ.setdefault("OMP_NUM_THREADS", "1")

import hypothesis
import numpy as np
import pytest
from xdist.scheduler import LoadFileScheduling

from spab_core.design.model import reference_design
from spab_core.design.presets import preset
from spab_core.solver.film import Mesh, build_film, gas_size
from spab_core.solver.rotor import build_rotor
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System
from spab_core.trajectory import compiling
from spab_core.trajectory.compiling import compile_once
from spab_core.ui.jobs import SOLVES

# no test is for seconds
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")
SMALL = Mesh(3, 16)


def pytest_configure(config):
    """Compile the kernels once, before the worker processes of the session start."""
    if not hasattr(config, "workerinput") and config.getoption("numprocesses", 0):
        compile_once()


def pytest_xdist_make_scheduler(config, log):
    """Give out files, those of the browser as if they were one: two browsers at once wait for each
    other's servers, one waits for itself while another worker computes.
    """

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return BROWSER if nodeid.startswith(BROWSER) else super()._split_scope(nodeid)

    return ByFile(config, log)


BROWSER = "tests/browser/"
LONG = (
    BROWSER,
    "test_controls",
    "test_ross",
    "test_axial_motion",
    "test_home",
    "test_faults",
    "test_wheel",
    "test_jobs",
    "test_job_kinds",
    "test_cli_models",
)


def pytest_collection_modifyitems(items):
    """Long files first: workers take files in this order, and none is left alone with one at the
    end.
    """
    items.sort(
        key=lambda item: next((k for k, name in enumerate(LONG) if name in item.nodeid), len(LONG))
    )


ROOT = Path(__file__).resolve().parent.parent


def load_script(path):
    """Return a script of docs/ or benchmarks/ as a module, run anew; ``path`` from the top."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session", autouse=True)
def own_folders(tmp_path_factory):
    """Models that tests train and jobs that they start are kept apart from the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPAB_CACHE", str(tmp_path_factory.mktemp("models") / "cache"))
        patch.setenv("SPAB_JOBS", str(tmp_path_factory.mktemp("work") / "jobs"))
        # servers and pages of tests compile what the tests use, nothing ahead of it
        patch.setenv("SPAB_COMPILE_AHEAD", "usual")
        # and solve no margin, sensitivity or line that no test waits for
        patch.setenv(SOLVES, "asked")
        patch.setattr(compiling, "_decided", True)
        yield


@pytest.fixture
def unasked(monkeypatch):
    """Pages, and servers started from here on, solve by themselves, as a user's do."""
    monkeypatch.delenv(SOLVES)


@pytest.fixture(scope="session")
def design():
    return reference_design()


@pytest.fixture(scope="session")
def chromium():
    """Path of Chromium; skips with a reason where there is none, fails where CI must have one."""
    path = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    if path is None:
        if os.environ.get("SPAB_REQUIRE_BROWSER"):
            pytest.fail("CI must have Chromium (see .ci/run)")
        pytest.skip("no Chromium on this machine")
    return path


class Run:
    """One trajectory under the test's control: state, system and whole-revolution stepping."""

    def __init__(
        self,
        design,
        rotor_mass,
        bearing_number,
        mesh=SMALL,
        method="rodas",
        ramp=30.0,
    ):
        self.film = build_film(design, bearing_number, mesh)
        self.rotor = build_rotor(design, rotor_mass, bearing_number, ramp)
        self.system = System(self.film, self.rotor)
        self.method = method
        self.memory = build_memory(self.film, method)
        self.n = gas_size(self.film)
        self.done = 0

    def go(self, revolutions, tolerance=2e-4, *, samples=0, restart=False, **options):
        """Advance; returns (status, record)."""
        if restart:
            self.memory.control[:] = 0.0
        record = build_record(revolutions, samples)
        chosen = Options(tolerance, **options)
        status, done = advance(self.system, self.memory, chosen, self.done, revolutions, record)
        self.done += done
        return status, record

    def start_from(self, other):
        """Take state, tangent and time of another run on the same mesh."""
        self.memory.state[:] = other.memory.state
        self.memory.tangent[:] = other.memory.tangent
        self.memory.control[:] = 0.0
        self.done = other.done
        return self

    @property
    def unknowns(self):
        """Positions of the unknowns in the state."""
        return np.arange(self.n + 8)


@pytest.fixture
def make_run(design):
    def build(rotor_mass, bearing_number, design=design, **options):
        return Run(design, rotor_mass, bearing_number, **options)

    return build


def quiet(name):
    """A preset's design, its wall taken as quasi-steady."""
    return preset(name).design.replace(bearing__porosity=0.0)


def fed_design(edge_latitude, supply, feeding_number, **changes):
    """The reference design with another band, supply pressure and porous feeding number."""
    d = reference_design()
    b = d.bearing
    permeability = feeding_number * b.wall_thickness * b.clearance**3 / (6.0 * b.radius**2)
    return d.replace(
        bearing__edge_latitude=float(edge_latitude),
        bearing__supply_pressure_ratio=float(supply),
        bearing__permeability=permeability,
        **changes,
    )
