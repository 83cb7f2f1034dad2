"""What a sensor beside the LiDAR is to the vessel: messages in, looks for the tracker out."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, NamedTuple, Protocol, TypeAlias

from twinscrew.runtime.messages.types import HealthEvent, Odometry, Tracks
from twinscrew.runtime.settings import Settings
from twinscrew.runtime.tracking.detections import Look, SourceSettings

OwnAt: TypeAlias = Callable[[int], Odometry | None]
"""Gives the own vessel's state at a stamp [ns]; None if that is not known."""


class Heard(NamedTuple):
    """What came of a message, or of the time."""

    looks: tuple[Look, ...] = ()
    """For the tracker."""
    events: tuple[HealthEvent, ...] = ()
    """For the operator."""


NOTHING = Heard()


class Sense(Protocol):
    """Turns one kind of message into looks. No clock and no randomness: stamps are the time."""

    def take(self, payload: bytes, latest_ns: int, own_at: OwnAt) -> Heard:
        """Take in a message.

        Parameters
        ----------
        payload
            In CDR.
        latest_ns
            [ns] The vessel's time, for messages without a stamp of their own.
        own_at
            The own vessel's state.

        Raises
        ------
        MessageError
            It is not the message that it should be.
        """

    def step(self, stamp_ns: int, *, forgotten: bool) -> Heard:
        """Let time pass, once a scan; if the tracker has forgotten all, say again what is known."""

    def targets(self, stamp_ns: int) -> Tracks | None:
        """Give everything that it knows by itself, for people; None if it keeps nothing."""


class SenseSettings(Settings, frozen=True, kw_only=True):
    """The settings of a sensor beside the LiDAR, and what belongs to its kind."""

    topic: ClassVar[str]
    """The topic that its messages come by."""
    source: ClassVar[SourceSettings]
    """What the tracker must know of it."""

    def make(self, name: str) -> Sense:
        """Make the sensor; `name` is its source's."""
        raise NotImplementedError


class Rarely:
    """Lets an event of a kind pass once in a while, so that a flood is no flood of events."""

    MOST_KINDS = 1024

    def __init__(self, every_s: float) -> None:
        """Begin with nothing reported; a kind may pass again after `every_s` [s]."""
        self._every_ns = every_s * 1e9
        self._last_ns: dict[str, int] = {}

    def allows(self, what: str, stamp_ns: int) -> bool:
        """Tell whether something may be reported now, and note that it was."""
        last_ns = self._last_ns.get(what)
        if last_ns is not None and abs(stamp_ns - last_ns) < self._every_ns:
            return False
        if len(self._last_ns) >= self.MOST_KINDS:
            self._last_ns.clear()
        self._last_ns[what] = stamp_ns
        return True
