"""The commands ``spab design …``: presets, a design file to start from, derived numbers,
coefficients for rotor programs.
"""

from __future__ import annotations

import math
import shlex
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from spab_core.cli import drawings, options
from spab_core.cli.design_map import add_map_options, design_map
from spab_core.cli.options import Answer, Commands, Parser
from spab_core.cli.point import assessment_lines, extremes_words
from spab_core.cli.progress import say_compiling
from spab_core.common.errors import InputError
from spab_core.common.files import check_output
from spab_core.common.validation import check_number
from spab_core.common.words import capital
from spab_core.design.form import bearing_number_of
from spab_core.design.limits import check_point
from spab_core.design.model import Design, save_design
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.coefficients import (
    FILM_WHIRL,
    FREQUENCIES,
    NAMES,
    WHIRL_RANGE,
    Coefficients,
    coefficients_over_speed,
    coefficients_over_speed_and_frequency,
    coefficients_over_whirl,
)
from spab_core.linear_theory.ross_table import (
    check_table_output,
    check_workbook,
    coefficient_notes,
    coefficient_table,
    coefficient_warnings,
    save_table,
)
from spab_core.linear_theory.summary import Derived, derive
from spab_core.solver.film import Mesh, parse_mesh
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

MAX_ROWS = 1000
_OF_MOTION = (  # what `spab design show` tells of the motion with unbalance
    "regime",
    "period",
    "contact_share",
    "thin_film_share",
    "peak_contact_force_n",
    "max_eccentricity",
    "orbit_amplitude",
    "coexisting",
)


def add_commands(commands: Commands) -> None:
    """Add ``design`` and its commands to the parser's."""
    text = "designs: presets, files, derived numbers, coefficients for rotor programs"
    subs = options.add_group(commands, "design", text)

    def command(name: str, text: str, run: Callable[[Namespace], Answer]) -> Parser:
        return options.add_command(subs, name, text, run, "--design", "--preset")

    sub = command(
        "show",
        "what a design means at an operating point: groups, equilibrium, gas flow, stiffness, "
        "whirl",
        _show,
    )
    options.add(sub, "--rotor-mass", required=True)
    options.add(sub, "--rpm", "--bearing-number", "--mesh")
    options.add_limits(sub)

    options.add_command(subs, "presets", "the designs that come with spab", _presets)

    sub = options.add_command(subs, "new", "write the design file of a preset, to be changed", _new)
    sub.add_argument("--preset", required=True, help=", ".join(PRESETS))
    sub.add_argument("--out", required=True, metavar="FILE.toml")
    sub.add_argument("--force", action="store_true", help="replace a file that is there")

    sub = command(
        "coefficients",
        "stiffness and damping at the static equilibrium as a table that ROSS reads",
        _coefficients,
    )
    options.add(sub, "--rotor-mass", required=True)
    either = "one number, or START:STOP:COUNT for a table against shaft speed"
    sub.add_argument("--rpm", help=f"shaft speed: {either}")
    sub.add_argument("--bearing-number", help=f"shaft speed as bearing number: {either}")
    sub.add_argument(
        "--whirl",
        help="default: a table over shaft speed and whirl frequency, for every mode (an .xlsx, "
        f"which ROSS reads as one over speed alone: {FILM_WHIRL}); or the whirl frequency over "
        f"shaft speed: {FILM_WHIRL}, at each speed that of the film's whirl, followed by "
        "continuity, for the limit of stability; a number (1: synchronous, for unbalance); "
        "START:STOP:COUNT at one shaft speed, or over a range of them, there over the highest",
    )
    sub.add_argument(
        "--out",
        required=True,
        metavar="FILE",
        help="table; ends in .json (read by ross.BearingElement.load), .xlsx (by "
        "ross.BearingElement.from_table; over speed alone) or .csv",
    )
    options.add(sub, "--mesh")

    sub = command(
        "map",
        "the map of a bearing in minutes: cells solved where regimes are in doubt, the others "
        "predicted",
        lambda args: design_map(args, options.design_of(args)),
    )
    add_map_options(sub)

    sub = command(
        "tolerance",
        "what the tolerances of a drawing mean: machines drawn within them, solved and judged",
        lambda args: drawings.design_tolerance(args, options.design_of(args)),
    )
    drawings.add_tolerance_options(sub)

    sub = command(
        "improve",
        "better drawings: what may move, what must hold, what is wanted; a front, all solved",
        lambda args: drawings.design_improve(args, options.design_of(args)),
    )
    drawings.add_improve_options(sub)


def _presets(args: Namespace) -> Answer:
    rows = [
        {
            "name": p.name,
            "label": p.label,
            "text": p.text,
            "rotor_mass_kg": p.rotor_mass,
            "speed_rpm": p.speed_rpm,
            "bearing_number": bearing_number_of(p.design, None, p.speed_rpm),
        }
        for p in PRESETS.values()
    ]
    if not args.json:
        for row in rows:
            print(
                f"{row['name']:18s} {row['label']}: {row['text']}; start with "
                f"{row['rotor_mass_kg']:g} kg, {row['speed_rpm']:,.0f} rpm"
            )
    return {"presets": rows}


