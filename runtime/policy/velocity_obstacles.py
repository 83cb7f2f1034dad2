"""Velocity obstacles with the sides of the rules of the road: what many boats would use instead.

Every object forbids velocities that would lead into it within a horizon. As in optimal reciprocal
collision avoidance (ORCA), the boundary nearest to the present velocity becomes a half-plane of
allowed ones, and the allowed velocity nearest to the wanted one is found exactly. Others at sea run
other software, so two things differ: the boat takes the whole of an evasion, not half of it, and
the rules say on which side it evades. A head-on or crossing vessel from starboard is left to port;
for a vessel that has to give way itself the boat stands on until there is little time left.

The velocity is then followed as far as the hull can: of the 25 actions that one is taken which, a
moment later, fits it best.

Source of the half-planes: van den Berg, Guy, Lin, Manocha (2011), Reciprocal n-body collision
avoidance, Robotics Research; of the idea of rule sides: Kuwata, Wolf, Zarzhitsky, Huntsberger
(2014), Safe maritime autonomous navigation with COLREGS, using velocity obstacles, IEEE J. Ocean.
Eng. 39 (1).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Literal

import numpy as np

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.observation import Shown
from twinscrew.runtime.policy.planners import Planner, PlannerSettings, seen_objects
from twinscrew.runtime.policy.vessel_model import alignment
from twinscrew.runtime.settings import Count, NonNegative, Positive

Role = Literal["none", "give_way", "stand_on", "overtaking"]
HALF_TURN_TESTS = 40
"""[-] Halvings of the violation where no velocity is allowed: to 1e-9 m/s."""
TIGHT = 1e-9
"""[m/s] What lies outside a half-plane by less lies on its edge."""


class VelocitySettings(PlannerSettings, frozen=True, kw_only=True):
    """How a planner that wants a velocity has it followed, and how the rules see others."""

    nearly_rad: Positive = math.radians(22.5)
    """[rad] Courses are "nearly reciprocal", others "nearly ahead", within this (rule 14)."""
    abaft_rad: Positive = math.radians(112.5)
    """[rad] From the bow: 22.5 degrees abaft the beam (rule 13)."""
    stand_on_s: Positive = 8.0
    """[s] A boat that is to stand on acts when contact is nearer in time than this."""
    objects: Count = 8
    """[-] How many objects it is shown, nearest first,"""
    range_m: Positive = 60.0
    """[m] and how far."""
    arrival_s: Positive = 4.0
    """[s] Near the goal it wants what is left of the way in this time: it does not circle."""
    speed_share: Positive = 0.7
    """[-] Of the top speed that it wants on the way: the rest is left to evade with."""
    speed_weight: NonNegative = 0.3
    """[rad s/m] What a wrong speed along the velocity costs, against a wrong heading."""
    slow_mps: Positive = 0.3
    """[m/s] A slower velocity has no direction: only its size is followed."""
    look_s: Positive = 0.8
    """[s] The velocity is compared so long after the decision."""


class VelocityPlanner(Planner):
    """A planner that says which velocity it wants; the hull follows it as far as it can."""

    settings: VelocitySettings

    @property
    def shown(self) -> Shown:
        """What the planner takes."""
        return Shown(objects=self.settings.objects, range_m=self.settings.range_m)

    @abstractmethod
    def velocity(self, observation: Observation) -> Float64:
        """Give the velocity wanted now, (2,) [m/s], frame B."""

    def costs(self, observation: Observation) -> Float64:
        """Give the difference between the velocity `look_s` later and the one wanted, (25,)."""
        settings = self.settings
        wanted = self.velocity(observation)
        after = self._simulate(observation, steps=1, step_s=settings.look_s)
        size = math.hypot(*wanted)
        if size < settings.slow_mps:
            off: Float64 = after.velocity[0] - wanted
            return np.hypot(off[:, 0], off[:, 1])
        angle, speed = alignment(after.pose[0, :, 2], after.velocity[0], wanted)
        return angle + settings.speed_weight * np.abs(speed - size)


def towards_goal(observation: Observation, settings: VelocitySettings) -> Float64:
    """Give the velocity to the goal with nothing in the way, (2,) [m/s], frame B."""
    goal = observation.ego[:2].astype(np.float64)
    top = settings.speed_share * settings.vessel.top_speed
    far = math.hypot(*goal)
    velocity: Float64 = goal / max(far, 1e-9) * min(far / settings.arrival_s, top)
    return velocity


class OrcaSettings(VelocitySettings, frozen=True, kw_only=True):
    """Horizons and margins."""

    horizon_s: Positive = 10.0
    """[s] A vessel that would be met within this forbids velocities,"""
    static_horizon_s: Positive = 4.0
    """[s] and so does what stands still."""
    clearance_m: NonNegative = 2.0
    """[m] Kept between surfaces: what the hull lacks in following a velocity is in it."""
    escape_s: Positive = 2.0
    """[s] In which it wants to be out of a clearance that it is already within."""


class OrcaPolicy(VelocityPlanner):
    """Velocity obstacles with rule sides."""

    name = "orca"

    def __init__(self, settings: OrcaSettings | None = None) -> None:
        self.settings: OrcaSettings = settings or OrcaSettings()
        super().__init__(self.settings)

    def velocity(self, observation: Observation) -> Float64:
        """Give the velocity wanted now, (2,) [m/s], frame B."""
        return safe_velocity(observation, self.settings)


def safe_velocity(observation: Observation, settings: OrcaSettings) -> Float64:
    """Give the allowed velocity nearest to the one towards the goal, (2,) [m/s], frame B."""
    wanted = towards_goal(observation, settings)
    normals, offsets = half_planes(observation, wanted, settings)
    return nearest_allowed(wanted, normals, offsets, settings.vessel.top_speed)


def half_planes(
    observation: Observation, wanted: Float64, settings: OrcaSettings
) -> tuple[Float64, Float64]:
    """Give the allowed velocities v: normals @ v >= offsets, (K, 2) and (K,) [m/s], frame B.

    Parameters
    ----------
    observation
        What is seen.
    wanted : (2,) float64
        [m/s] The velocity towards the goal: its direction is the course that roles go by, so that
        a boat which has turned out of the way does not change its role by it.
    settings
        Margins, horizons, sides.
    """
    v_own = observation.ego[2:4].astype(np.float64)
    rows = []
    for x, y, v_x, v_y, radius in seen_objects(observation, settings).tolist():
        p, v_other = np.array([x, y]), np.array([v_x, v_y])
        reach = radius + settings.own_radius_m + settings.clearance_m
        static = math.hypot(v_x, v_y) < settings.colregs.min_speed_mps
        role: Role = "none" if static else role_of(p, v_other, wanted, settings)
        horizon_s = settings.static_horizon_s if static else settings.horizon_s
        risk = min(time_to(p, wanted - v_other, reach), time_to(p, v_own - v_other, reach))
        to_starboard = role in ("give_way", "stand_on") and risk <= horizon_s
        if role == "stand_on" and risk > settings.stand_on_s:
            continue
        rows.append(_half_plane(p, v_own, v_other, reach, horizon_s, to_starboard, settings))
    if not rows:
        return np.empty((0, 2)), np.empty(0)
    normals = np.array([normal for normal, _ in rows])
    return normals, np.array([offset for _, offset in rows])


def role_of(p: Float64, v_other: Float64, course: Float64, settings: VelocitySettings) -> Role:
    """Say what the rules ask of the boat towards a moving vessel.

    Parameters
    ----------
    p : (2,) float64
        [m] The other vessel as seen from the boat.
    v_other : (2,) float64
        [m/s] Its velocity.
    course : (2,) float64
        [m/s] The boat's velocity, or the one it wants.
    """
    along, their = math.atan2(course[1], course[0]), math.atan2(v_other[1], v_other[0])
    bearing = _wrapped(math.atan2(p[1], p[0]) - along)
    aspect = _wrapped(math.atan2(-p[1], -p[0]) - their)
    if abs(aspect) > settings.abaft_rad:
        return "overtaking" if math.hypot(*course) > math.hypot(*v_other) else "none"
    if abs(bearing) > settings.abaft_rad:
        return "stand_on"
    head_on = abs(_wrapped(their - along - math.pi)) <= settings.nearly_rad
    if head_on and abs(bearing) <= settings.nearly_rad:
        return "give_way"
    return "give_way" if bearing > 0.0 else "stand_on"


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


def time_to(p: Float64, v: Float64, reach: float) -> float:
    """Give when p (2,) [m] is within `reach` [m] of who goes at v (2,) [m/s]; inf: never."""
    a, b, c = float(v @ v), float(p @ v), float(p @ p) - reach**2
    if c <= 0.0:
        return 0.0
    under = b * b - a * c
    if b <= 0.0 or under < 0.0:
        return math.inf
    return c / (b + math.sqrt(under))


def _half_plane(
    p: Float64,
    v_own: Float64,
    v_other: Float64,
    reach: float,
    horizon_s: float,
    to_starboard: bool,
    settings: OrcaSettings,
) -> tuple[Float64, float]:
    """Give the allowed side of one object's velocity obstacle: normal, offset (see `half_planes`).

    The obstacle is, of relative velocities, the cone of the disc at p with the radius `reach`, from
    the disc at p / horizon on.
    """
    distance = math.hypot(*p)
    ahead = p / max(distance, 1e-9)
    if distance <= reach:
        return -ahead, float(-ahead @ v_other) + (reach - distance) / settings.escape_s
    relative = v_own - v_other
    half = math.asin(reach / distance)
    starboard, port = _turned(ahead, half), _turned(ahead, -half)
    if to_starboard:
        normal = _turned(starboard, math.pi / 2)
        return normal, float(normal @ v_other)
    centre, radius = p / horizon_s, reach / horizon_s
    off = relative - centre
    along = float(off @ ahead)
    # Before the points where the legs touch the disc its arc is nearest, else a leg of the cone.
    if along < 0.0 and along**2 > math.sin(half) ** 2 * float(off @ off):
        normal = off / max(math.hypot(*off), 1e-9)
        return normal, float(normal @ (v_other + centre)) + radius
    side = float(ahead[0] * relative[1] - ahead[1] * relative[0])
    normal = _turned(starboard, math.pi / 2) if side >= 0.0 else _turned(port, -math.pi / 2)
    return normal, float(normal @ v_other)


def _turned(v: Float64, angle: float) -> Float64:
    """Turn a vector clockwise, from x (forward) to y (starboard), by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


