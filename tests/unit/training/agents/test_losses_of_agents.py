"""Each agent's loss against the same sum written out by hand."""

import math

import msgspec
import pytest
import torch

from twinscrew.training.agents.ac_iqn import quantile_huber
from twinscrew.training.agents.ddpg import Ddpg, DdpgSettings
from twinscrew.training.agents.dqn import Dqn, DqnSettings
from twinscrew.training.agents.iqn import Iqn, IqnSettings
from twinscrew.training.agents.rainbow import Rainbow, RainbowSettings, project_distribution
from twinscrew.training.agents.sac import Sac, SacSettings, log_density
from twinscrew.training.agents.values import action_number
from twinscrew.training.networks import NetworkSettings

NETWORK = NetworkSettings(ego_width=16, object_width=16, hidden_width=32)
COMMON = {"network": NETWORK, "precision": "float32"}


def half_square(error):
    """The Huber loss inside kappa = 1, where these small networks' errors lie."""
    assert abs(error) < 1.0
    return 0.5 * error * error


def lesson(agent, batch):
    """Give a batch with what the agent draws for it."""
    return agent.prepare(batch, agent.chance(len(batch.action)))


def differ(network):
    """Give a target network values of its own."""
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(0.5)


@pytest.mark.parametrize("double", [False, True])
def test_dqn_looks_one_step_ahead(double, batch):
    agent = Dqn(DqnSettings(**COMMON, double=double), 0)
    differ(agent.target)
    some = batch(4, reward=lambda a: 0.1 * a[:, 0], pairs=True)
    with torch.no_grad():
        online = agent.network(agent.see(some.next_observations))
        target = agent.target(agent.see(some.next_observations))
        values = agent.network(agent.see(some.observations))
    total = 0.0
    for k, number in enumerate(action_number(some.action).tolist()):
        best = int((online if double else target)[k].argmax())
        goal = float(some.reward[k]) + 0.9 * float(target[k, best])
        total += half_square(goal - float(values[k, number]))
    assert agent.loss(lesson(agent, some))[0].item() == pytest.approx(total / 4, rel=1e-4)


def test_ddpg_values_the_targets_action(batch):
    agent = Ddpg(DdpgSettings(**COMMON), 0)
    differ(agent.target_critic)
    some = batch(4, reward=lambda a: 0.1 * a[:, 0])
    seen, following = agent.see(some.observations), agent.see(some.next_observations)
    with torch.no_grad():
        after = agent.target_critic(following, agent.target_actor(following))
        values = agent.critic(seen, some.action)
    errors = (some.reward + 0.9 * after - values).tolist()
    expected = sum(half_square(error) for error in errors) / 4
    loss, _ = agent.critic_loss(lesson(agent, some))
    assert loss.item() == pytest.approx(expected, rel=1e-4)


def test_iqn_takes_the_best_action_by_its_mean_quantile(batch):
    agent = Iqn(IqnSettings(**COMMON), 0)
    differ(agent.target)
    some = batch(4, reward=lambda a: a[:, 0], pairs=True)
    state = agent.generator.get_state()
    loss = agent.loss(lesson(agent, some))[0].item()
    agent.generator.set_state(state)
    first, second = (
        (torch.arange(8) + torch.rand(8, generator=agent.generator)) / 8 for _ in range(2)
    )
    with torch.no_grad():
        after = agent.target(agent.see(some.next_observations), first)
        now = agent.network(agent.see(some.observations), second)
    losses = []
    for k, number in enumerate(action_number(some.action).tolist()):
        best = int(after[k].mean(0).argmax())
        target = some.reward[k] + 0.9 * after[k, :, best]
        losses.append(quantile_huber(now[k, :, number][None], target[None], second, 1.0))
    assert loss == pytest.approx(torch.cat(losses).mean().item(), rel=1e-4)


def test_rainbow_projects_the_double_choice(batch):
    agent = Rainbow(RainbowSettings(**COMMON, support_min=-2.0, support_max=2.0, atoms=5), 0)
    differ(agent.target)
    some = batch(3, reward=lambda a: a[:, 0], pairs=True)
    with torch.no_grad():
        online = agent.network(agent.see(some.next_observations)).exp()
        target = agent.target(agent.see(some.next_observations)).exp()
        logs = agent.network(agent.see(some.observations))
    support = torch.linspace(-2.0, 2.0, 5)
    quiet = agent.prepare(some, {})
    for k, number in enumerate(action_number(some.action).tolist()):
        best = int((online[k] * support).sum(1).argmax())
        goal = project_distribution(
            target[k, best][None], some.reward[k : k + 1], some.discount[k : k + 1], support
        )
        expected = -(goal[0] * logs[k, number]).sum().item()
        assert agent.losses(quiet)[k].item() == pytest.approx(expected, rel=1e-4)


def test_rainbow_weights_each_samples_loss(batch):
    settings = RainbowSettings(**COMMON)
    some = batch(4, reward=lambda a: a[:, 0], pairs=True)
    plain = Rainbow(settings, 0).update(some, 0.0)
    weighted = Rainbow(settings, 0).update(some._replace(weight=torch.tensor([1.0, 0, 0, 0])), 0.0)
    assert weighted["critic_loss"].item() == pytest.approx(plain["priority"][0].item() / 4)


def test_the_density_of_a_squashed_gaussian_integrates_to_one():
    x = torch.linspace(-2000.0, 2000.0, 2_000_001, dtype=torch.float64)
    mean, log_sigma = torch.tensor(0.3), torch.tensor(-0.5)
    one = log_density(x[:, None], mean, log_sigma).exp()
    action = torch.atan(x) * 2 / math.pi
    assert torch.trapezoid(one, action).item() == pytest.approx(1.0, abs=1e-4)


def test_sac_subtracts_the_density_from_the_worse_critic(batch):
    agent = Sac(SacSettings(**COMMON), 0)
    differ(agent.target_critics[0])
    some = batch(4, reward=lambda a: 0.1 * a[:, 0])
    seen, following = agent.see(some.observations), agent.see(some.next_observations)
    draws = agent.chance(4)
    loss = agent.critic_loss(agent.prepare(some, draws))[0].item()
    with torch.no_grad():
        action, density = agent.sample(following, draws["following"])
        both = torch.stack([critic(following, action) for critic in agent.target_critics])
        goal = some.reward + 0.9 * (both.amin(0) - 0.078 * density)
        expected = 0.0
        for critic in agent.critics:
            errors = (goal - critic(seen, some.action)).tolist()
            expected += sum(half_square(error) for error in errors) / 4
    assert loss == pytest.approx(expected, rel=1e-3)


def test_sac_lowers_its_temperature_while_there_is_more_entropy_than_asked(batch):
    settings = SacSettings(**COMMON, target_entropy=-2.0)
    agent = Sac(settings, 0)
    agent.update(batch(), 0.0)
    assert agent.temperature.log.item() < math.log(settings.temperature)
    fixed = Sac(msgspec.structs.replace(settings, learn_temperature=False), 0)
    fixed.update(batch(), 0.0)
    assert fixed.temperature.log.item() == pytest.approx(math.log(settings.temperature))