def _new(args: Namespace) -> Answer:
    chosen = preset(args.preset)
    check_output(args.out, "--out", (".toml",))
    options.check_new(args.out, "--out", args.force)
    save_design(chosen.design, args.out)
    if not args.json:
        print(
            f"{args.out}: {chosen.label}; change its values, then spab design show --design "
            f"{shlex.quote(args.out)} --rotor-mass {chosen.rotor_mass:g} --rpm {chosen.speed_rpm:g}"
        )
    return {"out": args.out, "preset": chosen.name, "design": _finite(chosen.design)}


def _finite(design: Design) -> dict[str, dict[str, Any]]:
    """Return the design as plain values; an infinite stiffness becomes "inf", for JSON."""
    return {
        part: {key: "inf" if value == math.inf else value for key, value in values.items()}
        for part, values in design.to_dict().items()
    }


def _show(args: Namespace) -> Answer:
    design, limits, mesh = options.design_of(args), options.limits_of(args), parse_mesh(args.mesh)
    number = bearing_number_of(design, args.bearing_number, args.rpm)
    settings = Settings(mesh, revolutions=300)
    found = derive(design, args.rotor_mass, number, mesh)
    say_compiling(settings, design)
    compile_once(settings, design)
    point = solve_point(design, args.rotor_mass, number, settings)
    judged, motion = point.assessment(limits, rest=found), point.record(limits)
    if not args.json:
        moves = [f"Motion with unbalance: {extremes_words(point)}"] if point.mle else []
        print("\n".join([*_lines(found), *moves, *assessment_lines(judged)]))
    return (
        found.record()
        | {name: motion[name] for name in _OF_MOTION}
        | {
            "assessment": judged.grade,
            "assessment_reasons": list(judged.reasons),
            "motion_least_film_m": motion["least_film_m"],
            "motion_status": motion["status"],
            "design": _finite(design),
            "mesh": args.mesh,
        }
    )


def _lines(d: Derived) -> list[str]:
    """Return the derived numbers as lines of text."""
    lines = [
        f"Operating point: {d.rotor_mass:g} kg on one bearing at {d.speed_rpm:,.0f} rpm "
        f"({d.speed:.1f} rad/s)",
        f"Groups: Lambda {d.bearing_number:.4g}, M {d.mass_number:.4g}, K "
        f"{d.shaft_stiffness_number:.4g}, beta {d.feeding_number:.4g}, W {d.load_number:.4g}, "
        f"rho {d.unbalance_number:.4g}",
        f"Unbalance: balance quality G {d.balance_grade:.3g} mm/s at this speed",
    ]
    if d.gas_flow is None or d.coefficients is None:
        return [*lines, capital(d.status)]
    if d.lies_on_wall:
        words = d.lift_words()
        lines.append(capital(words) + ": what follows is the wall's more than the film's")
    angle = "" if d.attitude_angle is None else f"attitude angle {d.attitude_angle:.1f} deg, "
    lines += [
        f"Static equilibrium: eccentricity {d.eccentricity:.4f} of the clearance, {angle}least "
        f"film {1e6 * (d.least_film or 0.0):.2f} µm",
        *(
            []
            if d.axial_stiffness is None
            else [
                f"Along the axis: displaced by {d.axial_offset:.4f} of the clearance, static "
                f"stiffness {d.axial_stiffness:.4g} N/m"
            ]
        ),
        f"Gas flow through the wall: {d.gas_flow.mass:.3e} kg/s, {d.gas_flow.words} "
        "normal litres per minute",
    ]
    for k, name in enumerate(("Static", "Synchronous")):
        values = ", ".join(f"{n} {d.coefficients.column(n)[k]:.4g}" for n in NAMES)
        lines.append(f"{name} coefficients: {values} (N/m, N s/m)")
    for name, whirl in d.families:
        if whirl:
            lines.append(
                f"Least stable {name}: {whirl.speed_rpm:,.0f} rpm, {whirl.ratio:.4f} of the shaft "
                f"speed; {'decays' if whirl.stable else 'GROWS'} by {abs(whirl.growth):.4g} per "
                "revolution (linear)"
            )
    if d.penetration_depth is not None:
        lines.append(
            f"Wall: sigma_w {d.sigma_wall:.4g}, gas in the pores {d.pore_gas_ratio:.3g} times the "
            f"film's, pressure waves of the whirl reach {1e3 * d.penetration_depth:.2f} mm deep"
        )
        lines += filter(None, [d.wall_words()])
    return lines + d.broken()


