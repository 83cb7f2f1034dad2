import re
from pathlib import Path

import pytest

from twinscrew.runtime.link.ardupilot.authority import (
    HOLD,
    INITIALISING,
    MANUAL,
    TRANSITIONS,
    AskManual,
    Authority,
    Holder,
    Input,
)

LOITER, AUTO = 5, 10
DOCS = Path(__file__).parents[3] / "docs" / "mavlink.md"


class Line:
    """An authority and an autopilot whose frames all arrive, unless a test leaves some out."""

    def __init__(self, ask=AskManual.AFTER_FAILSAFE, *, arm=True):
        self.boss = Authority(ask, arm=arm)
        self.boss.failsafe_holds = True
        self.now_s, self.boot_s, self.number = 100.0, 0.0, 0

    def beat(self, mode, *, armed=True, critical=False, after_s=1.0):
        self.now_s += after_s
        self._frame()
        self.boss.heartbeat(mode, self.now_s, armed=armed, critical=critical)
        return self

    def uptime(self):
        self.now_s += 0.1
        self._frame()
        self.boss.uptime(round((self.now_s - self.boot_s) * 1e6) % 2**32, 1e-6, self.now_s)
        return self

    def settle(self, mode, **how):
        """Say the mode, the time since boot, and the mode again."""
        return self.beat(mode, **how).uptime().uptime().beat(mode, **how).uptime()

    def lose(self, count=1):
        self.number += count
        return self

    def restart(self, off_s=5.0):
        self.now_s += off_s
        self.boot_s, self.number = self.now_s, 0
        return self

    def _frame(self):
        assert self.boss.frame(self.number % 256, self.now_s)
        self.number += 1


def in_manual(**how):
    return Line(**how).settle(MANUAL, armed=False).settle(MANUAL)


def taken(mode=LOITER, **how):
    return in_manual(**how).settle(mode)


def in_failsafe(**how):
    line = in_manual(**how)
    line.boss.reached(line.now_s)
    return line.beat(MANUAL).beat(HOLD, critical=True)


def test_nothing_is_asked_before_the_autopilot_spoke():
    assert not Line().boss.asks_manual
    assert not Line().boss.asks_arming


@pytest.mark.parametrize("mode", [HOLD, LOITER])
def test_a_disarmed_boat_is_asked_for_manual_at_the_start(mode):
    boss = Line().beat(mode, armed=False).boss
    assert boss.asks_manual
    assert not boss.asks_arming


def test_nothing_is_asked_of_an_autopilot_that_is_starting():
    line = Line().beat(INITIALISING, armed=False)
    assert not line.boss.asks_manual
    assert line.beat(HOLD, armed=False).boss.asks_manual


@pytest.mark.parametrize("mode", [HOLD, LOITER, AUTO])
def test_an_armed_boat_in_another_mode_at_first_contact_is_a_pilots(mode):
    boss = Line().beat(mode, critical=True).boss
    assert boss.taken
    assert not boss.asks_manual


def test_who_may_never_ask_never_asks():
    assert not Line(AskManual.NEVER).beat(HOLD, armed=False).boss.asks_manual
    assert not in_failsafe(ask=AskManual.NEVER).boss.asks_manual


@pytest.mark.parametrize("mode", [HOLD, LOITER, AUTO])
def test_a_pilots_mode_change_wins_for_good(mode):
    line = in_manual()
    for _ in range(100):
        line.beat(mode).uptime()
        assert line.boss.taken
        assert not line.boss.asks_manual
        assert not line.boss.drives


def test_a_pilot_gives_the_boat_back_by_choosing_manual():
    assert taken().beat(MANUAL, after_s=0.5).boss.drives


@pytest.mark.parametrize("lost", [0, 3])
def test_after_a_silence_or_a_lost_frame_the_time_since_boot_tells_that_it_was_his_choice(lost):
    line = taken().lose(lost).beat(MANUAL, after_s=0.5 if lost else 1.5)
    assert not line.boss.drives  # an autopilot that restarted says MANUAL, too
    assert line.uptime().boss.drives


def test_hold_by_the_radio_failsafe_may_be_left_again():
    boss = in_failsafe().boss
    assert boss.held
    assert boss.asks_manual


def test_hold_by_the_failsafe_is_left_only_by_permission():
    assert not in_failsafe(ask=AskManual.AT_START).boss.asks_manual


def test_hold_that_is_not_critical_is_a_pilots():
    line = in_manual()
    line.boss.reached(line.now_s)
    assert line.beat(MANUAL).beat(HOLD).boss.taken


def test_hold_in_a_critical_state_that_began_before_is_a_pilots():
    line = in_manual()
    line.boss.reached(line.now_s)
    assert line.beat(MANUAL, critical=True).beat(HOLD, critical=True).boss.taken


def test_hold_while_the_autopilot_hears_us_is_a_pilots():
    line = in_manual().beat(MANUAL)
    line.boss.reached(line.now_s)
    assert line.beat(HOLD, critical=True).boss.taken


