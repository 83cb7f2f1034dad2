"""Carries MAVLink bytes: UDP, TCP, serial. Never waits; `fileno` lets a loop wait for all at once.

Connection strings are pymavlink's: `udpin:HOST:PORT` listens, `udpout:HOST:PORT` calls,
`tcp:HOST:PORT` connects, `serial:DEVICE:BAUD` (or `/dev/...`) opens a line. On UDP a message is
never split: what one `send` is given goes out as one datagram.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from twinscrew.runtime.errors import LinkError, one_of
from twinscrew.runtime.link.carrier import Recognises, Transport, anybody
from twinscrew.runtime.link.serial_line import SerialTransport
from twinscrew.runtime.link.sockets import TcpTransport, UdpTransport

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
