"""The connection between sensors and boat, cut by hand."""

import socket
import threading
from collections.abc import Iterator

import pytest
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.faults.proxy import Proxy

HOST = "127.0.0.1"


@pytest.fixture
def echo() -> Iterator[int]:
    """A server that answers what it hears; its port."""
    listener = socket.create_server((HOST, 0))

    def answer(near: socket.socket) -> None:
        with near:
            while data := near.recv(1000):
                near.sendall(data)

    def accept() -> None:
        while True:
            try:
                near, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=answer, args=(near,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    yield listener.getsockname()[1]
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()


@pytest.fixture
def proxy(echo: int) -> Iterator[Proxy]:
    between = Proxy(echo)
    yield between
    between.close()


def asked(line: socket.socket, words: bytes) -> bytes:
    line.sendall(words)
    return line.recv(1000)


def test_what_comes_passes_both_ways(proxy: Proxy) -> None:
    with socket.create_connection((HOST, proxy.port)) as line:
        assert asked(line, b"hello") == b"hello"


def test_a_cut_closes_the_line_refuses_new_ones_and_ends(proxy: Proxy) -> None:
    line = socket.create_connection((HOST, proxy.port))
    assert asked(line, b"a") == b"a"
    proxy.cut(silently=False)
    assert line.recv(1000) == b""
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((HOST, proxy.port))
    proxy.mend()
    with socket.create_connection((HOST, proxy.port)) as again:
        assert asked(again, b"b") == b"b"
    line.close()


def test_a_silent_cut_holds_everything_back_and_tells_nobody(proxy: Proxy) -> None:
    with socket.create_connection((HOST, proxy.port)) as line:
        assert asked(line, b"a") == b"a"
        proxy.cut(silently=True)
        line.sendall(b"b")
        line.settimeout(0.2)
        with pytest.raises(TimeoutError):
            line.recv(1000)
        proxy.mend()
        line.settimeout(None)
        assert wait_until(lambda: line.recv(1000)) == b"b"
