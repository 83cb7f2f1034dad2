"""`sensor_msgs/NavSatFix`: a satellite receiver's position; its covariance from ENU to NED."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from twinscrew.runtime.messages.header import read_header, write_header
from twinscrew.runtime.messages.types import Fix, Float64
from twinscrew.runtime.messages.wire import Reader, Writer

FIX_TYPE: Final = "sensor_msgs/msg/NavSatFix"

_NO_FIX: Final = -1
"""NavSatStatus.STATUS_NO_FIX; more is a fix, with or without augmentation."""
_SERVICE_GPS: Final = 1
_UNKNOWN, _KNOWN = 0, 3
"""position_covariance_type: the receiver does not tell; it tells all of it."""
_NED_ENU: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Turns a vector of ENU into NED; it is its own inverse."""


def decode_fix(payload: bytes | memoryview) -> Fix:
    """Read a sensor_msgs/NavSatFix.

    A covariance that is said to be known but is all zeros, or not finite, is none: some drivers
    never fill it in.

    Raises
    ------
    MessageError
        Not such a message, or a fix at no place on the earth.
    """
    reader = Reader(payload, FIX_TYPE)
    stamp_ns, _ = read_header(reader)
    (status,) = reader.values("b", 1)
    reader.values("H", 2)  # which systems: of no concern
    latitude, longitude, altitude, *covariance = reader.values("12d", 8)
    kind = reader.uint8()
    reader.end()
    valid = status > _NO_FIX
    if valid and not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
        raise reader.fail(
            f"latitude {latitude:g}, longitude {longitude:g} is no place on the earth"
        )
    return Fix(
        stamp_ns=stamp_ns,
        valid=valid,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=altitude if math.isfinite(altitude) else math.nan,
        covariance_N=None if kind == _UNKNOWN else _covariance_N(covariance),
    )


def encode_fix(fix: Fix, *, frame_id: str = "gps") -> bytes:
    """Write a sensor_msgs/NavSatFix."""
    writer = Writer()
    write_header(writer, fix.stamp_ns, frame_id)
    writer.values("b", 1, 0 if fix.valid else _NO_FIX)
    writer.values("H", 2, _SERVICE_GPS)
    told = fix.covariance_N is not None
    covariance_N = fix.covariance_N if fix.covariance_N is not None else np.zeros((3, 3))
    covariance = (_NED_ENU @ covariance_N @ _NED_ENU).ravel().tolist()
    writer.values("12d", 8, fix.latitude_deg, fix.longitude_deg, fix.altitude_m, *covariance)
    writer.values("B", 1, _KNOWN if told else _UNKNOWN)
    return writer.payload()


def _covariance_N(values: list[float]) -> Float64 | None:
    covariance = np.array(values).reshape(3, 3)
    if not np.isfinite(covariance).all() or (covariance.diagonal() <= 0.0).any():
        return None
    covariance_N: Float64 = _NED_ENU @ covariance @ _NED_ENU
    return covariance_N
