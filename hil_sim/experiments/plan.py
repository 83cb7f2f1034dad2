"""What an experiment consists of: methods, sets of episodes, switches, and each episode's seed.

A set says how many vessels and buoys there are. A switch makes the simulator simpler in one respect
that the training environment lacks; what the success rate gains, the difference cost.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta, structs

from twinscrew.hil_sim.experiments import chance
from twinscrew.hil_sim.random_scenario import Buoys, Vessels
from twinscrew.hil_sim.scenario import Scenario, as_chart, load_scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.supervisor import SupervisorSettings
from twinscrew.hil_sim.vessel.dynamics import DynamicsSettings, as_vrx
from twinscrew.runtime.errors import ConfigError, PolicyError, one_of
from twinscrew.runtime.policy.load import PLANNERS, load_policy
from twinscrew.runtime.settings import CONFIG_DIR, Count, Settings, load, shipped
from twinscrew.runtime.vessel_description import VesselDescription, load_vessel

Name = Annotated[str, Meta(min_length=1)]


class SetSettings(Settings, frozen=True, kw_only=True):
    """Episodes of one kind."""

    name: Name
    """What tables call it."""
    scenario: str = "random"
    """A name in config/scenarios, SERIES:CASE (`hil_sim.scenario.SERIES`), or a file."""
    cases: tuple[str, ...] = ()
    """Scenarios that the episodes sail in turn, instead of that one."""
    vessels: Vessels | None = None
    """[-] None: the scenario says it."""
    buoys: Buoys | None = None
    """[-] None: the scenario says it."""
    types: tuple[str, ...] = ()
    """What sails, in turn: names in config/vessels, or files; none: the scenario says it."""

    def draw(self, seed: int, episode: int = 0) -> Scenario:
        """Give an episode's beginning; a `ConfigError` if there can be none."""
        scenario = self.cases[episode % len(self.cases)] if self.cases else self.scenario
        return load_scenario(scenario, self.vessels, self.buoys, seed, self.types)


class SetsFile(Settings, frozen=True, kw_only=True):
    """A file of sets."""

    finite: ClassVar[bool] = False
    set: Annotated[tuple[SetSettings, ...], Meta(min_length=1)]
    published_travel_time_s: dict[str, tuple[float, ...]] = msgspec.field(default_factory=dict)
    """[s] By method, one a set, to compare with; nan where there is none."""

    def __post_init__(self) -> None:
        """Refuse sets that could be taken for each other, and rows of a wrong length."""
        names = [one.name for one in self.set]
        if len(set(names)) < len(names):
            raise ValueError(f"two sets have the same name: {names}")
        for method, row in self.published_travel_time_s.items():
            if len(row) != len(names):
                raise ValueError(f"{method}: {len(row)} travel times for {len(names)} sets")


def load_sets(name: str | Path) -> SetsFile:
    """Read sets: `paper`, or a file.

    Raises
    ------
    ConfigError
        No such file, or one of its sets cannot be sailed.
    """
    path = shipped("experiments", name)
    sets = load(path, SetsFile)
    for one in sets.set:
        try:
            one.draw(seed=0)
        except ConfigError as error:
            raise ConfigError(f"set {one.name!r}: {error}", file=path) from error
    return sets


# -- Switches that make the simulator simpler, one by one, to see which of them explains a gap.
#
# The training environment is simpler than the simulator in perception, sea and dynamics. With a
# switch on, one difference is gone; what the success rate gains by it, the difference cost.

ABLATIONS = {
    "ideal_perception": "the tracker is given the true centres and radii of what is in range",
    "ideal_tracking": "the policy is given the true centres, radii and velocities",
    "no_wind": "no wind",
    "no_waves": "flat water",
    "no_assurance": "the policy's thrust goes to the propellers unchecked, as in the paper",
    "no_chart": "the vessels have no chart: of land they know what their sensors see",
    "ideal_thrust": "commands reach the propellers as they are, not as the autopilot's pulses",
    "training_vessel": "mass, inertia, drag and thrusters of the training environment",
    "as_vrx": "VRX's own physics: wind coefficients along the world's axes, steps of 50 ms",
    "goal_4m": "a goal is reached within 4 m, as the authors' code has it for APF and MPC",
    "vanish": "vessels leave the map at their goals, as in training",
}
"""What each switch does."""
PRESETS = {
    "gap": (
        "no_assurance",
        "ideal_perception",
        "ideal_tracking",
        "no_wind",
        "no_waves",
        "ideal_thrust",
        "training_vessel",
        "vanish",
    )
}
"""Switches by one name: `gap` is all that training does not have."""
FULL = "full"
"""The simulator as it is."""
Switches = tuple[str, ...]


def parse_ablations(text: str, key: str = "--ablate") -> Switches:
    """Read switches as people type them: names with commas between them, `gap` for many."""
    parts = [part.strip() for part in text.split(",") if part.strip()]
    names = tuple(dict.fromkeys(name for part in parts for name in PRESETS.get(part, (part,))))
    for name in names:
        if name not in ABLATIONS:
            raise ConfigError(one_of(name, (*ABLATIONS, *PRESETS)), key=key)
    return names


def variants(switches: Switches, base: Switches = ()) -> tuple[Switches, ...]:
    """Give what is sailed: the base, every switch alone with it, then all of them at once.

    The base is the full simulator, or what its switches leave of it.
    """
    added = tuple(switch for switch in switches if switch not in base)
    together = (added,) if len(added) > 1 else ()
    return tuple((*base, *some) for some in ((), *((switch,) for switch in added), *together))


def label(switches: Iterable[str]) -> str:
    """Give a variant's name, as "full" or "no_wind+no_waves"."""
    return "+".join(switches) or FULL


