"""What a manoeuvre of the own vessel leads to: its path, what it meets, what wind and current add.

The assurance asks this. The vessel moves in three degrees of freedom (Fossen (2021), chapters 3 and
6), objects go straight on; runtime/native/assurance.hpp does the work. Derivation:
docs/assurance.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Final, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime import _native
from twinscrew.runtime._native import Law
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Odometry, Tracks
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import Circle, VesselDescription, load_vessel

Three = tuple[NonNegative, NonNegative, NonNegative]


def surge_sway_yaw(six: tuple[float, ...]) -> tuple[float, float, float]:
    """Take three of six numbers: surge, sway, yaw."""
    return six[0], six[1], six[5]


def close_circles(vessel: VesselDescription) -> tuple[Circle, ...]:
    """Cover a hull's rectangle by equal circles that reach a tenth beyond its sides at most."""
    count = math.ceil(vessel.length_m / (0.458 * vessel.beam_m))
    step = vessel.length_m / count
    radius = round(math.hypot(step, vessel.beam_m) / 2.0, 3)
    return tuple(((i + 0.5) * step - vessel.length_m / 2.0, radius) for i in range(count))


_DEFAULT = load_vessel()


class AssuranceVessel(Settings, frozen=True):
    """What is assumed of the own vessel; by default, what its description says."""

    inertia: tuple[Positive, Positive, Positive] = _DEFAULT.plane_inertia
    """[kg, kg, kg m2] In surge, sway and yaw, added mass included."""
    linear_drag: Three = surge_sway_yaw(_DEFAULT.linear_drag)
    """[kg/s, kg/s, kg m2/s] In surge, sway and yaw, positive."""
    quadratic_drag: Three = surge_sway_yaw(_DEFAULT.quadratic_drag)
    """[kg/m, kg/m, kg m2] The same, of the square."""
    lever_m: Positive = _DEFAULT.lever_m
    """[m] From the centre line to a propeller."""
    hull: Annotated[tuple[Circle, ...], Meta(min_length=1)] = _DEFAULT.circles_m
    """[m] Circles that cover the hull: how far ahead of the origin, radius."""
    close_hull: Annotated[tuple[Circle, ...], Meta(min_length=1)] = close_circles(_DEFAULT)
    """[m] The same, closer, for what is charted: a gap of 1.6 beams has no room for wide ones."""

    @classmethod
    def of(cls, vessel: VesselDescription) -> AssuranceVessel:
        """Take the numbers of a vessel's description."""
        return cls(
            inertia=vessel.plane_inertia,
            linear_drag=surge_sway_yaw(vessel.linear_drag),
            quadratic_drag=surge_sway_yaw(vessel.quadratic_drag),
            lever_m=vessel.lever_m,
            hull=vessel.circles_m,
            close_hull=close_circles(vessel),
        )

    @property
    def extent_m(self) -> float:
        """[m] No part of the hull is farther from the origin."""
        return max(abs(ahead) + radius for ahead, radius in self.hull)

    @property
    def close_extent_m(self) -> float:
        """[m] The same of the circles that cover it closely."""
        return max(abs(ahead) + radius for ahead, radius in self.close_hull)

    def top_speed_mps(self, thrust_n: float) -> float:
        """[m/s] Straight ahead with this thrust of each propeller [N]: drag equals thrust."""
        linear, quadratic = self.linear_drag[0], self.quadratic_drag[0]
        if quadratic == 0.0:
            return 2.0 * thrust_n / linear if linear else math.inf
        root = math.sqrt(linear * linear + 8.0 * quadratic * thrust_n)
        return (root - linear) / (2.0 * quadratic)


class Motion(NamedTuple):
    """How the vessel moves now, over ground, in its levelled frame [m/s, m/s, rad/s]."""

    surge: float
    sway: float
    yaw_rate: float


Thrust = tuple[float, float]
"""[N] Of the left and the right propeller."""
Push = tuple[float, float]
"""[N] x and y of a force that is not of the propellers, as of wind or current."""
STILL: Push = (0.0, 0.0)


def slewed(thrust: Thrust, wanted: Thrust, step_n: float) -> Thrust:
    """Change each thrust by at most a step [N] towards what is wanted."""
    return (
        thrust[0] + min(max(wanted[0] - thrust[0], -step_n), step_n),
        thrust[1] + min(max(wanted[1] - thrust[1], -step_n), step_n),
    )


