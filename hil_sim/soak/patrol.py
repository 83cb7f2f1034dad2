"""Where a soak sails: to and fro in a lane of its own, as long as it takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.world import World
from twinscrew.runtime.messages.types import Float64

TURN_M = 12.0
"""[m] So near the end of its lane a vessel is sent back: before it has arrived, and stopped."""
AGAIN_S = 15.0
"""[s] A goal is given again after this: a fault may have swallowed it, and the boat would rest."""


class Patrol:
    """Sends every vessel to the other end of its lane when it comes near one, and says so again."""

    def __init__(self, world: World, waits: Sequence[Sequence[Span]] = ()) -> None:
        """Begin.

        Parameters
        ----------
        waits
            When each vessel is given no goal, [s] since somebody first asked for one: another
            gives it then, and the boat is to wait for him.
        """
        self._world = world
        self._waits = waits or [()] * world.scenario.vessels
        self._begin_s: float | None = None
        self.turns = [0] * world.scenario.vessels
        """[-] How often each vessel was sent back."""
        self._said_s = [world.time_s] * world.scenario.vessels

    def goal_of(self, vessel: int) -> Float64 | None:
        """Give a goal that a vessel is to be sent to now, (2,) [m] [N]; None if it is none."""
        if self._is_to_wait(vessel):
            return None
        if np.hypot(*(self._world.state.position_N[vessel, :2] - self._goal(vessel))) <= TURN_M:
            self.turns[vessel] += 1
        elif self._world.time_s - self._said_s[vessel] < AGAIN_S:
            return None
        self._said_s[vessel] = self._world.time_s
        return self._goal(vessel)

    def _is_to_wait(self, vessel: int) -> bool:
        if self._begin_s is None:
            self._begin_s = self._world.time_s
        since_s = self._world.time_s - self._begin_s
        return any(span.holds(since_s) for span in self._waits[vessel])

    def _goal(self, vessel: int) -> Float64:
        goal_N: Float64 = self.ends(vessel)[(self.turns[vessel] + 1) % 2]
        return goal_N

    def ends(self, vessel: int) -> Float64:
        """Give both ends of a lane, (2, 2) [m] [N]: where it starts, and where it goes first."""
        scenario = self._world.scenario
        return np.array([scenario.starts[vessel, :2], scenario.goals[vessel]])
