"""Refined against random cells of the shipped map: writes docs/learning_curve.csv and prints its
means over five seeds.
"""

import argparse
import io
import time

from tqdm import tqdm

from spab_core.active_learning.learning_curve import (
    LEARNING_CURVE,
    SEEDS,
    goal,
    learning_curve,
    summary,
)
from spab_core.common.files import write_atomically
from spab_core.shipped.manifest import load_reference_map


def main():
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument(
        "--seeds",
        type=int,
        default=len(SEEDS),
        choices=range(1, len(SEEDS) + 1),
        help="the first of them",
    )
    parser.add_argument("--out", default=str(LEARNING_CURVE), metavar="FILE.csv")
    args = parser.parse_args()
    began = time.perf_counter()
    with tqdm(total=args.seeds, unit="seed") as bar:
        rows = learning_curve(load_reference_map(), SEEDS[: args.seeds], progress=bar.update)
    text = io.StringIO()
    rows.to_csv(text, index=False)
    write_atomically(args.out, text.getvalue().encode())
    for judged in ("unsolved", "withheld"):
        print(f"judged on {judged} cells, mean and standard deviation over {args.seeds} seeds")
        print(summary(rows, judged).to_string(float_format="{:.4f}".format))
        print(goal(rows, judged).to_string(float_format="{:.4f}".format))
    print(f"{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
