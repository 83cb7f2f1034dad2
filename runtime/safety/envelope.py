"""The operational envelope: what the boat was proved for, and what it does when it leaves it.

The words are those of the draft MASS Code: while a ship is outside its operational envelope, a
*fallback response* brings it into a *fallback state*. Each quantity is estimated from what the boat
measures anyway (docs/odd.md says how, and what cannot be estimated); the worst response of all that
have been left counts. Limits, and everything else here, are settings: config/envelope.toml.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

import numpy as np

from twinscrew.runtime.geometry import euler_from_quaternion
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float32,
    Float64,
    HealthEvent,
    Odometry,
)
from twinscrew.runtime.safety.events import ENVELOPE_LEFT, ENVELOPE_RETURNED, FALLBACK
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings

MOVING_MPS: Final = 0.5
"""[m/s] Slower tracks are not traffic (paper, sec. IV)."""
TRAFFIC_M: Final = 20.0
"""[m] Nor are those whose hulls are farther (paper, sec. III: as far as its vessels see)."""
SEA_WINDOW_S: Final = 20.0
"""[s] Waves are measured over this: four of the paper's longest."""
SEA_SAMPLE_NS: Final = NANOSECONDS_PER_SECOND // 10
"""[ns] Between two samples of them."""
SEA_LEAST_S: Final = 10.0
"""[s] Before this nothing is said of the sea."""
UPWARDS_RAD: Final = math.radians(8.5)
"""[rad] Beams that rise more pass 3 m over the LiDAR at 20 m."""
VISIBILITY_EVERY_S: Final = 0.5
"""[s] The range image is looked at so often: that takes 0.2 ms."""
SIDES: Final = 12
"""[-] All around."""
CLEARER_SIDES: Final = 0.25
"""[-] The share of sides that are as clear as is said, or clearer."""
MOST_NARROWING: Final = 0.999
"""[-] A scan of nothing but clutter."""


class Response(Enum):
    """What the boat does outside its envelope, the mildest first."""

    NONE = "none"
    SLOW = "slow"
    """It sails on, slowly."""
    HOLD = "hold"
    """It keeps the place where it is."""
    STOP = "stop"
    """Propellers at rest."""
    HAND_OVER = "hand_over"
    """Propellers at rest and the channels a pilot's, until an operator gives a new order."""


class Bound(Settings, frozen=True):
    """The limit of one quantity, and what is done beyond it."""

    limit: Positive = 1.0
    """[the quantity's] Proved up to this, or down to it for visibility and depth."""
    response: Literal["none", "slow", "hold", "stop", "hand_over"] = "none"
    """What the boat does beyond it; "none": it only says so."""
    after_s: NonNegative = 2.0
    """[s] So long beyond it, without a break, the envelope is left."""
    back_after_s: NonNegative = 5.0
    """[s] So long well inside, it is entered again."""
    required: bool = False
    """Whether it counts as left, too, while the quantity cannot be estimated."""


def _bound(limit: float, response: str, after_s: float = 2.0, back_after_s: float = 5.0) -> Bound:
    return Bound(limit=limit, response=response, after_s=after_s, back_after_s=back_after_s)  # type: ignore[arg-type]


class EnvelopeSettings(Settings, frozen=True):
    """What the boat was proved for. A configuration may name a file of these instead."""

    enabled: bool = True
    """Whether it is watched."""
    wave_height_m: Bound = _bound(0.6, "slow", 5.0, 20.0)
    """[m] Significant height of the waves, by the boat's own heave."""
    motion_deg: Bound = _bound(5.0, "slow", 2.0, 20.0)
    """[deg] Significant roll or pitch, the greater: twice the standard deviation."""
    drift_share: Bound = _bound(0.11, "slow", 3.0, 10.0)
    """[-] Force of wind and current together, as a share of the greatest thrust ahead."""
    visibility_m: Bound = _bound(60.0, "stop", 1.0, 3.0)
    """[m] How far the LiDAR's beams come on the average before spray, rain or fog ends them."""
    traffic: Bound = _bound(6.0, "slow", 2.0, 5.0)
    """[-] Moving tracks within 20 m."""
    speed_share: Bound = _bound(1.3, "slow", 1.0, 3.0)
    """[-] Speed over ground, as a share of the top speed in still water."""
    depth_m: Bound = _bound(1.0, "stop", 0.5, 3.0)
    """[m] Water under the echo sounder, where the autopilot has one (WATER_DEPTH)."""
    station_s: Bound = _bound(10.0, "hold", 0.0, 2.0)
    """[s] Since the last heartbeat of a ground station; not before the first."""
    lateness_ms: Bound = _bound(300.0, "slow", 0.0, 3.0)
    """[ms] The latest decision or tick of the last two seconds."""
    slow_share: Fraction = 0.4
    """[-] "Slow" is this share of the top speed."""
    inside: Fraction = 0.9
    """[-] Well inside is this share of the way to a limit."""


