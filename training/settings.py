"""Everything that a training run is configured by: one TOML file, read as this."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
from msgspec import Meta

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Count, Fraction, Positive, Settings, convert, read_toml
from twinscrew.training.agents import AnyAgentSettings
from twinscrew.training.collect import ExplorationSettings
from twinscrew.training.environment import EnvironmentSettings
from twinscrew.training.replay import PrioritySettings


class Phase(Settings, frozen=True, kw_only=True):
    """A stretch of training under its own conditions, as one line of the paper's curriculum."""

    name: str
    """What logs and progress call it."""
    steps: Count
    """[environment steps] How long; one step moves every vessel of every parallel episode."""
    keep_replay: bool = True
    """Go on with the old transitions; false where the rewards have changed."""
    environment: dict[str, Any] = msgspec.field(default_factory=dict)
    """What differs from `environment`."""
    agent: dict[str, Any] = msgspec.field(default_factory=dict)
    """What differs from `agent`, networks apart."""


class TrainSettings(Settings, frozen=True, kw_only=True):
    """A training run."""

    agent: AnyAgentSettings
    """The learner; `algorithm` names it."""
    environment: EnvironmentSettings = EnvironmentSettings()
    """Where it learns."""
    rough: dict[str, Any] = msgspec.field(default_factory=dict)
    """What differs from `environment` in rough episodes: what the sea and a real tracker do."""
    rough_share: Fraction = 0.0
    """[-] Share of the parallel episodes that are rough; if any, rough ones are validated too."""
    radius_margin: Positive = 1.25
    """[-] Factor on observed radii in the deployed policy; they average 0.8 of the true ones."""
    exploration: ExplorationSettings = ExplorationSettings()
    """How it tries out."""
    phases: Annotated[list[Phase], Meta(min_length=1)]
    """One after another."""
    parallel_episodes: Count = 64
    """[-] Episodes that run at once."""
    updates_per_step: Positive = 2.0
    """[-] Updates of the agent an environment step; below 1, one every few steps."""
    batch: Count = 256
    """[transitions] In an update."""
    replay: Count = 1_000_000
    """[transitions] Kept."""
    priority: PrioritySettings | None = None
    """Draw transitions by their loss; uniformly if this table is missing."""
    warm_up: Count = 20_000
    """[transitions] Gathered before the first update, and after the replay was emptied."""
    save_replay: bool = True
    """Keep the replay beside the checkpoint, 312 bytes a transition: a run that was cut off then
    goes on as if it had not been. Else it gathers `warm_up` transitions anew."""
    n_steps: Count = 3
    """[decisions] Rewards summed before the value of what follows is asked."""
    discount: Fraction = 0.99
    """[-] gamma, a decision (paper: 0.99)."""
    log_every: Count = 200
    """[environment steps] Between two lines of the log."""
    evaluate_every: Count = 5000
    """[environment steps] Between two evaluations, each with a checkpoint."""
    evaluation_episodes: Count = 100
    """[-] In each of the six settings of the paper's table."""
    validation_seed: int = 424_242
    """[-] Of the evaluations that select the best checkpoint; never used for reported figures."""

    @property
    def steps(self) -> int:
        """[environment steps] Of all phases."""
        return sum(phase.steps for phase in self.phases)


def load_training(file: Path, changes: Sequence[str] = ()) -> TrainSettings:
    """Read a training configuration; every phase's differences are checked at once.

    `extends = "other.toml"` lays a file over another one beside it, table by table; the agent is
    taken over only if the algorithm is the same. `changes` are laid over all, as "agent.risk=0.5".

    Raises
    ------
    ConfigError
        Names the file, the key, the value and what is allowed.
    """
    values = _read(file)
    for change in changes:
        values = _overlay(values, _changed(change))
    settings = convert(values, TrainSettings, file=file)
    for number, phase in enumerate(settings.phases):
        try:
            phase_settings(settings, phase)
        except ConfigError as error:
            raise ConfigError(f"phase {number + 1} ({phase.name}): {error}", file=file) from error
    return settings


def _read(file: Path, depth: int = 0) -> dict[str, Any]:
    values = read_toml(file)
    base = values.pop("extends", None)
    if base is None:
        return values
    if not isinstance(base, str) or depth > 8:
        raise ConfigError(f"expected the name of a file beside this one, got {base!r}", file=file)
    under = _read(file.parent / base, depth + 1)
    names = [table.get("agent", {}).get("algorithm") for table in (under, values)]
    if names[1] is not None and names[0] != names[1]:
        del under["agent"]
    return _overlay(under, values)


def _changed(text: str) -> dict[str, Any]:
    """Read "agent.risk=0.5" as nested tables; a value that is no TOML is a string."""
    key, equals, value = text.partition("=")
    names = [name.strip() for name in key.split(".")]
    if not equals or not all(names):
        raise ConfigError(f"expected key=value, as agent.risk=0.5, got {text!r}", key="--set")
    try:
        read: Any = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        read = value.strip()
    for name in reversed(names):
        read = {name: read}
    changed: dict[str, Any] = read
    return changed


class PhaseSettings(NamedTuple):
    """What holds in a phase."""

    agent: AnyAgentSettings
    calm: EnvironmentSettings
    rough: EnvironmentSettings


def phase_settings(settings: TrainSettings, phase: Phase) -> PhaseSettings:
    """Give the agent's and the environments' settings in a phase."""
    for key in {"network", "risk_levels", "precision", "bfloat16"} & phase.agent.keys():
        raise ConfigError("the networks stay the same over all phases", key=f"agent.{key}")
    calm = merged(settings.environment, phase.environment)
    return PhaseSettings(
        convert(merged(settings.agent, phase.agent), type(settings.agent)),
        convert(calm, EnvironmentSettings),
        convert(_overlay(calm, settings.rough), EnvironmentSettings),
    )


def merged(base: Settings, changes: dict[str, Any]) -> dict[str, Any]:
    """Give settings as plain values, with changes laid over them table by table."""
    return _overlay(msgspec.to_builtins(base), changes)


def _overlay(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    both = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, dict) and isinstance(both.get(key), dict)
        both[key] = _overlay(both[key], value) if nested else value
    return both


def parse_seeds(text: str) -> list[int]:
    """Read seeds as they are typed: "0,1,2".

    Raises
    ------
    ConfigError
        They are no such list, or one comes twice.
    """
    words = text.split(",")
    if not all(word.strip().isdecimal() for word in words) or len(set(words)) < len(words):
        raise ConfigError(f"expected different numbers as 0,1,2, got {text!r}", key="--seeds")
    return [int(word) for word in words]
