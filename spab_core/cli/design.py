"""The commands ``spab design …``: presets, a design file to start from, derived numbers,
coefficients for rotor programs.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from spab_core.cli import options
from spab_core.cli.design_map import add_map_options, design_map
from spab_core.cli.options import Answer, Commands, Parser
from spab_core.common.errors import InputError
from spab_core.common.files import check_output
from spab_core.design.form import bearing_number_of
from spab_core.design.limits import check_point
from spab_core.design.model import Design, save_design
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.coefficients import (
    LEAST_STABLE,
    NAMES,
    Coefficients,
    coefficients,
    coefficients_over_speed,
    impedance,
)
from spab_core.linear_theory.ross_table import (
    FORMATS,
    check_table_output,
    coefficient_table,
    save_table,
)
from spab_core.linear_theory.summary import Derived, derive
from spab_core.maps.stability_map import axis
from spab_core.solver.film import Mesh, parse_mesh

MAX_ROWS = 1000


def add_commands(commands: Commands) -> None:
    """Add ``design`` and its commands to the parser's."""
    text = "designs: presets, files, derived numbers, coefficients for rotor programs"
    subs = options.add_group(commands, "design", text)

    def command(name: str, text: str, run: Callable[[Namespace], Answer]) -> Parser:
        sub = options.add_command(subs, name, text, run, "--design")
        sub.add_argument("--preset", help=f"in place of --design: {', '.join(PRESETS)}")
        return sub

    sub = command(
        "show",
        "what a design means at an operating point: groups, equilibrium, gas flow, stiffness, "
        "whirl",
        _show,
    )
    options.add(sub, "--rotor-mass", required=True)
    sub.add_argument("--rpm", type=options.number, help="shaft speed; or give --bearing-number")
    options.add(sub, "--bearing-number", "--mesh")

    options.add_command(subs, "presets", "the designs that come with spab", _presets)

    sub = options.add_command(subs, "new", "write the design file of a preset, to be changed", _new)
    sub.add_argument("--preset", required=True, help=", ".join(PRESETS))
    sub.add_argument("--out", required=True, metavar="FILE.toml")

    sub = command(
        "coefficients",
        "stiffness and damping at the static equilibrium as a table, as ROSS reads it",
        _coefficients,
    )
    options.add(sub, "--rotor-mass", required=True)
    either = "one number, or START:STOP:COUNT for a table against shaft speed"
    sub.add_argument("--rpm", help=f"shaft speed: {either}")
    sub.add_argument("--bearing-number", help=f"shaft speed as bearing number: {either}")
    sub.add_argument(
        "--whirl",
        default=LEAST_STABLE,
        help="whirl frequency over shaft speed: a number (1: synchronous), START:STOP:COUNT at "
        f"one shaft speed, or {LEAST_STABLE} (left out): at each speed that of the rotor's least "
        "stable whirl, which gives the right limit of stability",
    )
    sub.add_argument(
        "--out", required=True, metavar="FILE", help=f"table; ends in {' or '.join(FORMATS)}"
    )
    options.add(sub, "--mesh")

    sub = command(
        "map",
        "the map of a bearing in minutes: cells solved where regimes are in doubt, the others "
        "predicted",
        lambda args: design_map(args, _design(args)),
    )
    add_map_options(sub)


def _design(args: Namespace) -> Design:
    if args.preset is not None and args.design is not None:
        raise InputError("give either --design or --preset")
    return options.design_of(args) if args.preset is None else preset(args.preset).design


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
    check_output(args.out, "--out")
    save_design(chosen.design, args.out)
    if not args.json:
        print(
            f"{args.out}: {chosen.label}; change its values, then spab design show --design "
            f"{args.out} --rotor-mass {chosen.rotor_mass:g} --rpm {chosen.speed_rpm:g}"
        )
    return {"out": args.out, "preset": chosen.name, "design": _finite(chosen.design)}


