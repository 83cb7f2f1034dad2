"""The autopilot's time since boot in the caller's time.

Two sources. Every message bounds the difference: it came no earlier than it was sent, so the
smallest (arrival - its own time) ever seen is off by the least delay. TIMESYNC halves that error:
the answer tells the autopilot's time between our question and its arrival, and the fastest
question's middle is the best guess. The clocks drift apart by some parts per million: what was
seen longer ago counts less (`FORGET`), so that the difference follows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.wire import Message

FORGET = 1e-4
"""[s/s] How fast an old measurement loses its worth: more than two crystals drift (100 ppm)."""
ASK_S = 1.0
"""[s] Between two TIMESYNC questions."""
LONGEST_DELAY_S = 5.0
"""[s] No line is slower: who answers as if it were counts by another clock than its messages."""
_REBOOT_S = 1.0
"""[s] A time this far back means that the autopilot started again."""


@dataclass(slots=True)
class _Difference:
    """The caller's time less the autopilot's [s], as one source measured it."""

    value_s: float = math.inf
    error_s: float = math.inf
    """[s] How good the measurement was: less is better."""
    at_s: float = -math.inf

    def offer(self, value_s: float, error_s: float, now_s: float) -> None:
        """Take a new measurement if it is better than the old one has become."""
        if error_s <= self.error_s + FORGET * max(0.0, now_s - self.at_s):
            self.value_s, self.error_s, self.at_s = value_s, error_s, now_s


class BootClock:
    """Measures the difference between the caller's time and the autopilot's."""

    def __init__(self) -> None:
        self._question_ns: int | None = None
        self._asked_s = -math.inf
        self._boot_s = -math.inf
        self._one_way = _Difference()
        self._synced = _Difference()

    def caller_s(self, boot_s: float) -> float:
        """Give the caller's time [s] of an autopilot's time since boot [s]."""
        latest_s, synced_s = self._one_way.value_s, self._synced.value_s
        apart = math.isfinite(latest_s) and latest_s - synced_s > LONGEST_DELAY_S
        return boot_s + (latest_s if apart else min(latest_s, synced_s))

    def heard(self, boot_s: float, now_s: float) -> None:
        """Take the time since boot that a message carries, which came now."""
        if boot_s < self._boot_s - _REBOOT_S:
            self._one_way, self._synced = _Difference(), _Difference()
        self._boot_s = boot_s
        difference_s = now_s - boot_s
        self._one_way.offer(difference_s, difference_s, now_s)  # the less, the less delay

    def ask(self, now_s: float) -> list[Message]:
        """Give the TIMESYNC question if it is time for one."""
        if now_s - self._asked_s < ASK_S:
            return []
        self._asked_s = now_s
        self._question_ns = round(now_s * 1e9)
        return [mavlink.MAVLink_timesync_message(0, self._question_ns)]

    def answered(self, message: Message, now_s: float) -> float | None:
        """Take a TIMESYNC; only the answer to our last question counts.

        Returns
        -------
        float or None
            When the question was sent [s]; None if this does not answer it.
        """
        if message.tc1 == 0 or message.ts1 != self._question_ns:
            return None
        self._question_ns = None
        round_trip_s = float(now_s - message.ts1 * 1e-9)
        if round_trip_s >= 0.0:
            middle_s = now_s - round_trip_s / 2
            self._synced.offer(middle_s - message.tc1 * 1e-9, round_trip_s, now_s)
        return now_s - round_trip_s