NO_SHORES: Final = np.empty((0, 2, 2))
"""The boundary of what is forbidden, where nothing is."""
NO_TRACK: Final = -1
FIXED: Final = -2
"""In a track's place: the boundary of what is forbidden."""


@dataclass(frozen=True, slots=True)
class Circles:
    """What is around the vessel, going straight on, in its present levelled frame L."""

    id: tuple[int, ...]
    p_L: Float64
    """[m] (K, 2)"""
    v_L: Float64
    """[m/s] (K, 2) Over ground."""
    radius: Float64
    """[m] (K,)"""
    horizon_s: Float64
    """[s] (K,) How far ahead its motion is trusted."""
    shores_L: Float64 = field(default_factory=lambda: NO_SHORES)
    """[m] (S, 2, 2) The boundary of what is forbidden, which lies to the left of each piece."""
    shore_clearance_m: float = 0.0
    """[m] It counts as this much nearer."""
    shore_margin_m: float = 0.0
    """[m] Nearer than this, closing in is limited."""
    shore_horizon_s: float = 0.0
    """[s] How far ahead it matters."""


class Contact(NamedTuple):
    """The worst that a path leads to."""

    excess: float
    """[m/s] How much faster than allowed it closes in, at most and, times 1 /s, in all; less the
    later; 0 if it leads to none."""
    time_s: float = float("inf")
    """[s] From now until the vessel first closes in too fast."""
    speed_mps: float = 0.0
    """[m/s] How fast it then closes in."""
    track: int = -1
    """The track's id; FIXED: the boundary of what is forbidden."""
    to_starboard: bool = False
    """True if the track is then on the starboard side."""


NO_CONTACT = Contact(0.0)


def surroundings(
    odometry: Odometry,
    tracks: Tracks,
    *,
    reach_m: float,
    horizon_s: tuple[float, float],
    least_radius_m: float,
    clearance_m: float,
    static_mps: float,
    shores_N: Float64 = NO_SHORES,
    shore_margin_m: float = 0.0,
) -> Circles:
    """Give what could be met within the horizon.

    Parameters
    ----------
    reach_m : float
        How far the edge of the vessel, with its margin, can get within the horizon [m].
    horizon_s : (float, float)
        How far ahead the motion of what stands still, and of what moves, is trusted [s]. A ship
        that tells where it goes is trusted for as long as what stands still.
    least_radius_m, clearance_m : float
        No object is taken to be smaller; every object is taken to be this much larger [m].
    static_mps : float
        Slower tracks stand still [m/s].
    shores_N : (S, 2, 2) float64
        The boundary of what is forbidden, near the vessel [m].
    shore_margin_m : float
        Nearer to it than this, closing in is limited [m].
    """
    told = _told(tracks)
    tracks = in_circles(tracks)
    speed = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1])
    speed = np.where(speed < static_mps, 0.0, speed)
    offset_N = tracks.p_N - odometry.position_N[:2]
    radius = np.maximum(tracks.radius, least_radius_m) + clearance_m
    gap = np.hypot(offset_N[:, 0], offset_N[:, 1]) - radius - reach_m
    horizon = np.where((speed > 0.0) & ~np.isin(tracks.id, told), horizon_s[1], horizon_s[0])
    near = np.flatnonzero(gap < speed * horizon)
    R_NL = rotation_2d(odometry.heading)
    return Circles(
        id=tuple(tracks.id[near].tolist()),
        p_L=offset_N[near] @ R_NL,
        v_L=np.where(speed[near, None] > 0.0, tracks.v_N[near], 0.0) @ R_NL,
        radius=radius[near],
        horizon_s=horizon[near],
        shores_L=(shores_N - odometry.position_N[:2]) @ R_NL if len(shores_N) else NO_SHORES,
        shore_clearance_m=clearance_m,
        shore_margin_m=shore_margin_m,
        shore_horizon_s=horizon_s[0],
    )


def _told(tracks: Tracks) -> NDArray[np.int64]:
    """Give the identities of the ships that report themselves."""
    if tracks.name is None:
        return np.zeros(0, np.int64)
    return tracks.id[[bool(name) for name in tracks.name]]


MOST_CIRCLES = 8
"""[-] Of one outline."""


