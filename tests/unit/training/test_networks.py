import math

import pytest
import torch

from twinscrew.training.agents.ac_iqn import (
    CosineEmbedding,
    PaperQuantileCritic,
    QuantileCritic,
    make_quantile_critic,
)
from twinscrew.training.networks import (
    Actor,
    EncoderSettings,
    NetworkSettings,
    PaperEncoder,
    See,
    SetEncoder,
    circles,
    make_encoder,
    squash,
)

PAPER = NetworkSettings(kind="paper", critic="paper", normalise=False)
OURS = NetworkSettings()
BOTH = pytest.mark.parametrize("settings", [PAPER, OURS], ids=["paper", "ours"])


def observations(count, seed=0, objects=3):
    generator = torch.Generator().manual_seed(seed)
    mask = torch.zeros(count, 5)
    mask[:, :objects] = 1.0
    things = torch.randn(count, 5, 5, generator=generator) * 5
    return circles(torch.randn(count, 7, generator=generator), things * mask[:, :, None], mask)


@BOTH
def test_padding_has_no_influence_whatever_it_holds(settings):
    torch.manual_seed(0)
    actor, see = Actor(settings), See(settings)
    clean = observations(6)
    dirty = clean.objects.clone()
    dirty[:, 3:] = torch.tensor([float("nan"), float("inf"), 1e9, -5.0, 3.0])
    with torch.no_grad():
        answer = actor(see(clean._replace(objects=dirty)))
        assert torch.equal(answer, actor(see(clean)))


@BOTH
def test_what_is_there_has_influence(settings):
    torch.manual_seed(0)
    actor, see = Actor(settings), See(settings)
    seen = observations(6)
    moved = seen._replace(objects=seen.objects + seen.mask[:, :, None])
    assert not torch.allclose(actor(see(seen)), actor(see(moved)))


def test_the_set_encoder_does_not_care_for_the_order_of_objects():
    torch.manual_seed(0)
    settings = EncoderSettings()
    encoder, see = SetEncoder(settings), See(settings)
    seen = observations(4, objects=5)
    turned = seen._replace(objects=seen.objects[:, [3, 1, 4, 0, 2]])
    assert torch.allclose(encoder(see(seen)), encoder(see(turned)), atol=1e-5)


def test_the_papers_encoder_has_the_papers_size():
    encoder = make_encoder(PAPER)
    assert isinstance(encoder, PaperEncoder)
    assert encoder.width == 256
    assert sum(p.numel() for p in encoder.parameters()) == 7 * 56 + 56 + 5 * 40 + 40


def test_actions_lie_between_minus_one_and_one():
    extreme = squash(torch.tensor([-1e9, 0.0, 1.0, 1e9]))
    assert extreme.tolist() == pytest.approx([-1.0, 0.0, 0.5, 1.0])


def test_the_cosine_embedding_is_that_of_iqn():
    embedding = CosineEmbedding(64, 64)
    with torch.no_grad():
        embedding.layer.weight.copy_(torch.eye(64))
        embedding.layer.bias.zero_()
    tau = 0.3
    expected = [max(0.0, math.cos(math.pi * i * tau)) for i in range(64)]
    assert embedding(torch.tensor([tau]))[0].tolist() == pytest.approx(expected, abs=1e-4)


def test_folding_the_fraction_into_the_weights_is_the_product_of_the_features():
    torch.manual_seed(1)
    critic, see = QuantileCritic(OURS), See(OURS)
    seen, action, fractions = see(observations(5)), torch.rand(5, 2), torch.rand(3)
    joined = torch.relu(critic.state(critic.encoder(seen)) + critic.action(action))
    joined = torch.relu(critic.joined(joined))
    product = joined[:, None, :] * critic.embedding(fractions)
    expected = critic.output(torch.relu(critic.hidden(product))).squeeze(-1)
    assert torch.allclose(critic(seen, action, fractions), expected, atol=1e-5)


@BOTH
def test_a_critic_gives_one_quantile_for_each_fraction(settings):
    critic, see = make_quantile_critic(settings), See(settings)
    assert critic(see(observations(5)), torch.rand(5, 2), torch.rand(8)).shape == (5, 8)


def test_the_papers_critic_takes_fractions_of_each_sample():
    torch.manual_seed(2)
    critic, see = PaperQuantileCritic(PAPER), See(PAPER)
    seen, action, fractions = see(observations(5)), torch.rand(5, 2), torch.rand(5, 8)
    together = critic(seen, action, fractions)
    alone = critic(see(observations(5)), action, fractions[2])
    assert torch.allclose(together[2], alone[2], atol=1e-5)


@BOTH
def test_a_critic_knows_the_action(settings):
    torch.manual_seed(3)
    critic, see = make_quantile_critic(settings), See(settings)
    action = torch.rand(5, 2, requires_grad=True)
    critic(see(observations(5)), action, torch.rand(8)).sum().backward()
    assert (action.grad != 0).any()
