"""UDP and TCP without waiting."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Callable
from typing import Any

from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.carrier import Transport

_READ = 65_536
"""[bytes] The most that one read takes: more than any datagram."""
_MOST_READS = 64
"""[-] Reads a call: a flood must not keep the loop from its work."""
ENOUGH = 32_768
"""[bytes] After which a call reads no more; the rest waits in the system, or is lost there. A link
of 921 600 baud brings 5 kB between two ticks."""
CONNECT_S = 3.0
"""[s] How long a TCP connection may take to open."""
UNANSWERED_S = 3.0
"""[s] What was sent and is not acknowledged for so long breaks a TCP connection: the peer lost its
power, or the cable was cut. Otherwise the system would try for a quarter of an hour."""
PEER_SILENT_S = 3.0
"""[s] A listener keeps to its peer until that is silent this long: no stranger takes its place."""


class UdpTransport(Transport):
    """UDP; one that listens keeps to the first who speaks, until he is silent.

    Parameters
    ----------
    host, port
        Where to listen (port 0: any free one), or whom to call.
    listens
        Whether to listen; otherwise we call.
    clock
        [s] Monotonic time.
    """

    def __init__(
        self, host: str, port: int, *, listens: bool, clock: Callable[[], float] = time.monotonic
    ) -> None:
        family, address = _resolve(host, port, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._peer: Any = None if listens else address
        self._peer_heard_s = -math.inf
        self._listens = listens
        self._clock = clock
        try:
            if listens:
                self._socket.bind(address)
            else:
                self._socket.connect(address)  # the system now drops what others send
        except OSError:
            self._socket.close()
            raise

    @property
    def port(self) -> int:
        """The port we listen on, or send from."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """Give the descriptor to poll."""
        return self._socket.fileno()

    def receive(self) -> bytes:
        """Give what has come; never waits."""
        taken = bytearray()
        for _ in range(_MOST_READS):
            try:
                data, sender = self._socket.recvfrom(_READ)
            except OSError:
                break  # nothing more; or our last datagram found nobody: the heartbeat will tell
            if self._is_peer(sender):
                taken += data
            if len(taken) >= ENOUGH:
                break
        return bytes(taken)

    def send(self, data: bytes) -> None:
        """Send what the system can take now."""
        if data and self._peer is not None:
            with contextlib.suppress(OSError):  # no route, full buffer: as lost as on a radio
                if self._listens:
                    self._socket.sendto(data, self._peer)
                else:
                    self._socket.send(data)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _is_peer(self, sender: Any) -> bool:
        if not self._listens:
            return True
        now_s = self._clock()
        if now_s - self._peer_heard_s > PEER_SILENT_S:
            self._peer = sender
        if sender != self._peer:
            return False
        self._peer_heard_s = now_s
        return True


class TcpTransport(Transport):
    """TCP, as ArduPilot's simulator offers it on port 5760."""

    def __init__(self, host: str, port: int) -> None:
        self._name = f"tcp:{host}:{port}"
        self._socket = socket.create_connection((host, port), timeout=CONNECT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        unanswered_ms = round(UNANSWERED_S * 1e3)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unanswered_ms)
        self._socket.setblocking(False)

    def fileno(self) -> int:
        """Give the descriptor to poll."""
        return self._socket.fileno()

    def receive(self) -> bytes:
        """Give what has come; never waits."""
        taken = bytearray()
        while len(taken) < ENOUGH:
            try:
                data = self._socket.recv(ENOUGH)
            except BlockingIOError:
                break
            except OSError as error:
                raise LinkError(f"{self._name}: {error.strerror or error}") from error
            if not data:
                if taken:
                    break
                raise LinkError(f"{self._name}: the other side closed the connection")
            taken += data
        return bytes(taken)

    def send(self, data: bytes) -> None:
        """Send what the system can take now."""
        try:
            self._socket.send(data)
        except BlockingIOError:
            return
        except OSError as error:
            raise LinkError(f"{self._name}: {error.strerror or error}") from error

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _resolve(host: str, port: int, kind: socket.SocketKind) -> tuple[socket.AddressFamily, Any]:
    found = socket.getaddrinfo(host, port, type=kind)[0]
    return found[0], found[4]
