"""What jobs compute is what the library computes, and wrong requests are sentences."""

import hashlib

import numpy as np
import pandas as pd
import pytest

from spab_core.design import InputError
from spab_core.foreign import Samples, rank_samples, samples_bytes
from spab_core.job_kinds import KINDS, SAMPLES
from spab_core.jobs import submit
from spab_core.simulate import Settings
from spab_core.surrogates import MODELS
from spab_core.what_if import load_sensitivity, sensitivity
from tests.unit.test_jobs import root, until  # noqa: F401  (root is a fixture)

QUICK = {"mesh": "2x16", "transient": 40, "revolutions": 30}


def test_sensitivity_as_a_job(root, design):  # noqa: F811
    asked = {"rotor_mass": 8.0, "speed_rpm": 9000.0, "axis": "mass", "scan": 2, "settings": QUICK}
    job = until(submit("sensitivity", asked).id, lambda j: not j.active)
    assert (job.state, job.done, job.total) == ("done", 9, 9), job.message
    base, table = load_sensitivity(job.result)
    own, rows = sensitivity(design, 8.0, 9000.0, "mass", Settings(**QUICK), scan=2)
    assert repr(base) == repr(own) and table.equals(rows)


def test_ranking_as_a_job_on_its_own_file(root, design):  # noqa: F811
    number, mass = (a.ravel() for a in np.meshgrid(np.linspace(0.5, 8.0, 10), np.linspace(1.0, 20.0, 10)))
    samples = Samples(np.column_stack([number, mass]), np.sin(number) * mass)
    data = samples_bytes(samples)
    asked = {"samples": hashlib.sha256(data).hexdigest(), "models": ["tree", "cubic", "theory-trees"]}
    job = until(submit("ranking", asked, {SAMPLES: data}).id, lambda j: not j.active)
    assert job.state == "done" and job.done == job.total, job.message
    scores, own = pd.read_csv(job.result), rank_samples(samples, design, [MODELS[k] for k in asked["models"]])
    assert np.allclose(scores["rmse_held_out"], own["rmse_held_out"], rtol=1e-12)
    assert list(scores["model"]) == list(own["model"])
    wrong = submit("ranking", {"samples": "0" * 64}, {SAMPLES: data})
    assert "not the file" in until(wrong.id, lambda j: not j.active).message


@pytest.mark.parametrize(("kind", "change", "words"), [
    ("sensitivity", {"axis": "time"}, "axis = 'time'"), ("sensitivity", {"step": 0.9}, "step = 0.9 is out of range"),
    ("sensitivity", {"speed_rpm": 1e9}, "speed = 1e[+]09 rpm is out of range"),
    ("sensitivity", {"speed": 1}, "'speed' is unknown"),
    ("sensitivity", {"settings": {"mesh": "1x1"}}, "mesh"), ("ranking", {"samples": "../../etc/passwd"}, "must be the SHA-256"),
    ("ranking", {}, "'samples' is missing"),
    ("ranking", {"samples": "0" * 64, "models": ["oracle"]}, "model = 'oracle'")])
def test_wrong_requests(kind, change, words):
    usual = {"rotor_mass": 8.0, "speed_rpm": 9000.0} if kind == "sensitivity" else {}
    with pytest.raises(InputError, match=words):
        KINDS[kind].check(usual | change)
