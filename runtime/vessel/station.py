"""Station keeping: the thrust with which a hull of two fixed propellers stays at a place.

Such a hull pushes ahead, astern, and round; nothing pushes it sideways. So it steers its thrust as
a multicopter does: the force that would bring it to its place, and hold it there against wind and
current, is a vector; the bow is turned along it, and the propellers give what of it lies along the
bow. At the place the force is just the one that balances wind and current: the bow points into
them, as that of a boat at anchor does (Fossen's weather-optimal positioning).

Derivation, figures and limits: docs/station.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from twinscrew.runtime.geometry import rotation_2d, wrap
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Berth,
    Float64,
    HealthEvent,
    Odometry,
    Station,
    Tracks,
)
from twinscrew.runtime.policy.observation import levelled_twist
from twinscrew.runtime.safety.assurance import FACE_M
from twinscrew.runtime.safety.events import (
    BERTH_ABORTED,
    BERTH_APPROACH,
    BERTH_GIVEN_UP,
    BERTHED,
    STATION_HEADING,
)
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.safety.prediction import (
    STILL,
    AssuranceVessel,
    DisturbanceObserver,
    Foresight,
    Motion,
    Push,
)
from twinscrew.runtime.settings import Count, Fraction, Positive, Settings
from twinscrew.runtime.vessel_description import VesselDescription


class StationSettings(Settings, frozen=True):
    """How a place is held."""

    speed_share: Fraction = 0.4
    """[-] The vessel goes back to its place at no more than this share of its top speed."""
    contact_mps: Positive = 0.2
    """[m/s] A berth's face may be touched no faster, over ground."""
    contact_deg: Positive = 12.0
    """[deg] Nor with a heading farther off its direction."""
    along_m: Positive = 1.0
    """[m] Nor farther than this from its middle, along it."""
    alongside_m: Positive = 0.1
    """[m] A boat whose hull is as near to the face as this, and meets the three above, lies
    alongside: lines can be made fast."""
    closing_mps: Positive = 0.2
    """[m/s] How fast the boat comes near the face."""
    tries: Count = 3
    """[-] After so many approaches that went wrong the boat stays off."""


TURN_SHARE: Final = 1.0
"""[-] Share of the greatest moment that turns the boat where it points 1 rad wrong."""
DELAY_S: Final = 0.15
"""[s] From a scan to the thrust that follows it, besides the propellers' own lag."""
DAMPING: Final = 0.9
"""[-] Damping ratio of heading and place."""
SLOWER: Final = 3.0
"""[-] The place is controlled so much more slowly than the heading that it is steered by."""
WEAK: Final = 0.01
"""[-] A force that is this share of full thrust ahead turns the bow half-way from where it is to
point; far weaker ones do not turn it."""
LEARN_S: Final = 4.0
"""[s] Time constant with which wind and current are learnt: near one of the waves' periods."""
HEADING_DEG: Final = 10.0
"""[deg] A heading that is off by less is held."""
HEADING_AFTER_S: Final = 3.0 * LEARN_S
"""[s] Before that nobody knows yet whether it can be."""
WAY_IN_LENGTHS: Final = 3.0
"""[-] How long the way in to a berth is."""
LANDINGS: Final = 4
"""[-] So often a manoeuvre may end short of the face before the way in counts as gone wrong."""
AGAIN_M: Final = 1.2
"""[m] After a landing that ended short it takes the way in from so far before its end again."""
STILL_MPS: Final = 0.4
"""[m/s] Slower tracks stand still: on the face they are the face."""
CLEAR_M: Final = 0.35
"""[m] A boat that does not yet lie along the face comes no nearer."""
LAND_S: Final = 12.0
"""[s] A manoeuvre that has not ended alongside after so long, for a hull that turns slowly longer,
is broken off."""
BEYOND_M: Final = 1.5
"""[m] The way in goes on so far behind the face, so that the boat does not stop before it."""
WAY_IN_RAD: Final = math.radians(35.0)
"""[rad] And the angle at which it comes to the face."""
ASTERN_LENGTHS: Final = 2.0
"""[-] Farther than this from its place a boat turns to it, and does not go astern."""
SLACK_LENGTHS: Final = 0.06
"""[-] In calm water so many lengths off the place are near enough."""


