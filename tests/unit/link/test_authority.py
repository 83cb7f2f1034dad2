import pytest

from twinscrew.runtime.link.authority import AskManual, Authority
from twinscrew.runtime.link.modes import HOLD, INITIALISING, MANUAL

LOITER, AUTO = 5, 10


def authority(ask=AskManual.AFTER_FAILSAFE, arm=True):
    return Authority(ask, arm=arm)


def in_manual(**how):
    boss = authority(**how)
    boss.heard(MANUAL, armed=False, now_s=0.0)
    boss.heard(MANUAL, armed=True, now_s=1.0)
    return boss


def test_nothing_is_asked_before_the_autopilot_spoke():
    boss = authority()
    assert not boss.asks_manual
    assert not boss.asks_arming


@pytest.mark.parametrize("mode", [HOLD, LOITER, INITIALISING])
def test_a_disarmed_boat_is_asked_for_manual_at_the_start(mode):
    boss = authority()
    boss.heard(mode, armed=False, now_s=0.0)
    assert boss.asks_manual
    assert not boss.asks_arming


@pytest.mark.parametrize("mode", [HOLD, LOITER, AUTO])
def test_an_armed_boat_in_another_mode_at_first_contact_is_a_pilots(mode):
    boss = authority()
    boss.heard(mode, armed=True, now_s=0.0)
    assert boss.taken
    assert not boss.asks_manual


def test_who_may_never_ask_never_asks():
    boss = authority(ask=AskManual.NEVER)
    boss.heard(HOLD, armed=False, now_s=0.0)
    assert not boss.asks_manual


@pytest.mark.parametrize("mode", [HOLD, LOITER, AUTO])
def test_a_pilots_mode_change_wins_for_good(mode):
    boss = in_manual()
    for second in range(2, 100):
        boss.heard(mode, armed=True, now_s=float(second))
        assert boss.taken
        assert not boss.asks_manual
        assert not boss.drives


def test_a_pilot_gives_the_boat_back_by_choosing_manual():
    boss = in_manual()
    boss.heard(LOITER, armed=True, now_s=2.0)
    boss.heard(MANUAL, armed=True, now_s=3.0)
    assert boss.drives
    assert not boss.taken


@pytest.mark.parametrize("word_first", [True, False])
def test_hold_by_the_radio_failsafe_may_be_left_again(word_first):
    boss = in_manual()
    if word_first:
        boss.failsafe(now_s=10.0)
    boss.heard(HOLD, armed=True, now_s=10.1)
    if not word_first:
        boss.failsafe(now_s=10.2)
    assert boss.held
    assert boss.asks_manual


def test_hold_by_the_failsafe_is_left_only_by_permission():
    boss = in_manual(ask=AskManual.AT_START)
    boss.failsafe(now_s=10.0)
    boss.heard(HOLD, armed=True, now_s=10.1)
    assert not boss.asks_manual


def test_an_old_failsafe_excuses_no_later_hold():
    boss = in_manual()
    boss.failsafe(now_s=10.0)
    boss.heard(HOLD, armed=True, now_s=20.0)
    assert boss.taken


def test_a_failsafe_long_after_a_pilots_hold_does_not_take_the_boat_from_him():
    boss = in_manual()
    boss.heard(HOLD, armed=True, now_s=10.0)
    boss.failsafe(now_s=20.0)
    assert boss.taken
    assert not boss.asks_manual


def test_a_failsafe_excuses_no_other_mode_than_hold():
    boss = in_manual()
    boss.failsafe(now_s=10.0)
    boss.heard(LOITER, armed=True, now_s=10.1)
    assert boss.taken


def test_a_pilot_who_acts_while_we_ask_wins():
    boss = in_manual()
    boss.failsafe(now_s=10.0)
    boss.heard(HOLD, armed=True, now_s=10.1)
    boss.heard(LOITER, armed=True, now_s=11.0)
    assert boss.taken
    assert not boss.asks_manual


def test_arming_is_asked_only_when_told_to():
    for arm in (True, False):
        boss = authority(arm=arm)
        boss.heard(MANUAL, armed=False, now_s=0.0)
        assert boss.asks_arming is arm


def test_a_boat_that_was_disarmed_is_not_armed_again():
    boss = in_manual()
    boss.heard(MANUAL, armed=False, now_s=2.0)
    assert not boss.asks_arming


def test_an_operators_word_starts_over():
    boss = in_manual()
    boss.heard(HOLD, armed=False, now_s=2.0)
    boss.ask_again()
    assert boss.asks_manual
    boss.heard(MANUAL, armed=False, now_s=3.0)
    assert boss.asks_arming


def test_a_failsafe_that_was_recovered_from_excuses_no_pilots_hold():
    boss = in_manual()
    boss.failsafe(now_s=10.0)
    boss.heard(HOLD, armed=True, now_s=10.1)
    boss.heard(MANUAL, armed=True, now_s=10.5)
    boss.heard(HOLD, armed=True, now_s=11.0)
    assert boss.taken
    assert not boss.asks_manual
