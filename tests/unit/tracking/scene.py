"""Objects that move as told, and what a perfect segmentation would say of them."""

import numpy as np

from twinscrew.runtime.geometry import quaternion_from_euler, rotation_2d
from twinscrew.runtime.messages.types import Objects, Odometry

SECOND = 1_000_000_000
SCAN = SECOND // 10


def odometry(stamp_ns=0, north=0.0, east=0.0, yaw=0.0):
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=np.array([north, east, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, yaw),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def objects(p_N, ego, radius=1.0, points=200):
    """Objects with centres at p_N (K, 2), as seen from the ego vessel."""
    p_N = np.asarray(p_N, dtype=np.float64).reshape(-1, 2)
    R_NL = rotation_2d(ego.heading)
    count = len(p_N)
    return Objects(
        stamp_ns=ego.stamp_ns,
        p_L=(p_N - ego.position_N[:2]) @ R_NL,
        radius=np.full(count, radius) if np.isscalar(radius) else np.asarray(radius, dtype=float),
        points=np.full(count, points, dtype=np.int64),
    )


def follow(tracker, path, scans, *, sigma=0.0, seed=0, ego=odometry, radius=1.0, hidden=None):
    """Feed `scans` scans of objects at path(t) (K, 2) to a tracker; give all its answers.

    `hidden(t)` names the rows of path that are not seen.
    """
    rng = np.random.default_rng(seed)
    answers = []
    for k in range(scans):
        t = 0.1 * k
        seen = np.asarray(path(t), dtype=np.float64).reshape(-1, 2)
        if hidden is not None:
            seen = np.delete(seen, hidden(t), axis=0)
        here = ego(stamp_ns=k * SCAN)
        noisy = seen + sigma * rng.standard_normal(seen.shape)
        answers.append(tracker.step(objects(noisy, here, radius), here))
    return answers
