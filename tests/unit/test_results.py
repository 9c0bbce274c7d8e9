"""docs/results.md says what is shipped."""

import importlib.util

from tests.conftest import ROOT


def test_its_tables_are_those_of_the_shipped_scores():
    """Written by ``make results``; a table whose first line is not there is an error."""
    path = ROOT / "docs" / "result_tables.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    text = tables.RESULTS.read_text("utf-8")
    lines = text.split("\n")
    assert lines == tables.with_tables(text).split("\n")
    assert all(lines.count(first) == 1 for first in tables.TABLES)
