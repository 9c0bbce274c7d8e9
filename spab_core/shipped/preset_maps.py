"""Maps of the presets, shipped as examples: of each a small plane with a coarse start and refined
cells, by the engine of ``spab design map``.

    python -m spab_core.shipped.preset_maps            # solve what is missing or stale; goes on
    python -m spab_core.shipped.preset_maps --table    # what each map says, in numbers
    python -m spab_core.shipped.preset_maps --restamp  # the solver's code changed, its answers not
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from spab_core.active_learning.quick_map import (
    SECONDS_RANGE,
    SETTINGS,
    as_map,
    axis_around,
    quick_map,
)
from spab_core.active_learning.refine import Refinement, last, load_refinement, save_refinement
from spab_core.common.errors import InputError
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.design.presets import PRESETS, Preset
from spab_core.maps.checkpoints import remove_checkpoint
from spab_core.maps.stability_map import StabilityMap, axis
from spab_core.shipped.manifest import (
    ARTIFACTS,
    ArtifactError,
    checked_path,
    read_manifest,
    write_manifest,
)
from spab_core.shipped.provenance import design_hash, difference
from spab_core.solver.cache import code_hash
from spab_core.trajectory.assessment import GRADES
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

COUNTS = 64, 80  # bearing numbers, rotor masses of a plane
CELLS = 256  # solved of each
PROVEN = 3  # cells of each that are solved again before a map is stamped anew
SHARES = 0.5, 1.0, 1.5, 2.0  # of a preset's speed, whose limits of mass are told
NEAR = 1e-6  # per revolution, of a settled exponent on another processor
AGAIN = "`make preset-maps` solves it again"


@dataclass(frozen=True)
class PresetMap:
    """A shipped map.

    Attributes
    ----------
    preset : Preset
        Whose design, mass and speed it is made around.
    changes : dict
        Of the preset's design, as for ``Design.replace``.
    suffix, wall : str
        Of the file's name, and of the label, where the design is changed.
    """

    preset: Preset
    changes: dict[str, Any] = field(default_factory=dict)
    suffix: str = ""
    wall: str = ""

    @property
    def file(self) -> str:
        """Its name in the folder of shipped files."""
        return f"map_{self.preset.name}{self.suffix}.npz"

    @property
    def label(self) -> str:
        """What it is of."""
        return self.preset.label + self.wall

    @property
    def family(self) -> str:
        """The bearing, whatever its wall."""
        return self.preset.name.removesuffix("_layered")

    @property
    def design(self) -> Design:
        """The design that it is of."""
        return self.preset.design.replace(**self.changes)

    def axes(self) -> tuple[str, str]:
        """Return bearing numbers and rotor masses as start:stop:count."""
        number = self.design.bearing_number(self.preset.speed_rpm * np.pi / 30.0)
        return (
            axis_around(float(number), BEARING_NUMBER_RANGE, COUNTS[0]),
            axis_around(self.preset.rotor_mass, ROTOR_MASS_RANGE, COUNTS[1]),
        )

    def command(self, cells: int = CELLS) -> str:
        """Return the command that solves the same cells."""
        number, mass = self.axes()
        design = "--design my.toml" if self.changes else f"--preset {self.preset.name}"
        return (
            f"spab design map {design} --bearing-number {number} --rotor-mass {mass} "
            f"--minutes 60 --cells {cells} --out {self.file}"
        )

    def stamp(self) -> dict[str, str]:
        """Return what it depends on: hashes of the design and of the solver's code."""
        return {"design": design_hash(self.design), "solver": code_hash()}


REFERENCE = "spab60"  # which has the large map
MAPS = tuple(
    found
    for name, one in PRESETS.items()
    if name != REFERENCE
    for found in (
        PresetMap(one),
        *(
            [PresetMap(one, {"bearing__porosity": 0.0}, "_quasi_steady", ", quasi-steady wall")]
            if name == "fed_spindle"
            else []
        ),
    )
)


def map_of_design(design: Design) -> PresetMap | None:
    """Return the shipped map of a design; None where there is none."""
    return next((one for one in MAPS if one.design == design), None)


def others(one: PresetMap) -> list[PresetMap]:
    """Return the maps of the same bearing with other walls."""
    return [m for m in MAPS if m.family == one.family and m != one]


def stale(one: PresetMap, folder: Path = ARTIFACTS) -> str | None:
    """Return why a map is not to be shown, as a clause; None where it is.

    Raises ``ArtifactError`` where it is missing, or not the file that the manifest names.
    """
    checked_path(one.file, folder)
    return difference(read_manifest(folder)[one.file].get("made_from"), one.stamp())


def load_preset_map(one: PresetMap, folder: Path = ARTIFACTS) -> Refinement:
    """Read a shipped map.

    Raises
    ------
    ArtifactError
        If it is missing or damaged, or was made for another design or by another solver.
    """
    if apart := stale(one, folder):
        raise ArtifactError(f"the shipped map {one.file} is not shown: {apart}; {AGAIN}")
    found = load_refinement(folder / one.file)
    if Design.from_dict(found.metadata["design"]) != one.design:
        raise ArtifactError(f"the shipped map {one.file} is of another design; {AGAIN}")
    return found


