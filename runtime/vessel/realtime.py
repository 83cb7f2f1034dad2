"""The real-time loop of one vessel: take in, compute, guard, publish, keep time.

Scans are worked on as they come; the thrust is re-sent, the inputs' ages are checked and the
autopilot is read on a fixed grid of ticks that does not drift. The loop itself sends the heartbeat:
if it dies, the autopilot's failsafe stops the boat.

Whatever raises while a message is worked on or a tick is made, ends there: the thrust is neutral
for a second, `internal_error` says why, and the loop goes on (`Loop._guarded`). What raises for
ever keeps the propellers still for ever, and the operator informed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final, ParamSpec, TypeVar

from twinscrew.runtime.bus.base import Inbox, Received
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import BusError, ConfigError, LinkError
from twinscrew.runtime.link.transport import Transport, open_transport, reopening
from twinscrew.runtime.messages.types import HealthEvent
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.safety.events import (
    ARMING_WITHHELD,
    FILES_APPROVED,
    INTERNAL_ERROR,
    KEEPER,
    LINK_DOWN,
    LINK_RESTORED,
    MESSAGES_MISSING,
    NAME_TAKEN,
    OVERRUN,
    PRIORITY_REFUSED,
    RECEIVER_DOWN,
    RECORDER,
    EventKind,
)
from twinscrew.runtime.safety.guard import NEUTRAL
from twinscrew.runtime.senses.nmea import NmeaLines
from twinscrew.runtime.vessel.config import RuntimeConfig, inputs_of
from twinscrew.runtime.vessel.keeper import Keeper
from twinscrew.runtime.vessel.outputs import Publisher
from twinscrew.runtime.vessel.process import Garbage, ServiceManager
from twinscrew.runtime.vessel.summary import Latencies, RunSummary, metadata_of, write_summary
from twinscrew.runtime.vessel.vessel import Vessel, make_vessel

P = ParamSpec("P")
T = TypeVar("T")
NANOSECONDS_PER_MS: Final = 1e6
PAUSE_S: Final = 0.001
"""[s] An inbox that cannot be waited on is not asked again at once."""
OVERRUN_MS: Final = 100.0
"""[ms] A decision later than this misses the next scan of a 10 Hz LiDAR."""


class Loop:
    """One vessel, in real time."""

    def __init__(
        self,
        vessel: Vessel,
        inbox: Inbox,
        transport: Transport,
        publisher: Publisher,
        *,
        rate_hz: float,
        receivers: Sequence[Transport] = (),
        keeper: Keeper | None = None,
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
        self._vessel = vessel
        self._inbox = inbox
        self._transport = transport
        self._publisher = publisher
        self._keeper = keeper
        self._period_s = 1.0 / rate_hz
        self._clock = clock
        self._next_tick_s = math.inf
        self._link_is_down = False
        self._manager = ServiceManager()
        self._receivers = [(receiver, NmeaLines()) for receiver in receivers]
        self._silent_receivers: set[int] = set()

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

    def _compute(self, message: Received) -> None:
        if message.topic == "points" and self._vessel.follows_autopilot:
            self._read_autopilot(self._clock())  # a scan wants the newest odometry
        self._publisher.came(message.topic, message.payload)
        out, explanation = self._vessel.handle(message, self._clock()), None
        if message.topic in self._vessel.link.topics:
            self._publisher.thrust(out.thrust)
        if out.decision is not None:
            self._send(out.autopilot)
            latency_ms = self._note_latency(message)
            self._vessel.report.decided(out.decision, latency_ms, self._clock())
            if self._publisher.has_listeners:
                explanation = self._vessel.explain(out.decision)
        self._publisher.publish(out, explanation)

    def _tick(self) -> None:
        now_s = self._clock()
        self._keep_time(now_s)
        self._read_autopilot(now_s)
        self._read_receivers(now_s)
        out = self._vessel.tick(now_s)
        self._send(out.autopilot)
        self._publisher.publish(out)
        self._publisher.thrust(out.thrust)
        self._report(RECORDER, self._publisher.recorder_trouble())
        self._report(MESSAGES_MISSING, self._publisher.bus_trouble())
        state, autopilot = self._vessel.state.value, self._vessel.link.status.words
        envelope = self._vessel.envelope.state
        self._publisher.state(state, self._vessel.stamp_ns, autopilot, envelope)
        self._manager.alive(now_s, state)
        if self._keeper is not None:
            self._report(KEEPER, self._keeper.alive(now_s))

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
            self._send(self._vessel.hold(now_s))
        with suppress(Exception):
            self._publisher.thrust(NEUTRAL)
        detail = f"{where}: {type(error).__name__}: {error}"
        event = INTERNAL_ERROR.at(self._vessel.stamp_ns, detail)
        with suppress(Exception):
            self._publisher.report((event,))
        with suppress(Exception):
            self._vessel.note((event,), now_s)

    def _rest(self) -> None:
        self._publisher.thrust(NEUTRAL)
        self._send(self._vessel.rest(self._clock()))

    def _read_autopilot(self, now_s: float) -> None:
        self._publisher.publish(self._vessel.receive(self._receive(), now_s))

    def _read_receivers(self, now_s: float) -> None:
        """Read the lines that sentences of NMEA come by; one that breaks stops nothing."""
        for place, (receiver, lines) in enumerate(self._receivers):
            try:
                data = receiver.receive()
            except LinkError as error:
                if place not in self._silent_receivers:
                    self._silent_receivers.add(place)
                    self._report(RECEIVER_DOWN, str(error))
                continue
            if data:
                self._silent_receivers.discard(place)
            for text in lines.feed(data):
                self._publisher.publish(self._vessel.hear(text, now_s))

    def _keep_time(self, now_s: float) -> None:
        self._next_tick_s += self._period_s
        if self._next_tick_s <= now_s:  # late by a whole tick: drop it, keep the grid
            late_ms = (now_s - self._next_tick_s + self._period_s) * 1e3
            behind = int((now_s - self._next_tick_s) / self._period_s) + 1
            self._next_tick_s += behind * self._period_s
            self.missed_ticks += behind
            self._vessel.late(late_ms, now_s)
            self._report(OVERRUN, f"a tick {late_ms:.0f} ms late, {behind} missed")

    def _note_latency(self, message: Received) -> float:
        latency_ms = (time.monotonic_ns() - message.received_ns) / NANOSECONDS_PER_MS
        self.latencies.add(latency_ms)
        if message.sent_ns:
            self.wire_latencies.add((time.time_ns() - message.sent_ns) / NANOSECONDS_PER_MS)
        if latency_ms > OVERRUN_MS:
            self.overruns += 1
            self._vessel.late(latency_ms, self._clock())
            self._report(OVERRUN, f"a decision after {latency_ms:.0f} ms")
        return latency_ms

    def _receive(self) -> bytes:
        try:
            data = self._transport.receive()
        except LinkError as error:
            self._link_broke(error)
            return b""
        if self._link_is_down and self._transport.is_open:
            self._link_is_down = False
            self._report(LINK_RESTORED, "")
        return data

    def _send(self, data: bytes) -> None:
        try:
            self._transport.send(data)
        except LinkError as error:
            self._link_broke(error)

    def _link_broke(self, error: LinkError) -> None:
        if not self._link_is_down:
            self._link_is_down = True
            self._report(LINK_DOWN, str(error))

    def tell(self, kind: EventKind, detail: str) -> None:
        """Report what whoever drives the loop has found."""
        self._report(kind, detail)

    def _report(self, kind: EventKind, detail: str | None) -> None:
        """Report what happened to the loop itself; None: nothing."""
        if detail is not None:
            event: HealthEvent = kind.at(self._vessel.stamp_ns, detail)
            self._vessel.note((event,), self._clock())
            self._publisher.report((event,))


def run_vessel(
    config: RuntimeConfig,
    *,
    source: Path,
    stop: Callable[[], bool],
    until: Callable[[Vessel], bool] = lambda _vessel: False,
    refused: tuple[str, ...] = (),
    approval: str = "",
    withheld: str = "",
    ready: Callable[[], None] = lambda: None,
) -> RunSummary:
    """Open everything, loop until `stop` says so, close everything, and write the summary.

    Parameters
    ----------
    source
        The configuration's file, to be named in errors.
    stop
        Ends the loop, and the wait for an autopilot that is not there yet.
    until
        Ends the loop, too, when the vessel has done what it was started for.
    refused
        What of the priority the system did not give (`process.take_priority`): it is reported.
    approval
        Who approved the files that were read, if anybody: it is reported.
    withheld
        Why the configured arming is not asked for, if it is not: it is reported.
    ready
        Called once everything is open.

    Raises
    ------
    TwinscrewError
        Something configured cannot be used or opened: before anything moves.
    """
    folder = Path(config.recording.folder) if config.recording.folder else None
    inbox = Inbox()
    with ExitStack() as stack:
        vessel = make_vessel(config)
        transport = vessel.link.open(stop)
        stack.callback(transport.close)
        vessel.pipeline.warm_up()
        bus = ZenohBus(config.bus, config.name)
        stack.callback(bus.close)
        recorder = None
        if folder is not None:
            recorder = stack.enter_context(open_recorder(folder, config, source, vessel))
        publisher = Publisher(bus, recorder, vessel=config.name, frames=vessel.frames)
        receivers = []
        for line in config.senses.nmea.connections:
            receivers.append(reopening(line, open_transport(line)))
            stack.callback(receivers[-1].close)
        keeper = None
        if config.autopilot.kind == "thrust":
            keeper = Keeper(config.bus, config.name)
            stack.callback(keeper.close)
        rate_hz = config.command_rate_hz
        loop = Loop(
            vessel, inbox, transport, publisher, rate_hz=rate_hz, receivers=receivers, keeper=keeper
        )
        if refused:
            publisher.report((PRIORITY_REFUSED.at(vessel.stamp_ns, "; ".join(refused)),))
        if approval:
            publisher.report((FILES_APPROVED.at(vessel.stamp_ns, approval),))
        if withheld:
            event = ARMING_WITHHELD.at(vessel.stamp_ns, withheld)
            publisher.report((event,))
            vessel.note((event,), time.monotonic())
        stack.enter_context(Garbage())  # the first collection takes 20 ms: before a scan comes
        inbox.listen(bus, inputs_of(config))
        name = Name(bus, config.name, lambda words: loop.tell(NAME_TAKEN, words))
        ready()
        loop.run(lambda: stop() or name.is_anothers() or until(vessel))
    if name.yields:
        raise BusError(f"another runtime is named {config.name!r} on this bus: give one another")
    summary = RunSummary(
        name=config.name,
        decisions=publisher.decisions,
        decisions_sha256=publisher.sha256,
        latency_ms=loop.latencies.summary().as_dict(),
        wire_latency_ms=loop.wire_latencies.summary().as_dict(),
        overruns=loop.overruns,
        missed_ticks=loop.missed_ticks,
        priority_refused=refused,
        passed_over=dict(inbox.passed_over),
        unrecorded=recorder.dropped if recorder else 0,
    )
    if folder is not None:
        write_summary(summary, folder)
    return summary


class Name:
    """Watches that no other runtime on the bus has the vessel's name.

    Orders for one would reach both, and nobody could tell whose thrust and decisions he sees. One
    that finds another in its first seconds ends, and of two that start together both. Later nobody
    ends because somebody else appears: it is reported.
    """

    JUST_STARTED_S = 5.0
    """[s] Longer than it takes to reach the bus."""

    def __init__(
        self,
        bus: ZenohBus,
        name: str,
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.yields = False
        """Whether this runtime ends, because the name was taken."""
        self._bus, self._name, self._report, self._clock = bus, name, report, clock
        self._begin_s = clock()
        self._known: frozenset[str] = frozenset()
        bus.claim_name()

    def is_anothers(self) -> bool:
        """Look for others; tells whether this runtime has to end."""
        others = self._bus.namesakes
        if others != self._known:
            new, self._known = others - self._known, others
            if new:
                self._report(f"{self._name}: session {', '.join(sorted(new))}")
                self.yields = self._clock() - self._begin_s < self.JUST_STARTED_S
        return self.yields


def unused(folder: Path) -> Path:
    """Give the folder, or the first of folder-2, folder-3, ... that is not there or is empty.

    A boat that starts again keeps what it recorded before, and is not kept from starting by it.
    """
    candidate, number = folder, 1
    while candidate.exists() and any(candidate.iterdir()):
        number += 1
        candidate = folder.with_name(f"{folder.name}-{number}")
    return candidate


def open_recorder(folder: Path, config: RuntimeConfig, source: Path, vessel: Vessel) -> Recorder:
    """Open a recording in a new folder beside earlier ones; `source` is named in errors."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(
            f"{folder}: {error.strerror}", file=source, key="recording.folder"
        ) from error
    metadata = metadata_of(config, vessel.pipeline.policy)
    return Recorder(unused(folder / "recording"), config.name, metadata, config.recording)
