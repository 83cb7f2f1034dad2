"""How often a policy brings every vessel to its goal, and how fast (paper, sec. VI).

Greedy, in the training environment, many episodes at once. An episode fails if anything is touched
or any vessel is under way for more than 90 s. Episode k of a seed is the same for every policy, in
any batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, get_args

import msgspec
import numpy as np
from scipy.stats import binomtest

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Float32, Float64, Observation
from twinscrew.runtime.policy.hull_units import in_units, units_of
from twinscrew.runtime.policy.load import PLANNERS, InHullUnits, Policy, load_policy
from twinscrew.runtime.policy.metadata import (
    EXTENDED_INPUTS,
    OUTPUT_NAME,
    OUTPUT_SHAPE,
    PolicyExpectation,
    check_expectation,
)
from twinscrew.runtime.policy.onnx import AS_SHIPPED, OnnxPolicy, risk_feed
from twinscrew.runtime.policy.onnx_runtime import ort
from twinscrew.runtime.policy.risk import RiskSettings, adaptive_level
from twinscrew.runtime.settings import shipped
from twinscrew.runtime.vessel_description import DEFAULT, VesselDescription, load_vessel
from twinscrew.training.environment import RATE_LIMIT, EnvironmentSettings, VectorEnv
from twinscrew.training.harbours import CurrentKind, Kind
from twinscrew.training.perception import PAPER, Layout, Observations
from twinscrew.training.physics import HullSettings, UnknownSettings
from twinscrew.training.scenarios import Mask, ScenarioSettings, six_settings

if TYPE_CHECKING:
    from torch import nn

TIME_LIMIT_S = 90.0
"""[s] Longer than this under way, and the episode has failed (paper, sec. VI)."""
BATCH = 500
"""[-] Episodes at once; the results do not depend on it."""
SECONDS_WORTH = 0.001
"""[1/s] What a second of mean travel time counts against the mean success rate in selection."""


# -- policies that decide for many vessels at once ------------------------------------------------


class BatchPolicy(Protocol):
    """A policy that decides for all vessels of all episodes in one call."""

    @property
    def name(self) -> str:
        """What the policy calls itself."""

    @property
    def period_s(self) -> float:
        """[s] Between two decisions."""

    @property
    def layout(self) -> Layout:
        """What it is shown."""

    @property
    def range_m(self) -> float:
        """[m] How far it is shown what there is."""

    def begin(self, episodes: int, vessels: int) -> None:
        """Forget everything: new episodes follow."""

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]; those of vessels not `active`, (E, V), are 0."""


def open_policy(
    spec: str, risk: RiskSettings = AS_SHIPPED, vessel: VesselDescription | None = None
) -> BatchPolicy:
    """Give a policy by what the user typed: an ONNX file, a shipped policy's name, apf or mpc.

    Raises
    ------
    PolicyError
        There is no such policy, or it was not made for the vessel (None: the default one).
    """
    hull = vessel or load_vessel()
    if spec in PLANNERS:
        return OneByOne(lambda: _in_units(load_policy(spec, risk=risk, vessel=hull)))
    try:
        file = shipped("policies", spec, ".onnx")
    except ConfigError as error:
        raise PolicyError(f"{error}; or {', '.join(PLANNERS)}, or an ONNX file") from error
    made = OnnxBatch(file, risk)
    check_expectation(made.metadata, PolicyExpectation(vessel=hull.name))
    return made


def _in_units(policy: Policy) -> Policy:
    """Give a policy that is fed in its hull's own units."""
    return policy.policy if isinstance(policy, InHullUnits) else policy


def sailed_by(vessel: VesselDescription, settings: EnvironmentSettings) -> EnvironmentSettings:
    """Give an environment in which all vessels are like one, everything in that hull's own units.

    So the paper's map, distances and radii are as many of its lengths as they are of the default
    vessel's. Times that are found there are to be multiplied by `units_of(vessel, ...).time`.
    """
    if vessel.key == DEFAULT:
        return settings
    units = units_of(vessel, load_vessel())
    lag_s = vessel.thrusters.time_constant_s / units.time
    return msgspec.structs.replace(
        settings,
        vessel=in_units(vessel.plane, units),
        conditions=msgspec.structs.replace(settings.conditions, thrust_lag_s=lag_s),
    )


