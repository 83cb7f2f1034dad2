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
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.training import contacts
from twinscrew.training.beginnings import begin
from twinscrew.training.conditions import Conditions
from twinscrew.training.dynamics import Dynamics
from twinscrew.training.environment_settings import RATE_LIMIT, EnvironmentSettings, check
from twinscrew.training.imperfections import Imperfections
from twinscrew.training.perception import Observations, Things, see_ego, see_objects
from twinscrew.training.perception_noise import NoiseBank
from twinscrew.training.reward import colregs_turn, reward
from twinscrew.training.scenario_pool import Beginning, Pool
from twinscrew.training.step_result import StepResult
from twinscrew.training.streams import Stream, episode_stream, slot_stream

__all__ = ["RATE_LIMIT", "EnvironmentSettings", "StepResult", "VectorEnv"]

Mask = NDArray[np.bool_]

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
        self._slots = [(one, number) for one in seeds for number in numbers]
        self.episodes, self.auto_reset = len(self._slots), auto_reset
        self.vessels, self.buoys = settings.shape
        self.set_weights([row.weight for row in settings.scenarios])
        self._pool = Pool(self._begin, self.episodes, AHEAD if auto_reset else 1)
        self._allocate()

    @property
    def active(self) -> Mask:
        """(E, V) Who is on the water now: whose action the next `step` uses."""
        return self._active.copy()

    def set_weights(self, weights: Sequence[float]) -> None:
        """Change how often each row of `settings.scenarios` is drawn, for episodes yet to begin."""
        rows = self.settings.scenarios
        if len(weights) != len(rows) or min(weights) < 0.0 or sum(weights) <= 0.0:
            raise ConfigError(
                f"{len(rows)} numbers >= 0 with a positive sum are needed, got {list(weights)}",
                key="weight",
            )
        self._cumulative = np.cumsum(weights) / np.sum(weights)
        if hasattr(self, "_pool"):
            self._pool.forget()

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
        acting = self._active.copy()
        distance = np.abs(self._goal - self._position)
        self._move(action)
        touched_vessel, touched_buoy = self._contacts()
        collided = touched_vessel | touched_buoy
        left = np.abs(self._goal - self._position)
        reached = acting & ~collided & (left <= self.settings.goal_radius_m)
        terminated = collided | reached
        self._decisions += 1
        self._active &= ~terminated
        if self.settings.park:
            self._parked |= reached
        truncated: Mask = self._active & (self._decisions >= self.settings.decision_limit)[:, None]
        final = self._observe()
        gained = reward(distance - left, collided, reached, self._turn(final), self.settings.reward)
        gained *= acting
        finished = np.asarray(~(self._active & ~truncated).any(axis=1))
        elapsed = self._decisions.astype(np.float64) * self.settings.period_s
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
            elapsed_s=elapsed,
            finished=finished,
        )

    def _allocate(self) -> None:
        """Make the state: components first, then episodes, then vessels."""
        s, episodes, vessels, buoys = self.settings, self.episodes, self.vessels, self.buoys
        shape = (episodes, vessels)
        self._north_east = np.zeros((2, *shape))
        self._position = np.zeros(shape, complex)  # the same, north + i east
        self._heading = np.zeros(shape)
        self._nu = np.zeros((3, *shape))
        self._thrust = np.zeros((2, *shape))
        self._goal = np.zeros(shape, complex)
        self._active = np.zeros(shape, bool)
        self._buoy = np.zeros((episodes, buoys), complex)
        self._buoy_there = np.zeros((episodes, buoys), bool)
        self._decisions = np.zeros(episodes, np.int64)
        self._radius = np.array([s.vessel.radius] * vessels + [s.map.buoy_radius_m] * buoys)
        self._parked = np.zeros(shape, bool)
        self._conditions = Conditions(s.conditions, s.vessel, shape, s.substep_s)
        self._dynamics = Dynamics(self._conditions.coefficients, episodes * vessels, s.substeps)
        pairs = (vessels, vessels + buoys)
        self._noise = NoiseBank(s.noise, self._streams(Stream.PERCEPTION), pairs)
        self._imperfections = None
        if s.imperfections.used:
            streams = self._streams(Stream.IMPERFECTION)
            self._imperfections = Imperfections(s.imperfections, streams, pairs, s.period_s)

    def _streams(self, stream: Stream) -> list[Generator]:
        """Give every slot's generator for one purpose."""
        return [slot_stream(seed, slot, stream) for seed, slot in self._slots]

    def _move(self, action: NDArray[np.floating]) -> None:
        """Change the thrusts and sail through the sub-steps of a decision."""
        vessel = self.settings.vessel
        rate = np.clip(np.asarray(action, np.float64), -1.0, 1.0) * RATE_LIMIT
        self._thrust += rate.transpose(2, 0, 1) * self.settings.period_s
        np.clip(self._thrust, vessel.thrust_min_n, vessel.thrust_max_n, out=self._thrust)
        self._thrust *= self._active
        elapsed = self._decisions.astype(np.float64) * self.settings.period_s
        self._conditions.decide(self._thrust, self._heading, self._active, elapsed)
        self._dynamics.advance(
            self._north_east.reshape(2, -1),
            self._heading.reshape(-1),
            self._nu.reshape(3, -1),
            self._conditions.force,
        )
        self._position.real, self._position.imag = self._north_east

    def _contacts(self) -> tuple[Mask, Mask]:
        """Tell which vessels touched a vessel, and which a buoy, in the decision just sailed."""
        radius = self.settings.vessel.radius
        flat = self._dynamics.trajectory
        trajectory = flat.reshape(len(flat), 2, self.episodes, self.vessels)
        strayed = contacts.strayed(flat).reshape(self.episodes, self.vessels)
        there = self._active | self._parked
        vessel = contacts.between_vessels(trajectory, strayed, there, radius) & self._active
        buoy = contacts.with_buoys(
            trajectory,
            strayed,
            self._active,
            radius,
            self._buoy,
            self._buoy_there,
            self.settings.map.buoy_radius_m,
        )
        return vessel, buoy

    def _observe(self) -> Observations:
        """See what is around, as things are now."""
        s = self.settings
        heading = np.exp(1j * self._heading)
        velocity = np.zeros((self.episodes, self.vessels + self.buoys), complex)
        velocity[:, : self.vessels] = (self._nu[0] + 1j * self._nu[1]) * heading * self._active
        if self._imperfections is not None:
            velocity = self._imperfections.lagged(velocity)
        things = Things(
            position=np.concatenate([self._position, self._buoy], axis=1),
            velocity=velocity,
            radius=self._radius,
            there=np.concatenate([self._active | self._parked, self._buoy_there], axis=1),
        )
        noise = self._noise.next()
        objects, mask = see_objects(
            heading, things, noise, s.range_m, s.observed_objects, self._imperfections
        )
        ego = see_ego(self._position, heading, self._goal, self._nu, self._thrust)
        return Observations(ego, objects, mask)

    def _turn(self, seen: Observations) -> Float64:
        """Give how far each vessel's course falls short of the COLREGs, as it sees them."""
        s = self.settings
        v_ego = seen.ego[..., 2:4].astype(np.float64)
        return colregs_turn(seen.objects, seen.mask, v_ego, s.vessel.radius, s.reward)

    def _continue(self, final: Observations, truncated: Mask, finished: Mask) -> Observations:
        """Take who left off the water, begin new episodes, and give what is to be acted on."""
        self._active &= ~truncated
        self._nu *= self._active
        self._thrust *= self._active
        there = self._active.astype(np.float32)[..., None]
        observation = Observations(
            final.ego * there, final.objects * there[..., None], final.mask * there
        )
        if self.auto_reset and finished.any():
            self._restart(np.flatnonzero(finished), observation)
        return observation

    def _restart(self, slots: NDArray[np.intp], observation: Observations) -> None:
        """Begin the next episode of some slots and write what its vessels see."""
        beginning = self._pool.take(slots)
        scenario = beginning.scenario
        self._position[slots] = scenario.start
        self._north_east[0, slots] = scenario.start.real
        self._north_east[1, slots] = scenario.start.imag
        self._heading[slots] = scenario.heading
        self._nu[:, slots] = 0.0
        self._thrust[:, slots] = 0.0
        self._goal[slots] = scenario.goal
        self._active[slots] = scenario.vessel
        self._buoy[slots] = scenario.buoy
        self._buoy_there[slots] = scenario.buoy_there
        self._parked[slots] = False
        self._decisions[slots] = 0
        self._conditions.begin(slots, beginning.chance)
        if self._imperfections is not None:
            self._imperfections.forget(slots)
        observation.ego[slots] = beginning.ego
        observation.objects[slots] = beginning.objects
        observation.mask[slots] = beginning.mask

    def _begin(self, slots: NDArray[np.intp], numbers: NDArray[np.intp]) -> Beginning:
        """Draw episodes, by slot and number."""
        which = [self._slots[slot] for slot in slots]
        generators = [
            episode_stream(seed, slot, number)
            for (seed, slot), number in zip(which, numbers.tolist(), strict=True)
        ]
        return begin(self.settings, generators, self._cumulative, self._radius)
