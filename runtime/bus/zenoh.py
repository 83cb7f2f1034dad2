"""The bus between processes and machines: ROS 2 messages over Zenoh."""

from __future__ import annotations

import itertools
import json
import time
import uuid
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Final, cast

import zenoh

from twinscrew.runtime.bus import tokens
from twinscrew.runtime.bus.base import Received, Receiver, find_topic
from twinscrew.runtime.bus.gaps import SequenceGaps, attachment, source_time_ns
from twinscrew.runtime.bus.zenoh_config import ZenohSettings, in_short, zenoh_config
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages.topics import Traffic, key

_PRIORITIES: Final = {
    Traffic.SENSOR: zenoh.Priority.DATA,
    Traffic.COMMAND: zenoh.Priority.REAL_TIME,
    Traffic.STATUS: zenoh.Priority.DATA_LOW,
}
_POLL_S: Final = 0.005
"""[s] How often to look whether subscribers have come."""


class _Line:
    """What the faces of one Zenoh session share."""

    def __init__(self, settings: ZenohSettings) -> None:
        self.settings = settings
        self.gaps = SequenceGaps()
        self.refused: Counter[str] = Counter()
        self.closed = False
        self.publishers: dict[str, _Publisher] = {}
        self.subscribers: list[zenoh.Subscriber[None]] = []
        self._tokens: list[zenoh.LivelinessToken] = []
        self._nodes: set[str] = set()
        config = zenoh_config(settings)
        try:
            self.session = zenoh.open(config)
        except zenoh.ZError as error:
            raise BusError(
                f"Zenoh cannot be opened ({_words(config)}): {in_short(error)}"
            ) from None

    def announce(self, namespace: str, topic: str, end: tokens.End) -> None:
        """Tell ROS 2 that we publish, or hear, a topic."""
        settings, session = self.settings, str(self.session.zid())
        if not settings.node:
            return
        if settings.key_format == "ros2dds":
            self._declare(tokens.dds_end(session, namespace, end, find_topic(topic)))
            return
        who = (session, settings.domain, namespace, settings.node)
        if namespace not in self._nodes:
            self._nodes.add(namespace)
            self._declare(tokens.rmw_node(*who))
        number = len(self._tokens) + 1
        self._declare(tokens.rmw_end(*who, number, end, find_topic(topic)))

    def _declare(self, token: str) -> None:
        self._tokens.append(self.session.liveliness().declare_token(token))


class _Publisher:
    """A Zenoh publisher that numbers what it sends."""

    def __init__(self, line: _Line, name: str, traffic: Traffic) -> None:
        congestion = zenoh.CongestionControl
        self._gid = uuid.uuid4().bytes
        self._sequence = itertools.count(1)
        self._zenoh = line.session.declare_publisher(
            name,
            congestion_control=congestion.BLOCK if line.settings.lossless else congestion.DROP,
            priority=_PRIORITIES[traffic],
            express=traffic is not Traffic.STATUS,
        )

    def put(self, payload: bytes) -> None:
        """Send a payload."""
        attached = attachment(next(self._sequence), time.time_ns(), self._gid)
        self._zenoh.put(payload, attachment=attached)

    @property
    def is_heard(self) -> bool:
        """Whether somebody listens."""
        # zenoh's stub calls it a bool, but it is a struct that is always true.
        return cast("zenoh.MatchingStatus", self._zenoh.matching_status).matching


