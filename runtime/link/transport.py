"""Carry MAVLink bytes over UDP, TCP or a serial line, and open a broken connection again."""

from __future__ import annotations

import contextlib
import math
import os
import socket
import termios
import threading
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Self, TypeAlias

from twinscrew.runtime.errors import LinkError, one_of

# -- What every way of carrying MAVLink bytes offers.


Recognises: TypeAlias = Callable[[bytes], bool]
"""Tells whether a datagram is from whom we want to talk to; it changes nothing."""


def anybody(datagram: bytes) -> bool:  # noqa: ARG001
    """Recognise whoever speaks: for simulators on one machine."""
    return True


class Transport(ABC):
    """An open connection; as a context manager it closes itself."""

    @property
    def is_open(self) -> bool:
        """Whether there is a connection now; False while a broken one is being opened again."""
        return True

    @abstractmethod
    def fileno(self) -> int:
        """Give the descriptor to select or poll for reading."""

    @abstractmethod
    def receive(self) -> bytes:
        """Give what has come, empty if nothing has; never waits.

        Raises
        ------
        LinkError
            The other side closed the connection, or the device is gone.
        """

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send bytes; what the system cannot take now is dropped, as a radio would.

        Raises
        ------
        LinkError
            The other side closed the connection, or the device is gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the connection."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class NoTransport(Transport):
    """No connection: of an autopilot that is commanded by topics, or of nobody."""

    def fileno(self) -> int:
        """Give no descriptor."""
        return -1

    def receive(self) -> bytes:
        """Give nothing."""
        return b""

    def send(self, data: bytes) -> None:
        """Send nothing."""

    def close(self) -> None:
        """Do nothing."""


# -- A serial line, by the standard library alone: raw, eight bits, no flow control.

_READ = 4096
"""[bytes] The most that one read takes."""
_SPEEDS = {
    int(name[1:]): value
    for name, value in vars(termios).items()
    if name.startswith("B") and name[1:].isdecimal() and name != "B0"
}


class SerialTransport(Transport):
    """A serial device, as the telemetry port of a flight controller."""

    def __init__(self, device: str, baud: int) -> None:
        if baud not in _SPEEDS:
            raise LinkError(f"{device}: baud {one_of(baud, sorted(_SPEEDS))}")
        self._name = device
        self._file = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            self._configure(_SPEEDS[baud])
        except termios.error as error:
            os.close(self._file)
            raise LinkError(f"{device}: not a serial device ({error.args[-1]})") from error

    def fileno(self) -> int:
        """Give the descriptor to poll."""
        return self._file

    def receive(self) -> bytes:
        """Give what has come; never waits."""
        try:
            data = os.read(self._file, _READ)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"{self._name}: {error.strerror or error}") from error
        if not data:  # a line at rest would block: this one was hung up
            raise LinkError(f"{self._name}: the device is gone")
        return data

    def send(self, data: bytes) -> None:
        """Send what the line can take now."""
        try:
            os.write(self._file, data)
        except BlockingIOError:
            return
        except OSError as error:
            raise LinkError(f"{self._name}: {error.strerror or error}") from error

    def close(self) -> None:
        """Close the device."""
        os.close(self._file)

    def _configure(self, speed: int) -> None:
        tty.setraw(self._file, termios.TCSANOW)
        settings = termios.tcgetattr(self._file)
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[2] &= ~termios.CRTSCTS
        settings[4] = settings[5] = speed
        termios.tcsetattr(self._file, termios.TCSANOW, settings)


# -- UDP and TCP without waiting.

_DATAGRAM = 65_536
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
                data, sender = self._socket.recvfrom(_DATAGRAM)
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


# -- Carries MAVLink bytes: UDP, TCP, serial. Never waits; `fileno` lets a loop wait for all at
# once.
#
# Connection strings are pymavlink's: `udpin:HOST:PORT` listens, `udpout:HOST:PORT` calls,
# `tcp:HOST:PORT` connects, `serial:DEVICE:BAUD` (or `/dev/...`) opens a line. On UDP a message is
# never split: what one `send` is given goes out as one datagram.

__all__ = ["TcpTransport", "Transport", "UdpTransport", "await_transport", "open_transport"]

DEFAULT_BAUD = 921_600
"""[baud] What ArduPilot's documentation advises for companion computers."""
RETRY_S = 0.2
"""[s] Between two tries to open a connection."""
_LAST_PORT = 65_535
KINDS = ("udpin:HOST:PORT", "udpout:HOST:PORT", "tcp:HOST:PORT", "serial:DEVICE:BAUD")


def open_transport(connection: str, recognises: Recognises = anybody) -> Transport:
    """Open a connection from its string.

    Parameters
    ----------
    connection
        See this module's words.
    recognises
        Tells by a datagram who may become the peer of `udpin`.

    Raises
    ------
    LinkError
        The string is not understood, the port is in use, nobody listens, or there is no such
        device.
    """
    kind, _, rest = connection.partition(":")
    if connection.startswith("/dev/"):
        kind, rest = "serial", connection
    try:
        if kind in ("udpin", "udp", "udpout"):
            listens = kind != "udpout"
            host, port = _host_port(connection, rest)
            return UdpTransport(host, port, listens=listens, recognises=recognises)
        if kind == "tcp":
            return TcpTransport(*_host_port(connection, rest))
        if kind == "serial":
            device, _, baud = rest.partition(":")
            return SerialTransport(device, _number(connection, baud or str(DEFAULT_BAUD)))
    except (OSError, UnicodeError) as error:
        raise LinkError(f"{connection}: {getattr(error, 'strerror', None) or error}") from error
    raise LinkError(f"connection {one_of(connection, KINDS)}")


