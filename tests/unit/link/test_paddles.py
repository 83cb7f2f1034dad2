import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.link.ardupilot.thrust import (
    PaddleSettings,
    pwm_from_thrust,
    stick_from_pwm,
    thrust_from_pwm,
)

SCALE = PaddleSettings()


@pytest.mark.parametrize(
    ("thrust_N", "pwm_us"), [(0, 1500), (1000, 2000), (-500, 1000), (500, 1750), (-250, 1250)]
)
def test_full_thrust_is_full_paddle_either_way(thrust_N, pwm_us):
    assert pwm_from_thrust(thrust_N, SCALE) == pwm_us
    assert thrust_from_pwm(pwm_us, SCALE) == thrust_N


@given(st.floats(-500, 1000))
def test_what_the_simulator_reads_differs_by_half_a_microsecond_of_thrust_at_most(thrust_N):
    back = thrust_from_pwm(pwm_from_thrust(thrust_N, SCALE), SCALE)
    assert abs(back - thrust_N) <= (1.0 if thrust_N >= 0 else 0.5) + 1e-9


@given(st.floats(-500, 1000), st.floats(-500, 1000))
def test_more_thrust_is_never_less_paddle(a, b):
    low, high = sorted((a, b))
    assert pwm_from_thrust(low, SCALE) <= pwm_from_thrust(high, SCALE)


@given(st.floats())
def test_any_float_gives_a_pulse_the_autopilot_understands(thrust_N):
    assert 1000 <= pwm_from_thrust(thrust_N, SCALE) <= 2000


@given(st.integers(1000, 2000))
def test_sticks_and_pulses_are_two_words_for_one_paddle(pwm_us):
    assert stick_from_pwm(pwm_us) == 2 * (pwm_us - 1500)


@pytest.mark.parametrize("thrust_N", [math.nan, math.inf, -math.inf])
def test_a_thrust_that_is_not_finite_is_stop(thrust_N):
    assert pwm_from_thrust(thrust_N, SCALE) == 1500


def test_no_pulse_is_no_thrust():
    assert thrust_from_pwm(0, SCALE) == 0.0


@given(st.integers(1000, 2000))
def test_every_pulse_comes_back_as_itself(pwm_us):
    assert pwm_from_thrust(thrust_from_pwm(pwm_us, SCALE), SCALE) == pwm_us
