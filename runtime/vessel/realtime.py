"""The real-time loop of one vessel: take in, compute, guard, publish, keep time.

Scans are worked on as they come; the thrust is re-sent, the inputs' ages are checked and the
autopilot is heard on a fixed grid of ticks that does not drift. The loop itself sends the
heartbeat: if it dies, the autopilot's failsafe stops the boat.

Whatever raises while a message is worked on or a tick is made, ends there: the thrust is neutral
for a second, `internal_error` says why, and the loop goes on (`Loop._guarded`). What raises for
ever keeps the propellers still for ever, and the operator informed.
"""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, ParamSpec, Self, TypeVar

import msgspec

from twinscrew.runtime.app.ground import GroundReport
from twinscrew.runtime.app.ground_desk import GroundDesk
from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.bus.inbox import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import ConfigError, LinkError, RecordingError
from twinscrew.runtime.link.reopening import reopening
from twinscrew.runtime.link.transport import Transport, await_transport
from twinscrew.runtime.messages.types import HealthEvent
from twinscrew.runtime.policy.base import Policy
from twinscrew.runtime.safety.events import (
    FILES_APPROVED,
    INTERNAL_ERROR,
    LINK_DOWN,
    LINK_RESTORED,
    MESSAGES_MISSING,
    OVERRUN,
    PRIORITY_REFUSED,
    RECORDER,
)
from twinscrew.runtime.vessel.config import RuntimeConfig, sensor_of
from twinscrew.runtime.vessel.outputs import Frames, Outlet
from twinscrew.runtime.vessel.own_odometry import SENSED
from twinscrew.runtime.vessel.process import Garbage, ServiceManager
from twinscrew.runtime.vessel.summary import Latencies
from twinscrew.runtime.vessel.vessel import Controller, make_controller

P = ParamSpec("P")
T = TypeVar("T")
NANOSECONDS_PER_MS = 1e6
PAUSE_S = 0.001
"""[s] An inbox that cannot be waited on is not asked again at once."""
OVERRUN_MS = 100.0
"""[ms] A decision later than this misses the next scan of a 10 Hz LiDAR."""


