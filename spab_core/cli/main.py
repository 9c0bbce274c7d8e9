"""The command ``spab``: every answer as text for people or, with --json, as one JSON object."""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import sys
from pathlib import Path

from tqdm import tqdm

from spab_core._version import __version__
from spab_core.cli import dashboard as cli_dashboard
from spab_core.cli import design as cli_design
from spab_core.cli import jobs as cli_jobs
from spab_core.cli import margin as cli_margin
from spab_core.cli import models as cli_models
from spab_core.cli import refine as cli_refine
from spab_core.cli import surrogates as cli_surrogates
from spab_core.cli.jobs import kept_when_stopped
from spab_core.common.errors import InputError
from spab_core.common.files import check_output, check_writable, write_atomically
from spab_core.common.validation import check_number
from spab_core.design.limits import BEARING_NUMBER_RANGE, check_point
from spab_core.design.model import load_design, reference_design
from spab_core.linear_theory.equilibrium import concentric_stiffness
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.maps.bifurcation import (
    SWEEPS,
    VARY,
    chaotic_intervals,
    check_line,
    compute_bifurcation,
    save_bifurcation,
)
from spab_core.maps.checkpoints import Checkpoint, remove_checkpoint, run_plan
from spab_core.maps.compute import compute_map
from spab_core.maps.stability_map import axis, check_plane, save_map
from spab_core.solver.film import DEFAULT_MESH, SCHEMES, parse_mesh
from spab_core.solver.stepping import DEFAULT_TOLERANCE, METHODS
from spab_core.trajectory.compiling import compile_once, is_compiled
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.run import path_angle
from spab_core.trajectory.settings import Settings


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence and exits with 2."""

    def error(self, message):
        print(f"{self.prog}: {' '.join(message.split())}", file=sys.stderr)
        raise SystemExit(2)


def _number(text):
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a number") from None


def _whole(text):
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a whole number") from None


def _build_parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="spab",
        description="Rotors on spherical porous gas bearings: regimes, exponents, stability maps.",
    )
    parser.add_argument("--version", action="version", version=f"spab {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=_Parser)

    def command(name, text):
        sub = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
        sub.add_argument(
            "--design", metavar="FILE.toml", help="design file; left out: the reference design"
        )
        sub.add_argument(
            "--mesh",
            default=str(DEFAULT_MESH),
            help="latitudes x azimuths of the half band, such as 4x48",
        )
        sub.add_argument("--json", action="store_true", help="print one JSON object")
        return sub

    def run_options(sub, revolutions):
        sub.add_argument(
            "--transient", type=_whole, default=300, help="revolutions before the measurement"
        )
        sub.add_argument(
            "--revolutions", type=_whole, default=revolutions, help="revolutions measured"
        )
        sub.add_argument(
            "--method", default="rodas", help=f"time integrator: {' or '.join(METHODS)}"
        )
        sub.add_argument(
            "--scheme", default="fitted", help=f"film differences: {' or '.join(SCHEMES)}"
        )
        sub.add_argument(
            "--tolerance",
            type=_number,
            default=DEFAULT_TOLERANCE,
            help="largest error estimate of a step",
        )
        sub.add_argument(
            "--full-length",
            action="store_true",
            help="integrate all revolutions: do not stop on a settled periodic orbit, nor leave "
            "an unstable one",
        )

    sub = command("simulate", "solve one operating point: regime and maximum Lyapunov exponent")
    sub.add_argument("--rotor-mass", type=_number, required=True, help="kg on one bearing")
    sub.add_argument("--bearing-number", type=_number, required=True)
    sub.add_argument(
        "--orbit", metavar="FILE.csv", help="write the last orbits, 96 points a revolution"
    )
    run_options(sub, 400)
    sub.set_defaults(run=_simulate)

    sub = command("stiffness", "static stiffness of the film about the centre")
    sub.add_argument("--bearing-number", type=_number, required=True)
    sub.set_defaults(run=_stiffness)

    sub = command(
        "whirl-threshold", "rotor mass at which the static equilibrium changes its linear stability"
    )
    sub.add_argument("--bearing-number", type=_number, required=True)
    sub.set_defaults(run=_whirl_threshold)

    sub = command("map", "solve a plane of operating points")
    sub.add_argument("--bearing-number", required=True, metavar="START:STOP:COUNT")
    sub.add_argument(
        "--rotor-mass", required=True, metavar="START:STOP:COUNT", help="kg on one bearing"
    )
    sub.add_argument("--out", required=True, metavar="FILE.npz")
    sub.add_argument("--workers", type=_whole, default=1, help="processes")
    sub.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster, such as tcp://host:8786, to solve there",
    )
    run_options(sub, 300)
    sub.set_defaults(run=_map)

    sub = command("bifurcation", "Poincaré sections and exponents along a line of operating points")
    sub.add_argument("--vary", required=True, help=" or ".join(VARY))
    sub.add_argument(
        "--at",
        type=_number,
        required=True,
        help="the other one's value: bearing number, or rotor mass in kg",
    )
    sub.add_argument("--range", required=True, metavar="START:STOP:COUNT")
    sub.add_argument("--out", required=True, metavar="FILE.npz")
    sub.add_argument(
        "--sweeps",
        default=",".join(SWEEPS),
        help="cold (every point from rest), up, down (state carried on)",
    )
    sub.add_argument("--workers", type=_whole, default=1, help="processes")
    run_options(sub, 300)
    sub.set_defaults(run=_bifurcation)
    cli_surrogates.add_commands(commands, _number, _whole)
    cli_refine.add_command(command, run_options, _whole, (_design, _settings, _say_compiling))
    cli_models.add_commands(commands, _whole)
    cli_jobs.add_commands(commands)
    cli_design.add_commands(commands, _number, _whole)
    cli_dashboard.add_command(commands, _whole)
    cli_margin.add_commands(commands, _number)
    return parser


def _settings(args) -> Settings:
    return Settings(
        args.mesh,
        args.method,
        args.transient,
        args.revolutions,
        args.tolerance,
        args.scheme,
        not args.full_length,
    )


def _design(args):
    return load_design(args.design) if args.design is not None else reference_design()


def _say_compiling():
    if not is_compiled():
        print(
            "spab: compiling the kernels, once on this machine (about 20 s)",
            file=sys.stderr,
            flush=True,
        )


_ORBIT_REVOLUTIONS = 50


def _simulate(args) -> dict:
    settings, design = _settings(args), _design(args)
    check_point(args.rotor_mass, args.bearing_number)
    if args.orbit is not None:
        check_output(args.orbit, "--orbit")
    _say_compiling()
    compile_once()
    point = solve_point(
        design,
        args.rotor_mass,
        args.bearing_number,
        settings,
        path_revolutions=0 if args.orbit is None else _ORBIT_REVOLUTIONS,
    )
    if args.orbit is not None:
        text = io.StringIO()
        writer = csv.writer(text)
        writer.writerow(["tau", "X2", "Y2", "X1", "Y1", "X2_dot", "Y2_dot", "X1_dot", "Y1_dot"])
        states = point.trajectory.path.reshape(-1, 8)
        writer.writerows(
            [f"{t:.6f}", *(f"{v:.8g}" for v in row)]
            for t, row in zip(path_angle(point.trajectory), states, strict=True)
        )
        write_atomically(args.orbit, text.getvalue().encode())
    record = point.record()
    if not args.json:
        print(point.verdict())
        if point.mle:
            print(
                f"MLE {point.mle.value:+.4f} ± {point.mle.standard_error:.4f} per revolution at "
                f"{record['speed_rpm']:,.0f} rpm; largest eccentricity "
                f"{record['max_eccentricity']:.3f} of the clearance; "
                f"{record['revolutions']} revolutions in {record['wall_seconds']:.2f} s"
            )
    return record


def _stiffness(args) -> dict:
    design = _design(args)
    check_number("bearing number", args.bearing_number, *BEARING_NUMBER_RANGE)
    kxx, kyx = concentric_stiffness(design, args.bearing_number, parse_mesh(args.mesh))
    unit = design.stiffness_unit
    if not args.json:
        print(
            f"K_xx = {kxx:.5f}, K_yx = {kyx:.5f} (p_a R² / C); {kxx * unit:.4g} and "
            f"{kyx * unit:.4g} N/m"
        )
    return {"kxx": kxx, "kyx": kyx, "kxx_n_per_m": kxx * unit, "kyx_n_per_m": kyx * unit}


def _whirl_threshold(args) -> dict:
    check_number("bearing number", args.bearing_number, *BEARING_NUMBER_RANGE)
    found = whirl_thresholds(_design(args), args.bearing_number, parse_mesh(args.mesh))
    if not args.json:
        for t in found:
            print(
                f"stable {t.stable_side} {t.critical_mass:.4f} kg (M = "
                f"{t.critical_mass_number:.4f}); "
                f"whirl at {t.whirl_ratio:.4f} of the shaft speed"
            )
        if not found:
            print("no threshold between 0.01 and 100 kg: stable, or unstable, over the whole range")
    first = found[0] if found else None
    return {
        "critical_mass_kg": first.critical_mass if first else None,
        "critical_mass_number": first.critical_mass_number if first else None,
        "whirl_ratio": first.whirl_ratio if first else None,
        "stable_side": first.stable_side if first else None,
        "thresholds": [
            {
                "critical_mass_kg": t.critical_mass,
                "critical_mass_number": t.critical_mass_number,
                "whirl_ratio": t.whirl_ratio,
                "stable_side": t.stable_side,
            }
            for t in found
        ],
    }


def _map(args) -> dict:
    bearing_number, rotor_mass = (
        axis(args.bearing_number, "--bearing-number"),
        axis(args.rotor_mass, "--rotor-mass"),
    )
    cells = check_plane(bearing_number, rotor_mass)
    check_number("--workers", args.workers, 1, 1024)
    settings, design = _settings(args), _design(args)
    check_output(args.out, "--out")
    parts = Path(f"{args.out}.parts")
    Checkpoint(parts, run_plan(design, bearing_number, rotor_mass, settings), {}).open()
    _say_compiling()
    with (
        tqdm(total=cells, unit="cell", smoothing=0.05) as bar,
        kept_when_stopped(bar, parts, "finished chunks"),
    ):
        result = compute_map(
            design,
            bearing_number,
            rotor_mass,
            settings,
            workers=args.workers,
            cluster=args.dask,
            checkpoint=parts,
            progress=bar.update,
        )
        save_map(result, args.out)
    remove_checkpoint(parts)
    names, counts = _count(result)
    if not args.json:
        print(f"{args.out}: " + ", ".join(f"{n} {c}" for n, c in zip(names, counts, strict=True)))
    return {
        "out": args.out,
        "cells": int(result.mle.size),
        "regimes": dict(zip(names, counts, strict=True)),
        "wall_seconds": result.metadata["wall_seconds"],
    }


def _bifurcation(args) -> dict:
    values = axis(args.range, "--range")
    check_number("--workers", args.workers, 1, 1024)
    settings, design = _settings(args), _design(args)
    check_output(args.out, "--out")
    sweeps = args.sweeps.split(",")
    check_line(args.vary, args.at, values, sweeps)
    parts = Path(f"{args.out}.parts")
    _say_compiling()
    with (
        tqdm(total=len(values) * len(sweeps), unit="point", smoothing=0.05) as bar,
        kept_when_stopped(bar, parts, "finished points"),
    ):
        result = compute_bifurcation(
            design,
            args.vary,
            args.at,
            values,
            settings,
            sweeps=sweeps,
            workers=args.workers,
            checkpoint=parts,
            progress=bar.update,
        )
        save_bifurcation(result, args.out)
    remove_checkpoint(parts)
    intervals = {
        name: chaotic_intervals(values, branch.regime) for name, branch in result.branches.items()
    }
    if not args.json:
        for name, found in intervals.items():
            text = ", ".join(f"{a:g}" if a == b else f"{a:g} to {b:g}" for a, b in found)
            print(
                f"{args.out}: {name}: chaotic at {args.vary} {text}"
                if found
                else f"{args.out}: {name}: nowhere chaotic"
            )
    return {"out": args.out, "points": len(values), "chaotic_intervals": intervals}


def _count(result):
    labels = [
        r or s
        for r, s in zip(result.regime.ravel().tolist(), result.status.ravel().tolist(), strict=True)
    ]
    names = sorted(set(labels))
    return names, [labels.count(n) for n in names]


_OUTPUTS = ("out", "map_out", "orbit")  # options that name a file to write


def main(argv: list[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0, 1 where ``spab verify`` finds something
    wrong, or 2 for bad input.
    """
    with contextlib.suppress(AttributeError):  # a file name may hold what the terminal cannot show
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    parser = _build_parser()
    args = parser.parse_args(argv)
    for name, value in vars(args).items():
        if value == []:  # what argparse of Python 3.11 makes of --name=--
            parser.error(f"--{name.replace('_', '-')} = '--' is not allowed")
    try:
        for name in _OUTPUTS:
            if getattr(args, name, None):
                check_writable(
                    Path(getattr(args, name)).parent,
                    f"--{name.replace('_', '-')} = {getattr(args, name)[:200]!r}",
                )
        answer = args.run(args)
    except InputError as error:
        print(f"spab {args.command}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("spab: stopped", file=sys.stderr)
        return 130
    except OSError as error:
        # no name: the disk was full while a file was written, which then is not there; the one
        # before it stays
        where = error.filename or "a file could not be written"
        print(f"spab {args.command}: {where}: {error.strerror or error}", file=sys.stderr)
        return 2
    if args.json:
        print(json.dumps(answer, allow_nan=False))
    return 1 if answer.get("passed") is False else 0


if __name__ == "__main__":
    raise SystemExit(main())
