"""A design for a rotor program: the eight coefficients as a table that ROSS reads.

Take the fed spindle with the rotor mass at which its whirl is about to grow at 30,000 rpm, by the
eigenvalues of film and rotor together. Linearise the bearing at five speeds, each row at the
frequency of the rotor's least stable whirl (docs/my_bearing.md says why). Print the table in SI units
and write it as CSV and as the XLSX that `ross.BearingElement.from_table` reads.

The last column is the work that the cross stiffness does in a circle of forward whirl over what the
damping takes, (kxy - kyx) / ((cxx + cyy) ν ω). Check: it passes 1 within a percent of
30,000 rpm (not exactly there, because the whirl is not quite a circle).

    python examples/bearing_for_ross.py [FOLDER]
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from spab_core import whirl_thresholds
from spab_core.design.presets import preset
from spab_core.linear_theory.coefficients import LEAST_STABLE, coefficients_over_speed
from spab_core.linear_theory.ross_table import coefficient_table, save_table

THRESHOLD = 30_000.0  # rpm
SPEEDS = np.array([26_000.0, 28_000.0, 30_000.0, 32_000.0, 34_000.0])  # rpm


def main(folder: Path) -> None:
    """Compute the table, print it and write it into the folder."""
    design = preset("fed_spindle").design
    numbers = [design.bearing_number(speed * np.pi / 30) for speed in SPEEDS]
    threshold = whirl_thresholds(
        design, design.bearing_number(THRESHOLD * np.pi / 30), masses=(4.0, 20.0), scan=3
    )[0]
    print(
        f"at {THRESHOLD:.0f} rpm whirl grows from {threshold.critical_mass:.3f} kg, "
        f"at {threshold.whirl_ratio:.4f} of the speed"
    )
    found = coefficients_over_speed(design, threshold.critical_mass, numbers, LEAST_STABLE)
    table = coefficient_table(found)
    driven = (found.column("kxy") - found.column("kyx")) / (
        (found.column("cxx") + found.column("cyy")) * found.whirl_frequency
    )
    print(table.assign(rpm=found.speed * 30 / np.pi, driven=driven).to_string(index=False))
    rpm = np.interp(1.0, driven, found.speed * 30 / np.pi)
    print(f"by the coefficients, in a circle, it grows from {rpm:.0f} rpm")
    for name in ("bearing.csv", "bearing.xlsx"):
        save_table(table, str(folder / name))
        print(f"{name}: {(folder / name).stat().st_size} bytes")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as scratch:
            main(Path(scratch))
