"""Everything that moves: vessels in the sea, what their sensors say, how near they came.

The world does what it is told: who arrived, collided or ran out of time is the supervisor's to say.
Its time is an integer count of steps, so that it never drifts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray

from twinscrew.hil_sim import contacts, odometry, scene
from twinscrew.hil_sim.bodies import ABSENT, Bodies
from twinscrew.hil_sim.contacts import HullCircles, Obstacles, Shore
from twinscrew.hil_sim.lidar import Lidar, LidarSettings, Scan
from twinscrew.hil_sim.mooring import moor
from twinscrew.hil_sim.odometry import OdometrySettings
from twinscrew.hil_sim.scenario import Scenario, land_areas
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings
from twinscrew.hil_sim.traffic import Traffic
from twinscrew.hil_sim.vessel.dynamics import DynamicsSettings, FleetDynamics
from twinscrew.hil_sim.vessel.rest import fleet_at_rest
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Odometry, PointCloud
from twinscrew.runtime.perception.sensor import Sensor, load_sensor
from twinscrew.runtime.settings import Positive, Settings, load, shipped
from twinscrew.runtime.vessel.hull_settings import lidar_on
from twinscrew.runtime.vessel_description import VesselDescription, load_vessel

EPOCH_NS = 1_735_689_600 * NANOSECONDS_PER_SECOND
"""[ns] When a simulation begins, unless told otherwise: 2025-01-01 00:00 UTC."""


Touched: TypeAlias = Literal["vessel", "buoy", "quay", "fence", "traffic"]
"""What a vessel was in contact with: a buoy may be a pile; a quay land, a rock, or the ground; a
fence a keep-out area."""


CURRENT_STEPS = 10
"""[-] How often the water's speed is noted: every so many steps."""


class WorldSettings(Settings, frozen=True, kw_only=True):
    """How the world is simulated. The defaults are the paper's experiments."""

    dynamics: DynamicsSettings = DynamicsSettings()
    lidar: LidarSettings = LidarSettings()
    odometry: OdometrySettings = OdometrySettings()
    mooring_radps: Positive = 0.5
    """[rad/s] Frequency of a mooring. It brakes 3.3 m/s with 3.3 m/s2 at first: what both
    propellers do full astern (1000 N on 300 kg)."""


