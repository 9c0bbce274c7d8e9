"""Work beside the pages waits while one is drawn."""

import pytest

from spab_core.ui import pace


@pytest.fixture
def clock(monkeypatch):
    """A clock that goes on by what is slept."""
    at = [100.0]
    monkeypatch.setattr(pace.time, "monotonic", lambda: at[0])
    monkeypatch.setattr(pace.time, "sleep", lambda seconds: at.append(at.pop() + seconds))
    return at


def test_what_works_beside_waits_for_the_last_page(clock):
    pace.let_pages_first()
    assert clock == [100.0]
    pace.page_begins()
    pace.let_pages_first()
    assert clock == [100.0 + pace.DRAWING]
    pace.page_begins()
    clock[0] += 0.4 * pace.DRAWING
    pace.page_begins()  # another one has begun in the meantime
    pace.let_pages_first()
    assert clock[0] == pytest.approx(100.0 + 2.4 * pace.DRAWING)
