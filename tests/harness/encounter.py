"""Vessels of the 3-DoF model that meet, each under the same policy, seeing where all is.

Of radii they see 0.8, as in the training environment.
"""

import numpy as np

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Goal, Observation, Odometry, Tracks
from twinscrew.runtime.policy.observation import observe
from twinscrew.runtime.policy.vessel_model import VesselModel

RADIUS = 2.8


def observation(ego=(30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), objects=(), room=5):
    rows = np.zeros((room, 5), dtype=np.float32)
    mask = np.zeros(room, dtype=np.float32)
    for k, row in enumerate(objects):
        rows[k], mask[k] = row, 1.0
    return Observation(ego=np.array(ego, dtype=np.float32), objects=rows, mask=mask)


def _seen(i, pose, nu, thrust, goals, buoys):
    others = [j for j in range(len(pose)) if j != i]
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    v_N = np.column_stack([c * nu[:, 0] - s * nu[:, 1], s * nu[:, 0] + c * nu[:, 1]])
    count = len(others) + len(buoys)
    tracks = Tracks(
        stamp_ns=0,
        id=np.arange(count),
        p_N=np.concatenate([pose[others, :2], buoys[:, :2]]),
        v_N=np.concatenate([v_N[others], np.zeros((len(buoys), 2))]),
        radius=0.8 * np.concatenate([np.full(len(others), RADIUS), buoys[:, 2]]),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )
    odometry = Odometry(
        stamp_ns=0,
        position_N=np.append(pose[i, :2], 0.0),
        q_NB=quaternion_from_euler(0.0, 0.0, pose[i, 2]),
        velocity_B=np.append(nu[i, :2], 0.0),
        rates_B=np.array([0.0, 0.0, nu[i, 2]]),
    )
    return observe(odometry, Goal(stamp_ns=0, position_N=goals[i]), tracks, thrust[i])


def sail(policy, starts, goals, seconds, buoys=()):
    """Give poses (T, V, 3), every half second, until `seconds` have passed.

    Buoys are rows of north, east, radius.
    """
    buoys = np.array(buoys, dtype=float).reshape(-1, 3)
    model = VesselModel()
    pose, goals = np.array(starts, dtype=float), np.array(goals, dtype=float)
    nu, thrust = np.zeros((len(pose), 3)), np.zeros((len(pose), 2))
    path = [pose]
    for _ in range(int(seconds / policy.period_s)):
        rates = [policy.act(_seen(i, pose, nu, thrust, goals, buoys)) for i in range(len(pose))]
        thrust = model.apply(thrust, np.array(rates), policy.period_s)
        for _ in range(10):
            pose, nu = model.step(pose, nu, thrust, policy.period_s / 10)
        path.append(pose)
    return np.array(path)


def gap(path):
    """Give the least distance between the two vessels' circles."""
    apart = path[:, 0, :2] - path[:, 1, :2]
    return np.hypot(apart[:, 0], apart[:, 1]).min() - 2 * RADIUS
