"""Runtime assurance: a command that leads to contact gives way to a manoeuvre that does not.

It knows nothing of the policy, and trusts nothing but the tracks and a simple model of the vessel.
A command is refused only when both hold: it leads to contact within the horizon, and a moment later
no manoeuvre would avoid that contact any more. So the policy has all the time there is to find its
own way, and the manoeuvre still begins in time. Derivation and figures: docs/assurance.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from twinscrew.runtime._native import Law
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    HealthEvent,
    Odometry,
    Tracks,
)
from twinscrew.runtime.policy.observation import levelled_twist
from twinscrew.runtime.safety.events import ASSURANCE_INTERVENED, ASSURANCE_RELEASED
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.safety.prediction import (
    FIXED,
    NO_SHORES,
    AssuranceVessel,
    Contact,
    DisturbanceObserver,
    Foresight,
    Motion,
    Thrust,
    slewed,
    surroundings,
)
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import VesselDescription, load_vessel


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """What the vessel can do instead of what was commanded."""

    name: str
    law: Law


def manoeuvres(
    limits: ThrustLimits, *, brake_nspm: float, turn_n: float, to_starboard: bool
) -> tuple[Manoeuvre, ...]:
    """Give the manoeuvres in the order in which they are tried.

    Parameters
    ----------
    limits
        What a propeller can do.
    brake_nspm : float
        Thrust against each metre a second of surge [N s/m].
    turn_n : float
        By how much braking and turning differs between the propellers and the mean [N].
    to_starboard : bool
        Whether contact threatens on the starboard side.
    """
    ahead, astern = limits.max_n, limits.min_n
    away = (astern, ahead) if to_starboard else (ahead, astern)
    return (
        Manoeuvre("brake", braking(brake_nspm, 0.0, limits)),
        Manoeuvre("turn away", Law(away)),
        Manoeuvre("brake and turn to starboard", braking(brake_nspm, turn_n, limits)),
        Manoeuvre("full astern", Law((astern, astern))),
        Manoeuvre("full ahead", Law((ahead, ahead))),
    )


def braking(gain_nspm: float, turn_n: float, limits: ThrustLimits) -> Law:
    """Thrust against the speed until it is gone, and meanwhile turn to starboard by `turn_n`."""
    return Law((turn_n, -turn_n), gain_nspm, limits.min_n, limits.max_n)


FACE_M = 0.5
"""[m] Shores as near as this to a berth's face, and as far beyond its ends, are the face."""


def without_face(shores_N: Float64, face_N: Float64) -> Float64:
    """Leave out of a map's boundary what is the face of a berth.

    Parameters
    ----------
    shores_N : (S, 2, 2) float64
        Segments [m].
    face_N : (2, 2) float64
        The face's ends [m].

    Returns
    -------
    shores_N : (R, 2, 2) float64
        Segments that do not lie on the face's line, and what of the others lies beyond its ends, in
        their own direction: what is forbidden stays to the left.
    """
    way = face_N[1] - face_N[0]
    length = float(np.hypot(*way))
    if length == 0.0:
        return shores_N
    along = way / length
    across = np.array([-along[1], along[0]])
    kept: list[Float64] = []
    for segment in shores_N:
        off = (segment - face_N[0]) @ across
        if np.abs(off).max() > FACE_M:
            kept.append(segment)
            continue
        begin, end = ((segment - face_N[0]) @ along).tolist()
        low, high = sorted((begin, end))
        pieces = [(low, min(high, -FACE_M)), (max(low, length + FACE_M), high)]
        for first, last in pieces if begin < end else [piece[::-1] for piece in pieces[::-1]]:
            if (last - first) * (end - begin) > 0.0:
                middle = face_N[0] + across * float(off.mean())
                kept.append(middle + np.outer([first, last], along))
    return np.array(kept).reshape(-1, 2, 2)


Judge = Callable[[Thrust, Law], Contact]
"""What a law of the propellers leads to, from this thrust on."""


def shore_margin_m(vessel: VesselDescription) -> float:
    """[m] Give within which distance of what is charted a vessel's closing in is limited."""
    return round(0.2 * vessel.beam_m, 3)


