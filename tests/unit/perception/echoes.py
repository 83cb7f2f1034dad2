"""What a sensor sees of posts and walls: exact echoes."""

import numpy as np

from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.sensor import Mount, Sensor, load_sensor

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
MOUNT = Mount(x_m=0.43, y_m=0.0, z_m=1.93)


def sensor(name: str = "vrx32") -> Sensor:
    return load_sensor(name).mounted(MOUNT)


def cloud(points_S: np.ndarray, **more: np.ndarray) -> PointCloud:
    points = np.ascontiguousarray(points_S, np.float32)
    return PointCloud(stamp_ns=7, frame_id="s", points_S=points, **more)


def post(
    s: Sensor, forward: float, starboard: float, radius: float = 0.4, q_NB: np.ndarray = LEVEL
) -> np.ndarray:
    """Give the echoes of an upright cylinder, 0.4 to 1.9 m over the origin, frame S."""
    R_BS, p_BS = (
        rotation_from_quaternion(q_NB) @ s.R_BS,
        rotation_from_quaternion(q_NB) @ s.mount_position_B,
    )
    rays = (s.directions_S().reshape(-1, 3).astype(np.float64)) @ R_BS.T
    centre = np.array([forward, starboard]) - p_BS[:2]
    a = (rays[:, :2] ** 2).sum(axis=1)
    b = rays[:, :2] @ centre
    root = b * b - a * (centre @ centre - radius**2)
    t = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, -1.0)
    height = -(p_BS[2] + t * rays[:, 2])
    hit = (t > 0) & (height > 0.4) & (height < 1.9)
    return (rays[hit] * t[hit][:, None]) @ R_BS


def wall(
    s: Sensor,
    starboard: float,
    q_NB: np.ndarray = LEVEL,
    *,
    low: float = 0.4,
    high: float = 2.0,
    aft: float = -20.0,
    ahead: float = 20.0,
) -> np.ndarray:
    """Give the echoes of a wall along the vessel, from `low` to `high` over the origin, frame S.

    It is to port if `starboard` is negative.
    """
    R_NB = rotation_from_quaternion(q_NB)
    R_NS, p_NS = R_NB @ s.R_BS, R_NB @ s.mount_position_B
    rays = s.directions_S().reshape(-1, 3).astype(np.float64) @ R_NS.T
    across = rays[:, 1] * np.sign(starboard)
    t = np.where(across > 1e-6, abs(starboard - p_NS[1]) / np.maximum(across, 1e-6), -1.0)
    p = rays * t[:, None] + p_NS
    hit = (t > 0) & (p[:, 2] < -low) & (p[:, 2] > -high) & (p[:, 0] > aft) & (p[:, 0] < ahead)
    return (rays[hit] * t[hit][:, None]) @ R_NS