UNKNOWN: Mapping[str, Mapping[str, float]] = {
    "mass": {"mass": 0.25},
    "drag": {"drag": 0.5},
    "propeller": {"propeller": 0.3},
    "lag": {"lag_s": 0.5},
    "current": {},
}
"""What a policy may not be told of its hull, by name: fields of `UnknownSettings`."""
UNKNOWN_CURRENT = 0.3
"""[-] The water runs up to this share of the default vessel's top speed."""


def unknown_to_policy(settings: EnvironmentSettings, what: Sequence[str]) -> EnvironmentSettings:
    """Give an environment whose vessels differ from what their policies are told (`UNKNOWN`).

    Raises
    ------
    ConfigError
        A name that is none of `UNKNOWN`'s.
    """
    if wrong := sorted(set(what) - set(UNKNOWN)):
        allowed = ", ".join(UNKNOWN)
        raise ConfigError(f"cannot hide {', '.join(wrong)}; allowed: {allowed}", key="--unknown")
    fields = {key: value for name in what for key, value in UNKNOWN[name].items()}
    most_mps = UNKNOWN_CURRENT * load_vessel().top_speed_mps * ("current" in what)
    conditions = msgspec.structs.replace(
        settings.conditions, unknown=UnknownSettings(**fields), current_mps=(0.0, most_mps)
    )
    return msgspec.structs.replace(settings, conditions=conditions)


def sailed_by_any(settings: EnvironmentSettings) -> EnvironmentSettings:
    """Give an environment in which every vessel has a hull of its own, drawn at random.

    The policies are told the truth, in the hull's own units (`HullSettings`).
    """
    hulls = HullSettings(share=1.0, weak=0.0, unknown=0.0, coriolis_twice=0.0)
    conditions = msgspec.structs.replace(settings.conditions, hulls=hulls)
    return msgspec.structs.replace(settings, conditions=conditions)


class OnnxBatch:
    """A policy file, after all the checks of `OnnxPolicy`, asked with as many rows as there are."""

    def __init__(self, path: Path, risk: RiskSettings = AS_SHIPPED) -> None:
        self.metadata = OnnxPolicy(path, risk=risk).metadata
        self.name, self.period_s = self.metadata.algorithm, self.metadata.decision_period_s
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # fatal only: what goes wrong is raised
        self.range_m = self.metadata.perception_range_m
        m = self.metadata
        self.layout = Layout(m.observed_objects, m.extended, m.contour)
        self._session: Any = ort.InferenceSession(
            path.read_bytes(), options, providers=["CPUExecutionProvider"]
        )
        self._risk = risk

    def begin(self, episodes: int, vessels: int) -> None:
        """Do nothing: a policy file remembers nothing."""

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]."""
        parts = ("ego", "objects", "mask", *EXTENDED_INPUTS * self.layout.extended)
        parts += ("contour",) * self.layout.contour
        feed = {name: getattr(seen, name)[active] for name in parts}
        feed |= risk_feed(self._session, len(feed["ego"]), self._risk)
        if self._risk.level == "adaptive":
            feed["risk"] = adaptive_level(feed["objects"], feed["mask"], self._risk)
        rows = len(feed["ego"])
        try:
            answer = self._session.run([OUTPUT_NAME], feed)[0]
        except Exception as error:  # ONNX Runtime has no base class of its own
            raise PolicyError(f"{self.name} failed with {rows} rows at once: {error}") from error
        if answer.shape != (rows, *OUTPUT_SHAPE):
            raise PolicyError(f"{self.name} answered {rows} rows with shape {answer.shape}")
        if not np.isfinite(answer).all():
            raise PolicyError(f"{self.name} answered with numbers that are not finite")
        limit = self.metadata.thrust_rate_max_n_per_s
        return _spread(np.clip(answer, -limit, limit), active)


class OneByOne:
    """A policy that decides for one vessel at a time; each vessel has its own."""

    def __init__(self, make: Callable[[], Policy]) -> None:
        self._make, example = make, make()
        self.name, self.period_s = example.name, example.period_s
        self.layout, self.range_m = PAPER, EnvironmentSettings().range_m
        self._policies: list[list[Policy]] = []

    def begin(self, episodes: int, vessels: int) -> None:
        """Give every vessel a fresh policy."""
        self._policies = [[self._make() for _ in range(vessels)] for _ in range(episodes)]

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]."""
        rates = np.zeros((*active.shape, 2))
        for episode, vessel in np.argwhere(active):
            ego, objects, mask = (np.ascontiguousarray(part[episode, vessel]) for part in seen)
            one = Observation(ego=ego, objects=objects, mask=mask)
            rates[episode, vessel] = self._policies[episode][vessel].act(one)
        return rates