def in_circles(tracks: Tracks) -> Tracks:
    """Cover each outline that is known with circles along it, in the place of one about all of it.

    The circle about a ship of 100 m reaches 40 m beyond its sides.
    """
    if tracks.half_length is None or tracks.half_beam is None or tracks.heading is None:
        return tracks
    rows: list[int] = []
    ahead: list[float] = []
    radius: list[float] = []
    for k in range(len(tracks.id)):
        half, beam = float(tracks.half_length[k]), float(tracks.half_beam[k])
        known = math.isfinite(half + beam + float(tracks.heading[k]))
        count = min(max(math.ceil(half / beam), 1), MOST_CIRCLES) if known and beam > 0.0 else 1
        if count == 1:
            rows, ahead, radius = [*rows, k], [*ahead, 0.0], [*radius, float(tracks.radius[k])]
            continue
        step = 2.0 * half / count
        rows += [k] * count
        ahead += [(n + 0.5) * step - half for n in range(count)]
        radius += [math.hypot(beam, 0.5 * step)] * count
    heading = np.nan_to_num(tracks.heading[rows])
    along = np.array(ahead)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    return replace(
        tracks,
        id=tracks.id[rows],
        p_N=tracks.p_N[rows] + along,
        v_N=tracks.v_N[rows],
        radius=np.array(radius),
        covariance=tracks.covariance[rows],
        age_s=tracks.age_s[rows],
        half_length=None,
        half_beam=None,
        heading=None,
        name=None,
    )


class Foresight:
    """Predicts and judges. It keeps the kernel's memory: one serves one thread at a time."""

    def __init__(
        self,
        vessel: AssuranceVessel,
        *,
        steps: int,
        dt: float,
        slew_nps: float,
        margin_m: float,
        approach_per_s: float,
    ) -> None:
        """Take the vessel, the number and length [s] of time steps, and how fast a thrust changes.

        Nearer than the margin [m], closing in is allowed at `approach_per_s` times the gap.
        """
        self._kernel = _native.Foresight(
            vessel=(vessel.inertia, vessel.linear_drag, vessel.quadratic_drag),
            lever=vessel.lever_m,
            hull=vessel.hull,
            close_hull=vessel.close_hull,
            steps=steps,
            dt=dt,
            slew=slew_nps,
            margin=margin_m,
            approach=approach_per_s,
        )

    def acceleration(self, motion: Motion, thrust: Thrust) -> tuple[float, float, float]:
        """Give how surge, sway [m/s2] and yaw rate [rad/s2] change by thrust and water alone."""
        return self._kernel.acceleration(motion, thrust)

    def path(self, motion: Motion, thrust: Thrust, law: Law, push: Push = STILL) -> Float64:
        """Follow a law of the thrusts: Euler steps of the velocity, trapezoids of the position.

        Parameters
        ----------
        motion, thrust
            How the vessel moves, and what its propellers give, now.
        law
            What the propellers are to give.
        push
            What wind and current do, as long as the prediction lasts.

        Returns
        -------
        path : (T + 1, 3) float64
            x, y [m], heading [rad], from now on, in the vessel's present levelled frame.
        """
        return self._kernel.path(motion, thrust, law, push)

    def contact(self, path: Float64, circles: Circles) -> Contact:
        """Judge a path as `path` gives it, of any length.

        Nearer than the margin, closing in is allowed at `approach_per_s` times the gap that is
        left, so that a vessel may pass along an edge, or lie beside it, but not run into it; where
        they overlap, it has to leave as fast, as from 0.2 m at most. What comes later counts less,
        down to nothing at the track's horizon: until then there is time to decide again.
        """
        return _contact(self._kernel.contact(path, *_around(circles)), circles)

    def judge(
        self, motion: Motion, thrust: Thrust, law: Law, circles: Circles, push: Push = STILL
    ) -> Contact:
        """Give `contact` of `path`, without making the path."""
        found = self._kernel.judge(motion, thrust, law, push, *_around(circles))
        return _contact(found, circles)


def _around(
    c: Circles,
) -> tuple[Float64, Float64, Float64, Float64, Float64, float, float, float]:
    shores = (c.shores_L, c.shore_clearance_m, c.shore_margin_m, c.shore_horizon_s)
    return c.p_L, c.v_L, c.radius, c.horizon_s, *shores


