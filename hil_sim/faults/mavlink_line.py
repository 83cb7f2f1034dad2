"""MAVLink between a runtime and its autopilot, over lines on which things go wrong."""

from __future__ import annotations

from collections.abc import Callable

from twinscrew.hil_sim.faults.line import Line
from twinscrew.runtime.link.transport import Transport


class FaultyTransport(Transport):
    """The autopilot's end of the connection; a datagram is a message of the line."""

    def __init__(
        self, inner: Transport, incoming: Line, outgoing: Line, clock: Callable[[], float]
    ) -> None:
        self._inner = inner
        self._incoming, self._outgoing = incoming, outgoing
        self._clock = clock

    def fileno(self) -> int:
        """See `Transport`."""
        return self._inner.fileno()

    def receive(self) -> bytes:
        """See `Transport`."""
        now_s = self._clock()
        data = self._inner.receive()
        passed = self._incoming.put(data, now_s) if data else []
        return b"".join([*passed, *self._incoming.due(now_s)])

    def send(self, data: bytes) -> None:
        """See `Transport`."""
        now_s = self._clock()
        passed = self._outgoing.put(data, now_s) if data else []
        for datagram in [*passed, *self._outgoing.due(now_s)]:
            self._inner.send(datagram)

    def close(self) -> None:
        """See `Transport`."""
        self._inner.close()
