import copy

import msgspec
import pytest
import torch

from twinscrew.training.agents.ac_iqn import AcIqn, AcIqnSettings, quantile_huber, worst_share
from twinscrew.training.learner import Alone
from twinscrew.training.networks import NetworkSettings, with_risk

SMALL = NetworkSettings(ego_width=16, object_width=16, feature_width=32, hidden_width=32)
SETTINGS = AcIqnSettings(network=SMALL, precision="float32")


@pytest.mark.slow
def test_the_critics_loss_is_that_of_algorithm_2(batch):
    agent = AcIqn(SETTINGS, seed=1)
    some = batch(reward=lambda action: action[:, 0])
    seen, following = agent.see(some.observations), agent.see(some.next_observations)
    before = agent.generator.get_state()
    loss, _ = agent.critic_loss(agent.prepare(some, agent.chance(64)))
    agent.generator.set_state(before)
    with torch.no_grad():
        first = (torch.arange(8) + torch.rand(8, generator=agent.generator)) / 8
        action = agent.target_actor(following)
        target = some.reward[:, None] + 0.9 * agent.target_critic(following, action, first)
        second = (torch.arange(8) + torch.rand(8, generator=agent.generator)) / 8
        quantiles = agent.critic(seen, some.action, second)
        expected = quantile_huber(quantiles, target, second, 1.0).mean()
    assert loss.item() == pytest.approx(expected.item(), rel=1e-5)


def test_a_lower_risk_level_asks_only_for_the_worst_quantiles(batch):
    agent = AcIqn(SETTINGS, seed=1)
    asked = []
    critic = agent.critic.forward
    agent.critic.forward = lambda s, a, f: asked.append(f) or critic(s, a, f)
    agent.retune(msgspec.structs.replace(SETTINGS, risk=0.25))
    agent.actor_loss(agent.prepare(batch(), agent.chance(64)))
    assert asked[0].max() <= 0.25


def test_the_actor_climbs_the_critic_without_changing_it(batch):
    agent = AcIqn(SETTINGS, seed=2)
    some = batch()
    critic = {k: v.clone() for k, v in agent.critic.state_dict().items()}
    before = agent.actor.output.weight.clone()
    lesson, (_, climb) = agent.prepare(some, agent.chance(64)), agent.descents()
    Alone(agent)._descend(climb, lesson)
    assert all(p.grad is None for p in agent.critic.parameters())
    assert not torch.equal(before, agent.actor.output.weight)
    assert all(torch.equal(critic[k], v) for k, v in agent.critic.state_dict().items())


@pytest.mark.slow
def test_it_learns_which_action_is_rewarded(batch, observations):
    # One-step episodes with reward -(a - 0.5)^2 summed over both thrusters: the best is (0.5, 0.5).
    agent = AcIqn(msgspec.structs.replace(SETTINGS, learning_rate=3e-3, actor_rate=1e-3), seed=3)
    for k in range(400):
        agent.update(batch(128, k, lambda a: -((a - 0.5) ** 2).sum(1), discount=0.0), 0.0)
    action = agent.act(observations(50, 999), explore=True)
    assert action.mean(0).tolist() == pytest.approx([0.5, 0.5], abs=0.12)


def test_target_networks_move_by_their_share(batch):
    agent = AcIqn(msgspec.structs.replace(SETTINGS, target_rate=0.25), seed=4)
    before = agent.target_critic.output.bias.item()
    agent.update(batch(reward=lambda a: a[:, 0]), 0.0)
    after = agent.critic.output.bias.item()
    assert agent.target_critic.output.bias.item() == pytest.approx(0.75 * before + 0.25 * after)


def test_hard_copies_come_every_so_many_updates(batch):
    settings = msgspec.structs.replace(SETTINGS, target_rate=1.0, target_every=3)
    agent = AcIqn(settings, seed=4)
    same = []
    for k in range(6):
        agent.update(batch(seed=k, reward=lambda a: a[:, 0]), 0.0)
        same.append(torch.equal(agent.target_actor.output.weight, agent.actor.output.weight))
    assert same == [False, False, True, False, False, True]


def test_learning_rates_fall_with_progress(batch):
    agent = AcIqn(msgspec.structs.replace(SETTINGS, final_rate=0.1), seed=5)
    agent.update(batch(), 1.0)
    assert agent.optimizers["critic_optimizer"].param_groups[0]["lr"] == pytest.approx(0.1 * 5e-4)
    assert agent.optimizers["actor_optimizer"].param_groups[0]["lr"] == pytest.approx(0.1 * 3e-4)


def test_the_same_seed_learns_the_same(batch, observations):
    def learn(seed):
        agent = AcIqn(SETTINGS, seed)
        for k in range(3):
            agent.update(batch(seed=k), 0.0)
        return agent.act(observations(5, 7), explore=False)

    assert torch.equal(learn(6), learn(6))
    assert not torch.equal(learn(6), learn(7))


