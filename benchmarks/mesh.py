"""Which mesh? Errors of M latitudes and N azimuths, in the film at rest and in operating points.

    python benchmarks/mesh.py [--part film|points] [--points 12]

Film: the journal is held at an eccentricity, its film steady. Told are the errors of the force and
of the dynamic stiffness at half speed, over their size (Frobenius norm), against a fine mesh
(8x40), the largest over three bearing numbers: first of N alone for the reference, then of M alone
for fed bearings and other edges too, then of the meshes that
:func:`spab_core.solver.film.suitable_mesh` takes.

Points: those of docs/model.md and random ones of the plane (fixed seed) on each mesh and on a fine
one (4x32): how many regimes agree, the median and the largest difference of the exponent over
points that are periodic on both, and the seconds over those of 3x16."""

import argparse
import functools
import math
import statistics

import numpy as np

from spab_core.design.model import reference_design
from spab_core.solver.film import (
    AZIMUTHS,
    MORE_AZIMUTHS,
    Mesh,
    film_array,
    film_force,
    film_size,
    parse_mesh,
    suitable_mesh,
)
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import build_system
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

FINE = Mesh(8, 40)
NUMBERS = (1.0, 3.45, 8.5)
ATTITUDE, WHIRL = -1.0, 0.5  # rad from +X; over the shaft speed
MESHES, FINEST = ("3x16", "3x24", "4x16", "4x24"), "4x32"
POINTS = [
    (4.52, 1.5),
    (20.0, 2.0),
    (7.0, 6.0),
    (10.0, 5.0),
    (12.0, 8.0),
    (4.52, 3.0),
    (2.0, 5.0),
    (18.0, 4.5),
    (24.0, 4.0),
    (15.0, 5.0),
]


def build_designs():
    """The designs of the study: the reference, three that feed their wall, three other edges."""
    reference = reference_design()

    def fed(number):
        bearing = {"bearing__supply_pressure_ratio": 5.0}
        permeability = reference.bearing.permeability * number / reference.feeding_number
        return reference.replace(**bearing, bearing__permeability=permeability)

    return {
        "reference": reference,
        **{f"fed, P_s 5, beta {number:g}": fed(number) for number in (0.16, 1.0, 10.0)},
        **{
            f"edge at {edge:g} deg": reference.replace(bearing__edge_latitude=edge)
            for edge in (45.0, 60.0, 80.0)
        },
    }


@functools.cache
def hold(design, number, mesh, eccentricity):
    """Film force and dynamic stiffness, (2,) and (2, 2), of a journal held off the centre, by
    Newton's method from the concentric film on.
    """
    system = build_system(design, 1.0, number, mesh).without_unbalance()
    rotor = system.rotor._replace(contact_force=0.0)
    system = system._replace(rotor=rotor)
    n = film_size(system.film)
    state = np.zeros(system.size)
    state[:n] = 1.0
    direction = np.array([math.cos(ATTITUDE), math.sin(ATTITUDE)])
    for share in np.linspace(0.2, 1.0, 5):
        state[n : n + 2] = share * eccentricity * direction
        for _ in range(40):
            value, jacobian = slope_and_jacobian(system, state, np.arange(n))
            step, fraction = np.linalg.solve(jacobian[:n], value[:n]), 1.0
            while (state[:n] - fraction * step).min() <= 0.0:
                fraction *= 0.5
            state[:n] -= fraction * step
            if np.abs(step).max() < 1e-11:
                break
        else:
            raise RuntimeError(f"no steady film: {number}, {mesh}, {eccentricity}")
    _, jacobian = slope_and_jacobian(system, state, np.arange(n + 2))
    force = jacobian[n + 4 : n + 6] / rotor.inverse_mass
    answer = np.linalg.solve(1j * WHIRL * np.eye(n) - jacobian[:n, :n], jacobian[:n, n:] + 0j)
    shaft = rotor.coupling_journal / rotor.inverse_mass
    stiffness = force[:, :n] @ answer + force[:, n:] + shaft * np.eye(2)
    return np.array(film_force(system.film, film_array(system.film, state), *state[n : n + 2])), (
        stiffness
    )


