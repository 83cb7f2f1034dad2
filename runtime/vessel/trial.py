"""Trials: scripted manoeuvres from which a vessel's mass, drag and thrust can be identified.

A trial stands where a policy stands: it gives the thrust, and the assurance, the guard, the
vessel's state and the recording are the same as ever. Four trials, each a few minutes:

straight   both propellers at several thrusts ahead and astern, on a held heading
zigzag     10/10 and 20/20: the thrusts differ, one way until the heading has changed by 10 (20)
           degrees, then the other way (IMO MSC.137(76), with differential thrust for the rudder)
circle     turning circles both ways at several thrusts, and turns on the spot
stop       full astern from full speed, and coasting until the speed is gone

A guard keeps the trial in a box of water, below a speed, and clear of tracks. What breaks one of
these ends the trial with an event: the boat brakes, and then its thrust stays neutral.

The manoeuvres follow from the vessel's description, which may be wrong: it is what the trials are
to find out. So every phase ends by what the boat does, or after a time at the latest.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import numpy as np
from msgspec import Meta

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_2d, wrap
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    HealthEvent,
    Observation,
    Odometry,
    Tracks,
)
from twinscrew.runtime.policy.observation import PAPER
from twinscrew.runtime.safety.events import (
    TRIAL_BEGUN,
    TRIAL_DONE,
    TRIAL_INTERRUPTED,
    TRIAL_MANOEUVRE,
    TRIAL_OUT_OF_BOX,
    TRIAL_REFUSED,
    TRIAL_TOO_FAST,
    TRIAL_TRACK_NEAR,
    EventKind,
)
from twinscrew.runtime.safety.guard import NEUTRAL, ThrustLimits
from twinscrew.runtime.settings import NonNegative, Settings
from twinscrew.runtime.vessel_description import VesselDescription

TRIALS: Final = ("straight", "zigzag", "circle", "stop")
"""The trials; `all` is all of them, in this order."""
TRIAL_ENDS: Final = frozenset(
    kind.name
    for kind in (
        TRIAL_DONE,
        TRIAL_REFUSED,
        TRIAL_OUT_OF_BOX,
        TRIAL_TOO_FAST,
        TRIAL_TRACK_NEAR,
        TRIAL_INTERRUPTED,
    )
)
"""The events that end a trial."""
AHEAD: Final = (0.25, 0.5, 0.75, 1.0)
"""[-] Shares of the greatest thrust ahead at which straight runs are made."""
ASTERN: Final = (0.5, 1.0)
"""[-] The same astern, of the greatest thrust astern."""
ZIGZAGS: Final = ((10.0, 0.15), (20.0, 0.3))
"""[deg, -] By how much the heading changes, and by how much of the greatest thrust ahead each
propeller differs from the mean, which is `ZIGZAG_MEAN` of it."""
ZIGZAG_MEAN: Final = 0.5
RUN_UP: Final = 0.4
"""[-] Share of a straight run's time that comes before a zig-zag."""
SWITCHES: Final = 5
"""[-] How often a zig-zag changes sides."""
CIRCLES: Final = ((0.4, 0.0), (1.0, 0.2))
"""[-] The outer propeller's thrust and the inner one's, as shares of the greatest ahead."""
CIRCLE_RAD: Final = math.radians(400.0)
"""[rad] How far a circle turns: one whole turn, when it is steady."""
SPOT: Final = 0.5
"""[-] Share of the greatest thrust astern with which a turn on the spot is made."""
HOLD: Final = 0.2
"""[-] Share of the greatest thrust ahead that may go into holding the heading."""
STILL: Final = 0.08
"""[-] Slower than this share of the top speed a boat counts as stopped."""
SPARE_LENGTHS: Final = 3.0
"""[-] Lengths of water that are kept between a manoeuvre's end and the box's edge."""
FACED_RAD: Final = math.radians(12.0)
"""[rad] A boat that points so near to where it is to point may start a run."""


