"""What every agent must do: learn a rewarded action, copy its targets, come back from a file."""

import copy

import msgspec
import pytest
import torch

from twinscrew.training.agents import algorithm, make_agent
from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.agents.ddpg import DdpgSettings
from twinscrew.training.agents.dqn import DqnSettings
from twinscrew.training.agents.iqn import IqnSettings
from twinscrew.training.agents.rainbow import RainbowSettings
from twinscrew.training.agents.sac import SacSettings
from twinscrew.training.networks import NetworkSettings

NETWORK = NetworkSettings(ego_width=16, object_width=16, feature_width=32, hidden_width=32)
COMMON = {"network": NETWORK, "precision": "float32", "average_rate": 0.05, "learning_rate": 3e-3}
ALL = [
    AcIqnSettings(**COMMON, actor_rate=1e-3),
    IqnSettings(**COMMON),
    SacSettings(**COMMON, actor_rate=1e-3, temperature=0.01, learn_temperature=False),
    DdpgSettings(**COMMON, actor_rate=1e-3),
    RainbowSettings(**COMMON, support_min=-3.0, support_max=0.0),
    DqnSettings(**COMMON),
]
EVERY = pytest.mark.parametrize("settings", ALL, ids=algorithm)


@pytest.mark.slow
@EVERY
def test_it_learns_which_action_is_rewarded(settings, batch, observations):
    # One decision an episode, rewarded by -(a - 0.5)^2 for each thruster: the best is (0.5, 0.5).
    agent = make_agent(settings, seed=3, device="cpu")
    for k in range(400):
        pairs = not agent.continuous
        agent.update(batch(128, k, lambda a: -((a - 0.5) ** 2).sum(1), 0.0, pairs), 0.0)
    action = agent.act(observations(100, 999), explore=False)
    assert ((action - 0.5) ** 2).sum(1).mean() < 0.15  # 0.5 for no action at all


@EVERY
def test_what_it_deploys_is_what_it_does_greedily(settings, observations):
    agent = make_agent(settings, seed=1, device="cpu")
    seen = observations(20, 5)
    with torch.no_grad():
        deployed = agent.deployed(1.0)(seen)
    assert torch.allclose(deployed, agent.act(seen, explore=False), atol=1e-5)


@EVERY
def test_random_actions_fill_the_range(settings):
    action = make_agent(settings, seed=1, device="cpu").random(500)
    assert action.shape == (500, 2)
    assert action.abs().max() <= 1.0
    assert action.std(0).min() > 0.5


@EVERY
def test_it_goes_on_after_a_restore_as_if_nothing_had_happened(settings, batch, observations):
    one, other = (make_agent(settings, seed, "cpu") for seed in (8, 9))
    pairs = not one.continuous
    for k in range(3):
        one.update(batch(seed=k, pairs=pairs), 0.0)
    other.restore(copy.deepcopy(one.state()))
    answers = []
    for agent in (one, other):
        agent.update(batch(seed=11, pairs=pairs), 0.0)
        answers.append(agent.act(observations(10, 1), explore=False))
    assert torch.equal(*answers)
    assert one.updates == other.updates == 4


@EVERY
def test_the_state_of_other_networks_is_refused(settings):
    wide = msgspec.structs.replace(NETWORK, hidden_width=40)
    other = make_agent(msgspec.structs.replace(settings, network=wide), 0, "cpu")
    with pytest.raises((KeyError, RuntimeError, ValueError)):
        make_agent(settings, 0, "cpu").restore(other.state())


@EVERY
def test_the_same_seed_learns_the_same(settings, batch, observations):
    def learn(seed):
        agent = make_agent(settings, seed, "cpu")
        for k in range(2):
            agent.update(batch(seed=k, pairs=not agent.continuous), 0.0)
        agent.update(batch(seed=5, pairs=not agent.continuous), 0.0)
        return torch.cat([p.detach().flatten() for p in agent.deployed(1.0).parameters()])

    assert torch.equal(learn(6), learn(6))
    assert not torch.equal(learn(6), learn(7))
