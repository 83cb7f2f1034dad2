import pytest

from twinscrew.runtime._native import Law
from twinscrew.runtime.safety.assurance import braking, manoeuvres
from twinscrew.runtime.safety.guard import ThrustLimits

LIMITS = ThrustLimits()


def ways(*, to_starboard: bool = True):
    found = manoeuvres(LIMITS, brake_nspm=500.0, turn_n=500.0, to_starboard=to_starboard)
    return {way.name: way.law for way in found}


def test_they_are_tried_from_the_mildest_on():
    assert list(ways()) == [
        "brake",
        "turn away",
        "brake and turn to starboard",
        "full astern",
        "full ahead",
    ]


@pytest.mark.parametrize(
    ("surge", "thrust"), [(3.0, -500.0), (0.6, -300.0), (0.0, 0.0), (-0.6, 300.0), (-3.0, 1000.0)]
)
def test_braking_thrusts_against_the_speed_until_it_is_gone(surge, thrust):
    assert ways()["brake"](0.0, surge) == (thrust, thrust)


def test_braking_and_turning_to_starboard_ends_in_turning_on_the_spot():
    law = ways()["brake and turn to starboard"]
    assert law(0.0, 1.5) == (-250.0, -500.0)
    assert law(3.0, 0.0) == (500.0, -500.0)


def test_turning_away_goes_to_port_from_what_is_to_starboard_and_the_other_way():
    assert ways(to_starboard=True)["turn away"](0.0, 2.0) == (-500.0, 1000.0)
    assert ways(to_starboard=False)["turn away"](0.0, 2.0) == (1000.0, -500.0)


def test_making_way_takes_all_that_the_propellers_have():
    assert ways()["full astern"](0.0, 2.0) == (-500.0, -500.0)
    assert ways()["full ahead"](0.0, 2.0) == (1000.0, 1000.0)


def test_braking_keeps_to_the_range_of_weaker_propellers():
    weak = braking(500.0, 500.0, ThrustLimits(min_n=-100.0, max_n=200.0))
    assert weak(0.0, 3.0) == (-100.0, -100.0)
    assert weak(0.0, -3.0) == (200.0, 200.0)


def test_later_follows_the_command_until_its_time_has_come():
    law = Law((3.0, 4.0)).after((1.0, 2.0), 0.3)
    times = (0.0, 0.1, 0.2, 0.1 + 0.2, 0.4)
    assert [law(time_s, 0.0)[0] for time_s in times] == [1.0, 1.0, 1.0, 3.0, 3.0]
