"""ODOMETRY (331): position, attitude and velocity of one moment in one message.

Visual-inertial systems and PX4 send it; ArduPilot (4.6) takes it in but sends none.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Float64, Odometry

UNIX_SINCE_S: Final = 1e9
"""[s] Times later than this (the year 2001) are counted from 1970, earlier ones from the boot."""
_IN_BODY: Final = (mavlink.MAV_FRAME_BODY_FRD, mavlink.MAV_FRAME_BODY_NED)
"""Frames of a velocity in the vessel's axes; the second is the older name of the first."""
_NUMBERS: Final = ("x", "y", "z", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed")
_QUATERNION_TOLERANCE: Final = 1e-2
_FAILED: Final = -1


def time_s(message: Message) -> float:
    """[s] Give the time that the message carries, since the sender's boot or since 1970."""
    return float(message.time_usec) * 1e-6


def is_usable(message: Message) -> bool:
    """Tell whether it is whole, in frames that we know, and its estimator has not failed."""
    known = message.frame_id == mavlink.MAV_FRAME_LOCAL_NED and (
        message.child_frame_id in (*_IN_BODY, mavlink.MAV_FRAME_LOCAL_NED)
    )
    finite = all(math.isfinite(getattr(message, name)) for name in _NUMBERS)
    norm = math.hypot(*message.q)
    unit = math.isfinite(norm) and abs(norm - 1.0) <= _QUATERNION_TOLERANCE
    return known and finite and unit and message.quality != _FAILED


def whole_odometry(message: Message, origin_N: Float64, stamp_ns: int) -> Odometry:
    """Give the odometry of a message that `is_usable`.

    Parameters
    ----------
    message
        An ODOMETRY.
    origin_N : (3,) float64
        Where its sender's frame begins [m].
    stamp_ns
        [ns] When it was measured, on the caller's clock.
    """
    q_NB = np.array(message.q, dtype=np.float64)
    q_NB /= math.sqrt(float(q_NB @ q_NB))
    velocity = np.array([message.vx, message.vy, message.vz])
    if message.child_frame_id not in _IN_BODY:
        velocity = rotation_from_quaternion(q_NB).T @ velocity
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=origin_N + np.array([message.x, message.y, message.z]),
        q_NB=q_NB,
        velocity_B=velocity,
        rates_B=np.array([message.rollspeed, message.pitchspeed, message.yawspeed]),
    )
