"""How long the surroundings have been seen since they were last forgotten.

What is around a boat is known only after it has been seen for a while: a track is confirmed by 3 of
its first 5 scans, and its velocity needs some more. Until then a boat would sail blind.
"""

from __future__ import annotations

from typing import Final

from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND

SETTLE_S: Final = 1.0
"""[s] Scans must have come for this long: twice what five scans of a 10 Hz LiDAR take, within which
every track that is seen is confirmed."""


class Settling:
    """Counts scans, and the time between their stamps, since the last restart.

    Parameters
    ----------
    scans
        [-] So many are needed besides the time: what the tracker confirms a track by.
    kept_s
        [s] What has not been seen for longer is forgotten: how long the tracker keeps it.
    """

    def __init__(self, scans: int, kept_s: float) -> None:
        self._needed = scans
        self._kept_ns = kept_s * NANOSECONDS_PER_SECOND
        self._since_ns: int | None = None
        self._last_ns = 0
        self._seen = 0
        self.has_forgotten = False
        """Whether there was a restart, so that this is not the first time of all."""

    def restart(self) -> None:
        """Note that the surroundings are forgotten."""
        self.has_forgotten = True
        self._since_ns = None
        self._seen = 0

    def see(self, stamp_ns: int) -> None:
        """Note a scan that could be used."""
        if self._since_ns is None:
            self._since_ns = stamp_ns
        self._last_ns = stamp_ns
        self._seen += 1

    def miss(self, stamp_ns: int) -> None:
        """Note a scan that could not be used; after too many in a row all is forgotten."""
        if self._since_ns is not None and stamp_ns - self._last_ns > self._kept_ns:
            self.restart()

    @property
    def is_settled(self) -> bool:
        """Whether the surroundings have been seen for long enough."""
        if self._since_ns is None or self._seen < self._needed:
            return False
        return self._last_ns - self._since_ns >= SETTLE_S * NANOSECONDS_PER_SECOND
