"""The messages that the link sends, and the times that it keeps."""

from __future__ import annotations

from typing import Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.paddles import stick_from_pwm
from twinscrew.runtime.link.settings import AutopilotSettings
from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Severity

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
    return _override(target, pair)


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


def _override(target: int, pair: tuple[int, int]) -> Message:
    channels = [_IGNORE] * 18
    channels[LEFT - 1], channels[RIGHT - 1] = pair
    return mavlink.MAVLink_rc_channels_override_message(
        target, mavlink.MAV_COMP_ID_AUTOPILOT1, *channels
    )


def _command(target: int, command: int, *params: float) -> Message:
    padded = [*params, *[0.0] * (7 - len(params))]
    return mavlink.MAVLink_command_long_message(
        target, mavlink.MAV_COMP_ID_AUTOPILOT1, command, 0, *padded
    )
