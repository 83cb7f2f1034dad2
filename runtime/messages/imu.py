"""`sensor_msgs/Imu`: from FLU axes in an ENU world (REP 103, REP 145) to FRD axes in NED."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from twinscrew.runtime.geometry import (
    attitude_enu_flu_to_ned_frd,
    attitude_ned_frd_to_enu_flu,
    flu_to_frd,
)
from twinscrew.runtime.messages.header import read_header, write_header
from twinscrew.runtime.messages.odometry import check_numbers, unit
from twinscrew.runtime.messages.types import Float64, Imu
from twinscrew.runtime.messages.wire import Reader, Writer

IMU_TYPE: Final = "sensor_msgs/msg/Imu"

_NOT_THERE: Final = -1.0
"""First element of a covariance: the unit does not measure that at all."""
_DIAGONAL: Final = (0, 4, 8)


def decode_imu(payload: bytes | memoryview) -> Imu:
    """Read a sensor_msgs/Imu.

    Variances are those of the axes, which turning an axis round does not change. All zeros means
    that the unit does not tell.

    Raises
    ------
    MessageError
        Not such a message, a number is not finite or absurd, it has no rates or no acceleration,
        or its attitude is not a unit quaternion.
    """
    reader = Reader(payload, IMU_TYPE)
    stamp_ns, _ = read_header(reader)
    qx, qy, qz, qw, *body = reader.values("37d", 8)
    reader.end()
    attitude_c, rates, rates_c = body[:9], body[9:12], body[12:21]
    force, force_c = body[21:24], body[24:33]
    check_numbers(reader, (*rates, *force))
    if _NOT_THERE in (rates_c[0], force_c[0]):
        raise reader.fail("a unit without rates or without accelerations is of no use")
    q_NI = None
    if attitude_c[0] != _NOT_THERE:
        check_numbers(reader, (qx, qy, qz, qw))
        q_NI = attitude_enu_flu_to_ned_frd(unit(reader, qw, qx, qy, qz))
    return Imu(
        stamp_ns=stamp_ns,
        rates_I=flu_to_frd(np.array(rates)),
        force_I=flu_to_frd(np.array(force)),
        q_NI=q_NI,
        attitude_variance=None if q_NI is None else _variance(attitude_c),
        rates_variance=_variance(rates_c),
        force_variance=_variance(force_c),
    )


def encode_imu(imu: Imu, *, frame_id: str = "imu") -> bytes:
    """Write a sensor_msgs/Imu."""
    writer = Writer()
    write_header(writer, imu.stamp_ns, frame_id)
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    if imu.q_NI is not None:
        w, x, y, z = attitude_ned_frd_to_enu_flu(imu.q_NI).tolist()
    attitude = [_NOT_THERE, *[0.0] * 8] if imu.q_NI is None else _covariance(imu.attitude_variance)
    writer.values(
        "37d",
        8,
        *(x, y, z, w),
        *attitude,
        *flu_to_frd(imu.rates_I).tolist(),
        *_covariance(imu.rates_variance),
        *flu_to_frd(imu.force_I).tolist(),
        *_covariance(imu.force_variance),
    )
    return writer.payload()


def _variance(covariance: list[float]) -> Float64 | None:
    diagonal = [covariance[i] for i in _DIAGONAL]
    told = all(math.isfinite(value) and value > 0.0 for value in diagonal)
    return np.array(diagonal) if told else None


def _covariance(variance: Float64 | None) -> list[float]:
    return np.diag(np.zeros(3) if variance is None else variance).ravel().tolist()
