"""CDR of odometry, IMU, satellite fixes, paths and the small messages beside them."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import (
    Array,
    attitude_enu_flu_to_ned_frd,
    attitude_ned_frd_to_enu_flu,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    quaternion_from_euler,
)
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Chart,
    ChartFeature,
    Engagement,
    Fallback,
    Fix,
    Float64,
    Goal,
    Imu,
    Odometry,
    Station,
)
from twinscrew.runtime.messages.wire import (
    FLAG,
    HEADER,
    HEADER_SIZE,
    STRING,
    Kind,
    Layout,
    Reader,
    Writer,
    array,
    choice,
    number,
)

# -- `std_msgs/Header` and `builtin_interfaces/Time`: what nearly every message starts with.


MIN_STAMP_NS = -(2**31) * NANOSECONDS_PER_SECOND
MAX_STAMP_NS = 2**31 * NANOSECONDS_PER_SECOND - 1
"""[ns] ROS 2 counts seconds in a signed number of 32 bits: from 1901 until 2038."""

WORLD_FRAME = "world"
"""The frame of positions that we publish: local, east-north-up (VRX's name)."""
VESSEL_FRAME = "base_link"
"""The vessel's frame, forward-left-up (REP 105)."""
LIDAR_FRAME = "lidar_wamv_link"
"""The LiDAR's frame, forward-left-up."""


def read_stamp(reader: Reader) -> int:
    """Read a Time; give it in nanoseconds."""
    seconds, nanoseconds = reader.values("iI", 4)
    if nanoseconds >= NANOSECONDS_PER_SECOND:
        raise reader.fail(f"a stamp has {nanoseconds} ns within its second")
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """Give a Time's seconds and nanoseconds; a `MessageError` before 1901 or after 2038."""
    if not MIN_STAMP_NS <= stamp_ns <= MAX_STAMP_NS:
        raise MessageError(f"{stamp_ns} ns is not a stamp that ROS 2 can write")
    return divmod(stamp_ns, NANOSECONDS_PER_SECOND)


def write_stamp(writer: Writer, stamp_ns: int) -> None:
    """Write a Time; a `MessageError` before 1901 or after 2038."""
    writer.values("iI", 4, *split_stamp(stamp_ns))


STAMP: Final = Kind(read_stamp, write_stamp)


def read_header(reader: Reader) -> tuple[int, str]:
    """Read a Header; give its stamp [ns] and frame."""
    return read_stamp(reader), reader.name()


def write_header(writer: Writer, stamp_ns: int, frame_id: str) -> None:
    """Write a Header."""
    write_stamp(writer, stamp_ns)
    writer.string(frame_id)


# -- `nav_msgs/Odometry`, `geometry_msgs/PoseStamped`: the turn from ENU and FLU to NED and FRD.
#
# A pose is that of the vessel (FLU) in the world (ENU); a twist is in the vessel's frame (REP 103).

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
    stamp_ns, frame_id = read_header(reader)
    child_frame_id = reader.name()
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
        frame_id=frame_id,
        child_frame_id=child_frame_id,
    )


def encode_odometry(
    odometry: Odometry, *, frame_id: str | None = None, child_frame_id: str | None = None
) -> bytes:
    """Write a nav_msgs/Odometry in ENU and FLU, its covariances unknown.

    The frames are those given, else the odometry's own, else `WORLD_FRAME` and `VESSEL_FRAME`.
    """
    if frame_id is None:
        frame_id = odometry.frame_id or WORLD_FRAME
    if child_frame_id is None:
        child_frame_id = odometry.child_frame_id or VESSEL_FRAME
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
    """Read a geometry_msgs/PoseStamped: x east, y north, or what they are in the frame it names.

    The goal's height and attitude mean nothing.
    """
    reader = Reader(payload, GOAL_TYPE)
    stamp_ns, frame_id = read_header(reader)
    x, y, *_ = reader.values("7d", 8)
    reader.end()
    check_numbers(reader, (x, y))
    return Goal(stamp_ns=stamp_ns, position_N=np.array((y, x)), frame_id=frame_id)


