"""Perception, tracking and thrust replaced by the truth: how a policy does without their faults."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.bodies import ABSENT
from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.world import World
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64, Objects, Odometry, PointCloud, Tracks
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.perception.stage import Perception
from twinscrew.runtime.tracking.tracker import Tracker

POINTS = 100
"""[-] Number of points an ideal object claims to have: more than any stage asks for."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What truly is around a vessel, K bodies."""

    p_N: Float64
    """[m] [N] (K, 2) From the vessel's origin to the bodies' centres."""
    v_N: Float64
    """[m/s] [N] (K, 2) Over ground."""
    radius: Float64
    """[m] (K,) Of the circles with which contacts are judged."""
    row: NDArray[np.int64]
    """(K,) The bodies' numbers in the world."""


def surroundings(world: World, vessel: int, reach_m: float) -> Surroundings:
    """Give every vessel and buoy of which something is within reach.

    Raises
    ------
    ConfigError
        The scenario has quays: they are no circles.
    """
    if len(world.scenario.quays):
        raise ConfigError("a quay is no circle: not with ideal perception", key="--ablate")
    bodies = world.bodies()
    buoys = world.scenario.buoys[:, 2]
    radius = np.r_[np.full(world.scenario.vessels, world.parameters.collision_radius_m), buoys]
    p_N = bodies.position_N[:, :2] - bodies.position_N[vessel, :2]
    seen = (bodies.shape != ABSENT) & (np.hypot(*p_N.T) <= reach_m + radius)
    seen[vessel] = False
    v_N = np.zeros_like(p_N) if bodies.velocity_N is None else bodies.velocity_N[:, :2]
    return Surroundings(p_N[seen], v_N[seen], radius[seen], np.flatnonzero(seen))


class TruePerception(Perception):
    """Finds every object where it is, of its true size; the cloud is not looked at."""

    def __init__(self, sensor: Sensor, world: World, vessel: int) -> None:
        """See around one vessel of a world, as far as perception is set to."""
        super().__init__(sensor)
        self._world = world
        self._vessel = vessel

    def step(
        self,
        cloud: PointCloud,
        q_NB: Float64,  # noqa: ARG002  (the truth needs no odometry)
        rates_B: Float64 | None = None,  # noqa: ARG002
        velocity_B: Float64 | None = None,  # noqa: ARG002
    ) -> Objects:
        """Give the objects around the vessel now; see `Perception.step`."""
        around = surroundings(self._world, self._vessel, self.settings.max_range_m)
        heading = self._world.state.heading[self._vessel]
        c, s = np.cos(heading), np.sin(heading)
        return Objects(
            stamp_ns=cloud.stamp_ns,
            p_B=around.p_N @ np.array([[c, -s], [s, c]]),
            radius=around.radius,
            points=np.full(len(around.radius), POINTS, dtype=np.int64),
        )


class TrueTracker(Tracker):
    """Knows every object's centre, size and velocity; what perception found is not looked at."""

    def __init__(self, world: World, vessel: int, reach_m: float) -> None:
        """Follow what is around one vessel of a world."""
        super().__init__()
        self._world = world
        self._vessel = vessel
        self._reach_m = reach_m

    def step(self, objects: Objects, odometry: Odometry) -> Tracks:
        """Give the tracks around the vessel now; see `Tracker.step`."""
        around = surroundings(self._world, self._vessel, self._reach_m)
        count = len(around.radius)
        return Tracks(
            stamp_ns=objects.stamp_ns,
            id=around.row,
            p_N=around.p_N + odometry.position_N[:2],
            v_N=around.v_N,
            radius=around.radius,
            covariance=np.zeros((count, 4, 4)),
            age_s=np.zeros(count),
        )


class DirectCrew(LockstepCrew):
    """Propellers that do what the runtimes command, not what is left of it in 1 us pulses."""

    def thrust_N(self) -> Float64:
        """Give each armed vessel's present command, (V, 2) [N]; see `Crew`."""
        return np.array([vessel.controller.thrust for vessel in self.vessels])
