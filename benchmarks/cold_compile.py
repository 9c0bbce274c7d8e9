"""How long the compiler keeps a first operating point waiting, here and in another checkout, in
turns on the same machine.

    git worktree add /tmp/before 6afd9a5 && python benchmarks/cold_compile.py --against /tmp/before

Each round starts a fresh process with an empty kernel folder for each checkout and solves the
reference design once, twice: the first time compiles. Seconds of the processor beside those of the
clock: they tell how much of it a second core could take."""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent.parent
_CODE = """
import json, time
from spab_core import Settings, reference_design, solve_point
def seconds():
    began, worked = time.perf_counter(), time.process_time()
    solve_point(reference_design(), 4.0, 3.0, Settings(transient=40, revolutions=20))
    return time.perf_counter() - began, time.process_time() - worked
first, again = seconds(), seconds()
print(json.dumps({"clock": first[0] - again[0], "processor": first[1] - again[1]}))
"""


def answer_of(code: str, checkout: Path, kernels: str | Path) -> Any:
    """Run a program on a checkout with a folder of kernels; return its last line, read as JSON."""
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=checkout,
        check=True,
        capture_output=True,
        text=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(kernels), "PYTHONPATH": str(checkout)},
    )
    return json.loads(run.stdout.splitlines()[-1])


def compile_cold(checkout: Path) -> dict[str, float]:
    """Seconds of clock and processor that a first point takes longer than a second one, with an
    empty kernel folder.
    """
    with tempfile.TemporaryDirectory() as kernels:
        return answer_of(_CODE, checkout, kernels)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    checkouts = [HERE] + ([args.against.resolve()] if args.against else [])
    found: list[list[dict[str, float]]] = [[] for _ in checkouts]
    for _ in range(args.rounds):
        for rows, checkout in zip(found, checkouts, strict=True):
            rows.append(compile_cold(checkout))
    medians = [
        {key: statistics.median(row[key] for row in rows) for key in rows[0]} for rows in found
    ]
    for checkout, median in zip(checkouts, medians, strict=True):
        print(
            f"{checkout}: {median['clock']:.1f} s of the clock, {median['processor']:.1f} s of "
            "the processor"
        )
    if args.against:
        print(
            f"ratio: {medians[1]['clock'] / medians[0]['clock']:.2f} clock, "
            f"{medians[1]['processor'] / medians[0]['processor']:.2f} processor"
        )


if __name__ == "__main__":
    main()
