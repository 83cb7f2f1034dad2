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
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Float32, Float64
from twinscrew.runtime.policy.colregs import ColregsSettings, Situation, situation, starboard_turn
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings
from twinscrew.training import scenarios
from twinscrew.training.episodes import Episodes, Stream, slot_stream
from twinscrew.training.imperfections import Imperfections, ImperfectionSettings
from twinscrew.training.land import ContourNoise, Land, LandSettings
from twinscrew.training.perception import (
    Layout,
    Noise,
    NoiseSettings,
    Observations,
    Perception,
    Sight,
)
from twinscrew.training.physics import (
    RATE_LIMIT,
    ConditionSettings,
    Coriolis,
    Physics,
    State,
    draw_hulls,
)
from twinscrew.training.scenarios import (
    MOST_PILES,
    Index,
    MapSettings,
    Mask,
    ScenarioSettings,
    StrangerSettings,
)

__all__ = ["RATE_LIMIT", "EnvironmentSettings", "StepResult", "VectorEnv", "steer_at_goal"]

AHEAD = 16
"""[-] Episodes that are drawn ahead for a slot: many at a time cost little each."""
CRUISE_N, TURN_N, STEP_N = 600.0, 400.0, 500.0
"""[N] Of `steer_at_goal`: thrust straight ahead; greatest difference; change by an action of 1."""
NonPositive = Annotated[float, Meta(le=0.0)]


class RewardSettings(Settings, frozen=True):
    """The paper's weights (sec. V)."""

    step: float = -0.1
    """[-] Every decision."""
    forward: NonNegative = 1.0
    """[1/m] For every metre that the goal came nearer."""
    collision: NonPositive = -5.0
    """[-] Touching anything."""
    goal: NonNegative = 10.0
    """[-] Reaching the goal."""
    colregs: NonPositive = -0.1
    """[1/rad] Times the angle by which the course lies to port of the compliant one."""
    which: Literal["closest", "first"] = "closest"
    """Who is checked: the closest vessel (paper) or the first that qualifies (reference)."""
    rules: ColregsSettings = ColregsSettings()
    """The zones."""