class World:
    """Vessels and all that is fixed of a scenario in a sea, fully determined by the seed."""

    def __init__(
        self,
        scenario: Scenario,
        sensor: Sensor,
        vessels: VesselDescription | Sequence[VesselDescription],
        sea: SeaSettings,
        seed: int,
        *,
        settings: WorldSettings | None = None,
        epoch_ns: int = EPOCH_NS,
    ) -> None:
        """Put everything at its start, at rest, at time `epoch_ns`.

        `vessels` are what sails, one a vessel of the scenario, or one kind for all. Each carries
        the sensor at its own place.
        """
        self.scenario = scenario
        if isinstance(vessels, VesselDescription):
            vessels = [vessels] * scenario.vessels
        self.vessels: tuple[VesselDescription, ...] = tuple(vessels)
        """Each vessel's description."""
        self.settings = settings or WorldSettings()
        self.epoch_ns = epoch_ns
        self.step_ns = round(self.settings.dynamics.step_s * NANOSECONDS_PER_SECOND)
        self.steps = 0
        # One independent stream a use: the sea, then each vessel's LiDAR and odometry.
        for_sea, *for_vessels = SeedSequence(seed).spawn(1 + scenario.vessels)
        self.sea = Sea(sea, np.random.default_rng(for_sea), scenario.current)
        self._seeds = for_vessels
        streams = [[np.random.default_rng(s) for s in v.spawn(2)] for v in for_vessels]
        self._lidar_rng: list[Generator] = [pair[0] for pair in streams]
        self._odometry_rng: list[Generator] = [pair[1] for pair in streams]
        self._dynamics = FleetDynamics(self.vessels, self.settings.dynamics)
        shapes = scene.shapes(scenario, self.vessels)
        self._shapes = scene.shape_numbers(scenario, self.vessels)
        kinds = {
            vessel.key: (vessel, int(n))
            for vessel, n in zip(self.vessels, self._shapes, strict=True)
        }
        self._lidars = {
            key: Lidar(lidar_on(sensor, vessel), self.settings.lidar, shapes, number)
            for key, (vessel, number) in kinds.items()
        }
        self.traffic: Traffic | None = Traffic(scenario.traffic) if scenario.traffic else None
        """Scripted ships; None without any."""
        self._first_traffic = len(shapes) - len(scenario.traffic)
        self._under_way = False
        self._obstacles = self._solid()
        self._hulls = HullCircles(self.vessels)
        self._ashore = _grounds(scenario, self.vessels)
        rules = StaticMap.of([f for f in scenario.charted if f.kind in ("keep_out", "fence")])
        self._fences = None if rules.is_empty else Shore(rules, self.vessels)
        counts = {
            "vessel": scenario.vessels,
            "buoy": len(scenario.circles),
            "quay": len(scenario.quays),
            "traffic": len(scenario.traffic),
        }
        self._kinds: list[Touched] = [
            kind for kind in ("vessel", "buoy", "quay", "traffic") for _ in range(counts[kind])
        ]
        if self._ashore:
            self._kinds.append("quay")
        starts = scenario.starts
        self.state = fleet_at_rest(self._dynamics, starts[:, :2], starts[:, 2])
        self.present: NDArray[np.bool_] = np.ones(scenario.vessels, dtype=np.bool_)
        self.moored: NDArray[np.bool_] = np.zeros(scenario.vessels, dtype=np.bool_)
        self._moorings_N = scenario.starts.copy()
        self._push_N = np.zeros((scenario.vessels, 2))
        self._closest = np.full(scenario.vessels, np.inf)
        self._greatest_current = np.zeros(scenario.vessels)
        self._bodies: tuple[int, Bodies] | None = None
        self._watchers: list[Callable[[], None]] = []
        self._measure_reaches()
        self._measure_gaps()

    @property
    def time_s(self) -> float:
        """[s] Since the beginning."""
        return self.steps * self.step_ns / NANOSECONDS_PER_SECOND

    @property
    def stamp_ns(self) -> int:
        """[ns] Now."""
        return self.epoch_ns + self.steps * self.step_ns

    @property
    def step_s(self) -> float:
        """[s] Length of one step."""
        return self.step_ns / NANOSECONDS_PER_SECOND

    @property
    def gaps(self) -> Float64:
        """[m] (V, V + B + Q + T) Distances between surfaces now, see `contacts.gaps`.

        One more column, the last, is the distance from land, rocks and the ground, if there are.
        """
        return self._gaps

    @property
    def fence_gap(self) -> Float64:
        """[m] (V,) From each hull to the nearest fence or keep-out area; above 0 if none broken."""
        return self._fence_gap

    @property
    def nearest(self) -> Float64:
        """[m] (V,) Least of each vessel's gaps now."""
        return self._nearest

    @property
    def closest_approach(self) -> Float64:
        """[m] (V,) Least gap while under way so far: negative after a collision."""
        return self._closest.copy()

    @property
    def greatest_current(self) -> Float64:
        """[m/s] (V,) The fastest water that each vessel has been in so far."""
        return self._greatest_current.copy()

    def touched(self, vessel: int) -> Touched | None:
        """Tell what a vessel is in contact with now, most of all; None if with nothing."""
        if self._nearest[vessel] <= 0.0:
            return self._kinds[int(self._gaps[vessel].argmin())]
        return "fence" if self._fence_gap[vessel] <= 0.0 else None

    def step(self, commands: Float64) -> None:
        """Move everything on by one step, under thrust commands (V, 2) [N], left and right."""
        self._step(self._checked(commands))

    def advance(
        self, duration_s: float, commands: Float64, until: Callable[[], bool] | None = None
    ) -> None:
        """Move everything on by a whole number of steps, under held commands (V, 2) [N].

        `until` is asked after every step; the world stops when it says so.
        """
        commands = self._checked(commands)
        for _ in range(self.steps_in(duration_s)):
            self._step(commands)
            if until is not None and until():
                return

    def steps_in(self, duration_s: float) -> int:
        """Give how many steps a duration is; a ValueError if it is not a whole number."""
        steps = duration_s / self.step_s
        if not np.isfinite(steps) or steps < 0 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(f"{duration_s} s is no whole number of steps of {self.step_s} s")
        return round(steps)

    def watch(self, look: Callable[[], None]) -> None:
        """Have `look` called after every step, for sensors that are faster than the LiDAR."""
        self._watchers.append(look)

    def random(self, vessel: int) -> Generator:
        """Give a new stream of random numbers, of one more sensor of a vessel."""
        return np.random.default_rng(self._seeds[vessel].spawn(1)[0])

    def moor(self, vessel: int, mooring_N: Float64) -> None:
        """Hold a vessel at a place, (2,) [m], on its present heading; commands no longer count."""
        self.moored[vessel] = True
        self._moorings_N[vessel] = [*mooring_N, self.state.heading[vessel]]

    def release(self, vessel: int) -> None:
        """Let go of a moored vessel; with the first one traffic gets under way."""
        self.moored[vessel] = False
        self._under_way = True

    def remove(self, vessel: int) -> None:
        """Take a vessel off the map: nobody sees or touches it any more."""
        self.present[vessel] = False
        self._bodies = None
        self._measure_reaches()

    def odometry(self, vessel: int) -> Odometry:
        """Give a vessel's odometry now."""
        rng = self._odometry_rng[vessel]
        return odometry.measure(self.state, vessel, self.stamp_ns, self.settings.odometry, rng)

    def cloud(self, vessel: int) -> PointCloud:
        """Give a vessel's LiDAR scan that ends now."""
        return self.scan(vessel).cloud

    def scan(self, vessel: int) -> Scan:
        """Give a vessel's scan that ends now, and the truth: rows are vessels, buoys, quays."""
        lidar = self._lidars[self.vessels[vessel].key]
        return lidar.scan(self.bodies(), vessel, self.stamp_ns, self._lidar_rng[vessel])

    def bodies(self) -> Bodies:
        """Give all that can be seen now: vessels, buoys, all that stands as one body, traffic."""
        if self._bodies is None or self._bodies[0] != self.steps:
            shapes = np.where(self.present, self._shapes, ABSENT)
            bodies = scene.bodies(
                self.scenario,
                self.state,
                shapes,
                self.sea,
                self.time_s,
                self.traffic,
                self._first_traffic,
            )
            self._bodies = self.steps, bodies
        return self._bodies[1]

    def _checked(self, commands: Float64) -> Float64:
        commands = np.asarray(commands, dtype=np.float64)
        if commands.shape != (self.scenario.vessels, 2) or not np.isfinite(commands).all():
            raise ValueError(f"commands must be {self.scenario.vessels} pairs of finite numbers")
        limit = self.scenario.thrust_limits[:, None]
        return np.clip(commands, -limit, limit)

    def _step(self, commands: Float64) -> None:
        free = self.present & ~self.moored
        state = self._dynamics.step(
            self.state, commands * free[:, None], self.sea, self.time_s, self.step_s
        )
        if self.moored.any():
            w = self.settings.mooring_radps
            R_NB = scene.rotations(state.q_NB)
            state = moor(state, R_NB, self.moored, self._moorings_N, w, self.step_s)
        if self._push_N.any():
            state = self._pushed(state, free)
        self.state = state
        self.steps += 1
        if self.traffic is not None and self._under_way:
            self.traffic.step(self.step_s)
            self._obstacles = self._solid()
        self._measure_gaps()
        self._measure_current()
        for look in self._watchers:
            look()

    def _solid(self) -> Obstacles:
        """Give what vessels can hit, besides each other and land: quays and ships as boxes."""
        boxes = self.scenario.quays
        if self.traffic is not None:
            boxes = np.concatenate([boxes, self.traffic.boxes])
        return Obstacles(circles=self.scenario.circles, boxes=boxes)

    def push(self, vessel: int, force_N: tuple[float, float]) -> None:
        """Let a force act on a vessel from now on, north and east [N], beyond the sea's own."""
        self._push_N[vessel] = force_N

    def _pushed(self, state: VesselState, free: NDArray[np.bool_]) -> VesselState:
        mass = np.array([vessel.mass_kg for vessel in self.vessels])
        gained = np.zeros((len(mass), 3))
        gained[:, :2] = self._push_N * (free * self.step_s / mass)[:, None]
        R_NB = scene.rotations(state.q_NB)
        return replace(state, velocity_B=state.velocity_B + np.einsum("vij,vi->vj", R_NB, gained))

    def _measure_gaps(self) -> None:
        centres = self._hulls.centres(self.state.position_N[:, :2], self._heading())
        gaps = contacts.gaps(centres, self._reaches, self._obstacles)
        self._gaps = self._hulls.of_vessels(gaps)
        place_N = self.state.position_N[:, :2]
        if self._ashore:
            ashore = np.full(len(place_N), np.inf)
            for rows, shore in self._ashore:
                ashore[rows] = shore.gaps(place_N[rows], self.state.heading[rows])
            self._gaps = np.column_stack([self._gaps, np.where(self.present, ashore, np.inf)])
        self._fence_gap: Float64 = np.full(len(place_N), np.inf)
        if self._fences is not None:
            fenced = self._fences.gaps(place_N, self.state.heading)
            self._fence_gap = np.where(self.present, fenced, np.inf)
        self._nearest: Float64 = self._gaps.min(axis=1)
        nearer = (self._nearest < self._closest) & ~self.moored
        self._closest[nearer] = self._nearest[nearer]

    def _measure_current(self) -> None:
        if self.steps % CURRENT_STEPS == 1:
            water_N = self.sea.current(self.state.position_N[:, :2], self.time_s)
            speed = np.hypot(water_N[:, 0], water_N[:, 1])
            under_way = self.present & ~self.moored
            self._greatest_current = np.maximum(self._greatest_current, speed * under_way)

    def _measure_reaches(self) -> None:
        self._reaches = contacts.reaches(self._hulls, self.present, self._obstacles)

    def _heading(self) -> Float64:
        return np.zeros(0) if self._hulls.alone else self.state.heading


