"""Maps of bearings that nothing here was tuned on, in five minutes each: how many cells have the
regime of the full solve?

    python benchmarks/own_maps.py [--minutes 5] [--cells 1000] [preset ...]

The full solve is sampled: cells drawn at random from the whole plane are solved and compared, and
the share that agrees is told with its 95 % interval (Wilson). Writes docs/own_maps.csv."""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from held_out import WORKERS, held_out
from scipy.stats import binomtest

from spab_core.active_learning.quick_map import (
    as_map,
    check_quick_map,
    quick_map,
    usual_plane,
)
from spab_core.design.presets import PRESETS

TARGET = Path(__file__).resolve().parent.parent / "docs" / "own_maps.csv"


def measure(name: str, minutes: float, cells: int) -> dict:
    """Map one preset, solve random cells, compare."""
    design = PRESETS[name].design.replace(bearing__porosity=0.0)  # as measured before
    axes = usual_plane(design)
    number, mass = check_quick_map(*axes, 60.0 * minutes)
    began, first = time.perf_counter(), []
    with tempfile.TemporaryDirectory() as folder:
        for found in quick_map(
            design,
            number,
            mass,
            seconds=60.0 * minutes,
            checkpoint=Path(folder) / "parts",
            workers=WORKERS,
        ):
            first.append(time.perf_counter() - began)
            solved = int(found.solved.sum())
    seconds, m = time.perf_counter() - began, as_map(found)
    began = time.perf_counter()
    drawn, solved_again = held_out(name, design, number, mass, cells)
    check_seconds = time.perf_counter() - began
    row, column = np.unravel_index(drawn, m.shape)
    truth, mle = solved_again["regime"], solved_again["mle"]
    agree = m.regime[row, column] == truth
    test = binomtest(int(agree.sum()), cells).proportion_ci(method="wilson")
    open_cells = ~found.solved[row, column] & np.isfinite(mle)
    inside = np.abs(m.mle[row, column] - mle) <= 1.645 * m.mle_standard_error[row, column]
    shares = {
        f"share {r}": float((truth == r).mean())
        for r in ("periodic", "quasi-periodic", "chaotic", "")
    }
    return {
        "design": name,
        "bearing_number": axes[0],
        "rotor_mass": axes[1],
        "minutes": seconds / 60.0,
        "first_plane_s": first[0],
        "solved": solved,
        "of": int(m.mle.size),
        "checked": cells,
        "agree": float(agree.mean()),
        "low": test.low,
        "high": test.high,
        "inside_1.645_deviations": float(inside[open_cells].mean()),
        "mle_median_error": float(np.median(np.abs(m.mle[row, column] - mle)[open_cells])),
        **shares,
        "full_solve_would_take_min": check_seconds / cells * m.mle.size / 60.0,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "presets", nargs="*", default=[name for name in PRESETS if name != "spab60"]
    )
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--cells", type=int, default=1000)
    args = parser.parse_args()
    rows = []
    for name in args.presets:
        rows.append(measure(name, args.minutes, args.cells))
        print(
            "; ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in rows[-1].items()
            ),
            flush=True,
        )
    if args.presets == [name for name in PRESETS if name != "spab60"]:
        pd.DataFrame(rows).to_csv(TARGET, index=False, float_format="%.6g")


if __name__ == "__main__":
    main()