def calmed(sea: SeaSettings, switches: Switches) -> SeaSettings:
    """Take wind or waves away."""
    if "no_wind" in switches:
        wind = structs.replace(sea.wind, mean_mps=0.0, gust_mps=0.0)
        sea = structs.replace(sea, wind=wind)
    if "no_waves" in switches:
        sea = structs.replace(sea, waves=structs.replace(sea.waves, gain=0.0))
    return sea


def vessel_of(switches: Switches, vessel: VesselDescription) -> VesselDescription:
    """Give the vessel that sails: the scenario's, or one that moves as the training's does."""
    if "training_vessel" not in switches:
        return vessel
    trained = load_vessel(CONFIG_DIR / "experiments" / "training_vessel.toml")
    return replace(trained, boxes=vessel.boxes, cylinders=vessel.cylinders)


def dynamics(switches: Switches) -> DynamicsSettings:
    """Say whose physics it is."""
    return as_vrx() if "as_vrx" in switches else DynamicsSettings()


def eased(scenario: Scenario, switches: Switches) -> Scenario:
    """Widen the goals."""
    return replace(scenario, goal_radius=4.0) if "goal_4m" in switches else scenario


def unassured(switches: Switches) -> dict[str, bool]:
    """Let the policy's commands pass unchecked: what the assurance's table then says."""
    return {"enabled": False} if "no_assurance" in switches else {}


def chart_of(switches: Switches, scenario: Scenario) -> dict[str, Any]:
    """Give the chart that a scenario's vessels have: their configuration's table `[chart]`."""
    return {"from_scenario": False} if "no_chart" in switches else as_chart(scenario)


def supervision(switches: Switches) -> SupervisorSettings:
    """Say what becomes of a vessel that has arrived."""
    return SupervisorSettings(after_goal="vanish" if "vanish" in switches else "hold")


# -- What an experiment consists of: methods, sets, episodes, variants; and each episode's seed.

CLASSICAL = PLANNERS
CHANCE = chance.NAME


class Method(Settings, frozen=True, kw_only=True):
    """A policy under test."""

    name: str
    """What tables call it."""
    policy: str
    """`apf`, `mpc`, `orca`, `random`, the name of a shipped policy, or an ONNX file."""
    sha256: str
    """Of the policy's file, or of the baseline's settings: what was tested."""


class Experiment(Settings, frozen=True, kw_only=True):
    """Everything that decides the results; kept in the results' folder."""

    methods: tuple[Method, ...]
    sets: tuple[SetSettings, ...]
    episodes: Count = 100
    """[-] A set, a method and a variant."""
    seed: int = 0
    sensor: str = "vrx32"
    variants: tuple[Switches, ...] = ((),)
    """Switches of each variant (`ablations`); () is the full simulator."""
    suite: str = ""
    """The suite it is (`suites.SUITES`), whose figures are counted; empty: none."""


class Key(NamedTuple):
    """Which episode."""

    method: str
    set: str
    variant: str
    episode: int


class Task(NamedTuple):
    """All that a worker must know to sail an episode."""

    method: Method
    set: SetSettings
    switches: Switches
    episode: int
    seed: int
    sensor: str


def episode_seed(seed: int, set_name: str, episode: int) -> int:
    """Give the seed of an episode: the same for every method and variant, other sets differ.

    It is what `twinscrew sitl --lockstep --seed` takes.
    """
    name = int.from_bytes(hashlib.sha256(set_name.encode()).digest()[:8], "little")
    return int(np.random.SeedSequence((seed, name, episode)).generate_state(1)[0])


def tasks(experiment: Experiment) -> Iterator[Task]:
    """Give every episode: the first of all sets and methods, then the second, and so on.

    So an experiment that was broken off is a smaller one, with the same weight on every set.
    """
    for episode, one in product(range(experiment.episodes), experiment.sets):
        seed = episode_seed(experiment.seed, one.name, episode)
        for switches, method in product(experiment.variants, experiment.methods):
            yield Task(method, one, switches, episode, seed, experiment.sensor)


def parse_methods(text: str) -> tuple[Method, ...]:
    """Read methods as people type them: `ac_iqn,apf,mine=path/to/policy.onnx`.

    Raises
    ------
    ConfigError
        None is named, or one twice.
    PolicyError
        There is no such policy, or its file is none: found out before anything is sailed.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    methods = tuple(_method(part) for part in parts)
    names = [method.name for method in methods]
    if not names or len(set(names)) < len(names):
        raise ConfigError(f"name each method once, got {text!r}", key="--methods")
    return methods


def check(method: Method) -> None:
    """Raise a `PolicyError` if a method's policy is not any more what it was."""
    found = policy_sha256(method.policy)
    if found != method.sha256:
        raise PolicyError(
            f"method {method.name!r}: {method.policy} has changed since these results were begun "
            f"(SHA-256 {found[:12]}..., was {method.sha256[:12]}...)"
        )


def policy_sha256(policy: str) -> str:
    """Give the hash of what decides: the ONNX file, the baseline's settings, or the code."""
    if policy == CHANCE:
        path = Path(chance.__file__)
    elif policy in CLASSICAL:
        path = shipped("policies", policy)
    else:
        path = shipped("policies", policy, ".onnx")
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _method(part: str) -> Method:
    name, _, policy = part.partition("=")
    if policy:
        policy = str(Path(policy).resolve())
    elif name.endswith(".onnx"):
        name, policy = Path(name).stem, str(Path(name).resolve())
    else:
        policy = name
    try:
        if policy != CHANCE:
            load_policy(policy)
        return Method(name=name, policy=policy, sha256=policy_sha256(policy))
    except (PolicyError, ConfigError) as error:
        raise PolicyError(
            f"method {name!r} has no policy: {error}; {name}=FILE.onnx names a file"
        ) from error
