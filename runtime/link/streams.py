"""Messages that the autopilot shall send at a rate: asked for, measured, asked for again.

ArduPilot sends most messages once a second by itself (SRn_* = 1), and a ground station may change a
rate at any time. So each is asked for at the start whatever comes already, and again whenever fewer
come than are needed.
"""

from __future__ import annotations

import math
from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.commands import message_interval
from twinscrew.runtime.link.wire import Message

ENOUGH = 0.5
"""[-] A rate is good enough if this part of it comes: one message in three may be lost."""
WINDOW_S = 1.0
"""[s] Rates are measured over this time, or five periods if that is longer."""
TRIES = 5
"""[-] Unanswered requests before the rate counts as refused; it is asked for on, less often."""
SELDOM_S = 5.0
"""[s] Between two requests from then on."""
STREAM_RATES = {
    int(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW): "SRn_RC_CHAN",
    int(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED): "SRn_POSITION",
    int(mavlink.MAVLINK_MSG_ID_ATTITUDE): "SRn_EXTRA1",
}
"""The parameter that sets a message's rate at boot; n is the number of the MAVLink port. Source:
ArduPilot, Rover/GCS_Mavlink.cpp."""


class Stream:
    """One message of one autopilot.

    Parameters
    ----------
    target, message_id, rate_hz
        Who shall send which message how often.
    """

    def __init__(self, target: int, message_id: int, rate_hz: float) -> None:
        self._id = message_id
        self._asked_hz = rate_hz
        self._request = message_interval(target, message_id, rate_hz)
        self._window_s = max(WINDOW_S, 5.0 / rate_hz)
        self._needed = math.ceil(ENOUGH * rate_hz * self._window_s)
        self._arrivals: deque[float] = deque(maxlen=math.ceil(4.0 * rate_hz * self._window_s))
        self._asked_s = -math.inf
        self._tries = 0
        self._steady = False

    def arrived(self, message_id: int, now_s: float) -> None:
        """Take note of a message of any kind."""
        if message_id == self._id:
            self._arrivals.append(now_s)
            self._steady = self._count(now_s) >= self._needed

    def shows_silence(self, silent_after_s: float) -> bool:
        """Tell whether it came so often, when it came last, that such a silence is unusual."""
        return self._steady and 1.0 / (ENOUGH * self._asked_hz) < silent_after_s

    def ask(self, now_s: float) -> list[Message]:
        """Give the request if it is time for one."""
        if self._tries and self._count(now_s) >= self._needed:
            self._tries = 1  # it was asked for, and it comes
            return []
        wait_s = self._window_s if self._tries < TRIES else SELDOM_S
        if now_s - self._asked_s < wait_s:
            return []
        self._asked_s = now_s
        self._tries += 1
        return [self._request]

    def ask_again(self) -> None:
        """Ask at once: the autopilot has restarted, and forgotten what it was asked for."""
        self._asked_s, self._tries = -math.inf, 0

    def refused(self, now_s: float) -> str | None:
        """Say how fast it comes, and what to set, if it was asked for in vain; else None."""
        if self._tries < TRIES:
            return None
        name = mavlink.mavlink_map[self._id].msgname
        rate_hz = self._count(now_s) / self._window_s
        words = f"{name} comes at {rate_hz:.1f} Hz, {self._asked_hz:g} Hz asked for"
        parameter = STREAM_RATES.get(self._id)
        return words if parameter is None else f"{words}: set {parameter} to {self._asked_hz:g}"

    def _count(self, now_s: float) -> int:
        return sum(arrival_s > now_s - self._window_s for arrival_s in self._arrivals)
