"""A recording as a film: read once, then any moment of it at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

from twinscrew.hil_sim.viewer.scene import Scene, read_scene
from twinscrew.hil_sim.viewer.source import Places
from twinscrew.hil_sim.viewer.vessel import SHOWN, Vessel
from twinscrew.hil_sim.viewer.wire import Part
from twinscrew.runtime.app.config import RuntimeConfig, sensor_of
from twinscrew.runtime.app.recording import Recorded, Recording, find_recordings
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import convert

FRAME_S = 0.1
"""[s] Between two pictures."""
MOST_PICTURES = 12_000
"""[-] Of one vessel, some 5 kB each; a longer recording has pictures at half the rate."""


class Film:
    """One vessel's pictures at even times."""

    def __init__(self, most: int = MOST_PICTURES) -> None:
        self.step_s = FRAME_S
        self._most = most
        self._pictures: list[Part] = []

    @property
    def next_s(self) -> float:
        """[s] The time of the next picture to add."""
        return len(self._pictures) * self.step_s

    def add(self, picture: Part) -> None:
        """Add the next picture; when there are too many, every second one goes."""
        self._pictures.append(picture)
        if len(self._pictures) > self._most:
            del self._pictures[1::2]
            self.step_s *= 2.0

    def at(self, time_s: float) -> Part:
        """Give the last picture taken until a time."""
        index = int(time_s / self.step_s + 1e-6)
        return self._pictures[min(max(index, 0), len(self._pictures) - 1)]


class RecordedSource:
    """A run's recordings, or one."""

    mode: Literal["recording"] = "recording"

    def __init__(self, path: Path, mapping: Path | None = None) -> None:
        """Read everything.

        Parameters
        ----------
        path
            A run's folder, a bag's folder, or one file.
        mapping
            TOML that maps a foreign bag's topics to ours.

        Raises
        ------
        RecordingError
            There is no recording, one is damaged or empty, or two are of the same vessel.
        """
        recordings = find_recordings(path, mapping)
        _refuse_twins(path, recordings)
        begins = [_first_ns(recording) for recording in recordings]
        self.names: Sequence[str] = tuple(recording.vessel for recording in recordings)
        self.scene: Scene = read_scene(path) if path.is_dir() else Scene()
        self.duration_s = 0.0
        self._films: list[Film] = []
        self._trails: dict[str, Places] = {}
        vessels = [self._read(recording, min(begins)) for recording in recordings]
        for vessel, film in zip(vessels, self._films, strict=True):
            while film.next_s <= self.duration_s:  # it fell silent before the others
                film.add(vessel.part(film.next_s))

    def now_s(self) -> float:
        """See `Source`."""
        return self.duration_s

    def parts(self, time_s: float) -> Sequence[Part]:
        """See `Source`."""
        return tuple(film.at(time_s) for film in self._films)

    def trails(self) -> Mapping[str, Places]:
        """See `Source`."""
        return self._trails

    @property
    def revision(self) -> int:
        """See `Source`; what is recorded does not change."""
        return 0

    def close(self) -> None:
        """See `Source`; nothing is open."""

    def _read(self, recording: Recording, begin_ns: int) -> Vessel:
        vessel = Vessel(recording.vessel, _sensor(recording))
        film, time_s = Film(), 0.0
        for message in recording.messages(SHOWN):
            time_s = (message.time_ns - begin_ns) * 1e-9
            while film.next_s < time_s:
                film.add(vessel.part(film.next_s))
            vessel.take(message.topic, message.payload, time_s)
        film.add(vessel.part(time_s))
        self.duration_s = max(self.duration_s, time_s)
        self._films.append(film)
        self._trails[recording.vessel] = vessel.trail.places
        return vessel


def _refuse_twins(path: Path, recordings: Sequence[Recording]) -> None:
    names = [recording.vessel for recording in recordings]
    for recording in recordings:
        if names.count(recording.vessel) > 1:
            folders = ", ".join(r.path.name for r in recordings if r.vessel == recording.vessel)
            raise RecordingError(
                f"{path}: {recording.vessel} was recorded in {folders}: choose one"
            )


def _first_ns(recording: Recording) -> int:
    messages: Iterator[Recorded] = recording.messages(SHOWN)
    first = next(messages, None)
    if first is None:
        raise RecordingError(f"{recording.path}: holds no message that could be shown")
    return first.time_ns


def _sensor(recording: Recording) -> Sensor:
    """Give the LiDAR of the recorded configuration; a foreign bag's is taken for the default."""
    config = recording.metadata.get("config", {})
    where = {key: config[key] for key in ("sensor", "mount") if key in config}
    return sensor_of(convert(where, RuntimeConfig, file=recording.path))