def test_hold_after_a_lost_frame_is_a_pilots():
    line = in_manual()
    line.boss.reached(line.now_s)
    assert line.beat(MANUAL).lose().beat(HOLD, critical=True).boss.taken


def test_hold_is_a_pilots_unless_the_parameters_let_the_failsafe_choose_it():
    line = in_manual()
    line.boss.failsafe_holds = False
    line.boss.reached(line.now_s)
    assert line.beat(MANUAL).beat(HOLD, critical=True).boss.taken


def test_a_failsafe_excuses_no_other_mode_than_hold():
    line = in_manual()
    line.boss.reached(line.now_s)
    assert line.beat(MANUAL).beat(LOITER, critical=True).boss.taken


def test_a_failsafe_that_is_over_excuses_no_pilots_hold():
    line = in_failsafe().beat(HOLD).beat(MANUAL).beat(MANUAL)
    assert line.beat(HOLD).boss.taken
    assert not line.boss.asks_manual


@pytest.mark.parametrize("change", [{"mode": LOITER}, {"mode": HOLD, "armed": False}])
def test_a_pilot_who_acts_while_we_ask_wins(change):
    line = in_failsafe().beat(**change)
    assert line.boss.taken
    assert not line.boss.asks_manual


def test_frames_that_are_missing_while_we_ask_may_have_told_of_a_pilot():
    assert in_failsafe().lose().beat(HOLD).boss.taken


@pytest.mark.parametrize("mode", [HOLD, LOITER, MANUAL])
def test_a_restart_does_not_give_back_what_a_pilot_took(mode):
    line = taken().restart().beat(INITIALISING, armed=False).settle(mode, armed=False)
    for _ in range(20):
        line.settle(mode)
        assert line.boss.taken
        assert not line.boss.asks_manual
        assert not line.boss.asks_arming
        assert not line.boss.drives


def test_a_restart_whose_first_messages_are_lost_does_not_either():
    line = taken().restart(60.0).lose(20).settle(MANUAL).settle(MANUAL)
    assert line.boss.taken
    assert line.settle(LOITER).settle(MANUAL).boss.drives  # now it is a choice


def test_the_counter_of_microseconds_that_begins_anew_is_no_restart():
    line = taken()
    line.now_s = line.boot_s + 2**32 * 1e-6 - 5.0
    line.settle(LOITER).beat(LOITER, after_s=2.0).uptime().beat(LOITER).uptime()
    assert line.boot_s + 2**32 * 1e-6 < line.now_s
    assert line.beat(MANUAL).uptime().boss.drives


def test_manual_by_a_late_request_of_ours_is_not_a_pilots_choice():
    line = Line().settle(HOLD, armed=False)
    line.boss.manual_asked(line.now_s)
    line.settle(LOITER)
    assert line.boss.taken
    assert not line.settle(MANUAL).boss.drives


def test_a_frame_that_was_overtaken_says_nothing_but_stops_us():
    line = in_manual()
    late = line.number - 3
    assert not line.boss.frame(late, line.now_s)
    line.boss.late_heartbeat(HOLD, armed=True)
    assert not line.boss.drives
    assert not line.boss.taken
    assert line.beat(MANUAL).boss.drives


def test_arming_is_asked_only_when_told_to():
    for arm in (True, False):
        assert Line(arm=arm).beat(MANUAL, armed=False).boss.asks_arming is arm


def test_a_boat_that_was_disarmed_is_not_armed_again():
    assert not in_manual().beat(MANUAL, armed=False).boss.asks_arming


@pytest.mark.parametrize("lost", [0, 1])
def test_arming_that_was_not_answered_is_asked_again_if_no_frame_is_missing(lost):
    line = Line().settle(MANUAL, armed=False)
    line.boss.arming_asked()
    line.lose(lost).beat(MANUAL, armed=False)
    assert line.boss.asks_arming is (lost == 0)
    assert line.boss.arming_unknown is (lost > 0)


def test_an_operators_word_starts_over():
    line = in_manual().settle(HOLD, armed=False)
    line.boss.ask_again()
    assert line.boss.asks_manual
    assert line.beat(MANUAL, armed=False).boss.asks_arming


def test_every_state_but_ours_is_left_to_the_pilot_by_a_mode_that_nobody_asked_for():
    for holder in set(Holder) - {Holder.NOBODY, Holder.PILOT}:
        assert TRANSITIONS[holder, Input.OTHER_ARMED] is Holder.PILOT
        assert TRANSITIONS[holder, Input.OTHER_DISARMED] is Holder.PILOT


def test_the_documentation_shows_the_table_that_is_used():
    text = DOCS.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ([^|`]+) \| `(\w+)` \|$", text, re.MULTILINE)
    told = {(Holder(a), Input(b.strip()), Holder(c)) for a, b, c in rows if a != "any"}
    told |= {
        (holder, Input(b.strip()), Holder(c)) for a, b, c in rows if a == "any" for holder in Holder
    }
    assert told == {(holder, heard, then) for (holder, heard), then in TRANSITIONS.items()}
