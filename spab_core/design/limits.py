"""Ranges of an operating point."""

from __future__ import annotations

from spab_core.common.validation import check_number

ROTOR_MASS_RANGE = (1e-3, 1e3)  # kg
BEARING_NUMBER_RANGE = (0.01, 50.0)


def check_linear_point(rotor_mass: float, bearing_number: float) -> None:
    """Raise :class:`DesignError` unless both are positive and at most what is allowed: linear
    theory holds on the way to 0, where static stiffness and onset are known.
    """
    top = ROTOR_MASS_RANGE[1], BEARING_NUMBER_RANGE[1]
    check_number("rotor mass", rotor_mass, 0.0, top[0], "kg", open_low=True)
    check_number("bearing number", bearing_number, 0.0, top[1], open_low=True)


def check_point(rotor_mass: float, bearing_number: float) -> None:
    """Raise :class:`DesignError` unless the operating point is in the allowed ranges."""
    check_number("rotor mass", rotor_mass, *ROTOR_MASS_RANGE, "kg")
    check_number("bearing number", bearing_number, *BEARING_NUMBER_RANGE)
