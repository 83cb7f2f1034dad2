import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.link.ardupilot.authority import FrameNumbers, Uptime

WRAP_S = 2**32 * 1e-6


def frames(*numbers, every_s=0.1, frames=None):
    frames = frames or FrameNumbers()
    return [frames.arrived(number, k * every_s) for k, number in enumerate(numbers)], frames


@given(st.integers(0, 255), st.integers(1, 600))
def test_numbers_in_a_row_show_that_nothing_is_missing(first, count):
    taken, numbers = frames(*[(first + k) % 256 for k in range(count)])
    assert all(taken)
    assert numbers.missed() == (False, False)


@given(st.integers(0, 255), st.integers(2, 127))
def test_a_gap_is_told_once(first, step):
    _, numbers = frames(first, (first + step) % 256)
    assert numbers.missed() == (True, True)
    assert numbers.missed() == (False, False)


@given(st.integers(0, 255), st.integers(0, 127))
def test_copies_and_frames_that_were_overtaken_are_not_taken(newest, back):
    taken, numbers = frames(newest, (newest - back) % 256)
    assert taken == [True, False]
    assert numbers.missed() == (False, False)


def test_after_a_silence_any_number_is_new():
    taken, numbers = frames(200, 0, every_s=3.0)
    assert taken == [True, True]
    assert numbers.missed() == (True, True)


def test_a_silence_without_a_missing_frame_may_hide_a_restart():
    _, numbers = frames(255, 0, every_s=2.0)
    assert numbers.missed() == (False, True)


def test_after_a_long_silence_a_whole_round_may_be_missing():
    _, numbers = frames(7, 8, every_s=5.0)
    assert numbers.missed() == (True, True)


@given(st.floats(2.0, WRAP_S - 1.0), st.floats(0.05, 100.0))
def test_a_time_since_boot_that_goes_on_is_no_restart(uptime_s, passed_s):
    uptime = Uptime(WRAP_S)
    assert uptime.arrived(uptime_s, 1000.0) is None
    assert uptime.arrived((uptime_s + passed_s) % WRAP_S, 1000.0 + passed_s) is True


@given(st.floats(0.0, WRAP_S - 200.0), st.floats(2.0, 100.0), st.floats(0.0, 1.0))
def test_a_restart_is_seen_however_long_it_took(uptime_s, off_s, part):
    uptime = Uptime(WRAP_S)
    uptime.arrived(uptime_s, 1000.0)
    since_boot_s = part * (off_s - 1.0)
    assert uptime.arrived(since_boot_s, 1000.0 + off_s) is False


@pytest.mark.parametrize("late_s", [0.6, 0.9])
def test_a_late_time_since_boot_proves_nothing(late_s):
    uptime = Uptime(WRAP_S)
    uptime.arrived(50.0, 1000.0)
    assert uptime.arrived(50.1, 1000.1 + late_s) is None
    assert uptime.arrived(50.0, 1000.2 + late_s) is None
