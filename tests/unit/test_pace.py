"""Work beside the pages waits while one is drawn."""

import math

import pytest

from spab_core.ui import pace


class Clock:
    """Goes on by what is slept."""

    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


def test_what_works_beside_waits_for_the_last_page(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(pace, "time", clock)
    monkeypatch.setattr(pace, "_began", -math.inf)
    pace.let_pages_first()
    assert clock.now == 100.0
    pace.page_begins()
    pace.let_pages_first()
    assert clock.now == 100.0 + pace.DRAWING
    pace.page_begins()
    clock.now += 0.4 * pace.DRAWING
    pace.let_pages_first()
    assert clock.now == pytest.approx(100.0 + 2.0 * pace.DRAWING)


def test_it_goes_on_where_pages_begin_all_the_time(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(pace, "time", clock)
    monkeypatch.setattr(pace, "_began", clock.now)
    real = clock.sleep

    def sleep(seconds):
        real(seconds)
        pace.page_begins()

    monkeypatch.setattr(clock, "sleep", sleep)
    pace.let_pages_first()
    assert clock.now == 100.0 + pace.DRAWING