class TrialSettings(Settings, frozen=True):
    """Which manoeuvres are sailed, and what ends them."""

    name: Literal["", "straight", "zigzag", "circle", "stop", "all"] = ""
    """What is sailed; empty: no trial, the policy drives."""
    box_m: tuple[float, float, float, float] | None = None
    """[m] [N] The water: its southern, western, northern and eastern edge; none: `around_m`."""
    around_m: NonNegative = 0.0
    """[m] The water reaches so far from where the trial begins, to each of the four sides."""
    speed_limit_mps: NonNegative = 0.0
    """[m/s] Faster over ground the trial ends; 0: 1.5 times the vessel's top speed."""
    clearance_m: NonNegative = 0.0
    """[m] Nothing may come nearer, the way to stop included; 0: two lengths of the vessel."""
    max_time_s: Annotated[float, Meta(gt=0.0, le=7200.0)] = 1200.0
    """[s] The trial is done after so long, whatever is left of it."""

    def __post_init__(self) -> None:
        """Refuse a box that is none."""
        if self.box_m is not None:
            south, west, north, east = self.box_m
            if not (all(map(math.isfinite, self.box_m)) and south < north and west < east):
                raise ValueError(
                    "trial.box_m must be [south, west, north, east] with south < north and "
                    f"west < east, got {list(self.box_m)}"
                )


@dataclass(frozen=True, slots=True)
class _Now:
    """What a manoeuvre is steered by."""

    time_s: float
    place_N: Float64
    heading: float
    surge: float
    turned: float
    """[rad] Sum of all changes of heading."""
    rate: float
    speed: float
    """[m/s] Over ground."""
    course_N: Float64
    """(2,) Velocity over ground."""


Script = Generator[Float64, None, None]
"""Gives the thrust, (2,) [N], once a scan."""


