"""What the autopilot makes of a channel, undone: N commanded are N at the propeller."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.autopilot.mixer import Mixer
from twinscrew.hil_sim.autopilot.parameters import Parameters
from twinscrew.runtime.link.ardupilot.thrust import (
    Output,
    PaddleSettings,
    pwm_from_thrust,
    thrust_from_pwm,
)

CURVE = (
    (-1.0, -60.0),
    (-0.5, -10.0),
    (-0.1, 0.0),
    (0.0, 0.0),
    (0.1, 0.0),
    (0.5, 20.0),
    (1.0, 100.0),
)
CONTROLLER = PaddleSettings(
    ahead_N=100.0, astern_N=60.0, curve=CURVE, low_us=1100, stop_us=1500, high_us=1900
)


@given(
    thrust_n=st.floats(-60.0, 100.0),
    expo=st.floats(-0.9, 1.0),
    low=st.integers(900, 1100),
    high=st.integers(1900, 2100),
)
def test_newtons_commanded_are_newtons_at_the_propeller_whatever_the_autopilot_is_set_to(
    thrust_n: float, expo: float, low: int, high: int
) -> None:
    changes = {"MOT_THST_EXPO": expo}
    changes |= {f"SERVO{n}_MIN": low for n in (1, 3)} | {f"SERVO{n}_MAX": high for n in (1, 3)}
    parameters = Parameters(1, changes)
    values = {name: parameters[name] for name in ("SERVO1_TRIM", *changes)}
    wanted = pwm_from_thrust(thrust_n, CONTROLLER)
    channel = Output(values, 1).channel(wanted)
    left, right = Mixer(parameters).outputs([channel, 0, channel])
    steepest = 100.0 / 200  # [N/us] of the curve; a channel is a whole number of microseconds
    assert thrust_from_pwm(left, CONTROLLER) == pytest.approx(thrust_n, abs=6 * steepest)
    assert left == right == Output(values, 1).pulse(channel)


def test_as_shipped_the_channel_is_the_pulse() -> None:
    output = Output({"SERVO1_MIN": 1000.0, "SERVO1_TRIM": 1500.0, "SERVO1_MAX": 2000.0}, 1)
    assert output.is_straight
    assert [output.channel(us) for us in range(1000, 2001)] == list(range(1000, 2001))


def test_parameters_that_make_no_sense_are_left_alone() -> None:
    output = Output({"SERVO1_MIN": 1900.0, "SERVO1_TRIM": 1500.0, "SERVO1_MAX": 1100.0}, 1)
    assert output.channel(1700) == 1700


def test_below_the_least_throttle_the_propeller_rests_or_gives_the_least() -> None:
    output = Output({"MOT_THR_MIN": 10.0}, 1)
    assert output.pulse(output.channel(1500)) == 1500
    assert output.pulse(output.channel(1510)) in (1500, 1550)
    assert output.pulse(output.channel(1800)) == pytest.approx(1800, abs=1)


def test_pulses_out_of_order_are_refused() -> None:
    with pytest.raises(ValueError, match="low_us < stop_us < high_us"):
        PaddleSettings(low_us=1400, stop_us=1400)
