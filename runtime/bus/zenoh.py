"""Zenoh as the bus: its settings, its liveliness tokens, publishers and subscribers."""

from __future__ import annotations

import itertools
import json
import os
import re
import time
import uuid
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Final, Literal, cast

import zenoh
from msgspec import Meta, field

from twinscrew.runtime.bus.base import (
    Received,
    Receiver,
    SequenceGaps,
    attachment,
    find_topic,
    source_time_ns,
)
from twinscrew.runtime.errors import BusError, ConfigError, one_of
from twinscrew.runtime.files import read_file, require_private
from twinscrew.runtime.messages.topics import (
    TOPICS,
    KeyFormat,
    Topic,
    Traffic,
    key,
    rmw_type,
    ros_name,
)
from twinscrew.runtime.settings import Positive, Settings

# -- Zenoh's configuration, made from settings; nothing beyond this machine unless asked for.


MOST_SESSIONS: Final = 32
"""[-] Programs that may be connected at a time: fewer than there are threads that receive."""
os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 40), tx: (worker_threads: 4))")
"""Zenoh's threads, which it reads once, before the first session. While Zenoh gives up a peer that
has stopped reading (10 s after it fell silent, for 10 s), that holds one of its receiving threads,
of which there are two by default: two stopped viewers kept everybody's messages from coming in."""

DEFAULT_PORT: Final = 7447
DEFAULT_ENDPOINT: Final = f"tcp/127.0.0.1:{DEFAULT_PORT}"
"""Zenoh's usual port, on this machine only."""


class ZenohSettings(Settings, frozen=True):
    """How to reach the others. Complete without a file."""

    mode: Literal["peer", "client", "router"] = "peer"
    """A peer goes on trying to reach its `connect` endpoints, and hears those who are there. A
    client needs one of them at once, and hears everybody whom that one hears: for tools."""
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    """Where to find the others: a simulator, a bridge or a router."""
    listen: tuple[str, ...] = ()
    """Where to be found; nowhere by default."""
    multicast_scouting: bool = False
    """Look for others on the local network, and let them find us."""
    shared_memory: bool = True
    """Let large payloads go to programs on this machine by shared memory."""
    config_file: str | None = None
    """A configuration in Zenoh's own words (JSON5): TLS, access control. The five settings above
    are applied over it where they are not at their defaults; what it does not say of listening and
    of looking for others is theirs, too. Private keys that it names must be their owner's alone."""
    key_format: KeyFormat = "ros2dds"
    """Whose keys: those of zenoh-bridge-ros2dds, of rmw_zenoh, or of rmw_zenoh in ROS 2 Humble,
    which has no type hashes."""
    domain: Annotated[int, Meta(ge=0, le=232)] = 0
    """[-] ROS_DOMAIN_ID; rmw_zenoh's keys hold it."""
    topics: dict[str, str] = field(default_factory=dict)
    """Topics that have other names on this bus: `points = "velodyne/points"` is under the vessel's
    namespace, "/points" is not. Left out, a topic has its own (docs/interfaces.md)."""
    node: Annotated[str, Meta(pattern="^([A-Za-z_][A-Za-z0-9_]*)?$")] = "twinscrew"
    """The node's name in ROS 2: `ros2 topic list` shows what is published and heard; empty: it does
    not."""
    max_message_mb: Positive = 64.0
    """[MB] Larger messages are thrown away and told. A cloud of 1e6 points has 20 to 48 MB."""
    lossless: bool = False
    """Wait where the line is full instead of dropping: for lock-step, never at sea."""

    def __post_init__(self) -> None:
        """Refuse names of topics that there are not, or that ROS does not allow."""
        for name, other in self.topics.items():
            if name not in TOPICS:
                raise ValueError(f"topics: {one_of(name, TOPICS)}")
            if not _ROS_NAME.fullmatch(other):
                raise ValueError(
                    f"topics.{name}: {other!r} is not a name: letters, digits, _ and / between"
                )
        names = [self.topics.get(name, topic.key) for name, topic in TOPICS.items()]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"topics: {twice[0]!r} would be two topics")

    def topic(self, name: str) -> Topic:
        """Give a topic of the table, as it is called here; a `BusError` if there is none."""
        topic = find_topic(name)
        return replace(topic, key=self.topics[name]) if name in self.topics else topic


