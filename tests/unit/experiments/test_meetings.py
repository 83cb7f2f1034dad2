"""Suites of meetings: Imazu's, DNV's and drawn traffic, as scenarios of the simulator."""

import numpy as np
import pytest

from twinscrew.hil_sim.experiments.suites import SUITES
from twinscrew.hil_sim.rules import geometric, temporal
from twinscrew.hil_sim.rules.evidence import STEP_S, Body, Tracks
from twinscrew.hil_sim.scenario import dnv_situations, load_scenario
from twinscrew.runtime.errors import ConfigError
from twinscrew.training.encounters import draw_traffic

OWN_MPS = 2.5
ROLES = {
    "HO": "head_on",
    "CR-GW": "give_way",
    "CR-SO": "stand_on",
    "OT-GW": "overtaking",
    "OT-SO": "stand_on",
}


def unaltered(scenario) -> Tracks:
    """Everybody goes straight on, the own vessel at about its speed."""
    times = np.arange(0.0, 40.0, STEP_S)
    rows = [(*scenario.starts[0, :2], scenario.starts[0, 2], OWN_MPS, 5.0, 2.5)]
    rows += [
        (*s.start_m, np.radians(s.course_deg), s.speed_mps, s.length_m, s.beam_m)
        for s in scenario.traffic
    ]
    pose = np.empty((len(times), len(rows), 3))
    for k, (north, east, course, speed, *_) in enumerate(rows):
        pose[:, k, 0] = north + speed * np.cos(course) * times
        pose[:, k, 1] = east + speed * np.sin(course) * times
        pose[:, k, 2] = course
    bodies = tuple(
        Body(name=str(k), length_m=row[4], beam_m=row[5], circle=True, ours=k == 0)
        for k, row in enumerate(rows)
    )
    return Tracks(times=times, pose_N=pose, bodies=bodies, fixed=np.empty((0, 3)))


@pytest.mark.parametrize("case", range(1, 23))
def test_in_imazus_encounters_all_meet_at_one_point_and_time(case) -> None:
    scenario = load_scenario(f"imazu:{case}")
    tracks = unaltered(scenario)
    middle = (scenario.starts[0, :2] + scenario.goals[0]) / 2
    at = int(40.0 / OWN_MPS / STEP_S)
    np.testing.assert_allclose(tracks.pose_N[at, :, :2] - middle, 0.0, atol=0.01)


def test_there_are_55_base_situations_every_mix_of_up_to_three_kinds() -> None:
    names = [tuple(name.split(", ")) for name in dnv_situations()]
    assert len(names) == 55
    assert {len(name) for name in names} == {1, 2, 3}
    assert len({tuple(sorted(name)) for name in names}) == 55


@pytest.mark.parametrize("judge", [geometric.judge, temporal.judge], ids="AB")
def test_both_judges_see_the_roles_that_dnv_means(judge) -> None:
    """Of the five with one other vessel, sailed straight on."""
    for case, kind in enumerate(dnv_situations()[:5], start=1):
        (found,) = judge(unaltered(load_scenario(f"dnv:{case}")))
        assert found.role == ROLES[kind], kind


def test_traffic_is_drawn_as_evaluate_draws_it() -> None:
    scenario = load_scenario("traffic:large", seed=4)
    drawn = draw_traffic("large", 1, 4).episodes[0]
    assert [ship.length_m for ship in scenario.traffic] == [o.length_m for o in drawn.others]
    apart = np.subtract(scenario.traffic[0].start_m, scenario.starts[0, :2])
    np.testing.assert_allclose(apart, np.subtract(drawn.others[0].start_m, drawn.own.start_m))
    assert load_scenario("traffic:large", seed=5).traffic != scenario.traffic


@pytest.mark.parametrize("name", ["imazu:0", "imazu:23", "imazu:one", "dnv:56", "traffic:none"])
def test_a_meeting_that_there_is_not_is_refused_by_name(name) -> None:
    with pytest.raises(ConfigError, match=r"imazu:0|imazu:23|imazu:one|dnv:56|none"):
        load_scenario(name)


@pytest.mark.parametrize("name", ["imazu", "dnv", "traffic"])
def test_every_episode_of_a_suite_can_be_drawn(name) -> None:
    suite = SUITES[name]
    for one in suite.sets:
        scenarios = [one.draw(seed=k, episode=k) for k in range(min(suite.episodes, 55))]
        assert all(scenario.traffic for scenario in scenarios)
    if name != "traffic":
        assert len(suite.sets[0].cases) == suite.episodes
