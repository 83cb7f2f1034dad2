"""What carries messages: the protocol, gaps in sequences, the bus in memory, the inbox."""

from __future__ import annotations

import struct
import threading
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple, Protocol, Self, TypeAlias

from twinscrew.runtime.errors import BusError, one_of
from twinscrew.runtime.messages.topics import TOPICS, Topic, ros_name

# -- What a bus is: payloads of named topics between the programs of one or several vessels.


class Received(NamedTuple):
    """A message as it came in."""

    topic: str
    """A name of `TOPICS`."""
    payload: bytes
    received_ns: int
    """[ns] Monotonic clock, not the message's stamp; 0 where there is no clock (lock-step)."""
    sent_ns: int = 0
    """[ns] The sender's wall clock; 0 if it did not say."""


Receiver: TypeAlias = Callable[[Received], None]
"""Takes a message. It may be called from another thread and must return at once."""


class Bus(Protocol):
    """Carries payloads. Topics are names of `TOPICS`, within one vessel's namespace."""

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a payload to everyone who listens; nobody is an error.

        Raises
        ------
        BusError
            The bus is closed, or there is no such topic.
        """

    def subscribe(self, topic: str, receive: Receiver) -> None:
        """Have `receive` called with every message of a topic from now on.

        Raises
        ------
        BusError
            The bus is closed, or there is no such topic.
        """

    @property
    def missing(self) -> Mapping[str, int]:
        """How many messages to us are missing, by what became of them: "points too large"."""

    def within(self, namespace: str) -> Self:
        """Give the same bus as seen from another vessel's namespace."""

    def close(self) -> None:
        """Stop receiving and sending; closing twice is closing once."""


def find_topic(name: str) -> Topic:
    """Give a topic of the table; a `BusError` lists them if it is not there."""
    topic = TOPICS.get(name)
    if topic is None:
        raise BusError(f"topic {one_of(name, TOPICS)}")
    return topic


# -- Counts messages that never arrived, by the sequence numbers that senders attach.
#
# A sample lost on its way (a full queue, a stalled receiver) leaves no other trace. The attachment
# is rmw_zenoh's: int64 sequence, int64 source time [ns], 16-byte identity of the publisher with its
# length before it.

ATTACHMENT: Final = struct.Struct("<qqB16s")
"""rmw_zenoh's attachment; its samples are thrown away without it."""
GID_SIZE: Final = 16
MAX_PUBLISHERS: Final = 256
"""[-] More identities than this on a topic are not followed: memory stays bounded."""

MOST_LOST: Final = 10_000
"""[-] A number farther ahead than this is no gap but another count: 17 minutes of scans."""


def attachment(sequence: int, source_ns: int, gid: bytes) -> bytes:
    """Give the attachment of a sample: its number from 1, wall clock [ns], who sends."""
    return ATTACHMENT.pack(sequence, source_ns, GID_SIZE, gid)


def source_time_ns(attached: bytes) -> int:
    """Give the sender's wall clock [ns] of an attachment; 0 if it is of another kind."""
    if len(attached) != ATTACHMENT.size:
        return 0
    _, source_ns, _, _ = ATTACHMENT.unpack(attached)
    return int(source_ns)


class SequenceGaps:
    """Follows every publisher of every topic."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, bytes], int] = {}
        self._lost: Counter[str] = Counter()

    def see(self, topic: str, attached: bytes) -> None:
        """Take note of a sample's attachment; one of another kind says nothing."""
        if len(attached) != ATTACHMENT.size:
            return
        sequence, _, _, gid = ATTACHMENT.unpack(attached)
        last = self._last.get((topic, gid))
        if last is None and len(self._last) >= MAX_PUBLISHERS:
            return
        if last is not None and last + 1 < sequence <= last + MOST_LOST:
            self._lost[topic] += sequence - last - 1
        self._last[topic, gid] = sequence

    @property
    def lost(self) -> Mapping[str, int]:
        """How many messages of each topic are known not to have arrived."""
        return dict(self._lost)


# -- A bus within one thread: messages arrive in the order in which they were sent, always.


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


# -- What a control loop waits on: everything that came in, newest scans only, in order of arrival.


class Inbox:
    """Keeps what arrives until the loop takes it. Safe between threads; never grows.

    Of each topic only its `depth` newest unread messages are kept: a slow loop works on the newest
    scan, not on a queue of old ones. What was passed over is counted.
    """

    def __init__(self) -> None:
        self._messages: deque[Received] = deque()
        self._unread: Counter[str] = Counter()
        self._passed_over: Counter[str] = Counter()
        self._arrived = threading.Condition(threading.Lock())

    def listen(self, bus: Bus, topics: Iterable[str]) -> None:
        """Receive these topics of a bus."""
        for topic in topics:
            bus.subscribe(topic, self.put)

    def put(self, message: Received) -> None:
        """Add a message, in the place of the topic's oldest one if there are too many."""
        topic = message.topic
        depth = find_topic(topic).depth
        with self._arrived:
            if self._unread[topic] >= depth:
                oldest = next(at for at, m in enumerate(self._messages) if m.topic == topic)
                del self._messages[oldest]
                self._passed_over[topic] += 1
            else:
                self._unread[topic] += 1
            self._messages.append(message)
            self._arrived.notify()

    def wait(self, timeout_s: float) -> list[Received]:
        """Give everything unread in order of arrival, as soon as there is something.

        Parameters
        ----------
        timeout_s
            [s] How long to wait at most; then the list is empty. 0 or less only looks.
        """
        with self._arrived:
            if not self._messages and timeout_s > 0:
                self._arrived.wait(timeout_s)
            messages = list(self._messages)
            self._messages.clear()
            self._unread.clear()
        return messages

    @property
    def passed_over(self) -> Mapping[str, int]:
        """How many messages of each topic were replaced before they were read."""
        with self._arrived:
            return dict(self._passed_over)