def await_transport(
    connection: str,
    wait_s: float,
    stop: Callable[[], bool] = lambda: False,
    recognises: Recognises = anybody,
) -> Transport:
    """Open a connection, and try again for a while if nobody is there yet.

    Parameters
    ----------
    connection, recognises
        As `open_transport` takes them.
    wait_s
        [s] How long to try.
    stop
        Says that nobody wants it any more.

    Raises
    ------
    LinkError
        As `open_transport`; at once if the string is not understood, when the time is over or
        `stop` says so if nobody is there.
    """
    until_s = time.monotonic() + wait_s
    while True:
        try:
            return open_transport(connection, recognises)
        except LinkError as error:
            hopeless = not isinstance(error.__cause__, OSError)
            if hopeless or time.monotonic() >= until_s or stop():
                raise
        time.sleep(RETRY_S)


def _host_port(connection: str, rest: str) -> tuple[str, int]:
    host, _, port = rest.rpartition(":")
    if not host:
        raise LinkError(f"connection {one_of(connection, KINDS)}")
    return host, _number(connection, port, _LAST_PORT)


def _number(connection: str, text: str, greatest: int = 2**31) -> int:
    if not text.isdecimal() or not text.isascii() or int(text) > greatest:
        raise LinkError(f"connection {connection!r}: {text!r} is not a number up to {greatest}")
    return int(text)


# -- A connection that is opened again after it broke, by a thread: the loop never waits for it.
#
# A TCP server that restarts, a serial adapter that was pulled and put back: both come back by
# themselves, in a moment or in an hour. Meanwhile nothing comes and nothing is sent, which the link
# takes for what it is (`autopilot_silent`), and the boat stands still.

FIRST_S = 0.1
"""[s] From the break to the first try."""
LONGEST_S = 2.0
"""[s] The most between two tries; each wait is twice the one before."""
TCP_SILENT_S = 5.0
"""[s] A TCP peer that was heard and is silent so long is gone, though nobody closed the connection:
five of MAVLink's heartbeats."""


def reopening(
    connection: str, transport: Transport, recognises: Recognises = anybody
) -> ReopeningTransport:
    """Keep a connection that `open_transport` opened open.

    Parameters
    ----------
    connection
        The string that it was opened from.
    transport
        What came of it.
    recognises
        As `open_transport` takes it.
    """
    silent_s = TCP_SILENT_S if connection.startswith("tcp:") else math.inf

    def reopen() -> Transport:
        return open_transport(connection, recognises)

    return ReopeningTransport(transport, reopen, silent_s=silent_s)


class ReopeningTransport(Transport):
    """A transport that raises once when it breaks, is quiet while it is broken, and comes back.

    Parameters
    ----------
    transport
        The open connection.
    reopen
        Opens it anew; raises `LinkError` while that cannot be done. Called in another thread.
    silent_s
        [s] A peer that was heard and is silent for so long is taken for gone.
    clock
        [s] Monotonic time.
    """

    def __init__(
        self,
        transport: Transport,
        reopen: Callable[[], Transport],
        *,
        silent_s: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.reopened = 0
        """[-] How often it has come back."""
        self._transport: Transport | None = transport
        self._reopen = reopen
        self._silent_s = silent_s
        self._clock = clock
        self._heard_s = math.inf
        self._closing = threading.Event()
        self._mender: threading.Thread | None = None

    @property
    def is_open(self) -> bool:
        """Whether there is a connection now."""
        return self._transport is not None

    def fileno(self) -> int:
        """Give the descriptor to poll; -1 while there is none."""
        transport = self._transport
        return -1 if transport is None else transport.fileno()

    def receive(self) -> bytes:
        """Give what has come; see `Transport.receive`. Raises at the break, not after it."""
        transport = self._transport
        if transport is None:
            return b""
        try:
            data = transport.receive()
            self._listen(data)
        except LinkError:
            self._mend(transport)
            raise
        return data

    def send(self, data: bytes) -> None:
        """Send bytes; see `Transport.send`. Raises at the break, not after it."""
        transport = self._transport
        if transport is None:
            return
        try:
            transport.send(data)
        except LinkError:
            self._mend(transport)
            raise

    def close(self) -> None:
        """Close the connection, and try no more."""
        self._closing.set()
        if self._mender is not None:
            self._mender.join()
        if self._transport is not None:
            self._transport.close()

    def _listen(self, data: bytes) -> None:
        now_s = self._clock()
        if data:
            self._heard_s = now_s
        elif now_s - self._heard_s > self._silent_s:
            raise LinkError(f"nothing came for {self._silent_s:g} s")

    def _mend(self, broken: Transport) -> None:
        self._transport, self._heard_s = None, math.inf
        self._mender = threading.Thread(
            target=self._work, args=(broken,), name="reopen", daemon=True
        )
        self._mender.start()

    def _work(self, broken: Transport) -> None:
        with suppress(OSError):
            broken.close()  # here, because a serial line may wait for what it has not sent
        wait_s = FIRST_S
        while not self._closing.wait(wait_s):
            wait_s = min(2.0 * wait_s, LONGEST_S)
            with suppress(LinkError):
                opened = self._reopen()
                self.reopened += 1
                self._transport = opened
                return