def test_a_restored_agent_goes_on_as_if_nothing_had_happened(batch):
    one, other = AcIqn(SETTINGS, 8), AcIqn(SETTINGS, 9)
    for k in range(3):
        one.update(batch(seed=k), 0.0)
    other.restore(copy.deepcopy(one.state()))
    for agent in (one, other):
        agent.update(batch(seed=11), 0.0)
    for name, value in one.critic.state_dict().items():
        assert torch.equal(value, other.critic.state_dict()[name])


def test_bfloat16_changes_little_and_the_losses_stay_float32(batch):
    exact = AcIqn(SETTINGS, 10)
    rough = AcIqn(msgspec.structs.replace(SETTINGS, precision="bfloat16"), 10)
    one, other = exact.update(batch(), 0.0), rough.update(batch(), 0.0)
    assert other["critic_loss"].dtype == torch.float32
    assert float(other["critic_loss"]) == pytest.approx(float(one["critic_loss"]), rel=0.05)


TOLD = msgspec.structs.replace(SETTINGS, risk_levels=8, risk=0.5)


def test_the_worst_share_of_stratified_quantiles_is_the_cvar():
    # Of a return uniform on [0, 1] the quantile at tau is tau, and CVaR_alpha = alpha / 2.
    level = torch.tensor([[0.25], [0.5], [1.0]])
    middles = (torch.arange(8) + 0.5) / 8
    weights = worst_share(level, 8)
    assert weights.sum(1).tolist() == pytest.approx([1.0, 1.0, 1.0])
    assert (weights * middles).sum(1).tolist() == pytest.approx([0.125, 0.25, 0.5])


def test_a_conditioned_actor_climbs_each_samples_own_share(batch):
    agent = AcIqn(TOLD, seed=1)
    risk = torch.tensor([0.125, 1.0]).repeat(8)[:, None]
    draws = {**agent.chance(16), "risk": risk}
    some = batch(16)
    value = -agent.actor_loss(agent.prepare(some, draws))[0]
    seen = with_risk(agent.see(some.observations), risk)
    quantiles = agent.critic(seen, agent.actor(seen), draws["actor"])
    expected = torch.where(risk.squeeze(1) < 1.0, quantiles[:, 0], quantiles.mean(1)).mean()
    assert value.item() == pytest.approx(expected.item(), rel=1e-5)


def test_the_target_action_is_that_of_the_samples_level(batch):
    agent = AcIqn(TOLD, seed=1)
    asked = []
    actor, critic = agent.target_actor.forward, agent.target_critic.forward
    agent.target_actor.forward = lambda seen: asked.append(seen.ego[:, -1]) or actor(seen)
    agent.target_critic.forward = lambda s, *rest: asked.append(s.ego[:, -1]) or critic(s, *rest)
    agent.update(batch(), 0.0)
    assert torch.equal(asked[0], asked[1])
    assert set((asked[0] * 8).tolist()) == {1, 2, 3, 4, 5, 6, 7, 8}


def test_a_conditioned_actor_is_deployed_at_its_level_and_answers_at_others(observations):
    agent, some = AcIqn(TOLD, seed=2), observations(4, 1)
    pilot = agent.deployed(1.0)
    at = {level: pilot(some, torch.full((4, 1), level)) for level in (0.25, 0.5)}
    assert torch.equal(pilot(some), at[0.5])
    assert not torch.equal(at[0.25], at[0.5])
    assert torch.equal(agent.act(some, explore=False), at[0.5])


@pytest.mark.slow
def test_one_network_learns_a_bold_and_a_cautious_policy(batch, observations):
    # One-step episodes: the left thruster gains a = 0 .. 1 but loses 3 a^2 with probability 0.3.
    # The worst eighth holds losses alone, so 0 is best; the mean a - 0.9 a^2 is best at 0.56.
    settings = msgspec.structs.replace(TOLD, learning_rate=3e-3, actor_rate=1e-3)
    agent = AcIqn(settings, seed=3)
    generator = torch.Generator().manual_seed(9)

    def reward(action):
        unlucky = (torch.rand(len(action), generator=generator) < 0.3).float()
        gain = action[:, 0].clamp(min=0.0)
        return gain - unlucky * 3 * gain**2 - action[:, 0].clamp(max=0.0) ** 2

    for k in range(500):
        agent.update(batch(128, k, reward, discount=0.0), 0.0)
    pilot, some = agent.deployed(1.0), observations(50, 999)
    agent.average_actor.load_state_dict(agent.actor.state_dict())
    with torch.no_grad():
        cautious, bold = (
            pilot(some, torch.full((50, 1), level))[:, 0].mean().item() for level in (0.125, 1.0)
        )
    assert cautious < bold - 0.1


@pytest.mark.parametrize("wrong", [{"stratified": False}, {"risk_levels": 3}])
def test_levels_that_no_fractions_fit_are_refused(wrong):
    with pytest.raises(ValueError, match="risk_levels needs stratified"):
        msgspec.structs.replace(TOLD, **wrong)
