"""The Zenoh bus between processes, with real sockets on loopback."""

import os
import socket
import subprocess
import sys
import textwrap
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import zenoh

from twinscrew.runtime.bus.base import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings, zenoh_config
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages.topics import TOPICS

ECHO = textwrap.dedent(
    """
    import sys
    from twinscrew.runtime.bus.base import Inbox
    from twinscrew.runtime.bus.zenoh import ZenohBus
    from twinscrew.runtime.bus.zenoh import ZenohSettings

    bus = ZenohBus(ZenohSettings(connect=(sys.argv[1],), lossless=True), "wamv1")
    inbox = Inbox()
    inbox.listen(bus, ("points", "odometry", "goal"))
    while True:
        for message in inbox.wait(60):
            if message.topic == "goal":
                sys.exit()
            bus.publish("decision", message.topic.encode() + b":" + message.payload)
    """
)


@pytest.fixture
def endpoint():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def listening(endpoint, **more):
    return ZenohSettings(listen=(endpoint,), connect=(), **more)


@pytest.fixture
def simulator(endpoint):
    bus = ZenohBus(listening(endpoint, lossless=True), "sim")
    yield bus.within("wamv1")
    bus.close()


@pytest.fixture
def boat(simulator, endpoint):
    bus = ZenohBus(ZenohSettings(connect=(endpoint,)), "wamv1")
    yield bus
    bus.close()


def gather(inbox, count, timeout_s=20.0):
    """Give `count` messages, or what came in time."""
    messages, deadline_s = [], time.monotonic() + timeout_s
    while len(messages) < count and time.monotonic() < deadline_s:
        messages += inbox.wait(0.5)
    return messages


def test_another_process_hears_every_byte_and_answers(simulator, endpoint):
    answers = Inbox()
    answers.listen(simulator, ("decision",))
    process = subprocess.Popen([sys.executable, "-c", ECHO, endpoint])
    try:
        assert simulator.wait_for_subscribers(("points", "odometry", "goal"), 30)
        cloud = os.urandom(480_000)
        simulator.publish("points", cloud)
        (answer,) = gather(answers, 1)
        assert answer.payload == b"points:" + cloud
        for number in range(50):
            simulator.publish("odometry", b"%d" % number)
        odometry = [m.payload for m in gather(answers, 50)]
        assert odometry == [b"odometry:%d" % number for number in range(50)]
        simulator.publish("goal", b"")
        assert process.wait(20) == 0
        assert simulator.lost == {}
    finally:
        process.kill()
        process.wait()


def test_a_client_that_knows_only_zenoh_is_heard_and_hears_through_the_simulator(
    boat, simulator, endpoint
):
    heard, inbox = [], Inbox()
    inbox.listen(boat, ("odometry",))
    config = zenoh_config(ZenohSettings(mode="client", connect=(endpoint,)))
    with zenoh.open(config) as session:
        listener = session.declare_subscriber("wamv1/thrusters/left/thrust", heard.append)
        assert boat.wait_for_subscribers(("thrust_left",), 20)
        publisher = session.declare_publisher("wamv1/sensors/position/ground_truth_odometry")
        while not publisher.matching_status.matching:
            time.sleep(0.01)
        publisher.put(b"from afar")
        boat.publish("thrust_left", b"ahead")
        assert [m.payload for m in gather(inbox, 1)] == [b"from afar"]
        deadline_s = time.monotonic() + 20
        while not heard and time.monotonic() < deadline_s:
            time.sleep(0.01)
        listener.undeclare()
    (sample,) = heard
    assert sample.payload.to_bytes() == b"ahead"
    assert sample.priority == zenoh.Priority.REAL_TIME
    assert sample.express is True
    assert len(sample.attachment.to_bytes()) == 33


def test_rmw_zenoh_keys_meet_each_other_and_no_others(endpoint):
    sender = ZenohBus(listening(endpoint, key_format="rmw_zenoh", domain=3), "wamv1")
    near = ZenohBus(ZenohSettings(connect=(endpoint,), key_format="rmw_zenoh", domain=3), "wamv1")
    far = ZenohBus(ZenohSettings(connect=(endpoint,), key_format="rmw_zenoh", domain=4), "wamv1")
    near_inbox, far_inbox = Inbox(), Inbox()
    near_inbox.listen(near, ("goal",))
    far_inbox.listen(far, ("goal",))
    try:
        assert sender.wait_for_subscribers(("goal",), 20)
        sender.publish("goal", b"here")
        assert [m.payload for m in gather(near_inbox, 1)] == [b"here"]
        assert far_inbox.wait(0.1) == []
    finally:
        for bus in (near, far, sender):
            bus.close()