class EnvironmentSettings(Settings, frozen=True):
    """The environment; the defaults are the published one (paper, sec. V)."""

    scenarios: tuple[ScenarioSettings, ...] = (ScenarioSettings(),)
    """The mixture: every episode follows one of these rows, drawn by weight."""
    map: MapSettings = MapSettings()
    vessel: VesselParameters = VesselParameters()
    coriolis: Coriolis = "once"
    """How often Coriolis acts: "once" is the paper's equation, "twice" the authors' published
    environment, whose boats slide outward in turns. Travel times in the two do not compare."""
    noise: NoiseSettings = NoiseSettings()
    reward: RewardSettings = RewardSettings()
    conditions: ConditionSettings = ConditionSettings()
    imperfections: ImperfectionSettings = ImperfectionSettings()
    strangers: StrangerSettings = StrangerSettings()
    """What vessels are like that give no way, where a row of `scenarios` asks for any."""
    park: bool = False
    """Vessels that arrived stay at their goals as obstacles; as published they vanish."""
    period_s: Positive = 0.5
    """[s] Between two decisions; a multiple of the sub-step."""
    substep_s: Positive = 0.05
    """[s] Of the integration."""
    goal_radius_m: Positive = 2.0
    """[m] Nearer than this to its goal, a vessel has arrived."""
    range_m: Positive = 20.0
    """[m] Objects are perceived this far."""
    observed_objects: Count = OBSERVED_OBJECTS
    """[-] K: how many objects a vessel sees at most."""
    extended: bool = False
    """Observations hold the objects' outlines and the own hull's description too."""
    contour: bool = False
    """Extended observations hold the contour of what is fixed too."""
    land: LandSettings = LandSettings()
    """How harbours are drawn and their edges seen, where a row of `scenarios` asks for any."""
    decision_limit: Count = 1000
    """[-] An episode is truncated after so many decisions."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """V, M and T: room for the vessels, buoys and strangers of the largest row."""
        rows = self.scenarios
        piles = MOST_PILES if any(row.harbour for row in rows) else 0
        buoys = max(piles, *(row.buoys for row in rows))
        return max(row.robots for row in rows), buoys, max(row.strangers for row in rows)

    @property
    def layout(self) -> Layout:
        """What a vessel is shown."""
        return Layout(self.observed_objects, self.extended, self.contour)

    def check(self, episodes: int, seeds: Sequence[int]) -> None:
        """Refuse settings that contradict each other, and a batch that cannot be.

        Raises
        ------
        ConfigError
            Names the key and what is allowed.
        """
        scenarios.check(self.scenarios, self.map)
        if self.contour and not self.extended:
            raise ConfigError("a contour needs extended observations", key="contour")
        if episodes < 1:
            raise ConfigError(f"must be at least 1, got {episodes}", key="episodes")
        if not seeds or not all(0 <= seed < 2**63 for seed in seeds):
            got = ", ".join(map(str, seeds)) or "none"
            raise ConfigError(f"must be in [0, 2^63), got {got}", key="seed")
        substeps = round(self.period_s / self.substep_s)
        if abs(substeps * self.substep_s - self.period_s) > 1e-9:
            raise ConfigError(
                f"must be a multiple of substep_s {self.substep_s}, got {self.period_s}",
                key="period_s",
            )


@dataclass(frozen=True, slots=True)
class StepResult:
    """What a decision of all vessels led to; E episodes, V vessels."""

    observation: Observations
    """To act on next: of the new episode where one was over, zeros for vessels that left."""
    final_observation: Observations
    """The state that the decision led to: the `next` of the transition of who was `active`."""
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
    """(E, V) Touched a buoy or a pile in this decision."""
    touched_land: Mask
    """(E, V) Touched land in this decision: a quay."""
    touched_fence: Mask
    """(E, V) Crossed a fence, or the edge of a keep-out area, in this decision."""
    elapsed_s: Float64
    """(E,) [s] Since the episode began, after this decision: the travel time of `reached`."""
    finished: Mask
    """(E,) The episode is over; the slot has begun the next one (unless `auto_reset` is off)."""

    @property
    def collided(self) -> Mask:
        """(E, V) Touched anything in this decision."""
        others = self.touched_vessel | self.touched_buoy
        return others | self.touched_land | self.touched_fence


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
    scripted
        T: room for vessels that hold course and speed, placed by whoever asks for them.

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
        scripted: int = 0,
    ) -> None:
        self.settings = s = settings or EnvironmentSettings()
        seeds = [seed] if isinstance(seed, int) else list(seed)
        s.check(episodes, seeds)
        numbers = range(first_slot, first_slot + episodes)
        slots = [(one, number) for one in seeds for number in numbers]
        self.episodes, self.auto_reset = len(slots), auto_reset
        self.vessels, self.buoys, strangers = shape = s.shape
        others = strangers or scripted
        lag_s = s.conditions.thrust_lag_s
        has_harbours = any(row.harbour for row in s.scenarios)
        land = Land((self.episodes, self.vessels), s.land) if has_harbours else None
        self.state = State(self.episodes, self.vessels, self.buoys, others, s.vessel, lag_s, land)
        """What is on the water now."""
        self.physics = Physics(
            self.state, s.vessel, s.conditions, s.period_s, s.substep_s, s.coriolis
        )
        pairs = (self.vessels, self.vessels + self.buoys + others)
        noise = Noise(s.noise, _streams(slots, Stream.PERCEPTION), pairs)
        imperfect = None
        if s.imperfections.used:
            streams = _streams(slots, Stream.IMPERFECTION)
            imperfect = Imperfections(s.imperfections, streams, pairs, s.period_s)
        wrong = None
        if land is not None and s.contour:
            wrong = ContourNoise(s.land, _streams(slots, Stream.CONTOUR), self.vessels)
        sight = Sight(s.range_m, s.observed_objects, s.extended, s.contour)
        self.perception = Perception(noise, sight, imperfect, wrong)
        self._upcoming = Episodes(
            *(s.scenarios, s.map, s.noise, sight, s.conditions, s.vessel, s.strangers, s.land),
            shape,
            slots,
            AHEAD if auto_reset else 1,
        )

    @property
    def active(self) -> Mask:
        """(E, V) Who is on the water now: whose action the next `step` uses."""
        return self.state.active.copy()

    def set_weights(self, weights: Sequence[float]) -> None:
        """Change how often each row of `settings.scenarios` is drawn, for episodes yet to begin."""
        self._upcoming.set_weights(weights)

    def reset(self) -> Observations:
        """Begin the next episode in every slot."""
        s, shape = self.settings, (self.episodes, self.vessels)
        layout = s.layout._asdict()
        seen = Observations.empty(shape, **layout)
        self.restart(np.arange(self.episodes), seen)
        return seen

    def restart(self, slots: Index, observation: Observations) -> None:
        """Begin the next episode of some slots and write what its vessels see."""
        beginning = self._upcoming.take(slots)
        conditions, hulls = self.settings.conditions, None
        self.state.begin(slots, beginning.scenario)
        if conditions.varied:
            hulls = draw_hulls(conditions, self.settings.vessel, beginning.chance)
            self.state.take_hulls(slots, hulls)
        if conditions.currents:
            elapsed_s = self.state.decisions.astype(np.float64) * self.settings.period_s
            self.state.take_field(slots, beginning.field, elapsed_s)
        if self.state.land is not None:
            harbours = self._upcoming.harbours_of(beginning.scenario)
            self.state.land.begin(slots, harbours, beginning.chance)
            self.state.take_aim(slots)
        self.physics.forces.begin(slots, beginning.chance, hulls)
        self.perception.forget(slots)
        observation.rows[slots] = beginning.rows

    def step(self, action: NDArray[np.floating]) -> StepResult:
        """Let every vessel act for one decision period.

        Parameters
        ----------
        action : (E, V, 2) float
            Rates of change of thrust, left and right, in units of 1000 N/s, clipped to [-1, 1].
            Those of vessels that are not on the water are ignored.

        Raises
        ------
        PolicyError
            The action of a vessel on the water is not finite.
        """
        state, settings = self.state, self.settings
        acting, before = self.active, state.way_left
        self.physics.move(action)
        touched_vessel, touched_buoy = self.touched()
        touched_land, touched_fence = self.physics.grounded()
        collided, left = touched_vessel | touched_buoy, state.way_left
        if state.land is not None:
            collided = collided | touched_land | touched_fence
        reached = acting & ~collided & (state.to_goal <= settings.goal_radius_m)
        terminated = collided | reached
        state.decisions += 1
        state.active &= ~terminated
        if settings.park:
            # Not in harbours: who parks in a narrow place would lie in everybody's way.
            state.parked |= reached if state.land is None else reached & ~state.land.there[:, None]
        truncated = state.active & (state.decisions >= settings.decision_limit)[:, None]
        final = self.perception.observe(state, acting)
        gained = reward(before - left, collided, reached, self._turn(final), settings.reward)
        gained *= acting
        finished = np.asarray(~(state.active & ~truncated).any(axis=1))
        elapsed_s = state.decisions.astype(np.float64) * settings.period_s
        state.active &= ~truncated
        state.halt_others()
        observation = Observations(final.rows * state.active[..., None])
        if self.auto_reset and finished.any():
            self.restart(np.flatnonzero(finished), observation)
        return StepResult(
            observation=observation,
            final_observation=final,
            reward=gained,
            terminated=terminated,
            truncated=truncated,
            active=acting,
            reached=reached,
            touched_vessel=touched_vessel,
            touched_buoy=touched_buoy,
            touched_land=touched_land,
            touched_fence=touched_fence,
            elapsed_s=elapsed_s,
            finished=finished,
        )

    def touched(self) -> tuple[Mask, Mask]:
        """Tell which vessels touched a vessel, and which a buoy, in the decision just made."""
        return self.physics.touched()

    def _turn(self, seen: Observations) -> Float64:
        """Give how far each vessel's course falls short of the COLREGs, as it sees them."""
        s = self.settings
        v_ego = seen.ego[..., 2:4].astype(np.float64)
        return colregs_turn(seen.objects, seen.mask, v_ego, self.state.radius, s.reward)