@dataclass(frozen=True, slots=True)
class Gains:
    """How firmly a hull is held, by its own inertia, thrust and lag."""

    turn: float
    """[rad/s] Natural frequency of the heading."""
    place: float
    """[rad/s] Natural frequency of the place."""

    @classmethod
    def of(cls, vessel: VesselDescription, limits: ThrustLimits) -> Gains:
        """Give the gains of a hull whose propellers give so much."""
        moment = vessel.lever_m * (limits.max_n - limits.min_n)
        turn = math.sqrt(TURN_SHARE * moment / vessel.plane_inertia[2])
        turn = min(turn, 0.35 / (vessel.thrusters.time_constant_s + DELAY_S))
        return cls(turn, turn / SLOWER)


class Keeper:
    """Holds a place; it learns meanwhile what wind and current do.

    Parameters
    ----------
    settings
        How.
    vessel
        The hull.
    limits
        What its propellers may give.
    """

    def __init__(
        self, settings: StationSettings, vessel: VesselDescription, limits: ThrustLimits
    ) -> None:
        self.settings = settings
        self.limits = limits
        self.vessel = vessel
        self.gains = Gains.of(vessel, limits)
        self.hull = AssuranceVessel.of(vessel)
        """What its equations of motion are made of."""
        # Foresight's equations of motion alone are used here; the rules of contact are not.
        model = Foresight(
            self.hull, steps=1, dt=0.1, slew_nps=1.0, margin_m=0.0, approach_per_s=1.0
        )
        self._observer = DisturbanceObserver(
            model.acceleration,
            self.hull.inertia[:2],
            time_constant_s=LEARN_S,
            limit_n=2.0 * limits.max_n,
        )
        self.reset()

    def reset(self) -> None:
        """Forget where the bow was to point; what wind and current do is remembered."""
        self._observer.pause()
        self._bow: float | None = None
        self._rests = 0.0
        self._learnt_ns: int | None = None
        self._push_L: Push = STILL
        self._astern = False
        self._moment = 0.0
        self._last_ns: int | None = None
        self._kept_s = 0.0
        self._told: bool | None = None
        self._asked: float | None = None

    def step(
        self, odometry: Odometry, given: Float64, station: Station
    ) -> tuple[Float64, tuple[HealthEvent, ...]]:
        """Give the thrust, (2,) [N] left and right, and what there is to report.

        Parameters
        ----------
        odometry
            The vessel's state now.
        given : (2,) float64
            What the propellers gave since the last step [N].
        station
            Where to stay.
        """
        if station.heading != self._asked:  # of another order: what was said counts no more
            self._asked, self._told, self._kept_s = station.heading, None, 0.0
        speed_mps = self.settings.speed_share * self.vessel.top_speed_mps
        thrust = self.steer(
            odometry, given, station.position_N, station.heading, speed_mps=speed_mps
        )
        return thrust, self._report(odometry.stamp_ns, station)

    def _report(self, stamp_ns: int, station: Station) -> tuple[HealthEvent, ...]:
        """Say once if the heading that was asked for cannot be held."""
        if station.heading is None or self._kept_s < HEADING_AFTER_S:
            return ()
        off = abs(float(wrap(self._rests - station.heading)))
        held = off < math.radians(HEADING_DEG) * (1.0 if self._told is not True else 0.5)
        if held or self._told:
            self._told = None if held else self._told
            return ()
        self._told = True
        asked, rests = math.degrees(station.heading), math.degrees(self._rests)
        words = f"asked {asked % 360.0:.0f} deg, it lies at about {rests % 360.0:.0f} deg"
        return (STATION_HEADING.at(stamp_ns, words),)

    def steer(
        self,
        odometry: Odometry,
        given: Float64,
        place_N: Float64,
        heading: float | None = None,
        *,
        speed_mps: float,
        drift_N: Float64 | None = None,
    ) -> Float64:
        """Give the thrust, (2,) [N] left and right.

        Parameters
        ----------
        odometry
            The vessel's state now.
        given : (2,) float64
            What the propellers gave since the last step [N].
        place_N : (2,) float64
            Where the boat is to be [m].
        heading
            [rad] Where its bow is to point, as far as wind and current let it; None: into them.
        speed_mps
            [m/s] How fast it may go there.
        drift_N : (2,) float64
            [m/s] How fast the place itself moves; none: it does not.
        """
        since_s = self._since_last(odometry.stamp_ns)
        self._kept_s += since_s
        motion, push_L = self.learn(odometry, given)
        psi = odometry.heading
        R_NL = rotation_2d(psi)
        push_N = R_NL @ np.array(push_L)
        velocity_N = R_NL @ np.array(motion[:2])
        offset_N = place_N - odometry.position_N[:2]
        offset_N = self._beyond_slack(offset_N, push_N)
        force_N = self._force(offset_N, velocity_N, push_N, speed_mps, drift_N)
        bow = self._point(force_N, push_N, offset_N, psi, heading)
        thrust = float(force_N @ R_NL[:, 0])
        return self._allocate(thrust, self._turning(bow, psi, motion.yaw_rate, since_s))

    def point(self, odometry: Odometry, given: Float64, bow: float, ahead_n: float) -> Float64:
        """Give the thrust that points the bow [rad] and pushes ahead with a force [N]."""
        since_s = self._since_last(odometry.stamp_ns)
        motion, _ = self.learn(odometry, given)
        moment = self._turning(bow, odometry.heading, motion.yaw_rate, since_s)
        return self._allocate(ahead_n, moment)

    def learn(self, odometry: Odometry, given: Float64) -> tuple[Motion, Push]:
        """Learn of wind and current; give how the boat moves, and their force [N] [L]."""
        motion = Motion(*levelled_twist(odometry).tolist())
        if self._learnt_ns != odometry.stamp_ns:
            self._learnt_ns = odometry.stamp_ns
            thrust = (float(given[0]), float(given[1]))
            self._push_L = self._observer.step(odometry.stamp_ns, motion, odometry.heading, thrust)
        return motion, self._push_L

    def stream_N(self, odometry: Odometry) -> Float64:
        """Give a current, (2,) [m/s] [N], that would push as wind and current together do."""
        motion = levelled_twist(odometry)
        stream = np.zeros(2)
        for i in range(2):
            linear, square = self.hull.linear_drag[i], self.hull.quadratic_drag[i]
            own = float(motion[i])
            force = (linear + square * abs(own)) * own - self._push_L[i]
            size = abs(force)
            if square > 0.0:
                root = math.sqrt(linear * linear + 4.0 * square * size)
                through = (root - linear) / (2.0 * square)
            else:
                through = size / linear if linear > 0.0 else 0.0
            stream[i] = own - math.copysign(through, force)
        out: Float64 = rotation_2d(odometry.heading) @ stream
        return out

    @property
    def moment(self) -> float:
        """[N m] What balances what turns the boat."""
        return self._moment

    def since_s(self, stamp_ns: int) -> float:
        """[s] Since the last step; 0 at the first."""
        last_ns = stamp_ns if self._last_ns is None else self._last_ns
        return min(max((stamp_ns - last_ns) / NANOSECONDS_PER_SECOND, 0.0), 0.5)

    def _since_last(self, stamp_ns: int) -> float:
        since_s = self.since_s(stamp_ns)
        self._last_ns = stamp_ns
        return since_s

    def _beyond_slack(self, offset_N: Float64, push_N: Float64) -> Float64:
        """[m] (2,) Give what counts of an offset: where nothing pushes, all beyond some slack.

        With nothing to lean on, the boat would turn to and fro for the last decimetres.
        """
        weak = WEAK * 2.0 * self.limits.max_n
        calm = max(0.0, 1.0 - float(np.hypot(*push_N)) / (2.0 * weak))
        slack = SLACK_LENGTHS * self.vessel.length_m * calm
        distance = float(np.hypot(*offset_N))
        return offset_N * (max(0.0, distance - slack) / max(distance, 1e-9))

    def _force(
        self,
        offset_N: Float64,
        velocity_N: Float64,
        push_N: Float64,
        speed_mps: float,
        drift_N: Float64 | None,
    ) -> Float64:
        """[N] (2,) What the boat needs: a velocity towards its place, against wind and current."""
        w = self.gains.place
        per_s = 2.0 * DAMPING * w
        distance = float(np.hypot(*offset_N))
        mass = self.hull.inertia[0]
        slowing = math.sqrt(0.5 * self.limits.max_n / mass * distance)
        wanted = min(w * w / per_s * distance, speed_mps, slowing)
        wanted_N = offset_N * (wanted / distance) if distance > 1e-9 else np.zeros(2)
        if drift_N is not None:
            wanted_N = wanted_N + drift_N
        speed = float(np.hypot(*wanted_N))
        drag = self.hull.linear_drag[0] + self.hull.quadratic_drag[0] * speed
        force: Float64 = mass * per_s * (wanted_N - velocity_N) + drag * wanted_N - push_N
        most = self.limits.max_n
        return force * min(1.0, most / max(float(np.hypot(*force)), 1e-9))

    def _point(
        self,
        force_N: Float64,
        push_N: Float64,
        offset_N: Float64,
        psi: float,
        heading: float | None,
    ) -> float:
        """[rad] Where the bow is to point."""
        weak = WEAK * 2.0 * self.limits.max_n
        pushed = float(np.hypot(*push_N))
        if heading is not None:
            self._bow = heading
        elif pushed > weak:
            self._bow = math.atan2(-push_N[1], -push_N[0])
        elif self._bow is None:
            self._bow = psi
        asked = np.array([math.cos(self._bow), math.sin(self._bow)])
        decides_N = -push_N if pushed > weak else force_N
        size = float(np.hypot(*decides_N))
        if float(np.hypot(*offset_N)) > ASTERN_LENGTHS * self.vessel.length_m:
            self._astern = False
        elif size > 0.5 * weak:
            # Bow or stern into the drift as the asked heading has it; the bow if it has neither.
            to_ahead, to_astern = (-0.2, -0.6) if pushed > weak else (0.2, -0.2)
            limit = to_ahead if self._astern else to_astern
            self._astern = float(decides_N @ asked) < limit * size
        way = -1.0 if self._astern else 1.0
        rests = weak * asked - way * push_N  # where it points when it lies still at its place
        rests *= weak / max(float(np.hypot(*rests)), 1e-9)
        self._rests = math.atan2(rests[1], rests[0])
        strength = float(np.hypot(*force_N))
        wanted = way * strength / (strength + 4.0 * weak) * force_N + rests
        return math.atan2(wanted[1], wanted[0])

    def _turning(self, bow: float, psi: float, rate: float, since_s: float) -> float:
        """[N m] The moment that turns the bow; its integral balances what turns the boat."""
        w, inertia = self.gains.turn, self.hull.inertia[2]
        error = float(wrap(bow - psi))
        most = self.hull.lever_m * (self.limits.max_n - self.limits.min_n)
        if abs(error) < 0.3:
            self._moment += since_s * (inertia * w**3 * 0.2 * error - 0.05 * self._moment)
            self._moment = max(-0.5 * most, min(0.5 * most, self._moment))
        error = max(-1.0, min(1.0, error))
        return inertia * (w * w * error - 2.0 * DAMPING * w * rate) + self._moment

    def _allocate(self, ahead: float, moment: float) -> Float64:
        """[N] (2,) Both thrusts; where one is out of range both are shifted, to keep the turn."""
        low, high = self.limits.min_n, self.limits.max_n
        differs = moment / (2.0 * self.hull.lever_m)
        differs = max(-(high - low) / 2.0, min((high - low) / 2.0, differs))
        mean = max(low + abs(differs), min(high - abs(differs), ahead / 2.0))
        return self.limits.clip(np.array([mean + differs, mean - differs]))


