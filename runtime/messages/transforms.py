"""`tf2_msgs/TFMessage`: where the frames are, so that a viewer can draw all in one picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from twinscrew.runtime.geometry import attitude_ned_frd_to_enu_flu, enu_to_ned
from twinscrew.runtime.messages.header import VESSEL_FRAME, WORLD_FRAME, write_header
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.messages.wire import Writer

TRANSFORMS_TYPE: Final = "tf2_msgs/msg/TFMessage"


class Transform(NamedTuple):
    """Where a frame is in its parent; both in ROS's axes (ENU, FLU)."""

    parent: str
    child: str
    translation: tuple[float, float, float]
    """[m] Position of the child's origin."""
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """[-] Attitude of the child, a unit quaternion, w first."""


def vessel_transform(
    odometry: Odometry, *, frame_id: str = WORLD_FRAME, child_frame_id: str = VESSEL_FRAME
) -> Transform:
    """Give the vessel's frame in the world, from odometry in NED and FRD."""
    x, y, z = enu_to_ned(odometry.position_N).tolist()
    rotation = tuple(attitude_ned_frd_to_enu_flu(odometry.q_NB).tolist())
    return Transform(frame_id, child_frame_id, (x, y, z), rotation)


def encode_transforms(transforms: Iterable[Transform], *, stamp_ns: int) -> bytes:
    """Write a tf2_msgs/TFMessage."""
    transforms = tuple(transforms)
    writer = Writer()
    writer.values("I", 4, len(transforms))
    for transform in transforms:
        write_header(writer, stamp_ns, transform.parent)
        writer.string(transform.child)
        w, x, y, z = transform.rotation
        writer.values("7d", 8, *transform.translation, x, y, z, w)
    return writer.payload()