class NetworkPolicy:
    """A network (observations to actions) as what `evaluate` asks for thrust rates."""

    name = "network"

    def __init__(
        self, network: nn.Module, period_s: float, layout: Layout = PAPER, range_m: float = 20.0
    ) -> None:
        self._network, self.period_s = network, period_s
        self.layout, self.range_m = layout, range_m
        self._device = next(network.parameters()).device

    def begin(self, episodes: int, vessels: int) -> None:
        """Do nothing: a network remembers nothing."""

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]."""
        import torch

        from twinscrew.training.networks import unpack

        with torch.no_grad():
            action = self._network(unpack(torch.from_numpy(seen.rows[active]).to(self._device)))
        return _spread(action.cpu().numpy() * RATE_LIMIT, active)


def _spread(values: Float32, active: Mask) -> Float64:
    """Give values of active vessels, (n, 2), in their places, (E, V, 2); 0 elsewhere."""
    rates = np.zeros((*active.shape, 2))
    rates[active] = values
    return rates


# -- scores ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A policy's score in one setting; episodes = successes + collisions + timeouts."""

    episodes: int
    success_rate: float
    """[-] Share of the episodes in which every vessel arrived in time and nothing was touched."""
    wilson95: tuple[float, float]
    """[-] Wilson's 95 % confidence interval of the success rate."""
    travel_time_s: float | None
    """[s] Mean over the vessels that reached their goals; None if none did."""
    collisions: int
    """[-] Episodes in which anything was touched."""
    timeouts: int
    """[-] Other episodes in which a vessel took over 90 s."""
    seed: int
    cumulative_reward: float
    """[-] Mean over the vessels of the sum of their rewards, undiscounted."""
    quays: int = 0
    """[-] Of the collisions: episodes in which land was touched,"""
    fences: int = 0
    """[-] and in which a fence or the edge of a keep-out area was."""

    def record(self, *, land: bool = False) -> dict[str, Any]:
        """Give it as plain values, for JSON; with `land`, what was touched of land and fences."""
        names = self.__slots__ if land else self.__slots__[: -len(_OF_LAND)]
        return {name: getattr(self, name) for name in names}


_OF_LAND = ("quays", "fences")


