"""Holding a place, and coming alongside, in the full simulator: how well a vessel does both.

One vessel, the whole runtime in lock-step, open water. It starts beside its place with any heading,
is ordered to hold it, and is watched to the end. Wind and waves are those of a sea of config/sea;
the current comes from a direction that is drawn.

To berth, it starts off a face that lies in any direction, and is ordered to lie at it. The face is
not solid: where the hull's rectangle comes to it, and how fast, is measured. An episode in which it
touches faster or more askew than allowed has failed, whatever comes after.

    python -m twinscrew.hil_sim.experiments.station hold --episodes 4 --out hold.jsonl
    python -m twinscrew.hil_sim.experiments.station berth --sea calm --episodes 20 --out berth.jsonl
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
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
from twinscrew.runtime.vessel.station import Phase
from twinscrew.runtime.vessel_description import load_vessel

OFF_LENGTHS: Final = 3.0
"""[-] A vessel starts up to so many of its lengths north and east of its place."""
VRX_SHARE: Final = 0.75
"""[-] VRX's score weighs the heading's error by this to the power of the distance in metres."""
LIMIT_MPS, LIMIT_TURN_DEG = 0.2, 12.0
"""[m/s], [deg] The most at which a face may be touched."""
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

    def order(
        self, topic: str, payload: bytes, duration_s: float, until: Callable[[], bool]
    ) -> float:
        """Sail with an order until something is so, or a time [s] is over; gives how long [s]."""
        self._wait_at_the_dock()
        self._world.release(0)
        self._deliver(0, topic, payload)
        begin_s = self._world.time_s
        while self._world.time_s - begin_s < duration_s and not until():
            self._tick()
        return self._world.time_s - begin_s

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


def sail_hold(task: HoldTask, folder: Path | None = None) -> HoldRecord:
    """Sail one episode; with a folder, the runtime is recorded under it."""
    vessel = load_vessel(task.vessel)
    rng = np.random.default_rng([task.seed, 17])
    towards = rng.uniform(-math.pi, math.pi)
    off_m = OFF_LENGTHS * vessel.length_m * rng.uniform(-1.0, 1.0, 2)
    start = np.array([[*off_m, rng.uniform(-math.pi, math.pi)]])
    sea = _sea(task.sea, task.current_mps, towards)
    world, crew = _afloat(task.vessel, start, sea, task.sensor, task.seed, folder)
    heading = None if task.heading_deg is None else math.radians(task.heading_deg)
    voyage = _Holding(world, crew, scan_s=0.1)
    station = Station(stamp_ns=0, position_N=np.zeros(2), heading=heading)
    rows = voyage.hold(station, task.duration_s)
    crew.close()
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


def _sea(name: str, current_mps: float, towards: float) -> SeaSettings:
    sea = load(shipped("sea", name), SeaSettings)
    current = (current_mps * math.cos(towards), current_mps * math.sin(towards))
    return replace(sea, current_mps=current, waves=replace(sea.waves, random_phase=True))


def _afloat(
    vessel: str,
    start: Float64,
    sea: SeaSettings,
    sensor: str,
    seed: int,
    folder: Path | None,
) -> tuple[World, LockstepCrew]:
    water = _open_water(vessel, start)
    world = World(water, load_sensor(sensor), load_vessel(vessel), sea, seed)
    config = config_for(
        vessel,
        name="wamv1",
        sensor=sensor,
        envelope={"enabled": False},
        autopilot={"system_id": 1, "arm": True, "receiver_fitted": False},
        recording={"folder": "" if folder is None else str(folder / "wamv1")},
    )
    return world, LockstepCrew([config], epoch_ns=world.epoch_ns)


@dataclass(frozen=True, slots=True, kw_only=True)
class BerthTask:
    """One episode."""

    vessel: str = "wam_v"
    sea: str = "calm"
    current_mps: float = 0.0
    off_wind_deg: float = 180.0
    """[deg] The face lies so far off the wind's axis at most; 180: anyhow."""
    duration_s: float = 600.0
    seed: int = 0
    sensor: str = "vrx16"


@dataclass(frozen=True, slots=True, kw_only=True)
class BerthRecord:
    """What became of it."""

    vessel: str
    sea: str
    seed: int
    wind_deg: float
    """[deg] Where the wind blows to, from the bow's direction at the berth; towards the face is
    positive."""
    berthed: bool
    """Whether it lay alongside, within all limits, and had touched nothing in another way."""
    phase: str
    speed_mps: float
    """[m/s] Over ground, at the end."""
    turned_deg: float
    along_m: float
    gap_m: float
    tries: int
    touched_wrongly: bool
    """Whether the hull had come to the face's line faster or more askew than allowed."""
    taken_s: float
    decisions_sha256: str