def _contact(found: tuple[float, float, float, int, bool], circles: Circles) -> Contact:
    excess, time_s, speed_mps, circle, to_starboard = found
    if circle == FIXED:
        return Contact(excess, time_s, speed_mps, FIXED, to_starboard)
    if circle < 0:
        return NO_CONTACT
    return Contact(excess, time_s, speed_mps, circles.id[circle], to_starboard)


class DisturbanceObserver:
    """Estimates the force of wind and current: what the model does not explain of the motion.

    Newton's second law in the vessel's frame, with the model's forces at the mean of two motions::

        F_B = M (nu_k - nu_(k-1)) / dt - M nu'_model(mean nu, thrust)

    It is turned into frame N, where wind and current stay when the vessel turns, and goes through a
    first-order low pass, so that waves leave little of themselves.
    """

    LONGEST_S = 0.5
    """[s] Over a longer gap the mean of the motions says nothing of what happened in between."""

    def __init__(
        self,
        acceleration: Callable[[Motion, Thrust], tuple[float, float, float]],
        inertia: tuple[float, float],
        *,
        time_constant_s: float,
        limit_n: float,
    ) -> None:
        """Begin with no disturbance.

        Parameters
        ----------
        acceleration
            The model's, of a motion and a thrust [m/s2, rad/s2].
        inertia
            In surge and sway, added mass included [kg].
        time_constant_s
            Of the low pass [s].
        limit_n
            The estimate is never greater [N]; 0: there is none.
        """
        self._acceleration = acceleration
        self._inertia = inertia
        self._time_constant_s = time_constant_s
        self._limit_n = limit_n
        self._force_N: Push = STILL
        self._before: tuple[int, Motion, float] | None = None

    @property
    def force_N(self) -> Push:
        """[N] [N] North and east."""
        return self._force_N

    @property
    def size_n(self) -> float:
        """[N] How strong the disturbance is, wherever it pushes."""
        return math.hypot(*self._force_N)

    def pause(self) -> None:
        """Learn nothing from the time until the next step: what acts in it is not known."""
        self._before = None

    def step(self, stamp_ns: int, motion: Motion, heading: float, thrust: Thrust) -> Push:
        """Learn from one more motion.

        Parameters
        ----------
        stamp_ns, motion, heading
            How the vessel moves [levelled frame L] and its heading [rad] at a time.
        thrust
            What the propellers gave since the last step.

        Returns
        -------
        push
            The disturbance [N], in the vessel's present levelled frame.
        """
        before, self._before = self._before, (stamp_ns, motion, heading)
        if before is not None and self._limit_n > 0.0:
            last_ns, last_motion, last_heading = before
            dt = (stamp_ns - last_ns) / NANOSECONDS_PER_SECOND
            if 0.0 < dt <= self.LONGEST_S:
                midway = heading - math.remainder(heading - last_heading, math.tau) / 2.0
                push = self._unexplained(last_motion, motion, thrust, dt)
                self._learn(_turned(push, -midway), dt)
        return _turned(self._force_N, heading)

    def _unexplained(self, before: Motion, now: Motion, thrust: Thrust, dt: float) -> Push:
        (u0, v0, r0), (u1, v1, r1), (m11, m22) = before, now, self._inertia
        mean = Motion((u0 + u1) / 2.0, (v0 + v1) / 2.0, (r0 + r1) / 2.0)
        surge, sway, _ = self._acceleration(mean, thrust)
        return m11 * ((u1 - u0) / dt - surge), m22 * ((v1 - v0) / dt - sway)

    def _learn(self, force_N: Push, dt: float) -> None:
        share = 1.0 - math.exp(-dt / self._time_constant_s)
        north = self._force_N[0] + share * (force_N[0] - self._force_N[0])
        east = self._force_N[1] + share * (force_N[1] - self._force_N[1])
        size = math.hypot(north, east)
        if not math.isfinite(size):
            return  # no bad message may spoil what was learnt
        shrink = min(1.0, self._limit_n / size) if size > 0.0 else 0.0
        self._force_N = (shrink * north, shrink * east)


def _turned(force: Push, angle: float) -> Push:
    """Give a force in axes that are turned by an angle [rad] from its own, clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return c * force[0] + s * force[1], c * force[1] - s * force[0]