class Trial:
    """A source of thrust in a policy's place.

    Parameters
    ----------
    settings
        What is sailed, and where.
    vessel
        What the vessel is taken for.
    limits
        What the propellers can do.

    Raises
    ------
    ConfigError
        There is not enough room, or nothing says how much there is.
    """

    period_s = 0.1
    """[s] The thrust changes with every scan."""
    shown = PAPER
    """It looks at nothing of it."""

    def __init__(
        self, settings: TrialSettings, vessel: VesselDescription, limits: ThrustLimits
    ) -> None:
        self.settings = settings
        self.name = f"trial {settings.name}"
        self.needed_m = room_m(settings.name, vessel)
        """[m] How far the water must reach from its centre."""
        self.over = False
        """Whether the trial is done, or was ended."""
        self.done = False
        """Whether it was sailed to its end."""
        self.outcome = ""
        """The event that ended it; empty while it goes on."""
        self.words = ""
        """What was reported last: the manoeuvre, or why the trial ended."""
        self._vessel, self._limits = vessel, limits
        self._require_room()
        self._time_s = vessel.length_m / vessel.top_speed_mps
        self._stop_s, self._stop_way_m = vessel.stopping(limits.max_n / max(self._time_s, 0.2))
        self._speed_limit = settings.speed_limit_mps or 1.5 * vessel.top_speed_mps
        self._spare_m = spare_m(vessel)
        self._clearance = settings.clearance_m or 2.0 * vessel.length_m
        inertia, lever = vessel.plane_inertia[2], vessel.lever_m
        # A control of the heading that needs all of `HOLD` for half a radian, damped critically,
        # and no faster than the propellers and the scans can follow.
        moment = 2.0 * lever * HOLD * limits.max_n
        self._gain = min(moment / 0.5, inertia * 1.0**2) / (2.0 * lever)
        self._damping = 2.0 * math.sqrt(self._gain * 2.0 * lever * inertia) / (2.0 * lever)
        self._box: tuple[float, float, float, float] | None = None
        self._script: Script | None = None
        self._now: _Now | None = None
        self._begin_s = 0.0
        self._events: list[HealthEvent] = []
        self._stamp_ns = 0

    # -- A policy's face: the pipeline asks for it where it wants any policy.

    def act(self, observation: Observation) -> Float64:  # noqa: ARG002
        """Give no thrust rates: the thrust comes from `step`."""
        return NEUTRAL

    def reset(self) -> None:
        """Forget nothing: what ends a trial early is `interrupt`."""

    # -- What the pipeline calls.

    def step(self, odometry: Odometry, tracks: Tracks) -> tuple[Float64, list[HealthEvent]]:
        """Give the thrust, (2,) [N] left and right, and what there is to report."""
        self._see(odometry)
        self._events = []
        if self._script is None and not self.over:
            self._begin(tracks)
        elif not self.over:
            self._watch(tracks)
        thrust = NEUTRAL if self._script is None else next(self._script, None)
        if thrust is None:
            self._script, thrust = None, NEUTRAL
            if not self.over:
                self.done = True
                self._end(TRIAL_DONE, f"{self.name}, {self._now_.time_s - self._begin_s:.0f} s")
        return thrust, self._events

    def interrupt(self, stamp_ns: int, why: str) -> list[HealthEvent]:
        """End a trial that has begun, at once and without braking: somebody else drives."""
        self._script = None
        if self.over or self._now is None:
            return []
        self._events, self._stamp_ns = [], stamp_ns
        self._end(TRIAL_INTERRUPTED, why)
        return self._events

    @property
    def has_ended(self) -> bool:
        """Whether it is over, and the boat has braked."""
        return self.over and self._script is None

    @property
    def braking(self) -> bool:
        """Whether it is over, but the boat still brakes."""
        return self.over and self._script is not None

    # -- The guard.

    def _require_room(self) -> None:
        given, name = self.settings, self.settings.name
        if given.box_m is None and not given.around_m:
            raise ConfigError(
                f"say where there is room: {name} needs water {self.needed_m:.0f} m to each side of"
                " its centre, as box_m = [south, west, north, east] or around_m",
                key="trial.around_m",
            )
        if given.box_m is None:
            room, key = given.around_m, "trial.around_m"
        else:
            south, west, north, east = given.box_m
            room, key = min(north - south, east - west) / 2.0, "trial.box_m"
        if room < self.needed_m:
            raise ConfigError(
                f"{name} needs water {self.needed_m:.0f} m to each side of its centre, "
                f"got {room:g} m",
                key=key,
            )

    def _begin(self, tracks: Tracks) -> None:
        now = self._now_
        if self.settings.box_m is None:
            (north, east), half = now.place_N, self.settings.around_m
            self._box = (north - half, east - half, north + half, east + half)
        else:
            self._box = self.settings.box_m
        self._begin_s = now.time_s
        spare = self._spare_m
        if self._to_edge(now.place_N) < spare:
            self._end(
                TRIAL_REFUSED,
                f"the boat is not within the box, {spare:.0f} m from its edges",
            )
        elif (near := self._near(tracks)) is not None:
            self._end(TRIAL_REFUSED, near)
        else:
            south, west, north, east = self._box
            where = f"south {south:.0f}, west {west:.0f}, north {north:.0f}, east {east:.0f} m"
            self._tell(TRIAL_BEGUN, f"{self.name} within {where}")
            self._script = self._sailed()

    def _watch(self, tracks: Tracks) -> None:
        now = self._now_
        if self._to_edge(now.place_N) < 0.0:
            north, east = now.place_N
            self._abort(TRIAL_OUT_OF_BOX, f"at north {north:.1f} m, east {east:.1f} m")
        elif now.speed > self._speed_limit:
            words = f"{now.speed:.2f} m/s, allowed {self._speed_limit:.2f} m/s"
            self._abort(TRIAL_TOO_FAST, words)
        elif (near := self._near(tracks)) is not None:
            self._abort(TRIAL_TRACK_NEAR, near)

    def _near(self, tracks: Tracks) -> str | None:
        """Say which track comes near until the boat could have stopped; None if there is none."""
        if not len(tracks.id):
            return None
        now = self._now_
        times = np.linspace(0.0, self._stop_s + 1.0, 11)
        p = tracks.p_N - now.place_N
        v = tracks.v_N - now.course_N
        apart = np.linalg.norm(p[:, None] + times[:, None] * v[:, None], axis=2).min(axis=1)
        gaps = apart - tracks.radius - self._vessel.radius_m
        nearest = int(np.argmin(gaps))
        if gaps[nearest] >= self._clearance:
            return None
        return (
            f"track {tracks.id[nearest]} comes within {max(gaps[nearest], 0.0):.1f} m, "
            f"allowed {self._clearance:.1f} m"
        )

    def _to_edge(self, place_N: Float64) -> float:
        """[m] Distance to the nearest edge; negative outside."""
        assert self._box is not None  # noqa: S101  (`_begin` made it)
        south, west, north, east = self._box
        p, q = place_N
        return float(min(p - south, north - p, q - west, east - q))

    def _edge_is_near(self, since_s: float = -math.inf) -> bool:
        """Tell whether the boat has to brake now so as to stop well within the box.

        A manoeuvre that has just begun, at `since_s`, may still carry the boat away from the edge.
        """
        now = self._now_
        if now.time_s < since_s + 3.0 * self._time_s + 1.0 or now.speed < 1e-3:
            return False
        share = now.speed / self._vessel.top_speed_mps
        way = share * (self._stop_way_m + now.speed * 0.5)
        stops_N = now.place_N + now.course_N / now.speed * way
        outward = self._to_edge(stops_N) < self._to_edge(now.place_N)
        return outward and self._to_edge(stops_N) < 0.6 * self._spare_m

    def _abort(self, kind: EventKind, detail: str) -> None:
        self._script = self._brake(self._now_.heading)
        self._end(kind, detail)

    def _end(self, kind: EventKind, detail: str) -> None:
        self.over, self.outcome = True, kind.name
        self._tell(kind, detail)

    def _tell(self, kind: EventKind, detail: str) -> None:
        self.words = f"{kind.name}: {detail}"
        self._events.append(kind.at(self._stamp_ns, detail))

    def _see(self, odometry: Odometry) -> None:
        heading = euler_from_quaternion(odometry.q_NB)[2]
        course_N = rotation_2d(heading) @ odometry.velocity_B[:2]
        before = self._now
        turned = 0.0 if before is None else before.turned + float(wrap(heading - before.heading))
        self._stamp_ns = odometry.stamp_ns
        self._now = _Now(
            time_s=odometry.stamp_ns / NANOSECONDS_PER_SECOND,
            place_N=odometry.position_N[:2],
            heading=heading,
            surge=float(odometry.velocity_B[0]),
            turned=turned,
            rate=float(odometry.rates_B[2]),
            speed=float(np.hypot(*course_N)),
            course_N=course_N,
        )

    @property
    def _now_(self) -> _Now:
        assert self._now is not None  # noqa: S101  (`step` has seen odometry)
        return self._now

    # -- The manoeuvres. Each is a script: it yields a thrust, and reads what came of it.

    def _sailed(self) -> Script:
        name = self.settings.name
        for trial in TRIALS if name == "all" else (name,):
            yield from getattr(self, f"_{trial}")()

    def _straight(self) -> Script:
        for share in AHEAD:
            yield from self._run(share * self._top, f"straight ahead at {share:.0%}")
            yield from self._brake(self._now_.heading)
        for share in ASTERN:
            yield from self._run(share * self._bottom, f"straight astern at {share:.0%}")
            yield from self._brake(self._now_.heading)

    def _zigzag(self) -> Script:
        mean = ZIGZAG_MEAN * self._top
        for degrees, share in ZIGZAGS:
            angle, differs = math.radians(degrees), share * self._top
            words = f"zig-zag {degrees:.0f}/{degrees:.0f}"
            yield from self._run(mean, words, share=RUN_UP)
            straight, side, switches = self._now_.turned, 1.0, 0
            over = self._timer(30.0)
            while switches < SWITCHES and not (over() or self._edge_is_near()):
                if side * (self._now_.turned - straight) >= angle:
                    side, switches = -side, switches + 1
                yield self._pair(mean, side * differs)
            yield from self._brake(self._now_.heading)

    def _circle(self) -> Script:
        for outer, inner in CIRCLES:
            for side, where in ((1.0, "starboard"), (-1.0, "port")):
                yield from self._back_to_the_middle()
                words = f"circle to {where}, {outer:.0%} outside and {inner:.0%} inside"
                self._tell(TRIAL_MANOEUVRE, words)
                mean, differs = (outer + inner) / 2.0, (outer - inner) / 2.0
                yield from self._turn(mean * self._top, side * differs * self._top)
                yield from self._brake(self._now_.heading)
        spot = -SPOT * self._bottom
        if spot > 0.0:
            for side, where in ((1.0, "starboard"), (-1.0, "port")):
                self._tell(TRIAL_MANOEUVRE, f"turn on the spot to {where}")
                yield from self._turn(0.0, side * min(spot, self._top))
                yield from self._brake(self._now_.heading)

    def _stop(self) -> Script:
        top = self._top
        yield from self._run(top, "crash stop from full speed")
        over, heading = self._timer(20.0), self._now_.heading
        while self._now_.surge > 0.0 and not over():
            yield self._pair(self._bottom, self._correction(heading))
        yield from self._run(top, "coasting from full speed")
        over, slow = self._timer(15.0), STILL * self._vessel.top_speed_mps
        while self._now_.surge > slow and not (over() or self._edge_is_near()):
            yield NEUTRAL
        yield from self._brake(self._now_.heading)

    # -- What they are made of.

    def _run(self, thrust_N: float, words: str, *, share: float = 1.0) -> Script:
        """Point along the box, then run straight for a share of the time until it is steady."""
        if self._to_edge(self._now_.place_N + self._now_.course_N * 10.0 * self._time_s) < 0.0:
            yield from self._back_to_the_middle()  # it would drift out while it turns
        yield from self._face(words, astern=thrust_N < 0.0)
        heading, over = self._now_.heading, self._timer(share * _steady_s(self._vessel))
        since_s = self._now_.time_s
        while not (over() or self._edge_is_near(since_s)):
            yield self._pair(thrust_N, self._correction(heading))

    def _turn(self, mean_N: float, differs_N: float) -> Script:
        begin, over, since_s = self._now_.turned, self._timer(40.0), self._now_.time_s
        while not (over() or self._edge_is_near(since_s)):
            if abs(self._now_.turned - begin) >= CIRCLE_RAD:
                break
            yield self._pair(mean_N, differs_N)

    def _face(self, words: str, *, astern: bool = False) -> Script:
        """Turn on the spot until the bow, or the stern, points to the middle of the box."""
        if self._now_.time_s - self._begin_s > self.settings.max_time_s:
            return
        self._tell(TRIAL_MANOEUVRE, words)
        offset = self._from_middle()
        heading = self._now_.heading
        if np.hypot(*offset) > self._vessel.length_m:
            heading = math.atan2(-offset[1], -offset[0]) + (math.pi if astern else 0.0)
        over = self._timer(12.0)
        while not over():
            off = abs(float(wrap(heading - self._now_.heading)))
            if off < FACED_RAD and abs(self._now_.rate) < 0.1 / self._time_s:
                return
            yield self._pair(0.0, self._correction(heading))

    def _back_to_the_middle(self) -> Script:
        """Sail back into the middle half of the box, for a manoeuvre that needs room all round."""
        assert self._box is not None  # noqa: S101  (`_begin` made it)
        south, west, north, east = self._box
        enough_m = min(north - south, east - west) / 4.0
        if np.hypot(*self._from_middle()) <= enough_m:
            return
        yield from self._face("back to the middle of the box")
        over = self._timer(20.0)
        while np.hypot(*(offset := self._from_middle())) > 0.7 * enough_m and not over():
            yield self._pair(0.6 * self._top, self._correction(math.atan2(-offset[1], -offset[0])))

    def _from_middle(self) -> Float64:
        """[m] [N] Where the boat is, seen from the middle of the box."""
        assert self._box is not None  # noqa: S101  (`_begin` made it)
        south, west, north, east = self._box
        offset: Float64 = self._now_.place_N - np.array([south + north, west + east]) / 2.0
        return offset

    def _brake(self, heading: float) -> Script:
        """Take the way off, with thrust against it."""
        over, slow = (
            _Timer(self, self._now_.time_s + 15.0 * self._time_s + 2.0),
            STILL * self._vessel.top_speed_mps,
        )
        while abs(self._now_.surge) > slow and not over():
            share = min(1.0, abs(self._now_.surge) / (3.0 * slow))
            back = self._bottom if self._now_.surge > 0.0 else self._top
            yield self._pair(0.8 * share * back, self._correction(heading))

    @property
    def _top(self) -> float:
        """[N] Full ahead; less where the speed limit would be passed."""
        return min(self._allowed_n, self._limits.max_n)

    @property
    def _bottom(self) -> float:
        """[N] Full astern; less where the speed limit would be passed."""
        return max(-self._allowed_n, self._limits.min_n)

    @property
    def _allowed_n(self) -> float:
        """[N] Of each propeller, for 0.8 of the speed limit."""
        vessel, limit = self._vessel, 0.8 * self._speed_limit
        return 0.5 * (vessel.linear_drag[0] + vessel.quadratic_drag[0] * limit) * limit

    def _correction(self, heading: float) -> float:
        """[N] By how much the left propeller has to push more, and the right one less."""
        error = float(wrap(heading - self._now_.heading))
        most = HOLD * self._limits.max_n
        return max(-most, min(most, self._gain * error - self._damping * self._now_.rate))

    def _pair(self, mean_N: float, differs_N: float) -> Float64:
        """Give both thrusts; where one is out of range both are shifted, to keep the turn."""
        low, high = self._limits.min_n, self._limits.max_n
        differs = max(-(high - low) / 2.0, min((high - low) / 2.0, differs_N))
        mean = max(low + abs(differs), min(high - abs(differs), mean_N))
        return self._limits.clip(np.array([mean + differs, mean - differs]))

    def _timer(self, units: float) -> _Timer:
        """Make a clock that is over after a time in the hull's own units, length by top speed."""
        left_s = self._begin_s + self.settings.max_time_s - self._now_.time_s
        return _Timer(self, self._now_.time_s + min(units * self._time_s + 2.0, left_s))


