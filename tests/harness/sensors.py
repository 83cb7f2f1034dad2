"""The sensors' end of a runtime's bus: sends what a boat at rest measures, and takes what comes."""

from __future__ import annotations

from tests.harness.boat import TICK_S, cloud, odometry
from tests.harness.waiting import wait_until

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import HealthEvent


class Sensors:
    """Sensors on a bus; what the runtime says comes in Zenoh's threads."""

    def __init__(self, bus: ZenohBus) -> None:
        self.decisions: list[bytes] = []
        self.events: list[HealthEvent] = []
        self._bus = bus
        self._ticks = 0
        bus.subscribe("decision", lambda message: self.decisions.append(message.payload))
        bus.subscribe("diagnostics", self._hear)

    def measure_until_decided(self, count: int) -> None:
        """Send scans and odometry until so many decisions have come."""

        def enough() -> bool:
            time_s = self._ticks * TICK_S
            self._ticks += 1
            self._bus.publish("odometry", cdr.encode_odometry(odometry(time_s)))
            self._bus.publish("points", cdr.encode_point_cloud(cloud(time_s)))
            return len(self.decisions) >= count

        wait_until(enough)

    def wait_for_event(self, name: str, words: str) -> None:
        """Wait until an event of this name, with these words in its detail, is told."""
        wait_until(lambda: any(e.name == name and words in e.detail for e in self.events))

    def _hear(self, message: Received) -> None:
        self.events.extend(cdr.decode_diagnostics(message.payload))
