"""Frames and angles.

N is local north-east-down; B the vessel's forward-starboard-down, and L the same levelled: its x
and y axes lie in the horizontal plane; S is the sensor's forward-starboard-down.

`X_NB` is the pose of B in N; `p_NB` a position of B in N; `R_NB` turns a vector of B into N.
A product is right when the inner letters meet. ENU and FLU exist at the ROS boundary only: the
functions at the end are the one place where they are converted.

Source: Fossen (2021), Handbook of Marine Craft Hydrodynamics and Motion Control, chapter 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Angle = TypeVar("Angle", float, Array)


def rotation_2d(heading: float) -> Array:
    """Give R_NL, (2, 2), of a heading [rad, clockwise from north as seen from above]."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s], [s, c]])


def rotation_from_quaternion(q_NB: Array) -> Array:
    """Give R_NB, (3, 3), of a unit quaternion (w, x, y, z). Fossen (2021), eq. 2.72."""
    w, x, y, z = q_NB.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Array:
    """Give the unit quaternion (w, x, y, z) of zyx Euler angles [rad]. Fossen, sec. 2.2.3."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def euler_from_quaternion(q_NB: Array) -> tuple[float, float, float]:
    """Give the zyx Euler angles (roll, pitch, yaw) [rad] of a unit quaternion (w, x, y, z)."""
    w, x, y, z = q_NB.tolist()
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def interpolate_quaternion(q0: Array, q1: Array, fraction: float) -> Array:
    """Give the unit quaternion a fraction of the way from q0 to q1, the short way round.

    Normalised linear interpolation: exact at both ends, and within 0.01 deg of the great arc for
    the few degrees that a vessel turns between two odometry messages.
    """
    blend = (1.0 - fraction) * q0 + fraction * (q1 if float(q0 @ q1) >= 0.0 else -q1)
    unit: Array = blend / math.sqrt(float(blend @ blend))
    return unit


def quaternion_product(p: Array, q: Array) -> Array:
    """Give the Hamilton product of two quaternions (w, x, y, z)."""
    return np.array(_product(p.tolist(), q.tolist()))


def _product(p: Sequence[float], q: Sequence[float]) -> tuple[float, float, float, float]:
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def enu_to_ned(v: Array) -> Array:
    """Express a vector, (..., 3), given in ENU in NED. It is its own inverse."""
    turned: Array = v[..., _EAST_NORTH] * _DOWN
    return turned


def flu_to_frd(v: Array) -> Array:
    """Express a vector, (..., 3), given in FLU in FRD. It is its own inverse."""
    flipped: Array = v * _STARBOARD_DOWN
    return flipped


_Q_NED_ENU = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)
_Q_FLU_FRD = (0.0, 1.0, 0.0, 0.0)
_EAST_NORTH = np.array([1, 0, 2])
_DOWN = np.array([1.0, 1.0, -1.0])
_STARBOARD_DOWN = np.array([1.0, -1.0, -1.0])


def attitude_enu_flu_to_ned_frd(q: Array) -> Array:
    """Turn the attitude of FLU in ENU, (w, x, y, z), into that of FRD in NED (w >= 0)."""
    w, x, y, z = _product(_product(_Q_NED_ENU, q.tolist()), _Q_FLU_FRD)
    return np.array((-w, -x, -y, -z) if w < 0 else (w, x, y, z))


def attitude_ned_frd_to_enu_flu(q_NB: Array) -> Array:
    """Turn the attitude of FRD in NED, (w, x, y, z), into that of FLU in ENU (w >= 0)."""
    return attitude_enu_flu_to_ned_frd(q_NB)


def wrap(angle: Angle) -> Angle:
    """Wrap an angle, or an array of angles, to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
