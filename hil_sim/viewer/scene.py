"""What a run's folder says beside its recordings: the chart, who arrived when, the result.

`scene.json` holds what does not move, `outcomes.jsonl` what became of vessels whose run has ended
(the simulator switches their sensors off, and holds or removes them), `summary.json` the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.supervisor import Result
from twinscrew.hil_sim.world import World
from twinscrew.runtime.charts.static_map import Outline
from twinscrew.runtime.errors import NOT_THE_FORMAT, RecordingError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import load, shipped

SCENE_FILE = "scene.json"
OUTCOMES_FILE = "outcomes.jsonl"
SUMMARY_FILE = "summary.json"
FLOW_ARROWS = 9
"""[-] Arrows of the current along the longer side of the map."""
AFTERWARDS_S = 0.5
"""[s] Between two places of a vessel that has ended and is held."""


class Region(msgspec.Struct, frozen=True, kw_only=True):
    """An area as it is drawn."""

    kind: str
    """land, keep_out, depth, hazard or fence."""
    ring: tuple[tuple[float, float], ...]
    """[m] North, east of its corners."""
    holes: tuple[tuple[tuple[float, float], ...], ...] = ()
    """[m] North, east."""
    keep_in: bool = False
    """True for a fence that nobody may leave."""
    name: str = ""


class Scene(msgspec.Struct, frozen=True, kw_only=True):
    """What a scenario says and no topic tells: what is fixed, goals, wind, current. Frame N."""

    name: str = ""
    map_size_m: tuple[float, float] | None = None
    """[m] North, east; its corner is the origin."""
    goal_radius_m: float | None = None
    buoys: tuple[tuple[float, float, float], ...] = ()
    """[m] North, east, radius."""
    quays: tuple[tuple[float, float, float, float, float, float], ...] = ()
    """[m, rad] North, east of the centre; length, width, height; heading."""
    piles: tuple[tuple[float, float, float], ...] = ()
    """[m] North, east, radius."""
    regions: tuple[Region, ...] = ()
    """Land, keep-out areas, shallows, hazards, fences."""
    flow: tuple[tuple[float, float, float, float], ...] = ()
    """[m, m/s] North, east; the current there when the run begins, north and east, where it is not
    the same everywhere."""
    names: tuple[str, ...] = ()
    """The vessels."""
    goals: tuple[tuple[float, float], ...] = ()
    """[m] North, east, one a vessel."""
    wind: tuple[float, float] | None = None
    """[m/s, deg] Mean speed, and where it blows from; None if not known."""
    current: tuple[float, float] | None = None
    """[m/s] North, east velocity of the water; None if not known."""


def region_of(outline: Outline) -> Region:
    """Give an outline of a chart as the page draws it."""
    return Region(
        kind=outline.kind,
        ring=_places(outline.ring),
        holes=tuple(map(_places, outline.holes)),
        keep_in=outline.keep_in,
        name=outline.name,
    )


def _places(ring: Float64) -> tuple[tuple[float, float], ...]:
    return tuple((north, east) for north, east in np.round(ring, 2).tolist())


def scene_of(scenario: Scenario) -> Scene:
    """Give what a scenario's picture needs."""
    sea = load(shipped("sea", scenario.sea), SeaSettings)
    return msgspec.convert(
        {
            "name": scenario.name,
            "map_size_m": scenario.map_size,
            "goal_radius_m": scenario.goal_radius,
            "buoys": scenario.buoys.tolist(),
            "quays": scenario.quays.tolist(),
            "piles": scenario.piles[:, :3].tolist(),
            "regions": [*map(region_of, scenario.outlines)],
            "flow": scenario.flow(FLOW_ARROWS).tolist(),
            "names": scenario.names,
            "goals": scenario.goals.tolist(),
            "wind": (sea.wind.mean_mps, sea.wind.from_deg),
            "current": sea.current_mps,
        },
        Scene,
    )


def write_scene(folder: Path, scenario: Scenario) -> None:
    """Leave a scenario's scene in a run's folder."""
    content = msgspec.json.format(msgspec.json.encode(scene_of(scenario)), indent=1)
    (folder / SCENE_FILE).write_bytes(content + b"\n")


def read_scene(folder: Path) -> Scene:
    """Read a run's scene; an empty one if it has none: a real sea has no file.

    Raises
    ------
    RecordingError
        The file is there, but is not a scene.
    """
    path = folder / SCENE_FILE
    if not path.is_file():
        return Scene()
    try:
        return msgspec.json.decode(path.read_bytes(), type=Scene)
    except NOT_THE_FORMAT as error:
        raise RecordingError(f"{path}: not a scene: {error}") from error


class Ended(msgspec.Struct, frozen=True, kw_only=True):
    """Where a vessel is after its run has ended: one line of `OUTCOMES_FILE`."""

    name: str
    outcome: str
    """goal, collision or timeout."""
    stamp_ns: int
    """[ns] When it was there, on the clock of its odometry."""
    travel_time_s: float
    closest_approach_m: float | None
    """[m] None if nothing was ever near."""
    pose: tuple[float, float, float]
    """[m, m, rad] North, east, heading."""


class OutcomeLog:
    """Writes what became of the vessels of a simulation, while it goes on."""

    def __init__(self, folder: Path, world: World) -> None:
        self._path = folder / OUTCOMES_FILE
        self._world = world
        self._next_ns: dict[str, int] = {}

    def note(self, results: Sequence[Result]) -> None:
        """Write down who has ended, where the simulator holds him, and how he fared."""
        world = self._world
        for vessel, result in enumerate(results):
            due_ns = self._next_ns.get(result.name, 0)
            if result.outcome is None or world.stamp_ns < due_ns:
                continue
            self._next_ns[result.name] = world.stamp_ns + round(AFTERWARDS_S * 1e9)
            if due_ns and not world.present[vessel]:
                continue  # taken off the map: its first line says where it was
            north, east = world.state.position_N[vessel, :2].tolist()
            near_m = result.closest_approach_m
            line = Ended(
                name=result.name,
                outcome=result.outcome.value,
                stamp_ns=world.stamp_ns,
                travel_time_s=round(result.travel_time_s, 2),
                closest_approach_m=round(near_m, 2) if near_m < float("inf") else None,
                pose=(round(north, 2), round(east, 2), float(world.state.heading[vessel])),
            )
            with self._path.open("ab") as file:
                file.write(msgspec.json.encode(line) + b"\n")


def read_outcomes(folder: Path) -> Mapping[str, Sequence[Ended]]:
    """Read who has ended so far, by vessel in the order of time; a line half written is left."""
    try:
        lines = (folder / OUTCOMES_FILE).read_bytes().splitlines()
    except OSError:
        return {}
    ended: dict[str, list[Ended]] = {}
    for line in lines:
        with suppress(*NOT_THE_FORMAT):
            one = msgspec.json.decode(line, type=Ended)
            ended.setdefault(one.name, []).append(one)
    return ended


class VesselResult(msgspec.Struct, frozen=True, kw_only=True):
    """How a vessel fared, as `summary.json` says."""

    name: str
    outcome: str
    travel_time_s: float
    closest_approach_m: float | None = None


class RunResult(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended."""

    success: bool
    vessels: tuple[VesselResult, ...]


def read_result(folder: Path) -> RunResult | None:
    """Read how a run ended; None while it goes on, or where nobody wrote it down."""
    with suppress(OSError, *NOT_THE_FORMAT):
        return msgspec.json.decode((folder / SUMMARY_FILE).read_bytes(), type=RunResult)
    return None
