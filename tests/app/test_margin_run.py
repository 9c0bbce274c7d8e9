"""A margin being solved beside the pages goes on as long as one of them looks at it."""

import math
import os
import time
from concurrent import futures

import pytest

from spab_core.common.workers import StandingWorkers
from spab_core.design.model import reference_design
from spab_core.solver.cache import folder_for_others
from spab_core.trajectory.assessment import Limits
from spab_core.ui import margin

PATIENCE = 60.0
KEY = reference_design(), 4.52, 3.45, Limits()


@pytest.fixture
def run(monkeypatch):
    """A run whose search has one call under way, and twenty that wait."""

    def search(*where, pool, **more):
        calls = [pool.submit(time.sleep, 0.2) for _ in range(21)]
        return [call.result() for call in calls]

    monkeypatch.setattr(margin, "solve_margin", search)
    found = margin._Run(KEY, StandingWorkers(1, os.getpid, folder_for_others()), lambda found: None)
    found.submit(abs, -1).result(PATIENCE)
    return found


def test_one_that_is_left_ends_and_takes_its_calls_back(run):
    run.wanted = -math.inf
    run._thread.join(PATIENCE)
    assert run.ended and not run.problem and not run._pending
    with pytest.raises(futures.CancelledError):
        run.submit(abs, -1)


def test_one_that_another_page_looks_at_goes_on(run):
    run.leave()
    run.wanted = time.monotonic()  # what the other page's next look does
    assert run.submit(abs, -2).result(PATIENCE) == 2
    assert not run.problem
    run.wanted = -math.inf


def test_one_that_is_left_for_good_ends(run):
    run.leave()
    run._thread.join(PATIENCE)
    assert run.ended
