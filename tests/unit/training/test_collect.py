import msgspec
import numpy as np
import pytest
import torch

from twinscrew.training.agents import make_agent
from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.agents.dqn import DqnSettings
from twinscrew.training.agents.ppo import PpoSettings
from twinscrew.training.collect import Collector, ExplorationSettings
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.learner import Alone, Stack
from twinscrew.training.networks import NetworkSettings, unpack
from twinscrew.training.perception import PACKED_COLUMNS
from twinscrew.training.replay import Replay, split_rows
from twinscrew.training.settings import Phase, TrainSettings, phase_settings

NETWORK = NetworkSettings(ego_width=16, object_width=16, feature_width=32, hidden_width=32)
AC_IQN, DQN = AcIqnSettings(network=NETWORK), DqnSettings(network=NETWORK)
PHASE = Phase(name="learn", steps=1)


def collector(agent=AC_IQN, seed=0, step=0, **changes):
    settings = TrainSettings(agent=agent, phases=[PHASE], parallel_episodes=6, n_steps=1)
    settings = msgspec.structs.replace(settings, **changes)
    return collecting(settings, [seed], step)


def collecting(settings, seeds, step=0):
    told = phase_settings(settings, PHASE)
    rough = round(settings.parallel_episodes * settings.rough_share)
    kinds = [(told.calm, settings.parallel_episodes - rough), (told.rough, rough)]
    agents = [make_agent(settings.agent, one) for one in seeds]
    return Collector(kinds, settings.exploration, agents, seeds, step)


def rows_of(step):
    """The transitions of a step, (n, 78), of one decision each."""
    replay = Replay(1000)
    replay.begin(len(step.reward))
    replay.add(step)
    return replay.rows[: replay.added].numpy()


def gathered(made, agent=AC_IQN, steps=5):
    learner = Alone(make_agent(agent, 0, "cpu"))
    steps = [made.step(learner, k, random=False)[0] for k in range(steps)]
    return np.concatenate([rows_of(step) for step in steps])


def test_rows_hold_what_the_environment_shows():
    env = VectorEnv(EnvironmentSettings(), 4, seed=1)
    seen = env.reset()
    back = unpack(torch.from_numpy(seen.rows.reshape(-1, PACKED_COLUMNS)))
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
    rows = np.concatenate([rows_of(made.step(learner, 0, random=True)[0]) for _ in range(20)])
    assert rows[:, 37:39].std(axis=0).min() > 0.5


def test_what_a_seed_gathers_does_not_depend_on_who_sails_beside_it():
    def many(seeds):
        settings = TrainSettings(
            agent=AC_IQN, phases=[PHASE], parallel_episodes=6, rough_share=0.5, rough={"park": True}
        )
        made = collecting(settings, seeds)
        agents = [make_agent(AC_IQN, seed, "cpu") for seed in seeds]
        learner = Alone(agents[0]) if len(seeds) == 1 else Stack(agents)
        steps = [made.step(learner, 0, random=True) for _ in range(60)]
        return [np.concatenate([rows_of(one) for one in mine]) for mine in zip(*steps, strict=True)]

    together = many([3, 4])
    for seed, rows in zip((3, 4), together, strict=True):
        assert np.array_equal(rows, many([seed])[0])


def test_returns_are_those_of_vessels_that_have_come_to_their_end():
    made = collector(exploration=ExplorationSettings(noise=0.0))
    learner = Alone(make_agent(AC_IQN, 0))
    earned, ended = np.zeros(18), []
    for _ in range(150):
        step = made.step(learner, 0, random=True)[0]
        earned += step.reward
        over = step.terminated | step.truncated
        ended += earned[over].tolist()
        earned[over] = 0.0
    assert len(ended) > 3
    assert [one for one, _ in made.ended[0]] == pytest.approx(ended, abs=1e-4)


def test_an_on_policy_agents_actions_are_its_own():
    agent = PpoSettings(network=NETWORK)
    made = collector(agent, exploration=ExplorationSettings(noise=1.0, epsilon_start=1.0))
    learner = Alone(make_agent(agent, 0))
    state = learner.agents[0].generator.get_state()
    step = made.step(learner, 0, random=True)[0]
    learner.agents[0].generator.set_state(state)
    seen = unpack(torch.from_numpy(step.observation))
    own = learner.agents[0].act(seen, explore=True).numpy()
    assert np.allclose(step.action, own, atol=1e-6)
