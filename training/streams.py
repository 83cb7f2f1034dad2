"""Random streams: each slot and each episode has its own, whatever else runs beside it.

Slot k draws the same numbers in a batch of 1 and of 1000, so that results do not depend on how many
episodes run at once, and an episode's scenario does not depend on what any vessel did before.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.random import SFC64, Generator, Philox, SeedSequence


class Stream(IntEnum):
    """What a slot's stream is for."""

    PERCEPTION = 0
    IMPERFECTION = 1
    DISTURBANCE = 2


def slot_stream(seed: int, slot: int, stream: Stream) -> Generator:
    """Give the generator that a slot keeps for as long as the environment lives."""
    return Generator(SFC64(SeedSequence([seed, slot, int(stream)])))


def episode_stream(seed: int, slot: int, number: int) -> Generator:
    """Give the generator of the slot's episode `number`: counter-based, so cheap to make."""
    return Generator(Philox(key=np.array([seed, (slot << 32) + number], dtype=np.uint64)))
