"""Whatever happens, in whatever order: a pilot's choice that was seen stands until he undoes it.

A plain model of the autopilot, its pilot and a bad line plays against `Authority`. Every heartbeat
bears, unseen by the companion, whether a pilot has the boat. From the arrival of one that says so
until the arrival of one that does not, the companion may neither drive nor ask for a mode.

The quick tests play a few hundred sequences. The nightly tier plays 100 000:

    HYPOTHESIS_PROFILE=nightly python -m pytest tests/property/test_authority.py
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import note
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from twinscrew.runtime.link.ardupilot.authority import (
    HOLD,
    INITIALISING,
    MANUAL,
    AskManual,
    Authority,
    Holder,
)

LOITER, AUTO = 5, 10
FAILSAFE_S = 2.0
LATEST_S = 0.95
"""[s] How late a frame may come."""
RESTART_S = 2.0
"""[s] The shortest silence of an autopilot that restarts."""

FATES = st.one_of(st.just(0.0), st.none(), st.floats(0.05, LATEST_S))
"""[s] How late a frame comes; None: it is lost."""
SHORT = st.sampled_from([0.05, 0.3, 1.0, 2.5, 7.0])


@dataclass(frozen=True)
class Frame:
    """What is on its way to the companion."""

    due_s: float
    order: int
    number: int
    heartbeat: tuple[int, bool, bool] | None
    """Mode, armed, critical."""
    uptime_us: int
    pilots: bool
    """Whether a pilot has the boat: what the companion cannot read."""
    disarmed_by_pilot: bool
    answers_s: float | None = None
    """A question of ours that it answers, by the time [s] when that was sent."""
    arming_result: bool | None = None


class Afternoon(RuleBasedStateMachine):
    """An autopilot, a pilot, a line, and the companion's authority."""

    @initialize(
        ask=st.sampled_from(AskManual),
        arm=st.booleans(),
        mode=st.sampled_from([MANUAL, HOLD, LOITER]),
        armed=st.booleans(),
        number=st.integers(0, 255),
        uptime_s=st.sampled_from([3.0, 50.0, 4290.0]),
    )
    def switch_on(self, ask, arm, mode, armed, number, uptime_s):
        self.authority = Authority(ask, arm=arm)
        self.authority.failsafe_holds = True
        self.now_s, self.boot_s = 100.0, 100.0 - uptime_s
        self.mode, self.armed, self.number, self.order = mode, armed, number, 0
        self.triggered = self.ekf_failed = self.cut = False
        self.override_s = self.now_s
        self.contact = self.pilots = self.shown = False
        self.disarmed_by_pilot = self.disarming_shown = self.arming_shown = False
        self.down: list[Frame] = []
        self.up: list[tuple[float, str]] = []
        self.newest = -1
        self.armed_by_us = False
        self.manual_s = self.arm_s = self.clock_s = -10.0

    @rule(mode=st.sampled_from([MANUAL, HOLD, LOITER, AUTO]), fate=FATES)
    def pilot_chooses(self, mode, fate):
        if self.mode == INITIALISING or mode == self.mode:
            return  # ArduPilot does nothing, and nobody can tell
        self.mode = mode
        self.pilots = mode != MANUAL and self.involved
        self.beat(fate)

    @rule(armed=st.booleans(), fate=FATES)
    def pilot_arms(self, armed, fate):
        if self.mode == INITIALISING or armed == self.armed:
            return
        self.armed = armed
        self.disarmed_by_pilot = not armed and (self.arming_shown or self.armed_by_us)
        self.beat(fate)

    @rule(lost=st.booleans())
    def line_to_the_autopilot(self, lost):
        self.cut = lost

    @rule(failed=st.booleans())
    def navigation_filter(self, failed):
        if not self.cut:
            self.ekf_failed = failed and self.armed

    @rule(
        off_s=st.floats(RESTART_S, 10.0),
        mode=st.sampled_from([MANUAL, HOLD]),
        fates=st.tuples(FATES, FATES),
    )
    def restart(self, off_s, mode, fates):
        self.mode, self.triggered = INITIALISING, False
        self.wait(off_s, beats=False)
        self.boot_s, self.number = self.now_s - 0.2, 0
        self.armed = self.triggered = self.ekf_failed = self.disarmed_by_pilot = False
        self.pilots &= self.shown  # a choice that nobody saw, and the autopilot forgot
        self.beat(fates[0])
        self.wait(0.5, beats=False)
        self.mode, self.override_s = mode, self.now_s
        self.beat(fates[1])

    @rule(seconds=SHORT, fate=FATES)
    def time_passes(self, seconds, fate):
        self.wait(seconds, fate=fate)

    @rule(fate=FATES)
    def a_message_with_the_time_since_boot(self, fate):
        self.send(fate)

    @rule(minutes=st.sampled_from([1.0, 71.0]))
    def a_quiet_while(self, minutes):
        self.wait(1.0, fate=0.0)
        self.up, self.down = [], []
        self.now_s += 60.0 * minutes
        self.override_s = self.now_s
        self.wait(1.0, fate=0.0)

    @rule()
    def an_operator_decides(self):
        if self.contact:
            self.authority.ask_again()
            self.pilots = self.shown = self.arming_shown = self.armed_by_us = False
            self.disarmed_by_pilot = self.disarming_shown = False
            self.down = []
            self.companion()

    def wait(self, seconds, *, beats=True, fate=0.0):
        until_s = self.now_s + seconds
        while self.now_s < until_s:
            self.now_s = round(self.now_s + 0.05, 3)
            self.autopilot()
            self.arrive()
            self.companion()
            if beats and round(self.now_s * 20) % 20 == 0:
                self.beat(fate)
            if beats and round(self.now_s * 20) % 4 == 0:
                self.send(fate)

    def autopilot(self):
        """Receive what was sent to it; its radio failsafe."""
        if not self.cut and self.mode != INITIALISING:
            self.override_s = self.now_s
            self.triggered = False
        due = [what for at_s, what in self.up if at_s <= self.now_s]
        self.up = [(at_s, what) for at_s, what in self.up if at_s > self.now_s]
        for what in due:
            self.obey(what)
        lost_s = self.now_s - self.override_s
        if lost_s > FAILSAFE_S and not self.triggered and self.mode not in (HOLD, INITIALISING):
            self.triggered, self.mode = True, HOLD
            self.beat(0.0)

    def obey(self, what):
        if self.mode == INITIALISING:
            return
        if what == "manual" and self.mode != MANUAL:
            self.mode = MANUAL
            self.pilots &= self.shown  # it undid what the companion could not have known
            self.beat(0.0)
        elif what == "arm":
            ready = self.mode == MANUAL
            self.armed_by_us |= ready and not self.armed
            self.armed |= ready
            self.send(0.0, arming_result=ready)
            self.beat(0.0)
        elif what.startswith("question"):
            self.send(0.0, answers_s=float(what.split()[1]))

    def companion(self):
        """Ask for what authority wants, as the link does: each once a second."""
        boss, now_s = self.authority, self.now_s
        if not self.contact:
            return
        if boss.asks_manual and now_s - self.manual_s >= 1.0:
            self.manual_s = now_s
            boss.manual_asked(now_s)
            self.post("manual")
        if boss.asks_arming and now_s - self.arm_s >= 1.0:
            assert not self.disarming_shown
            self.arm_s = now_s
            boss.arming_asked()
            self.post("arm")
        if now_s - self.clock_s >= 1.0:
            self.clock_s = now_s
            self.post(f"question {now_s}")

    def post(self, what):
        if not self.cut:
            self.up.append((self.now_s + 0.05, what))

    def beat(self, fate):
        critical = self.triggered or self.ekf_failed
        self.send(fate, heartbeat=(self.mode, self.armed, critical))

    def send(self, fate, *, heartbeat=None, answers_s=None, arming_result=None):
        number, self.number = self.number, (self.number + 1) % 256
        self.order += 1
        if fate is not None:
            uptime_us = round((self.now_s - self.boot_s) * 1e6) % 2**32
            frame = Frame(
                self.now_s + fate,
                self.order,
                number,
                heartbeat,
                uptime_us,
                self.pilots,
                self.disarmed_by_pilot,
                answers_s,
                arming_result,
            )
            self.down.append(frame)
            self.arrive()
            self.companion()

    def arrive(self):
        due = sorted(
            (f for f in self.down if f.due_s <= self.now_s), key=lambda f: (f.due_s, f.order)
        )
        self.down = [f for f in self.down if f.due_s > self.now_s]
        for frame in due:
            self.deliver(frame)

    def deliver(self, frame):
        boss = self.authority
        overtaken = frame.order < self.newest
        self.newest = max(self.newest, frame.order)
        if frame.heartbeat is not None and not overtaken:
            self.show(frame)
        if not boss.frame(frame.number, self.now_s):
            if frame.heartbeat is not None:
                boss.late_heartbeat(frame.heartbeat[0], armed=frame.heartbeat[1])
                self.arming_shown |= frame.heartbeat[1]
            return
        if frame.heartbeat is not None:
            mode, armed, critical = frame.heartbeat
            boss.heartbeat(mode, self.now_s, armed=armed, critical=critical)
        elif frame.answers_s is not None:
            boss.reached(frame.answers_s)
        elif frame.arming_result is None:
            boss.uptime(frame.uptime_us, 1e-6, self.now_s)
        elif not frame.arming_result:
            boss.arming_refused()
        elif boss.asks_arming:
            boss.note_armed(True)
        note(f"{self.now_s:.2f} {frame} -> {boss.holder.name}")

    @property
    def involved(self):
        """Whether there was anything to take from the companion yet: it drove, or asked."""
        idle = self.authority.holder in (Holder.NOBODY, Holder.OFFERED)
        return not idle or self.manual_s > 0.0

    def show(self, frame):
        mode, armed, _ = frame.heartbeat
        if not self.contact and mode != INITIALISING:
            self.contact = True
            self.shown = self.pilots = armed and mode != MANUAL
            self.arming_shown = armed
            return
        if mode == INITIALISING:
            return
        self.shown = frame.pilots
        self.disarming_shown = frame.disarmed_by_pilot
        self.arming_shown |= armed

    @invariant()
    def a_pilot_who_was_seen_is_not_overruled(self):
        if getattr(self, "shown", False):
            assert not self.authority.drives
            assert not self.authority.asks_manual


TestAfternoon = pytest.mark.slow(Afternoon.TestCase)
