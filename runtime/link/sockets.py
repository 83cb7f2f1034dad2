"""UDP and TCP without waiting."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Callable
from typing import Any

from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.carrier import Recognises, Transport, anybody

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
"""[s] A listener keeps to its peer until that was not recognised for so long: no stranger takes its
place."""
_KNOWN_FOR_S = 0.5
"""[s] A peer is recognised anew this often: to look at every datagram would cost twice the time."""


class UdpTransport(Transport):
    """UDP; one that listens keeps to the first whom it recognises, until he is silent.

    Parameters
    ----------
    host, port
        Where to listen (port 0: any free one), or whom to call.
    listens
        Whether to listen; otherwise we call.
    recognises
        Tells by a datagram whether its sender may become the peer, and stay it.
    clock
        [s] Monotonic time.
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        listens: bool,
        recognises: Recognises = anybody,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        family, address = _resolve(host, port, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._peer: Any = None if listens else address
        self._peer_known_s = -math.inf
        self._recognises = recognises
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
            if self._is_peer(sender, data):
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

    def _is_peer(self, sender: Any, data: bytes) -> bool:
        """Tell whether a datagram is to be read; where there is no peer, see whether this is he.

        Without a peer all is read, so that it can be said what is wrong with it; nobody
        new is answered.
        """
        if not self._listens:
            return True
        silent_s = self._clock() - self._peer_known_s
        if sender == self._peer and silent_s < _KNOWN_FOR_S:
            return True
        read = bool(sender == self._peer or silent_s > PEER_SILENT_S)
        if read and self._recognises(data):
            self._peer, self._peer_known_s = sender, self._clock()
        return read


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
