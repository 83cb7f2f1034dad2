"""What a policy sees: the ego state and the nearest objects in the vessel's levelled frame.

Frame L is B levelled: x forward and y starboard in the horizontal plane, turned by the heading
alone, so that roll and pitch in the waves do not shift what is 15 m away.
"""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.geometry import rotation_2d, rotation_from_quaternion
from twinscrew.runtime.messages.types import (
    OBSERVED_OBJECTS,
    Float64,
    Goal,
    Observation,
    Odometry,
    Tracks,
)
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel


class ObservationSettings(Settings, frozen=True, kw_only=True):
    """Which objects a policy sees."""

    perception_range_m: Positive = 20.0
    """[m] An object is seen while its nearest edge is within this (paper, sec. III)."""
    goal_range_m: Positive = 55.0
    """[m] A goal farther away is shown at this distance, in its direction: 94 of 100 goals of the
    training were nearer, and beyond what was learnt policies no longer heed what is near."""
    own_radius_m: NonNegative = load_vessel().radius_m
    """[m] Radius of the own hull, half its diagonal."""


DEFAULTS = ObservationSettings()


def observe(
    odometry: Odometry,
    goal: Goal,
    tracks: Tracks,
    thrust: Float64,
    settings: ObservationSettings = DEFAULTS,
) -> Observation:
    """Say what the vessel knows in the frame its policy was trained in.

    Parameters
    ----------
    odometry
        The vessel's state at the tracks' stamp.
    goal
        Where it has to go.
    tracks
        What is around it.
    thrust : (2,) float64
        The present command [N], left and right.
    settings
        Which objects are seen.

    Returns
    -------
    Observation
        Paper, eqs. (2) and (3): nearest objects first by the distance between the hulls' surfaces,
        equal distances in the order of the tracks; zeros and mask 0 where there is none.
    """
    R_NL = rotation_2d(odometry.heading)
    ego = np.empty(7, dtype=np.float32)
    ego[:2] = _within(goal.position_N - odometry.position_N[:2], settings.goal_range_m) @ R_NL
    ego[2:5] = levelled_twist(odometry)
    ego[5:] = thrust
    objects = np.zeros((OBSERVED_OBJECTS, 5), dtype=np.float32)
    mask = np.zeros(OBSERVED_OBJECTS, dtype=np.float32)
    if tracks.id.size:
        p_L = (tracks.p_N - odometry.position_N[:2]) @ R_NL
        nearest = nearest_objects(p_L, tracks.radius, settings)
        count = nearest.size
        objects[:count, :2] = p_L[nearest]
        objects[:count, 2:4] = tracks.v_N[nearest] @ R_NL
        objects[:count, 4] = tracks.radius[nearest]
        mask[:count] = 1.0
    return Observation(ego=ego, objects=objects, mask=mask)


def _within(d_N: Float64, range_m: float) -> Float64:
    """Shorten a vector, (2,) [m], that is longer than the range."""
    return d_N * (range_m / max(float(np.hypot(*d_N)), range_m))


def levelled_twist(odometry: Odometry) -> Float64:
    """Give surge [m/s], sway [m/s] and yaw rate [rad/s] in the levelled frame, (3,).

    The yaw rate is the vertical component of the angular velocity: unlike the derivative of the
    heading, it has no singularity at a pitch of 90 degrees.
    """
    R_NB = rotation_from_quaternion(odometry.q_NB)
    velocity_N = R_NB @ odometry.velocity_B
    horizontal = velocity_N[:2] @ rotation_2d(odometry.heading)
    return np.array([horizontal[0], horizontal[1], R_NB[2] @ odometry.rates_B])


def nearest_objects(
    p_L: Float64, radius: Float64, settings: ObservationSettings = DEFAULTS
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Give the indices of the objects to see, nearest surface first, at most `OBSERVED_OBJECTS`.

    Parameters
    ----------
    p_L : (K, 2) float64
        Centres [m], levelled frame L.
    radius : (K,) float64
        Radii [m].
    settings
        Range and own radius.
    """
    surface = np.hypot(p_L[:, 0], p_L[:, 1]) - radius - settings.own_radius_m
    order = np.argsort(surface, kind="stable")
    seen = surface[order] + settings.own_radius_m <= settings.perception_range_m
    return order[seen][:OBSERVED_OBJECTS]


def require_finite(observation: Observation) -> None:
    """Raise a `PolicyError` if what was seen is not finite."""
    if not (np.isfinite(observation.ego).all() and np.isfinite(observation.objects).all()):
        raise PolicyError("the observation is not finite")