def evaluate(
    policy: BatchPolicy,
    scenario: ScenarioSettings,
    episodes: int = 1000,
    seed: int = 0,
    *,
    environment: EnvironmentSettings | None = None,
    batch: int = BATCH,
    progress: Callable[[int], None] | None = None,
) -> Evaluation:
    """Sail fresh episodes of one scenario with one policy on every vessel.

    Parameters
    ----------
    policy
        Decides for all; its decision period is the environment's.
    scenario
        Vessels, buoys and least distance.
    episodes, seed
        How many, and of which stream.
    environment
        The conditions; the published ones by default. Its mixture is replaced by `scenario`.
    batch
        Episodes at once.
    progress
        Called with the number of episodes that just ended.

    Raises
    ------
    ConfigError
        The scenario cannot be placed, or the policy's period does not fit the sub-steps.
    PolicyError
        The policy answered nonsense.
    """
    if episodes < 1:
        raise ConfigError(f"must be at least 1, got {episodes}", key="episodes")
    settings = shown_to(policy, environment or EnvironmentSettings())
    settings = msgspec.structs.replace(settings, scenarios=(scenario,))
    outcomes = []
    for first in range(0, episodes, batch):
        count = min(batch, episodes - first)
        env = VectorEnv(settings, count, seed, first_slot=first, auto_reset=False)
        outcomes.append(sail(env, policy))
        if progress is not None:
            progress(count)
    return score(Outcomes(*map(np.concatenate, zip(*outcomes, strict=True))), seed)


def shown_to(policy: BatchPolicy, settings: EnvironmentSettings) -> EnvironmentSettings:
    """Give an environment that shows a policy what it was made for, when it was made for it."""
    return msgspec.structs.replace(
        settings,
        period_s=policy.period_s,
        observed_objects=policy.layout.objects,
        extended=policy.layout.extended,
        contour=policy.layout.contour,
    )


