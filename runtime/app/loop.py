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
import time
from collections.abc import Callable
from contextlib import suppress
from typing import ParamSpec, TypeVar

from twinscrew.runtime.app.controller import Controller
from twinscrew.runtime.app.garbage import Garbage
from twinscrew.runtime.app.ground import GroundReport
from twinscrew.runtime.app.ground_desk import GroundDesk
from twinscrew.runtime.app.latency import Latencies
from twinscrew.runtime.app.notify import ServiceManager
from twinscrew.runtime.app.outlet import Outlet
from twinscrew.runtime.bus.base import Inbox, Received
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.messages.types import HealthEvent
from twinscrew.runtime.safety.events import (
    INTERNAL_ERROR,
    LINK_DOWN,
    LINK_RESTORED,
    MESSAGES_MISSING,
    OVERRUN,
    RECORDER,
)

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
