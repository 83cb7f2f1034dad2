import math

from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.autopilot.streams import Streams


def count(streams, step_s, seconds):
    return sum(len(streams.due(k * step_s)) for k in range(round(seconds / step_s)))


@given(st.sampled_from([1.0, 4.0, 10.0, 20.0, 50.0]), st.sampled_from([0.01, 0.02, 0.05, 0.003]))
def test_a_rate_is_kept_without_drift_however_fine_the_steps(rate_hz, step_s):
    due = count(Streams({30: 1 / rate_hz}), step_s, 30.0)
    assert abs(due - 30.0 * min(rate_hz, 1 / step_s)) <= 1 + 30.0 * rate_hz * 1e-3


def test_a_long_pause_is_not_made_up_for():
    streams = Streams({30: 0.1})
    streams.due(0.0)
    assert streams.due(100.0) == [30]
    assert streams.due(100.05) == []


def test_reset_goes_back_to_the_first_rate():
    streams = Streams({30: 1.0})
    streams.every(30, 0.1)
    streams.every(31, 0.1)
    streams.reset(30)
    streams.reset(31)
    assert streams.interval_s(30) == 1.0
    assert streams.interval_s(31) is None


def test_with_nothing_wanted_nothing_is_due():
    assert Streams({}).due(math.pi) == []


def test_at_once_is_now():
    streams = Streams({0: 1.0})
    streams.due(0.0)
    streams.at_once(0)
    assert streams.due(0.1) == [0]
