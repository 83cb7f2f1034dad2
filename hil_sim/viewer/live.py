"""Looks at running boats by Zenoh. It only listens: nothing it does can reach them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Final, Literal, NamedTuple

from twinscrew.hil_sim.viewer.scene import Scene
from twinscrew.hil_sim.viewer.source import Places
from twinscrew.hil_sim.viewer.vessel import SHOWN, Vessel
from twinscrew.hil_sim.viewer.wire import Part
from twinscrew.runtime.bus.inbox import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.perception.sensor import Sensor

NANOSECONDS: Final = 1e-9


class Boat(NamedTuple):
    """One boat to look at."""

    name: str
    sensor: Sensor


class LiveSource:
    """Follows boats. Of each topic only the newest unread messages are kept (`Inbox`)."""

    mode: Literal["live"] = "live"
    duration_s = 0.0

    def __init__(self, settings: ZenohSettings, boats: Sequence[Boat], scene: Scene) -> None:
        """Open a bus of its own.

        Raises
        ------
        BusError
            The endpoint cannot be reached.
        """
        self.names = tuple(boat.name for boat in boats)
        self.scene = scene
        self._begin_s = time.monotonic()
        self._vessels = [Vessel(boat.name, boat.sensor) for boat in boats]
        self._inboxes = [Inbox() for _ in boats]
        self._parts: tuple[Part, ...] = ()
        self._parts_s = -1.0
        self._bus = ZenohBus(settings, self.names[0])
        for name, inbox in zip(self.names, self._inboxes, strict=True):
            inbox.listen(self._bus.within(name), SHOWN)

    def now_s(self) -> float:
        """See `Source`."""
        return time.monotonic() - self._begin_s

    def follow(self) -> None:
        """Take in what has come; to be called often enough that trails have no gaps."""
        for vessel, inbox in zip(self._vessels, self._inboxes, strict=True):
            for message in inbox.wait(0.0):
                came_s = message.received_ns * NANOSECONDS - self._begin_s
                sent_s = message.sent_ns * NANOSECONDS if message.sent_ns else None
                vessel.take(message.topic, message.payload, came_s, sent_s)

    def parts(self, time_s: float) -> Sequence[Part]:
        """See `Source`; pages that ask at the same time get the same."""
        if time_s != self._parts_s:
            self._parts = tuple(vessel.part(time_s) for vessel in self._vessels)
            self._parts_s = time_s
        return self._parts

    def trails(self) -> Mapping[str, Places]:
        """See `Source`."""
        return {vessel.name: vessel.trail.places for vessel in self._vessels}

    @property
    def revision(self) -> int:
        """See `Source`: who came late learns of the way before."""
        return sum(vessel.trail.is_preceded for vessel in self._vessels)

    def close(self) -> None:
        """See `Source`."""
        self._bus.close()
