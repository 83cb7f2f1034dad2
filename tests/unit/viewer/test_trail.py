"""Where a vessel has been."""

import numpy as np

from twinscrew.hil_sim.viewer.vessel import Trail


def test_places_nearer_than_the_step_add_nothing():
    trail = Trail(step_m=1.0)
    for time_s, north in enumerate((0.0, 0.4, 0.9, 1.1, 1.5, 2.2)):
        trail.add(time_s, north, 0.0)
    assert [place[1] for place in trail.places] == [0.0, 1.1, 2.2]


def test_what_was_sailed_before_comes_first_and_only_once():
    trail = Trail(step_m=1.0)
    for time_s, north in enumerate((10.0, 12.0, 14.0)):
        trail.add(5.0 + time_s, north, 0.0)
    way = np.array([[north, 0.0] for north in range(0, 15, 2)])
    trail.precede(way)
    trail.precede(way - 100.0)
    assert [place[1] for place in trail.places] == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]
    assert [place[0] for place in trail.places] == [5.0] * 6 + [6.0, 7.0]


def test_a_way_that_begins_where_we_do_adds_nothing():
    trail = Trail(step_m=1.0)
    trail.precede(np.array([[1.0, 1.0]]))
    trail.add(0.0, 1.0, 1.0)
    trail.precede(np.array([[1.0, 1.0], [2.0, 1.0]]))
    trail.precede(np.empty((0, 2)))
    assert trail.places == ((0.0, 1.0, 1.0),)
    assert not trail.is_preceded


def test_a_long_way_is_kept_from_end_to_end_within_a_bounded_number_of_places():
    trail = Trail(step_m=1.0, most=50)
    for metre in range(10_000):
        trail.add(metre, metre, -metre)
        assert len(trail.places) <= 50
    times = [place[0] for place in trail.places]
    assert times[0] == 0.0
    assert times[-1] > 9_000
    assert times == sorted(times)
