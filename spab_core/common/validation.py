"""Check numbers that a user gave."""

from __future__ import annotations

import math
from collections.abc import Collection
from numbers import Real
from typing import Any

from spab_core.common.errors import DesignError


def check_number(
    name: str,
    value: object,
    low: float,
    high: float,
    unit: str = "",
    *,
    infinite: bool = False,
    open_low: bool = False,
) -> float:
    """Return ``value`` as a float; raise if it is not a number or outside the allowed range.

    Parameters
    ----------
    name : str
        What to call the value in the message.
    value : object
        What the user gave.
    low, high : float
        The allowed range, both ends included (``low`` excluded where ``open_low``).
    unit : str
        Unit for the message, "" for a pure number.
    infinite : bool
        Whether positive infinity is allowed too.

    Raises
    ------
    DesignError
        If it is not a number or out of range; the message names the field, the value and the range.
    """
    unit = f" {unit}" if unit else ""
    begin = f"more than {low:g} up" if open_low else f"from {low:g}"
    allowed = f"{begin} to {high:g}{unit}"
    if infinite:
        allowed += ", or inf"
    if isinstance(value, bool) or not isinstance(value, Real):
        raise DesignError(f"{name} must be a number ({allowed}), not {str(value)[:60]!r}")
    given: Any = value
    try:
        number = float(given)
    except OverflowError:
        number = math.inf if given > 0 else -math.inf
    inside = low <= number <= high and not (open_low and number == low)
    if not inside and not (infinite and number == math.inf):
        raise DesignError(f"{name} = {number:g}{unit} is out of range: allowed is {allowed}")
    return number


def check_whole(name: str, value: object, low: int, high: int, unit: str = "") -> int:
    """Return ``value`` as an int; raise as :func:`check_number`, and where it is not whole."""
    number = check_number(name, value, low, high, unit)
    if number != int(number):
        raise DesignError(f"{name} = {number:g} must be a whole number from {low} to {high}")
    return int(number)


def check_choice(name: str, value: object, allowed: Collection[object]) -> None:
    """Raise :class:`DesignError` with the allowed values if ``value`` is not one of them."""
    if value not in allowed:
        raise DesignError(
            f"{name} = {str(value)[:40]!r} is not allowed: choose {', '.join(map(str, allowed))}"
        )
