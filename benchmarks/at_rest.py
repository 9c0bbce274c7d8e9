"""What does linear theory at rest take, with the azimuths chosen by the film and with 32 always?

    python benchmarks/at_rest.py [--rounds 20]

Operating points with a thick film, and one with a thin film, which is solved on 16 azimuths first
and on 32 then. Medians of processor time, in turns in one run.
"""

import argparse
import statistics
import time

from drawings import layered, machine

from spab_core import reference_design
from spab_core.linear_theory.equilibrium import AZIMUTHS
from spab_core.linear_theory.summary import derive
from spab_core.solver.film import AUTO, suitable_mesh


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=20)
    rounds = parser.parse_args().rounds
    fed, storing = machine(), layered()
    points = {
        "reference, 4.52 kg, Λ 3.45": (reference_design(), 4.52, 3.45),
        "4 kg, fed": (fed.design, fed.rotor_mass, fed.bearing_number),
        "4 kg, fed, wall storing gas": (storing.design, storing.rotor_mass, storing.bearing_number),
        "reference, 16 kg, Λ 2 (thin)": (reference_design(), 16.0, 2.0),
    }
    for name, point in points.items():
        meshes = AUTO, suitable_mesh(point[0], AZIMUTHS)
        took = [[], []]
        for turn in range(rounds + 1):
            for times, mesh in zip(took, meshes, strict=True):
                began = time.process_time()
                derive(*point, mesh)
                if turn:  # the first compiles and fills caches
                    times.append(time.process_time() - began)
        chosen, always = map(statistics.median, took)
        print(
            f"{name}: {1e3 * chosen:.1f} ms, with 32 azimuths {1e3 * always:.1f} ms, "
            f"ratio {chosen / always:.2f}"
        )


if __name__ == "__main__":
    main()
