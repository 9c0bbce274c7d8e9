"""About the model without a browser: the documents as they stand in docs/, all of them, with their
pictures and formulas.
"""

import json
import re

import pytest
from streamlit.testing.v1 import AppTest

from spab_core.common.errors import InputError
from spab_core.common.paths import HOME
from spab_core.shipped import manifest
from spab_core.shipped.manifest import AUDIT, ArtifactError, load_audit
from spab_core.ui import documents
from spab_core.ui.documents import read_sections
from spab_core.ui.view import ABOUT_TABS
from tests.app.conftest import complaints
from tests.conftest import ROOT

PAGE = str(next((ROOT / "pages").glob("*_About_the_model.py")))
SHOWN = ("model.md", "numerics.md", "results.md")


def opened(tab):
    at = AppTest.from_file(PAGE, default_timeout=30)
    at.query_params["about_tab"] = tab
    return at.run()


def test_every_line_of_the_documents_is_on_the_page_once():
    words, bodies = [], []
    for name in ABOUT_TABS:
        at = opened(name)
        assert not at.exception and not complaints(at)
        assert [tab.label for tab in at.tabs] == list(ABOUT_TABS)
        assert [bool(tab.children) for tab in at.tabs] == [tab == name for tab in ABOUT_TABS]
        words += [block.value for block in at.markdown]
        bodies += [h.proto.body for h in at.get("html")]
        assert not [c.value for c in at.caption if "missing" in c.value]
    shown = "\n".join(words).splitlines()
    for name in SHOWN:
        for line in (HOME / "docs" / name).read_text("utf-8").splitlines():
            if line.strip("$ ") and not line.startswith(("# ", "![", "## ", "|")):
                assert shown.count(line) == 1, line
    pictures = sum((HOME / "docs" / name).read_text("utf-8").count("![") for name in SHOWN)
    shown = [body for body in bodies if "<img alt=" in body]
    assert len(shown) == pictures > 5 and not any('alt=""' in body for body in shown)


def test_formulas_are_closed():
    """An odd number of dollar signs would set the rest of a paragraph as a formula."""
    for name in SHOWN:
        for heading, body in read_sections(name).items():
            for paragraph in re.sub(r"`[^`]*`", "", body).split("\n\n"):
                assert paragraph.count("$") % 2 == 0, (name, heading, paragraph)


def test_the_guide_shows_every_page():
    text = (HOME / "docs" / "dashboard.md").read_text("utf-8")
    names = [
        "start_light",
        *(p.stem.partition("_")[2].lower() for p in (ROOT / "pages").glob("*.py")),
    ]
    for name in names:
        assert (
            f"(pictures/{name}.png)" in text
            and (HOME / "docs" / "pictures" / f"{name}.png").is_file()
        ), name
    assert sum((HOME / "docs" / "pictures" / f"{name}.png").stat().st_size for name in names) < 2e6


def test_audit_figure_has_every_cell():
    at = opened("Numerics and validation")
    traces = json.loads(at.get("plotly_chart")[0].proto.spec)["data"]
    rows = load_audit(AUDIT)
    assert [t["name"] for t in traces[1:]] == [
        f"{r} ({(rows['regime'] == r).sum()})" for r in ("periodic", "quasi-periodic", "chaotic")
    ]
    crosses = sum(symbol == "x" for t in traces[1:] for symbol in t["marker"]["symbol"])
    assert crosses == int((rows["regime"] != rows["map_regime"]).sum()) > 0


def test_missing_documents_are_said_in_words(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"cannot read .*model\.md"):
        read_sections("model.md", (), tmp_path)
    (tmp_path / "model.md").write_text("# The model\n\nWords\n\n## Film\n\nMore")
    assert {k: v.strip() for k, v in read_sections("model.md", (), tmp_path).items()} == {
        "": "Words",
        "Film": "More",
    }
    with pytest.raises(InputError, match="no section 'Contact'"):
        read_sections("model.md", ("Film", "Contact"), tmp_path)
    for text in ("", "a,b\n1,2\n"):
        (tmp_path / "audit.csv").write_text(text)
        with pytest.raises(ArtifactError, match=r"audit_map\.py"):
            load_audit(tmp_path / "audit.csv")
    monkeypatch.setattr(manifest, "AUDIT", tmp_path / "none.csv")
    at = AppTest.from_file(PAGE, default_timeout=30).run()
    assert not at.exception and "none.csv" in at.error[0].value and AUDIT.exists()


def test_a_missing_picture_is_told(tmp_path):
    def page(folder):
        from pathlib import Path

        from spab_core.ui.documents import show_sections

        show_sections({"Film": "Words\n![The map](pictures/none.png)\nMore"}, Path(folder))

    at = AppTest.from_function(page, args=(str(tmp_path),)).run()
    assert not at.exception and "pictures/none.png is missing" in at.caption[0].value
    assert [m.value.strip() for m in at.markdown] == ["## Film\n\nWords", "More"]
    assert documents.DOCS == HOME / "docs"
