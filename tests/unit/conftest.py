"""What unit tests share."""

import pytest

from spab_core.jobs import store as jobs
from spab_core.jobs.store import cancel, list_jobs


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Jobs of this test alone; none is left at work."""
    folder = tmp_path / "jobs"
    monkeypatch.setenv("SPAB_JOBS", str(folder))
    yield folder
    for job in list_jobs():
        if job.active:
            cancel(job.id)
    for name in list(jobs._workers):
        jobs._workers.pop(name).wait(60)
