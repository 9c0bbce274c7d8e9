"""Is what is called good good? Verdicts of live points beside those of long runs on a finer mesh.

    python benchmarks/verdicts.py [--points 15] [--good 15] [--workers 2]

For the reference bearing and for one that is fed (R 40 mm, C 25 µm, 6 bar gauge): points drawn over
the plane, evenly; of the fed one the machine of 4 kg at 20,000 rpm too. Then more points until as
many are judged good as asked for: of the reference bearing, and of the fed one with pores that
store gas behind a restricted layer, as without them it is outside the theory and so never good.
Each is judged as a live point is; then with a run from rest of
1,000 + 1,000 revolutions on 4 x 32 nodes that does not stop early, and where it is good with one
from a large orbit too. Finished runs are kept in build/verdicts (a second run goes on from them).
Printed: the table of docs/assessment.md."""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path

import joblib
import numpy as np
from drawings import layered

from spab_core import Settings, reference_design, solve_point
from spab_core.common.files import write_atomically
from spab_core.common.units import from_rpm
from spab_core.solver.cache import solver_hash
from spab_core.trajectory.assessment import Motion, grades
from spab_core.trajectory.starts import whirling_start

ROOT = Path(__file__).resolve().parent.parent
SEED = 20261127
LONG = Settings("4x32", transient=1000, revolutions=1000, early_stop=False)
REFERENCE = reference_design()
FED = REFERENCE.replace(
    bearing__radius=0.04, bearing__clearance=25e-6, bearing__supply_pressure_ratio=7.01325 / 1.01325
)
OWN = ((FED.bearing_number(from_rpm(20_000.0)), 4.0),)
# the design, its bearing numbers and masses, points in any case; whether some are drawn over the
# plane, and whether good ones are sought
PLANES = {
    "reference": (REFERENCE, (0.05, 8.5), (0.1, 25.0), (), True, True),
    "fed": (FED, (0.25, 9.0), (0.5, 12.0), OWN, True, False),
    "layered": (layered().design, (0.25, 9.0), (0.5, 12.0), OWN, False, True),
}
TRIES = 2000


def long_motion(design, mass, number, whirling, folder):
    """The motion of a long run, from the folder where it is there already."""
    plan = json.dumps(
        [solver_hash(), design.to_dict(), mass, number, LONG.to_dict(), "whirling" * whirling]
    )
    path = folder / f"{hashlib.sha256(plan.encode()).hexdigest()[:24]}.json"
    if not path.exists():
        start = whirling_start(design, mass, number, LONG.mesh) if whirling else None
        point = solve_point(design, mass, number, LONG, start=start)
        write_atomically(path, json.dumps(point.motion._asdict()).encode())
    return Motion(**json.loads(path.read_text()))


def draw(name, count, good):
    """The first ``count`` points of a plane and the first ``good`` further ones that are judged
    good, solved live.
    """
    design, numbers, masses, given, over, sought = PLANES[name]
    count, good = count * over, good * sought
    rng, found = np.random.default_rng(SEED), 0
    points = [solve_point(design, mass, number) for number, mass in given]
    for _ in range(TRIES):
        if len(points) >= count and found >= good:
            break
        number, mass = (float(rng.uniform(*ends)) for ends in (numbers, masses))
        point = solve_point(design, mass, number)
        if len(points) < count:
            points.append(point)
        elif point.assessment().grade == "good":
            points.append(point)
            found += 1
    return points


def row(name, point, folder):
    """A point's verdict beside those of its long runs."""
    design, mass, number = point.design, point.rotor_mass, point.bearing_number
    judged = point.assessment()
    runs = [long_motion(design, mass, number, False, folder)]
    if judged.grade == "good":
        runs.append(long_motion(design, mass, number, True, folder))
    told = [str(grades(design, motion)) for motion in runs]
    return name, point, judged, runs, told


def words(motion):
    """A long run's motion in a few words."""
    what = motion.regime or motion.status
    what += f" {motion.period}" if motion.regime == "periodic" else ""
    return f"{what}, {motion.max_eccentricity:.3f}, {100.0 * motion.contact_share:.3g} %"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=15)
    parser.add_argument("--good", type=int, default=15)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    folder = ROOT / "build" / "verdicts"
    folder.mkdir(parents=True, exist_ok=True)
    points = [(name, p) for name in PLANES for p in draw(name, options.points, options.good)]
    rows = joblib.Parallel(n_jobs=options.workers)(
        joblib.delayed(row)(name, point, folder) for name, point in points
    )
    print(
        "| bearing | Λ | kg | live | why | long run: motion, largest eccentricity, contact | its "
        "verdict |\n|---|---|---|---|---|---|---|"
    )
    wrong, alike, greens = 0, 0, 0
    for name, point, judged, runs, told in rows:
        own = str(grades(point.design, point.motion))
        alike += own == told[0]
        greens += judged.grade == "good"
        wrong += judged.grade == "good" and set(told) != {"good"}
        print(
            f"| {name} | {point.bearing_number:.3g} | {point.rotor_mass:.3g} | {judged.grade} | "
            f"{judged.reasons[0].split(':')[0] if judged.reasons else ''} | "
            f"{'; from a large orbit: '.join(words(m) for m in runs)} | {', '.join(told)} |"
        )
    print(
        f"{len(rows)} points, {greens} called good, {wrong} of these not good in the long run; the "
        f"motion's own verdict is the same at {alike}"
    )


if __name__ == "__main__":
    main()