class Loop:
    """One vessel, in real time."""

    def __init__(
        self,
        controller: Controller,
        inbox: Inbox,
        transport: Transport,
        outlet: Outlet,
        *,
        rate_hz: float,
        ground: GroundReport | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.latencies = Latencies()
        """From a scan's arrival to its command on the socket."""
        self.wire_latencies = Latencies()
        """From the sender's put to the command on the socket; true between synchronised clocks."""
        self.overruns = 0
        """[-] Decisions that came too late."""
        self.missed_ticks = 0
        """[-] Ticks of the grid that passed while the loop was held up."""
        self._controller = controller
        self._inbox = inbox
        self._transport = transport
        self._outlet = outlet
        self._desk = GroundDesk(controller, ground or GroundReport())
        self._period_s = 1.0 / rate_hz
        self._clock = clock
        self._next_tick_s = math.inf
        self._link_is_down = False
        self._manager = ServiceManager()

    def run(self, stop: Callable[[], bool]) -> None:
        """Work until `stop` says so, then leave the propellers at rest."""
        with Garbage() as garbage:
            if self._next_tick_s == math.inf:
                self._next_tick_s = self._clock()  # the grid begins with the first turn
            while not stop():
                came = self._guarded(self._inbox.wait, self._next_tick_s - self._clock())
                if came is None:
                    time.sleep(PAUSE_S)
                for message in came or ():
                    self._guarded(self._compute, message)
                if self._clock() >= self._next_tick_s:
                    self._guarded(self._tick)
                    garbage.collect(self._clock())
        self._guarded(self._manager.stopping)
        self._guarded(self._rest)

    def _guarded(self, do: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T | None:
        """Do something; what it raises stops the propellers, not the loop."""
        try:
            return do(*args, **kwargs)
        except Exception as error:
            self._hold(do.__name__.strip("_"), error)
            return None

    def _hold(self, where: str, error: Exception) -> None:
        """Hold the propellers at rest, and say why to everybody who can still be reached.

        Each step is tried for itself: what raised may raise here again.
        """
        now_s = self._clock()
        with suppress(Exception):
            self._send(self._controller.hold(now_s))
        detail = f"{where}: {type(error).__name__}: {error}"
        event = (INTERNAL_ERROR.at(self._controller.stamp_ns, detail),)
        with suppress(Exception):
            self._controller.note(event, now_s)
        with suppress(Exception):
            self._outlet.happened(event)
        with suppress(Exception):
            self._desk.report.happened(event, now_s)

    def _rest(self) -> None:
        self._send(self._controller.rest(self._clock()))

    def _compute(self, message: Received) -> None:
        if message.topic == "points" and self._controller.has_own_odometry:
            self._hear_autopilot(self._clock())  # a scan wants the newest odometry
        self._outlet.record(message.topic, message.payload)
        handled = self._controller.take_in(message.topic, message.payload, self._clock())
        if handled.decision is not None:
            self._send(self._controller.command(self._clock()))
            latency_ms = self._note_latency(message)
            self._desk.report.decided(handled.decision, latency_ms, self._clock())
            why = self._controller.explain(handled.decision) if self._outlet.is_told else None
            self._outlet.decided(handled.decision, self._controller.thrust, why)
        self._tell(handled.events)

    def _tick(self) -> None:
        now_s = self._clock()
        self._keep_time(now_s)
        self._hear_autopilot(now_s)
        engagement, events = self._controller.supervise(now_s)
        if engagement is not None:
            self._outlet.engaged(engagement)
            self._controller.take_in("engagement", engagement, now_s)
        self._desk.serve(self._feed, now_s)
        self._send(self._controller.command(now_s))
        self._tell(events)
        self._outlet.thrust(self._controller.thrust)
        self._look_for_losses()
        autopilot = self._controller.link.status.words
        self._outlet.state(self._controller.state.value, self._controller.stamp_ns, autopilot)
        self._manager.alive(now_s, self._controller.state.value)

    def _hear_autopilot(self, now_s: float) -> None:
        self._controller.from_autopilot(self._receive(), now_s)
        for payload in self._controller.own_odometry():
            self._outlet.own_odometry(payload)
            handled = self._controller.take_in("odometry", payload, now_s)
            self._tell(handled.events)

    def _keep_time(self, now_s: float) -> None:
        self._next_tick_s += self._period_s
        if self._next_tick_s <= now_s:  # late by a whole tick: drop it, keep the grid
            late_ms = (now_s - self._next_tick_s + self._period_s) * 1e3
            behind = int((now_s - self._next_tick_s) / self._period_s) + 1
            self._next_tick_s += behind * self._period_s
            self.missed_ticks += behind
            detail = f"a tick {late_ms:.0f} ms late, {behind} missed"
            self._happened(OVERRUN.at(self._controller.stamp_ns, detail))

    def _note_latency(self, message: Received) -> float:
        latency_ms = (time.monotonic_ns() - message.received_ns) / NANOSECONDS_PER_MS
        self.latencies.add(latency_ms)
        if message.sent_ns:
            self.wire_latencies.add((time.time_ns() - message.sent_ns) / NANOSECONDS_PER_MS)
        if latency_ms > OVERRUN_MS:
            self.overruns += 1
            self._happened(
                OVERRUN.at(self._controller.stamp_ns, f"a decision after {latency_ms:.0f} ms")
            )
        return latency_ms

    def _receive(self) -> bytes:
        try:
            data = self._transport.receive()
        except LinkError as error:
            self._down(error)
            return b""
        if self._link_is_down and self._transport.is_open:
            self._link_is_down = False
            self._happened(LINK_RESTORED.at(self._controller.stamp_ns))
        return data

    def _send(self, data: bytes) -> None:
        try:
            self._transport.send(data)
        except LinkError as error:
            self._down(error)

    def _down(self, error: LinkError) -> None:
        if not self._link_is_down:
            self._link_is_down = True
            self._happened(LINK_DOWN.at(self._controller.stamp_ns, str(error)))

    def _look_for_losses(self) -> None:
        trouble = self._outlet.recorder_trouble()
        if trouble is not None:
            self._happened(RECORDER.at(self._controller.stamp_ns, trouble))
        missing = self._outlet.bus_trouble()
        if missing is not None:
            self._happened(MESSAGES_MISSING.at(self._controller.stamp_ns, missing))

    def _happened(self, event: HealthEvent) -> None:
        self._controller.note((event,), self._clock())
        self._tell((event,))

    def _feed(self, topic: str, payload: bytes) -> None:
        """Hand the core what a ground station ordered, as if it had come over the bus."""
        self._outlet.record(topic, payload)
        self._tell(self._controller.take_in(topic, payload, self._clock()).events)

    def _tell(self, events: tuple[HealthEvent, ...]) -> None:
        self._outlet.happened(events)
        self._desk.report.happened(events, self._clock())


# -- One run of a vessel's runtime: opens everything, closes everything, writes the summary.

INPUTS = ("points", "odometry", "goal", "route")
SUMMARY_FILE = "runtime.json"


def inputs_of(config: RuntimeConfig) -> tuple[str, ...]:
    """Give the topics that a runtime listens to."""
    if config.odometry_source == "bus":
        return INPUTS
    rest = tuple(topic for topic in INPUTS if topic != "odometry")
    return (*rest, *SENSED) if config.odometry_source == "gps_imu" else rest


class RunSummary(msgspec.Struct, frozen=True, kw_only=True):
    """What a runtime says of itself when it stops."""

    name: str
    decisions: int
    decisions_sha256: str
    latency_ms: dict[str, float]
    """From a scan's arrival to the MAVLink bytes on the socket."""
    wire_latency_ms: dict[str, float]
    """From the sender's Zenoh put to the MAVLink bytes on the socket."""
    overruns: int
    """Decisions that came too late."""
    missed_ticks: int = 0
    """Ticks of the loop's grid that passed while it was held up."""
    priority_refused: tuple[str, ...] = ()
    """What the system did not allow of the priority and cores that were asked for."""
    passed_over: dict[str, int]
    """Messages that newer ones replaced before they were read."""
    unrecorded: int
    """Messages that the recorder had to drop."""


def read_summary(folder: Path) -> RunSummary:
    """Read what a runtime said of itself when it stopped.

    Raises
    ------
    RecordingError
        There is none: it did not stop by itself.
    """
    path = folder / SUMMARY_FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=RunSummary)
    except (OSError, ValueError, RecursionError) as error:  # nested too deep, for the last
        raise RecordingError(f"{path}: the runtime left no summary ({error})") from error


def nothing_told(name: str) -> RunSummary:
    """Give the summary of a runtime that was killed and left none."""
    return RunSummary(
        name=name,
        decisions=0,
        decisions_sha256="",
        latency_ms=Latencies().summary().as_dict(),
        wire_latency_ms=Latencies().summary().as_dict(),
        overruns=0,
        passed_over={},
        unrecorded=0,
    )


def metadata_of(config: RuntimeConfig, policy: Policy) -> dict[str, Any]:
    """Give what a replay must know: configuration, the policy's hash (if it is a file), machine."""
    return {
        "config": msgspec.to_builtins(config),
        "policy_sha256": getattr(policy, "sha256", ""),
        "platform": {
            "python": platform.python_version(),
            "architecture": platform.machine(),
            "libc": " ".join(platform.libc_ver()),
        },
    }


def unused(folder: Path) -> Path:
    """Give the folder, or the first of folder-2, folder-3, ... that is not there or is empty.

    A boat that starts again keeps what it recorded before, and is not kept from starting by it.
    """
    candidate, number = folder, 1
    while candidate.exists() and any(candidate.iterdir()):
        number += 1
        candidate = folder.with_name(f"{folder.name}-{number}")
    return candidate


class Session:
    """A context: everything is open inside it."""

    def __init__(
        self,
        config: RuntimeConfig,
        *,
        source: Path,
        stop: Callable[[], bool] = lambda: False,
        refused: tuple[str, ...] = (),
        approval: str = "",
    ) -> None:
        """Prepare a run.

        Parameters
        ----------
        stop
            Ends the wait for an autopilot that is not there yet.
        refused
            What of the priority the system did not give (`priority.take`): it is told.
        approval
            Who stands for the files that were read, if anybody: it is told.
        """
        self._stop = stop
        self._refused = refused
        self._approval = approval
        self._config = config
        self._source = source
        self._folder = Path(config.recording.folder) if config.recording.folder else None
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        try:
            self._open()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.close()

    def write_summary(self) -> RunSummary:
        """Write what happened beside the recording, and give it."""
        summary = RunSummary(
            name=self._config.name,
            decisions=self._outlet.decisions,
            decisions_sha256=self._outlet.sha256,
            latency_ms=self.loop.latencies.summary().as_dict(),
            wire_latency_ms=self.loop.wire_latencies.summary().as_dict(),
            overruns=self.loop.overruns,
            missed_ticks=self.loop.missed_ticks,
            priority_refused=self._refused,
            passed_over=dict(self._inbox.passed_over),
            unrecorded=self._recorder.dropped if self._recorder else 0,
        )
        if self._folder is not None:
            content = msgspec.json.format(msgspec.json.encode(summary))
            (self._folder / SUMMARY_FILE).write_bytes(content + b"\n")
        return summary

    def _open(self) -> None:
        config = self._config
        link = config.autopilot
        opened = await_transport(link.connection, link.wait_s, self._stop)
        transport = reopening(link.connection, opened)
        self._stack.callback(transport.close)
        controller = make_controller(config)
        controller.core.pipeline.warm_up()
        bus = ZenohBus(config.bus, config.name)
        self._stack.callback(bus.close)
        self._recorder = self._open_recorder(controller.core.pipeline.policy)
        self._outlet = Outlet(
            bus, self._recorder, vessel=config.name, frames=Frames(sensor_of(config))
        )
        self._inbox = Inbox()
        self.loop = Loop(
            controller,
            self._inbox,
            transport,
            self._outlet,
            rate_hz=config.command_rate_hz,
            ground=GroundReport(
                config.ground,
                link.datum,
                link.system_id,
                sees_m=config.perception.max_range_m,
            ),
        )
        if self._refused:
            told = PRIORITY_REFUSED.at(controller.stamp_ns, "; ".join(self._refused))
            self._outlet.happened((told,))
        if self._approval:
            self._outlet.happened((FILES_APPROVED.at(controller.stamp_ns, self._approval),))
        self._stack.enter_context(
            Garbage()
        )  # the first collection takes 20 ms: before a scan comes
        self._inbox.listen(bus, inputs_of(config))

    def _open_recorder(self, policy: Policy) -> Recorder | None:
        if self._folder is None:
            return None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(
                f"{self._folder}: {error.strerror}", file=self._source, key="recording.folder"
            ) from error
        metadata = metadata_of(self._config, policy)
        return self._stack.enter_context(
            Recorder(
                unused(self._folder / "recording"),
                self._config.name,
                metadata,
                self._config.recording,
            )
        )
