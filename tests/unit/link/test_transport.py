import os
import pty
import select
import socket
import threading
from contextlib import ExitStack

import pytest
from tests.harness.work import calls_of

from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.ardupilot.commands import heartbeat
from twinscrew.runtime.link.transport import (
    ENOUGH,
    PEER_SILENT_S,
    UdpTransport,
    await_transport,
    open_transport,
)
from twinscrew.runtime.mavlink import Signing, Wire

LOOPBACK = "127.0.0.1"


def wait_for(transport):
    ready, _, _ = select.select([transport], [], [], 5.0)
    assert ready, "nothing came within 5 s"
    return transport.receive()


def caller(listener):
    return open_transport(f"udpout:{LOOPBACK}:{listener.port}")


def test_udp_carries_both_ways_and_never_waits():
    with UdpTransport(LOOPBACK, 0, listens=True) as listener, caller(listener) as other:
        assert listener.receive() == b""
        listener.send(b"to nobody yet")
        other.send(b"ahoy")
        assert wait_for(listener) == b"ahoy"
        listener.send(b"aye")
        assert wait_for(other) == b"aye"


def test_a_listener_keeps_to_its_peer_until_he_is_silent():
    now_s = [0.0]
    with (
        UdpTransport(LOOPBACK, 0, listens=True, clock=lambda: now_s[0]) as listener,
        caller(listener) as peer,
        caller(listener) as stranger,
    ):
        peer.send(b"peer")
        assert wait_for(listener) == b"peer"
        stranger.send(b"stranger")
        peer.send(b"peer")
        heard = b""
        while b"peer" not in heard:
            heard += wait_for(listener)
        assert heard == b"peer"
        now_s[0] += PEER_SILENT_S + 0.1
        stranger.send(b"heir")
        assert wait_for(listener) == b"heir"


def test_one_call_reads_no_more_of_a_flood_than_it_can_work_on_and_the_rest_comes_later():
    with UdpTransport(LOOPBACK, 0, listens=True) as listener, caller(listener) as peer:
        datagram = bytes(8000)
        for _ in range(8):
            peer.send(datagram)
        first = wait_for(listener)
        assert len(first) < ENOUGH + len(datagram)
        heard = len(first)
        while heard < 8 * len(datagram):
            heard += len(wait_for(listener))


def test_tcp_reads_no_more_of_a_flood_in_one_call_than_it_can_work_on():
    with (
        socket.create_server((LOOPBACK, 0)) as server,
        open_transport(f"tcp:{LOOPBACK}:{server.getsockname()[1]}") as transport,
    ):
        other, _ = server.accept()
        with other:
            sent = bytes(10 * ENOUGH)
            writer = threading.Thread(target=other.sendall, args=(sent,))
            writer.start()
            heard = 0
            while heard < len(sent):
                data = wait_for(transport)
                assert len(data) < 2 * ENOUGH
                heard += len(data)
            writer.join()


AUTOPILOT = (1, 1)
RUBBISH = (
    b"12345",
    b"\xfd" * 300,
    Wire(7, 1).encode(heartbeat()),
    Wire(1, 190).encode(heartbeat()),
    Wire(*AUTOPILOT).encode(heartbeat())[:-1],
)
"""What is not the autopilot's: noise, another vehicle, its companion, a frame that was cut."""


class Harbour:
    """A link's listener, its autopilot and a stranger, with a clock that the test turns."""

    def __init__(self, stack, key=None):
        self.now_s = 0.0
        self.signing = None if key is None else Signing(key)
        self.link = Wire(1, 191, self.signing)
        self.listener = stack.enter_context(
            UdpTransport(
                LOOPBACK,
                0,
                listens=True,
                recognises=self.link.recognises,
                clock=lambda: self.now_s,
            )
        )
        self.autopilot, self.stranger = (stack.enter_context(caller(self.listener)) for _ in "ab")

    def hears(self, sender, datagram):
        """Let somebody send; give what the listener reads."""
        sender.send(datagram)
        return wait_for(self.listener)

    def answers(self, sender):
        """Tell whether what we send goes to somebody."""
        self.listener.send(b"ahoy")
        ready, _, _ = select.select([sender], [], [], 0.2)
        return bool(ready) and b"ahoy" in sender.receive()


@pytest.fixture
def stack():
    with ExitStack() as stack:
        yield stack


@pytest.mark.parametrize("key", [None, bytes(32)], ids=["unsigned", "signed"])
def test_whoever_is_not_the_autopilot_never_becomes_the_peer(stack, key):
    harbour = Harbour(stack, key)
    autopilot = Wire(*AUTOPILOT, None if key is None else Signing(key))
    forgeries = (Wire(*AUTOPILOT, Signing(b"another" * 4 + b"keys")), Wire(*AUTOPILOT))
    signed = () if key is None else tuple(wire.encode(heartbeat()) for wire in forgeries)
    for datagram in (*RUBBISH, *signed):
        harbour.now_s += 0.2
        assert harbour.hears(harbour.stranger, datagram) == datagram  # so that it can be counted
        assert not harbour.answers(harbour.stranger)
    frame = autopilot.encode(heartbeat())
    assert harbour.hears(harbour.autopilot, b"\x00" * 5 + frame)[5:] == frame
    assert harbour.answers(harbour.autopilot)


def test_rubbish_from_its_own_address_does_not_keep_the_place_of_an_autopilot_that_moved(stack):
    harbour = Harbour(stack)
    frame = Wire(*AUTOPILOT).encode(heartbeat())
    harbour.hears(harbour.stranger, frame)  # its address until now
    for _ in range(20):
        harbour.now_s += 0.2
        harbour.hears(harbour.stranger, b"12345")
    assert harbour.hears(harbour.autopilot, frame) == frame
    assert harbour.answers(harbour.autopilot)
    assert not harbour.answers(harbour.stranger)


