"""A design for a rotor program: the eight coefficients over speed and whirl frequency for ROSS.

Take the fed spindle with the rotor mass at which its whirl is about to grow at 30,000 rpm, by the
eigenvalues of film and rotor together. Follow the film's whirl over five speeds, and print it: its
frequency over the speed, its logarithmic decrement, the coefficients that it feels, in SI units.
Write the table over speed and frequency as JSON, a `BearingElement` of ROSS, and as CSV
(docs/my_bearing.md says how to use it, and when to take the XLSX over speed alone).

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
from spab_core.linear_theory.coefficients import (
    FILM_WHIRL,
    coefficients_over_speed,
    coefficients_over_speed_and_frequency,
)
from spab_core.linear_theory.ross_table import coefficient_table, save_table

THRESHOLD = 30_000.0  # rpm
SPEEDS = np.array([10_000.0, 20_000.0, 28_000.0, 30_000.0, 32_000.0])  # rpm


def main(folder: Path) -> None:
    """Compute the tables, print the film's whirl and write the table into the folder."""
    design = preset("fed_spindle_layered").design
    numbers = [design.bearing_number(speed * np.pi / 30) for speed in SPEEDS]
    threshold = whirl_thresholds(
        design, design.bearing_number(THRESHOLD * np.pi / 30), masses=(4.0, 20.0), scan=3
    )[0]
    mass = threshold.critical_mass
    print(
        f"at {THRESHOLD:.0f} rpm whirl grows from {mass:.3f} kg, "
        f"at {threshold.whirl_ratio:.4f} of the speed"
    )
    found = coefficients_over_speed(design, mass, numbers, FILM_WHIRL)
    driven = (found.column("kxy") - found.column("kyx")) / (
        (found.column("cxx") + found.column("cyy")) * found.whirl_frequency
    )
    shown = coefficient_table(found)[
        ["whirl_ratio", "log_decrement", "mode", "kxx", "kxy", "kyx", "cxx"]
    ]
    shown.insert(0, "rpm", found.speed * 30 / np.pi)
    print(shown.assign(driven=driven).to_string(index=False))
    rpm = np.interp(1.0, driven, found.speed * 30 / np.pi)
    print(f"by the coefficients, in a circle, it grows from {rpm:.0f} rpm")
    table = coefficients_over_speed_and_frequency(design, mass, numbers)
    for name in ("bearing.json", "bearing.csv"):
        save_table(table, str(folder / name))
        print(f"{name}: {(folder / name).stat().st_size} bytes")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as scratch:
            main(Path(scratch))
