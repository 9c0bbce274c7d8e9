"""Every package that is imported is declared in pyproject.toml, where pip looks."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions

from tests.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]


def plain(requirement):
    """The name alone, as PyPI compares names."""
    return re.sub("[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def imported(*patterns):
    """Top-level packages that the files import anywhere, by the file that does."""
    found = {}
    for pattern in patterns:
        for path in ROOT.glob(pattern):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                names = (
                    [a.name for a in node.names]
                    if isinstance(node, ast.Import)
                    else [node.module]
                    if isinstance(node, ast.ImportFrom) and not node.level
                    else []
                )
                found |= {
                    name.partition(".")[0]: path.relative_to(ROOT).as_posix() for name in names
                }
    return {name: path for name, path in found.items() if name not in sys.stdlib_module_names}


def undeclared(found, *groups):
    """Packages of ``found`` that none of the distributions in ``groups`` brings."""
    declared, brings = {plain(r) for group in groups for r in group}, packages_distributions()
    return {
        name: path
        for name, path in found.items()
        if name != "spab_core" and declared.isdisjoint(map(plain, brings.get(name, [name])))
    }


def test_what_the_library_and_the_pages_import_is_declared():
    found = imported("app.py", "pages/*.py", "spab_core/**/*.py")
    assert {"numpy", "streamlit", "sklearn", "PIL", "distributed"} <= set(found)
    assert undeclared(found, PROJECT["dependencies"]) == {
        "distributed": "spab_core/maps/parallel.py"
    }  # said there
    assert not undeclared(found, PROJECT["dependencies"], EXTRAS["dask"])


def test_what_tests_benchmarks_docs_and_examples_import_is_declared():
    own = {path.stem for path in (*ROOT.glob("benchmarks/*.py"), *ROOT.glob("docs/*.py"))} | {
        "tests",
        "benchmarks",
    }
    # what benchmarks/against.py and open_air_bearing.py compare with, where it is there
    rivals = {"extensisq", "heyoka", "openairbearing", "optuna", "pymoo"}
    found = imported("tests/**/*.py", "benchmarks/*.py", "docs/*.py", "examples/*.py")
    groups = (PROJECT["dependencies"], *EXTRAS.values())
    assert "pytest" in found and not undeclared(
        {k: v for k, v in found.items() if k not in own | rivals}, *groups
    )
