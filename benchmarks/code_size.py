"""How large and how complex the code is, at several commits: lines, statements, the longest and the
most complex functions; seconds a cell of two of them in one run.

    python benchmarks/code_size.py [--marks NAME=COMMIT ...] [--most 20]
    python benchmarks/code_size.py --seconds e3a7d10^ 7d54606 [--rounds 5]

Each commit is laid out in a folder and formatted by ruff at 100 columns first, so that lines mean
the same at all of them; statements do not depend on layout at all. Lines of a function are those
without its docstring; complexity is McCabe's, as ruff counts it (``make lint`` allows 15). A mark
ends a stretch of work. The answer is Markdown, as it stands in docs/code_size.md.

``--seconds`` solves the same cells from both commits in turns, each in a process of its own with
kernels compiled before, and tells the ratio of the processor's time, median and range."""

import argparse
import ast
import io
import json
import re
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from cold_compile import answer_of

ROOT = Path(__file__).resolve().parent.parent
MARKS = {
    "one flat folder": "e3a7d10^",
    "rooms and engines": "7d54606",
    "Fourier around the band, assessments, solved margins": "306ad8f",
    "gas in the wall, shapes, the new dashboard, tolerances, better drawings": "e87c37c",
    "today": "HEAD",
}
PARTS = {
    "spab_core, app.py, pages": ("spab_core", "pages", "app.py"),
    "tests": ("tests",),
    "benchmarks": ("benchmarks",),
}
RUFF = (sys.executable, "-m", "ruff")
_CELLS = """
import json, time
from spab_core import Settings, reference_design, solve_point
cells = [(m, b) for m in (3.0, 9.0, 18.0) for b in (1.0, 4.0, 7.5)]
settings = Settings(revolutions=300, early_stop=False)
for m, b in cells[:1] * 2:
    solve_point(reference_design(), m, b, settings)  # compiles or loads the kernels
began = time.process_time()
for m, b in cells:
    solve_point(reference_design(), m, b, settings)
print(json.dumps((time.process_time() - began) / len(cells)))
"""


def lay_out(commit: str, folder: Path) -> None:
    """Write a commit's files to a folder."""
    data = subprocess.run(
        ["git", "archive", commit], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        archive.extractall(folder, filter="data")


def sources(folder: Path, part: str) -> list[Path]:
    """Return the Python files of a part."""
    roots = [folder / name for name in PARTS[part]]
    return [path for root in roots for path in (root.rglob("*.py") if root.is_dir() else [root])]


def documented(node: ast.AST) -> bool:
    """Whether a module, class or function begins with a docstring."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return isinstance(node, kinds) and ast.get_docstring(node, clean=False) is not None


def count(paths: list[Path]) -> tuple[int, int]:
    """Lines that are not blank, and statements without docstrings."""
    lines = statements = 0
    for path in paths:
        text = path.read_text()
        lines += sum(bool(line.strip()) for line in text.splitlines())
        for node in ast.walk(ast.parse(text)):
            statements += isinstance(node, ast.stmt) - documented(node)
    return lines, statements


def lengths(folder: Path, paths: list[Path]) -> dict[tuple[str, str], int]:
    """Lines without the docstring of each function, by file and name."""
    found = {}
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                told = node.body[0] if documented(node) else None
                doc = told.end_lineno - told.lineno + 1 if told else 0
                key = (str(path.relative_to(folder)), node.name)
                found[key] = max(found.get(key, 0), node.end_lineno - node.lineno + 1 - doc)
    return found


def complexities(folder: Path, paths: list[Path]) -> dict[tuple[str, str], int]:
    """McCabe's complexity of each function, by file and name."""
    limit = "lint.mccabe.max-complexity = 0"
    command = [*RUFF, "check", "--isolated", "--select", "C901", "--config", limit]
    ran = subprocess.run(
        [*command, "--ignore-noqa", "--output-format", "json", *map(str, paths)],
        capture_output=True,
        text=True,
    )
    found: dict[tuple[str, str], int] = {}
    for row in json.loads(ran.stdout):
        if told := re.match(r"`(\w+)` is too complex \((\d+) > 0\)", row["message"]):
            key = (str(Path(row["filename"]).relative_to(folder)), told[1])
            found[key] = max(found.get(key, 0), int(told[2]))
    return found


def most(found: dict[tuple[str, str], int], many: int) -> list[str]:
    """The largest, in words."""
    rows = sorted(found.items(), key=lambda row: (-row[1], row[0]))[:many]
    return [
        f"{value} `{name}` in {path.removeprefix('spab_core/')}" for (path, name), value in rows
    ]


def table(head: list[str], rows: list[list[str]]) -> str:
    """Markdown of a table."""
    told = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in told) + "\n"


def describe(marks: dict[str, str], many: int) -> None:
    """Print the tables of lines and of functions."""
    rows, longest, complex_ones = [], [], []
    for name, commit in marks.items():
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place).resolve()
            lay_out(commit, folder)
            format_ = [*RUFF, "format", "--quiet", "--isolated", "--line-length", "100"]
            subprocess.run([*format_, str(folder)], check=True)
            paths = {part: sources(folder, part) for part in PARTS}
            told = [f"{lines:,}; {many:,}" for lines, many in map(count, paths.values())]
            product = paths["spab_core, app.py, pages"]
            function_lengths = lengths(folder, product)
            rows.append([name, str(len(product)), *told, str(len(function_lengths))])
            longest.append(most(function_lengths, many))
            complex_ones.append(most(complexities(folder, product), many))
    parts = [f"{part}: lines; statements" for part in PARTS]
    print(table(["after", "files", *parts, "functions"], rows))
    (first, *_, last) = marks
    for title, found in (("longest, lines", longest), ("most complex", complex_ones)):
        pairs = zip(found[0], found[-1], strict=True)
        print(table([f"{title}: {first}", last], [list(pair) for pair in pairs]))


def compare(commits: list[str], rounds: int) -> None:
    """Print seconds a cell of two commits and their ratio."""
    with tempfile.TemporaryDirectory() as place:
        seconds: list[list[float]] = [[], []]
        for turn in range(rounds + 1):
            for k, commit in enumerate(commits):
                folder = Path(place).resolve() / str(k)
                if not turn:
                    lay_out(commit, folder)
                found = answer_of(_CELLS, folder, folder / "kernels")
                if turn:  # the first one compiles
                    seconds[k].append(found)
    ratios = [after / before for before, after in zip(*seconds, strict=True)]
    for commit, found in zip(commits, seconds, strict=True):
        print(f"{commit}: {statistics.median(found):.3f} s a cell")
    print(
        f"{commits[1]} over {commits[0]}: {statistics.median(ratios):.3f} "
        f"({min(ratios):.3f} to {max(ratios):.3f}, {rounds} rounds)"
    )


def main() -> None:
    """Describe, or compare two commits."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--marks", nargs="+", metavar="NAME=COMMIT", help="commits, oldest first")
    parser.add_argument("--most", type=int, default=20, help="functions of each table")
    parser.add_argument("--seconds", nargs=2, metavar="COMMIT", help="compare seconds a cell")
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    if args.seconds:
        return compare(args.seconds, args.rounds)
    marks = dict(mark.split("=", 1) for mark in args.marks) if args.marks else MARKS
    describe(marks, args.most)


if __name__ == "__main__":
    main()