QUANTITIES: Final = tuple(
    name
    for name in EnvelopeSettings.__struct_fields__
    if isinstance(getattr(EnvelopeSettings(), name), Bound)
)
LEAST: Final = frozenset({"visibility_m", "depth_m"})
"""Quantities that must not be less than their limit; all others not more."""
_ORDER: Final = tuple(Response)


@dataclass(slots=True)
class _Watch:
    """What is remembered of one quantity."""

    bound: Bound
    least: bool
    left: bool = False
    since_s: float | None = None
    value: float = math.nan

    def step(self, value: float, now_s: float, inside: float) -> bool:
        """Take an estimate, NaN for none; tells whether the envelope was left or entered by it."""
        self.value = value
        if math.isnan(value):
            beyond, within = self.bound.required, False
        elif self.least:
            beyond, within = value < self.bound.limit, value >= self.bound.limit / inside
        else:
            beyond, within = value > self.bound.limit, value <= self.bound.limit * inside
        wanted = within if self.left else beyond
        if not wanted:
            self.since_s = None
            return False
        if self.since_s is None:
            self.since_s = now_s
        if now_s - self.since_s < (self.bound.back_after_s if self.left else self.bound.after_s):
            return False
        self.left, self.since_s = not self.left, None
        return True


class Envelope:
    """Watches the quantities of one boat, and chooses its response; times are the caller's."""

    def __init__(self, settings: EnvelopeSettings | None = None) -> None:
        self.settings = settings or EnvelopeSettings()
        self.response = Response.NONE
        self._watches = {
            name: _Watch(getattr(self.settings, name), name in LEAST) for name in QUANTITIES
        }
        self._order_at_hand_over: int | None = None

    def step(
        self, estimates: Mapping[str, float], now_s: float, stamp_ns: int, *, order: int = 0
    ) -> list[HealthEvent]:
        """Follow the estimates.

        Parameters
        ----------
        estimates
            Of `QUANTITIES`; what is missing or NaN cannot be estimated now.
        order
            Counts the operator's orders: a new one ends a hand-over whose reason is over.

        Returns
        -------
        list of HealthEvent
            `envelope_left` and `envelope_returned` for each quantity, `fallback` when the response
            changes.
        """
        if not self.settings.enabled:
            return []
        events = []
        for name, watch in self._watches.items():
            if watch.step(estimates.get(name, math.nan), now_s, self.settings.inside):
                kind = ENVELOPE_LEFT if watch.left else ENVELOPE_RETURNED
                events.append(kind.at(stamp_ns, self._words(name)))
        response = self._worst(order)
        if response is not self.response:
            self.response = response
            events.append(FALLBACK.at(stamp_ns, self.words))
        return events

    @property
    def words(self) -> str:
        """The response, and why; or that the boat is inside."""
        left = [self._words(name) for name, watch in self._watches.items() if watch.left]
        if not left and self.response is Response.NONE:
            return "inside the operational envelope"
        why = "; ".join(left) or "until an operator gives a new order"
        return f"fallback response {self.response.value.replace('_', ' ')}: {why}"

    @property
    def state(self) -> str:
        """Every quantity that is estimated, with its limit, for a display."""
        known = [
            self._words(name)
            for name, watch in self._watches.items()
            if not math.isnan(watch.value) or watch.left
        ]
        return f"{self.response.value}: " + "; ".join(known)

    def _words(self, name: str) -> str:
        watch = self._watches[name]
        value = "not known" if math.isnan(watch.value) else f"{watch.value:.3g}"
        return f"{name} {value}, proved {'down' if watch.least else 'up'} to {watch.bound.limit:g}"

    def _worst(self, order: int) -> Response:
        wanted = [Response(watch.bound.response) for watch in self._watches.values() if watch.left]
        worst = max(wanted, key=_ORDER.index, default=Response.NONE)
        if worst is Response.HAND_OVER:
            self._order_at_hand_over = order
        elif self._order_at_hand_over == order:
            return Response.HAND_OVER
        else:
            self._order_at_hand_over = None
        return worst


