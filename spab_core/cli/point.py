"""The commands for one operating point: simulate, stiffness, whirl-threshold."""

from __future__ import annotations

import csv
import io
import itertools
from argparse import Namespace

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.progress import say_compiling
from spab_core.common.files import check_output, write_atomically
from spab_core.common.words import newtons
from spab_core.design.limits import check_point
from spab_core.linear_theory.conical import conical_thresholds
from spab_core.linear_theory.equilibrium import concentric_stiffness
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.solver.film import parse_mesh
from spab_core.trajectory.assessment import Assessment
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.point_file import path_units, save_point, start_of
from spab_core.trajectory.run import path_table
from spab_core.trajectory.starts import WHIRLING

_ORBIT_REVOLUTIONS = 50


def add_commands(commands: Commands) -> None:
    """Add the commands to the parser's."""
    sub = options.add_command(
        commands,
        "simulate",
        "solve one operating point: regime and maximum Lyapunov exponent",
        _simulate,
    )
    options.add(sub, "--rotor-mass", required=True)
    options.add_speed(sub)
    sub.add_argument(
        "--orbit",
        metavar="FILE.csv",
        help="write the last orbits, 96 points a revolution: tau in radians, X and Y over the "
        "clearance, velocities per radian",
    )
    sub.add_argument(
        "--start",
        metavar="FILE.npz",
        help=f"start from the last state of a point file (--out), or {WHIRLING}: on a large orbit; "
        "default: from rest",
    )
    sub.add_argument("--out", metavar="FILE.npz", help="write the solved point")
    options.add(sub, *options.SOLVER)
    options.add_limits(sub)
    for name, text, run in (
        ("stiffness", "static stiffness of the film about the centre", _stiffness),
        (
            "whirl-threshold",
            "rotor mass at which the static equilibrium changes its linear stability",
            _whirl_threshold,
        ),
    ):
        sub = options.add_command(commands, name, text, run, "--design", "--preset", "--mesh")
        options.add_speed(sub)


def _simulate(args: Namespace) -> Answer:
    settings, design = options.settings_of(args), options.design_of(args)
    limits = options.limits_of(args)
    number = options.bearing_number_at(args, design)
    check_point(args.rotor_mass, number)
    start = None
    if args.start is None:
        settings.check_cold_start()
    else:
        start = start_of(args.start, design, args.rotor_mass, number, settings.mesh)
    if args.out is not None:
        check_output(args.out, "--out", (".npz",))
    if args.orbit is not None:
        check_output(args.orbit, "--orbit", (".csv",))
    say_compiling(settings, design)
    compile_once(settings, design)
    point = solve_point(
        design,
        args.rotor_mass,
        number,
        settings,
        path_revolutions=0 if args.orbit is None else _ORBIT_REVOLUTIONS,
        start=start,
    )
    if args.out is not None:
        save_point(point, args.out)
    if args.orbit is not None:
        write_atomically(args.orbit, _orbit_csv(point))
    record = point.record(limits)
    if not args.json:
        told = filter(None, [point.axial_words(), point.push_words()])
        print("\n".join([*assessment_lines(point.assessment(limits)), *told]))
        if point.mle:
            print(
                f"MLE {point.mle.value:+.4f} ± {point.mle.standard_error:.4f} per revolution at "
                f"{record['speed_rpm']:,.0f} rpm; {extremes_words(point)}; "
                f"{record['revolutions']} revolutions in {record['wall_seconds']:.2f} s"
            )
    return record


def extremes_words(point: OperatingPoint) -> str:
    """Return the largest eccentricity, least film and asperity force of a motion as a clause."""
    return (
        f"largest eccentricity {point.max_eccentricity:.3f} of the clearance, least film "
        f"{1e6 * point.least_film:.2f} µm, largest asperity force "
        f"{newtons(point.peak_contact_force)} N"
    )


def assessment_lines(found: Assessment) -> list[str]:
    """Return a verdict's lines: motion, equilibrium, reasons."""
    return [found.motion, found.rest, *(f"- {reason}" for reason in found.reasons)]


def _orbit_csv(point: OperatingPoint) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = path_table(point.trajectory)
    writer.writerow([*columns, "units"])  # said once, in the first row of a last column
    units = itertools.chain([path_units(point.design)], itertools.repeat(""))
    writer.writerows(
        [f"{t:.6f}", *(f"{v:.8g}" for v in row), next(units)]
        for t, *row in zip(*columns.values(), strict=True)
    )
    return text.getvalue().encode()


def _stiffness(args: Namespace) -> Answer:
    design = options.design_of(args)
    number = options.bearing_number_at(args, design)
    kxx, kxy = concentric_stiffness(design, number, parse_mesh(args.mesh))
    unit = design.stiffness_unit
    if not args.json:
        print(
            f"K_xx = K_yy = {kxx:.5f}, K_yx = -K_xy = {-kxy:.5f} (p_a R² / C); {kxx * unit:.4g} "
            f"and {-kxy * unit:.4g} N/m; F_x = -K_xx X - K_xy Y, F_y = -K_yx X - K_yy Y"
        )
    return {"kxx": kxx, "kyx": -kxy, "kxx_n_per_m": kxx * unit, "kyx_n_per_m": -kxy * unit}


def _whirl_threshold(args: Namespace) -> Answer:
    design = options.design_of(args)
    number = options.bearing_number_at(args, design)
    mesh = parse_mesh(args.mesh)
    found: list[Answer] = [
        {
            "critical_mass_kg": t.critical_mass,
            "critical_mass_number": t.critical_mass_number,
            "whirl_ratio": t.whirl_ratio,
            "stable_side": t.stable_side,
        }
        for t in whirl_thresholds(design, number, mesh)
    ]
    tilting = conical_thresholds(design, number, mesh) if design.rotor.conical else None
    if not args.json:
        for t in found:
            print(
                "stable {stable_side} {critical_mass_kg:.4f} kg (M = {critical_mass_number:.4f}); "
                "{what} at {whirl_ratio:.4f} of the shaft speed".format(
                    what="vibration or drift" if design.rotor.axial_motion else "whirl", **t
                )
            )
        if not found:
            print("no threshold between 0.01 and 100 kg: stable, or unstable, over the whole range")
        for c in tilting or []:
            print(
                f"conical motion, at rest in the middle: stable {c.stable_side} a transverse "
                f"inertia of {c.transverse_inertia:.4g} kg m2 at this ratio of inertias; whirl at "
                f"{c.whirl_ratio:.4f} of the shaft speed"
            )
        if tilting == []:
            print("conical motion, at rest in the middle: no threshold at this ratio of inertias")
    none = dict.fromkeys(("critical_mass_kg", "critical_mass_number", "whirl_ratio", "stable_side"))
    conical = [
        {
            "transverse_inertia_kg_m2": c.transverse_inertia,
            "whirl_ratio": c.whirl_ratio,
            "stable_side": c.stable_side,
        }
        for c in tilting or []
    ]
    return {**(found[0] if found else none), "thresholds": found} | (
        {} if tilting is None else {"conical_thresholds": conical}
    )
