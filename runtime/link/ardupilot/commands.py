"""What is sent to the autopilot: commands, requests that are repeated, streams with their rates."""

from __future__ import annotations

import math
from collections import deque
from typing import Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.link.ardupilot.thrust import stick_from_pwm
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Severity

# -- Requests that are repeated until they are answered: a message may always be lost.


class Retried:
    """A command that is sent again and again while it is wanted.

    Parameters
    ----------
    message
        The command.
    every_s
        [s] Between two tries.
    """

    def __init__(self, message: Message, every_s: float) -> None:
        self._message = message
        self._every_s = every_s
        self._last_s = -math.inf
        self.refusal: int | None = None
        """MAV_RESULT of the last refusal; None if there was none, or it was accepted since."""
        self._reasons: dict[str, float] = {}

    def ask(self, now_s: float) -> list[Message]:
        """Give the command if it is time for the next try."""
        if now_s - self._last_s < self._every_s:
            return []
        self._last_s = now_s
        return [self._message]

    def answered(self, result: int) -> None:
        """Take the answer, a MAV_RESULT."""
        self.refusal = None if result == 0 else result
        if result == 0:
            self._reasons = {}

    def explained(self, words: str, now_s: float) -> None:
        """Take the autopilot's own words about a refusal; it may have several reasons.

        A text that comes in chunks is given again with each of them.
        """
        kept_s = now_s - 3.0 * self._every_s
        self._reasons = {
            text: at_s
            for text, at_s in self._reasons.items()
            if at_s >= kept_s and not words.startswith(text)
        }
        self._reasons[words] = now_s

    @property
    def reason(self) -> str:
        """Why it was refused, in the autopilot's own words; empty if it said nothing."""
        return "; ".join(sorted(self._reasons))


# -- The messages that the link sends, and the times that it keeps.

HEARTBEAT_S = 1.0
"""[s] MAVLink's heartbeat interval."""
ORIGIN_HZ = 1.0
"""[Hz] Often enough to hear soon that an autopilot has started again, with another origin."""
COMMAND_STALE_S = 0.2
"""[s] Without a new command for this long (4 at 20 Hz), `tick` sends stop."""
STREAM_BEFORE_ARMING_S = 0.1
"""[s] Neutral overrides must reach the autopilot before it lets itself be armed."""
LEFT, RIGHT = 1, 3
"""Channels of the paddles (RCMAP_ROLL, RCMAP_THROTTLE)."""
_STATE = {
    "local_position": (
        int(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED),
        int(mavlink.MAVLINK_MSG_ID_ATTITUDE),
    ),
    "odometry": (int(mavlink.MAVLINK_MSG_ID_ODOMETRY),),
}
"""The messages that tell the vessel's state, by `AutopilotSettings.state_message`."""
_IGNORE = 65535
_TEXT_LENGTH = 50
"""[bytes] One STATUSTEXT."""
MOST_CHUNKS = 10
"""[-] Of one text: chunks are numbered by 8 bits, and a slow radio has other things to carry."""
_NUMBERS = 65_536
_SEVERITIES = {
    Severity.INFO: mavlink.MAV_SEVERITY_INFO,
    Severity.WARNING: mavlink.MAV_SEVERITY_WARNING,
    Severity.ERROR: mavlink.MAV_SEVERITY_ERROR,
}


def heartbeat() -> Message:
    """We are an onboard computer, not an autopilot."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,  # MAVLink's own version number in this message
    )


def thrust(
    target: int, pair: tuple[int, int], control: Literal["rc_override", "manual_control"]
) -> Message:
    """Ask for pulse widths [us], left and right."""
    if control == "manual_control":
        left, right = (stick_from_pwm(pwm_us) for pwm_us in pair)
        none = 32_767  # an axis that is not there
        return mavlink.MAVLink_manual_control_message(target, none, left, right, none, 0)
    channels = [_IGNORE] * 18
    channels[LEFT - 1], channels[RIGHT - 1] = pair
    return mavlink.MAVLink_rc_channels_override_message(
        target, mavlink.MAV_COMP_ID_AUTOPILOT1, *channels
    )


def set_mode(target: int, mode: int) -> Message:
    """Ask for a mode."""
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return _command(target, mavlink.MAV_CMD_DO_SET_MODE, custom, mode)


def arm(target: int) -> Message:
    """Ask for arming, with all of the autopilot's checks."""
    return _command(target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)


def disarm(target: int) -> Message:
    """Ask for disarming."""
    return _command(target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)


def message_interval(target: int, message_id: int, rate_hz: float) -> Message:
    """Ask for a message at a rate."""
    interval_us = 1e6 / rate_hz
    return _command(target, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us)


def streams(settings: AutopilotSettings) -> list[tuple[int, float]]:
    """Give the messages that the link wants, with their rates [Hz]."""
    wanted = [
        (int(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW), settings.servo_output_hz),
        (int(mavlink.MAVLINK_MSG_ID_HEARTBEAT), 1.0 / HEARTBEAT_S),
    ]
    if settings.state_hz > 0:
        wanted += [(id_, settings.state_hz) for id_ in _STATE[settings.state_message]]
    if settings.state_hz > 0 and settings.datum is not None:
        wanted.append((int(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN), ORIGIN_HZ))
    return wanted


def statustext(text: str, severity: Severity, number: int) -> list[Message]:
    """Give the messages that carry a text, 50 bytes each, of which `MOST_CHUNKS` at most are sent.

    Parameters
    ----------
    number
        Another one for each text: it joins the chunks of a long one. Its last chunk is shorter than
        50 bytes, if need be empty: so a station knows that it has them all.
    """
    encoded = text[: MOST_CHUNKS * _TEXT_LENGTH - 1].encode("ascii", errors="replace")
    if len(encoded) <= _TEXT_LENGTH:
        return [mavlink.MAVLink_statustext_message(_SEVERITIES[severity], encoded)]
    starts = range(0, len(encoded) + 1, _TEXT_LENGTH)
    return [
        mavlink.MAVLink_statustext_message(
            _SEVERITIES[severity],
            encoded[start : start + _TEXT_LENGTH],
            1 + number % (_NUMBERS - 1),  # 0 is a text without chunks
            chunk,
        )
        for chunk, start in enumerate(starts)
    ]


def _command(target: int, command: int, *params: float) -> Message:
    padded = [*params, *[0.0] * (7 - len(params))]
    return mavlink.MAVLink_command_long_message(
        target, mavlink.MAV_COMP_ID_AUTOPILOT1, command, 0, *padded
    )


# -- Messages that the autopilot shall send at a rate: asked for, measured, asked for again.
#
# ArduPilot sends most messages once a second by itself (SRn_* = 1), and a ground station may change
# a rate at any time. So each is asked for at the start whatever comes already, and again whenever
# fewer come than are needed.

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
