"""The training environment: many episodes at once, as array operations.

Paper, sec. V. One decision of all vessels in all episodes is one `step`: all move at once through
0.05 s sub-steps, touching is checked at every sub-step, reaching the goal at the end; who reached
or touched leaves the water. A slot whose episode is over begins the next.

    env = VectorEnv(EnvironmentSettings(), episodes=64, seed=0)
    observation = env.reset()                      # ego (E, V, 7), objects (E, V, K, 5), mask
    while training:
        result = env.step(action)                  # action (E, V, 2) in [-1, 1]
        # a transition of each vessel with result.active:
        #   observation, action, result.reward, result.final_observation, result.terminated
        observation = result.observation           # of the new episodes where one was over

Slot k's episodes are the same in any batch: `VectorEnv(s, 8, seed).slot 3` is
`VectorEnv(s, 1, seed, first_slot=3).slot 0`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.training.environment_settings import RATE_LIMIT, EnvironmentSettings, check
from twinscrew.training.episodes import Episodes
from twinscrew.training.lookout import Lookout
from twinscrew.training.perception import Observations
from twinscrew.training.reward import colregs_turn, reward
from twinscrew.training.sailing import Sailing
from twinscrew.training.step_result import StepResult
from twinscrew.training.vessel_state import Mask, State

__all__ = ["RATE_LIMIT", "EnvironmentSettings", "StepResult", "VectorEnv"]

AHEAD = 16
"""[-] Episodes that are drawn ahead for a slot: many at a time cost little each."""


class VectorEnv:
    """E episodes side by side.

    Parameters
    ----------
    settings
        The environment.
    episodes
        E: how many slots.
    seed
        Of everything random; non-negative. Several: as many slots for each, one seed after another.
    first_slot
        The number of the first slot: slots are numbered on from here, and a slot's number alone
        (with the seed) determines its episodes.
    auto_reset
        Whether a slot whose episode is over begins the next.

    Raises
    ------
    ConfigError
        The scenario cannot be placed or the settings contradict each other.
    """

    def __init__(
        self,
        settings: EnvironmentSettings | None = None,
        episodes: int = 64,
        seed: int | Sequence[int] = 0,
        *,
        first_slot: int = 0,
        auto_reset: bool = True,
    ) -> None:
        self.settings = settings = settings or EnvironmentSettings()
        seeds = [seed] if isinstance(seed, int) else list(seed)
        check(settings, episodes, seeds)
        numbers = range(first_slot, first_slot + episodes)
        slots = [(one, number) for one in seeds for number in numbers]
        self.episodes, self.auto_reset = len(slots), auto_reset
        self.vessels, self.buoys = settings.shape
        self.state = State(self.episodes, self.vessels, self.buoys)
        """What is on the water now."""
        self.sailing = Sailing(settings, self.state)
        self.lookout = Lookout(settings, slots)
        self._upcoming = Episodes(settings, slots, AHEAD if auto_reset else 1)

    @property
    def active(self) -> Mask:
        """(E, V) Who is on the water now: whose action the next `step` uses."""
        return self.state.active.copy()

    def set_weights(self, weights: Sequence[float]) -> None:
        """Change how often each row of `settings.scenarios` is drawn, for episodes yet to begin."""
        self._upcoming.set_weights(weights)

    def reset(self) -> Observations:
        """Begin the next episode in every slot."""
        shape = (self.episodes, self.vessels)
        most = self.settings.observed_objects
        observation = Observations(
            np.zeros((*shape, 7), np.float32),
            np.zeros((*shape, most, 5), np.float32),
            np.zeros((*shape, most), np.float32),
        )
        self._restart(np.arange(self.episodes), observation)
        return observation

    def step(self, action: NDArray[np.floating]) -> StepResult:
        """Let every vessel act for one decision period.

        Parameters
        ----------
        action : (E, V, 2) float
            Rates of change of thrust, left and right, in units of 1000 N/s, clipped to [-1, 1].
            Those of vessels that are not on the water are ignored.
        """
        state, settings = self.state, self.settings
        acting, before = self.active, state.to_goal
        self.sailing.move(action)
        touched_vessel, touched_buoy = self.sailing.touched()
        collided, left = touched_vessel | touched_buoy, state.to_goal
        reached = acting & ~collided & (left <= settings.goal_radius_m)
        terminated, truncated = self._leave(collided, reached)
        final = self.lookout.observe(state)
        gained = reward(before - left, collided, reached, self._turn(final), settings.reward)
        gained *= acting
        finished = np.asarray(~(state.active & ~truncated).any(axis=1))
        elapsed_s = state.decisions.astype(np.float64) * settings.period_s
        return StepResult(
            observation=self._continue(final, truncated, finished),
            final_observation=final,
            reward=gained,
            terminated=terminated,
            truncated=truncated,
            active=acting,
            reached=reached,
            touched_vessel=touched_vessel,
            touched_buoy=touched_buoy,
            elapsed_s=elapsed_s,
            finished=finished,
        )

    def _leave(self, collided: Mask, reached: Mask) -> tuple[Mask, Mask]:
        """Count the decision; take who is done off the water, tell whom the limit cuts off."""
        state = self.state
        terminated = collided | reached
        state.decisions += 1
        state.active &= ~terminated
        if self.settings.park:
            state.parked |= reached
        truncated = state.active & (state.decisions >= self.settings.decision_limit)[:, None]
        return terminated, truncated

    def _turn(self, seen: Observations) -> Float64:
        """Give how far each vessel's course falls short of the COLREGs, as it sees them."""
        s = self.settings
        v_ego = seen.ego[..., 2:4].astype(np.float64)
        return colregs_turn(seen.objects, seen.mask, v_ego, s.vessel.radius, s.reward)

    def _continue(self, final: Observations, truncated: Mask, finished: Mask) -> Observations:
        """Take who left off the water, begin new episodes, and give what is to be acted on."""
        self.state.active &= ~truncated
        self.state.halt_others()
        there = self.state.active.astype(np.float32)[..., None]
        observation = Observations(
            final.ego * there, final.objects * there[..., None], final.mask * there
        )
        if self.auto_reset and finished.any():
            self._restart(np.flatnonzero(finished), observation)
        return observation

    def _restart(self, slots: NDArray[np.intp], observation: Observations) -> None:
        """Begin the next episode of some slots and write what its vessels see."""
        beginning = self._upcoming.take(slots)
        self.state.begin(slots, beginning.scenario)
        self.sailing.begin(slots, beginning.chance)
        self.lookout.begin(slots)
        observation.ego[slots] = beginning.ego
        observation.objects[slots] = beginning.objects
        observation.mask[slots] = beginning.mask
