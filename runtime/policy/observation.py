"""What a policy sees: the ego state, the nearest objects and the edges of what is fixed.

All in the vessel's levelled frame. What is fixed (land, keep-out areas, fences) is seen by a policy
that takes a contour; standing objects that are a part of it are then no objects of their own.

Frame L is B levelled: x forward and y starboard in the horizontal plane, turned by the heading
alone, so that roll and pitch in the waves do not shift what is 15 m away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.charts.contour import SECTORS, contour_of
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.geometry import rotation_2d, rotation_from_quaternion
from twinscrew.runtime.messages.types import (
    OBSERVED_OBJECTS,
    Float32,
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

    perception_range_m: Positive = 60.0
    """[m] An object is seen while its nearest edge is within this, and within what the policy
    knows (`Shown.range_m`)."""
    goal_range_m: Positive = 55.0
    """[m] A goal farther away is shown at this distance, in its direction: 94 of 100 goals of the
    training were nearer, and beyond what was learnt policies no longer heed what is near."""
    own_radius_m: NonNegative = load_vessel().radius_m
    """[m] Radius of the own hull, half its diagonal."""
    charted_m: NonNegative = 1.0
    """[m] A standing object whose centre is within this of something fixed is a part of it, and is
    seen by the contour alone, where the policy takes one."""


DEFAULTS = ObservationSettings()


class Shown(NamedTuple):
    """What a policy takes."""

    objects: int = OBSERVED_OBJECTS
    """[-] K: how many it is shown at most."""
    outlines: bool = False
    """Whether it is shown their outlines."""
    range_m: float = 20.0
    """[m] Farther than this it is shown none, however far the vessel sees (paper, sec. III)."""
    contour_m: float | None = None
    """[m] How far it is shown the edges of what is fixed; None: it is shown none."""


PAPER = Shown()
STANDING_MPS = 0.5
"""[m/s] What is slower stands: also a wall whose pieces seem to move a little."""


def observe(
    odometry: Odometry,
    goal: Goal,
    tracks: Tracks,
    thrust: Float64,
    settings: ObservationSettings = DEFAULTS,
    shown: Shown = PAPER,
    fixed: StaticMap | None = None,
    walls: Float64 | None = None,
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
    shown
        What the policy takes.
    fixed
        What is fixed around the vessel; None: nothing is known of it.
    walls : (S, 2, 2) float64, optional
        Walls that the LiDAR has learnt [m] [N]: edges of the contour like the map's.

    Returns
    -------
    Observation
        Paper, eqs. (2) and (3): nearest objects first by the distance between the hulls' surfaces,
        equal distances in the order of the tracks; zeros and mask 0 where there is none.
    """
    R_NL = rotation_2d(odometry.heading)
    ego = np.empty(7, dtype=np.float32)
    way_N = goal.position_N - odometry.position_N[:2]
    far = settings.goal_range_m / max(float(np.hypot(*way_N)), settings.goal_range_m)
    ego[:2] = (way_N * far) @ R_NL
    ego[2:5] = levelled_twist(odometry)
    ego[5:] = thrust
    objects = np.zeros((shown.objects, 5), dtype=np.float32)
    mask = np.zeros(shown.objects, dtype=np.float32)
    outlines = np.zeros((shown.objects, 3), dtype=np.float32) if shown.outlines else None
    contour = None
    if shown.contour_m is not None:
        contour = _contour(fixed, walls, odometry, shown.contour_m)
    if tracks.id.size:
        p_L = (tracks.p_N - odometry.position_N[:2]) @ R_NL
        nearest = nearest_objects(
            p_L, tracks.radius, settings, shown, _apart(tracks, fixed, settings, shown)
        )
        count = nearest.size
        objects[:count, :2] = p_L[nearest]
        objects[:count, 2:4] = tracks.v_N[nearest] @ R_NL
        objects[:count, 4] = tracks.radius[nearest]
        mask[:count] = 1.0
        if outlines is not None and tracks.half_length is not None:
            outlines[:count] = _outlines(tracks, odometry.heading)[nearest]
    return Observation(ego=ego, objects=objects, mask=mask, outlines=outlines, contour=contour)


def nothing_seen(shown: Shown = PAPER) -> Observation:
    """Give the observation of a vessel at rest, at its goal, with nothing around."""
    k = shown.objects
    return Observation(
        ego=np.zeros(7, dtype=np.float32),
        objects=np.zeros((k, 5), dtype=np.float32),
        mask=np.zeros(k, dtype=np.float32),
        outlines=np.zeros((k, 3), dtype=np.float32) if shown.outlines else None,
        contour=None if shown.contour_m is None else _far(shown.contour_m),
    )


def _far(range_m: float) -> Float32:
    return np.full(SECTORS, range_m, dtype=np.float32)


def _contour(
    fixed: StaticMap | None, walls: Float64 | None, odometry: Odometry, range_m: float
) -> Float32:
    """Give how far off the nearest edge is, (32,) [m]; 0 where the vessel may not be."""
    place, inside = odometry.position_N[:2], False
    edges = [] if walls is None or not len(walls) else [walls]
    if fixed is not None and not fixed.is_empty:
        inside = bool(fixed.forbidden(place[None])[0])
        edges.append(fixed.near(place, range_m))
    if not edges:
        return _far(range_m)
    near = edges[0] if len(edges) == 1 else np.concatenate(edges)
    return contour_of(near, place, odometry.heading, range_m, inside=inside)


def _apart(
    tracks: Tracks, fixed: StaticMap | None, settings: ObservationSettings, shown: Shown
) -> NDArray[np.bool_] | None:
    """Tell which tracks are objects of their own; None: all are."""
    if shown.contour_m is None or fixed is None or fixed.is_empty:
        return None
    moving = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1]) >= STANDING_MPS
    return np.asarray(moving | (fixed.distance_m(tracks.p_N) > settings.charted_m))


def _outlines(tracks: Tracks, heading: float) -> Float64:
    """Give half length, half beam [m] and heading [rad] of tracks in frame L; zeros if unknown."""
    missing = np.full(tracks.id.size, np.nan)
    parts = (tracks.half_length, tracks.half_beam, tracks.heading)
    rows = np.stack([missing if part is None else part for part in parts], axis=1)
    rows[:, 2] = np.remainder(rows[:, 2] - heading + np.pi, 2 * np.pi) - np.pi
    rows[~np.isfinite(rows).all(axis=1)] = 0.0
    return rows


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
    p_L: Float64,
    radius: Float64,
    settings: ObservationSettings = DEFAULTS,
    shown: Shown = PAPER,
    among: NDArray[np.bool_] | None = None,
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Give the indices of the objects to see, nearest surface first, at most as many as are shown.

    Parameters
    ----------
    p_L : (K, 2) float64
        Centres [m], levelled frame L.
    radius : (K,) float64
        Radii [m].
    settings
        Range and own radius.
    shown
        What the policy takes.
    among : (K,) bool
        Which of them are objects at all; None: all.
    """
    surface = np.hypot(p_L[:, 0], p_L[:, 1]) - radius - settings.own_radius_m
    order = np.argsort(surface, kind="stable")
    range_m = min(settings.perception_range_m, shown.range_m)
    seen = surface[order] + settings.own_radius_m <= range_m
    if among is not None:
        seen &= among[order]
    return order[seen][: shown.objects]


def require_finite(observation: Observation) -> None:
    """Raise a `PolicyError` if what was seen is not finite."""
    o = observation
    parts = (o.ego, o.objects, o.outlines, o.contour)
    if not all(np.isfinite(part).all() for part in parts if part is not None):
        raise PolicyError("the observation is not finite")