def _streams(slots: Sequence[tuple[int, int]], stream: Stream) -> list[np.random.Generator]:
    """Give every slot's generator for one purpose."""
    return [slot_stream(seed, slot, stream) for seed, slot in slots]


def reward(
    progress: Float64, collided: Mask, reached: Mask, turn: Float64, settings: RewardSettings
) -> Float32:
    """Give the reward, paper, eq. (16); all arguments and the result are (E, V).

    Parameters
    ----------
    progress
        [m] By how much the distance to the goal decreased.
    collided, reached
        Whether the vessel touched anything, or is at its goal.
    turn
        [rad] max(delta, 0) in a COLREGs situation, else 0.
    settings
        The weights.
    """
    total = settings.step + settings.forward * progress + settings.colregs * turn
    total += settings.collision * collided
    total += settings.goal * reached
    return total.astype(np.float32)


def colregs_turn(
    objects: Float32, mask: Float32, v_ego: Float64, ego_radius: Float64, settings: RewardSettings
) -> Float64:
    """Give max(delta, 0) [rad] towards the vessel that is checked, 0 without such a situation.

    Parameters
    ----------
    objects, mask : (E, V, K, 5), (E, V, K) float32
        As perceived, frame B.
    v_ego : (E, V, 2) float
        [m/s] Surge and sway over ground.
    ego_radius : (E, V) float
        [m]
    settings
        Zones, and who is checked.

    Returns
    -------
    turn : (E, V) float64
    """
    turn = np.zeros(mask.shape[:2])
    where, checked = _checked(objects, mask, v_ego, settings)
    if len(checked):
        ego = v_ego[where]
        radius = np.broadcast_to(ego_radius, mask.shape[:2])[where]
        angle = starboard_turn(checked[:, :2], checked[:, 4], ego, radius, settings.rules)
        turn[where] = angle
    return turn


