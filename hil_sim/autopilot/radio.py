"""The pilot's channels: what a receiver gives, and what overrides make of it.

Behaviour measured on ArduRover V4.6.0-dev; each rule says what was seen.
"""

from __future__ import annotations

from collections.abc import Sequence

CHANNELS = 16
NEUTRAL_US = 1500
"""[us] A stick that nobody touches."""
IGNORE = 65535
"""An override that leaves its channel alone."""
RELEASE = 0
"""An override that gives its channel back to the receiver (channels 1 to 8)."""
RELEASE_HIGH = 65534
"""The same for channels 9 to 16, where 0 means ignore."""
LOST_AFTER_S = 0.5
"""[s] Without a receiver, radio counts as lost this long after the last override."""


class Radio:
    """Sixteen channels.

    Parameters
    ----------
    receiver
        Whether a receiver is fitted; its sticks are `sticks`, which a test may move.
    """

    def __init__(self, *, receiver: bool) -> None:
        self.receiver = receiver
        self.sticks = [NEUTRAL_US] * CHANNELS
        """[us] What the receiver gives, channel 1 first."""
        self.values = [NEUTRAL_US if receiver else 0] * CHANNELS
        """[us] What RC_CHANNELS shows: the last value of each channel, however old."""
        self._overrides: list[tuple[int, float] | None] = [None] * CHANNELS
        self._last_override_s: float | None = None

    def override(self, values: Sequence[int], now_s: float) -> None:
        """Take one override message: a value [us] a channel, channel 1 first."""
        for channel, value in enumerate(values[:CHANNELS]):
            if value == IGNORE or (channel >= 8 and value == RELEASE):
                continue
            released = value == (RELEASE if channel < 8 else RELEASE_HIGH)
            self._overrides[channel] = None if released else (value, now_s)
        if any(override is not None for override in self._overrides):
            self._last_override_s = now_s  # read: giving every channel back is no sign of a pilot

    def clear_overrides(self) -> None:
        """Forget every override, as the failsafe does."""
        self._overrides = [None] * CHANNELS

    def update(self, now_s: float, override_time_s: float) -> None:
        """Bring `values` up to date; overrides older than `override_time_s` give way to sticks."""
        for channel, override in enumerate(self._overrides):
            held = override is not None and (
                override_time_s < 0 or now_s - override[1] < override_time_s
            )
            if held and override is not None:
                self.values[channel] = override[0]
            elif self.receiver:
                self.values[channel] = self.sticks[channel]
            # else: nothing gives a value, and the old one stays (seen: RC_CHANNELS shows it on)

    def silent_s(self, now_s: float, boot_s: float) -> float:
        """Give how long [s] no pilot has been heard: 0 with a receiver."""
        if self.receiver:
            return 0.0
        return now_s - (boot_s if self._last_override_s is None else self._last_override_s)
