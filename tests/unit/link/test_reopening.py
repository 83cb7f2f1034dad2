"""Connections that break and come back: real TCP servers and serial lines (pseudo-terminals)."""

import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.harness.cut_line import SerialAdapter
from tests.harness.waiting import wait_until

from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.transport import (
    ReopeningTransport,
    Transport,
    open_transport,
    reopening,
)

LOOPBACK = "127.0.0.1"


def kept_open(connection: str) -> ReopeningTransport:
    return reopening(connection, open_transport(connection))


def breaks(look: Callable[[], object]) -> str:
    """The words with which it says that the connection broke."""
    words: list[str] = []

    def fails() -> bool:
        try:
            look()
        except LinkError as error:
            words.append(str(error))
        return bool(words)

    wait_until(fails)
    return words[0]


@contextmanager
def server(port: int = 0) -> Iterator[socket.socket]:
    with socket.create_server((LOOPBACK, port)) as listening:
        listening.settimeout(60)
        yield listening


def hears(transport: Transport, wanted: bytes) -> None:
    heard = bytearray()

    def look() -> bool:
        heard.extend(transport.receive())
        return wanted in heard

    wait_until(look)


def test_a_tcp_server_that_goes_and_comes_back_is_found_again() -> None:
    with server() as first:
        port = first.getsockname()[1]
        line = kept_open(f"tcp:{LOOPBACK}:{port}")
        other, _ = first.accept()
        other.sendall(b"before")
        hears(line, b"before")
        other.close()
    assert "closed" in breaks(line.receive)
    assert not line.is_open
    for _ in range(3):  # once is enough: from then on it is quiet
        assert line.receive() == b""
        line.send(b"into the void")
    with server(port) as second:
        other, _ = second.accept()
        wait_until(lambda: line.is_open)
        other.sendall(b"after")
        hears(line, b"after")
        line.send(b"answer")
        assert other.recv(100) == b"answer"
        assert line.reopened == 1
        line.close()
        assert other.recv(100) == b""
        other.close()


def test_it_comes_back_as_often_as_it_breaks() -> None:
    with server() as listening:
        line = kept_open(f"tcp:{LOOPBACK}:{listening.getsockname()[1]}")
        for time in range(5):
            other, _ = listening.accept()
            wait_until(lambda: line.is_open)
            other.sendall(b"%d" % time)
            hears(line, b"%d" % time)
            other.close()
            breaks(line.receive)
        wait_until(lambda: line.is_open)
        assert line.reopened == 5
        line.close()


def test_a_break_is_noticed_by_sending_too() -> None:
    with server() as listening:
        line = kept_open(f"tcp:{LOOPBACK}:{listening.getsockname()[1]}")
        other, _ = listening.accept()
        other.close()
        assert breaks(lambda: line.send(b"x")).startswith("tcp:")
        line.close()


def test_a_tcp_peer_that_falls_silent_without_a_word_is_called_again() -> None:
    """A hung server keeps its connection open; only its heartbeats are missing."""
    now_s = [0.0]
    with server() as listening:
        connection = f"tcp:{LOOPBACK}:{listening.getsockname()[1]}"
        line = ReopeningTransport(
            open_transport(connection),
            lambda: open_transport(connection),
            silent_s=5.0,
            clock=lambda: now_s[0],
        )
        other, _ = listening.accept()
        now_s[0] = 100.0
        assert line.receive() == b""  # it was never heard: it may still be starting
        other.sendall(b"beat")
        hears(line, b"beat")
        now_s[0] = 104.9
        assert line.receive() == b""
        now_s[0] = 105.1
        with pytest.raises(LinkError, match="nothing came for 5 s"):
            line.receive()
        again, _ = listening.accept()
        again.sendall(b"awake")
        hears(line, b"awake")
        line.close()
        for peer in (other, again):
            peer.close()


def test_tcp_breaks_when_nobody_acknowledges_for_some_seconds() -> None:
    with server() as listening:
        line = open_transport(f"tcp:{LOOPBACK}:{listening.getsockname()[1]}")
        with socket.socket(fileno=os.dup(line.fileno())) as same:
            limit_ms = same.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
        assert 1000 <= limit_ms <= 5000
        line.close()


def test_a_serial_line_that_is_pulled_and_put_back_is_opened_again(tmp_path: Path) -> None:
    adapter = SerialAdapter(tmp_path)
    line = kept_open(adapter.connection)
    os.write(adapter.master, b"before")
    hears(line, b"before")
    adapter.cut()
    assert "ttyACM0" in breaks(line.receive)
    assert line.receive() == b""
    assert line.fileno() == -1
    adapter.mend()
    wait_until(lambda: line.is_open)
    os.write(adapter.master, b"after")
    hears(line, b"after")
    line.send(b"answer")
    assert os.read(adapter.master, 100) == b"answer"
    line.close()
    adapter.cut()


class Broken(Transport):
    def fileno(self) -> int:
        return -1

    def receive(self) -> bytes:
        raise LinkError("gone")

    def send(self, data: bytes) -> None:
        raise LinkError("gone")

    def close(self) -> None:
        raise OSError("it was gone already")


def test_the_waits_between_tries_grow_to_a_limit_and_closing_ends_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waits: list[float] = []

    class Closing(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            waits.append(timeout or 0.0)
            return len(waits) > 8 or super().wait(0)

    def nobody() -> Transport:
        raise LinkError("nobody there")

    line = ReopeningTransport(Broken(), nobody)
    monkeypatch.setattr(line, "_closing", Closing())
    with pytest.raises(LinkError, match="gone"):
        line.receive()
    wait_until(lambda: len(waits) > 8)
    assert waits[:7] == [0.1, 0.2, 0.4, 0.8, 1.6, 2.0, 2.0]
    line.close()


def test_closing_while_nobody_is_there_does_not_wait_for_him() -> None:
    with server() as listening:
        port = listening.getsockname()[1]
        line = kept_open(f"tcp:{LOOPBACK}:{port}")
        listening.accept()[0].close()
    breaks(line.receive)
    line.close()
    assert not line.is_open
    assert not [t for t in threading.enumerate() if t.name == "reopen"]