def _grounds(
    scenario: Scenario, vessels: Sequence[VesselDescription]
) -> list[tuple[NDArray[np.intp], Shore]]:
    """Give where vessels run aground: which of them, and on what; shallows by their draught."""
    charted = [f for f in scenario.charted if f.kind in ("depth", "hazard")]
    features = [*land_areas(scenario.land), *charted]
    draughts = [round(vessel.buoyancy.hull_radius_m, 3) for vessel in vessels]
    grounds = []
    for draught in dict.fromkeys(draughts):
        region = StaticMap.of(features, safety_depth_m=draught)
        rows = np.flatnonzero(np.array(draughts) == draught)
        if not region.is_empty:
            grounds.append((rows, Shore(region, [vessels[row] for row in rows.tolist()])))
    return grounds


def make_world(
    scenario: Scenario,
    *,
    sensor: str = "vrx32",
    seed: int = 0,
    settings: WorldSettings | None = None,
    epoch_ns: int = EPOCH_NS,
) -> World:
    """Make the world of a scenario, which names vessels and sea, and of a shipped sensor."""
    sea = load(shipped("sea", scenario.sea), SeaSettings)
    return World(
        scenario,
        load_sensor(sensor),
        [load_vessel(kind) for kind in scenario.types],
        sea,
        seed,
        settings=settings,
        epoch_ns=epoch_ns,
    )
