"""Past states: found by time, corrected together, forgotten in order."""

import numpy as np

from twinscrew.runtime.estimation.kinematics import ATTITUDE, STATES
from twinscrew.runtime.estimation.past import SIZE, Past


def filled(count: int) -> Past:
    past = Past()
    for k in range(count):
        past.add(100 * k, np.full(STATES, float(k)))
    return past


def test_without_states_there_is_none():
    assert Past().at(5) is None
    assert Past().newest_ns is None


def test_between_two_states_all_but_the_attitude_is_interpolated():
    x = filled(10).at(425)
    np.testing.assert_allclose(np.delete(x, range(6, 9)), 4.25)
    np.testing.assert_array_equal(x[ATTITUDE], 4.0)


def test_after_the_newest_it_is_the_newest_and_before_the_oldest_none():
    past = filled(SIZE + 10)
    assert past.newest_ns == 100 * (SIZE + 9)
    np.testing.assert_array_equal(past.at(10**9), SIZE + 9)
    np.testing.assert_array_equal(past.at(1000), 10)
    assert past.at(999) is None


def test_a_correction_holds_for_the_past_too():
    past = filled(10)
    past.correct(np.full(STATES, 0.5))
    np.testing.assert_array_equal(past.at(300), 3.5)


def test_what_is_given_is_a_copy():
    past = filled(10)
    past.at(300)[:] = -1.0
    np.testing.assert_array_equal(past.at(300), 3.0)


def test_after_clearing_the_ring_begins_anew():
    past = filled(SIZE + 10)
    past.clear()
    assert past.at(10**9) is None
    past.add(7, np.zeros(STATES))
    np.testing.assert_array_equal(past.at(8), 0.0)
    assert past.at(6) is None
