"""ROS 2 messages in CDR: one `encode_x` / `decode_x` pair a type.

Everything that comes in is checked, and turned from ENU and FLU to NED and FRD; everything that
goes out is turned back. A payload that is not the message it should be is a `MessageError`.
"""

from twinscrew.runtime.messages.decision import (
    decode_decision,
    decode_explanation,
    encode_decision,
    encode_explanation,
)
from twinscrew.runtime.messages.navigation import (
    decode_clock,
    decode_enable,
    decode_engagement,
    decode_fallback,
    decode_fix,
    decode_goal,
    decode_imu,
    decode_odometry,
    decode_path,
    decode_thrust,
    encode_clock,
    encode_enable,
    encode_engagement,
    encode_fallback,
    encode_fix,
    encode_goal,
    encode_imu,
    encode_odometry,
    encode_path,
    encode_thrust,
)
from twinscrew.runtime.messages.point_cloud import decode_point_cloud, encode_point_cloud
from twinscrew.runtime.messages.visual import (
    Shape,
    Transform,
    decode_diagnostics,
    encode_diagnostics,
    encode_object_markers,
    encode_shapes,
    encode_track_markers,
    encode_transforms,
    vessel_transform,
)

__all__ = [
    "Shape",
    "Transform",
    "decode_clock",
    "decode_decision",
    "decode_diagnostics",
    "decode_enable",
    "decode_engagement",
    "decode_explanation",
    "decode_fallback",
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
    "encode_enable",
    "encode_engagement",
    "encode_explanation",
    "encode_fallback",
    "encode_fix",
    "encode_goal",
    "encode_imu",
    "encode_object_markers",
    "encode_odometry",
    "encode_path",
    "encode_point_cloud",
    "encode_shapes",
    "encode_thrust",
    "encode_track_markers",
    "encode_transforms",
    "vessel_transform",
]
