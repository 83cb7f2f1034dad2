"""The real-time loop, by a clock that the test turns."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.harness.boat import Boat, cloud, odometry, stamp

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.runtime.bus.base import MemoryBus, Received
from twinscrew.runtime.bus.zenoh import ZenohSettings
from twinscrew.runtime.errors import LinkError, RecordingError
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import write_header
from twinscrew.runtime.messages.wire import Writer
from twinscrew.runtime.recording.settings import RecordingSettings
from twinscrew.runtime.safety.events import GREATEST_DETAIL
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.outputs import Outputs, Publisher
from twinscrew.runtime.vessel.realtime import Loop, open_recorder, run_vessel, unused
from twinscrew.runtime.vessel.summary import SUMMARY_FILE, RunSummary, read_summary
from twinscrew.runtime.vessel.vessel import Vessel

SCAN_S = 0.1


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class Line(Transport):
    """A connection to the simulated autopilot, which may break."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.broken, self.sends = clock, False, []
        self.turning: list[float] = []
        """[s] When the propellers turned."""
        self.autopilot = RoverAutopilot(RoverAutopilotSettings(), 1, boot_s=clock.now_s)

    def fileno(self) -> int:
        return -1

    def receive(self) -> bytes:
        if self.broken:
            raise LinkError("the device is gone")
        return self.step()

    def send(self, data: bytes) -> None:
        if self.broken:
            raise LinkError("the device is gone")
        self.sends.append(self.clock.now_s)
        self.autopilot.receive(data, self.clock.now_s)

    def step(self) -> bytes:
        said = self.autopilot.step(self.clock.now_s)
        if self.autopilot.thrust_command_N().any():
            self.turning.append(self.clock.now_s)
        return said

    def close(self) -> None:
        pass