def sail_berth(task: BerthTask, folder: Path | None = None) -> BerthRecord:
    """Sail one episode; with a folder, the runtime is recorded under it."""
    vessel = load_vessel(task.vessel)
    length = vessel.length_m
    rng = np.random.default_rng([task.seed, 18])
    sea = _sea(task.sea, task.current_mps, rng.uniform(-math.pi, math.pi))
    blows = math.radians(sea.wind.from_deg) + math.pi
    off = math.radians(task.off_wind_deg)
    bow = (
        blows
        + math.pi * rng.integers(2)
        + rng.uniform(-min(off, math.pi / 2), min(off, math.pi / 2))
    )
    along = np.array([math.cos(bow), math.sin(bow)])
    side = float(rng.choice([-1.0, 1.0]))
    water = side * np.array([along[1], -along[0]])  # from the face to the boat
    place = water * length * rng.uniform(3.0, 5.0) + along * length * rng.uniform(-4.0, 4.0)
    start = np.array([[*place, rng.uniform(-math.pi, math.pi)]])
    world, crew = _afloat(task.vessel, start, sea, task.sensor, task.seed, folder)
    face_N = np.array([-1.5 * length * along, 1.5 * length * along])
    pipeline = crew.vessels[0].vessel.pipeline
    half = 0.5 * length, 0.5 * vessel.beam_m
    wrong = False

    def seen() -> tuple[float, float, float, float]:
        """Give gap [m], speed [m/s], heading off the face [rad] and place along it [m], truly."""
        state = world.state
        turned = float(wrap(state.heading[0] - bow))
        reach = half[0] * abs(math.sin(turned)) + half[1] * abs(math.cos(turned))
        where = state.position_N[0, :2]
        speed = float(np.hypot(*state.velocity_B[0, :2]))
        return float(where @ water) - reach, speed, turned, float(where @ along)

    def over() -> bool:
        nonlocal wrong
        berthing = pipeline.berthing
        gap, speed, turned, _ = seen()
        if gap <= 0.0 and not (berthing is not None and berthing.lies):
            wrong = wrong or speed > LIMIT_MPS or abs(turned) > math.radians(LIMIT_TURN_DEG)
        return berthing is not None and berthing.phase in (Phase.ALONGSIDE, Phase.GIVEN_UP)

    voyage = _Holding(world, crew, scan_s=0.1)
    payload = cdr.encode_path(face_N, stamp_ns=0, frame_id="")
    taken_s = voyage.order("berth", payload, task.duration_s, over)
    crew.close()
    gap, speed, turned, ahead = seen()
    berthing = pipeline.berthing
    lies = berthing is not None and berthing.lies
    well = speed <= LIMIT_MPS and abs(math.degrees(turned)) <= LIMIT_TURN_DEG and abs(ahead) <= 1.1
    return BerthRecord(
        vessel=task.vessel,
        sea=task.sea,
        seed=task.seed,
        wind_deg=round(-side * math.degrees(float(wrap(blows - bow))), 1),
        berthed=lies and well and not wrong,
        phase="" if berthing is None else berthing.phase.value,
        speed_mps=round(speed, 3),
        turned_deg=round(math.degrees(turned), 2),
        along_m=round(ahead, 3),
        gap_m=round(gap, 3),
        tries=0 if berthing is None else berthing.tries,
        touched_wrongly=wrong,
        taken_s=round(taken_s, 1),
        decisions_sha256=combined_sha256([crew.vessels[0].publisher.sha256]),
    )


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


def main() -> None:
    """Sail episodes, and write a line of JSON for each."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("what", choices=("hold", "berth"))
    parser.add_argument("--vessel", action="append", help="A name or a file; several: each.")
    parser.add_argument("--sea", default="paper")
    parser.add_argument("--current", type=float, default=None, help="[m/s] hold: 0.5, berth: 0.")
    parser.add_argument("--heading", type=float, default=None, help="[deg] To hold.")
    parser.add_argument("--off-wind", type=float, default=180.0, help="[deg] Of a berth, at most.")
    parser.add_argument("--episodes", type=int, default=4, help="A vessel.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    vessels = asked.vessel or ["wam_v", "otter", "heron", "blueboat", "workboat"]
    with asked.out.open("a") as out:
        for seed in range(asked.seed, asked.seed + asked.episodes):
            for vessel in vessels:
                if asked.what == "hold":
                    current = 0.5 if asked.current is None else asked.current
                    task = HoldTask(
                        vessel=vessel,
                        sea=asked.sea,
                        current_mps=current,
                        heading_deg=asked.heading,
                        seed=seed,
                    )
                    record = sail_hold(task).as_dict()
                else:
                    berth = BerthTask(
                        vessel=vessel,
                        sea=asked.sea,
                        current_mps=asked.current or 0.0,
                        off_wind_deg=asked.off_wind,
                        seed=seed,
                    )
                    record = asdict(sail_berth(berth))
                print(json.dumps(record), file=out, flush=True)


if __name__ == "__main__":
    main()
