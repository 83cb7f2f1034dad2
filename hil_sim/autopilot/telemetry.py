"""What the simulated autopilot tells: one function a message, and who wants which how often."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.rover import Mode, Rover
from twinscrew.runtime.datum import EARTH_RADIUS_M
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_from_quaternion
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.settings import Settings

_RECEIVER = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_AHRS
)


_STATES = {
    Mode.HOLD: mavlink.MAV_STATE_STANDBY,
    Mode.INITIALISING: mavlink.MAV_STATE_CALIBRATING,
}
"""What the heartbeat says of a mode; of any other, that it is active (read: Rover/GCS_Mavlink)."""


class Origin(Settings, frozen=True):
    """Where the local frame's origin lies on the earth."""

    latitude_deg: float = -33.7221
    """[deg] VRX's Sydney Regatta Centre."""
    longitude_deg: float = 150.6739
    """[deg]"""
    altitude_m: float = 1.15
    """[m] Above mean sea level."""


@dataclass(frozen=True, slots=True)
class Moment:
    """Everything a message may tell of, at one time."""

    rover: Rover
    vehicle: Odometry | None
    origin: Origin
    now_s: float

    @property
    def boot_ms(self) -> int:
        """[ms] Time since boot, wrapped as MAVLink's uint32."""
        return round((self.now_s - self.rover.boot_s) * 1000) & 0xFFFFFFFF


def heartbeat(moment: Moment) -> Message:
    """Tell who it is, its mode, whether it is armed (type 11: a boat)."""
    rover = moment.rover
    mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if rover.mode is Mode.MANUAL:
        mode |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    if rover.armed:
        mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    state = _STATES.get(rover.mode, mavlink.MAV_STATE_ACTIVE)
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_SURFACE_BOAT if rover.is_boat else mavlink.MAV_TYPE_GROUND_ROVER,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        mode,
        int(rover.mode),
        mavlink.MAV_STATE_CRITICAL if rover.failsafe else state,
        3,  # MAVLink's own version number in this message
    )


def sys_status(moment: Moment) -> Message:
    """Tell which sensors are there and well."""
    receiver = _RECEIVER if moment.rover.radio.receiver else 0
    present = _SENSORS | receiver
    load, millivolt, centiampere, percent = 0, 12_600, -1, -1
    return mavlink.MAVLink_sys_status_message(
        present, present, present, load, millivolt, centiampere, percent, 0, 0, 0, 0, 0, 0
    )


def servo_output_raw(moment: Moment) -> Message:
    """Tell what really drives the outputs."""
    time_us = moment.boot_ms * 1000 & 0xFFFFFFFF
    outputs = moment.rover.servo_outputs()
    return mavlink.MAVLink_servo_output_raw_message(time_us, 0, *outputs)


def rc_channels(moment: Moment) -> Message:
    """Tell the pilot's channels: the last values, however old."""
    values = moment.rover.radio.values
    count = len(values) if any(values) else 0
    return mavlink.MAVLink_rc_channels_message(moment.boot_ms, count, *values, 0, 0, 255)


def attitude(moment: Moment) -> Message | None:
    """Tell roll, pitch, yaw and their rates."""
    if moment.vehicle is None:
        return None
    roll, pitch, yaw = euler_from_quaternion(moment.vehicle.q_NB)
    p, q, r = (float(rate) for rate in moment.vehicle.rates_B)
    return mavlink.MAVLink_attitude_message(moment.boot_ms, roll, pitch, yaw, p, q, r)


def local_position_ned(moment: Moment) -> Message | None:
    """Tell position and velocity in the local frame."""
    if moment.vehicle is None:
        return None
    position = (float(p) for p in moment.vehicle.position_N)
    return mavlink.MAVLink_local_position_ned_message(
        moment.boot_ms, *position, *_velocity_N(moment.vehicle)
    )


def odometry(moment: Moment) -> Message | None:
    """Tell everything in one message. ArduRover sends none: it is here to try other autopilots'."""
    vehicle = moment.vehicle
    if vehicle is None:
        return None
    unknown = [math.nan, *[0.0] * 20]
    numbers = np.concatenate([vehicle.velocity_B, vehicle.rates_B]).tolist()
    return mavlink.MAVLink_odometry_message(
        moment.boot_ms * 1000,
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_BODY_FRD,
        *vehicle.position_N.tolist(),
        vehicle.q_NB.tolist(),
        *numbers,
        unknown,
        unknown,
    )


def global_position_int(moment: Moment) -> Message | None:
    """Tell position on the earth, speed over ground, heading."""
    if moment.vehicle is None:
        return None
    north, east, down = (float(p) for p in moment.vehicle.position_N)
    origin = moment.origin
    circle_m = EARTH_RADIUS_M * math.cos(math.radians(origin.latitude_deg))
    latitude = origin.latitude_deg + math.degrees(north / EARTH_RADIUS_M)
    longitude = origin.longitude_deg + math.degrees(east / circle_m)
    vx, vy, vz = (round(100.0 * v) for v in _velocity_N(moment.vehicle))
    return mavlink.MAVLink_global_position_int_message(
        moment.boot_ms,
        round(latitude * 1e7),
        round(longitude * 1e7),
        round((origin.altitude_m - down) * 1000),
        round(-down * 1000),
        vx,
        vy,
        vz,
        round(math.degrees(moment.vehicle.heading) * 100) % 36_000,
    )


def gps_global_origin(moment: Moment) -> Message:
    """Tell where on the earth the local frame's origin lies."""
    origin = moment.origin
    return mavlink.MAVLink_gps_global_origin_message(
        round(origin.latitude_deg * 1e7),
        round(origin.longitude_deg * 1e7),
        round(origin.altitude_m * 1000),
        moment.boot_ms * 1000,
    )


def system_time(moment: Moment) -> Message:
    """Tell the time since boot (there is no date in a simulation)."""
    return mavlink.MAVLink_system_time_message(0, moment.boot_ms)


def autopilot_version(_: Moment) -> Message:
    """Tell version and capabilities: that of the ArduRover whose behaviour was measured."""
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    version = 4 << 24 | 6 << 16 | mavlink.FIRMWARE_VERSION_TYPE_DEV
    none = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, none, none, none, 0, 0, 0
    )


def water_depth(moment: Moment) -> Message | None:
    """Tell the depth of the water, if there is an echo sounder: SIM_DEPTH, ours, greater than 0."""
    depth_m = moment.rover.parameters["SIM_DEPTH"]
    if depth_m <= 0.0:
        return None
    place = (0, 0, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAVLink_water_depth_message(moment.boot_ms, 0, 1, *place, depth_m, 15.0)


TELLERS: dict[int, Callable[[Moment], Message | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: odometry,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: servo_output_raw,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: rc_channels,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    mavlink.MAVLINK_MSG_ID_WATER_DEPTH: water_depth,
}
"""Every message that can be asked for, by its id."""

STREAMED = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
    mavlink.MAVLINK_MSG_ID_WATER_DEPTH,
)
"""Messages that ArduRover sends unasked, in streams: SRn_EXT_STAT, EXTRA3, EXTRA1, POSITION,
RC_CHAN. Read in its sources, Rover/GCS_Mavlink.cpp."""
DEFAULT_INTERVAL_S = 1.0
"""[s] SRn_* = 1: ArduRover's streams unless somebody sets them otherwise."""


def _velocity_N(vehicle: Odometry) -> list[float]:
    velocity = rotation_from_quaternion(vehicle.q_NB) @ vehicle.velocity_B
    return [float(v) for v in velocity]
