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
from typing import Final

import numpy as np

from twinscrew.runtime.geometry import rotation_2d, wrap
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    HealthEvent,
    Odometry,
    Station,
)
from twinscrew.runtime.policy.observation import levelled_twist
from twinscrew.runtime.safety.events import STATION_HEADING
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.safety.prediction import (
    AssuranceVessel,
    DisturbanceObserver,
    Foresight,
    Motion,
)
from twinscrew.runtime.settings import Fraction, Settings
from twinscrew.runtime.vessel_description import VesselDescription


class StationSettings(Settings, frozen=True):
    """How a place is held."""

    speed_share: Fraction = 0.4
    """[-] The vessel goes back to its place at no more than this share of its top speed."""


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
        self._hull = AssuranceVessel.of(vessel)
        # Foresight's equations of motion alone are used here; the rules of contact are not.
        model = Foresight(
            self._hull, steps=1, dt=0.1, slew_nps=1.0, margin_m=0.0, approach_per_s=1.0
        )
        self._observer = DisturbanceObserver(
            model.acceleration,
            self._hull.inertia[:2],
            time_constant_s=LEARN_S,
            limit_n=2.0 * limits.max_n,
        )
        self.reset()

    def reset(self) -> None:
        """Forget where the bow was to point; what wind and current do is remembered."""
        self._observer.pause()
        self._bow: float | None = None
        self._rests = 0.0
        self._astern = False
        self._moment = 0.0
        self._last_ns: int | None = None
        self._kept_s = 0.0
        self._told: bool | None = None

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
        motion = Motion(*levelled_twist(odometry).tolist())
        psi = odometry.heading
        push_L = self._observer.step(
            odometry.stamp_ns, motion, psi, (float(given[0]), float(given[1]))
        )
        R_NL = rotation_2d(psi)
        push_N = R_NL @ np.array(push_L)
        velocity_N = R_NL @ np.array(motion[:2])
        offset_N = place_N - odometry.position_N[:2]
        offset_N = self._beyond_slack(offset_N, push_N)
        force_N = self._force(offset_N, velocity_N, push_N, speed_mps, drift_N)
        bow = self._point(force_N, push_N, offset_N, psi, heading)
        thrust = float(force_N @ R_NL[:, 0])
        return self._allocate(thrust, self._turning(bow, psi, motion.yaw_rate, since_s))

    def _since_last(self, stamp_ns: int) -> float:
        last_ns = stamp_ns if self._last_ns is None else self._last_ns
        self._last_ns = stamp_ns
        return min(max((stamp_ns - last_ns) / NANOSECONDS_PER_SECOND, 0.0), 0.5)

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
        mass = self._hull.inertia[0]
        slowing = math.sqrt(0.5 * self.limits.max_n / mass * distance)
        wanted = min(w * w / per_s * distance, speed_mps, slowing)
        wanted_N = offset_N * (wanted / distance) if distance > 1e-9 else np.zeros(2)
        if drift_N is not None:
            wanted_N = wanted_N + drift_N
        speed = float(np.hypot(*wanted_N))
        drag = self._hull.linear_drag[0] + self._hull.quadratic_drag[0] * speed
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
        w, inertia = self.gains.turn, self._hull.inertia[2]
        error = float(wrap(bow - psi))
        most = self._hull.lever_m * (self.limits.max_n - self.limits.min_n)
        if abs(error) < 0.3:
            self._moment += since_s * (inertia * w**3 * 0.2 * error - 0.05 * self._moment)
            self._moment = max(-0.5 * most, min(0.5 * most, self._moment))
        error = max(-1.0, min(1.0, error))
        return inertia * (w * w * error - 2.0 * DAMPING * w * rate) + self._moment

    def _allocate(self, ahead: float, moment: float) -> Float64:
        """[N] (2,) Both thrusts; where one is out of range both are shifted, to keep the turn."""
        low, high = self.limits.min_n, self.limits.max_n
        differs = moment / (2.0 * self._hull.lever_m)
        differs = max(-(high - low) / 2.0, min((high - low) / 2.0, differs))
        mean = max(low + abs(differs), min(high - abs(differs), ahead / 2.0))
        return self.limits.clip(np.array([mean + differs, mean - differs]))
