"""A small stability map, and the shipped one beside it.

Solve a plane of 5 bearing numbers x 4 rotor masses, each cell from its own cold start, save it as
NPZ and read it back. The cells lie on the grid of the shipped map (170 x 250 cells), so both can be
compared: the largest difference between the exponents of periodic cells is printed. Chaotic cells
may differ, because chaos amplifies the last bit.

A larger map takes the same call; `parts` names a folder where finished chunks are kept, so that an
interrupted run goes on, and `workers` the number of processes.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from spab_core import Settings, compute_map, load_map, reference_design, save_map
from spab_core.common.paths import HOME

BEARING_NUMBERS = np.array([0.5, 2.0, 3.5, 5.0, 6.5])
ROTOR_MASSES = np.array([2.0, 7.0, 12.0, 20.0])  # kg


def main() -> None:
    """Solve, save, read, compare."""
    solved = compute_map(
        reference_design(),
        BEARING_NUMBERS,
        ROTOR_MASSES,
        Settings(transient=300, revolutions=300),
        workers=1,
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "small_map.npz"
        save_map(solved, path)
        solved = load_map(path)

    print("Λ \\ kg  " + "".join(f"{mass:>34g}" for mass in solved.rotor_mass))
    for row, number in enumerate(solved.bearing_number):
        cells = (solved.cell_text(row, column) for column in range(len(solved.rotor_mass)))
        print(f"{number:<8g}" + "".join(f"{text:>34}" for text in cells))

    shipped = load_map(HOME / "artifacts" / "reference_map.npz")
    rows, columns = zip(
        *(shipped.nearest(mass, number) for number in BEARING_NUMBERS for mass in ROTOR_MASSES),
        strict=True,
    )
    regime, mle = shipped.regime[rows, columns], shipped.mle[rows, columns]
    periodic = (regime == "periodic") & (solved.regime.ravel() == "periodic")
    difference = np.abs(mle - solved.mle.ravel())[periodic].max()
    same = int((regime == solved.regime.ravel()).sum())
    print(f"regime as in the shipped map: {same} of {regime.size} cells")
    print(f"periodic in both: {periodic.sum()}, largest difference of exponents {difference:.1e}")


if __name__ == "__main__":
    main()
