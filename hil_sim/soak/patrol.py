"""Where a soak sails: to and fro in a lane of its own, as long as it takes."""

from __future__ import annotations

import numpy as np

from twinscrew.hil_sim.world import World
from twinscrew.runtime.messages.types import Float64

TURN_M = 12.0
"""[m] So near the end of its lane a vessel is sent back: before it has arrived, and stopped."""


class Patrol:
    """Sends every vessel to the other end of its lane when it comes near one."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.turns = [0] * world.scenario.vessels
        """[-] How often each vessel was sent back."""

    def goal_of(self, vessel: int) -> Float64 | None:
        """Give a vessel's next goal, (2,) [m] [N]; None if it has not come near the last one."""
        ends_N: Float64 = self.ends(vessel)
        to = ends_N[(self.turns[vessel] + 1) % 2]
        if np.hypot(*(self._world.state.position_N[vessel, :2] - to)) > TURN_M:
            return None
        self.turns[vessel] += 1
        back_N: Float64 = ends_N[(self.turns[vessel] + 1) % 2]
        return back_N

    def ends(self, vessel: int) -> Float64:
        """Give both ends of a lane, (2, 2) [m] [N]: where it starts, and where it goes first."""
        scenario = self._world.scenario
        return np.array([scenario.starts[vessel, :2], scenario.goals[vessel]])