def test_a_port_in_use_is_an_error_that_names_the_endpoint(simulator, endpoint):
    with pytest.raises(BusError, match=f"{endpoint}.*in use") as caught:
        ZenohBus(listening(endpoint), "wamv1")
    assert ".rs" not in str(caught.value)


def test_a_client_without_a_router_is_refused_but_a_peer_waits_for_it(endpoint):
    with pytest.raises(BusError, match=r"cannot be opened \(client, .*connecting to"):
        ZenohBus(ZenohSettings(mode="client", connect=(endpoint,)), "wamv1")
    early, inbox = ZenohBus(ZenohSettings(connect=(endpoint,)), "wamv1"), Inbox()
    inbox.listen(early, ("goal",))
    late = ZenohBus(listening(endpoint), "wamv1")
    try:
        assert late.wait_for_subscribers(("goal",), 20)
        late.publish("goal", b"at last")
        assert [m.payload for m in gather(inbox, 1)] == [b"at last"]
    finally:
        late.close()
        early.close()


def test_a_message_that_is_too_large_is_counted_and_thrown_away(simulator, endpoint):
    boat = ZenohBus(ZenohSettings(connect=(endpoint,), max_message_mb=0.001), "wamv1")
    inbox = Inbox()
    inbox.listen(boat, ("points",))
    try:
        assert simulator.wait_for_subscribers(("points",), 20)
        simulator.publish("points", bytes(1001))
        simulator.publish("points", bytes(1000))
        assert [len(m.payload) for m in gather(inbox, 1)] == [1000]
        assert boat.refused == 1
        assert boat.missing == {"points too large": 1}
    finally:
        boat.close()


def test_a_message_larger_than_any_of_its_topic_is_counted_and_thrown_away(simulator, endpoint):
    boat = ZenohBus(ZenohSettings(connect=(endpoint,)), "wamv1")
    inbox = Inbox()
    inbox.listen(boat, ("odometry", "route"))
    try:
        assert simulator.wait_for_subscribers(("odometry", "route"), 20)
        for topic in ("odometry", "route"):
            largest = TOPICS[topic].largest_b
            simulator.publish(topic, bytes(largest + 1))
            simulator.publish(topic, bytes(largest))
        assert {m.topic: len(m.payload) for m in gather(inbox, 2)} == {
            topic: TOPICS[topic].largest_b for topic in ("odometry", "route")
        }
        assert boat.missing == {"odometry too large": 1, "route too large": 1}
    finally:
        boat.close()


def test_a_message_far_too_large_is_not_even_put_together_and_the_line_goes_on(simulator, endpoint):
    boat = ZenohBus(
        ZenohSettings(connect=(endpoint,), max_message_mb=0.1, shared_memory=False), "wamv1"
    )
    inbox = Inbox()
    inbox.listen(boat, ("points",))
    try:
        assert simulator.wait_for_subscribers(("points",), 20)
        for size in (10, 5_000_000, 20):
            simulator.publish("points", bytes(size))
            if size != 5_000_000:
                assert [len(m.payload) for m in gather(inbox, 1)] == [size]
        assert boat.missing == {"points lost": 1}
    finally:
        boat.close()


ROUTER = textwrap.dedent(
    """
    import sys
    from twinscrew.runtime.bus.zenoh import ZenohBus
    from twinscrew.runtime.bus.zenoh import ZenohSettings

    bus = ZenohBus(ZenohSettings(mode="router", listen=(sys.argv[1],), connect=()), "router")
    sys.stdin.read()
    """
)


@contextmanager
def router(endpoint):
    """A router that is killed in the end, as hard as can be."""
    process = subprocess.Popen([sys.executable, "-c", ROUTER, endpoint], stdin=subprocess.PIPE)
    try:
        yield
    finally:
        process.kill()
        process.wait()
        process.stdin.close()


