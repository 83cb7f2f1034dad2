"""A serial line, by the standard library alone: raw, eight bits, no flow control."""

from __future__ import annotations

import os
import termios
import tty

from twinscrew.runtime.errors import LinkError, one_of
from twinscrew.runtime.link.carrier import Transport

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
