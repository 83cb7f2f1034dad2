"""What the simulated autopilot does on each MAV_CMD, and what it answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.rover import FORCE, Rover
from twinscrew.hil_sim.autopilot.streams import Streams
from twinscrew.hil_sim.autopilot.telemetry import TELLERS

ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
DENIED = int(mavlink.MAV_RESULT_DENIED)
UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)
FAILED = int(mavlink.MAV_RESULT_FAILED)


class Commanded(Protocol):
    """What a command may act on."""

    rover: Rover
    streams: Streams

    def send_once(self, message_id: int) -> None:
        """Send a message with the next step."""


def execute(command: int, params: Sequence[float], on: Commanded) -> int:
    """Carry a command out; gives its MAV_RESULT."""
    handler = _HANDLERS.get(command)
    return UNSUPPORTED if handler is None else handler(params, on)


def _arm_disarm(params: Sequence[float], on: Commanded) -> int:
    if params[0] == 1:
        return ACCEPTED if on.rover.arm(force=params[1] == FORCE) else FAILED
    if params[0] == 0:
        on.rover.disarm()
        return ACCEPTED
    return UNSUPPORTED


def _set_mode(params: Sequence[float], on: Commanded) -> int:
    if not int(params[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if on.rover.set_mode(params[1]) else FAILED


def _calibrate(params: Sequence[float], on: Commanded) -> int:
    simple = 4  # param5: one position, level
    if params[4] != simple:
        return UNSUPPORTED
    return ACCEPTED if on.rover.calibrate() else FAILED


def _set_servo(params: Sequence[float], on: Commanded) -> int:
    return ACCEPTED if on.rover.set_servo(params[0], params[1]) else FAILED


def _set_message_interval(params: Sequence[float], on: Commanded) -> int:
    message_id, interval_us = int(params[0]), params[1]
    if message_id not in TELLERS:
        return DENIED
    if interval_us == 0:
        on.streams.reset(message_id)
    else:
        on.streams.every(message_id, interval_us * 1e-6 if interval_us > 0 else None)
    return ACCEPTED


def _request_message(params: Sequence[float], on: Commanded) -> int:
    if int(params[0]) not in TELLERS:
        return FAILED
    on.send_once(int(params[0]))
    return ACCEPTED


_HANDLERS = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    mavlink.MAV_CMD_DO_SET_SERVO: _set_servo,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_message_interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
}
