import math

import pytest
from tests.unit.experiments.episodes import encounter, episode, vessel

from twinscrew.hil_sim.experiments.summary import cell, summarise, wilson

HIT = (vessel("collision", 8.0, "vessel", near=-0.01), vessel(travel_time_s=99.0))


def test_success_is_counted_with_its_interval_and_failures_by_cause() -> None:
    records = [episode(0), episode(1), episode(2, vessels=HIT, cause="vessel")]
    records.append(episode(3, cause="time"))
    one = cell(records)
    assert (one.episodes, one.successes, one.success_rate) == (4, 2, 0.5)
    assert one.wilson95 == wilson(2, 4)
    assert one.failures == {"vessel": 1, "buoy": 0, "quay": 0, "fence": 0, "time": 1}


def test_travel_time_and_energy_are_of_the_successful_episodes_alone() -> None:
    fast = (vessel(travel_time_s=10.0, energy_ns=10e3), vessel(travel_time_s=14.0, energy_ns=20e3))
    one = cell([episode(0, vessels=fast), episode(1, vessels=HIT, cause="vessel")])
    assert one.travel_time_s == (12.0, 12.0, 12.0)
    assert one.energy_kns == pytest.approx(15.0)


def test_without_a_success_there_is_no_travel_time() -> None:
    one = cell([episode(0, vessels=HIT, cause="vessel")])
    assert math.isnan(one.travel_time_s[0])
    assert math.isnan(one.energy_kns)
    assert one.record()["travel_time_s"] is None


def test_closest_approaches_are_of_all_vessels_of_all_episodes() -> None:
    near = [vessel(near=value) for value in (0.0, 1.0, 2.0, 3.0, 4.0)]
    alone = (vessel(near=None),)
    one = cell([episode(0, vessels=tuple(near[:2])), episode(1, vessels=(*near[2:], *alone))])
    assert one.closest_approach_m == pytest.approx((0.2, 1.0, 2.0))


def test_rules_are_counted_by_kind_and_deviations_by_what_they_gained() -> None:
    encounters = (
        encounter("head_on", acted=True),
        encounter("head_on", acted=False, gap_m=3.0, rule_gap_m=1.0),
        encounter("head_on", acted=False, gap_m=1.0, rule_gap_m=2.0),
        encounter("head_on", acted=False, touched=True, gap_m=-0.1, rule_gap_m=3.9),
        encounter("give_way", acted=True),
    )
    one = cell([episode(0, encounters=encounters)])
    rule = one.head_on
    counts = (rule.encounters, rule.acted, rule.deviated, rule.safer, rule.touched)
    assert counts == (4, 1, 3, 1, 1)
    assert rule.gained_m == pytest.approx(-1.0)
    assert (one.give_way.encounters, one.give_way.acted) == (1, 1)
    assert math.isnan(one.give_way.gained_m)


def test_methods_sets_and_variants_are_kept_apart() -> None:
    records = [episode(0), episode(0, method="b"), episode(0, set="two"), episode(1)]
    records.append(episode(0, variant="no_wind"))
    keys = [(one.method, one.set, one.variant, one.episodes) for one in summarise(records)]
    assert keys == [
        ("a", "one", "full", 2),
        ("b", "one", "full", 1),
        ("a", "two", "full", 1),
        ("a", "one", "no_wind", 1),
    ]
