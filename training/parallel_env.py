"""One episode of the training environment as PettingZoo's parallel environment.

Each vessel is an agent and sees a dictionary: ego (7,), objects (K, 5), mask (K,), raw SI units.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from twinscrew.runtime.messages.types import Float32
from twinscrew.training.environment import EnvironmentSettings, StepResult, VectorEnv
from twinscrew.training.perception import Observations

Dict = dict[str, Any]


class VesselsEnv(ParallelEnv[str, Dict, Float32]):  # type: ignore[misc]
    """Vessels that share one map; agents are named vessel_0, vessel_1, ...

    Parameters
    ----------
    settings
        The environment; the published one by default.
    seed
        Of the first episode; `reset(seed=...)` sets another.
    """

    metadata = {"name": "twinscrew_v0", "render_modes": []}  # noqa: RUF012 - PettingZoo's own form

    def __init__(self, settings: EnvironmentSettings | None = None, seed: int = 0) -> None:
        self.settings = settings or EnvironmentSettings()
        self.render_mode = None
        vessels = self.settings.shape[0]
        self.possible_agents = [f"vessel_{number}" for number in range(vessels)]
        self.agents: list[str] = []
        seen = _observation_space(self.settings.observed_objects)
        act = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_spaces = dict.fromkeys(self.possible_agents, seen)
        self.action_spaces = {agent: _copy(act) for agent in self.possible_agents}
        self._env = VectorEnv(self.settings, 1, seed, auto_reset=False)

    def observation_space(self, agent: str) -> spaces.Dict:
        """Give what an agent may see."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        """Give what an agent may do: rates of change of thrust, left and right, / 1000 N/s."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Dict | None = None
    ) -> tuple[dict[str, Dict], dict[str, Dict]]:
        """Begin an episode: that of `seed`, or the next one."""
        del options
        if seed is not None:
            self._env = VectorEnv(self.settings, 1, seed, auto_reset=False)
        seen = self._env.reset()
        self.agents = self._named(self._env.active[0])
        return self._views(seen, self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Float32]
    ) -> tuple[
        dict[str, Dict], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Dict]
    ]:
        """Let all vessels act at once; those that arrived or touched something leave."""
        action = np.zeros((1, len(self.possible_agents), 2))
        for agent, value in actions.items():
            action[0, self.possible_agents.index(agent)] = value
        result = self._env.step(action)
        acted, self.agents = self.agents, self._named(self._env.active[0])
        index = {agent: self.possible_agents.index(agent) for agent in acted}
        return (
            self._views(result.final_observation, acted),
            {agent: float(result.reward[0, k]) for agent, k in index.items()},
            {agent: bool(result.terminated[0, k]) for agent, k in index.items()},
            {agent: bool(result.truncated[0, k]) for agent, k in index.items()},
            {agent: _information(result, k) for agent, k in index.items()},
        )

    def _named(self, active: NDArray[np.bool_]) -> list[str]:
        return [agent for agent, there in zip(self.possible_agents, active, strict=True) if there]

    def _views(self, seen: Observations, agents: list[str]) -> dict[str, Dict]:
        views = {}
        for agent in agents:
            k = self.possible_agents.index(agent)
            views[agent] = {name: part[0, k] for name, part in seen._asdict().items()}
        return views


def _information(result: StepResult, vessel: int) -> Dict:
    """Say how a decision ended for one vessel."""
    return {
        "reached": bool(result.reached[0, vessel]),
        "touched_vessel": bool(result.touched_vessel[0, vessel]),
        "touched_buoy": bool(result.touched_buoy[0, vessel]),
        "elapsed_s": float(result.elapsed_s[0]),
    }


def _observation_space(objects: int) -> spaces.Dict:
    return spaces.Dict(
        {
            "ego": spaces.Box(-np.inf, np.inf, (7,), np.float32),
            "objects": spaces.Box(-np.inf, np.inf, (objects, 5), np.float32),
            "mask": spaces.Box(0.0, 1.0, (objects,), np.float32),
        }
    )


def _copy(box: spaces.Box) -> spaces.Box:
    """Give each agent its own space, so that seeding one does not seed another."""
    return spaces.Box(box.low, box.high, dtype=np.float32)