class AssuranceSettings(Settings, frozen=True):
    """When a command is overridden, and by what."""

    enabled: bool = True
    """Whether commands are checked."""
    horizon_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 4.0
    """[s] How far ahead: stopping from full ahead takes 2.5 s, the propellers' turning included."""
    moving_horizon_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 1.5
    """[s] The same for what moves: later than that it, too, may have turned or stopped."""
    step_s: Annotated[float, Meta(ge=0.01, le=1.0)] = 0.1
    """[s] Time step of the prediction."""
    wait_s: NonNegative = 0.3
    """[s] A command is let pass while a manoeuvre that begins this much later avoids contact."""
    least_radius_m: NonNegative = 0.8
    """[m] Objects are at least this large: of a buoy of 0.75 m, 0.5 to 0.7 m are seen."""
    clearance_m: NonNegative = 0.1
    """[m] Surfaces count as this much larger: at `tolerance_mps` a vessel can creep nearer than
    wanted, by tolerance_mps / approach_per_s = 0.07 m."""
    margin_m: NonNegative = 0.8
    """[m] Nearer than this to a surface, closing in is limited."""
    shore_margin_m: NonNegative = shore_margin_m(load_vessel())
    """[m] The same for what is charted: a fifth of the beam, so that a gap of 1.6 beams can be
    passed without slowing down."""
    approach_per_s: NonNegative = 0.7
    """[1/s] There it is allowed at this times the gap."""
    tolerance_mps: NonNegative = 0.05
    """[m/s] Closing in faster than allowed by less is no contact, and no improvement."""
    static_mps: NonNegative = 0.4
    """[m/s] Slower tracks stand still."""
    slew_nps: Positive = 1000.0
    """[N/s] How fast a manoeuvre changes each thrust (paper: the greatest rate of an action)."""
    brake_nspm: Positive = 500.0
    """[N s/m] Braking asks each propeller for this times the speed, astern."""
    turn_n: Positive = 500.0
    """[N] Turning while braking asks for this more to port, and less to starboard."""
    disturbance_time_s: Positive = 3.0
    """[s] Time constant with which wind and current are learnt from how the vessel moves."""
    disturbance_limit_n: NonNegative = 300.0
    """[N] They are never taken for more; 0: they are not learnt."""
    vessel: AssuranceVessel = AssuranceVessel()