def encode_goal(goal: Goal, *, frame_id: str | None = None) -> bytes:
    """Write a geometry_msgs/PoseStamped in ENU, heading east.

    Its frame is the one given, else the goal's own, else `WORLD_FRAME`.
    """
    writer = Writer()
    write_header(
        writer, goal.stamp_ns, goal.frame_id or WORLD_FRAME if frame_id is None else frame_id
    )
    north, east = goal.position_N.tolist()
    writer.values("7d", 8, east, north, 0.0, 0.0, 0.0, 0.0, 1.0)
    return writer.payload()


def decode_station(payload: bytes | memoryview) -> Station:
    """Read a geometry_msgs/PoseStamped: where to stay, and where the bow is to point.

    Of the attitude only the yaw counts. A quaternion of four zeros, which is no attitude, asks for
    none: the bow then points into wind and current.

    Raises
    ------
    MessageError
        Not such a message, a number is not finite or absurd, or the quaternion is neither four
        zeros nor a unit quaternion.
    """
    reader = Reader(payload, GOAL_TYPE)
    stamp_ns, frame_id = read_header(reader)
    x, y, _, qx, qy, qz, qw = reader.values("7d", 8)
    reader.end()
    check_numbers(reader, (x, y, qx, qy, qz, qw))
    heading = None
    if any((qx, qy, qz, qw)):
        heading = euler_from_quaternion(attitude_enu_flu_to_ned_frd(unit(reader, qw, qx, qy, qz)))[
            2
        ]
    return Station(
        stamp_ns=stamp_ns, position_N=np.array((y, x)), heading=heading, frame_id=frame_id
    )


def encode_station(station: Station) -> bytes:
    """Write a geometry_msgs/PoseStamped in ENU; no heading becomes a quaternion of four zeros."""
    writer = Writer()
    write_header(writer, station.stamp_ns, station.frame_id)
    north, east = station.position_N.tolist()
    w = x = y = z = 0.0
    if station.heading is not None:
        q_NB = quaternion_from_euler(0.0, 0.0, station.heading)
        w, x, y, z = attitude_ned_frd_to_enu_flu(q_NB).tolist()
    writer.values("7d", 8, east, north, 0.0, x, y, z, w)
    return writer.payload()


def check_numbers(reader: Reader, numbers: Iterable[float]) -> None:
    """Refuse numbers that are not finite, or greater than anything on the water."""
    for value in numbers:
        if not math.isfinite(value):
            raise reader.fail("a number is not finite")
        if abs(value) > GREATEST:
            raise reader.fail(f"{value:g} cannot be: the greatest number allowed is {GREATEST:g}")


def unit(reader: Reader, w: float, x: float, y: float, z: float) -> Array:
    """Give a unit quaternion, w first; refuse one whose norm is off by more than rounding."""
    norm = math.hypot(w, x, y, z)
    if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
        raise reader.fail(f"an attitude of norm {norm:g} is not a unit quaternion")
    return np.array((w / norm, x / norm, y / norm, z / norm))


# -- `sensor_msgs/Imu`: from FLU axes in an ENU world (REP 103, REP 145) to FRD axes in NED.

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


# -- `sensor_msgs/NavSatFix`: a satellite receiver's position; its covariance from ENU to NED.

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


# -- `nav_msgs/Path`: the way that was sailed, as RViz and Foxglove draw it.

PATH_TYPE: Final = "nav_msgs/msg/Path"
_SMALLEST_POSE: Final = 68
"""[B] A header with an empty frame, and seven numbers, without padding."""
MOST_PLACES: Final = 4096
"""[-] Reading them holds up the control loop for up to 13 ms, where each names a frame of its own;
for 2 ms where all name the same one."""
_HEADER: Final = 12
"""[B] A pose's header before the name of its frame: a stamp, and the name's length."""
_NUMBERS: Final = 7 * 8
"""[B] A position and an attitude."""


def encode_path(p_N: Float64, *, stamp_ns: int, frame_id: str = WORLD_FRAME) -> bytes:
    """Write places, (K, 2) [m] [N], as a nav_msgs/Path in ENU; attitudes mean nothing."""
    writer = Writer()
    write_header(writer, stamp_ns, frame_id)
    writer.values("I", 4, len(p_N))
    for north, east in p_N[:1].tolist():
        _write_pose(writer, stamp_ns, frame_id, (east, north))
    return writer.payload() + _alike(p_N[1:], stamp_ns, frame_id)


