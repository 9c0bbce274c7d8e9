"""Coefficients as a file: JSON and XLSX as ROSS 3 reads them, CSV for anyone (rad/s, N/m, N s/m).

JSON is a ``BearingElement`` of ROSS (``BearingElement.load``) and holds any table: over speed, over
whirl frequency, or over both, the only one that gives every mode of a rotor the coefficients at its
own frequency (``Rotor.run_modal(speed, matched_whirl=True)``). ``BearingElement.from_table`` reads
an XLSX as a table over speed whatever its first column is called, so XLSX holds nothing else."""

from __future__ import annotations

import io
import json
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd

from spab_core.common.errors import InputError
from spab_core.common.files import check_output, csv_bytes, with_units, write_atomically
from spab_core.common.units import to_rpm
from spab_core.common.words import count
from spab_core.linear_theory.coefficients import NAMES, Coefficients
from spab_core.linear_theory.equilibrium import LIFTED
from spab_core.linear_theory.modes import FILM_MODE

FORMATS = (".json", ".xlsx", ".csv")
ELEMENT = "BearingElement_spab"  # ROSS takes the class from a section's name
LEAST_POINTS = 5  # on an axis: with fewer ROSS warns of its interpolation
CONVENTION = (
    "Force on the journal: F_x = -kxx x - kxy y - cxx x' - cxy y', F_y = -kyx x - kyy y - cyx x' - "
    "cyy y'; x horizontal, y upwards, rotation from x to y. kxy > 0 with kyx < 0 drives forward "
    "whirl."
)
_UNITS = (
    "speed (of the shaft), frequency (of the whirl): rad/s; k: N/m; c: N s/m; growth_rate (of the "
    "whirl that feels them): 1/s; contact_load_share: share of the weight on the wall's asperities."
)
_STEADY = "Rows are those of a steady whirl, which neither grows nor decays."
_BELONGS = (
    "The table belongs to the rotor it was made with: mass, shaft stiffness, journal's share."
)


def coefficient_table(found: Coefficients) -> pd.DataFrame:
    """One row a shaft speed and whirl frequency, in SI units.

    Returns
    -------
    DataFrame
        ``speed``, ``frequency``, the eight coefficients by the names of ROSS, ``whirl_ratio``,
        ``growth_rate``, ``contact_load_share``; where the rows follow a mode, its ``mode``,
        ``mode_whirl_ratio`` and ``log_decrement`` at the row's speed.
    """
    table = {
        "speed": found.speed,
        "frequency": found.whirl_frequency,
        **{name: found.column(name) for name in NAMES},
        "whirl_ratio": found.whirl_ratio,
        "growth_rate": found.growth,
        "contact_load_share": found.contact_load_share,
    }
    if found.modes:
        table |= {
            "mode": np.array([mode.name for mode in found.modes]),
            "mode_whirl_ratio": np.array([mode.ratio for mode in found.modes]),
            "log_decrement": np.array([m.log_decrement for m in found.modes]),
        }
    return pd.DataFrame(table)


def coefficient_notes(found: Coefficients) -> list[str]:
    """What must be known to use the table, in sentences: the signs, what whirl its rows are for,
    then warnings (:func:`coefficient_warnings`).
    """
    if not found.modes:
        purpose = [_STEADY]
    elif found.axis == "speed":
        purpose = [
            "Rows follow one mode over the speed (mode, mode_whirl_ratio, log_decrement), "
            "at its own frequency and growth rate: a rotor on them has that mode as film and rotor "
            "together have it.",
            _BELONGS,
        ]
    else:
        purpose = [
            "At each speed and frequency the growth rate is that of the rotor's own mode of that "
            "frequency; the film's whirl is named (mode, mode_whirl_ratio, log_decrement). For "
            "modes at their own frequency: in ROSS run_modal(speed, matched_whirl=True).",
            _BELONGS,
        ]
    return [CONVENTION, _UNITS, *purpose, *coefficient_warnings(found)]