_ROS_NAME: Final = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_KEYS: Final = {
    "mode": "mode",
    "connect": "connect/endpoints",
    "listen": "listen/endpoints",
    "multicast_scouting": "scouting/multicast/enabled",
    "shared_memory": "transport/shared_memory/enabled",
}
"""Where in Zenoh's configuration a setting belongs."""
_SHY: Final = ("listen", "multicast_scouting")
"""Zenoh would listen at every address, and look for others, where a file does not say otherwise."""
_PRIVATE_KEYS: Final = (
    "transport/link/tls/listen_private_key",
    "transport/link/tls/connect_private_key",
)
_ROOM: Final = 2
"""[-] Zenoh itself drops a message of more than this many times the limit, before it is whole: a
peer cannot fill the memory. Up to there the message comes, and its sender's topic can be named."""
_NEVER_BLOCKS: Final = {
    # What others publish is dropped, and not waited with, where one for whom it is passed on does
    # not read: rmw_zenoh and the bridges ask to wait, and the wait (5 s) would be everybody's.
    "qos/network": [
        {
            "id": "lookers_on_never_block",
            "messages": ["put", "delete"],
            "flows": ["ingress"],
            "overwrite": {"congestion_control": "drop"},
        }
    ],
}
_OUR_DEFAULTS: Final = {
    # Look again after 0.1 s, later every second: a boat's programs start in any order.
    "connect/retry": {
        "period_init_ms": 100,
        "period_max_ms": 1000,
        "period_increase_factor": 2.0,
    },
    # Do not wait for peers when opening: matching is awaited where it matters.
    "open/return_conditions": {"connect_scouted": False, "declares": False},
}


def zenoh_config(settings: ZenohSettings) -> zenoh.Config:
    """Make Zenoh's configuration.

    Raises
    ------
    ConfigError
        The file cannot be read, or Zenoh refuses a value; the error names it.
    """
    if settings.config_file is None:
        config = zenoh.Config()
        names = set(_KEYS)
        _insert_all(config, _OUR_DEFAULTS)
    else:
        config = _read(Path(settings.config_file))
        defaults = ZenohSettings()
        names = {n for n in _KEYS if getattr(settings, n) != getattr(defaults, n)}
        names |= {n for n in _SHY if _unsaid(config, _KEYS[n])}
        _check_private_keys(config)
    protection: dict[str, Any] = {"transport/unicast/max_sessions": MOST_SESSIONS}
    if not settings.lossless:
        protection |= _NEVER_BLOCKS
    _insert_all(config, {k: v for k, v in protection.items() if _unsaid(config, k)})
    most = round(_ROOM * settings.max_message_mb * 1_000_000)
    _insert_all(config, {"transport/link/rx/max_message_size": most})
    _insert_all(config, {_KEYS[name]: getattr(settings, name) for name in sorted(names)})
    return config


def in_short(error: Exception) -> str:
    """Give Zenoh's words without the places in its source."""
    return re.sub(r" at /\S+:\d+\.?", "", str(error)).strip()


def _insert_all(config: zenoh.Config, values: dict[str, Any]) -> None:
    for name, value in values.items():
        try:
            config.insert_json5(name, json.dumps(value))
        except zenoh.ZError as error:
            raise ConfigError(f"{value!r}: {in_short(error)}", file="zenoh", key=name) from None


def _unsaid(config: zenoh.Config, key: str) -> bool:
    """Tell whether a key has Zenoh's own default."""
    return bool(config.get_json(key) == zenoh.Config().get_json(key))


def _check_private_keys(config: zenoh.Config) -> None:
    for name in _PRIVATE_KEYS:
        path = json.loads(config.get_json(name))
        if path is not None:
            require_private(Path(path))


def _read(path: Path) -> zenoh.Config:
    if not path.is_file():
        raise ConfigError("no such file", file=path)
    try:
        return zenoh.Config.from_json5(read_file(path).decode("utf-8"))
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    except (zenoh.ZError, UnicodeDecodeError) as error:
        raise ConfigError(f"not a Zenoh configuration: {in_short(error)}", file=path) from None


# -- Liveliness tokens: what makes `ros2 topic list` show what we publish and hear.
#
# Two kinds for the two key formats. rmw_zenoh builds the whole graph of ROS 2 out of tokens (its
# docs/design.md, "Graph Cache"). zenoh-bridge-ros2dds makes a DDS writer or reader for what other
# sessions announce (its liveliness_mgt.rs, 1.x). Messages flow without them.

_EMPTY: Final = "%"
_SLASH_RMW, _SLASH_DDS = "%", "§"
_RELIABLE, _VOLATILE, _TRANSIENT_LOCAL, _KEEP_LAST = 1, 0, 1, 0
"""DDS's numbers; rmw's number of transient local is the same."""
NODE_ID: Final = 0
"""[-] We are one node a session and namespace, and rmw_zenoh counts nodes and entities together."""


class End(Enum):
    """Which end of a topic we are."""

    PUBLISHER = "MP"
    SUBSCRIBER = "MS"


def rmw_node(session: str, domain: int, namespace: str, node: str) -> str:
    """Give rmw_zenoh's token of a node.

    Parameters
    ----------
    session
        The Zenoh session's identity, hexadecimal.
    domain
        [-] ROS_DOMAIN_ID.
    namespace, node
        The node's namespace, without a leading slash, and name.
    """
    return _rmw(session, domain, NODE_ID, "NN", namespace, node)


