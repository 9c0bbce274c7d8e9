"""Wait for background jobs."""

import time

from spab_core.jobs.store import find


def until(name, wanted, seconds=90):
    """The job once ``wanted`` holds for it."""
    end = time.monotonic() + seconds
    while True:
        job = find(name)
        if wanted(job):
            return job
        assert time.monotonic() < end, job
        time.sleep(0.05)