def solve_map(one: PresetMap, folder: Path = ARTIFACTS, cells: int = CELLS) -> Refinement:
    """Solve a map and write it; an interrupted run goes on from its cells."""
    number, mass = one.axes()
    parts = folder / f".{one.file}.parts"
    found = last(
        quick_map(
            one.design,
            axis(number, "bearing number"),
            axis(mass, "rotor mass"),
            seconds=SECONDS_RANGE[1],
            most=cells,
            checkpoint=parts,
        )
    )
    save_refinement(found, folder / one.file)
    remove_checkpoint(parts)
    return found


def update(folder: Path = ARTIFACTS) -> Iterator[str]:
    """Solve the maps that are missing or stale, and stamp each; yield a line each."""
    for one in MAPS:
        try:
            apart = stale(one, folder)
        except ArtifactError as error:
            apart = str(error)
        if apart:
            solve_map(one, folder)
            write_manifest(folder, {one.file: one.stamp()})
        yield f"{one.file}: {'solved' if apart else 'as it was'}"


def restamp(folder: Path = ARTIFACTS) -> Iterator[str]:
    """Note the present solver with the maps whose solver changed, after some cells of each have
    been solved again and come out the same; yield a line each.

    Raises
    ------
    ArtifactError
        If a cell comes out otherwise, or a map is of another design.
    """
    for one in MAPS:
        apart = stale(one, folder)
        if not apart:
            yield f"{one.file}: as it was"
            continue
        noted = read_manifest(folder)[one.file].get("made_from")
        if difference(noted, {"design": one.stamp()["design"]}):
            raise ArtifactError(f"{one.file}: {apart}; {AGAIN}")
        same = prove(one, load_refinement(folder / one.file))
        write_manifest(folder, {one.file: one.stamp()})
        yield f"{one.file}: {PROVEN} cells come out the same, {same} of them to the bit"


def prove(one: PresetMap, r: Refinement) -> int:
    """Solve some cells again, settled ones where there are; return how many come out to the bit.

    Raises :class:`ArtifactError` if one comes out otherwise: chaos decides the numbers of no
    settled orbit, so they agree on every processor.
    """
    values = r.values
    settled = r.solved & (values["regime"] == "periodic") & (values["mle"] < -0.01)
    cells = np.argwhere(settled if settled.sum() >= PROVEN else r.solved)
    settings = Settings(**{name: r.metadata[name] for name in SETTINGS.to_dict()})
    same = 0
    for row, column in cells[np.linspace(0, len(cells) - 1, PROVEN).astype(int)]:
        mass, number = float(r.rotor_mass[column]), float(r.bearing_number[row])
        point = solve_point(one.design, mass, number, settings)
        regime = point.regime.name if point.regime else ""
        before = float(values["mle"][row, column])
        now = np.nan if point.mle is None else point.mle.value
        apart = abs(now - before) > NEAR if settled[row, column] else False
        if regime != values["regime"][row, column] or apart:
            raise ArtifactError(
                f"{one.file}: at {mass:.4g} kg, Λ {number:.4g} the solver finds {regime} {now:+.8f}"
                f" and the map has {values['regime'][row, column]} {before:+.8f}; {AGAIN}"
            )
        same += now == before
    return same


def limit_of_mass(m: StabilityMap, bearing_number: float) -> float:
    """Return the largest rotor mass, kg, up to which no cell at a bearing number is to be avoided;
    nan where the least mass is.
    """
    column = m.grades()[np.abs(m.bearing_number - bearing_number).argmin()]
    bad = np.flatnonzero(column == "avoid")
    first = bad[0] if bad.size else len(column)
    return float(m.rotor_mass[first - 1]) if first else float("nan")


def table(folder: Path = ARTIFACTS) -> Iterator[str]:
    """Yield a line of CSV for each map: shares of its plane, and the limit of the mass at some of
    its speeds (:func:`limit_of_mass`).
    """
    yield "map,solved,good,watch,avoid,largest mass (kg),limit of mass (kg) at speed (rpm)"
    for one in MAPS:
        r = load_preset_map(one, folder)
        m, speed = as_map(r), one.design.speed_rpm(1.0)
        worth = m.grades()
        shares = ",".join(f"{100 * (worth == grade).mean():.1f} %" for grade in GRADES)
        limits = "; ".join(
            f"{limit_of_mass(m, rpm / speed):.3g} at {rpm:,.0f}".replace(",", "")
            for rpm in (share * one.preset.speed_rpm for share in SHARES)
        )
        yield f"{one.file},{int(r.solved.sum())},{shares},{m.rotor_mass[-1]:.3g},{limits}"


def _main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="preset_maps", description="Maps of the presets.")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--table", action="store_true", help="print what each map says")
    what.add_argument("--restamp", action="store_true", help="the solver's answers are the same")
    args = parser.parse_args(arguments)
    try:
        for line in table() if args.table else restamp() if args.restamp else update():
            print(line, flush=True)
    except (InputError, OSError) as error:
        print(f"preset_maps: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(_main(sys.argv[1:]))
