"""What does not move: the sea chart of a run, kept beside its recordings as scene.json."""

from __future__ import annotations

from pathlib import Path

import msgspec

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.runtime.errors import NOT_THE_FORMAT, RecordingError

SCENE_FILE = "scene.json"


class Scene(msgspec.Struct, frozen=True, kw_only=True):
    """Buoys, quays, goals: what a scenario says and no topic tells. Frame N."""

    name: str = ""
    map_size_m: tuple[float, float] | None = None
    """[m] North, east; its corner is the origin."""
    goal_radius_m: float | None = None
    buoys: tuple[tuple[float, float, float], ...] = ()
    """[m] North, east, radius."""
    quays: tuple[tuple[float, float, float, float, float, float], ...] = ()
    """[m, rad] North, east of the centre; length, width, height; heading."""
    names: tuple[str, ...] = ()
    """The vessels."""
    goals: tuple[tuple[float, float], ...] = ()
    """[m] North, east, one a vessel."""


def scene_of(scenario: Scenario) -> Scene:
    """Give what a scenario's picture needs."""
    return msgspec.convert(
        {
            "name": scenario.name,
            "map_size_m": scenario.map_size,
            "goal_radius_m": scenario.goal_radius,
            "buoys": scenario.buoys.tolist(),
            "quays": scenario.quays.tolist(),
            "names": scenario.names,
            "goals": scenario.goals.tolist(),
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
