"""Hashes of trajectories to the bit, here and in another checkout, in turns on the same machine.

    git worktree add /tmp/before 6afd9a5 && python benchmarks/golden.py --against /tmp/before

Shows that a change of code keeps every bit, and what it does to the seconds a point takes (least of
the rounds; the first one compiles). Hashes hold on one processor and one version of numba only;
``tests/unit/test_golden.py`` asserts what holds everywhere. ``--write`` makes the values for it."""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
VALUES = HERE / "tests" / "unit" / "golden.json"
_SHORT = {"transient": 40, "revolutions": 40}
# rotor mass in kg, bearing number, settings, changes of the reference design
CASES: list[tuple] = [
    (20.0, 2.0, {}),
    (7.0, 6.0, {}),
    (10.0, 5.0, {}),
    (12.0, 8.0, {}),
    (2.0, 5.0, {}),
    (18.0, 4.5, {}),
    (24.0, 4.0, {}),
    (15.0, 5.0, {}),
    (4.52, 1.4, {}),
    (15.2, 1.5, {}),
    (18.8, 6.55, {}),
    (0.1, 8.5, {}),
    (25.0, 0.05, {}),
    (4.0, 3.0, {}),
    (18.8, 6.55, {"early_stop": False, "transient": 60, "revolutions": 60}),
    (7.0, 6.0, {"mesh": "4x24", **_SHORT}),
    (7.0, 6.0, {"mesh": "5x32", **_SHORT}),
    (7.0, 6.0, {"mesh": "3x24", **_SHORT}),
    (7.0, 6.0, {"mesh": "2x16", "method": "dtm", **_SHORT}),
    (6.0, 2.0, {}, {"rotor__shaft_stiffness": math.inf}),
    # a wide band asks for more latitudes
    (20.0, 1.0, {}, {"bearing__edge_latitude": 70.0}),
    # a swift vibration decides; the journal touches the wall; a short-ranged contact
    (1.0, 0.02, {}, {"bearing__supply_pressure_ratio": 5.0}),
    (25.0, 0.5, {}, {"contact__force_at_closure": 1e-4}),
    (10.0, 3.0, _SHORT, {"contact__roughness": 0.005}),
]
with (HERE / "tests" / "physics" / "honesty_cases.csv").open(encoding="utf-8") as _file:
    for _row in csv.DictReader(_file):
        if _row["case"] in (
            "215",
            "257",
        ):  # one that no steps follow, one solved again on finer ones
            _changes = {k.replace(".", "__"): float(v) for k, v in _row.items() if "." in k}
            _mass, _number = float(_row["rotor_mass"]), float(_row["bearing_number"])
            CASES.append((_mass, _number, {"transient": 60, "revolutions": 40}, _changes))
_CODE = """
import hashlib, json, sys, time
import numpy as np
from spab_core import Settings, reference_design, solve_point
for mass, number, settings, *changes in json.loads(sys.argv[1]):
    design = reference_design().replace(**changes[0] if changes else {})
    began = time.process_time()
    point = solve_point(design, mass, number, Settings(**settings), path_revolutions=2)
    seconds, t = time.process_time() - began, point.trajectory
    arrays = (t.section, t.growth, t.contact, t.peak, t.path, t.final)
    bits = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays))
    print(json.dumps({
        "hash": bits.hexdigest()[:12],
        "seconds": seconds,
        "status": t.status,
        "completed": t.completed,
        "steps": t.steps,
        "regime": point.regime.text if point.regime else None,
        "exponent": point.mle.value if point.mle else None,
        "section": t.section[-point.regime.period:].tolist()
        if point.regime and point.regime.period else [],
    }))
"""


def solve_cases(checkout: Path) -> list[dict]:
    """What :data:`CASES` give with the code of a checkout, in a fresh process."""
    run = subprocess.run(
        [sys.executable, "-c", _CODE, json.dumps(CASES)],
        cwd=checkout,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(checkout)},
    )
    return [json.loads(line) for line in run.stdout.splitlines()]


def write_values(found: list[dict]) -> None:
    """Keep what test_golden.py compares: numbers for periodic orbits, the regime for others."""
    values = []
    for (mass, number, settings, *changes), case in zip(CASES, found, strict=True):
        value = {"rotor_mass": mass, "bearing_number": number, "settings": settings}
        value |= {
            "design": changes[0] if changes else {},
            "status": case["status"],
            "regime": case["regime"],
        }
        if case["section"]:
            value |= {"exponent": case["exponent"], "section": case["section"]}
        values.append(value)
    VALUES.write_text("[\n" + ",\n".join(json.dumps(value) for value in values) + "\n]\n")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--write", action="store_true", help=f"write {VALUES.name}")
    args = parser.parse_args()
    checkouts = [HERE] + ([args.against.resolve()] if args.against else [])
    rounds = [[solve_cases(checkout) for checkout in checkouts] for _ in range(args.rounds)]
    differ = 0
    for (mass, number, *settings), *cases in zip(CASES, *rounds[-1], strict=True):
        hashes = [case["hash"] for case in cases]
        differ += len(set(hashes)) > 1
        told = ", ".join(f"{k} {v}" for changed in settings for k, v in list(changed.items())[:3])
        print(
            f"{mass:g} kg, Lambda {number:g}{', ' if told else ''}{told}: {cases[0]['status']}, "
            f"{cases[0]['regime']}, {cases[0]['completed']} revolutions, {cases[0]['exponent']}, "
            + (" differs from ".join(hashes) if len(set(hashes)) > 1 else hashes[0])
        )
    seconds = [
        sum(min(case["seconds"] for case in cases) for cases in zip(*solved, strict=True))
        for solved in zip(*rounds, strict=True)
    ]
    for checkout, total in zip(checkouts, seconds, strict=True):
        print(f"{checkout}: {total / len(CASES):.3f} s of the processor a point")
    if args.against:
        print(f"ratio: {seconds[1] / seconds[0]:.3f}; {differ} of {len(CASES)} points differ")
    if args.write:
        write_values(rounds[-1][0])
    raise SystemExit(differ > 0)


if __name__ == "__main__":
    main()