def _write_pose(
    writer: Writer, stamp_ns: int, frame_id: str, east_north: tuple[float, float]
) -> None:
    write_header(writer, stamp_ns, frame_id)
    writer.values("7d", 8, *east_north, 0.0, 0.0, 0.0, 0.0, 1.0)


def _alike(p_N: Float64, stamp_ns: int, frame_id: str) -> bytes:
    """Give the poses after the first, which begin at multiples of 8 bytes.

    They differ in two numbers. One by one a thousand would hold up the control loop for 5 ms.
    """
    writer = Writer()
    _write_pose(writer, stamp_ns, frame_id, (0.0, 0.0))
    pose = writer.payload()[HEADER_SIZE:]
    poses = np.frombuffer(bytearray(pose * len(p_N)), np.uint8).reshape(len(p_N), len(pose))
    place = len(pose) - 7 * 8
    east_north = np.ascontiguousarray(p_N[:, ::-1]).astype("<f8")
    poses[:, place : place + 16] = east_north.view(np.uint8).reshape(len(p_N), 16)
    return poses.tobytes()


class Path(NamedTuple):
    """Places in a row."""

    stamp_ns: int
    """[ns] Of the message."""
    places_N: Float64
    """[m] [N] (K, 2) North, east; in another frame than N's, that frame's y and x."""
    frame_ids: tuple[str, ...]
    """The frames that the places are in, each once; empty names are the message's own frame."""


def decode_path(payload: bytes | memoryview) -> Path:
    """Read a nav_msgs/Path.

    Raises
    ------
    MessageError
        Not such a message, a place is not finite or nowhere on earth, or there are too many.
    """
    reader = Reader(payload, PATH_TYPE)
    stamp_ns, frame_of_all = read_header(reader)
    count = reader.count(_SMALLEST_POSE)
    if count > MOST_PLACES:
        raise reader.fail(f"{count} places are too many: at most {MOST_PLACES} are allowed")
    places: list[tuple[float, float]] = []
    frame_ids: dict[str, None] = {}
    while len(places) < count:
        _, frame_id = read_header(reader)
        east, north, *_ = reader.values("7d", 8)
        check_numbers(reader, (east, north))
        places.append((north, east))
        frame_ids[frame_id or frame_of_all] = None
        if len(places) == 1:
            places += _read_alike(reader, count - 1, frame_id)
    reader.end()
    return Path(stamp_ns, np.array(places).reshape(-1, 2), tuple(frame_ids))


def _read_alike(reader: Reader, count: int, frame_id: str) -> list[tuple[float, float]]:
    """Read the poses after the first at once if all of them are in its frame, else none.

    They then have equal lengths and begin at multiples of 8 bytes.
    """
    name = frame_id.encode() + b"\x00"
    before = _HEADER + len(name) + -(_HEADER + len(name)) % 8
    ahead = reader.ahead(count * (before + _NUMBERS))
    if ahead is None or not count:
        return []
    pose = np.dtype(
        {
            "names": ["ns", "length", "name", "x", "y"],
            "formats": [*["u4"] * 2, f"V{len(name)}", *["f8"] * 2],
            "offsets": [4, 8, _HEADER, before, before + 8],
            "itemsize": before + _NUMBERS,
        }
    ).newbyteorder(reader.order)
    poses = np.frombuffer(ahead, pose)
    alike = (poses["length"] == len(name)) & (poses["name"] == np.void(name))
    sound = (poses["ns"] < NANOSECONDS_PER_SECOND) & (abs(poses["x"]) <= GREATEST)
    if not (alike & sound & (abs(poses["y"]) <= GREATEST)).all():
        return []  # one by one: the error names what is wrong
    reader.take(len(ahead))
    return list(zip(poses["y"].tolist(), poses["x"].tolist(), strict=True))


# -- The messages of one or two numbers: thrust, clock, enable, engagement.

THRUST_TYPE: Final = "std_msgs/msg/Float64"
CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
ENGAGEMENT_TYPE: Final = "twinscrew_msgs/msg/Engagement"
ENABLE_TYPE: Final = "std_msgs/msg/Bool"


