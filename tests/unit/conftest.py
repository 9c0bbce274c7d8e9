"""What unit tests share."""

import pytest

from spab_core.jobs import store as jobs
from spab_core.jobs.store import cancel, list_jobs
from spab_core.shipped import build
from spab_core.surrogates import classifier


@pytest.fixture(scope="module")
def one_table():
    """The first table of scores only is made: the others take as long again, and intervals need
    more cells than small maps have. Classifiers have few trees.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(classifier, "TREES", 20)
        for other in set(build.TABLES) - {build.SCORES}:
            patch.delitem(build.TABLES, other)
        yield


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
