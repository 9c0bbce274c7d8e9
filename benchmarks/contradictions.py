"""Cells of a map whose exponent contradicts linear theory and all cells around, and what they alone cost a perfect surrogate.

    python benchmarks/contradictions.py [map.npz]

Judged are strongly damped cells only (linear rate under -2 per revolution), by the rule that surrogates drop training cells by.
"""

import sys

import numpy as np

from spab_core.artifacts import load_reference_map
from spab_core.features import LinearFeatures
from spab_core.stability_map import load_map
from spab_core.surrogates import linear_table_of, solved_cells
from spab_core.theory_models import STRETCH, baseline, credible


def main():
    m = load_map(sys.argv[1]) if len(sys.argv) > 1 else load_reference_map()
    _, inputs, mle = solved_cells(m)
    linear = baseline(LinearFeatures(linear_table_of(m)).transform(inputs))
    place = np.column_stack([STRETCH * np.log(inputs[:, 0]), inputs[:, 1] / inputs[:, 1].max()])
    wrong = ~credible(place, mle, linear)
    for (number, mass), found, expected in zip(inputs[wrong], mle[wrong], linear[wrong], strict=True):
        print(f"bearing number {number:.3f}, {mass:6.2f} kg: exponent {found:8.3f}, linear rate {expected:8.3f}")
    cost = np.sqrt(np.sum((mle - linear)[wrong]**2) / len(mle))
    print(f"{wrong.sum()} of {np.count_nonzero(linear < -2.0)} strongly damped cells; were linear theory right there, a "
          f"perfect surrogate's RMSE over all {len(mle)} cells would be {cost:.4f}")


if __name__ == "__main__":
    main()