def encode_thrust(thrust: float) -> bytes:
    """Write a std_msgs/Float64: the force of one propeller [N], ahead positive."""
    if not math.isfinite(thrust):
        raise MessageError(f"a thrust of {thrust} N cannot be sent")
    return HEADER + struct.pack("<d", thrust)


def decode_thrust(payload: bytes | memoryview) -> float:
    """Read a std_msgs/Float64: the force of one propeller [N]; it is finite."""
    reader = Reader(payload, THRUST_TYPE)
    (thrust,) = reader.values("d", 8)
    reader.end()
    if not math.isfinite(thrust):
        raise reader.fail(f"a thrust of {thrust} N")
    return float(thrust)


def encode_clock(stamp_ns: int) -> bytes:
    """Write a rosgraph_msgs/Clock: the simulation's time [ns]."""
    writer = Writer()
    write_stamp(writer, stamp_ns)
    return writer.payload()


def decode_clock(payload: bytes | memoryview) -> int:
    """Read a rosgraph_msgs/Clock: the simulation's time [ns]."""
    reader = Reader(payload, CLOCK_TYPE)
    stamp_ns = read_stamp(reader)
    reader.end()
    return stamp_ns


_ENGAGEMENT: Final = Layout(Engagement, ENGAGEMENT_TYPE, stamp_ns=STAMP, engaged=FLAG)


def encode_engagement(engagement: Engagement) -> bytes:
    """Write a twinscrew_msgs/Engagement."""
    return _ENGAGEMENT.encode(engagement)


def decode_engagement(payload: bytes | memoryview) -> Engagement:
    """Read a twinscrew_msgs/Engagement."""
    return _ENGAGEMENT.decode(payload)


FALLBACK_TYPE: Final = "twinscrew_msgs/msg/Fallback"
RESPONSES: Final = ("none", "slow", "hold", "stop", "hand_over")


_FALLBACK: Final = Layout(
    Fallback, FALLBACK_TYPE, stamp_ns=STAMP, response=choice(RESPONSES, "response"), reason=STRING
)


def encode_fallback(fallback: Fallback) -> bytes:
    """Write a twinscrew_msgs/Fallback."""
    return _FALLBACK.encode(fallback)


def decode_fallback(payload: bytes | memoryview) -> Fallback:
    """Read a twinscrew_msgs/Fallback; a `MessageError` if it is none."""
    return _FALLBACK.decode(payload)


CHART_TYPE: Final = "twinscrew_msgs/msg/Chart"
CHART_KINDS: Final = ("land", "keep_out", "depth", "hazard", "fence")
_SMALLEST_FEATURE: Final = 32
"""[B] A feature without a name and without places, without padding."""


class _Ring(NamedTuple):
    places: Float64


_RINGS: Final = Layout(_Ring, places=array(np.float64, 2)).sequence(4)
_CHART: Final = Layout(
    Chart,
    CHART_TYPE,
    stamp_ns=STAMP,
    safety_depth_m=number("d"),
    features=Layout(
        ChartFeature,
        kind=choice(CHART_KINDS, "kind of feature"),
        keep_in=FLAG,
        depth_m=number("d"),
        radius_m=number("d"),
        name=STRING,
        outline_N=array(np.float64, 2),
        holes_N=Kind(
            lambda reader: tuple(ring.places for ring in _RINGS.read(reader)),
            lambda writer, holes: _RINGS.write(writer, [_Ring(hole) for hole in holes]),
        ),
    ).sequence(_SMALLEST_FEATURE),
)


def encode_chart(chart: Chart) -> bytes:
    """Write a twinscrew_msgs/Chart."""
    return _CHART.encode(chart)


def decode_chart(payload: bytes | memoryview) -> Chart:
    """Read a twinscrew_msgs/Chart; a `MessageError` if it is none."""
    return _CHART.decode(payload)


def encode_enable(enable: bool) -> bytes:
    """Write a std_msgs/Bool: whether the thrusters may be driven."""
    return HEADER + bytes([enable])


def decode_enable(payload: bytes | memoryview) -> bool:
    """Read a std_msgs/Bool: whether the thrusters may be driven."""
    reader = Reader(payload, ENABLE_TYPE)
    enable = reader.flag()
    reader.end()
    return enable