class Sensors:
    """An inbox that turns the clock on while the loop waits, and hands out what is due."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.next_s, self.age_ms, self.hold_s = clock, clock.now_s, 0.0, 0.0
        self.also: bytes | None = None

    def wait(self, timeout_s: float) -> list[Received]:
        until_s = self.clock.now_s + max(0.0, timeout_s)
        if self.next_s > until_s:
            self.clock.now_s = until_s
            return []
        self.clock.now_s = max(self.clock.now_s, self.next_s) + self.hold_s
        time_s, self.next_s = self.next_s, self.next_s + SCAN_S
        received_ns = time.monotonic_ns() - round(self.age_ms * 1e6)
        extra = [] if self.also is None else [Received("points", self.also, received_ns)]
        return [
            *extra,
            Received("odometry", cdr.encode_odometry(odometry(time_s)), received_ns),
            Received("points", cdr.encode_point_cloud(cloud(time_s)), received_ns, 1),
        ]


def cloud_with_one_field(name: str) -> bytes:
    """A PointCloud2 of one point without x, y and z."""
    writer = Writer()
    write_header(writer, stamp(0.0), "lidar")
    writer.values("2I", 4, 1, 1)
    writer.values("I", 4, 1)
    writer.string(name)
    writer.values("IB3xI", 4, 0, 7, 1)
    writer.values("?3x2I", 4, False, 4, 4)
    writer.octets(bytes(4))
    writer.values("?", 1, True)
    return writer.payload()


class Rig:
    def __init__(self) -> None:
        self.clock = Clock()
        self.line, self.sensors = Line(self.clock), Sensors(self.clock)
        self.bus, self.events, self.thrusts = MemoryBus("wamv"), [], []
        self.later: list[tuple[float, Callable[[], object]]] = []
        self.bus.subscribe("diagnostics", self._hear)
        self.bus.subscribe("thrust_left", lambda m: self.thrusts.append(m.payload))
        self.publisher = Publisher(self.bus, None)
        self.loop = Loop(
            Boat().vessel, self.sensors, self.line, self.publisher, rate_hz=20.0, clock=self.clock
        )

    def at(self, seconds: float, do: Callable[[], object]) -> None:
        """Do something so much later, in the middle of a run."""
        self.later.append((self.clock.now_s + seconds, do))

    def run(self, seconds: float) -> Rig:
        until_s = self.clock.now_s + seconds
        self.loop.run(lambda: self._over(until_s))
        return self

    def _over(self, until_s: float) -> bool:
        while self.later and self.clock.now_s >= self.later[0][0]:
            self.later.pop(0)[1]()
        return self.clock.now_s >= until_s

    def turned(self, since_s: float) -> bool:
        """Tell whether the propellers have turned since a time."""
        return any(at_s >= since_s for at_s in self.line.turning)

    @property
    def names(self) -> list[str]:
        return [event.name for event in self.events]

    def _hear(self, message: Received) -> None:
        self.events += cdr.decode_diagnostics(message.payload)


def test_it_sails_and_every_decision_is_told_and_timed() -> None:
    rig = Rig().run(5.0)
    assert rig.line.autopilot.rover.armed
    assert rig.publisher.decisions == pytest.approx(50, abs=1)
    assert rig.loop.latencies.summary().count == rig.publisher.decisions
    assert rig.loop.wire_latencies.summary().count == rig.publisher.decisions
    assert max(cdr.decode_thrust(payload) for payload in rig.thrusts) > 100.0


def test_commands_go_out_twenty_times_a_second_without_drift() -> None:
    rig = Rig()
    rig.sensors.next_s = np.inf
    rig.run(60.0)
    sends = np.array(rig.line.sends[:-1])
    assert len(sends) == pytest.approx(1200, abs=1)
    np.testing.assert_allclose(sends, 100.0 + 0.05 * np.arange(len(sends)), atol=1e-6)
    assert rig.loop.missed_ticks == 0


def test_a_loop_that_was_held_up_drops_ticks_and_keeps_the_grid() -> None:
    rig = Rig()
    rig.sensors.hold_s = 0.27
    rig.run(3.0)
    rig.sensors.hold_s, rig.sensors.next_s = 0.0, np.inf
    rig.line.sends.clear()
    rig.run(1.0)
    phase = np.array(rig.line.sends[1:-1]) / 0.05 % 1.0
    assert len(phase) > 15
    assert rig.loop.missed_ticks > 5
    assert any("missed" in event.detail for event in rig.events if event.name == "overrun")
    np.testing.assert_allclose(np.minimum(phase, 1.0 - phase), 0.0, atol=1e-6)


def test_what_came_before_the_first_turn_is_no_missed_tick() -> None:
    rig = Rig()
    rig.clock.now_s += 3.0
    rig.sensors.next_s = rig.clock.now_s
    rig.run(1.0)
    assert rig.loop.missed_ticks == 0


def test_it_leaves_the_propellers_at_rest() -> None:
    rig = Rig().run(5.0)
    rig.line.autopilot.step(rig.clock.now_s)
    assert rig.line.autopilot.rover.armed
    assert rig.line.autopilot.thrust_command_N().tolist() == [0.0, 0.0]


def test_a_decision_that_comes_too_late_is_counted_told_and_degrades() -> None:
    rig = Rig().run(5.0)
    rig.sensors.age_ms = 250.0
    rig.run(1.0)
    assert rig.loop.overruns == pytest.approx(10, abs=1)
    assert "overrun" in rig.names
    details = [event.detail for event in rig.events if event.name == "state"]
    assert {"active -> degraded", "active -> safe"} & set(details)  # later still, if it is slow


def test_a_connection_that_breaks_is_told_once_and_the_loop_goes_on() -> None:
    rig = Rig().run(5.0)
    rig.line.broken = True
    before = rig.publisher.decisions
    rig.run(2.0)
    assert rig.names.count("link_down") == 1
    assert rig.publisher.decisions > before + 15
    assert "autopilot_silent" in rig.names
    assert cdr.decode_thrust(rig.thrusts[-1]) == 0.0
    assert "link_restored" not in rig.names


@pytest.mark.slow
def test_a_connection_that_comes_back_is_told_once_and_each_new_break_again() -> None:
    rig = Rig().run(5.0)
    for times in (1, 2):
        rig.line.broken = True
        rig.run(1.0)
        rig.line.broken = False
        rig.run(5.0)
        assert rig.names.count("link_down") == rig.names.count("link_restored") == times
    assert cdr.decode_thrust(rig.thrusts[-2]) > 0.0


def test_messages_that_the_bus_threw_away_are_told_once_and_degrade(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig().run(5.0)
    assert "messages_missing" not in rig.names
    monkeypatch.setattr(MemoryBus, "missing", {"points too large": 3})
    rig.run(3.0)
    told = [event.detail for event in rig.events if event.name == "messages_missing"]
    assert told == ["3 points too large"]
    assert "active -> degraded" in [e.detail for e in rig.events if e.name == "state"]


STAGES = {
    "perception": "vessel.pipeline.perception.step",
    "tracker": "vessel.pipeline.tracker.step",
    "mission": "vessel.pipeline.mission.step",
    "policy": "vessel.pipeline.policy.act",
    "assurance": "vessel.pipeline.assurance.step",
    "the pipeline's guard": "vessel.pipeline.guard.check",
    "scans": "vessel.inputs.scan",
    "odometry": "vessel.inputs.odometry",
    "watchdog": "vessel._watchdog.check",
    "ages": "vessel._watchdog.too_old",
    "the last guard": "vessel._guard.check",
    "health": "vessel.health.step",
    "taking in": "vessel.handle",
    "noting": "vessel.note",
    "supervision": "vessel.tick",
    "command": "vessel._command",
    "the autopilot's words": "vessel.receive",
    "the link's events": "vessel.link.events",
    "the link's command": "vessel.link.command",
    "the link's requests": "vessel.link.tick",
    "the line's bytes": "vessel.link.receive",
    "frames": "vessel.link.wire.encode",
    "ground stations": "vessel._ground.serve",
    "ground report": "vessel.report.due",
    "announcements": "vessel.report.happened",
    "service manager": "loop._manager.alive",
    "inbox": "loop._inbox.wait",
    "line in": "line.receive",
    "line out": "line.send",
    "recording": "publisher.publish",
    "recording what came": "publisher.came",
    "decision": "publisher._decide",
    "health events": "publisher.report",
    "state": "publisher.state",
    "thrust": "publisher.thrust",
    "recorder": "publisher.recorder_trouble",
    "bus": "bus.publish",
}
ENCODERS = (
    "encode_decision",
    "encode_diagnostics",
    "encode_engagement",
    "encode_object_markers",
    "encode_thrust",
    "encode_track_markers",
)
MUTE = ("health events", "bus", "encode_diagnostics")
"""What the operator hears by: while it raises he hears it on the other way only."""


def broken(rig: Rig, monkeypatch: pytest.MonkeyPatch, where: str) -> list[float]:
    """Let one part raise whenever it is called; gives when it did."""
    raised: list[float] = []

    def fail(*_: object, **__: object) -> None:
        raised.append(rig.clock.now_s)
        rig.clock.now_s += 1e-3  # time passes while something fails
        raise RuntimeError("unforeseen")

    if where in ENCODERS:
        monkeypatch.setattr(cdr, where, fail)
        return raised
    roots = {"loop": rig.loop, "vessel": rig.loop._vessel, "line": rig.line}
    roots |= {"publisher": rig.publisher, "bus": rig.bus}
    root, *way, name = STAGES[where].split(".")
    part = roots[root]
    for step in way:
        part = getattr(part, step)
    monkeypatch.setattr(type(part), name, fail)
    return raised


def test_a_message_is_recorded_before_it_is_worked_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """What brings a runtime down, or holds it up for ever, is in its recording."""
    rig, recorded, handled = Rig(), [], []
    take = Vessel.handle

    def record(_: object, topic: str, payload: bytes) -> None:
        recorded.append((topic, payload))

    def handle(vessel: Vessel, message: Received, now_s: float) -> Outputs:
        handled.append((message.topic, message.payload))
        assert recorded.count(handled[-1]) == handled.count(handled[-1])
        return take(vessel, message, now_s)

    monkeypatch.setattr(Publisher, "_record", record)
    monkeypatch.setattr(Vessel, "handle", handle)
    rig.run(2.0)
    assert len(handled) >= 40
    assert [one for one in recorded if one[0] in ("points", "odometry")] == handled  # and once
    assert "internal_error" not in rig.names


@pytest.mark.slow
@pytest.mark.parametrize("where", [*STAGES, *ENCODERS])
def test_whatever_raises_stops_the_propellers_is_named_and_does_not_end_the_loop(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig().run(5.0)
    assert rig.turned(rig.clock.now_s - 0.2)
    with monkeypatch.context() as patched:
        raised = broken(rig, patched, where)
        rig.at(0.3, lambda: rig.line.autopilot.rover.set_mode(Mode.HOLD))
        rig.at(0.5, lambda: rig.line.autopilot.rover.set_mode(Mode.MANUAL))
        rig.run(3.0)
        assert raised
        assert not rig.turned(raised[0] + 0.7)
        assert raised[-1] > rig.clock.now_s - 1.3  # it goes on
        told = {event.name for event in rig.events}
    assert told & {"internal_error", "lidar_stale"} or where in MUTE
    if where == "frames":  # nothing went to the autopilot nor came: its HOLD may be a pilot's
        rig.at(1.0, lambda: rig.line.autopilot.rover.set_mode(Mode.MANUAL))
    rig.run(8.0)
    assert rig.turned(rig.clock.now_s - 0.2)


@pytest.mark.slow
def test_what_raises_once_costs_a_second_of_thrust(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig().run(5.0)
    with monkeypatch.context() as patched:
        raised = broken(rig, patched, "decision")
        rig.run(0.12)
    assert len(raised) in (1, 2)
    events = [event for event in rig.events if event.name == "internal_error"]
    assert events[0].detail == "compute: RuntimeError: unforeseen"
    mended_s = rig.clock.now_s
    rig.run(3.0)
    first_s = next(at_s for at_s in rig.line.turning if at_s > mended_s)
    assert first_s - raised[-1] == pytest.approx(1.1, abs=0.15)


def test_the_end_of_a_run_leaves_the_propellers_at_rest_though_the_last_words_raise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig().run(5.0)
    broken(rig, monkeypatch, "the link's requests")
    rig.run(0.0)
    rig.clock.now_s += 0.05
    rig.line.step()
    assert not rig.turned(rig.clock.now_s)


def test_a_cloud_without_x_and_with_a_long_name_of_a_field_is_an_event_that_fits_the_line() -> None:
    rig = Rig().run(5.0)
    rig.sensors.also = cloud_with_one_field("n" * 13_000)
    rig.run(2.0)
    details = [event.detail for event in rig.events if event.name == "bad_message"]
    assert details
    assert all(len(detail) <= GREATEST_DETAIL for detail in details)
    assert "internal_error" not in rig.names
    assert "message_unsent" not in rig.names


def test_the_garbage_collector_is_left_as_it_was() -> None:
    import gc

    frozen = gc.get_freeze_count()
    Rig().run(0.5)
    assert gc.get_freeze_count() == frozen


def config(folder: Path, **recording: float) -> RuntimeConfig:
    return RuntimeConfig(
        bus=ZenohSettings(connect=()),
        autopilot=AutopilotSettings(connection="udpin:127.0.0.1:0"),
        recording=RecordingSettings(folder=str(folder), **recording),
    )


def test_a_boat_that_starts_again_keeps_its_recordings(tmp_path: Path) -> None:
    folder = tmp_path / "recording"
    assert unused(folder) == folder
    folder.mkdir()
    assert unused(folder) == folder
    (folder / "a.mcap").touch()
    assert unused(folder) == tmp_path / "recording-2"
    (tmp_path / "recording-2").mkdir()
    (tmp_path / "recording-2" / "b.mcap").touch()
    assert unused(folder) == tmp_path / "recording-3"


def test_a_boats_file_decides_how_its_recording_rotates(tmp_path: Path) -> None:
    settings = config(tmp_path, rotate_mb=0.05, quota_mb=0.2)
    with open_recorder(tmp_path, settings, tmp_path / "boat.toml", Boat().vessel) as recorder:
        for number in range(50):
            recorder.record("points", bytes(20_000), number)
    files = list((tmp_path / "recording").glob("*.mcap"))
    assert len(files) > 2
    assert sum(file.stat().st_size for file in files) < 0.35e6


def test_a_priority_that_was_refused_is_told_and_in_the_summary(tmp_path: Path) -> None:
    words = ("SCHED_FIFO 10: Operation not permitted",)
    opened = []
    summary = run_vessel(
        config(tmp_path),
        source=tmp_path / "boat.toml",
        stop=lambda: bool(opened),
        refused=words,
        ready=lambda: opened.append(True),
    )
    assert summary.priority_refused == words
    assert read_summary(tmp_path) == summary
    assert b"priority_refused" in next((tmp_path / "recording").glob("*.mcap")).read_bytes()


def test_the_summary_of_a_runtime_that_was_killed_counts_nothing() -> None:
    summary = RunSummary(name="wamv1")
    assert (summary.name, summary.decisions, summary.overruns) == ("wamv1", 0, 0)
    assert set(summary.latency_ms) == {"p50", "p99", "p999", "max"}


@pytest.mark.parametrize(
    "content",
    [None, b"{", b'{"vessel": "\xff"}', pytest.param(b'{"x": ' + b"[" * 100_000, id="deep")],
)
def test_a_summary_that_is_missing_or_damaged_is_refused_by_name(
    tmp_path: Path, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / SUMMARY_FILE).write_bytes(content)
    with pytest.raises(RecordingError, match=SUMMARY_FILE):
        read_summary(tmp_path)


@pytest.mark.parametrize("where", ["tick", "handle"])
def test_a_fault_of_the_runtime_and_its_end_are_zero_on_the_thrusters_topics(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig().run(5.0)
    assert cdr.decode_thrust(rig.thrusts[-2]) > 0.0  # the last is that of the run's end
    assert cdr.decode_thrust(rig.thrusts[-1]) == 0.0

    def broken(*_: object) -> None:
        raise RuntimeError("unforeseen")

    rig.thrusts.clear()
    with monkeypatch.context() as patched:
        patched.setattr(Vessel, where, broken)
        rig.run(0.5)
    assert len(rig.thrusts) >= 5  # again and again
    assert not any(cdr.decode_thrust(payload) for payload in rig.thrusts)


class SilentKeeper:
    """A keeper that notes when it is told that the runtime lives."""

    def __init__(self) -> None:
        self.told: list[float] = []
        self.word: str | None = None

    def alive(self, now_s: float) -> str | None:
        self.told.append(now_s)
        word, self.word = self.word, None
        return word


def test_the_keeper_is_told_with_every_tick_that_commanded_and_not_by_one_that_failed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig, keeper = Rig(), SilentKeeper()
    rig.loop._keeper = keeper
    rig.run(2.0)
    assert np.diff(keeper.told).max() < 0.06
    keeper.told.clear()
    with monkeypatch.context() as patched:
        patched.setattr(Publisher, "thrust", lambda *_: 1 / 0)
        rig.run(1.0)
    assert not keeper.told  # it sends zero in our place
    keeper.word = "it had ended with status -9"
    rig.run(0.2)
    assert "keeper" in rig.names