def _finite(design: Design) -> dict[str, dict[str, Any]]:
    """Return the design as plain values; an infinite stiffness becomes "inf", for JSON."""
    return {
        part: {key: value if math.isfinite(value) else "inf" for key, value in values.items()}
        for part, values in design.to_dict().items()
    }


def _show(args: Namespace) -> Answer:
    design = _design(args)
    number = bearing_number_of(design, args.bearing_number, args.rpm)
    found = derive(design, args.rotor_mass, number, parse_mesh(args.mesh))
    if not args.json:
        print("\n".join(_lines(found)))
    return found.record() | {"design": _finite(design), "mesh": args.mesh}


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
        return [*lines, d.status[0].upper() + d.status[1:]]
    lines += [
        f"Static equilibrium: eccentricity {d.eccentricity:.4f} of the clearance, attitude angle "
        f"{d.attitude_angle:.1f} deg, thinnest film {1e6 * (d.least_film or 0.0):.2f} µm",
        f"Gas flow through the wall: {d.gas_flow.mass:.3e} kg/s, {d.gas_flow.normal_litres:.3g} "
        "normal litres a minute",
    ]
    for k, name in enumerate(("Static", "Synchronous")):
        values = ", ".join(f"{n} {d.coefficients.column(n)[k]:.4g}" for n in NAMES)
        lines.append(f"{name} coefficients: {values} (N/m, N s/m)")
    if d.whirl:
        lines.append(
            f"Least stable whirl: {d.whirl.speed_rpm:,.0f} rpm, {d.whirl.ratio:.4f} of the "
            f"shaft speed; {'decays' if d.whirl.stable else 'GROWS'} by {abs(d.whirl.growth):.4g} "
            "per revolution (linear)"
        )
    return lines


def _values(text: str, name: str) -> np.ndarray | float:
    """Read a range as an array, or one number."""
    if ":" in text:
        values = axis(text, name)
        if len(values) > MAX_ROWS:
            raise InputError(
                f"{name}: count = {len(values)} is out of range: allowed is from 1 to {MAX_ROWS}"
            )
        return values
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"{name} = {text[:60]!r} is neither a number nor start:stop:count"
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
    design, mesh = _design(args), parse_mesh(args.mesh)
    check_table_output(args.out)
    speeds = _speeds(args, design)
    whirl: np.ndarray | float | str = (
        args.whirl if args.whirl == LEAST_STABLE else _values(args.whirl, "--whirl")
    )
    check_point(args.rotor_mass, float(np.max(speeds)))
    against = "speed" if isinstance(speeds, np.ndarray) else "frequency"
    found = _solve(design, args.rotor_mass, speeds, whirl, mesh)
    table = coefficient_table(found, against)
    save_table(table, args.out)
    if not args.json:
        axis_name = "shaft speed" if against == "speed" else "whirl frequency"
        text = f"{args.out}: {len(table)} rows against {axis_name}, rad/s, N/m, N s/m"
        if found.missing:
            text += f"; {len(found.missing)} speeds left out, which have no static equilibrium"
        print(text)
    return {
        "out": args.out,
        "axis": against,
        "rows": table.to_dict("records"),
        "missing_speeds_rad_s": list(found.missing),
    }


def _solve(
    design: Design,
    rotor_mass: float,
    speeds: np.ndarray | float,
    whirl: np.ndarray | float | str,
    mesh: Mesh,
) -> Coefficients:
    if isinstance(speeds, np.ndarray):
        if isinstance(whirl, np.ndarray):
            raise InputError(
                "a table is against shaft speed or against whirl frequency: give a range to one "
                "of them alone"
            )
        return coefficients_over_speed(design, rotor_mass, speeds, whirl, mesh)
    if not isinstance(whirl, np.ndarray):
        raise InputError(
            "a table needs a range: give START:STOP:COUNT to --rpm, --bearing-number or --whirl"
        )
    z = impedance(design, rotor_mass, speeds, mesh)
    if z is None:
        raise InputError(
            "there is no static equilibrium: the film does not carry this rotor at this speed"
        )
    return coefficients(z, whirl)
