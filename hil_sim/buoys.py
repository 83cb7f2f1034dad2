"""Buoys: moored, so that they stay where they are; floating, so that they follow the surface."""

from __future__ import annotations

import numpy as np

from twinscrew.hil_sim.sea.sea import Sea
from twinscrew.runtime.messages.types import Float64


def floating(places_N: Float64, sea: Sea, time_s: float) -> Float64:
    """Give the positions (B, 3) [m], frame N, of what floats upright at places (B, 2) [m]."""
    return np.column_stack([places_N, -sea.elevation(places_N, time_s)])
