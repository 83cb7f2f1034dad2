"""Who reached the goal, collided, or ran out of time: the paper's experiments, in simulation time.

A vessel's outcome is final. Vessels that touch while under way both have a collision; one that has
already arrived keeps its goal if it is hit, and the other has the collision.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np

from twinscrew.hil_sim.world import Touched, World
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Settings


class Outcome(Enum):
    """How a vessel's voyage ended."""

    GOAL = "goal"
    COLLISION = "collision"
    FENCE = "fence"
    """It entered a keep-out area, or crossed a fence."""
    TIMEOUT = "timeout"
    DONE = "done"
    """A trial was sailed to its end."""
    ENDED = "ended"
    """A trial was ended early by its guard."""


class SupervisorSettings(Settings, frozen=True, kw_only=True):
    """What becomes of a vessel whose voyage has ended."""

    after_goal: Literal["hold", "vanish"] = "hold"
    """Hold it at its goal, where others must keep clear of it; or take it off the map, as in
    training."""
    after_collision: Literal["vanish", "stop"] = "vanish"
    """Take it off the map, as in training; or hold it where it is, a wreck in the others' way. Of
    one that has entered a fence likewise."""
    goals_count: bool = True
    """Whether a voyage ends at its goal. One on trial has none: see `Supervisor.finish`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """How one vessel fared."""

    name: str
    outcome: Outcome | None
    """None while it is under way."""
    travel_time_s: float
    """[s] Simulation time from the beginning to the outcome, or to now."""
    closest_approach_m: float
    """[m] Least distance to another's surface while under way; infinite if there is no other."""
    touched: Touched | None = None
    """What it was in contact with when it ended."""
    greatest_current_mps: float = 0.0
    """[m/s] The fastest water it was in."""


class Supervisor:
    """Watches a world, step by step."""

    def __init__(self, world: World, settings: SupervisorSettings | None = None) -> None:
        """Begin now, with every vessel under way."""
        self.world = world
        self._begin_s = world.time_s
        self.settings = settings or SupervisorSettings()
        count = world.scenario.vessels
        self.outcomes: list[Outcome | None] = [None] * count
        self._ended_s = np.zeros(count)
        self._touched: list[Touched | None] = [None] * count

    @property
    def elapsed_s(self) -> float:
        """[s] Simulation time since the beginning."""
        return self.world.time_s - self._begin_s

    @property
    def over(self) -> bool:
        """True when every vessel has an outcome."""
        return None not in self.outcomes

    @property
    def success(self) -> bool:
        """True when every vessel has reached its goal."""
        return all(outcome is Outcome.GOAL for outcome in self.outcomes)

    def advance(self, duration_s: float, commands: Float64) -> None:
        """Move the world on under held commands (V, 2) [N], judging after every step.

        It stops early when the last vessel's outcome is known.
        """
        if not self.over:
            self.world.advance(duration_s, commands, until=self._judge)

    def finish(self, vessel: int, outcome: Outcome) -> None:
        """Note the outcome of a vessel whose trial is over; it is held where it is."""
        if self.outcomes[vessel] is None:
            self._end(vessel, outcome)

    def _judge(self) -> bool:
        """Give outcomes for what the world's last step has done; tell if the episode is over."""
        world, scenario = self.world, self.world.scenario
        offset = world.state.position_N[:, :2] - scenario.goals
        touching = (world.nearest <= 0.0).tolist()
        outside = (world.fence_gap <= 0.0).tolist()
        arrived = (np.hypot(offset[:, 0], offset[:, 1]) <= scenario.goal_radius).tolist()
        late = self.elapsed_s >= scenario.time_limit_s
        counts = self.settings.goals_count
        for vessel, outcome in enumerate(self.outcomes):
            if outcome is not None:
                continue
            if touching[vessel]:
                self._end(vessel, Outcome.COLLISION)
            elif outside[vessel]:
                self._end(vessel, Outcome.FENCE)
            elif counts and arrived[vessel]:
                self._end(vessel, Outcome.GOAL)
            elif late:
                self._end(vessel, Outcome.TIMEOUT)
        return self.over

    def results(self) -> tuple[Result, ...]:
        """Give how every vessel has fared until now."""
        closest, currents = self.world.closest_approach, self.world.greatest_current
        return tuple(
            Result(
                name=name,
                outcome=self.outcomes[i],
                travel_time_s=float(self._ended_s[i]) if self.outcomes[i] else self.elapsed_s,
                closest_approach_m=float(closest[i]),
                touched=self._touched[i],
                greatest_current_mps=float(currents[i]),
            )
            for i, name in enumerate(self.world.scenario.names)
        )

    def _end(self, vessel: int, outcome: Outcome) -> None:
        self.outcomes[vessel] = outcome
        self._ended_s[vessel] = self.elapsed_s
        self._touched[vessel] = self.world.touched(vessel)
        place_N = self.world.state.position_N[vessel, :2]
        if outcome is Outcome.GOAL:
            self._retire(vessel, self.settings.after_goal, self.world.scenario.goals[vessel])
        elif outcome in (Outcome.COLLISION, Outcome.FENCE):
            self._retire(vessel, self.settings.after_collision, place_N)
        else:
            self._retire(vessel, "stop", place_N)

    def _retire(self, vessel: int, how: str, mooring_N: Float64) -> None:
        if how == "vanish":
            self.world.remove(vessel)
        else:
            self.world.moor(vessel, mooring_N)