# -- Berthing: a way in that ends alongside, foreseen before it is begun.


class Phase(Enum):
    """What a boat does that is to lie at a berth."""

    LINE_UP = "line up"
    """It goes to where the way in begins."""
    APPROACH = "approach"
    """It follows the way in, slowly, and looks for a manoeuvre that ends alongside."""
    LAND = "land"
    """It makes that manoeuvre."""
    STAND_OFF = "stand off"
    """It goes away from the face."""
    ALONGSIDE = "alongside"
    """It has touched as it should: propellers at rest."""
    GIVEN_UP = "given up"
    """Too many tries: it holds its place off the berth."""


@dataclass(frozen=True, slots=True)
class Landing:
    """What the best manoeuvre leads to."""

    bow: float
    """[rad] Where it points the bow, off the face's direction, away from the face positive."""
    ahead_n: float
    """[N] Both propellers together, now."""
    touches: bool
    speed_mps: float
    """[m/s] Over ground when it touches."""
    turned: float
    """[rad] Heading off the face's direction then."""
    along_m: float
    """[m] Ahead of the middle of the berth then."""
    sound: bool
    """Whether all of that is well within what is allowed."""


class Alongside:
    """A berth's face in its own frame: x along it as the bow is to point, y towards it.

    Mirrored where the face is to port, so that there is one problem for both sides. The origin is
    the middle of the face.
    """

    def __init__(self, face_N: Float64, boat_N: Float64) -> None:
        along = face_N[1] - face_N[0]
        self.length_m = float(np.hypot(*along))
        self.heading = math.atan2(along[1], along[0])
        self.middle_N: Float64 = face_N.mean(axis=0)
        R_NL = rotation_2d(self.heading)
        self.side = 1.0 if float((boat_N - self.middle_N) @ R_NL[:, 1]) < 0.0 else -1.0
        self.R_NF: Float64 = R_NL * np.array([1.0, self.side])

    def place_F(self, p_N: Float64) -> Float64:
        """[m] (2,) Along the face, and beyond it (on the water: negative)."""
        place: Float64 = (p_N - self.middle_N) @ self.R_NF
        return place

    def place_N(self, p_F: Float64) -> Float64:
        """[m] (2,) The same back."""
        place: Float64 = self.middle_N + self.R_NF @ p_F
        return place

    def turned(self, heading: float) -> float:
        """[rad] A heading off the face's, towards the face positive."""
        return self.side * float(wrap(heading - self.heading))


