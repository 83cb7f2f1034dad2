"""COLREGs between two vessels: who meets whom how, and where the give-way vessel should steer.

Rules 14 (head-on) and 15 (crossing) of the COLREGs as the paper states them (sec. V, "Training RL
agents") with the zones of the authors' code. Everything is batched over leading dimensions and
given in ONE frame with x forward and y starboard (clockwise angles), usually the ego vessel's.
No trigonometry is needed to classify: at multiples of pi/4 an angle's cosine and sine compare.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings


class Situation(IntEnum):
    """What the rules ask of the ego vessel."""

    NONE = 0
    """Nothing: no encounter, or the ego vessel is to stand on."""
    HEAD_ON = 1
    """Rule 14: both vessels alter course to starboard."""
    GIVE_WAY = 2
    """Rule 15: the other is on the ego's starboard side; the ego keeps out of its way."""


class ColregsSettings(Settings, frozen=True):
    """Zones in the frame of the other vessel, x along ITS VELOCITY (the authors' code)."""

    head_on_ahead_m: Positive = 17.0
    """[m] The head-on zone reaches from the other vessel this far ahead of it."""
    head_on_half_width_m: Positive = 4.5
    """[m] And this far to either side."""
    crossing_ahead_m: Positive = 12.0
    """[m] The crossing zone lies on the port side, from this far ahead"""
    crossing_astern_m: Positive = 9.0
    """[m] to this far astern,"""
    crossing_port_m: Positive = 17.0
    """[m] this wide,"""
    crossing_corner_m: Positive = 7.0
    """[m] without the triangle ahead of the line from (0, 0) to (crossing_ahead, -this)."""
    min_speed_mps: NonNegative = 0.5
    """[m/s] Nothing is checked if either moves slower (paper, sec. IV)."""
    clearance_m: NonNegative = 1.0
    """[m] The compliant course passes the other's circle by this much."""


DEFAULT = ColregsSettings()
_TINY = float(np.finfo(np.float32).tiny)


def _corners(settings: ColregsSettings) -> tuple[Float64, Float64]:
    """Give the corners of the zones that `in_head_on_zone` and `in_crossing_zone` test."""
    ahead, half = settings.head_on_ahead_m, settings.head_on_half_width_m
    head_on = [(0.0, -half), (ahead, -half), (ahead, half), (0.0, half)]
    ahead, astern = settings.crossing_ahead_m, -settings.crossing_astern_m
    port, corner = -settings.crossing_port_m, -settings.crossing_corner_m
    crossing = [(astern, 0.0), (0.0, 0.0), (ahead, corner), (ahead, port), (astern, port)]
    return np.array(head_on), np.array(crossing)


def situation(
    p: Float64, v_other: Float64, v_ego: Float64, settings: ColregsSettings = DEFAULT
) -> NDArray[np.int8]:
    """Classify encounters.

    Parameters
    ----------
    p : (..., 2) float
        [m] The other vessel as seen from the ego vessel.
    v_other, v_ego : (..., 2) float
        [m/s] Velocities over ground, in the same frame.

    Returns
    -------
    situation : (...) int8
        Values of `Situation`.
    """
    dot = v_other[..., 0] * v_ego[..., 0] + v_other[..., 1] * v_ego[..., 1]
    cross = v_other[..., 0] * v_ego[..., 1] - v_other[..., 1] * v_ego[..., 0]
    speed = np.hypot(v_other[..., 0], v_other[..., 1])
    slower = np.minimum(speed, np.hypot(v_ego[..., 0], v_ego[..., 1]))
    moving = slower >= settings.min_speed_mps
    x, y = _ego_seen_by_other(p, v_other, speed)
    opposite = dot < -np.abs(cross)  # |angle(V_other -> V_ego)| > 3 pi / 4
    to_starboard = (cross >= np.abs(dot)) & (cross > 0)  # angle in [pi / 4, 3 pi / 4]
    head_on = moving & opposite & in_head_on_zone(x, y, settings)
    give_way = moving & to_starboard & in_crossing_zone(x, y, settings)
    # The two exclude each other, and the values of `Situation` are 1 and 2.
    return head_on.astype(np.int8) + 2 * give_way.astype(np.int8)


