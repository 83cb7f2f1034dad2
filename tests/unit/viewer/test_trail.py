"""Where a vessel has been."""

from twinscrew.hil_sim.viewer.trail import Trail


def test_places_nearer_than_the_step_add_nothing():
    trail = Trail(step_m=1.0)
    for time_s, north in enumerate((0.0, 0.4, 0.9, 1.1, 1.5, 2.2)):
        trail.add(time_s, north, 0.0)
    assert [place[1] for place in trail.places] == [0.0, 1.1, 2.2]


def test_a_long_way_is_kept_from_end_to_end_within_a_bounded_number_of_places():
    trail = Trail(step_m=1.0, most=50)
    for metre in range(10_000):
        trail.add(metre, metre, -metre)
        assert len(trail.places) <= 50
    times = [place[0] for place in trail.places]
    assert times[0] == 0.0
    assert times[-1] > 9_000
    assert times == sorted(times)
