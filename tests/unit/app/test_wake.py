"""The way that was sailed: a place a metre, told once a second."""

import numpy as np
from tests.harness.boat import odometry

from twinscrew.runtime.app.wake import PLACES, Wake
from twinscrew.runtime.messages import cdr


def sail(wake, times_s, speed=2.0):
    """Go north; give what was told."""
    payloads = (cdr.encode_odometry(odometry(t, north=speed * t)) for t in times_s)
    return [told for told in (wake.see(payload) for payload in payloads) if told is not None]


def test_it_is_told_once_a_second_with_a_place_a_metre():
    told = sail(Wake(), np.arange(0.0, 10.0, 0.05))
    assert len(told) == 10
    _, places_N = cdr.decode_path(told[-1])
    np.testing.assert_allclose(np.diff(places_N[:, 0]), 1.0, atol=0.11)
    assert (places_N[:, 1] == 0.0).all()


def test_a_boat_at_rest_leaves_one_place():
    told = sail(Wake(), np.arange(0.0, 5.0, 0.05), speed=0.0)
    assert len(cdr.decode_path(told[-1])[1]) == 1


def test_a_long_way_keeps_its_end():
    told = sail(Wake(), np.arange(0.0, 2.0 * PLACES, 1.0))
    _, places_N = cdr.decode_path(told[-1])
    assert len(places_N) == PLACES
    assert places_N[-1, 0] == 2.0 * (2.0 * PLACES - 1)


def test_a_clock_set_back_does_not_silence_it():
    wake = Wake()
    sail(wake, [100.0])
    assert len(sail(wake, [10.0, 10.5, 11.1])) == 2


def test_what_is_no_odometry_is_passed_over():
    assert Wake().see(b"nonsense") is None