def test_what_the_autopilot_once_signed_gives_no_stranger_its_place(stack):
    harbour = Harbour(stack, bytes(32))
    old = Wire(*AUTOPILOT, Signing(bytes(32))).encode(heartbeat())
    assert len(harbour.link.decode(harbour.hears(harbour.autopilot, old))) == 1
    harbour.now_s += PEER_SILENT_S + 0.1
    assert harbour.link.decode(harbour.hears(harbour.stranger, old)) == []
    assert not harbour.answers(harbour.stranger)
    assert harbour.answers(harbour.autopilot)


def test_to_recognise_a_datagram_takes_little_work_and_changes_nothing():
    link = Wire(1, 191, Signing(bytes(32)))
    for datagram in (b"\xfd" * 65_507, b"\xfd\x00\x01" * 21_000, bytes(65_507)):
        assert calls_of(lambda datagram=datagram: link.recognises(datagram)) < 1000
    frame = Wire(*AUTOPILOT, Signing(bytes(32))).encode(heartbeat())
    assert [link.recognises(frame) for _ in range(2)] == [True, True]
    assert len(link.decode(frame)) == 1
    assert link.bad_frames == 0
    assert not link.recognises(frame)


def test_calling_where_nobody_listens_yet_is_no_error():
    with UdpTransport(LOOPBACK, 0, listens=True) as free:
        port = free.port
    with open_transport(f"udpout:{LOOPBACK}:{port}") as transport:
        for _ in range(3):
            transport.send(b"anybody?")
            assert transport.receive() == b""


def test_a_port_in_use_is_named():
    with (
        UdpTransport(LOOPBACK, 0, listens=True) as first,
        pytest.raises(LinkError, match=rf"udpin:{LOOPBACK}:{first.port}: Address already in use"),
    ):
        open_transport(f"udpin:{LOOPBACK}:{first.port}")


def test_tcp_carries_both_ways_and_says_when_the_other_side_is_gone():
    with socket.create_server((LOOPBACK, 0)) as server:
        port = server.getsockname()[1]
        with open_transport(f"tcp:{LOOPBACK}:{port}") as transport:
            other, _ = server.accept()
            transport.send(b"ahoy")
            assert other.recv(100) == b"ahoy"
            assert transport.receive() == b""
            other.sendall(b"aye")
            assert wait_for(transport) == b"aye"
            other.close()
            with pytest.raises(LinkError, match="closed"):
                wait_for(transport)


def test_tcp_with_nobody_there_is_refused_by_name():
    with socket.create_server((LOOPBACK, 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(LinkError, match=rf"tcp:{LOOPBACK}:{port}: Connection refused"):
        open_transport(f"tcp:{LOOPBACK}:{port}")


def test_a_serial_line_carries_every_byte_unchanged():
    master, slave = pty.openpty()
    try:
        with open_transport(f"serial:{os.ttyname(slave)}:57600") as line:
            every_byte = bytes(range(256))
            os.write(master, every_byte)
            heard = b""
            while len(heard) < 256:
                heard += wait_for(line)
            assert heard == every_byte
            assert line.receive() == b""
            line.send(every_byte)
            sent = b""
            while len(sent) < 256:
                sent += os.read(master, 256)
            assert sent == every_byte
    finally:
        os.close(master)
        os.close(slave)


@pytest.mark.parametrize(
    ("connection", "words"),
    [
        ("serial:/dev/no_such_line:57600", "No such file"),
        ("/dev/no_such_line", "No such file"),
        ("serial:/dev/null:57600", "not a serial device"),
        ("serial:/dev/null:12345", "12345 is not one of"),
        ("udpin:127.0.0.1", "udpin:HOST:PORT"),
        ("udpin:127.0.0.1:", "not a number"),
        ("udpin:127.0.0.1:port", "not a number"),
        ("udpin:127.0.0.1:70000", "70000"),
        ("carrier-pigeon:1:2", "udpin:HOST:PORT"),
        ("", "udpin:HOST:PORT"),
        (f"tcp:{'x' * 70}.org:1", "tcp:xxx"),
    ],
)
def test_what_cannot_be_opened_is_refused_in_plain_words(connection, words):
    with pytest.raises(LinkError, match=words):
        open_transport(connection)


def test_a_server_that_comes_late_is_waited_for():
    with socket.create_server((LOOPBACK, 0)) as server:
        port = server.getsockname()[1]
    asked = []

    def come_at_the_third_look():
        asked.append(len(asked))
        if len(asked) == 3:
            servers.append(socket.create_server((LOOPBACK, port)))
        return False

    servers = []
    try:
        await_transport(f"tcp:{LOOPBACK}:{port}", 60.0, come_at_the_third_look).close()
    finally:
        for server in servers:
            server.close()
    assert len(asked) == 3


def test_waiting_ends_when_it_is_told_to_and_when_the_time_is_over():
    with socket.create_server((LOOPBACK, 0)) as server:
        port = server.getsockname()[1]
    for wait_s, stop in ((60.0, lambda: True), (0.0, lambda: False)):
        with pytest.raises(LinkError, match="Connection refused"):
            await_transport(f"tcp:{LOOPBACK}:{port}", wait_s, stop)


def test_a_string_that_is_not_understood_is_not_waited_for():
    def never():
        raise AssertionError("it must not wait")

    with pytest.raises(LinkError, match="is not one of"):
        await_transport("pigeon:LOFT:7", 60.0, never)
