import math
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.ardupilot.odometry import BootClock

BOOT_S = 500.0
"""[s] The caller's time when the autopilot booted."""


def talk(clock, *, seconds, delay, drift=0.0, since_s=1000.0):
    """Stream messages and answer questions over a line with a delay each way; gives the error."""
    now_s = since_s
    for k in range(round(seconds * 20)):
        now_s = since_s + k * 0.05
        boot_s = (now_s - BOOT_S) * (1 + drift)
        clock.heard(boot_s, now_s + delay())
        for question in clock.ask(now_s):
            there, back = delay(), delay()
            boot_ns = round((now_s + there - BOOT_S) * (1 + drift) * 1e9)
            answer = mavlink.MAVLink_timesync_message(boot_ns, question.ts1)
            clock.answered(answer, now_s + there + back)
    return clock.caller_s((now_s - BOOT_S) * (1 + drift)) - now_s


def test_a_line_without_delay_is_exact():
    assert talk(BootClock(), seconds=5, delay=lambda: 0.0) == pytest.approx(0.0, abs=1e-6)


def test_an_equal_delay_both_ways_is_taken_out():
    assert talk(BootClock(), seconds=5, delay=lambda: 0.03) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_wavering_delay_leaves_less_error_than_half_of_it(seed):
    generator = random.Random(seed)
    error = talk(BootClock(), seconds=60, delay=lambda: generator.uniform(0.005, 0.05))
    assert abs(error) < 0.01


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drifting_clock_is_followed_for_an_hour(drift):
    error = talk(BootClock(), seconds=3600, delay=lambda: 0.01, drift=drift)
    assert abs(error) < 0.012


def test_an_answer_to_somebody_elses_question_does_not_count():
    clock = BootClock()
    clock.heard(500.0, 1000.05)
    clock.ask(1000.0)
    clock.answered(mavlink.MAVLink_timesync_message(123, 456), 1000.1)
    assert clock.caller_s(500.0) == pytest.approx(1000.05)


def test_an_answer_counts_once():
    clock = BootClock()
    clock.heard(500.0, 1000.05)
    (question,) = clock.ask(1000.0)
    answer = mavlink.MAVLink_timesync_message(500_010_000_000, question.ts1)
    clock.answered(answer, 1000.02)
    clock.answered(answer, 1000.02 + 1e-9)
    assert clock.caller_s(500.0) == pytest.approx(1000.0)


def test_an_autopilot_that_starts_again_is_measured_anew():
    clock = BootClock()
    talk(clock, seconds=5, delay=lambda: 0.0)
    clock.heard(1.0, 2000.0)
    assert clock.caller_s(1.0) == pytest.approx(2000.0)


@pytest.mark.parametrize("boot_ns", [1_700_000_000 * 10**9, 2**62, -(2**62), 1])
def test_answers_by_another_clock_than_the_messages_are_not_believed(boot_ns):
    clock = BootClock()
    clock.heard(500.0, 1000.05)
    (question,) = clock.ask(1000.0)
    clock.answered(mavlink.MAVLink_timesync_message(boot_ns, question.ts1), 1000.02)
    assert clock.caller_s(500.0) == pytest.approx(1000.05)


@pytest.mark.parametrize("rate", [0.95, 0.8, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_a_simulation_slower_than_real_time_is_followed(rate, seed):
    generator = random.Random(seed)
    error = talk(BootClock(), seconds=120, delay=lambda: generator.uniform(0, 0.03), drift=rate - 1)
    assert abs(error) < 0.1


def test_a_simulation_that_keeps_up_again_is_believed_again():
    clock = BootClock()
    talk(clock, seconds=30, delay=lambda: 0.01, drift=-0.3)
    behind_s = 0.3 * (1030.0 - BOOT_S)
    now_s = 1030.0
    for k in range(200):
        now_s = 1030.0 + k * 0.05
        boot_s = now_s - BOOT_S - behind_s
        clock.heard(boot_s, now_s + 0.01)
        for question in clock.ask(now_s):
            answer = mavlink.MAVLink_timesync_message(round((boot_s + 0.01) * 1e9), question.ts1)
            clock.answered(answer, now_s + 0.02)
    assert clock.caller_s(now_s - BOOT_S - behind_s) - now_s == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_delays_alone_never_look_like_clocks_that_run_apart(seed):
    """A line whose delay rises to a second and falls again, there, back, or both."""
    generator = random.Random(seed)
    waves = [generator.uniform(0.0, 1.0) for _ in range(2)]
    clock = BootClock()
    for k in range(1200):
        now_s = 1000.0 + k * 0.05
        rise = 0.5 - 0.5 * math.cos(k / 120)
        there, back = (0.01 + wave * rise for wave in waves)
        clock.heard(now_s - back - BOOT_S, now_s)
        for question in clock.ask(now_s):
            boot_ns = round((now_s + there - BOOT_S) * 1e9)
            clock.answered(
                mavlink.MAVLink_timesync_message(boot_ns, question.ts1), now_s + there + back
            )
    assert clock.caller_s(500.0) == pytest.approx(BOOT_S + 500.0, abs=0.02)