def rmw_end(
    session: str,
    domain: int,
    namespace: str,
    node: str,
    number: int,
    end: End,
    topic: Topic,
    key_format: KeyFormat = "rmw_zenoh",
) -> str:
    """Give rmw_zenoh's token of a publisher or subscriber; `number` is its own in the session."""
    name = ros_name(topic, namespace).replace("/", _SLASH_RMW)
    # Reliable, volatile, keep the last `depth`: the defaults have no numbers.
    quality = f":{_TRANSIENT_LOCAL if topic.durable else ''}:,{topic.depth}:,:,:,,"
    entity = _rmw(session, domain, number, end.value, namespace, node)
    type_ = rmw_type(topic, key_format)
    return f"{entity}/{name}/{type_}/{quality}"


def dds_end(session: str, namespace: str, end: End, topic: Topic) -> str:
    """Give zenoh-bridge-ros2dds's token of a publisher or subscriber."""
    name = ros_name(topic, namespace).removeprefix("/").replace("/", _SLASH_DDS)
    type_ = topic.ros_type.replace("/", _SLASH_DDS)
    durability = _TRANSIENT_LOCAL if topic.durable else _VOLATILE
    quality = f":{_RELIABLE}:{durability}:{_KEEP_LAST},{topic.depth}"
    return f"@/{session}/@ros2_lv/{end.value}/{name}/{type_}/{quality}"


def _rmw(session: str, domain: int, number: int, kind: str, namespace: str, node: str) -> str:
    where = f"/{namespace}".replace("/", _SLASH_RMW) if namespace else _EMPTY
    enclave = _EMPTY
    return f"@ros2_lv/{domain}/{session}/{NODE_ID}/{number}/{kind}/{enclave}/{where}/{node}"


# -- The bus between processes and machines: ROS 2 messages over Zenoh.

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
        self.namesakes: set[str] = set()
        self._tokens: list[zenoh.LivelinessToken] = []
        self._nodes: set[str] = set()
        config = zenoh_config(settings)
        try:
            self.session = zenoh.open(config)
        except zenoh.ZError as error:
            raise BusError(
                f"Zenoh cannot be opened ({_words(config)}): {in_short(error)}"
            ) from None

    def announce(self, namespace: str, topic: str, end: End) -> None:
        """Tell ROS 2 that we publish, or hear, a topic."""
        settings, session = self.settings, str(self.session.zid())
        if not settings.node:
            return
        if settings.key_format == "ros2dds":
            self._declare(dds_end(session, namespace, end, settings.topic(topic)))
            return
        who = (session, settings.domain, namespace, settings.node)
        if namespace not in self._nodes:
            self._nodes.add(namespace)
            self._declare(rmw_node(*who))
        number = len(self._tokens) + 1
        self._declare(rmw_end(*who, number, end, settings.topic(topic), settings.key_format))

    def claim(self, token: str) -> None:
        """Have a token of our own, as long as the session lives."""
        self._declare(token)

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
        line.announce(self._namespace, topic, End.SUBSCRIBER)

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

    def claim_name(self) -> None:
        """Tell that a runtime of this namespace runs here, and look out for others that do.

        They are seen where Zenoh passes tokens on: from everybody to clients, and between peers
        that are connected with each other, but not between two peers by way of a third, or of a
        router. Where access control forbids tokens nothing is seen either.
        """
        line, own = self._line, str(self._line.session.zid())
        runtimes = f"twinscrew/runtime/{self._namespace}"

        def see(sample: zenoh.Sample) -> None:
            who = str(sample.key_expr).rpartition("/")[2]
            if who != own:
                alive = sample.kind == zenoh.SampleKind.PUT
                (line.namesakes.add if alive else line.namesakes.discard)(who)

        with suppress(zenoh.ZError):
            line.claim(f"{runtimes}/{own}")
            handler = zenoh.handlers.Callback(see, indirect=False)
            liveliness = line.session.liveliness()
            line.subscribers.append(
                liveliness.declare_subscriber(f"{runtimes}/*", handler, history=True)
            )

    @property
    def namesakes(self) -> frozenset[str]:
        """Other sessions, by identity, in which a runtime of this namespace runs now."""
        return frozenset(self._line.namesakes)

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
            self._line.announce(self._namespace, topic, End.PUBLISHER)
        return publisher

    def _key(self, topic: str) -> str:
        if self._line.closed:
            raise BusError("the bus is closed")
        settings = self._line.settings
        return key(
            settings.topic(topic), self._namespace, settings.key_format, domain=settings.domain
        )


def _words(config: zenoh.Config) -> str:
    """Say what a configuration wants to be."""
    mode, listen, connect = (
        json.loads(config.get_json(key))
        for key in ("mode", "listen/endpoints", "connect/endpoints")
    )
    return f"{mode or 'peer'}, listening on {listen}, connecting to {connect}"
