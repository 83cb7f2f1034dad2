"""Carries MAVLink bytes: UDP, TCP, serial. Never waits; `fileno` lets a loop wait for all at once.

Connection strings are pymavlink's: `udpin:HOST:PORT` listens, `udpout:HOST:PORT` calls,
`tcp:HOST:PORT` connects, `serial:DEVICE:BAUD` (or `/dev/...`) opens a line. On UDP a message is
never split: what one `send` is given goes out as one datagram.
"""

from __future__ import annotations

from typing import Protocol

from twinscrew.runtime.errors import LinkError, one_of
from twinscrew.runtime.link.serial_line import SerialTransport
from twinscrew.runtime.link.sockets import TcpTransport, UdpTransport

DEFAULT_BAUD = 921_600
"""[baud] What ArduPilot's documentation advises for companion computers."""
KINDS = ("udpin:HOST:PORT", "udpout:HOST:PORT", "tcp:HOST:PORT", "serial:DEVICE:BAUD")


class Transport(Protocol):
    """An open connection."""

    def fileno(self) -> int:
        """Give the descriptor to select or poll for reading."""

    def receive(self) -> bytes:
        """Give what has come, empty if nothing has; never waits.

        Raises
        ------
        LinkError
            The other side closed the connection, or the device is gone.
        """

    def send(self, data: bytes) -> None:
        """Send bytes; what the system cannot take now is dropped, as a radio would.

        Raises
        ------
        LinkError
            The other side closed the connection, or the device is gone.
        """

    def close(self) -> None:
        """Close the connection."""


def open_transport(connection: str) -> Transport:
    """Open a connection from its string.

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
            return UdpTransport(*_host_port(connection, rest), listens=kind != "udpout")
        if kind == "tcp":
            return TcpTransport(*_host_port(connection, rest))
        if kind == "serial":
            device, _, baud = rest.partition(":")
            return SerialTransport(device, _number(connection, baud or str(DEFAULT_BAUD)))
    except OSError as error:
        raise LinkError(f"{connection}: {error.strerror or error}") from error
    raise LinkError(f"connection {one_of(connection, KINDS)}")


def _host_port(connection: str, rest: str) -> tuple[str, int]:
    host, _, port = rest.rpartition(":")
    if not host:
        raise LinkError(f"connection {one_of(connection, KINDS)}")
    return host, _number(connection, port)


def _number(connection: str, text: str) -> int:
    if not text.isdecimal() or not text.isascii() or not 0 <= int(text) < 2**31:
        raise LinkError(f"connection {connection!r}: {text!r} is not a number")
    return int(text)
