"""What browser tests share: the tools that also take the pictures of docs/, and where theirs go."""

import importlib.util

import pytest

from tests.conftest import ROOT

OUTPUT = ROOT / "test-output"


@pytest.fixture(scope="session")
def tools():
    """docs/take_pictures.py as a module: a server of its own, pages in Chromium."""
    path = ROOT / "docs" / "take_pictures.py"
    spec = importlib.util.spec_from_file_location("take_pictures", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    OUTPUT.mkdir(exist_ok=True)
    return module
