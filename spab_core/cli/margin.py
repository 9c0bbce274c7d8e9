"""The commands of ``spab`` that read a solved map: margin, export."""

from __future__ import annotations

from pathlib import Path

from spab_core.common.errors import InputError
from spab_core.common.files import check_output, write_atomically
from spab_core.common.units import from_rpm
from spab_core.common.validation import check_number
from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.maps.margin import margin
from spab_core.maps.stability_map import load_map
from spab_core.shipped.manifest import load_reference_map


def add_commands(commands, number) -> None:
    """Add the commands to the parser's; ``number`` reads a float."""

    def command(name, text):
        sub = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
        sub.add_argument("--json", action="store_true", help="print one JSON object")
        return sub

    sub = command(
        "margin", "how far an operating point is from the nearest instability and chaos of a map"
    )
    sub.add_argument(
        "--map",
        metavar="FILE.npz",
        help="map file; left out: the shipped map of the reference design",
    )
    sub.add_argument("--rotor-mass", type=number, required=True, help="kg on one bearing")
    speed = sub.add_mutually_exclusive_group(required=True)
    speed.add_argument("--bearing-number", type=number)
    speed.add_argument("--rpm", type=number, help="shaft speed, of the map's design")
    sub.set_defaults(run=_margin)

    sub = command("export", "a map as NetCDF (.nc) or as a table (.csv)")
    sub.add_argument("map", metavar="MAP.npz")
    sub.add_argument("--out", required=True, metavar="FILE.nc|FILE.csv")
    sub.set_defaults(run=_export)


def _margin(args) -> dict:
    m = load_reference_map() if args.map is None else load_map(args.map)
    number = args.bearing_number
    if number is None:
        low, high = (m.design.speed_rpm(b) for b in BEARING_NUMBER_RANGE)
        check_number("--rpm", args.rpm, low, high, "rpm")
        number = m.design.bearing_number(from_rpm(args.rpm))
    found = margin(m, args.rotor_mass, number)
    if not args.json:
        print(
            f"{found.here} at {found.rotor_mass:g} kg and {found.speed_rpm:,.0f} rpm (bearing "
            f"number {number:.4g})"
        )
        print("\n".join([found.headline(), *found.sentences()]))
    return found.record()


def _export(args) -> dict:
    from spab_core.common.files import csv_bytes  # with Plotly: other commands need not wait for it
    from spab_core.reporting.export import map_netcdf, map_table

    writers = {".nc": map_netcdf, ".csv": lambda m: csv_bytes(map_table(m))}
    ending = Path(args.out).suffix.lower()
    if ending not in writers:
        raise InputError(f"--out = {args.out[:200]!r} must end in {' or '.join(writers)}")
    check_output(args.out, "--out")
    data = writers[ending](load_map(args.map))
    write_atomically(args.out, data)
    if not args.json:
        print(f"{args.out}: {len(data) / 1e6:.2f} MB")
    return {"out": args.out, "bytes": len(data)}