class _Timer:
    """Tells when a time is over."""

    def __init__(self, trial: Trial, until_s: float) -> None:
        self._trial, self._until_s = trial, until_s

    def __call__(self) -> bool:
        return self._trial._now_.time_s >= self._until_s


def _steady_s(vessel: VesselDescription) -> float:
    """[hull's units of time] How long a straight run lasts: three times the time constant."""
    speed, unit_s = vessel.top_speed_mps, vessel.length_m / vessel.top_speed_mps
    constant_s = vessel.plane_inertia[0] * speed / (2.0 * vessel.thrusters.max_n)
    return 3.0 * constant_s / unit_s + 3.0


WIND_MPS: Final = 10.0
"""[m/s] Trials have room for the drift in so much wind, between two manoeuvres."""


def spare_m(vessel: VesselDescription) -> float:
    """Give how much water is kept between where a manoeuvre ends and the box's edge [m].

    It is for what a boat drifts abeam in a wind of `WIND_MPS` while it turns round.
    """
    linear, quadratic = vessel.linear_drag[1], vessel.quadratic_drag[1]
    side_n = vessel.windage.across * WIND_MPS**2
    drift = 2.0 * side_n / (linear + math.sqrt(linear**2 + 4.0 * quadratic * side_n) + 1e-9)
    unit_s = vessel.length_m / vessel.top_speed_mps
    return SPARE_LENGTHS * vessel.length_m + drift * (10.0 * unit_s + 4.0)


def room_m(name: str, vessel: VesselDescription) -> float:
    """Give how far a trial's water must reach from its centre, to each of four sides [m].

    A straight run goes from rest to the top speed, keeps it for a while, and stops; it begins on
    one side of the centre and ends on the other. Circles need their diameter, about 4 lengths, and
    what wind and current drift the boat meanwhile.
    """
    unit_s = vessel.length_m / vessel.top_speed_mps
    run = vessel.top_speed_mps * _steady_s(vessel) * unit_s
    stop = vessel.stopping(vessel.thrusters.max_n / max(unit_s, 0.2))[1]
    spare = spare_m(vessel)
    circle = 6.0 * vessel.length_m + spare
    return math.ceil(circle if name == "circle" else max(0.6 * (run + stop) + spare, circle))