class Foreseen:
    """Predicts a table of manoeuvres at once, and gives the best.

    A manoeuvre is: the bow to an angle off the face, by the heading's control; one force ahead for
    a while, another one after that. The hull drifts as what is learnt of wind and current has it.
    """

    STEPS = 50

    def __init__(self, keeper: Keeper) -> None:
        self._keeper = keeper
        vessel, limits = keeper.vessel, keeper.limits
        slow = max(1.0, 1.3 / keeper.gains.turn)  # a hull that turns slowly needs more time
        self.slow = slow
        """[-] How much slower than the default hull this one turns, at least 1."""
        self._step_s = 0.2 * slow
        most = 0.5 * min(limits.max_n, -limits.min_n if limits.min_n < 0.0 else limits.max_n)
        bows = np.radians([-8.0, 0.0, 8.0])
        first = most * np.array([-1.6, -0.7, -0.3, -0.1, 0.0, 0.1, 0.3, 0.7, 1.6])
        second = most * np.array([-0.15, 0.0, 0.15])
        until_s = slow * np.array([0.8, 2.5])
        grid = np.meshgrid(bows, first, second, until_s, indexing="ij")
        self._bows, self._first, self._second, self._until = (g.ravel() for g in grid)
        self._hull = keeper.hull
        self._half_length, self.half_beam_m = vessel.length_m / 2.0, vessel.beam_m / 2.0

    def gap_m(self, place_F: Float64, turned: float) -> float:
        """[m] Between the hull and the face's line."""
        reach = self._half_length * abs(math.sin(turned)) + self.half_beam_m * abs(math.cos(turned))
        return -float(place_F[1]) - reach

    def best(
        self,
        place_F: Float64,
        turned: float,
        motion: Float64,
        stream_F: Float64,
        thrust: Float64,
        moment: float,
    ) -> Landing:
        """Choose.

        Parameters
        ----------
        place_F, turned
            [m], [rad] In the face's frame.
        motion : (3,) float64
            [m/s, m/s, rad/s] Surge, sway, yaw rate over ground, mirrored as the frame is.
        stream_F : (2,) float64
            [m/s] A current that would push as wind and current together do.
        thrust
            [N] (2,) Of the propeller away from the face, and of the one at it.
        moment
            [N m] What balances what turns the boat, mirrored.
        """
        hull, limits, w = self._hull, self._keeper.limits, self._keeper.gains.turn
        low, high, lever = limits.min_n, limits.max_n, hull.lever_m
        (m1, m2, m6), (l1, l2, l6), (q1, q2, q6) = (
            hull.inertia,
            hull.linear_drag,
            hull.quadratic_drag,
        )
        n = len(self._bows)
        x, y = np.full(n, place_F[0]), np.full(n, place_F[1])
        psi = np.full(n, turned)
        u, v, r = (np.full(n, value) for value in motion)
        out, inner = np.full(n, thrust[0]), np.full(n, thrust[1])
        lag = self._keeper.vessel.thrusters.time_constant_s + 0.5 * DELAY_S
        dt, share = self._step_s, 1.0 - math.exp(-self._step_s / lag)
        touched = np.zeros(n, dtype=np.bool_)
        speed, angle, along, when = (np.zeros(n) for _ in range(4))
        for k in range(self.STEPS):
            error = np.clip(self._bows - psi, -1.0, 1.0)
            differs = (m6 * (w * w * error - 2.0 * DAMPING * w * r) + moment) / (2.0 * lever)
            differs = np.clip(differs, -(high - low) / 2.0, (high - low) / 2.0)
            wanted = np.where(k * dt < self._until, self._first, self._second) / 2.0
            size = np.abs(differs)
            mean = np.maximum(low + size, np.minimum(high - size, wanted))
            out += share * (mean + differs - out)
            inner += share * (mean - differs - inner)
            c, s = np.cos(psi), np.sin(psi)
            cu, cv = c * stream_F[0] + s * stream_F[1], c * stream_F[1] - s * stream_F[0]
            ur, vr = u - cu, v - cv
            du = (out + inner + m2 * v * r - (l1 + q1 * np.abs(ur)) * ur) / m1
            dv = (-m1 * u * r - (l2 + q2 * np.abs(vr)) * vr) / m2
            turning = lever * (out - inner) - moment + (m1 - m2) * u * v
            dr = (turning - (l6 + q6 * np.abs(r)) * r) / m6
            u, v, r = u + dt * du, v + dt * dv, r + dt * dr
            x, y = x + dt * (c * u - s * v), y + dt * (s * u + c * v)
            psi = psi + dt * r
            reach = y + self._half_length * np.abs(np.sin(psi))
            reach += self.half_beam_m * np.abs(np.cos(psi))
            new = (reach >= -0.05) & ~touched
            if new.any():
                speed[new] = np.hypot(u[new], v[new])
                angle[new], along[new], when[new] = psi[new], x[new], k * dt
                touched |= new
                if touched.all():
                    break
        still = ~touched
        speed[still], angle[still] = np.hypot(u[still], v[still]), psi[still]
        along[still], when[still] = x[still], self.STEPS * dt
        gap = np.where(touched, 0.0, np.maximum(-reach, 0.0))
        tolerance = self._keeper.settings
        cost = (
            4.0 * (speed / tolerance.contact_mps) ** 2
            + (angle / math.radians(tolerance.contact_deg)) ** 2
            + (along / tolerance.along_m) ** 2
            + 30.0 * np.maximum(speed / tolerance.contact_mps - 0.8, 0.0)
            + np.where(touched, 0.1 * when, 3.0 + 4.0 * gap)
        )
        k = int(np.argmin(cost))
        sound = bool(
            touched[k]
            and speed[k] < 0.8 * tolerance.contact_mps
            and abs(angle[k]) < 0.7 * math.radians(tolerance.contact_deg)
            and abs(along[k]) < 0.7 * tolerance.along_m
        )
        now = self._first[k] if self._until[k] > 0.0 else self._second[k]
        return Landing(
            float(self._bows[k]),
            float(now),
            bool(touched[k]),
            float(speed[k]),
            float(angle[k]),
            float(along[k]),
            sound,
        )


