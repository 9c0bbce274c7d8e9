"""docs/results.md says what is shipped."""

from tests.conftest import load_script


def test_its_tables_are_those_of_the_shipped_scores():
    """Written by ``make results``; a table whose first line is not there is an error."""
    tables = load_script("docs/result_tables.py")
    text = tables.RESULTS.read_text("utf-8")
    lines = text.split("\n")
    assert lines == tables.with_tables(text).split("\n")
    assert all(lines.count(first) == 1 for first in tables.TABLES)
