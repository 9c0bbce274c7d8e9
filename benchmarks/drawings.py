"""How long tolerances and a better drawing take: the machine of 4 kg at 20,000 rpm (R 40 mm,
C 25 µm, fed with 6 bar gauge, the rest of the reference).

    python benchmarks/drawings.py tolerance     512 machines: a minute on two cores
    python benchmarks/drawings.py improve       a front: three minutes on two cores

What is improved is that machine with pores that store gas (porosity 0.15) and a restricted layer on
its wall: a fed wall whose storage is left out is to be watched whatever else is drawn.

Tells wall time, processor time, and both over the time of one solved point in the same run.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import resource
import time

from spab_core import reference_design, solve_point
from spab_core.design.tolerances import Machine, parse_range, parse_tolerances
from spab_core.drawings.improve import SCREENED, SOLVED, Improvement, improve
from spab_core.drawings.look import look_at
from spab_core.drawings.tolerance import tolerance_study
from spab_core.trajectory.compiling import compile_once

TOLERANCES = {
    "bearing.clearance": "± 2 µm",
    "bearing.permeability": "± 33 % normal",
    "bearing.supply_pressure_ratio": "± 0.3 bar",
    "rotor.unbalance_eccentricity": "up to 13 µm",
    "speed": "± 2 %",
}
RANGES = {
    "bearing.clearance": "10:40 µm",
    "bearing.supply_pressure_ratio": "2:10 bar",
    "bearing.layer_permeability": "0.005:0.2 10⁻¹⁵ m²",
    "bearing.edge_latitude": "20:45 °",
    "rotor.unbalance_eccentricity": "1:13 µm",
    "rotor.shaft_stiffness": "30:300 N/µm",
}


def machine() -> Machine:
    """The machine of 4 kg."""
    design = reference_design().replace(
        bearing__radius=0.04,
        bearing__clearance=25e-6,
        bearing__supply_pressure_ratio=1.0 + 6e5 / 101325.0,
    )
    return Machine(design, 4.0, 20_000.0)


def layered() -> Machine:
    """That machine with a layer of 0.1 mm on open-pored carbon, which passes about as much gas."""
    bearing = {"porosity": 0.15, "permeability": 1e-13, "layer_thickness": 1e-4}
    design = machine().design.replace(
        bearing__layer_permeability=3.25e-17, **{f"bearing__{k}": v for k, v in bearing.items()}
    )
    return machine()._replace(design=design)


def other_margin(found: Improvement) -> str:
    """The margin in mass before and after, each solved once more."""
    look = dataclasses.replace(found.look, axis="mass")
    told = []
    for m in (found.machine, found.machine_at(found.best)):
        row = look_at(m, look)
        end = row["meets"] or f"nothing up to {look.reach:g} times the mass"
        told.append(f"+{100 * row['margin']:.0f} % ({end})")
    return f"Margin up in mass: before {told[0]}, best {told[1]}."


def processor_seconds() -> float:
    """Of this process and of those it has ended."""
    own, others = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("tolerance", "improve"))
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--machines", type=int, default=512)
    parser.add_argument("--screened", type=int, default=SCREENED)
    parser.add_argument("--solved", type=int, default=SOLVED)
    args = parser.parse_args()
    compile_once()
    m, runs = machine(), 20
    solve_point(m.design, m.rotor_mass, m.bearing_number)
    began = time.process_time()
    for _ in range(runs):
        solve_point(m.design, m.rotor_mass, m.bearing_number)
    point = (time.process_time() - began) / runs
    before, began = processor_seconds(), time.perf_counter()
    if args.what == "tolerance":
        study = tolerance_study(
            m,
            parse_tolerances(TOLERANCES),
            most=args.machines,
            half_width=0.0,
            workers=args.workers,
        )
        solved, points = study.count, int(study.rows["points"].sum())
        told = study.sentences()
    else:
        m = layered()
        found = improve(
            m,
            dict(parse_range(k, v, m) for k, v in RANGES.items()),
            screened=args.screened,
            solved=args.solved,
            workers=args.workers,
        )
        solved, points = found.solved, int(found.rows["points"].sum())
        told = found.sentences()
    wall = time.perf_counter() - began
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor().shutdown(wait=True)  # or its processes' time is not known
    spent = processor_seconds() - before
    print("\n".join(told))
    if args.what == "improve":
        print(found.table().to_string(index=False, float_format="{:.4g}".format))
        if found.best is not None:
            print(other_margin(found))
    print(
        f"{solved} machines, {points:,} points told, {wall:.1f} s on {args.workers} processes, "
        f"{spent:.1f} s of processors: {spent / solved / point:.1f} times one solved point "
        f"({1e3 * point:.1f} ms) a machine"
    )


if __name__ == "__main__":
    main()
