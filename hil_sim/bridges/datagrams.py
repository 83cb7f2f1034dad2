"""A UDP port whose datagrams come one by one, each with its sender. Never waits."""

from __future__ import annotations

import contextlib
import socket
from typing import Any

from twinscrew.runtime.errors import LinkError

_READ = 2048
"""[bytes] More than any frame; what is longer is none."""


class DatagramPort:
    """Listens on a port of this machine."""

    def __init__(self, host: str, port: int) -> None:
        """Open it.

        Raises
        ------
        LinkError
            The port is in use.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise LinkError(f"UDP port {port}: {error.strerror}") from error

    @property
    def port(self) -> int:
        """The port it listens on."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """Give the descriptor to poll."""
        return self._socket.fileno()

    def receive(self) -> tuple[bytes, Any] | None:
        """Give the next datagram and its sender; None if there is none."""
        try:
            return self._socket.recvfrom(_READ)
        except (BlockingIOError, ConnectionRefusedError):
            return None  # nothing there; or our last answer found nobody: it will ask again

    def send(self, data: bytes, to: Any) -> None:
        """Send a datagram; one that cannot be sent is lost, and will be asked for again."""
        with contextlib.suppress(OSError):
            self._socket.sendto(data, to)

    def close(self) -> None:
        """Close it."""
        self._socket.close()