def _values(text: str, name: str, nor: str = "") -> np.ndarray | float:
    """Read a range as an array, or one number; ``nor`` names in the refusal what else there is."""
    if ":" in text:
        values = options.values_of(text, name)
        if len(values) > MAX_ROWS:
            raise InputError(
                f"{name}: count = {len(values)} is out of range: allowed is from 1 to {MAX_ROWS}"
            )
        return values
    try:
        return options.speed(text) if name == "--rpm" else options.number(text)
    except ArgumentTypeError as error:
        told = str(error).partition(":")[2]
        if " two ways" in str(error):
            raise InputError(f"{name} = {error}") from None
        raise InputError(
            f"{name} = {text[:60]!r} is neither a number nor start:stop:count{nor}"
            f"{told and f':{told}'}"
        ) from None


def _speeds(args: Namespace, design: Design) -> np.ndarray | float:
    """Return the bearing numbers of --rpm or --bearing-number, checked."""
    if (args.rpm is None) == (args.bearing_number is None):
        raise InputError("give either --bearing-number or --rpm")
    if args.rpm is not None:
        given = _values(args.rpm, "--rpm")
        number_of = partial(bearing_number_of, design, None)
    else:
        given = _values(args.bearing_number, "--bearing-number")
        number_of = partial(bearing_number_of, design, speed_rpm=None)
    if isinstance(given, np.ndarray):
        return np.array([number_of(float(v)) for v in given])
    return number_of(given)


def _coefficients(args: Namespace) -> Answer:
    design, mesh = options.design_of(args), parse_mesh(args.mesh)
    check_table_output(args.out)
    speeds, workbook = _speeds(args, design), args.out.lower().endswith(".xlsx")
    whirl: np.ndarray | float | str | None = args.whirl
    if whirl is None and workbook:
        whirl = FILM_WHIRL
    elif whirl is not None and whirl != FILM_WHIRL:
        whirl = _values(args.whirl, "--whirl", f", nor {FILM_WHIRL}")
    if workbook and isinstance(whirl, np.ndarray):
        both = isinstance(speeds, np.ndarray)
        check_workbook("speed and frequency" if both else "frequency")
    check_point(args.rotor_mass, float(np.max(speeds)))
    found = _solve(design, args.rotor_mass, speeds, whirl, mesh)
    save_table(found, args.out)
    if not args.json:
        print("\n".join(_table_lines(args.out, found)))
    table = coefficient_table(found)
    return {
        "out": args.out,
        "axis": found.axis,
        "rows": table.to_dict("records"),
        "missing_speeds_rad_s": list(found.missing),
        "notes": coefficient_notes(found),
    }


def _table_lines(out: str, found: Coefficients) -> list[str]:
    """Return what was written as lines of text."""
    rows = f"{len(found.speed)} rows over {found.axis}, rad/s, N/m, N s/m"
    lines = [f"{out}: {rows}; F_x = -kxx x - kxy y, F_y = -kyx x - kyy y"]
    if found.modes:
        first, last = found.modes[0], found.modes[-1]
        lines.append(
            f"Mode followed: {last.name}, from {first.ratio:.4g} of the speed, logarithmic "
            f"decrement {first.log_decrement:.4g}, at the first to {last.ratio:.4g}, "
            f"{last.log_decrement:.4g} at the last"
        )
    return lines + coefficient_warnings(found)


def _frequencies(design: Design, speeds: np.ndarray, whirl: np.ndarray) -> np.ndarray:
    """Return the whirl frequencies in rad/s of a table over both: --whirl times the highest speed,
    the same at each speed, as a table must have them.
    """
    rows = len(speeds) * len(whirl)
    if rows > MAX_ROWS * FREQUENCIES:
        raise InputError(
            f"--rpm and --whirl: {len(speeds):,} speeds times {len(whirl):,} frequencies are "
            f"{rows:,} rows: allowed are at most {MAX_ROWS * FREQUENCIES:,}"
        )
    slow, fast = float(np.min(speeds)), float(np.max(speeds))
    for value in whirl[[0, -1]]:  # over the lowest speed it is the largest ratio
        check_number("whirl ratio", float(value), WHIRL_RANGE[0], WHIRL_RANGE[1] * slow / fast)
    return np.asarray(whirl * design.speed(fast))


def _solve(
    design: Design,
    rotor_mass: float,
    speeds: np.ndarray | float,
    whirl: np.ndarray | float | str | None,
    mesh: Mesh,
) -> Coefficients:
    if isinstance(speeds, np.ndarray):
        if isinstance(whirl, np.ndarray):
            frequencies = _frequencies(design, speeds, whirl)
            return coefficients_over_speed_and_frequency(
                design, rotor_mass, speeds, frequencies, mesh
            )
        if whirl is None:
            return coefficients_over_speed_and_frequency(design, rotor_mass, speeds, mesh=mesh)
        return coefficients_over_speed(design, rotor_mass, speeds, whirl, mesh)
    if not isinstance(whirl, np.ndarray):
        raise InputError(
            "a table needs a range: give START:STOP:COUNT to --rpm, --bearing-number or --whirl"
        )
    return coefficients_over_whirl(design, rotor_mass, speeds, whirl, mesh)
