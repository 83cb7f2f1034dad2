"""Where the page's pictures come from: boats under way, or a recording of them.

A live source looks by Zenoh. It only listens, unless it was opened with orders switched on. A
recording is read once into a film, so that any moment of it is there at once.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal, NamedTuple, Protocol

import numpy as np
from msgspec import structs

from twinscrew.hil_sim.viewer.scene import (
    Ended,
    Region,
    RunResult,
    Scene,
    VesselResult,
    read_outcomes,
    read_result,
    read_scene,
)
from twinscrew.hil_sim.viewer.vessel import SHOWN, Places, Row, Vessel
from twinscrew.hil_sim.viewer.wire import EventView, Order, Part
from twinscrew.runtime.bus.base import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.errors import ConfigError, RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Goal
from twinscrew.runtime.perception.sensor import Sensor, load_sensor
from twinscrew.runtime.recording.recording import Recorded, Recording, find_recordings
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import RuntimeConfig, load_config, sensor_of

NANOSECONDS: Final = 1e-9
FRAME_S = 0.1
"""[s] Between two pictures of a film."""
MOST_PICTURES = 12_000
"""[-] Of one vessel, some 5 kB each; a longer recording has pictures at half the rate."""
LOOK_S = 0.5
"""[s] How often a run's folder is looked into for outcomes and the result."""
RUN_WAIT_S = 20.0
"""[s] How long a run may take to begin."""
POLL_S = 0.1
CONFIG_FILE = "runtime.toml"
"""What `sitl` calls a vessel's configuration."""


class Source(Protocol):
    """Gives pictures of vessels at times."""

    mode: Literal["live", "recording"]
    names: Sequence[str]
    scene: Scene
    datum: Datum | None
    """Where the frame's origin lies on the earth; None if not known."""
    duration_s: float
    """[s] Of a recording; 0 if it is live."""
    begin_s: float
    """[s] Time zero since 1970, so that a link to a moment is the same live and in the replay."""
    result: RunResult | None
    """How the run ended; None while it goes on, or where nobody wrote it down."""
    takes_orders: bool
    """Whether the operator may give goals."""

    def parts(self, time_s: float) -> Sequence[Part]:
        """Give every vessel's share of the frame at a time; live, of the present one."""

    def now_s(self) -> float:
        """[s] Give the present time on the view's clock; a recording's is its end."""

    def trails(self) -> Mapping[str, Places]:
        """Give where the vessels have been (a recording: all of it)."""

    def charts(self) -> Mapping[str, Sequence[Region]]:
        """Give what the vessels know of what is fixed (a recording: at its end)."""

    def series(self) -> Mapping[str, Sequence[Row]]:
        """Give the vessels' figures over time (a recording: all of them)."""

    def events(self) -> Mapping[str, Sequence[EventView]]:
        """Give the vessels' health events (a recording: all of them)."""

    @property
    def revision(self) -> int:
        """[-] Grows when charts change, or trails other than by getting longer: pages are told."""

    def order(self, order: Order) -> str:
        """Give a vessel a goal, or stop it; say in words what was done, or why not."""

    def close(self) -> None:
        """Let go of what is open."""


class Boat(NamedTuple):
    """One boat to look at."""

    name: str
    sensor: Sensor


