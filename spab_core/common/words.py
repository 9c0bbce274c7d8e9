"""Numbers and clauses in sentences."""

from __future__ import annotations

import math


def count(number: int, noun: str) -> str:
    """Return a number of things in words: "1 row", "2,000 rows"."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def capital(words: str) -> str:
    """Return a clause as a sentence begins: its first letter large, the others as they are."""
    return words[:1].upper() + words[1:]


def small(words: str) -> str:
    """Return a sentence as a clause begins: its first letter small, the others as they are."""
    return words[:1].lower() + words[1:]


def newtons(force: float) -> str:
    """Return a force in N, without its unit, as it is told; one that nobody feels as a bound."""
    if math.isnan(force):
        return "not measured"
    if force < 0.01:
        return "under 0.01" if force > 0.0 else "0"
    return f"{force:,.0f}" if force >= 100.0 else f"{force:.3g}"