def evaluate_all(
    policy: BatchPolicy,
    rows: Iterable[ScenarioSettings],
    episodes: int,
    seed: int,
    *,
    environment: EnvironmentSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[Evaluation, ...]:
    """Give a policy's score in each of several scenarios; the arguments are those of `evaluate`."""
    return tuple(
        evaluate(policy, row, episodes, seed, environment=environment, progress=progress)
        for row in rows
    )


class Outcomes(NamedTuple):
    """How E episodes ended, with n vessels in all."""

    collided: Mask
    """(E,) Whether anything was touched."""
    late: Mask
    """(E,) Whether a vessel was still under way after the time limit."""
    times: Float64
    """(m,) [s] Travel times of the vessels that reached their goals."""
    rewards: Float64
    """(n,) [-] The sum of each vessel's rewards."""
    land: Mask
    """(E,) Whether land was touched."""
    fence: Mask
    """(E,) Whether a fence or the edge of a keep-out area was touched."""


def sail(env: VectorEnv, policy: BatchPolicy) -> Outcomes:
    """Sail one episode in every slot to its end."""
    seen, active = env.reset(), env.active
    sailed = active
    rewards = np.zeros(active.shape)
    policy.begin(*active.shape)
    collided, land, fence = np.zeros((3, env.episodes), bool)
    times = [np.zeros(0)]
    for _ in range(int(TIME_LIMIT_S / env.settings.period_s + 1e-9)):
        result = env.step(policy.rates(seen, active) / RATE_LIMIT)
        collided |= result.collided.any(axis=1)
        land |= result.touched_land.any(axis=1)
        fence |= result.touched_fence.any(axis=1)
        rewards += result.reward
        times.append(np.repeat(result.elapsed_s, result.reached.sum(axis=1)))
        seen, active = result.observation, env.active
        if not active.any():
            break
    late = np.asarray(active.any(axis=1))
    return Outcomes(collided, late, np.concatenate(times), rewards[sailed], land, fence)


def score(outcomes: Outcomes, seed: int) -> Evaluation:
    """Count what `sail` saw."""
    collided, late, times, rewards, land, fence = outcomes
    episodes = len(collided)
    successes = int((~(collided | late)).sum())
    interval = binomtest(successes, episodes).proportion_ci(0.95, "wilson")
    return Evaluation(
        episodes=episodes,
        success_rate=successes / episodes,
        wilson95=(float(interval.low), float(interval.high)),
        travel_time_s=float(times.mean()) if len(times) else None,
        collisions=int(collided.sum()),
        timeouts=int((late & ~collided).sum()),
        seed=seed,
        cumulative_reward=float(rewards.mean()),
        quays=int(land.sum()),
        fences=int(fence.sum()),
    )


# -- selection ------------------------------------------------------------------------------------


class Score(NamedTuple):
    """A policy on the paper's six settings."""

    settings: tuple[Evaluation, ...]
    """As published."""
    rough: tuple[Evaluation, ...] = ()
    """In rough conditions, where the run trains in them."""
    harbours: tuple[Evaluation, ...] = ()
    """In each kind of harbour that the run trains in."""

    @property
    def success(self) -> float:
        """[-] Mean success rate as published."""
        return _success(self.settings)

    @property
    def travel_time_s(self) -> float:
        """[s] Mean travel time as published; where no vessel arrived, the time limit counts."""
        times = [one.travel_time_s for one in self.settings]
        return float(np.mean([TIME_LIMIT_S if time is None else time for time in times]))

    @property
    def cumulative_reward(self) -> float:
        """[-] Mean over the settings of a vessel's summed rewards, as published."""
        return float(np.mean([one.cumulative_reward for one in self.settings]))

    @property
    def value(self) -> float:
        """What selection maximises: success in both conditions, and a little, speed."""
        every = (self.settings, self.rough, self.harbours)
        kinds = [_success(kind) for kind in every if kind]
        return float(np.mean(kinds)) - SECONDS_WORTH * self.travel_time_s

    def record(self) -> dict[str, Any]:
        """Give it as plain values."""
        record: dict[str, Any] = {
            "success": round(self.success, 5),
            "travel_time_s": round(self.travel_time_s, 3),
            "cumulative_reward": round(self.cumulative_reward, 4),
            "rates": [round(one.success_rate, 5) for one in self.settings],
            "times_s": [one.travel_time_s for one in self.settings],
        }
        if self.rough:
            record["rough_success"] = round(_success(self.rough), 5)
            record["rough_rates"] = [round(one.success_rate, 5) for one in self.rough]
        if self.harbours:
            record["harbour_success"] = round(_success(self.harbours), 5)
            record["harbour_rates"] = [round(one.success_rate, 5) for one in self.harbours]
            record["harbour_times_s"] = [one.travel_time_s for one in self.harbours]
        return record


def validate(
    policy: BatchPolicy,
    episodes: int,
    seed: int,
    rough: EnvironmentSettings | None = None,
    harbours: Sequence[Kind] = (),
) -> Score:
    """Sail `episodes` in each of the six settings, greedily, and as many in rough conditions.

    And half as many, of three vessels each, in every kind of harbour that is named.
    """
    rows = six_settings()
    score = Score(evaluate_all(policy, rows, episodes, seed))
    if rough is not None:
        score = score._replace(rough=evaluate_all(policy, rows, episodes, seed, environment=rough))
    if harbours:
        rows = harbour_rows(harbours)
        where = in_fresh_harbours(EnvironmentSettings(), seed)
        found = evaluate_all(policy, rows, -(-episodes // 2), seed, environment=where)
        score = score._replace(harbours=found)
    return score


def harbour_rows(kinds: Sequence[Kind], robots: int = 3) -> tuple[ScenarioSettings, ...]:
    """Give a row for each kind of harbour."""
    return tuple(ScenarioSettings(robots=robots, harbour=(kind,)) for kind in kinds)


def in_fresh_harbours(settings: EnvironmentSettings, seed: int) -> EnvironmentSettings:
    """Give an environment in which every episode has a harbour of its own, of this seed."""
    land = msgspec.structs.replace(settings.land, harbours=2**31 - 1, seed=seed)
    return msgspec.structs.replace(settings, land=land)


def in_current(settings: EnvironmentSettings, speed_mps: float) -> EnvironmentSettings:
    """Give an environment with a current of this greatest speed, of every kind in turn."""
    kinds = get_args(CurrentKind)
    conditions = msgspec.structs.replace(
        settings.conditions, current_mps=(speed_mps, speed_mps), currents=kinds
    )
    return msgspec.structs.replace(settings, conditions=conditions)


def _success(kind: tuple[Evaluation, ...]) -> float:
    return float(np.mean([one.success_rate for one in kind]))
