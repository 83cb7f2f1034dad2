import pytest

from twinscrew.hil_sim.experiments.episode import sail_episode
from twinscrew.hil_sim.experiments.plan import SetSettings, Task, parse_methods
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.runtime.errors import TwinscrewError

HEAD_ON = SetSettings(name="head on", scenario="head_on")


def task(policy: str = "ac_iqn", switches=(), **changes) -> Task:
    (method,) = parse_methods(policy)
    return Task(method, HEAD_ON, switches, 0, 3, "vrx32")._replace(**changes)


@pytest.fixture(scope="module")
def sailed():
    return sail_episode(task())


@pytest.mark.slow
def test_an_episode_is_what_sitl_sails_bit_for_bit(sailed) -> None:
    report = sail(load_scenario("head_on", seed=3), SitlSettings(seed=3, lockstep=True))
    assert sailed.record.decisions_sha256 == report.sha256
    ours = [(v.outcome, v.travel_time_s) for v in sailed.record.vessels]
    assert ours == [(v.outcome, round(v.travel_time_s, 3)) for v in report.vessels]


def test_two_that_meet_head_on_have_one_encounter_each() -> None:
    """With a policy that alters late enough for both to be in each other's zone."""
    sailed = sail_episode(task("ac_iqn_wam_v"))
    encounters = sailed.record.encounters
    assert {(e.kind, e.ego) for e in encounters} >= {("head_on", 0), ("head_on", 1)}
    nearest = [v.closest_approach_m for v in sailed.record.vessels]
    assert min(e.gap_m for e in encounters) == pytest.approx(min(nearest), abs=0.1)


@pytest.mark.slow
def test_an_episode_can_be_sailed_again_and_gives_the_same(sailed) -> None:
    again = sail_episode(task()).record
    assert again.decisions_sha256 == sailed.record.decisions_sha256
    assert again.encounters == sailed.record.encounters
    assert again.vessels == sailed.record.vessels


@pytest.mark.slow
@pytest.mark.parametrize(
    "switches",
    [
        ("ideal_perception",),
        ("ideal_tracking",),
        ("no_wind",),
        ("no_waves",),
        ("ideal_thrust",),
        ("training_vessel",),
        ("as_vrx",),
    ],
)
def test_every_switch_changes_what_is_decided(sailed, switches) -> None:
    record = sail_episode(task(switches=switches)).record
    assert record.decisions_sha256 != sailed.record.decisions_sha256
    assert record.variant == switches[0]


@pytest.mark.slow
def test_chance_does_what_its_seed_says() -> None:
    first, again = (sail_episode(task("random", episode=k)).record for k in (0, 1))
    assert first.decisions_sha256 == again.decisions_sha256
    other = sail_episode(task("random", seed=4)).record
    assert other.decisions_sha256 != first.decisions_sha256


@pytest.mark.slow
def test_without_the_assurance_nobody_intervenes() -> None:
    bare = sail_episode(task("random", switches=("no_assurance",))).record
    assert [vessel.interventions for vessel in bare.vessels] == [0, 0]


def test_what_fails_is_an_error_and_not_a_result() -> None:
    lost = task(set=SetSettings(name="lost", scenario="no_such"))
    with pytest.raises(TwinscrewError, match=r"episode \(ac_iqn, lost, full, 0\).*no_such"):
        sail_episode(lost)
