"""A bifurcation line: period doubling on the way to chaos.

Solve the reference design at bearing number 3.45 for rotor masses from 17 to 22.5 kg, each point
from a cold start, and print regime, period in revolutions and exponent. A cascade of period
doubling is passed in order: 2, 4, 8 revolutions, then chaos. A point at a border between two of
them may be undecided: quasi-periodic with an exponent that is not clearly zero.
"""

import numpy as np

from spab_core import chaotic_intervals, compute_bifurcation, reference_design

ROTOR_MASSES = np.linspace(17.0, 22.5, 12)  # kg


def main() -> None:
    """Solve the line and print a row for each point."""
    line = compute_bifurcation(
        reference_design(), "rotor-mass", 3.45, ROTOR_MASSES, sweeps=("cold",), workers=1
    )
    branch = line.branches["cold"]
    print("     kg          regime  period  exponent per revolution")
    for k, mass in enumerate(line.values):
        print(f"{mass:7.2f}  {branch.regime[k]:>14}  {branch.period[k]:6d}  {branch.mle[k]:+.3f}")
    for first, last in chaotic_intervals(line.values, branch.regime):
        print(f"chaotic from {first:.2f} to {last:.2f} kg")


if __name__ == "__main__":
    main()
