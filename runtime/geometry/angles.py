"""Angles, in radians, wrapped to [-pi, pi)."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Angle = TypeVar("Angle", float, NDArray[np.float64])


def wrap(angle: Angle) -> Angle:
    """Wrap an angle, or an array of angles, to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
