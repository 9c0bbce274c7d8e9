"""Early stop against full runs: cells of the shipped map that stop early, again in full.

    python benchmarks/early_stop.py [--cells 300] [--workers 1] [--tolerance 1.5e-3]

Each cell is solved twice from the cold start on the map's mesh: as the map does, and without the
stop, 300 + 2,000 revolutions. The cells lie evenly over those that the map stopped early, in the
order of the plane, beside the named ones. The full run has errors of its own: that of its mean, by
batch means, is added in squares to the stated one; that of its steps shrinks with ``--tolerance``,
which is the full run's alone. Where the rate is under -2 modes swing many times within such steps:
there the full run takes 1,536 steps a revolution, for 100 + 100 of them. Finished cells are kept in
build/early_stop: a second run goes on from them."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
from pathlib import Path

import joblib
import numpy as np

from spab_core.common.files import write_atomically
from spab_core.shipped.manifest import load_reference_map
from spab_core.solver.cache import solver_hash
from spab_core.solver.stepping import REVOLUTION
from spab_core.trajectory.lyapunov import exponent
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.regimes import classify
from spab_core.trajectory.run import Run
from spab_core.trajectory.settings import Settings

ROOT = Path(__file__).resolve().parent.parent
NAMED = (  # kg, Lambda: where early stops or coarse meshes have been wrong
    (15.2, 1.5),
    (14.5, 0.5),
    (18.8, 6.55),
    (10.6, 5.6),
    (6.2, 8.25),
    (17.6, 3.8),
    (23.5, 5.9),
    (18.69, 0.388),
    (4.52, 1.5),
    (20.0, 0.05),
)
OFF = 0.02  # per revolution
STRONG, FINE_STEPS = -2.0, 1536


def answer(point):
    """What is compared, as plain values."""
    t = point.trajectory
    return {
        "regime": point.regime.text if point.regime else t.status,
        "mle": point.mle.value if point.mle else None,
        "error": point.mle.standard_error if point.mle else None,
        "eccentricity": point.max_eccentricity,
        "settled": t.settled is not None,
        "pushed": t.pushed,
        "revolutions": t.completed,
        "steps": t.steps,
        "seconds": t.wall_seconds,
    }


def solve_finely(design, mass, number, settings):
    """A point on steps of at most 1/1536 revolution."""
    t = Run(design, (mass, number), settings, max_step=REVOLUTION / FINE_STEPS).solve()
    mle = exponent(t.growth) if t.status == "ok" else None
    regime = classify(t.section, mle) if mle else None
    return OperatingPoint(design, mass, number, settings, t, mle, regime)


def solve(design, mass, number, settings, folder, solver=solve_point):
    """A cell's answer, from the folder where it is there already."""
    plan = json.dumps(
        [solver_hash(), solver.__name__, design.to_dict(), mass, number, settings.to_dict()]
    )
    path = folder / f"{hashlib.sha256(plan.encode()).hexdigest()[:24]}.json"
    if not path.exists():
        found = answer(solver(design, mass, number, settings))
        write_atomically(path, json.dumps(found).encode())
    return json.loads(path.read_text())


def compare(design, mass, number, early, full, folder):
    """Both answers of a cell."""
    short = solve(design, mass, number, early, folder)
    solver = solve_point
    if short["settled"] and short["mle"] < STRONG:
        solver, full = solve_finely, dataclasses.replace(full, transient=100, revolutions=100)
    return mass, number, short, solve(design, mass, number, full, folder, solver)


def allowed(early, full):
    """Three errors, of early stop and full run together, and 0.001."""
    return 3.0 * float(np.hypot(early["error"], full["error"])) + 0.001


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=300)
    parser.add_argument("--workers", type=int, default=1, choices=(1, 2))
    parser.add_argument("--tolerance", type=float, default=None, help="of the full runs")
    options = parser.parse_args()
    m = load_reference_map()
    about = m.metadata
    early = Settings(about["mesh"], transient=about["transient"], revolutions=about["revolutions"])
    full = dataclasses.replace(early, early_stop=False, revolutions=2000)
    if options.tolerance:
        full = dataclasses.replace(full, tolerance=options.tolerance)
    whole = about["transient"] + about["revolutions"]
    stopped = np.argwhere((m.regime == "periodic") & (m.revolutions < whole))
    chosen = stopped[np.linspace(0, len(stopped) - 1, options.cells).round().astype(int)]
    cells = [*NAMED, *((float(m.rotor_mass[c]), float(m.bearing_number[r])) for r, c in chosen)]
    folder = ROOT / "build" / "early_stop"
    folder.mkdir(parents=True, exist_ok=True)
    found = joblib.Parallel(n_jobs=options.workers, verbose=5)(
        joblib.delayed(compare)(m.design, *cell, early, full, folder) for cell in cells
    )
    report([row for row in found if row[2]["settled"] and row[3]["mle"] is not None], len(found))


def report(found, tried):
    """Print how many are off, whether the stated errors hold, the worst, and what it costs."""
    off = np.array([abs(e["mle"] - f["mle"]) for _, _, e, f in found])
    held = off <= [allowed(e, f) for _, _, e, f in found]
    attractor = np.array([e["regime"] != f["regime"] for _, _, e, f in found])
    print(f"{len(found)} of {tried} cells stopped early")
    print(
        f"off by more than {OFF}: {(off > OFF).sum()}, of which {(attractor & (off > OFF)).sum()} "
        "with another regime or period in full"
    )
    print(f"within three errors and 0.001: {100.0 * held.mean():.1f} % of the cells")
    print(f"median {np.median(off):.5f}, nine tenths under {np.quantile(off, 0.9):.5f}")
    for name in ("revolutions", "steps", "seconds"):
        means = [float(np.mean([row[k][name] for row in found])) for k in (2, 3)]
        print(f"{name} a cell: {means[0]:.4g} early, {means[1]:.4g} in full")
    print("worst cells, over what is allowed:")
    for k in np.argsort([-d / allowed(r[2], r[3]) for d, r in zip(off, found, strict=True)])[:25]:
        mass, number, e, f = found[k]
        print(
            f"  {mass:.5g} kg, L {number:.5g}: {e['regime']} {e['mle']:.5f} ± {e['error']:.1e} "
            f"after {e['revolutions']}{', pushed' if e['pushed'] else ''}; full {f['regime']} "
            f"{f['mle']:.5f} ± {f['error']:.1e}; e {e['eccentricity']:.3f}, {f['eccentricity']:.3f}"
        )


if __name__ == "__main__":
    main()
