"""Which exponents surrogates learn: as they were solved, or cut off at a floor."""

from __future__ import annotations

import numpy as np
from streamlit.delta_generator import DeltaGenerator

from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.models import FLOOR
from spab_core.ui.shared import reference_map
from spab_core.ui.view import TARGETS, choice

_LABELS = {"full": "as solved", "floored": f"floor {FLOOR:g}"}


def target_choice(key: str, place: DeltaGenerator | None = None) -> float | None:
    """Show the choice of the exponents that are learnt; return their floor per revolution, None
    where they are as solved.

    ``key`` of the view: ``target`` of what is predicted, ``ranked`` of what is compared.
    """
    chosen: str = choice(
        "Exponents",
        tuple(TARGETS),
        place=place,
        key=key,
        format_func=_LABELS.__getitem__,
        help=f"Learnt and measured as solved, or with all under {FLOOR:g} per revolution set to "
        f"{FLOOR:g} before scaling",
    )
    return TARGETS[chosen]


def target_words(m: StabilityMap, floor: float | None) -> str:
    """What a floor does, or would do, to the exponents of the reference map, and why one chooses
    it.
    """
    solved = reference_map().mle
    low, high = float(np.nanmin(solved)), float(np.nanmax(solved))
    share = float((solved[np.isfinite(solved)] < FLOOR).mean())
    rest = (high - FLOOR) / (high - low)
    deviation = float(np.nanstd(m.mle))
    if floor is None:
        return (
            f"Exponents as solved, down to {low:.0f} per revolution (standard deviation "
            f"{deviation:.2f}). {share:.0%} of the cells lie under {FLOOR:g}; scaled to [0, 1], as "
            f"the paper does, all others share {rest:.0%} of the range."
        )
    return (
        f"Exponents under {floor:g} per revolution, {share:.0%} of the cells, count as {floor:g} "
        f"(standard deviation {deviation:.2f}): a disturbance that is down to {np.exp(floor):.0%} "
        "after one revolution is as good as gone, and how fast changes no verdict. What is left is "
        "where stability is decided."
    )


def floor_option(floor: float | None) -> str:
    """The floor as an option of the command line; "" where there is none."""
    return "" if floor is None else f" --floor {floor:g}"
