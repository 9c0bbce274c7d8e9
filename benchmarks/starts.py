"""How long the library and the command take to start, here and in another checkout, in turns on the
same machine.

    git worktree add /tmp/before COMMIT && python benchmarks/starts.py --against /tmp/before

Seconds of the processor, the least of some rounds: each a fresh process."""

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
STARTS = {
    "import spab_core": ["-c", "import spab_core"],
    "spab simulate --help": ["-m", "spab_core.cli", "simulate", "--help"],
    "spab map --help": ["-m", "spab_core.cli", "map", "--help"],
    "spab jobs list": ["-m", "spab_core.cli", "jobs", "list"],
}


def seconds(arguments: list[str], checkout: Path) -> float:
    """Seconds of the processor that a Python takes for it on a checkout."""

    def spent() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    began = spent()
    subprocess.run(
        [sys.executable, *arguments],
        cwd=checkout,
        check=True,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": str(checkout)},
    )
    return spent() - began


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, metavar="CHECKOUT")
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    checkouts = [HERE, *([asked.against.resolve()] if asked.against else [])]
    for name, arguments in STARTS.items():
        found: list[list[float]] = [[] for _ in checkouts]
        for _ in range(asked.rounds):
            for kept, checkout in zip(found, checkouts, strict=True):
                kept.append(seconds(arguments, checkout))
        least = [min(kept) for kept in found]
        told = f", there {least[1]:.2f} s: {least[0] / least[1]:.2f} times" if asked.against else ""
        print(f"{name}: {least[0]:.2f} s{told}")


if __name__ == "__main__":
    main()
