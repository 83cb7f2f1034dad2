"""Where faults are tried: a lane a vessel, so far apart that none sees another's trouble."""

from __future__ import annotations

import math

import numpy as np

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.traffic import TrafficEntry
from twinscrew.runtime.vessel_description import DEFAULT

LANE_M = 80.0
"""[m] Between lanes: perception ends at 20 m."""
BUOY_EVERY_M = 12.0
"""[m] Along a lane, so that there always is something to see."""
BUOY_ASIDE_M = 15.0
"""[m] From the lane: near enough to be followed, too far to be in the way of turning about."""
GOAL_M = 200.0
"""[m] Farther than any vessel comes in the time."""
BUOY_RADIUS_M = 0.75
"""[m] As in the paper's maps."""


SHIP = TrafficEntry(
    start_m=(600.0, -400.0),
    course_deg=90.0,
    speed_mps=4.0,
    length_m=30.0,
    beam_m=8.0,
    name="HONEST",
)
"""A ship that reports itself, far from the lanes."""


def lanes(count: int, duration_s: float, *, ship: bool = False) -> Scenario:
    """Make a scenario: every vessel sails north, for a time [s]; `ship`: one reports itself."""
    east = LANE_M * np.arange(count)
    north = np.arange(0.0, GOAL_M, BUOY_EVERY_M)
    side = np.where(np.arange(len(north)) % 2, BUOY_ASIDE_M, -BUOY_ASIDE_M)
    buoys = [(n, e + s, BUOY_RADIUS_M) for e in east for n, s in zip(north, side, strict=True)]
    return Scenario(
        name="lanes",
        names=tuple(f"wamv{i + 1}" for i in range(count)),
        types=(DEFAULT,) * count,
        starts=np.column_stack([np.zeros(count), east, np.zeros(count)]),
        goals=np.column_stack([np.full(count, GOAL_M), east]),
        thrust_limits=np.full(count, math.inf),
        buoys=np.array(buoys),
        quays=np.empty((0, 6)),
        map_size=(GOAL_M, LANE_M * count),
        sea="paper",
        time_limit_s=duration_s,
        goal_radius=2.0,
        traffic=(SHIP,) if ship else (),
    )
