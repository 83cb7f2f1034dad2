"""`nav_msgs/Odometry`, `geometry_msgs/PoseStamped`: the turn from ENU and FLU to NED and FRD.

A pose is that of the vessel (FLU) in the world (ENU); a twist is in the vessel's frame (REP 103).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from twinscrew.runtime.geometry import (
    Array,
    attitude_enu_flu_to_ned_frd,
    attitude_ned_frd_to_enu_flu,
    enu_to_ned,
    flu_to_frd,
)
from twinscrew.runtime.messages.header import (
    VESSEL_FRAME,
    WORLD_FRAME,
    read_header,
    write_header,
)
from twinscrew.runtime.messages.types import Goal, Odometry
from twinscrew.runtime.messages.wire import Reader, Writer

ODOMETRY_TYPE: Final = "nav_msgs/msg/Odometry"
GOAL_TYPE: Final = "geometry_msgs/msg/PoseStamped"

_COVARIANCE: Final = 36 * 8
"""[B] A covariance, 6 x 6 float64: stepped over; written as zeros, which means unknown."""
_BODY: Final = f"7d{_COVARIANCE}x6d{_COVARIANCE}x"
_QUATERNION_TOLERANCE: Final = 1e-2
"""[-] How far from 1 the norm of an attitude may be; float32 senders are within 1e-6."""
GREATEST: Final = 1e8
"""[m], [m/s], [rad/s] Farther than anything on earth, faster than any boat: not a measurement."""


def decode_odometry(payload: bytes | memoryview) -> Odometry:
    """Read a nav_msgs/Odometry in ENU and FLU.

    Raises
    ------
    MessageError
        Not such a message, a number is not finite or absurd, or the attitude is not a unit
        quaternion.
    """
    reader = Reader(payload, ODOMETRY_TYPE)
    stamp_ns, _ = read_header(reader)
    reader.name()
    body = reader.values(_BODY, 8)
    reader.end()
    x, y, z, qx, qy, qz, qw, *twist = body
    check_numbers(reader, body)
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=enu_to_ned(np.array((x, y, z))),
        q_NB=attitude_enu_flu_to_ned_frd(unit(reader, qw, qx, qy, qz)),
        velocity_B=flu_to_frd(np.array(twist[:3])),
        rates_B=flu_to_frd(np.array(twist[3:])),
    )


def encode_odometry(
    odometry: Odometry, *, frame_id: str = WORLD_FRAME, child_frame_id: str = VESSEL_FRAME
) -> bytes:
    """Write a nav_msgs/Odometry in ENU and FLU, its covariances unknown."""
    writer = Writer()
    write_header(writer, odometry.stamp_ns, frame_id)
    writer.string(child_frame_id)
    w, x, y, z = attitude_ned_frd_to_enu_flu(odometry.q_NB).tolist()
    writer.values(
        _BODY,
        8,
        *enu_to_ned(odometry.position_N).tolist(),
        *(x, y, z, w),
        *flu_to_frd(odometry.velocity_B).tolist(),
        *flu_to_frd(odometry.rates_B).tolist(),
    )
    return writer.payload()


def as_read_back(odometry: Odometry) -> Odometry:
    """Give odometry as `decode_odometry` reads it from `encode_odometry`, to the last bit.

    An attitude is rounded when it is turned to ENU and FLU and back; all else stays as it is. So
    whoever encodes odometry of its own need not decode it again to decide as a replay will.

    Raises
    ------
    MessageError
        A number is not finite or absurd: the message would be refused.
    """
    parts = (odometry.position_N, odometry.q_NB, odometry.velocity_B, odometry.rates_B)
    reader = Reader(b"\x00\x01\x00\x00", ODOMETRY_TYPE)
    check_numbers(reader, (number for part in parts for number in part.tolist()))
    q = attitude_enu_flu_to_ned_frd(unit(reader, *attitude_ned_frd_to_enu_flu(odometry.q_NB)))
    return replace(odometry, q_NB=q)


def decode_goal(payload: bytes | memoryview) -> Goal:
    """Read a geometry_msgs/PoseStamped in ENU; the goal's height and attitude mean nothing."""
    reader = Reader(payload, GOAL_TYPE)
    stamp_ns, _ = read_header(reader)
    x, y, *_ = reader.values("7d", 8)
    reader.end()
    check_numbers(reader, (x, y))
    return Goal(stamp_ns=stamp_ns, position_N=np.array((y, x)))


def encode_goal(goal: Goal, *, frame_id: str = WORLD_FRAME) -> bytes:
    """Write a geometry_msgs/PoseStamped in ENU, heading east."""
    writer = Writer()
    write_header(writer, goal.stamp_ns, frame_id)
    north, east = goal.position_N.tolist()
    writer.values("7d", 8, east, north, 0.0, 0.0, 0.0, 0.0, 1.0)
    return writer.payload()


def check_numbers(reader: Reader, numbers: Iterable[float]) -> None:
    """Refuse numbers that are not finite, or greater than anything on the water."""
    for number in numbers:
        if not math.isfinite(number):
            raise reader.fail("a number is not finite")
        if abs(number) > GREATEST:
            raise reader.fail(f"{number:g} cannot be: the greatest number allowed is {GREATEST:g}")


def unit(reader: Reader, w: float, x: float, y: float, z: float) -> Array:
    """Give a unit quaternion, w first; refuse one whose norm is off by more than rounding."""
    norm = math.hypot(w, x, y, z)
    if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
        raise reader.fail(f"an attitude of norm {norm:g} is not a unit quaternion")
    return np.array((w / norm, x / norm, y / norm, z / norm))