@pytest.mark.parametrize("boat", ["client", "peer"])
def test_those_who_meet_at_a_router_meet_again_when_it_was_killed_and_started_anew(endpoint, boat):
    ends, inbox = [], Inbox()
    modes = [boat, "client"]  # a router passes nothing on between peers
    try:
        for time in range(3):
            with router(endpoint):
                while len(ends) < 2:  # a client needs the router at once: it may still be starting
                    with suppress(BusError):
                        settings = ZenohSettings(mode=modes[len(ends)], connect=(endpoint,))
                        ends.append(ZenohBus(settings, "wamv1"))
                if time == 0:
                    inbox.listen(ends[0], ("goal",))
                word, heard = b"%d" % time, []
                while word not in heard:  # what is sent before they have met again is lost
                    ends[1].publish("goal", word)
                    heard += [m.payload for m in inbox.wait(0.1)]
    finally:
        for end in ends:
            end.close()


def test_nobody_listening_is_not_an_error_and_waiting_for_them_ends(simulator):
    simulator.publish("points", b"")
    assert simulator.wait_for_subscribers(("points",), 0.05) is False


def test_a_closed_bus_says_so(boat):
    boat.close()
    boat.close()
    with pytest.raises(BusError, match="closed"):
        boat.publish("thrust_left", b"")
    with pytest.raises(BusError, match="closed"):
        boat.subscribe("points", print)


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="needs Linux's /proc")
def test_by_default_no_port_is_opened():
    before = _listening_sockets()
    bus = ZenohBus(ZenohSettings(), "wamv1")
    try:
        time.sleep(0.3)
        assert _listening_sockets() == before
    finally:
        bus.close()


def test_by_comparison_listening_opens_one(endpoint):
    before = _listening_sockets()
    bus = ZenohBus(listening(endpoint), "wamv1")
    try:
        assert len(_listening_sockets() - before) == 1
    finally:
        bus.close()


def _listening_sockets():
    """Give the inodes of this process's sockets that listen (TCP) or are bound (UDP)."""
    own = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            own.add(str(link.readlink()).removeprefix("socket:[").removesuffix("]"))
    found = set()
    for table, state in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            columns = line.split()
            if columns[3] == state and columns[9] in own:
                found.add(columns[9])
    return found


def tokens_seen(endpoint, pattern):
    """What a stranger finds of tokens."""
    config = zenoh_config(ZenohSettings(mode="client", connect=(endpoint,)))
    with zenoh.open(config) as stranger:
        found = (reply.ok for reply in stranger.liveliness().get(pattern))
        return sorted(str(sample.key_expr) for sample in found if sample is not None)


@pytest.mark.parametrize(
    ("key_format", "pattern", "place"),
    [("rmw_zenoh", "@ros2_lv/7/**", 9), ("ros2dds", "@/*/@ros2_lv/**", 4)],
)
def test_ros_2_is_told_what_is_published_and_heard(endpoint, key_format, pattern, place):
    bus = ZenohBus(listening(endpoint, key_format=key_format, domain=7), "wamv1")
    try:
        Inbox().listen(bus, ("goal",))
        for _ in range(2):
            bus.publish("thrust_left", b"")
        parts = [token.split("/") for token in tokens_seen(endpoint, pattern)]
        ends = {
            (kind, name) for kind in ("MP", "MS") for p in parts if kind in p for name in [p[place]]
        }
        slash = "%" if key_format == "rmw_zenoh" else "§"
        lead = slash if key_format == "rmw_zenoh" else ""
        names = ("wamv1/goal", "wamv1/thrusters/left/thrust")
        heard, sent = (lead + name.replace("/", slash) for name in names)
        assert ends == {("MS", heard), ("MP", sent)}
        assert len([p for p in parts if "NN" in p]) == (key_format == "rmw_zenoh")
        numbers = [p[4] for p in parts]
        assert key_format == "ros2dds" or len(set(numbers)) == len(numbers)
    finally:
        bus.close()
    assert tokens_seen_by_a_new_router(endpoint, pattern) == []


def tokens_seen_by_a_new_router(endpoint, pattern):
    """Somebody else listens there now: what was told is gone with the session that told it."""
    bus = ZenohBus(listening(endpoint, node=""), "wamv1")
    try:
        bus.publish("thrust_left", b"")
        return tokens_seen(endpoint, pattern)
    finally:
        bus.close()