# -- The allowed velocity nearest to the wanted one: exact, by the vertices that it can lie on.


def nearest_allowed(
    wanted: Float64, normals: Float64, offsets: Float64, top_speed: float
) -> Float64:
    """Give the v, (2,), nearest to `wanted` where normals @ v >= offsets and |v| <= top_speed.

    Where there is none, the half-planes are all moved by the least distance that leaves one.
    """
    best = _nearest(wanted, normals, offsets, top_speed)
    if best is not None:
        return best
    low, high = 0.0, float(np.max(offsets)) + top_speed
    for _ in range(HALF_TURN_TESTS):
        middle = (low + high) / 2
        if _nearest(wanted, normals, offsets - middle, top_speed) is None:
            low = middle
        else:
            high = middle
    best = _nearest(wanted, normals, offsets - high - TIGHT, top_speed)
    return np.zeros(2) if best is None else best


def _nearest(
    wanted: Float64, normals: Float64, offsets: Float64, top_speed: float
) -> Float64 | None:
    """Give the solution of the quadratic programme of two unknowns; None if nothing is allowed.

    It is the wanted velocity, or its foot on an edge, or a corner of two edges; the disc of the top
    speed is one more edge.
    """
    slower = min(1.0, top_speed / max(math.hypot(*wanted), 1e-9))
    candidates = [wanted[None], slower * wanted[None]]
    if len(normals):
        candidates.append(wanted + normals * (offsets - normals @ wanted)[:, None])
        candidates += [_on_circle(normals, offsets, top_speed), _corners(normals, offsets)]
    v = np.concatenate(candidates)
    allowed = np.hypot(v[:, 0], v[:, 1]) <= top_speed + TIGHT
    if len(normals):
        allowed &= (v @ normals.T >= offsets - TIGHT).all(axis=1)
    if not allowed.any():
        return None
    v = v[allowed]
    best: Float64 = v[int(np.hypot(*(v - wanted).T).argmin())]
    return best


def _on_circle(normals: Float64, offsets: Float64, radius: float) -> Float64:
    """Give where edges cross the circle of the top speed, (n, 2)."""
    there = np.abs(offsets) <= radius
    foot = normals[there] * offsets[there, None]
    along = np.column_stack([-normals[there, 1], normals[there, 0]])
    half = np.sqrt(radius**2 - offsets[there] ** 2)[:, None]
    return np.concatenate([foot + half * along, foot - half * along])


def _corners(normals: Float64, offsets: Float64) -> Float64:
    """Give where edges cross each other, (n, 2)."""
    i, j = np.triu_indices(len(normals), 1)
    a, b = normals[i], normals[j]
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    there = np.abs(cross) > 1e-12
    a, b, cross = a[there], b[there], cross[there]
    at_a, at_b = offsets[i][there], offsets[j][there]
    return np.column_stack(
        [
            (at_a * b[:, 1] - at_b * a[:, 1]) / cross,
            (at_b * a[:, 0] - at_a * b[:, 0]) / cross,
        ]
    )
