"""NMEA 0183 over UDP, TCP or a serial line: bytes become sentences on the topic `nmea`.

Chart plotters, AIS receivers and radars speak it. The text goes on as it came, so that a recording
holds what the receiver said. Garbage between sentences is skipped; memory is bounded.
"""

from __future__ import annotations

from typing import Final

from twinscrew.runtime.messages.marine import LONGEST_SENTENCE
from twinscrew.runtime.settings import Settings

LONGEST_BUFFER: Final = 65_536
"""[B] More without an end of a line is no NMEA."""
MOST_LINES: Final = 500
"""[-] Handed on at once; a receiver at 38400 baud sends 50 in a second."""


class NmeaSettings(Settings, frozen=True, kw_only=True):
    """Where sentences come from, beside the topic `nmea`."""

    connections: tuple[str, ...] = ()
    """As [autopilot] connection: "udpin:0.0.0.0:10110", "tcp:192.168.1.5:10110",
    "serial:/dev/ttyUSB0:38400"."""


class NmeaLines:
    """Cuts bytes into sentences."""

    def __init__(self) -> None:
        self._rest = b""
        self.left_out = 0
        """[-] Lines that are no sentences."""

    def feed(self, data: bytes) -> list[str]:
        """Give the sentences that end in these bytes; the rest waits for more."""
        lines = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        self._rest = lines.pop()
        if len(self._rest) > LONGEST_BUFFER:
            self._rest = b""
            self.left_out += 1
        sentences: list[str] = []
        for line in lines:
            if not line:
                continue
            text = line.strip().decode("ascii", errors="replace")
            if len(line) > LONGEST_SENTENCE or not text.isascii() or text[:1] not in "!$\\":
                self.left_out += 1
            elif len(sentences) < MOST_LINES:
                sentences.append(text)
            else:
                self.left_out += 1
        return sentences
