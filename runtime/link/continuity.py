"""What the frames themselves prove: whether any is missing or late, whether the sender restarted.

Authority rests on knowing that nothing was missed. Two counters in ArduPilot's messages tell it:
the sequence number of every frame, and the time since boot in many messages. Both are read here,
without a clock: times are the caller's.
"""

from __future__ import annotations

import math

NUMBERS = 256
"""[-] MAVLink's sequence numbers count modulo this."""
LATE_S = 1.0
"""[s] A frame that was overtaken comes at most this long after the one that overtook it. An
autopilot that restarts is silent for longer than twice this."""
LONGEST_GAP_S = 4.0
"""[s] After a longer silence as many as 256 frames may be missing, which no number shows: that is
64 frames a second; an autopilot with our streams sends 20 to 60."""
STEADY_S = 0.5
"""[s] A time since boot proves something only if it is no more than this behind the last one."""


class FrameNumbers:
    """Follows the sequence numbers of one sender."""

    def __init__(self) -> None:
        self._newest = 0
        self._newest_s = -math.inf
        self._missed = False
        self._silent = False

    def arrived(self, number: int, now_s: float) -> bool:
        """Take a frame's number; False if the frame is a copy or came late, and tells nothing."""
        if not math.isfinite(self._newest_s):
            self._newest, self._newest_s = number, now_s
            return True
        ahead = (number - self._newest) % NUMBERS
        since_s = now_s - self._newest_s
        if (ahead == 0 or ahead >= NUMBERS // 2) and since_s < LATE_S:
            return False  # unless the sender began to count anew, which silence shows
        self._missed |= ahead != 1 or since_s > LONGEST_GAP_S
        self._silent |= since_s >= LATE_S
        self._newest, self._newest_s = number, now_s
        return True

    def missed(self) -> tuple[bool, bool]:
        """Tell of the frames since the last call.

        Returns
        -------
        missed
            Whether a frame may be missing.
        broken
            Whether one may be, or there was a silence in which the sender may have restarted.
        """
        missed, broken = self._missed, self._missed or self._silent
        self._missed = self._silent = False
        return missed, broken


class Uptime:
    """Follows the time since boot that messages carry.

    Parameters
    ----------
    wraps_s
        [s] When the counter starts again at 0: 2**32 of its units.
    """

    def __init__(self, wraps_s: float) -> None:
        self._wraps_s = wraps_s
        self._last_s: float | None = None
        self._came_s = -math.inf

    def arrived(self, uptime_s: float, now_s: float) -> bool | None:
        """Take a time since boot [s].

        Returns
        -------
        bool or None
            True: the sender has not restarted since the last message. False: it has. None: this
            is the first message, or came late, and proves nothing.
        """
        last_s, passed_s = self._last_s, now_s - self._came_s
        if last_s is None:
            self._last_s, self._came_s = uptime_s, now_s
            return None
        wrapped = abs(uptime_s + self._wraps_s - (last_s + passed_s)) < STEADY_S
        if not wrapped and last_s - LATE_S <= uptime_s < last_s and uptime_s >= passed_s:
            return None  # older than the last one, and too much to have begun anew since
        self._last_s, self._came_s = uptime_s, now_s
        if wrapped:
            return True
        if uptime_s < last_s or uptime_s < passed_s - STEADY_S:
            return False  # it counts from less than before, or began to count since
        return True if last_s + passed_s - uptime_s <= STEADY_S else None