# -- What the boat measures, as quantities of the envelope.


class SeaState:
    """Waves, by how the boat moves in them: heave, roll and pitch of the last `SEA_WINDOW_S`."""

    def __init__(self) -> None:
        count = round(SEA_WINDOW_S * NANOSECONDS_PER_SECOND / SEA_SAMPLE_NS)
        self._samples: deque[tuple[int, float, float, float]] = deque(maxlen=count)
        self._known = (math.nan, math.nan)
        self._known_ns = 0

    def step(self, odometry: Odometry) -> tuple[float, float]:
        """Take the boat's motion; gives wave height [m] and angle [deg], NaN if not known yet."""
        stamp_ns = odometry.stamp_ns
        last_ns = self._samples[-1][0] if self._samples else stamp_ns - SEA_SAMPLE_NS
        if not 0 <= stamp_ns - last_ns <= NANOSECONDS_PER_SECOND:
            self._samples.clear()  # a clock was set, or there was nothing for long
            self._known, self._known_ns = (math.nan, math.nan), 0
        elif stamp_ns - last_ns < SEA_SAMPLE_NS:
            return self._known
        roll, pitch, _ = euler_from_quaternion(odometry.q_NB)
        self._samples.append((stamp_ns, float(odometry.position_N[2]), roll, pitch))
        long_s = (stamp_ns - self._samples[0][0]) / NANOSECONDS_PER_SECOND
        if long_s >= SEA_LEAST_S and stamp_ns - self._known_ns >= NANOSECONDS_PER_SECOND:
            self._known_ns = stamp_ns
            _, heave, *angles = np.array(self._samples).T
            slow = np.polyfit(np.arange(len(heave)), heave, 1)  # tide, and the drift of a sensor
            height = 4.0 * float(np.std(heave - np.polyval(slow, np.arange(len(heave)))))
            self._known = height, math.degrees(2.0 * max(float(np.std(a)) for a in angles))
        return self._known


class Visibility:
    """How far beams come on the average, by those that look up and end all the same.

    Drops in the air end beams at random: 1 - exp(-range / visibility) of them within the range
    (Beer and Lambert). Beams that rise by more than `UPWARDS_RAD` pass over boats and buoys, so
    that what they meet is in the air. What stands high, as a wall or trees, stands on some sides;
    fog is on all. So the clearer sides count; under a bridge it is still too low.

    Parameters
    ----------
    elevations : (M,) float64
        Of the beams [rad], lowest first.
    range_m
        [m] Up to which echoes are used.
    """

    def __init__(self, elevations: Float64, range_m: float) -> None:
        self._first = int(np.searchsorted(elevations, UPWARDS_RAD))
        self._range_m = range_m
        self._known = math.nan
        self._known_s = -math.inf

    def step(self, image: Callable[[], Float32], now_s: float) -> float:
        """Give it [m], NaN if no beam looks up; the range image, (M, W), is asked for seldom."""
        if now_s - self._known_s >= VISIBILITY_EVERY_S:
            self._known_s = now_s
            upper = image()[self._first :]
            if upper.size:
                sides = np.array_split(upper > 0.0, min(SIDES, upper.shape[1]), axis=1)
                shares = np.array([side.mean() for side in sides])
                ended = min(float(np.quantile(shares, CLEARER_SIDES)), MOST_NARROWING)
                self._known = -self._range_m / math.log1p(-ended) if ended else math.inf
        return self._known


def slowed(thrust: Float64, surge_mps: float, most_mps: float, gain_nspm: float) -> Float64:
    """Give a thrust, (2,) [N], whose mean drives the boat no faster than `most_mps`.

    Both propellers are changed alike, so that the boat still turns as it was told; the caller puts
    the result into the thrusters' limits.
    """
    mean = float(thrust.mean())
    most = gain_nspm * (most_mps - surge_mps)
    return thrust if mean <= most else thrust - (mean - most)
