"""Where the frames are, so that RViz and Foxglove draw a recording in one picture.

Recorded only, never published: a boat or a VRX has its own publisher of /tf.
"""

from __future__ import annotations

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import flu_to_frd, quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import VESSEL_FRAME
from twinscrew.runtime.messages.visual import Transform, vessel_transform
from twinscrew.runtime.perception.sensor import Sensor


class Frames:
    """Follows the vessel's pose and the LiDAR's frame through the messages that come in."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._lidar: Transform | None = None

    def see(self, topic: str, payload: bytes) -> bytes | None:
        """Look at a message; gives the transforms to record after odometry, else None."""
        try:
            if topic == "points" and self._lidar is None:
                self._lidar = self._mount(cdr.decode_point_cloud(payload).frame_id)
            if topic != "odometry":
                return None
            odometry = cdr.decode_odometry(payload)
        except MessageError:  # the core says so
            return None
        frames = [vessel_transform(odometry)]
        if self._lidar is not None:
            frames.append(self._lidar)
        return cdr.encode_transforms(frames, stamp_ns=odometry.stamp_ns)

    def _mount(self, frame_id: str) -> Transform | None:
        """Give the LiDAR's frame in the vessel's; both FLU."""
        mount = self._sensor.mount
        if mount is None or frame_id in ("", VESSEL_FRAME):
            return None
        q = quaternion_from_euler(mount.roll_rad, mount.pitch_rad, mount.yaw_rad)
        x, y, z = flu_to_frd(self._sensor.mount_position_B).tolist()
        return Transform(VESSEL_FRAME, frame_id, (x, y, z), tuple(q.tolist()))
