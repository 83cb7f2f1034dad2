"""Sail given episodes: those of an experiment, so that both simulators can be set side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.training.batch_policy import BatchPolicy
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.evaluate import Evaluation, sail, score
from twinscrew.training.perception import Observations
from twinscrew.training.scenarios import ScenarioSettings

FILE = "beginnings.json"
Complex = NDArray[np.complexfloating]


class Given(NamedTuple):
    """E episodes of V vessels and M buoys; places are north + i east."""

    start: Complex
    """(E, V) [m]"""
    heading: NDArray[np.float64]
    """(E, V) [rad]"""
    goal: Complex
    """(E, V) [m]"""
    buoy: Complex
    """(E, M) [m]"""


class GivenEnv(VectorEnv):
    """The training environment at given beginnings; noise is drawn as ever."""

    def __init__(self, given: Given, settings: EnvironmentSettings, seed: int) -> None:
        """Take `settings` but for the scenario."""
        robots, buoys = given.start.shape[1], given.buoy.shape[1]
        row = ScenarioSettings(robots=robots, buoys=buoys, min_distance_m=0.0)
        only = msgspec.structs.replace(settings, scenarios=(row,))
        super().__init__(only, len(given.start), seed, auto_reset=False)
        self._given = given

    def reset(self) -> Observations:
        """Begin the given episodes."""
        super().reset()
        given, state = self._given, self.state
        state.position[:], state.goal[:] = given.start, given.goal
        state.north_east[0], state.north_east[1] = given.start.real, given.start.imag
        state.heading[:], state.buoy[:] = given.heading, given.buoy
        return self.lookout.observe(state)


def read_given(path: Path) -> dict[str, Given]:
    """Read an experiment's episodes, by set.

    Raises
    ------
    ConfigError
        The folder has no such file, or it cannot be read.
    """
    file = path / FILE if path.is_dir() else path
    try:
        sets = json.loads(file.read_text())["sets"]
        return {one["name"]: _given(one["episodes"]) for one in sets}
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise ConfigError(f"no episodes of an experiment ({error!r})", file=file) from error


def evaluate_given(policy: BatchPolicy, given: Given, seed: int = 0) -> Evaluation:
    """Sail given episodes with one policy on every vessel; `seed` is of the noise."""
    settings = EnvironmentSettings(period_s=policy.period_s)
    return score(sail(GivenEnv(given, settings, seed), policy), seed)


def _given(episodes: list[dict[str, Any]]) -> Given:
    starts = np.array([one["starts"] for one in episodes], dtype=float)
    goals = np.array([one["goals"] for one in episodes], dtype=float)
    buoys = np.array([one["buoys"] for one in episodes], dtype=float).reshape(len(episodes), -1, 3)
    return Given(
        start=starts[..., 0] + 1j * starts[..., 1],
        heading=starts[..., 2],
        goal=goals[..., 0] + 1j * goals[..., 1],
        buoy=buoys[..., 0] + 1j * buoys[..., 1],
    )
