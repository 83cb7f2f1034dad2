"""A pilot at the autopilot: what he does, and what he sees there."""

from __future__ import annotations

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot
from twinscrew.hil_sim.autopilot.rover import Mode


class Bridge(msgspec.Struct, frozen=True, array_like=True):
    """What the autopilot's own display shows."""

    mode: str
    """MANUAL or HOLD; empty before it is known."""
    armed: bool


def bridge_of(autopilot: RoverAutopilot) -> Bridge:
    """Look at it."""
    return Bridge(autopilot.rover.mode.name, armed=autopilot.rover.armed)


def act(autopilot: RoverAutopilot, does: str) -> None:
    """Do something: hold, manual, arm or disarm."""
    rover = autopilot.rover
    match does:
        case "hold":
            rover.set_mode(Mode.HOLD)
        case "manual":
            rover.set_mode(Mode.MANUAL)
        case "arm":
            rover.arm(force=True)
        case "disarm":
            rover.disarm()
    autopilot.streams.at_once(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
