"""Maps made up for tests."""

import dataclasses

import numpy as np
import pandas as pd

from spab_core.active_learning.learning_curve import (
    COLUMNS,
    COMMITTEE,
)
from spab_core.design.model import reference_design
from spab_core.maps.stability_map import StabilityMap
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings


def map_of(function, rows=14, columns=18):
    """A map whose exponent is ``function`` of bearing number and rotor mass."""
    number, mass = np.linspace(0.5, 8.5, rows), np.linspace(1.0, 25.0, columns)
    mle = np.asarray(function(*np.meshgrid(number, mass, indexing="ij")), float)
    shape = mle.shape
    metadata = map_metadata(reference_design(), Settings(), shape)
    return StabilityMap(
        number,
        mass,
        mle=mle,
        mle_standard_error=np.full(shape, 1e-3),
        regime=np.where(mle > 0.01, "chaotic", "periodic"),
        period=np.where(mle > 0.01, 0, 1),
        contact_share=np.zeros(shape),
        max_eccentricity=np.full(shape, 0.5),
        status=np.full(shape, "ok"),
        revolutions=np.full(shape, 600),
        metadata=metadata,
    )


def with_hole(m):
    """The same map with a failed cell at (3, 4)."""
    mle, regime, status = m.mle.copy(), m.regime.copy(), m.status.astype("<U16")
    mle[3, 4], regime[3, 4], status[3, 4] = np.nan, "", "touchdown"
    return dataclasses.replace(m, mle=mle, regime=regime, status=status)


def plane(number, mass):
    return 0.2 * number - 0.05 * mass - 0.4


def striped_map(rows=40, columns=50, noise=0.1, seed=0):
    """Periodic, quasi-periodic and chaotic stripes along a slanted line, exponents -0.5, 0, 0.3
    with noise in chaos only.
    """
    m = map_of(lambda number, mass: number + mass / 3.0, rows, columns)
    place = m.mle
    regime = np.where(
        place < 5.0, "periodic", np.where(place < 9.0, "quasi-periodic", "chaotic")
    ).astype("<U14")
    mle = np.where(place < 5.0, -0.5, np.where(place < 9.0, 0.0, 0.3))
    mle += np.where(regime == "chaotic", noise, 1e-3) * np.random.default_rng(seed).standard_normal(
        m.shape
    )
    return dataclasses.replace(
        m, mle=mle, regime=regime, period=np.where(regime == "periodic", 1, 0)
    )


KINDS = [
    ("periodic", 1, "ok"),
    ("periodic", 3, "ok"),
    ("quasi-periodic", 0, "ok"),
    ("chaotic", 0, "ok"),
    ("", 0, "touchdown"),
]


def map_of_regimes(numbers, masses, codes):
    """A map whose cells are KINDS[code]."""
    codes = np.asarray(codes)
    regime, period, status = (np.array(column)[codes] for column in zip(*KINDS, strict=True))
    mle = np.where(regime == "", np.nan, np.where(regime == "chaotic", 0.3, -0.1))
    zero = np.zeros(codes.shape)
    return StabilityMap(
        np.asarray(numbers, float),
        np.asarray(masses, float),
        mle,
        zero,
        regime,
        period,
        zero,
        zero,
        status,
        np.full(codes.shape, 600),
        {"design": reference_design().to_dict()},
    )


def made_up_curve(refined, committee, tree):
    values = [
        ("refine", COMMITTEE, 16, *refined),
        ("random", COMMITTEE, 4, *committee),
        ("random", "tree", 4, *tree),
    ]
    rows = [
        (strategy, name, "unsolved", divisor, 100, seed, error + 0.1 * seed, error, 0.0, 1.0, f1)
        for strategy, name, divisor, error, f1 in values
        for seed in (0, 1)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))
