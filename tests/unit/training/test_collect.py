import msgspec
import numpy as np
import pytest
import torch

from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.agents.dqn import DqnSettings
from twinscrew.training.agents.registry import make_agent
from twinscrew.training.buffer import split_rows
from twinscrew.training.collect import Collector, pack_slots
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.exploration import ExplorationSettings
from twinscrew.training.learner import Alone
from twinscrew.training.networks import NetworkSettings
from twinscrew.training.observations import unpack
from twinscrew.training.stack import Stack
from twinscrew.training.train_settings import Phase, TrainSettings, phase_settings

NETWORK = NetworkSettings(ego_width=16, object_width=16, feature_width=32, hidden_width=32)
AC_IQN, DQN = AcIqnSettings(network=NETWORK), DqnSettings(network=NETWORK)
PHASE = Phase(name="learn", steps=1)


def collector(agent=AC_IQN, seed=0, step=0, **changes):
    settings = TrainSettings(agent=agent, phases=[PHASE], parallel_episodes=6, n_steps=1)
    settings = msgspec.structs.replace(settings, **changes)
    return Collector(settings, phase_settings(settings, PHASE), [seed], step)


def gathered(made, agent=AC_IQN, steps=5):
    learner = Alone(make_agent(agent, 0, "cpu"))
    return np.concatenate([made.step(learner, k, random=False)[0] for k in range(steps)])


def test_rows_hold_what_the_environment_shows():
    env = VectorEnv(EnvironmentSettings(), 4, seed=1)
    seen = env.reset()
    back = unpack(torch.from_numpy(pack_slots(seen)))
    assert np.array_equal(back.objects.numpy(), seen.objects.reshape(-1, 5, 5))
    assert np.array_equal(back.ego.numpy(), seen.ego.reshape(-1, 7))
    assert np.array_equal(back.mask.numpy(), seen.mask.reshape(-1, 5))


def test_every_vessel_of_every_episode_gives_a_transition_a_step():
    assert gathered(collector(), steps=5).shape == (5 * 6 * 3, 78)


def test_a_transition_leads_from_one_observation_to_the_next():
    made = collector(exploration=ExplorationSettings(noise=0.0, epsilon_start=0, epsilon_end=0))
    first, second = (split_rows(torch.from_numpy(gathered(made, steps=1))) for _ in range(2))
    assert torch.equal(first.next_observations.ego, second.observations.ego)


def test_rough_episodes_sail_beside_calm_ones_in_their_share():
    rough = {"conditions": {"wind_mps": [10.0, 10.0]}}
    made = collector(rough=rough, rough_share=0.5)
    winds = [env.settings.conditions.wind_mps for env in made._environments]
    assert winds == [(0.0, 0.0), (10.0, 10.0)]
    assert [env.episodes for env in made._environments] == [3, 3]
    assert gathered(made, steps=2).shape == (2 * 6 * 3, 78)


def test_the_same_seed_gathers_the_same_and_a_later_start_something_else():
    assert np.array_equal(gathered(collector()), gathered(collector()))
    assert not np.array_equal(gathered(collector()), gathered(collector(step=100)))
    assert not np.array_equal(gathered(collector()), gathered(collector(seed=1)))


def test_noise_is_added_to_continuous_actions_alone():
    explore = ExplorationSettings(noise=0.5, epsilon_start=0.0, epsilon_end=0.0)
    pairs = gathered(collector(DQN, exploration=explore), DQN)[:, 37:39]
    assert set(np.unique(pairs)) <= {-1.0, -0.5, 0.0, 0.5, 1.0}
    assert len(np.unique(gathered(collector(exploration=explore))[:, 37])) > 50


@pytest.mark.parametrize("agent", [AC_IQN, DQN], ids=["continuous", "discrete"])
def test_random_actions_are_taken_when_asked_for(agent):
    made = collector(agent, exploration=ExplorationSettings(noise=0.0, epsilon_start=0.0))
    learner = Alone(make_agent(agent, 0, "cpu"))
    rows = np.concatenate([made.step(learner, 0, random=True)[0] for _ in range(20)])
    assert rows[:, 37:39].std(axis=0).min() > 0.5


def test_what_a_seed_gathers_does_not_depend_on_who_sails_beside_it():
    def many(seeds):
        settings = TrainSettings(
            agent=AC_IQN, phases=[PHASE], parallel_episodes=6, rough_share=0.5, rough={"park": True}
        )
        made = Collector(settings, phase_settings(settings, PHASE), seeds, 0)
        agents = [make_agent(AC_IQN, seed, "cpu") for seed in seeds]
        learner = Alone(agents[0]) if len(seeds) == 1 else Stack(agents)
        steps = [made.step(learner, 0, random=True) for _ in range(60)]
        return [np.concatenate(rows) for rows in zip(*steps, strict=True)]

    together = many([3, 4])
    for seed, rows in zip((3, 4), together, strict=True):
        assert np.array_equal(rows, many([seed])[0])
