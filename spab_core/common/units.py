"""Shaft speeds in rad/s and in revolutions per minute (rpm)."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

Speed = TypeVar("Speed", float, np.ndarray)


def to_rpm(speed: Speed) -> Speed:
    """Return a speed in rad/s, float or array, in revolutions per minute."""
    return speed * 30.0 / math.pi


def from_rpm(speed_rpm: Speed) -> Speed:
    """Return a speed in revolutions per minute, float or array, in rad/s."""
    return speed_rpm * math.pi / 30.0
