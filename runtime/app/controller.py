"""One vessel's runtime without its sockets and its clock.

`run` wraps it in real time, the lock-step driver in simulated time; what they share is everything
that decides whether a propeller turns. Messages and MAVLink bytes come in with the time; MAVLink
bytes, and messages to publish, go out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from twinscrew.runtime.app.core import Core
from twinscrew.runtime.app.health import Facts, Health, State
from twinscrew.runtime.app.odometry_source import SENSED, OdometrySource
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotStatus
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.types import (
    Decision,
    Engagement,
    Explanation,
    Float64,
    HealthEvent,
)
from twinscrew.runtime.safety.events import (
    BAD_MESSAGE,
    GUARD_TRIPPED,
    INTERNAL_ERROR,
    LIDAR_STALE,
    ODOMETRY_STALE,
    PERCEPTION_ERROR,
    POLICY_ERROR,
)
from twinscrew.runtime.safety.explain import assurance_manoeuvre, explain
from twinscrew.runtime.safety.guard import NEUTRAL, Guard, Watchdog

FAULTS = {kind.name for kind in (POLICY_ERROR, PERCEPTION_ERROR, GUARD_TRIPPED, INTERNAL_ERROR)}


WATCHED = {"points": LIDAR_STALE, "odometry": ODOMETRY_STALE}
"""The inputs that must keep coming, and what it is called when they do not."""

FAULT_HOLD_S = 1.0
"""[s] After a fault of the runtime itself the thrust is neutral for this long."""


@dataclass(frozen=True, slots=True)
class Handled:
    """What came of a message: the decision, if any, and what to tell the operator."""

    decision: Decision | None
    events: tuple[HealthEvent, ...]


class Controller:
    """Core, watchdog, guard, health and autopilot link of one vessel."""

    def __init__(
        self,
        core: Core,
        link: AutopilotLink,
        odometry: OdometrySource | None = None,
        *,
        looks_first: bool = True,
    ) -> None:
        """Join them.

        Parameters
        ----------
        odometry
            Makes odometry, if that does not come over the bus.
        looks_first
            Whether nothing may be driven before the surroundings have been seen for long enough,
            at the very start too. A simulation in lock-step begins with vessels that may.
        """
        self.core = core
        self.link = link
        self._odometry = odometry
        self.health = Health()
        self.decision: Decision | None = None
        self._guard = Guard(core.pipeline.guard.limits)
        self._watchdog = Watchdog(
            {name: (kind, TOPICS[name].max_age_s or math.inf) for name, kind in WATCHED.items()}
        )
        self._engaged = False
        self._fault = False
        self._has_looked = not looks_first
        self._inputs_too_old = False
        self._held_until_s = self._now_s = -math.inf
        self._assurance = ""

    @property
    def state(self) -> State:
        """What the vessel is doing."""
        return self.health.state

    @property
    def stamp_ns(self) -> int:
        """[ns] The core's time, by the stamps of what it took in."""
        return self.core.latest_ns

    @property
    def engaged(self) -> bool:
        """Whether the core's thrust goes to the propellers."""
        return self._engaged

    def take_in(self, topic: str, payload: bytes, now_s: float) -> Handled:
        """Feed one message to the core, or a sensor's to where odometry is made of it.

        It never raises on the message's content.
        """
        self._look(now_s)
        if topic in SENSED:
            return self._sense(topic, payload, now_s)
        scan_before_ns = self.core.scan_ns
        outcome = self.core.feed(topic, payload)
        scan_ns = self.core.scan_ns
        if self._odometry is not None and scan_ns is not None and scan_ns != scan_before_ns:
            self._odometry.scan_came(scan_ns, now_s)
        if outcome.stamp_ns is not None:
            self._watchdog.seen(topic, outcome.stamp_ns, now_s)
        events = outcome.events
        if outcome.decision is not None:
            self.decision = outcome.decision
            events += outcome.decision.events
        faulty = any(event.name in FAULTS for event in events)
        if faulty or outcome.decision is not None:
            self._fault = faulty
        self._has_looked = self._has_looked or self.core.knows_surroundings
        self.note(events, now_s)
        return Handled(outcome.decision, events)

    def note(self, events: tuple[HealthEvent, ...], now_s: float) -> None:
        """Let the vessel's state follow from events; the loop notes its own here."""
        self.health.note(events, now_s)

    def from_autopilot(self, data: bytes, now_s: float) -> None:
        """Take in bytes that came from the autopilot."""
        if data:
            self.link.receive(data, now_s)

    @property
    def has_own_odometry(self) -> bool:
        """Whether odometry is made here, of other messages."""
        return self._odometry is not None

    def own_odometry(self) -> list[bytes]:
        """Give the odometry that was made since the last call, to be fed to the core."""
        return [] if self._odometry is None else self._odometry.payloads()

    def supervise(self, now_s: float) -> tuple[bytes | None, tuple[HealthEvent, ...]]:
        """Look at the inputs' ages and the autopilot; say what changed.

        Returns
        -------
        engagement : bytes or None
            Where the right to drive changed: the message that the core must be fed, and the
            recorder keep, as an input like any other.
        events
            What an operator should know.
        """
        self._look(now_s)
        said = [replace(event, stamp_ns=self.stamp_ns) for event in self.link.events(now_s)]
        if self._odometry is not None:
            troubles = self._odometry.take_troubles()
            said += [BAD_MESSAGE.at(self.stamp_ns, f"odometry: {why}") for why in troubles]
        events = [*self._watchdog.check(now_s, self.stamp_ns), *said]
        self.note(tuple(events), now_s)
        status = self.link.status
        may_drive = status.engaged
        change = self.health.step(self._facts(status, may_drive, now_s), self.stamp_ns)
        if change:
            events.append(change)
        ready = self._has_looked and not self._is_held(now_s)
        engaged = may_drive and ready and not self._watchdog.stale
        if engaged == self._engaged:
            return None, tuple(events)
        message = cdr.encode_engagement(Engagement(stamp_ns=self.stamp_ns, engaged=engaged))
        self._engaged = engaged
        return message, tuple(events)

    def command(self, now_s: float) -> bytes:
        """Give the MAVLink bytes to send now: the thrust, and what the link has to say.

        On inputs that are too old the thrust is neutral, and nothing is asked of the autopilot,
        whatever `supervise` found when it was last called.
        """
        self._look(now_s)
        thrust, _ = self._guard.check(self.thrust, self.stamp_ns)
        wanted = None if self.state is State.READY and not self._has_goal else thrust
        asks = not self._inputs_too_old
        return self.link.command(wanted, now_s) + self.link.tick(now_s, may_ask=asks)

    def hold(self, now_s: float) -> bytes:
        """Hold the thrust neutral after a fault of the runtime, and give the bytes that say so."""
        self._held_until_s = now_s + FAULT_HOLD_S
        return self.link.command(NEUTRAL, now_s)

    def rest(self, now_s: float) -> bytes:
        """Give the last MAVLink bytes of a run: propellers at stop."""
        self._engaged = False
        return self.link.command(NEUTRAL, now_s) + self.link.tick(now_s)

    @property
    def thrust(self) -> Float64:
        """[N] (2,) What the propellers should give now, left and right."""
        if not self._engaged or self._fault or self._inputs_too_old or self.decision is None:
            return NEUTRAL
        return NEUTRAL if self._is_held(self._now_s) else self.decision.thrust

    def _look(self, now_s: float) -> None:
        """Look at the inputs' ages: the first thing that is done, however long nothing was."""
        self._now_s = now_s
        self._watchdog.awake(now_s)
        self._inputs_too_old = self._watchdog.too_old(now_s)

    def _is_held(self, now_s: float) -> bool:
        return now_s < self._held_until_s

    def explain(self, decision: Decision) -> Explanation | None:
        """Say what the newest decision does and why; None before the first odometry.

        Words must never stop the boat: whatever fails in making them leaves them out.
        """
        self._assurance = assurance_manoeuvre(decision, self._assurance) if self._engaged else ""
        odometry, goal = self.core.odometry, self.core.pipeline.mission.goal
        if odometry is None:
            return None
        goal_N = None if goal is None else goal.position_N
        acts = self._engaged and not self._inputs_too_old and not self._is_held(self._now_s)
        try:
            return explain(decision, odometry, goal_N, engaged=acts, assurance=self._assurance)
        except Exception:  # see above
            return None

    def _sense(self, topic: str, payload: bytes, now_s: float) -> Handled:
        events: tuple[HealthEvent, ...] = ()
        if self._odometry is not None:
            try:
                events = self._odometry.sense(topic, payload)
            except MessageError as error:
                events = (BAD_MESSAGE.at(self.stamp_ns, f"{topic}: {error}"),)
            except Exception as error:  # must stop the boat, not the loop: no odometry follows
                self._odometry.restart()
                detail = f"{topic}: {type(error).__name__}: {error}"
                events = (INTERNAL_ERROR.at(self.stamp_ns, detail),)
        self.note(events, now_s)
        return Handled(None, events)

    @property
    def _has_goal(self) -> bool:
        mission = self.core.pipeline.mission
        return mission.goal is not None and not mission.arrived

    def _facts(self, status: AutopilotStatus, may_drive: bool, now_s: float) -> Facts:
        return Facts(
            inputs_heard=self._watchdog.all_heard and status.message_age_s < math.inf,
            inputs_fresh=not self._watchdog.stale and status.connected,
            may_drive=may_drive,
            fault=self._fault or self._is_held(now_s),
            knows_surroundings=self._has_looked and not self.core.is_settling,
            has_goal=self._has_goal,
            warned=self.health.warned(now_s),
        )
