"""What every way of carrying MAVLink bytes offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeAlias

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