def error(design, mesh, eccentricity):
    """Largest errors of force and stiffness over the bearing numbers, as text."""
    apart = []
    for number in NUMBERS:
        found, fine = (hold(design, number, m, eccentricity) for m in (mesh, FINE))
        apart.append(
            [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(found, fine, strict=True)]
        )
    return ", ".join(f"{value:.0e}".replace("e-0", "e-") for value in np.max(apart, axis=0))


def table(head, rows):
    """Print a table of Markdown."""
    print("\n| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |", flush=True)


def tell_film():
    """Print the study of the film."""
    designs = build_designs()
    reference = designs["reference"]
    azimuths = [Mesh(FINE.latitude, n) for n in (16, 24, 32)]
    table(
        ("e", *map(str, azimuths)),
        (
            [f"{e:g}", *(error(reference, mesh, e) for mesh in azimuths)]
            for e in (0.3, 0.6, 0.8, 0.9, 0.95)
        ),
    )
    latitudes = [Mesh(m, FINE.azimuth) for m in (2, 3, 4, 5, 6)]
    table(
        ("design", "e", *map(str, latitudes)),
        (
            [name, f"{e:g}", *(error(design, mesh, e) for mesh in latitudes)]
            for name, design in designs.items()
            for e in (0.3, 0.9)
        ),
    )
    eccentricities = (0.3, 0.6, 0.8, 0.9)
    table(
        ("design", "mesh", *(f"e = {e:g}" for e in eccentricities)),
        (
            [name, str(mesh), *(error(design, mesh, e) for e in eccentricities)]
            for name, design in designs.items()
            for mesh in (suitable_mesh(design, n) for n in (AZIMUTHS, MORE_AZIMUTHS))
        ),
    )


def tell_points(count, finest):
    """Print the study of operating points of the reference design."""
    random = np.random.default_rng(11)
    points = POINTS + [(random.uniform(0.1, 25.0), random.uniform(0.05, 8.5)) for _ in range(count)]
    design = reference_design()
    answers = {mesh: [] for mesh in [*MESHES, str(finest)]}
    for mesh in answers:  # compiles, that of the early stop too
        solve_point(design, *POINTS[1], Settings(mesh))
    for point in points:
        for mesh, found in answers.items():
            found.append(solve_point(design, *point, Settings(mesh, revolutions=300)))
    seconds = {
        mesh: sum(a.trajectory.wall_seconds for a in found) for mesh, found in answers.items()
    }
    fine = answers.pop(str(finest))
    rows, notes = [], []
    for mesh, found in answers.items():
        pairs = list(zip(points, found, fine, strict=True))
        same = sum(a.regime == b.regime for _, a, b in pairs)
        change = [
            abs(a.mle.value - b.mle.value)
            for _, a, b in pairs
            if a.regime and b.regime and a.regime.name == b.regime.name == "periodic"
        ]
        notes += [
            f"{mesh}, {point[0]:.2f} kg, L {point[1]:.2f}: "
            + " for ".join(p.regime.text if p.regime else p.trajectory.status for p in (a, b))
            for point, a, b in pairs
            if a.regime != b.regime
        ]
        rows.append(
            (
                mesh,
                f"{same} of {len(points)}",
                f"{statistics.median(change):.4f}",
                f"{max(change):.4f}",
                f"{seconds[mesh] / seconds[MESHES[0]]:.2f}",
            )
        )
    rows.append((str(finest), "", "", "", f"{seconds[str(finest)] / seconds[MESHES[0]]:.2f}"))
    print(f"\n{len(points)} points against {finest}, 300 + 300 revolutions")
    table(("mesh", "same regime", "median change", "largest", "time"), rows)
    print(*notes, sep="\n")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--part", choices=("film", "points"), help="one part alone")
    parser.add_argument(
        "--points", type=int, default=12, help="random points besides those of docs/model.md"
    )
    parser.add_argument("--finest", type=parse_mesh, default=FINEST)
    options = parser.parse_args()
    if options.part != "points":
        tell_film()
    if options.part != "film":
        tell_points(options.points, options.finest)


if __name__ == "__main__":
    main()
