"""What jobs compute is what the library computes, and wrong requests are sentences."""

import hashlib

import numpy as np
import pandas as pd
import pytest

from spab_core.active_learning.quick_map import DOING
from spab_core.active_learning.refine import load_refinement
from spab_core.common.errors import InputError
from spab_core.design.model import reference_design
from spab_core.jobs.kinds import KINDS, SAMPLES
from spab_core.jobs.store import cancel, submit
from spab_core.maps.sensitivity import load_sensitivity, sensitivity
from spab_core.surrogates.models import MODELS
from spab_core.surrogates.user_data import Samples, rank_samples, samples_bytes
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings
from tests.background import until

QUICK = {"mesh": "2x16", "transient": 40, "revolutions": 30}


@pytest.mark.slow
def test_sensitivity_as_a_job(root, design):
    asked = {"rotor_mass": 8.0, "speed_rpm": 9000.0, "axis": "mass", "scan": 2, "settings": QUICK}
    job = until(submit("sensitivity", asked).id, lambda j: not j.active)
    assert (job.state, job.done, job.total) == ("done", 9, 9), job.message
    base, table = load_sensitivity(job.result)
    own, rows = sensitivity(design, 8.0, 9000.0, "mass", Settings(**QUICK), scan=2)
    assert repr(base) == repr(own) and table.equals(rows)


@pytest.mark.slow
def test_ranking_as_a_job_on_its_own_file(root, design):
    number, mass = (
        a.ravel() for a in np.meshgrid(np.linspace(0.5, 8.0, 10), np.linspace(1.0, 20.0, 10))
    )
    samples = Samples(np.column_stack([number, mass]), np.sin(number) * mass)
    data = samples_bytes(samples)
    asked = {
        "samples": hashlib.sha256(data).hexdigest(),
        "models": ["tree", "cubic", "theory-trees"],
    }
    job = until(submit("ranking", asked, {SAMPLES: data}).id, lambda j: not j.active)
    assert job.state == "done" and job.done == job.total, job.message
    scores, own = (
        pd.read_csv(job.result),
        rank_samples(samples, design, [MODELS[k] for k in asked["models"]]),
    )
    assert np.allclose(scores["rmse_held_out"], own["rmse_held_out"], rtol=1e-12)
    assert list(scores["model"]) == list(own["model"])
    wrong = submit("ranking", {"samples": "0" * 64}, {SAMPLES: data})
    assert "not the file" in until(wrong.id, lambda j: not j.active).message


@pytest.mark.slow
def test_a_quick_map_publishes_its_coarse_plane_and_keeps_it_when_stopped(root, design):
    asked = {
        "bearing_number": "2:4:8",
        "rotor_mass": "3:9:9",
        "seconds": 3600,
        "settings": QUICK | {"early_stop": False},
    }
    job = submit("map", asked)
    job = until(job.id, lambda j: j.message or not j.active)
    assert job.active and job.message in DOING  # what takes time is named
    job = until(job.id, lambda j: j.result.exists() or not j.active)
    assert job.active, job.message
    coarse = load_refinement(job.result)
    assert coarse.solved.sum() == 18 and (coarse.regime != "").all()
    kept = load_refinement(cancel(job.id).result)  # whatever has been published since
    assert kept.solved.sum() > 17 and not (coarse.solved & ~kept.solved).any()
    done = until(
        submit("map", asked).id, lambda j: not j.active
    )  # goes on to the last cell: time is not short here
    assert done.state == "done", done.message
    full = load_refinement(done.result)
    row, column = 5, 7
    point = solve_point(
        design, full.rotor_mass[column], full.bearing_number[row], Settings(**asked["settings"])
    )
    assert full.solved.all() and full.values["mle"][row, column] == point.mle.value
    assert np.array_equal(coarse.values["mle"][coarse.solved], full.values["mle"][coarse.solved])


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("sensitivity", {"axis": "time"}, "axis = 'time'"),
        ("sensitivity", {"step": 0.9}, "step = 0.9 is out of range"),
        ("sensitivity", {"speed_rpm": 1e9}, "speed = 1e[+]09 rpm is out of range"),
        ("sensitivity", {"speed": 1}, "'speed' is unknown"),
        ("sensitivity", {"settings": {"mesh": "1x1"}}, "mesh"),
        ("ranking", {"samples": "../../etc/passwd"}, "must be the SHA-256"),
        ("ranking", {}, "'samples' is missing"),
        ("ranking", {"samples": "0" * 64, "models": ["oracle"]}, "model = 'oracle'"),
        ("map", {"seconds": 1e9}, "seconds = 1e[+]09 s"),
        ("map", {"seed": -1}, "seed = -1"),
        ("map", {"bearing_number": "1:2:100000", "rotor_mass": "1:2:100000"}, "cells"),
        ("map", {"rotor_mass": "-1:2:20"}, "rotor mass = -1"),
        ("tolerance", {"tolerances": {}}, "at least one"),
        ("tolerance", {"tolerances": {"speed": "2"}}, "not understood"),
        ("tolerance", {"tolerances": 3}, "must be texts"),
        ("tolerance", {"machines": 100}, "power of two"),
        ("tolerance", {"rotor_mass": "x"}, "needs the numbers"),
        ("improve", {"ranges": {"bearing.clearance": [40, 20]}}, "must be the larger"),
        ("improve", {"ranges": {"bearing.clearance": 3}}, "must be two numbers"),
        ("improve", {"wishes": ["margin", "margin"]}, "two different wishes"),
        ("improve", {"most_gas_flow": -1.0}, "largest gas flow"),
        ("improve", {"load": 0.0}, "load = 0"),
    ],
)
def test_wrong_requests(kind, change, words):
    machine = {"rotor_mass": 8.0, "speed_rpm": 9000.0}
    usual = {
        "sensitivity": {"rotor_mass": 8.0, "speed_rpm": 9000.0},
        "ranking": {},
        "map": {"bearing_number": "1:2:10", "rotor_mass": "1:2:10"},
        "tolerance": machine | {"tolerances": {"speed": "± 1 %"}},
        "improve": machine | {"ranges": {"bearing.clearance": [30.0, 40.0]}},
    }[kind]
    with pytest.raises(InputError, match=words):
        KINDS[kind].check(usual | change)


@pytest.mark.parametrize("kind", ["point", "map", "tolerance"])
def test_a_method_that_does_not_solve_the_design_is_refused_before_the_queue(kind):
    design = reference_design().replace(rotor__axial_motion=True).to_dict()
    asked = {
        "point": {"rotor_mass": 1.0, "bearing_number": 2.0},
        "map": {"bearing_number": "1:2:4", "rotor_mass": "1:2:4"},
        "tolerance": {"rotor_mass": 1.0, "speed_rpm": 9000.0, "tolerances": {}},
    }[kind]
    with pytest.raises(InputError, match="method = dtm holds the journal along the axis"):
        submit(kind, asked | {"design": design, "settings": {"method": "dtm"}})