class Berthing:
    """Brings a boat alongside one face, tries again when it goes wrong, and gives up in the end."""

    def __init__(self, keeper: Keeper, berth: Berth, boat_N: Float64) -> None:
        self.keeper = keeper
        self.berth = berth
        self.face = Alongside(berth.face_N, boat_N)
        self.foreseen = Foreseen(keeper)
        self.phase = Phase.LINE_UP
        self.tries = 0
        self._way_m = 0.0
        self._landings = 0
        self._stream_F = np.zeros(2)
        self._since_s = 0.0
        self._bad_s = 0.0
        self.gap_m = math.inf
        self.found = Landing(0.0, 0.0, False, 0.0, 0.0, 0.0, False)
        length = keeper.vessel.length_m
        self._clear_m = max(CLEAR_M, 0.1 * length)
        # The way in ends where the hull touches; it comes at an angle, from astern.
        self._beam_m = self.foreseen.half_beam_m
        self._begins_m = WAY_IN_LENGTHS * length + self._beam_m

    @property
    def line_up_N(self) -> Float64:
        """[m] [N] (2,) Where the way in begins."""
        return self.face.place_N(self._on_way(self._begins_m))

    def _on_way(self, left_m: float) -> Float64:
        """[m] (2,) A place on the way in, so far from its end, in the face's frame."""
        c, s = math.cos(WAY_IN_RAD), math.sin(WAY_IN_RAD)
        return np.array([-c * left_m, -s * left_m - self._beam_m])

    @property
    def lies(self) -> bool:
        """Whether the boat lies alongside."""
        return self.phase is Phase.ALONGSIDE

    @property
    def is_coming_in(self) -> bool:
        """Whether the face may be touched now: nothing else ever may."""
        return self.phase in (Phase.APPROACH, Phase.LAND, Phase.ALONGSIDE)

    def others(self, tracks: Tracks) -> Tracks:
        """Give all tracks but those that stand still on the face, while the boat comes in."""
        if not self.is_coming_in or not len(tracks.id):
            return tracks
        places = (tracks.p_N - self.face.middle_N) @ self.face.R_NF
        still = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1]) < STILL_MPS
        along = np.abs(places[:, 0]) <= 0.5 * self.face.length_m + FACE_M
        keep = ~(still & along & (places[:, 1] >= -FACE_M))
        return tracks if keep.all() else tracks.only(keep)

    def interrupt(self, stamp_ns: int, why: str) -> tuple[HealthEvent, ...]:
        """Break off a way in, if there is one."""
        if self.phase not in (Phase.APPROACH, Phase.LAND):
            return ()
        return self._off(stamp_ns, why)

    def _in_the_way(self, odometry: Odometry, tracks: Tracks) -> str:
        """Say which vessel comes too near the boat while it comes in; empty if none does."""
        if not len(tracks.id):
            return ""
        apart = tracks.p_N - odometry.position_N[:2]
        moves = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1]) >= STILL_MPS
        times = np.array([0.0, 2.0, 4.0])[:, None, None]
        later = np.linalg.norm(apart + times * tracks.v_N, axis=2).min(axis=0) - tracks.radius
        near = np.flatnonzero(moves & (later < 1.5 * self.keeper.vessel.length_m))
        return f"track {tracks.id[near[0]]} is in the way" if len(near) else ""

    def step(
        self, odometry: Odometry, given: Float64, tracks: Tracks | None = None
    ) -> tuple[Float64, tuple[HealthEvent, ...]]:
        """Give the thrust, (2,) [N] left and right, and what there is to report."""
        if tracks is not None and self.phase in (Phase.APPROACH, Phase.LAND):
            why = self._in_the_way(odometry, tracks)
            if why:
                return self._leave(odometry, given), self._off(odometry.stamp_ns, why)
        return self._go(odometry, given)

    def _go(self, odometry: Odometry, given: Float64) -> tuple[Float64, tuple[HealthEvent, ...]]:
        keeper, face, settings = self.keeper, self.face, self.keeper.settings
        stamp_ns = odometry.stamp_ns
        place_F = face.place_F(odometry.position_N[:2])
        turned = face.turned(odometry.heading)
        self.gap_m = self.foreseen.gap_m(place_F, turned)
        speed = float(np.hypot(*odometry.velocity_B[:2]))
        cruise = settings.speed_share * keeper.vessel.top_speed_mps
        dt = keeper.since_s(stamp_ns)
        events: list[HealthEvent] = []
        if self.phase in (Phase.APPROACH, Phase.LAND) and self.gap_m <= settings.alongside_m:
            lies = (
                speed <= settings.contact_mps
                and abs(turned) <= math.radians(settings.contact_deg)
                and abs(float(place_F[0])) <= settings.along_m
            )
            if lies:
                return self._touched(stamp_ns, place_F, turned, speed)
            if self.gap_m <= 0.0:
                words = (
                    f"touched at {speed:.2f} m/s, {math.degrees(turned):+.0f} deg, "
                    f"{place_F[0]:+.1f} m along"
                )
                return self._leave(odometry, given), self._off(stamp_ns, words)
        if self.phase is Phase.ALONGSIDE:
            keeper.learn(odometry, given)
            return np.zeros(2), ()
        if self.phase is Phase.LINE_UP:
            thrust = keeper.steer(odometry, given, self.line_up_N, None, speed_mps=cruise)
            off = float(np.hypot(*(self.line_up_N - odometry.position_N[:2])))
            self._since_s = self._since_s + dt if off < 0.2 * keeper.vessel.length_m + 0.3 else 0.0
            if self._since_s > 3.0 * LEARN_S:
                self.phase, self._way_m, self._since_s = Phase.APPROACH, self._begins_m, 0.0
                self.tries += 1
                self._landings = 0
                events.append(BERTH_APPROACH.at(stamp_ns, f"try {self.tries} of {settings.tries}"))
            return thrust, tuple(events)
        if self.phase in (Phase.STAND_OFF, Phase.GIVEN_UP):
            thrust = keeper.steer(odometry, given, self.line_up_N, None, speed_mps=cruise)
            off = float(np.hypot(*(self.line_up_N - odometry.position_N[:2])))
            if self.phase is Phase.STAND_OFF and off < keeper.vessel.length_m:
                self.phase, self._since_s = Phase.LINE_UP, 0.0
            return thrust, ()
        # -- On the way in, or landing.
        motion = levelled_twist(odometry) * np.array([1.0, face.side, face.side])
        if self.phase is Phase.APPROACH:  # while it lands, the motion is too quick to learn from
            self._stream_F = keeper.stream_N(odometry) @ face.R_NF
        stream_F = self._stream_F
        sides = given if face.side > 0.0 else given[::-1]
        near = self.gap_m < 0.3 * keeper.vessel.length_m + 0.3
        if near or self.phase is Phase.LAND:
            self.found = self.foreseen.best(
                place_F, turned, motion, stream_F, sides, face.side * keeper.moment
            )
        found = self.found
        if self.phase is Phase.APPROACH:
            rate = min(0.08, 0.25 * keeper.gains.place)
            slow = min(max(rate * self._way_m, settings.closing_mps), cruise)
            way_F = np.array([math.cos(WAY_IN_RAD), math.sin(WAY_IN_RAD)])
            off_F = self._on_way(self._way_m) - place_F
            behind, aside = float(off_F @ way_F), float(off_F @ (way_F[::-1] * [1.0, -1.0]))
            follows = max(behind, abs(aside)) < 0.3 * keeper.vessel.length_m + 0.3
            moves = follows and self._way_m > -BEYOND_M
            too_near = (
                abs(turned) > math.radians(settings.contact_deg) and self.gap_m < self._clear_m
            )
            if too_near:
                self._way_m, moves = self._way_m + 0.3 * slow * dt, False
            elif moves:
                self._way_m = max(-BEYOND_M, self._way_m - slow * dt)
            drift_N = face.R_NF @ way_F * (slow if moves else 0.0)
            place_N = face.place_N(self._on_way(self._way_m))
            bow = face.heading + face.side * self._bow_on_way()
            thrust = keeper.steer(
                odometry, given, place_N, bow, speed_mps=min(cruise, 2.0 * slow), drift_N=drift_N
            )
            if near and found.sound:
                self.phase, self._bad_s, self._since_s = Phase.LAND, 0.0, 0.0
                self._landings += 1
            elif too_near or self._way_m <= -BEYOND_M:
                self._bad_s += dt
                if self._bad_s > 10.0:
                    return thrust, self._off(stamp_ns, f"nothing leads alongside: {_words(found)}")
            if self.phase is Phase.APPROACH:
                return thrust, ()
        self._since_s += dt
        late = self._since_s > LAND_S * self.foreseen.slow
        if (not found.touches or late) and self._landings < LANDINGS:
            self._bad_s += dt
            if self._bad_s > 0.8:
                self.phase, self._bad_s = Phase.APPROACH, 0.0
                self._way_m = AGAIN_M
            bow = face.heading + face.side * found.bow
            return keeper.point(odometry, given, bow, found.ahead_n), ()
        bad = late or not found.touches or found.speed_mps > settings.contact_mps
        self._bad_s = self._bad_s + dt if bad or (not found.sound and not found.touches) else 0.0
        if self._bad_s > 2.0:
            return self._leave(odometry, given), self._off(stamp_ns, _words(found))
        bow = face.heading + face.side * found.bow
        return keeper.point(odometry, given, bow, found.ahead_n), ()

    def _bow_on_way(self) -> float:
        """[rad] Off the face: bow or stern into the drift, whichever is nearer to lying alongside.

        Without a drift along the way in.
        """
        if float(np.hypot(*self._stream_F)) < 0.03 * self.keeper.vessel.top_speed_mps:
            return WAY_IN_RAD
        into = math.atan2(-self._stream_F[1], -self._stream_F[0])
        return into if abs(into) < math.radians(100.0) else float(wrap(into + math.pi))

    def _leave(self, odometry: Odometry, given: Float64) -> Float64:
        cruise = self.keeper.settings.speed_share * self.keeper.vessel.top_speed_mps
        return self.keeper.steer(odometry, given, self.line_up_N, None, speed_mps=cruise)

    def _off(self, stamp_ns: int, why: str) -> tuple[HealthEvent, ...]:
        """Stand off, to try again, or for good."""
        last = self.tries >= self.keeper.settings.tries
        self.phase = Phase.GIVEN_UP if last else Phase.STAND_OFF
        kind = BERTH_GIVEN_UP if last else BERTH_ABORTED
        self._bad_s = 0.0
        return (kind.at(stamp_ns, f"{why}; try {self.tries} of {self.keeper.settings.tries}"),)

    def _touched(
        self, stamp_ns: int, place_F: Float64, turned: float, speed: float
    ) -> tuple[Float64, tuple[HealthEvent, ...]]:
        self.phase = Phase.ALONGSIDE
        words = (
            f"{speed:.2f} m/s, {math.degrees(turned):+.1f} deg, {place_F[0]:+.2f} m along, "
            f"try {self.tries}"
        )
        return np.zeros(2), (BERTHED.at(stamp_ns, words),)


def _words(found: Landing) -> str:
    if not found.touches:
        return "it would not reach the face"
    return (
        f"it would touch at {found.speed_mps:.2f} m/s, {math.degrees(found.turned):+.0f} deg, "
        f"{found.along_m:+.1f} m along"
    )