class LiveSource:
    """Follows boats. Of each topic only the newest unread messages are kept (`Inbox`)."""

    mode: Literal["live", "recording"] = "live"
    duration_s = 0.0
    result: RunResult | None = None

    def __init__(
        self,
        settings: ZenohSettings,
        boats: Sequence[Boat],
        scene: Scene,
        *,
        folder: Path | None = None,
        orders: bool = False,
        datum: Datum | None = None,
    ) -> None:
        """Open a bus of its own.

        Parameters
        ----------
        folder
            The run's, if the boats are a simulation's: it says who has arrived, and when it is
            over.
        orders
            Whether the operator may give goals.

        Raises
        ------
        BusError
            The endpoint cannot be reached.
        """
        self.names: Sequence[str] = tuple(boat.name for boat in boats)
        self.scene = scene
        self.datum = datum
        self.takes_orders = orders
        self._folder = folder
        self._zero_s = time.monotonic()
        self.begin_s = time.time()
        self._looked_s = -1.0
        reach_m = scene.goal_radius_m or 0.0
        self._vessels = [Vessel(boat.name, boat.sensor, reach_m) for boat in boats]
        self._inboxes = [Inbox() for _ in boats]
        self._parts: tuple[Part, ...] = ()
        self._parts_s = -1.0
        self._bus = ZenohBus(settings, self.names[0])
        for name, inbox in zip(self.names, self._inboxes, strict=True):
            inbox.listen(self._bus.within(name), SHOWN)

    def now_s(self) -> float:
        """See `Source`."""
        return time.monotonic() - self._zero_s

    def follow(self) -> None:
        """Take in what has come; to be called often enough that trails have no gaps."""
        now_s = self.now_s()
        for vessel, inbox in zip(self._vessels, self._inboxes, strict=True):
            for message in inbox.wait(0.0):
                came_s = message.received_ns * NANOSECONDS - self._zero_s
                sent_s = message.sent_ns * NANOSECONDS if message.sent_ns else None
                vessel.take(message.topic, message.payload, came_s, sent_s)
            vessel.note(now_s)
        if self._folder is not None and now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            ended = read_outcomes(self._folder)
            for vessel in self._vessels:
                vessel.ends(ended.get(vessel.name, ()))

    def over(self) -> Path | None:
        """Give the folder of the run once it is over: its recordings are complete then."""
        if self._folder is None or read_result(self._folder) is None:
            return None
        return self._folder

    def parts(self, time_s: float) -> Sequence[Part]:
        """See `Source`; pages that ask at the same time get the same."""
        if time_s != self._parts_s:
            self._parts = tuple(vessel.part(time_s) for vessel in self._vessels)
            self._parts_s = time_s
        return self._parts

    def trails(self) -> Mapping[str, Places]:
        """See `Source`."""
        return {vessel.name: vessel.trail.places for vessel in self._vessels}

    def charts(self) -> Mapping[str, Sequence[Region]]:
        """See `Source`."""
        return {vessel.name: vessel.chart for vessel in self._vessels}

    def series(self) -> Mapping[str, Sequence[Row]]:
        """See `Source`."""
        return {vessel.name: vessel.series.rows for vessel in self._vessels}

    def events(self) -> Mapping[str, Sequence[EventView]]:
        """See `Source`."""
        return {vessel.name: vessel.events_at(self.now_s()) for vessel in self._vessels}

    @property
    def revision(self) -> int:
        """See `Source`: who came late learns of the way before; charts may change."""
        return sum(vessel.trail.is_preceded + vessel.charts for vessel in self._vessels)

    def order(self, order: Order) -> str:
        """See `Source`; a goal is what the topic `goal` is, stopping is an empty `route`."""
        if not self.takes_orders:
            return "refused: this view was started without --orders"
        if order.vessel not in self.names:
            return f"refused: there is no vessel {order.vessel!r}"
        bus, stamp_ns = self._bus.within(order.vessel), time.time_ns()
        if order.goal is None:
            bus.publish("route", cdr.encode_path(np.empty((0, 2)), stamp_ns=stamp_ns, frame_id=""))
            return f"{order.vessel}: told to stop"
        place = np.array(order.goal)
        if not np.isfinite(place).all() or np.abs(place).max() > 1e6:
            return "refused: that place is nowhere"
        goal = Goal(stamp_ns=stamp_ns, position_N=place)
        bus.publish("goal", cdr.encode_goal(goal, frame_id=""))  # in the vessel's own frame
        return f"{order.vessel}: sent to north {place[0]:.1f} m, east {place[1]:.1f} m"

    def close(self) -> None:
        """See `Source`."""
        self._bus.close()


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

    mode: Literal["live", "recording"] = "recording"
    takes_orders = False

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
        begin_ns = min(_first_ns(recording) for recording in recordings)
        self.begin_s = begin_ns * NANOSECONDS
        self.names: Sequence[str] = tuple(recording.vessel for recording in recordings)
        self.scene: Scene = read_scene(path) if path.is_dir() else Scene()
        self.result = read_result(path) if path.is_dir() else None
        self.datum = _datum(recordings[0])
        self.duration_s = 0.0
        self._films: list[Film] = []
        ended = read_outcomes(path) if path.is_dir() else {}
        results = {one.name: one for one in self.result.vessels} if self.result else {}
        self._vessels = [
            self._read(one, begin_ns, ended.get(one.vessel, ()), results.get(one.vessel))
            for one in recordings
        ]
        for vessel, film in zip(self._vessels, self._films, strict=True):
            while film.next_s <= self.duration_s:  # it fell silent before the others
                vessel.note(film.next_s)
                film.add(vessel.part(film.next_s))

    def now_s(self) -> float:
        """See `Source`."""
        return self.duration_s

    def parts(self, time_s: float) -> Sequence[Part]:
        """See `Source`."""
        return tuple(film.at(time_s) for film in self._films)

    def trails(self) -> Mapping[str, Places]:
        """See `Source`."""
        return {vessel.name: vessel.trail.places for vessel in self._vessels}

    def charts(self) -> Mapping[str, Sequence[Region]]:
        """See `Source`."""
        return {vessel.name: vessel.chart for vessel in self._vessels}

    def series(self) -> Mapping[str, Sequence[Row]]:
        """See `Source`."""
        return {vessel.name: vessel.series.rows for vessel in self._vessels}

    def events(self) -> Mapping[str, Sequence[EventView]]:
        """See `Source`."""
        return {vessel.name: vessel.events_at(self.duration_s) for vessel in self._vessels}

    @property
    def revision(self) -> int:
        """See `Source`; what is recorded does not change."""
        return 0

    def order(self, order: Order) -> str:
        """See `Source`; what was, was."""
        return f"refused: {order.vessel} is a recording"

    def close(self) -> None:
        """See `Source`; nothing is open."""

    def _read(
        self,
        recording: Recording,
        begin_ns: int,
        ended: Sequence[Ended],
        result: VesselResult | None,
    ) -> Vessel:
        vessel = Vessel(recording.vessel, _sensor(recording), self.scene.goal_radius_m or 0.0)
        vessel.ends(ended, result)
        film, time_s = Film(), 0.0
        for message in recording.messages(SHOWN):
            time_s = (message.time_ns - begin_ns) * NANOSECONDS
            while film.next_s < time_s:
                vessel.note(film.next_s)
                film.add(vessel.part(film.next_s))
            vessel.take(message.topic, message.payload, time_s)
        film.add(vessel.part(time_s))
        self.duration_s = max(self.duration_s, time_s, vessel.ended_s or 0.0)
        self._films.append(film)
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