class ZenohBus:
    """Carries payloads by Zenoh; receivers are called from Zenoh's thread."""

    def __init__(
        self, settings: ZenohSettings, namespace: str, *, _line: _Line | None = None
    ) -> None:
        """Open a session.

        Raises
        ------
        BusError
            It cannot be opened: a port is in use, or an endpoint is out of reach.
        ConfigError
            The settings or the configuration file cannot be used.
        """
        self._namespace = namespace
        self._line = _line or _Line(settings)

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a payload; see `Bus.publish`."""
        publisher = self._publisher(topic)
        try:
            publisher.put(payload)
        except zenoh.ZError as error:
            raise BusError(f"{topic} cannot be sent: {in_short(error)}") from None

    def subscribe(self, topic: str, receive: Receiver) -> None:
        """Listen to a topic; see `Bus.subscribe`. `receive` must not call the bus."""
        line, most_b = self._line, self._line.settings.max_message_mb * 1_000_000
        most_b = min(most_b, find_topic(topic).largest_b or most_b)

        def take(sample: zenoh.Sample) -> None:
            now_ns = time.monotonic_ns()
            if sample.kind != zenoh.SampleKind.PUT:
                return
            sent_ns = 0
            if sample.attachment is not None:
                attached = sample.attachment.to_bytes()
                line.gaps.see(topic, attached)
                sent_ns = source_time_ns(attached)
            if len(sample.payload) > most_b:
                line.refused[topic] += 1
                return
            receive(Received(topic, sample.payload.to_bytes(), now_ns, sent_ns))

        # Called in Zenoh's own thread: a thread of Python's between them would be a queue without a
        # bound, and would keep a program alive that forgot to close its bus.
        handler = zenoh.handlers.Callback(take, indirect=False)
        line.subscribers.append(line.session.declare_subscriber(self._key(topic), handler))
        line.announce(self._namespace, topic, tokens.End.SUBSCRIBER)

    def wait_for_subscribers(self, topics: Iterable[str], timeout_s: float) -> bool:
        """Wait until somebody listens to each of the topics: what is sent before is lost.

        Returns
        -------
        bool
            False if time ran out.
        """
        publishers = [self._publisher(topic) for topic in topics]
        deadline_s = time.monotonic() + timeout_s
        while not all(publisher.is_heard for publisher in publishers):
            if time.monotonic() > deadline_s:
                return False
            time.sleep(_POLL_S)
        return True

    @property
    def session(self) -> zenoh.Session:
        """Zenoh's session, for what is no topic."""
        return self._line.session

    def service_key(self, name: str) -> str:
        """Give the key of a service in this bus's namespace."""
        return f"{self._namespace}/{name}"

    def within(self, namespace: str) -> ZenohBus:
        """Give the same session as seen from another vessel's namespace."""
        return ZenohBus(self._line.settings, namespace, _line=self._line)

    def close(self) -> None:
        """Close the session for all namespaces."""
        line = self._line
        if line.closed:
            return
        line.closed = True
        line.session.close()  # type: ignore[no-untyped-call]

    @property
    def lost(self) -> Mapping[str, int]:
        """How many messages of each topic were sent to us and did not arrive."""
        return self._line.gaps.lost

    @property
    def refused(self) -> int:
        """How many messages were too large to be taken in."""
        return self._line.refused.total()

    @property
    def missing(self) -> Mapping[str, int]:
        """See `Bus.missing`."""
        large = {f"{topic} too large": count for topic, count in self._line.refused.items()}
        return large | {f"{topic} lost": count for topic, count in self.lost.items()}

    def _publisher(self, topic: str) -> _Publisher:
        name = self._key(topic)
        publisher = self._line.publishers.get(name)
        if publisher is None:
            publisher = _Publisher(self._line, name, find_topic(topic).traffic)
            self._line.publishers[name] = publisher
            self._line.announce(self._namespace, topic, tokens.End.PUBLISHER)
        return publisher

    def _key(self, topic: str) -> str:
        if self._line.closed:
            raise BusError("the bus is closed")
        settings = self._line.settings
        return key(find_topic(topic), self._namespace, settings.key_format, domain=settings.domain)


def _words(config: zenoh.Config) -> str:
    """Say what a configuration wants to be."""
    mode, listen, connect = (
        json.loads(config.get_json(key))
        for key in ("mode", "listen/endpoints", "connect/endpoints")
    )
    return f"{mode or 'peer'}, listening on {listen}, connecting to {connect}"
