"""The way that the vessel has sailed, thinned out, for those who look on."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND

APART_M: Final = 1.0
"""[m] Between two places of the way."""
PLACES: Final = 1000
"""[-] The last so many are kept: a kilometre."""
EVERY_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often it is told (`TOPICS["path"]`)."""


class Wake:
    """Follows the odometry that comes in."""

    def __init__(self) -> None:
        self._places: deque[tuple[float, float]] = deque(maxlen=PLACES)
        self._told_ns: int | None = None

    def see(self, payload: bytes) -> bytes | None:
        """Look at an odometry message; gives the path to tell now and then, else None."""
        try:
            odometry = cdr.decode_odometry(payload)
        except MessageError:  # the core says so
            return None
        north, east, _ = odometry.position_N.tolist()
        if not self._places or math.dist(self._places[-1], (north, east)) >= APART_M:
            self._places.append((north, east))
        stamp_ns, told_ns = odometry.stamp_ns, self._told_ns
        if told_ns is not None and 0 <= stamp_ns - told_ns < EVERY_NS:
            return None
        self._told_ns = stamp_ns
        return cdr.encode_path(np.array(self._places), stamp_ns=stamp_ns)
