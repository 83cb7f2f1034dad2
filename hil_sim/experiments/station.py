"""Station keeping in the full simulator: how far off its place, and off its heading, a vessel is.

One vessel, the whole runtime in lock-step, open water. It starts beside its place with any heading,
is ordered to hold it, and is watched to the end. Wind and waves are those of a sea of config/sea;
the current comes from a direction that is drawn.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from msgspec.structs import replace

from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.voyage import Voyage
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.hil_sim.world import World
from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Station
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import load, shipped
from twinscrew.runtime.vessel.config import config_for
from twinscrew.runtime.vessel.replay import combined_sha256
from twinscrew.runtime.vessel_description import load_vessel

OFF_LENGTHS: Final = 3.0
"""[-] A vessel starts up to so many of its lengths north and east of its place."""
VRX_SHARE: Final = 0.75
"""[-] VRX's score weighs the heading's error by this to the power of the distance in metres."""
LIMIT_M, LIMIT_DEG = 1.0, 10.0
"""[m], [deg] RMS within which a station counts as held."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldTask:
    """One episode."""

    vessel: str = "wam_v"
    sea: str = "paper"
    current_mps: float = 0.5
    heading_deg: float | None = None
    """[deg] Asked for; None: into wind and current."""
    settle_s: float = 90.0
    """[s] From the order on: what comes later counts."""
    duration_s: float = 240.0
    """[s] From the order to the end."""
    seed: int = 0
    sensor: str = "vrx16"


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldRecord:
    """What became of it."""

    vessel: str
    seed: int
    current_from_deg: float
    """[deg] Where the current comes from."""
    arrived_s: float
    """[s] From the order until it was first within a metre."""
    rms_m: float
    """[m] Of the distance from the place."""
    most_m: float
    """[m] Greatest distance."""
    rms_deg: float
    """[deg] Of the heading, from what was asked for, or from where nothing pushes sideways."""
    vrx_score: float
    """[m + rad] Mean of distance + 0.75 ** distance x heading error; the smaller the better."""
    vrx_score_all: float
    """The same from the order on, with the way to the place."""
    mean_thrust_n: float
    """[N] Mean size of one propeller's thrust."""
    decisions_sha256: str

    @property
    def held(self) -> bool:
        """Whether place and heading were held within the limits."""
        return self.rms_m <= LIMIT_M and self.rms_deg <= LIMIT_DEG

    def as_dict(self) -> dict[str, Any]:
        """Give it for JSON."""
        return {**asdict(self), "held": self.held}


class _Holding(Voyage):
    """A voyage whose vessel is given a place to stay at, not a goal."""

    def hold(self, station: Station, duration_s: float) -> Float64:
        """Sail; gives rows (K, 6): north, east [m], heading [rad], two thrusts [N], time [s]."""
        self._wait_at_the_dock()
        self._world.release(0)
        self._deliver(0, "hold", cdr.encode_station(station))
        begin_s, rows = self._world.time_s, []
        while self._world.time_s - begin_s < duration_s:
            self._tick()
            state = self._world.state
            since_s = self._world.time_s - begin_s
            rows.append([*state.position_N[0, :2], state.heading[0], *state.thrust[0], since_s])
        return np.array(rows)


def sail_hold(task: HoldTask) -> HoldRecord:
    """Sail one episode."""
    vessel = load_vessel(task.vessel)
    rng = np.random.default_rng([task.seed, 17])
    towards = rng.uniform(-math.pi, math.pi)
    off_m = OFF_LENGTHS * vessel.length_m * rng.uniform(-1.0, 1.0, 2)
    start = np.array([[*off_m, rng.uniform(-math.pi, math.pi)]])
    sea = load(shipped("sea", task.sea), SeaSettings)
    current = (task.current_mps * math.cos(towards), task.current_mps * math.sin(towards))
    waves = replace(sea.waves, random_phase=True)
    sea = replace(sea, current_mps=current, waves=waves)
    world = World(_open_water(task.vessel, start), load_sensor(task.sensor), vessel, sea, task.seed)
    config = config_for(
        task.vessel,
        name="wamv1",
        sensor=task.sensor,
        envelope={"enabled": False},
        autopilot={"system_id": 1, "arm": True, "receiver_fitted": False},
    )
    crew = LockstepCrew([config], epoch_ns=world.epoch_ns)
    heading = None if task.heading_deg is None else math.radians(task.heading_deg)
    voyage = _Holding(world, crew, scan_s=0.1)
    station = Station(stamp_ns=0, position_N=np.zeros(2), heading=heading)
    rows = voyage.hold(station, task.duration_s)
    wanted = heading if heading is not None else free_heading(task.vessel, sea, rows[-1, 2])
    counted = rows[rows[:, 5] >= task.settle_s]
    apart = np.hypot(counted[:, 0], counted[:, 1])
    turned = wrap(counted[:, 2] - wanted)
    near = np.flatnonzero(np.hypot(rows[:, 0], rows[:, 1]) <= LIMIT_M)
    return HoldRecord(
        vessel=task.vessel,
        seed=task.seed,
        current_from_deg=round((math.degrees(towards) + 180.0) % 360.0, 1),
        arrived_s=round(float(rows[near[0], 5]), 1) if len(near) else math.inf,
        rms_m=round(float(np.sqrt((apart**2).mean())), 4),
        most_m=round(float(apart.max()), 4),
        rms_deg=round(math.degrees(float(np.sqrt((turned**2).mean()))), 3),
        vrx_score=round(vrx_score(apart, turned), 4),
        vrx_score_all=round(
            vrx_score(np.hypot(rows[:, 0], rows[:, 1]), wrap(rows[:, 2] - wanted)), 4
        ),
        mean_thrust_n=round(float(np.abs(counted[:, 3:5]).mean()), 1),
        decisions_sha256=combined_sha256([crew.vessels[0].publisher.sha256]),
    )


def vrx_score(distance_m: Float64, turned: Float64) -> float:
    """Give VRX's station-keeping score: the mean of d + 0.75^d h, h the heading's error [rad].

    Source: VRX 2.3, StationkeepingScoringPlugin; one number a sample, in metres and radians.
    """
    return float((distance_m + VRX_SHARE**distance_m * np.abs(turned)).mean())


def free_heading(vessel: str, sea: SeaSettings, near: float) -> float:
    """Give the heading at which wind and current do not push a resting hull sideways.

    The bow points into them; of several the one nearest to `near` [rad]. Without any, `near`.
    """
    calm = replace(sea, waves=replace(sea.waves, gain=0.0), wind=replace(sea.wind, gust_mps=0.0))
    dynamics = VesselDynamics(load_vessel(vessel))
    headings = np.linspace(-math.pi, math.pi, 3601)
    state = at_rest(dynamics, np.zeros((len(headings), 2)), headings)
    surge, sway = dynamics.acceleration(state, Sea(calm, np.random.default_rng(0)), 1000.0)[:, :2].T
    crosses = (sway[:-1] * sway[1:] <= 0.0) & (surge[:-1] < 0.0)
    free = headings[:-1][crosses]
    return float(free[np.argmin(np.abs(wrap(free - near)))]) if len(free) else near


def _open_water(vessel: str, starts: Float64) -> Scenario:
    return Scenario(
        name="open water",
        names=("wamv1",),
        types=(vessel,),
        starts=starts,
        goals=np.zeros((1, 2)),
        thrust_limits=np.array([math.inf]),
        buoys=np.empty((0, 3)),
        quays=np.empty((0, 6)),
        map_size=(50.0, 50.0),
        sea="paper",
        time_limit_s=math.inf,
        goal_radius=1.0,
    )
