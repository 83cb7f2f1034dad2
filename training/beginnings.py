"""How episodes begin: who is where, what is seen at first, and which chances the sea gets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from twinscrew.runtime.messages.types import Float64
from twinscrew.training.conditions import CHANCES
from twinscrew.training.environment_settings import EnvironmentSettings
from twinscrew.training.perception import Things, see_ego, see_objects
from twinscrew.training.perception_noise import draw
from twinscrew.training.placement import sample
from twinscrew.training.scenario_pool import Beginning


def begin(
    s: EnvironmentSettings, generators: Sequence[Generator], cumulative: Float64
) -> Beginning:
    """Draw episodes with all that depends on them alone.

    Parameters
    ----------
    s
        The environment.
    generators
        N, one an episode.
    cumulative : (R,) float64
        [-] Running sum of the shares of the rows of `s.scenarios`.
    """
    vessels, buoys = s.shape
    row = np.searchsorted(cumulative, [g.random() for g in generators], side="right")
    scenario = sample(s.scenarios, row, s.map, generators, (vessels, buoys))
    noise = draw(s.noise, generators, (vessels, vessels + buoys))
    heading = np.exp(1j * scenario.heading)
    shape = (len(generators), vessels)
    things = Things(
        position=np.concatenate([scenario.start, scenario.buoy], axis=1),
        velocity=np.zeros((len(generators), vessels + buoys), complex),
        radius=s.radius,
        there=np.concatenate([scenario.vessel, scenario.buoy_there], axis=1),
    )
    objects, mask = see_objects(heading, things, noise, s.range_m, s.observed_objects)
    at_rest, idle = np.zeros((3, *shape)), np.zeros((2, *shape))
    ego = see_ego(scenario.start, heading, scenario.goal, at_rest, idle)
    there = scenario.vessel.astype(np.float32)[..., None]
    chance = np.stack([g.random((vessels + 1, CHANCES)) for g in generators])
    return Beginning(scenario, ego * there, objects * there[..., None], mask * there, chance)