def _datum(recording: Recording) -> Datum | None:
    """Give the datum of the recorded configuration, if it has one."""
    told = recording.metadata.get("config", {}).get("autopilot", {}).get("datum")
    return convert(told, Datum, file=recording.path) if told else None


def from_endpoint(endpoint: str, names: str, sensor: str, *, orders: bool = False) -> LiveSource:
    """Look at boats whose Zenoh endpoint is known.

    Raises
    ------
    BusError
        Nobody is there.
    ConfigError
        No name is given, or the sensor does not exist.
    """
    listed = tuple(name.strip() for name in names.split(",") if name.strip())
    if not listed:
        raise ConfigError("name at least one vessel", key="--names")
    boats = [Boat(name, load_sensor(sensor)) for name in listed]
    settings = ZenohSettings(mode="client", connect=(endpoint,), node="")
    return LiveSource(settings, boats, Scene(), orders=orders)


def from_configs(
    files: Sequence[Path],
    scene: Scene | None = None,
    *,
    folder: Path | None = None,
    orders: bool = False,
) -> LiveSource:
    """Look at boats by their own configuration: their bus's security and keys are used too.

    Raises
    ------
    BusError
        Nobody is there.
    ConfigError
        A file cannot be used.
    """
    configs = [load_config(file) for file in files]
    boats = [Boat(config.name, sensor_of(config)) for config in configs]
    settings = structs.replace(configs[0].bus, mode="client", listen=())
    datum = configs[0].autopilot.datum
    return LiveSource(settings, boats, scene or Scene(), folder=folder, orders=orders, datum=datum)


def from_run(folder: Path, *, orders: bool = False) -> LiveSource | RecordedSource:
    """Look at a run that `sitl` is sailing, or is about to; if it is over, at its recordings.

    Raises
    ------
    ConfigError
        It does not begin.
    """
    scene = read_scene(folder)
    if read_result(folder) is not None:
        return RecordedSource(folder)
    names = scene.names or tuple(
        sorted(path.parent.name for path in folder.glob(f"*/{CONFIG_FILE}"))
    )
    files = [folder / name / CONFIG_FILE for name in names]
    deadline_s = time.monotonic() + RUN_WAIT_S
    while not files or not all(file.is_file() and file.stat().st_size for file in files):
        if time.monotonic() > deadline_s or not files:
            raise ConfigError("no run in real time has begun here", file=folder)
        time.sleep(POLL_S)
    return from_configs(files, scene, folder=folder, orders=orders)
