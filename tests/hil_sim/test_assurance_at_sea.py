"""The assurance in the full simulator: waves, wind, a LiDAR, and a policy that does anything."""

import pytest
from tests.hil_sim.assurance_table import row
from tests.hil_sim.reckless import Episode, sail

from twinscrew.hil_sim.experiments.chance import RandomPolicy
from twinscrew.hil_sim.supervisor import Outcome, Result
from twinscrew.runtime.messages.types import Observation
from twinscrew.runtime.safety.assurance import AssuranceSettings


def voyage(seed: int, *, enabled: bool) -> Episode:
    """One vessel among twelve buoys, for as long as it takes the seed to hit one."""
    settings = AssuranceSettings(enabled=enabled)
    return sail(1, 12, seed, policy="random", assurance=settings, limit_s=12.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [10, 13])
def test_a_random_policy_that_hits_a_buoy_does_not_with_the_assurance(seed: int) -> None:
    without, assured = voyage(seed, enabled=False), voyage(seed, enabled=True)
    assert without.results[0].outcome is Outcome.COLLISION
    assert without.interventions == 0
    assert assured.results[0].outcome is Outcome.TIMEOUT
    assert assured.results[0].closest_approach_m > 0.0
    assert assured.interventions > 0


def test_a_seed_says_what_the_random_policy_asks_for(observation: Observation) -> None:
    policies = [RandomPolicy((3, 1)), RandomPolicy((3, 1)), RandomPolicy((3, 2))]
    first, same, other = ([p.act(observation).tolist() for _ in range(3)] for p in policies)
    assert first == same != other


@pytest.fixture
def observation() -> Observation:
    import numpy as np

    zeros = np.zeros((5, 5), dtype=np.float32)
    return Observation(ego=zeros[0], objects=zeros, mask=zeros[0])


def test_a_row_of_the_table_counts_vessels_and_whole_episodes() -> None:
    def result(outcome: Outcome, time_s: float) -> Result:
        return Result(name="a", outcome=outcome, travel_time_s=time_s, closest_approach_m=1.0)

    whole = Episode(1, (result(Outcome.GOAL, 10.0), result(Outcome.GOAL, 20.0)), 2, ())
    partly = Episode(2, (result(Outcome.GOAL, 30.0), result(Outcome.COLLISION, 5.0)), 1, ())
    assert row([whole, partly]) == (
        "2 episodes, 1 with all at their goals; vessels: "
        "{'goal': 3, 'collision': 1, 'timeout': 0}; travel time 20.00 s; 3 interventions"
    )
