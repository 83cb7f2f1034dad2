"""What one step of the training environment gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.training.perception import Observations

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class StepResult:
    """What a decision of all vessels led to; E episodes, V vessels."""

    observation: Observations
    """To act on next: of the new episode where one was over, zeros for vessels that left."""
    final_observation: Observations
    """The state that the decision led to: the `next` of the transition."""
    reward: Float32
    """(E, V) 0 for vessels that were not on the water."""
    terminated: Mask
    """(E, V) Reached the goal or touched something: do not bootstrap."""
    truncated: Mask
    """(E, V) Cut off by the limit of decisions while under way: bootstrap."""
    active: Mask
    """(E, V) Was on the water when acting: has made a transition."""
    reached: Mask
    """(E, V) Reached its goal by this decision."""
    touched_vessel: Mask
    """(E, V) Touched another vessel in this decision."""
    touched_buoy: Mask
    """(E, V) Touched a buoy in this decision."""
    elapsed_s: Float64
    """(E,) [s] Since the episode began, after this decision: the travel time of `reached`."""
    finished: Mask
    """(E,) The episode is over; the slot has begun the next one (unless `auto_reset` is off)."""

    @property
    def collided(self) -> Mask:
        """(E, V) Touched anything in this decision."""
        return self.touched_vessel | self.touched_buoy
