"""What a control loop waits on: everything that came in, newest scans only, in order of arrival."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Iterable, Mapping

from twinscrew.runtime.bus.base import Bus, Received, find_topic


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
