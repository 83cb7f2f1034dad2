"""The core with its doors: payloads in, in the order they came; decisions out.

`run`, `sitl`, the experiments and `replay` all feed this one object, so that a recording of what
went in gives the same decisions again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from twinscrew.runtime.app.freshness import Freshness
from twinscrew.runtime.app.odometry_buffer import (
    Arrival,
    OdometryBuffer,
    OdometryBufferSettings,
    seconds_between,
)
from twinscrew.runtime.app.pipeline import Pipeline
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import (
    Decision,
    Engagement,
    Float64,
    Goal,
    HealthEvent,
    Odometry,
    PointCloud,
)
from twinscrew.runtime.safety.events import (
    BAD_MESSAGE,
    CLOCK_BACK,
    INPUT_FROZEN,
    INPUT_LATE,
    INTERNAL_ERROR,
    ODOMETRY_JUMP,
    ODOMETRY_MISSING,
    OUT_OF_ORDER,
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one payload."""

    stamp_ns: int | None = None
    """[ns] The message's stamp; None if it could not be read, or not be used."""
    decision: Decision | None = None
    """The decision, if the message was a scan that could be used."""
    events: tuple[HealthEvent, ...] = ()
    """What an operator should know, besides the decision's own events."""


class Core:
    """Decodes, puts in order, and steps the pipeline on every scan."""

    def __init__(self, pipeline: Pipeline, odometry: OdometryBufferSettings | None = None) -> None:
        self.pipeline = pipeline
        settings = odometry or OdometryBufferSettings()
        self._odometry = OdometryBuffer(settings)
        self._clock_back_s = settings.clock_back_s
        self._max_lag_s = settings.max_lag_s
        self._freshness = Freshness()
        self._engaged = False
        self._last_scan_ns: int | None = None
        self._latest_ns = 0
        self._doors: dict[str, Callable[[bytes], Outcome]] = {
            "points": lambda payload: self._scan(cdr.decode_point_cloud(payload)),
            "odometry": lambda payload: self._add_odometry(cdr.decode_odometry(payload)),
            "goal": lambda payload: self._set_goal(cdr.decode_goal(payload)),
            "route": lambda payload: self._set_route(*cdr.decode_path(payload)),
            "engagement": lambda payload: self._engage(cdr.decode_engagement(payload)),
        }

    @property
    def latest_ns(self) -> int:
        """[ns] The stamp of the last scan or odometry that was in order: what time it is."""
        return self._latest_ns

    @property
    def odometry(self) -> Odometry | None:
        """The last odometry that was in order."""
        return self._odometry.newest

    @property
    def scan_ns(self) -> int | None:
        """[ns] The stamp of the last scan that was in order, whether it could be used or not."""
        return self._last_scan_ns

    @property
    def knows_surroundings(self) -> bool:
        """Whether what is around has been seen for long enough; see `Pipeline`."""
        return self.pipeline.knows_surroundings

    @property
    def is_settling(self) -> bool:
        """Whether the thrust is zero because what is around was forgotten; see `Pipeline`."""
        return self.pipeline.is_settling

    def feed(self, topic: str, payload: bytes) -> Outcome:
        """Take in one message of a core input topic; it never raises.

        A fault of the runtime itself is an `internal_error`, after which everything remembered of
        the surroundings is forgotten: the next scan starts afresh.
        """
        try:
            return self._doors[topic](payload)
        except MessageError as error:
            return Outcome(events=(BAD_MESSAGE.at(self._latest_ns, f"{topic}: {error}"),))
        except Exception as error:  # must stop the boat, not the loop
            self.pipeline.reset()
            detail = f"{topic}: {type(error).__name__}: {error}"
            # The sensor lives, if its message got as far as to set the time.
            event = INTERNAL_ERROR.at(self._latest_ns, detail)
            return Outcome(stamp_ns=self._latest_ns, events=(event,))

    def _engage(self, engagement: Engagement) -> Outcome:
        self._engaged = engagement.engaged
        return Outcome(stamp_ns=engagement.stamp_ns)

    def _set_goal(self, goal: Goal) -> Outcome:
        return Outcome(stamp_ns=goal.stamp_ns, events=(self.pipeline.set_goal(goal),))

    def _set_route(self, stamp_ns: int, places_N: Float64) -> Outcome:
        return Outcome(stamp_ns=stamp_ns, events=(self.pipeline.set_route(places_N, stamp_ns),))

    def _add_odometry(self, odometry: Odometry) -> Outcome:
        stamp_ns = odometry.stamp_ns
        if self._freshness.odometry_repeats(odometry):
            return Outcome(events=(INPUT_FROZEN.at(self._latest_ns, "odometry"),))
        arrival = self._odometry.add(odometry)
        events: tuple[HealthEvent, ...] = ()
        if arrival is Arrival.OLD:
            late = OUT_OF_ORDER.at(self._latest_ns, f"odometry of {stamp_ns} ns")
            return Outcome(events=(late,))
        if arrival is Arrival.CLOCK_BACK:
            events = (self._restart("odometry", stamp_ns),)
        elif arrival is Arrival.JUMP:
            self.pipeline.reset()
            north, east = odometry.position_N[:2]
            events = (ODOMETRY_JUMP.at(stamp_ns, f"to north {north:.1f} m, east {east:.1f} m"),)
        self._latest_ns = stamp_ns
        return Outcome(stamp_ns=stamp_ns, events=events)

    def _scan(self, cloud: PointCloud) -> Outcome:
        stamp_ns = cloud.stamp_ns
        events: tuple[HealthEvent, ...] = ()
        if self._last_scan_ns is not None and stamp_ns <= self._last_scan_ns:
            if seconds_between(stamp_ns, self._last_scan_ns) <= self._clock_back_s:
                late = OUT_OF_ORDER.at(self._latest_ns, f"scan of {stamp_ns} ns")
                return Outcome(events=(late,))
            self._odometry.clear()
            events = (self._restart("points", stamp_ns),)
        lag_s = seconds_between(stamp_ns, self._latest_ns)
        self._last_scan_ns = self._latest_ns = stamp_ns
        odometry = self._odometry.at(stamp_ns)
        if odometry is None:
            missing = ODOMETRY_MISSING.at(stamp_ns)
            return Outcome(events=(*events, missing))
        if not events and lag_s > self._max_lag_s:
            late = INPUT_LATE.at(stamp_ns, f"a scan {lag_s:.2f} s older than the odometry")
            return Outcome(events=(late,))
        if self._freshness.scan_repeats(cloud, odometry):
            return Outcome(events=(*events, INPUT_FROZEN.at(stamp_ns, "points")))
        decision = self.pipeline.step(cloud, odometry, engaged=self._engaged)
        return Outcome(stamp_ns=stamp_ns, decision=decision, events=events)

    def _restart(self, topic: str, stamp_ns: int) -> HealthEvent:
        self.pipeline.reset()
        self._last_scan_ns = None
        back_s = seconds_between(stamp_ns, self._latest_ns)
        return CLOCK_BACK.at(stamp_ns, f"{topic}: {back_s:.3f} s before the last message")
