"""A bus within one thread: messages arrive in the order in which they were sent, always."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Mapping

from twinscrew.runtime.bus.base import Received, Receiver, find_topic
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages.topics import ros_name


class _Exchange:
    """What the faces of one memory bus share."""

    def __init__(self) -> None:
        self.receivers: defaultdict[str, list[Receiver]] = defaultdict(list)
        self.waiting: deque[tuple[str, Received]] = deque()
        self.delivering = False
        self.closed = False

    def deliver(self) -> None:
        """Hand out what waits. What a receiver publishes meanwhile waits for its turn."""
        if self.delivering:
            return
        self.delivering = True
        try:
            while self.waiting:
                name, message = self.waiting.popleft()
                for receive in tuple(self.receivers[name]):
                    receive(message)
        finally:
            self.delivering = False


class MemoryBus:
    """Delivers within `publish`, before it returns; not for several threads."""

    def __init__(self, namespace: str, _exchange: _Exchange | None = None) -> None:
        self._namespace = namespace
        self._exchange = _exchange or _Exchange()

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a payload; see `Bus.publish`."""
        name = self._name(topic)
        self._exchange.waiting.append((name, Received(topic, bytes(payload), 0)))
        self._exchange.deliver()

    def subscribe(self, topic: str, receive: Receiver) -> None:
        """Listen to a topic; see `Bus.subscribe`."""
        self._exchange.receivers[self._name(topic)].append(receive)

    @property
    def missing(self) -> Mapping[str, int]:
        """See `Bus.missing`: here nothing can be lost."""
        return {}

    def within(self, namespace: str) -> MemoryBus:
        """Give the same bus as seen from another vessel's namespace."""
        return MemoryBus(namespace, self._exchange)

    def close(self) -> None:
        """Close the bus for all namespaces."""
        self._exchange.closed = True
        self._exchange.receivers.clear()
        self._exchange.waiting.clear()

    def _name(self, topic: str) -> str:
        if self._exchange.closed:
            raise BusError("the bus is closed")
        return ros_name(find_topic(topic), self._namespace)