class Assurance:
    """Checks every command, and remembers which manoeuvre it has begun."""

    def __init__(
        self, settings: AssuranceSettings | None = None, limits: ThrustLimits | None = None
    ) -> None:
        self.settings = settings or AssuranceSettings()
        self.limits = limits or ThrustLimits()
        vessel, horizon = self.settings.vessel, self.settings.horizon_s
        self._foresight = Foresight(
            vessel,
            steps=max(1, round(horizon / self.settings.step_s)),
            dt=self.settings.step_s,
            slew_nps=self.settings.slew_nps,
            margin_m=self.settings.margin_m,
            approach_per_s=self.settings.approach_per_s,
        )
        self._disturbance = DisturbanceObserver(
            self._foresight.acceleration,
            vessel.inertia[:2],
            time_constant_s=self.settings.disturbance_time_s,
            limit_n=self.settings.disturbance_limit_n,
        )
        self._manoeuvres = {
            side: manoeuvres(
                self.limits,
                brake_nspm=self.settings.brake_nspm,
                turn_n=self.settings.turn_n,
                to_starboard=side,
            )
            for side in (False, True)
        }
        way_m = horizon * vessel.top_speed_mps(self.limits.max_n)
        self._reach_m = way_m + vessel.extent_m + self.settings.margin_m
        self._shore_reach_m = way_m + vessel.close_extent_m + self.settings.shore_margin_m
        self._map = self._land = StaticMap.empty()
        self.berth_N: Float64 | None = None
        """[m] [N] (2, 2) Ends of the one face that may be touched now; None: nothing may be."""
        self.reset()

    def reset(self) -> None:
        """Forget a manoeuvre that was begun."""
        self._begun: str | None = None
        self._begun_ns = 0
        self._last_ns: int | None = None
        self._disturbance.pause()

    @property
    def static_map(self) -> StaticMap:
        """What is fixed: its boundary is kept clear of as objects are."""
        return self._map

    @static_map.setter
    def static_map(self, static_map: StaticMap) -> None:
        self._map = static_map
        self._land = StaticMap.of(f for f in static_map.features if f.kind == "land")

    @property
    def disturbance_n(self) -> float:
        """[N] Force of wind and current together, as learnt; NaN while nothing is learnt."""
        learns = self.settings.enabled and self.settings.disturbance_limit_n > 0.0
        return self._disturbance.size_n if learns and self._last_ns is not None else math.nan

    @property
    def drift_N(self) -> Float64:
        """[m/s] [N] (2,) How fast wind and current, as learnt, would push an idle vessel.

        The speed at which its drag ahead, the least there is, equals their force; 0 while nothing
        is learnt.
        """
        if not math.isfinite(self.disturbance_n):
            return np.zeros(2)
        force_N = np.array(self._disturbance.force_N)
        size_n = float(np.hypot(*force_N))
        speed_mps = self.settings.vessel.top_speed_mps(size_n / 2.0)
        known = 0.0 < size_n < math.inf and speed_mps < math.inf
        return force_N * (speed_mps / size_n) if known else np.zeros(2)

    def step(
        self,
        odometry: Odometry,
        tracks: Tracks,
        previous: Float64,
        command: Float64,
        *,
        decided: bool,
    ) -> tuple[Float64, tuple[HealthEvent, ...]]:
        """Check a command.

        Parameters
        ----------
        odometry, tracks
            The vessel's state, and what is around it, now.
        previous : (2,) float64
            What the propellers give until now [N], left and right.
        command : (2,) float64
            What they are to give from now on.
        decided : bool
            Whether the policy has just decided. A manoeuvre goes on until it has.

        Returns
        -------
        thrust : (2,) float64
            The command, or the first step of a manoeuvre.
        events
            `assurance_intervened` when a manoeuvre begins or another one takes over,
            `assurance_released` when the policy has the vessel again.
        """
        stamp_ns = tracks.stamp_ns
        since_s = self._since_last(stamp_ns)
        if not self.settings.enabled:
            return command, ()
        motion = Motion(*levelled_twist(odometry).tolist())
        given, wanted = _pair(previous), _pair(command)
        push = self._disturbance.step(odometry.stamp_ns, motion, odometry.heading, given)
        settings = self.settings
        circles = surroundings(
            odometry,
            self._afloat(tracks),
            reach_m=self._reach_m,
            horizon_s=(settings.horizon_s, min(settings.moving_horizon_s, settings.horizon_s)),
            least_radius_m=settings.least_radius_m,
            clearance_m=settings.clearance_m,
            static_mps=settings.static_mps,
            shores_N=self._shores(odometry),
            shore_margin_m=settings.shore_margin_m,
        )
        if not circles.id and not len(circles.shores_L):
            return command, self._release(stamp_ns)

        def judge(thrust: Thrust, law: Law) -> Contact:
            return self._foresight.judge(motion, thrust, law, circles, push)

        danger = judge(wanted, Law(wanted))
        resumes = self._begun is not None and not decided
        if not resumes and self._may_pass(wanted, danger, judge):
            return command, self._release(stamp_ns)
        manoeuvre, rest = self._best(given, danger, judge)
        if not resumes and rest.excess > danger.excess - self.settings.tolerance_mps:
            return command, self._release(stamp_ns)
        thrust = slewed(given, manoeuvre.law(0.0, motion.surge), self.settings.slew_nps * since_s)
        return np.array(thrust), self._intervene(stamp_ns, manoeuvre.name, danger)

    def _afloat(self, tracks: Tracks) -> Tracks:
        """Leave out what stands on charted land: a quay's pieces, as circles, reach beyond it."""
        if self._land.is_empty or not len(tracks.id):
            return tracks
        stands = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1]) < self.settings.static_mps
        ashore = stands & self._land.forbidden(tracks.p_N)
        return tracks.only(~ashore) if ashore.any() else tracks

    def _shores(self, odometry: Odometry) -> Float64:
        """Give what of the map's boundary could be met within the horizon."""
        if self._map.is_empty:
            return NO_SHORES
        shores = self._map.near(odometry.position_N[:2], self._shore_reach_m)
        return shores if self.berth_N is None else without_face(shores, self.berth_N)

    def _since_last(self, stamp_ns: int) -> float:
        """Give the time [s] since the last check: at least 0, at most a second."""
        last_ns = stamp_ns if self._last_ns is None else self._last_ns
        self._last_ns = stamp_ns
        return min(max((stamp_ns - last_ns) / NANOSECONDS_PER_SECOND, 0.0), 1.0)

    def _may_pass(self, command: Thrust, danger: Contact, judge: Judge) -> bool:
        """Tell whether the command avoids contact, or leaves time for a manoeuvre."""
        tolerance = self.settings.tolerance_mps
        return danger.excess <= tolerance or any(
            judge(command, way.law.after(command, self.settings.wait_s)).excess <= tolerance
            for way in self._manoeuvres[danger.to_starboard]
        )

    def _best(self, given: Thrust, danger: Contact, judge: Judge) -> tuple[Manoeuvre, Contact]:
        """Give the first manoeuvre without contact, or else the gentlest, and what it leads to."""
        judged = []
        for way in self._manoeuvres[danger.to_starboard]:
            rest = judge(given, way.law)
            if rest.excess <= self.settings.tolerance_mps:
                return way, rest
            judged.append((way, rest))
        return min(judged, key=lambda pair: pair[1].excess)

    def _intervene(self, stamp_ns: int, manoeuvre: str, danger: Contact) -> tuple[HealthEvent, ...]:
        if self._begun == manoeuvre:
            return ()
        if self._begun is None:
            self._begun_ns = stamp_ns
        self._begun = manoeuvre
        what = "what is fixed" if danger.track == FIXED else f"track {danger.track}"
        where = f"{what} in {danger.time_s:.1f} s at {danger.speed_mps:.1f} m/s"
        detail = f"{manoeuvre}: the command meets {where}" if danger.excess else manoeuvre
        return (ASSURANCE_INTERVENED.at(stamp_ns, detail),)

    def _release(self, stamp_ns: int) -> tuple[HealthEvent, ...]:
        if self._begun is None:
            return ()
        self._begun = None
        lasted_s = (stamp_ns - self._begun_ns) / NANOSECONDS_PER_SECOND
        return (ASSURANCE_RELEASED.at(stamp_ns, f"after {lasted_s:.1f} s"),)


def _pair(thrust: Float64) -> Thrust:
    return float(thrust[0]), float(thrust[1])
