"""What an experiment consists of: methods, sets, episodes, variants; and each episode's seed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from twinscrew.hil_sim.experiments import chance
from twinscrew.hil_sim.experiments.ablations import Switches
from twinscrew.hil_sim.experiments.sets import SetSettings
from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.settings import Count, Settings, shipped

CLASSICAL = ("apf", "mpc")
CHANCE = chance.NAME


class Method(Settings, frozen=True, kw_only=True):
    """A policy under test."""

    name: str
    """What tables call it."""
    policy: str
    """`apf`, `mpc`, `random`, the name of a shipped policy, or an ONNX file."""
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
        path = shipped("experiments", policy)
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
