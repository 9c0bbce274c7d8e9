"""Audit of the shipped map: random cells again on a mesh twice as fine in each direction (as far as
meshes go), with half the step, twice as long.

    python benchmarks/audit_map.py [--cells 200] [--workers 2]

Nothing stops early: 600 + 600 revolutions each. A step goes as the fourth root of the
tolerance, so half the step is a sixteenth of it. Finished cells are kept in build/audit (a second
run goes on from them); the table goes to docs/audit.csv."""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import json
import statistics
from pathlib import Path

import joblib
import numpy as np

from spab_core.common.files import write_atomically
from spab_core.shipped.manifest import load_reference_map
from spab_core.solver.cache import solver_hash
from spab_core.solver.film import (
    AUTO,
    MESH_LIMITS,
    MORE_AZIMUTHS,
    Mesh,
    parse_mesh,
    suitable_mesh,
)
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

ROOT = Path(__file__).resolve().parent.parent
SEED = 20261122
NEIGHBOURHOOD = 2  # cells: a disagreement nearer than this to another regime lies at a border


def solve(design, mass, number, settings, folder):
    """One cell as a dictionary, from the folder where it is there already."""
    plan = json.dumps([solver_hash(), design.to_dict(), mass, number, settings.to_dict()])
    path = folder / f"{hashlib.sha256(plan.encode()).hexdigest()[:24]}.json"
    if not path.exists():
        point = solve_point(design, mass, number, settings)
        found = {
            "regime": point.regime.name if point.regime else "",
            "period": point.regime.period if point.regime else 0,
            "mle": point.mle.value if point.mle else None,
            "error": point.mle.standard_error if point.mle else None,
            "status": point.trajectory.status,
            "seconds": point.trajectory.wall_seconds,
        }
        write_atomically(path, json.dumps(found).encode())
    return json.loads(path.read_text())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    m = load_reference_map()
    about = m.metadata
    mesh = parse_mesh(about["mesh"])
    mesh = suitable_mesh(m.design, MORE_AZIMUTHS) if mesh == AUTO else mesh
    most = [limits[1] for limits in MESH_LIMITS]
    settings = Settings(
        Mesh(min(mesh.latitude + 1, most[0]), min(2 * mesh.azimuth, most[1])),
        about["method"],
        2 * about["transient"],
        2 * about["revolutions"],
        about["tolerance"] / 16.0,
        early_stop=False,
    )
    chosen = np.sort(np.random.default_rng(SEED).choice(m.mle.size, options.cells, replace=False))
    cells = [tuple(int(i) for i in np.unravel_index(k, m.shape)) for k in chosen]
    folder = ROOT / "build" / "audit"
    folder.mkdir(parents=True, exist_ok=True)
    jobs = (
        joblib.delayed(solve)(
            m.design, float(m.rotor_mass[c]), float(m.bearing_number[r]), settings, folder
        )
        for r, c in cells
    )
    found = joblib.Parallel(n_jobs=options.workers, verbose=5)(jobs)

    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(
        [
            "bearing_number",
            "rotor_mass_kg",
            "map_regime",
            "map_period",
            "map_mle",
            "map_error",
            "regime",
            "period",
            "mle",
            "error",
            "at_border",
        ]
    )
    same, change, chaos, apart = [], [], [], []
    for (r, c), fine in zip(cells, found, strict=True):
        around = m.regime[
            max(r - NEIGHBOURHOOD, 0) : r + NEIGHBOURHOOD + 1,
            max(c - NEIGHBOURHOOD, 0) : c + NEIGHBOURHOOD + 1,
        ]
        border = bool((around != m.regime[r, c]).any())
        table.writerow(
            [
                f"{m.bearing_number[r]:.6g}",
                f"{m.rotor_mass[c]:.6g}",
                m.regime[r, c],
                m.period[r, c],
                f"{m.mle[r, c]:.6g}",
                f"{m.mle_standard_error[r, c]:.3g}",
                fine["regime"],
                fine["period"],
                f"{fine['mle']:.6g}" if fine["mle"] is not None else "",
                f"{fine['error']:.3g}" if fine["error"] is not None else "",
                int(border),
            ]
        )
        agrees = m.regime[r, c] == fine["regime"]
        same.append(agrees)
        if not agrees:
            apart.append(
                (
                    border,
                    f"  {m.rotor_mass[c]:.2f} kg, L {m.bearing_number[r]:.3f}: "
                    f"{m.cell_text(r, c)}; audit: "
                    f"{fine['regime'] or fine['status']}-{fine['period']}, {fine['mle']}",
                )
            )
        if fine["mle"] is None or not m.regime[r, c]:
            continue
        difference = abs(fine["mle"] - m.mle[r, c])
        if m.regime[r, c] == fine["regime"] == "chaotic":
            chaos.append(difference <= 3.0 * np.hypot(fine["error"], m.mle_standard_error[r, c]))
        elif "chaotic" not in (m.regime[r, c], fine["regime"]):
            change.append(difference)
    write_atomically(ROOT / "docs" / "audit.csv", text.getvalue().encode())
    print(
        f"{len(cells)} cells, seed {SEED}, {settings.mesh}, tolerance {settings.tolerance:.2g}, "
        f"{settings.transient} + "
        f"{settings.revolutions} revolutions; {sum(f['seconds'] for f in found):.0f} s of one core"
    )
    print(f"regime agrees in {sum(same)} of {len(same)} ({100 * np.mean(same):.1f} %)")
    print(
        f"non-chaotic: median |dMLE| {statistics.median(change):.4f}, nine tenths under "
        f"{np.quantile(change, 0.9):.4f} ({len(change)} cells)"
    )
    if chaos:
        print(
            f"chaotic: within 3 combined standard errors {sum(chaos)} of {len(chaos)} "
            f"({100 * np.mean(chaos):.0f} %)"
        )
    print(
        f"of {len(apart)} disagreements {sum(b for b, _ in apart)} lie within {NEIGHBOURHOOD} "
        "cells of another regime:"
    )
    for _, line in apart:
        print(line)


if __name__ == "__main__":
    main()