def _checked(
    objects: Float32, mask: Float32, v_ego: Float64, settings: RewardSettings
) -> tuple[tuple[Index, ...], Float64]:
    """Give where there is a COLREGs situation, and the object, (n, 5), it is with."""
    rules = settings.rules
    slow = rules.min_speed_mps**2
    vx, vy, surge, sway = objects[..., 2], objects[..., 3], v_ego[..., 0], v_ego[..., 1]
    candidate = vx * vx + vy * vy >= slow
    candidate &= mask > 0
    candidate &= (surge * surge + sway * sway >= slow)[..., None]
    episode, vessel, k = np.nonzero(candidate)
    if settings.which == "closest":  # nearest first: the first moving object of each vessel
        first = np.diff(episode * mask.shape[1] + vessel, prepend=-1) != 0
        episode, vessel, k = episode[first], vessel[first], k[first]
    chosen = objects[episode, vessel, k].astype(np.float64)
    kind = situation(chosen[:, :2], chosen[:, 2:4], v_ego[episode, vessel], rules)
    kept = np.flatnonzero(kind != Situation.NONE)
    if settings.which == "first":  # of those that qualify, the first of each vessel
        row = episode * mask.shape[1] + vessel
        kept = kept[np.unique(row[kept], return_index=True)[1]]
    return (episode[kept], vessel[kept]), chosen[kept]


def steer_at_goal(ego: Float32) -> Float64:
    """Give actions, (..., 2) in [-1, 1], for ego states, (..., 7): turn at the goal, sail on."""
    bearing = np.arctan2(ego[..., 1], ego[..., 0])
    turn = TURN_N * np.clip(2.0 * bearing - 2.0 * ego[..., 4], -1.0, 1.0)
    wanted = np.stack([CRUISE_N + turn, CRUISE_N - turn], axis=-1)
    action: Float64 = np.clip((wanted - ego[..., 5:7]) / STEP_N, -1.0, 1.0)
    return action
