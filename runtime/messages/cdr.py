"""ROS 2 messages in CDR: one `encode_x` / `decode_x` pair a type.

Everything that comes in is checked, and turned from ENU and FLU to NED and FRD; everything that
goes out is turned back. A payload that is not the message it should be is a `MessageError`.
"""

from twinscrew.runtime.messages.cloud import decode_point_cloud, encode_point_cloud
from twinscrew.runtime.messages.decision import decode_decision, encode_decision
from twinscrew.runtime.messages.diagnostics import decode_diagnostics, encode_diagnostics
from twinscrew.runtime.messages.explanation import decode_explanation, encode_explanation
from twinscrew.runtime.messages.imu import decode_imu, encode_imu
from twinscrew.runtime.messages.markers import encode_object_markers, encode_track_markers
from twinscrew.runtime.messages.navsat import decode_fix, encode_fix
from twinscrew.runtime.messages.odometry import (
    decode_goal,
    decode_odometry,
    encode_goal,
    encode_odometry,
)
from twinscrew.runtime.messages.path import decode_path, encode_path
from twinscrew.runtime.messages.simple import (
    decode_clock,
    decode_engagement,
    decode_thrust,
    encode_clock,
    encode_engagement,
    encode_thrust,
)
from twinscrew.runtime.messages.transforms import Transform, encode_transforms, vessel_transform

__all__ = [
    "Transform",
    "decode_clock",
    "decode_decision",
    "decode_diagnostics",
    "decode_engagement",
    "decode_explanation",
    "decode_fix",
    "decode_goal",
    "decode_imu",
    "decode_odometry",
    "decode_path",
    "decode_point_cloud",
    "decode_thrust",
    "encode_clock",
    "encode_decision",
    "encode_diagnostics",
    "encode_engagement",
    "encode_explanation",
    "encode_fix",
    "encode_goal",
    "encode_imu",
    "encode_object_markers",
    "encode_odometry",
    "encode_path",
    "encode_point_cloud",
    "encode_thrust",
    "encode_track_markers",
    "encode_transforms",
    "vessel_transform",
]
