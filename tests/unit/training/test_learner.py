"""Seeds that learn together, against the same seeds that learn alone."""

import msgspec
import pytest
import torch

from twinscrew.training.agents import algorithm, make_agent
from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.agents.ddpg import DdpgSettings
from twinscrew.training.agents.dqn import DqnSettings
from twinscrew.training.agents.iqn import IqnSettings
from twinscrew.training.agents.ppo import PpoSettings
from twinscrew.training.agents.rainbow import RainbowSettings
from twinscrew.training.agents.sac import SacSettings
from twinscrew.training.learner import Stack, limit
from twinscrew.training.networks import NetworkSettings, Observations, circles
from twinscrew.training.replay import TRANSITION_COLUMNS, Drawn

NETWORK = NetworkSettings(ego_width=16, object_width=16, feature_width=16, hidden_width=16)
COMMON = {"network": NETWORK, "precision": "float32", "gradient_norm": 0.5}
ALL = [
    AcIqnSettings(**COMMON, risk_levels=8, target_every=2),
    IqnSettings(**COMMON),
    SacSettings(**COMMON),
    DdpgSettings(**COMMON),
    RainbowSettings(**COMMON),
    DqnSettings(**COMMON),
    PpoSettings(**COMMON),
]
EVERY = pytest.mark.parametrize("settings", ALL, ids=algorithm)
SEEDS = (0, 1, 2)


def drawn(seed, pairs, weighted):
    """Random transitions."""
    generator = torch.Generator().manual_seed(seed)
    rows = torch.randn(32, TRANSITION_COLUMNS, generator=generator)
    rows[:, 37:39] = rows[:, 37:39].clamp(-1, 1)
    if pairs:
        rows[:, 37:39] = (rows[:, 37:39] * 2).round() / 2
    weight = torch.rand(32, generator=generator) if weighted else None
    return Drawn(rows, weight, extra=torch.randn(32, 3, generator=generator))


def learn_both_ways(settings, updates=3):
    alone = [make_agent(settings, seed, "cpu") for seed in SEEDS]
    stack = Stack([make_agent(settings, seed, "cpu") for seed in SEEDS])
    pairs, weighted = not alone[0].continuous, algorithm(settings) == "rainbow"
    for k in range(updates):
        rows = [drawn(10 * k + seed, pairs, weighted) for seed in SEEDS]
        for agent, one in zip(alone, rows, strict=True):
            agent.update(one.batch(agent.device), 0.1 * k)
        stack.update(rows, 0.1 * k)
    stack.settle()
    return alone, stack


def same(one, other):
    state, twin = one.state(), other.state()
    for name in one.networks:
        for key, value in state[name].items():
            assert torch.allclose(value, twin[name][key], atol=2e-6), (name, key)
    for name in one.optimizers:
        for number, kept in state[name]["state"].items():
            for key, value in kept.items():
                assert torch.allclose(value, twin[name]["state"][number][key], atol=1e-5)
    assert torch.equal(state["generator"], twin["generator"])
    assert state["updates"] == twin["updates"]


@EVERY
def test_each_seed_learns_together_what_it_learns_alone(settings):
    alone, stack = learn_both_ways(settings)
    for one, other in zip(alone, stack.agents, strict=True):
        same(one, other)


@EVERY
def test_each_seed_acts_together_as_it_acts_alone(settings):
    alone, stack = learn_both_ways(settings, updates=1)
    generator = torch.Generator().manual_seed(5)
    seen = [
        circles(
            torch.randn(4, 7, generator=generator),
            torch.randn(4, 5, 5, generator=generator),
            torch.ones(4, 5),
        )
        for _ in SEEDS
    ]
    risk = torch.rand(3, 4, 1) if algorithm(settings) == "ac_iqn" else None
    together = stack.act(Observations(*map(torch.stack, zip(*seen, strict=True))), risk)
    for k, agent in enumerate(alone):
        level = None if risk is None else risk[k]
        expected = agent.act(seen[k], explore=True, risk=level)
        assert torch.allclose(together[k], expected, atol=1e-5)


def test_a_stack_of_restored_agents_goes_on_where_they_were():
    alone, stack = learn_both_ways(ALL[0])
    again = Stack(stack.agents)
    rows = [drawn(90 + seed, pairs=False, weighted=False) for seed in SEEDS]
    again.update(rows, 0.5)
    again.settle()
    for agent, other, one in zip(alone, again.agents, rows, strict=True):
        agent.update(one.batch(agent.device), 0.5)
        same(agent, other)


def test_what_one_seed_sees_does_not_move_another():
    settings = ALL[0]
    ends = []
    for other in (50, 60):
        stack = Stack([make_agent(settings, seed, "cpu") for seed in (0, 1)])
        stack.update([drawn(1, False, False), drawn(other, False, False)], 0.0)
        stack.settle()
        ends.append(stack.agents[0].state()["actor"]["output.weight"])
    assert torch.equal(*ends)


def test_the_gradient_of_each_seed_is_limited_by_itself():
    gradients = {"a": torch.tensor([[3.0, 0.0], [0.3, 0.0]]), "b": torch.tensor([4.0, 0.4])}
    limit(gradients, 1.0)
    norms = (gradients["a"].square().sum(1) + gradients["b"].square()).sqrt()
    assert norms.tolist() == pytest.approx([1.0, 0.5], abs=1e-5)


def test_agents_take_part_with_their_settings_of_the_phase():
    stack = Stack([make_agent(ALL[3], seed, "cpu") for seed in SEEDS])
    before = stack.parameters["its_actor.output.weight"].clone()
    for agent in stack.agents:
        agent.retune(msgspec.structs.replace(ALL[3], learning_rate=1e-9, actor_rate=1e-9))
    stack.update([drawn(seed, False, False) for seed in SEEDS], 0.0)
    assert torch.allclose(before, stack.parameters["its_actor.output.weight"], atol=1e-7)