def in_head_on_zone(
    x: Float64, y: Float64, settings: ColregsSettings = DEFAULT
) -> NDArray[np.bool_]:
    """Tell whether (x, y) [m], x along the other's velocity, lies in its head-on zone."""
    ahead = (x >= 0.0) & (x <= settings.head_on_ahead_m)
    inside: NDArray[np.bool_] = ahead & (np.abs(y) <= settings.head_on_half_width_m)
    return inside


def in_crossing_zone(
    x: Float64, y: Float64, settings: ColregsSettings = DEFAULT
) -> NDArray[np.bool_]:
    """Tell whether (x, y) [m], x along the other's velocity, lies where it must be given way."""
    along = (x >= -settings.crossing_astern_m) & (x <= settings.crossing_ahead_m)
    to_port = (y <= 0.0) & (y >= -settings.crossing_port_m)
    slope = settings.crossing_corner_m / settings.crossing_ahead_m
    corner = y + settings.crossing_corner_m > -slope * (x - settings.crossing_ahead_m)
    inside: NDArray[np.bool_] = along & to_port & ~corner
    return inside


HEAD_ON_ZONE, CROSSING_ZONE = _corners(DEFAULT)
"""[m] (K, 2) The zones' corners: x along the other vessel's velocity, y to its starboard."""


def compliant_course(
    p: Float64, radius: Float64, ego_radius: Float64 | float, settings: ColregsSettings = DEFAULT
) -> Float64:
    """Give the course that passes the other vessel on its starboard side of the line of sight.

    Parameters
    ----------
    p : (..., 2) float
        [m] The other vessel as seen from the ego vessel.
    radius : (...) float
        [m] The other vessel's radius.
    ego_radius : float
        [m] The ego vessel's radius.

    Returns
    -------
    course : (...) float64
        [rad] Clockwise from the frame's x axis, not wrapped. Within the clearance of the other's
        circle it is its limit there: straight away from the other.
    """
    keep_off = np.asarray(radius) + settings.clearance_m
    distance = np.maximum(np.hypot(p[..., 0], p[..., 1]), keep_off)  # guard: d <= r_obj + 1
    tangent = np.sqrt(np.maximum(distance**2 - keep_off**2, 0.0))
    bearing = np.arctan2(p[..., 1], p[..., 0])
    course: Float64 = bearing + np.arcsin(keep_off / distance) + np.arctan2(ego_radius, tangent)
    return course


def starboard_turn(
    p: Float64,
    radius: Float64,
    v_ego: Float64,
    ego_radius: Float64 | float,
    settings: ColregsSettings = DEFAULT,
) -> Float64:
    """Give max(delta, 0) [rad]: how far to starboard the ego's course falls short of the compliant.

    Arguments as of `compliant_course`, with `v_ego` (..., 2) [m/s] in the same frame.
    """
    course = np.arctan2(v_ego[..., 1], v_ego[..., 0])
    delta = compliant_course(p, radius, ego_radius, settings) - course
    wrapped = np.remainder(delta + np.pi, 2 * np.pi) - np.pi
    turn: Float64 = np.maximum(wrapped, 0.0)
    return turn


def _ego_seen_by_other(p: Float64, v_other: Float64, speed: Float64) -> tuple[Float64, Float64]:
    """Give the ego's position [m] in the other's frame with x along its velocity."""
    speed = np.maximum(speed, _TINY)
    x = -(p[..., 0] * v_other[..., 0] + p[..., 1] * v_other[..., 1]) / speed
    y = -(v_other[..., 0] * p[..., 1] - v_other[..., 1] * p[..., 0]) / speed
    return x, y