def coefficient_warnings(found: Coefficients) -> list[str]:
    """What speaks against the table, in sentences; empty where nothing does."""
    warnings = []
    share = found.contact_load_share
    if share.max() > LIFTED:
        speeds = np.unique(to_rpm(found.speed[share > LIFTED]))
        warnings.append(
            f"Not lifted off at {len(speeds)} of {count(len(np.unique(found.speed)), 'speed')} "
            f"({speeds.min():,.0f} to {speeds.max():,.0f} rpm): the wall carries up to "
            f"{share.max():.0%} of the weight, so the coefficients there are those of its "
            "asperities, not of a gas film."
        )
    if found.missing:
        missing = to_rpm(np.array(found.missing))
        warnings.append(
            f"{count(len(missing), 'speed')} left out ({missing.min():,.0f} to "
            f"{missing.max():,.0f} rpm), which have no static equilibrium."
        )
    for axis, values, name in (
        ("speed", found.speed, "speeds"),
        ("frequency", found.whirl_frequency, "whirl frequencies"),
    ):
        if axis in found.axis and len(np.unique(values)) < LEAST_POINTS:
            warnings.append(
                f"Fewer than {LEAST_POINTS} {name}: programs that interpolate, ROSS among them, "
                "want more."
            )
    if found.held:
        warnings.append(
            "The journal is held along the axis here, and the design lets it move "
            "(rotor.axial_motion): vibrations along the axis, and how they couple with motion "
            "across under an axial load, are not in the table."
        )
    if found.lost:
        lost = to_rpm(np.array(found.lost))
        warnings.append(
            f"At {count(len(lost), 'speed')} ({lost.min():,.0f} to {lost.max():,.0f} rpm) what "
            "repeats K and C at the frequency it finds, as ROSS with matched_whirl=True, is "
            f"driven away from the {FILM_MODE} on this table and may call an unstable rotor "
            "stable: take the table over speed alone (--whirl film-whirl) for the limit of "
            "stability."
        )
    names = sorted({mode.name for mode in found.modes})
    if names not in ([], [FILM_MODE]):
        warnings.append(f"The mode followed is no {FILM_MODE} at all speeds: {', '.join(names)}.")
    return warnings


def ross_element(found: Coefficients) -> dict[str, object]:
    """The keyword arguments of ``ross.BearingElement``, but for the node ``n``, as plain values:
    arrays over ``speed``, over ``frequency``, or over (speed, frequency).
    """
    speed, frequency = np.unique(found.speed), found.whirl_frequency
    columns = {name: found.column(name) for name in NAMES}
    if found.axis == "speed":
        axes = {"speed": found.speed}
    elif found.axis == "frequency":
        axes = {"frequency": frequency}
    else:
        axes = {"speed": speed, "frequency": frequency[: len(frequency) // len(speed)]}
        columns = {name: values.reshape(len(speed), -1) for name, values in columns.items()}
    return {name: values.tolist() for name, values in (axes | columns).items()}


def table_bytes(found: Coefficients, form: str) -> bytes:
    """Return the table as a file's bytes, the same for the same numbers.

    ``form`` is one of :data:`FORMATS`; XLSX holds 16 significant digits of a number.

    Raises
    ------
    InputError
        For XLSX and anything but a table over speed.
    """
    if form == ".csv":
        return csv_bytes(with_units(coefficient_table(found), _UNITS))
    if form == ".json":
        rows = coefficient_table(found).drop(columns=[*NAMES])
        first = ~rows.duplicated("speed") if found.axis == "speed and frequency" else slice(None)
        about = rows[first].to_dict("list")
        if found.axis == "speed and frequency":
            about = {k: v for k, v in about.items() if k not in ("frequency", "whirl_ratio")}
        content = {
            ELEMENT: {"n": 0} | ross_element(found),
            "spab": {"notes": coefficient_notes(found), "rows": about},
        }
        return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
    check_workbook(found.axis)
    data = io.BytesIO()
    with pd.ExcelWriter(data, engine="xlsxwriter") as writer:
        writer.book.set_properties({"created": datetime(1980, 1, 1)})  # not the time of writing
        coefficient_table(found).to_excel(writer, sheet_name="bearing", index=False)
        # on a sheet of its own: ROSS searches the first one for words such as rpm
        notes = pd.DataFrame({"notes": coefficient_notes(found)})
        notes.to_excel(writer, sheet_name="notes", index=False)
    return data.getvalue()


def check_workbook(axis: str) -> None:
    """Raise :class:`InputError` unless a table over ``axis`` may be an XLSX."""
    if axis != "speed":
        raise InputError(
            f"--out: a table over {axis} cannot be an .xlsx, which ROSS reads as one over shaft "
            "speed; give a name that ends in .json (for ROSS) or .csv"
        )


def check_table_output(path: str) -> None:
    """Raise :class:`InputError` unless ``path`` is a writable file of one of :data:`FORMATS`."""
    check_output(path, "--out")
    if Path(path).suffix.lower() not in FORMATS:
        raise InputError(f"--out = {path[:200]!r} must end in {', '.join(FORMATS)}")


def save_table(found: Coefficients, path: str) -> None:
    """Write the table atomically, in the format of the file's ending."""
    check_table_output(path)
    write_atomically(path, table_bytes(found, Path(path).suffix.lower()))
