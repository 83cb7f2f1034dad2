import math

import pytest
import torch

from twinscrew.training.agents.ac_iqn import draw_fractions, quantile_huber
from twinscrew.training.agents.base import huber, td_target
from twinscrew.training.agents.rainbow import cross_entropy, project_distribution


def test_there_is_one_stratified_fraction_in_each_equal_part():
    fractions = draw_fractions(1, 8, torch.Generator().manual_seed(3), stratified=True)
    assert ((fractions * 8).floor() == torch.arange(8)).all()


def test_uniform_fractions_differ_between_samples_and_fill_the_unit_interval():
    fractions = draw_fractions(1000, 8, torch.Generator().manual_seed(0), stratified=False)
    assert fractions.shape == (1000, 8)
    assert fractions.mean() == pytest.approx(0.5, abs=0.02)
    assert fractions.std() == pytest.approx(1 / math.sqrt(12), abs=0.01)


def test_the_target_does_not_look_beyond_the_end_of_an_episode():
    target = td_target(
        torch.tensor([1.0, -5.0]), torch.tensor([0.9, 0.0]), torch.tensor([[10.0, 20.0]] * 2)
    )
    assert target.tolist() == [[10.0, 19.0], [-5.0, -5.0]]


def test_the_huber_loss_is_square_inside_and_linear_outside():
    error = torch.tensor([-3.0, -0.5, 0.0, 2.0, 4.0])
    assert huber(error, 2.0).tolist() == [4.0, 0.125, 0.0, 2.0, 6.0]


def test_the_quantile_huber_loss_agrees_with_the_hand_computed_sum():
    # One sample, tau = (0.25, 0.75), Z = (0, 2), targets (1, -3), kappa = 1:
    # u = 1: |0.25 - 0| * 0.5 = 0.125;   u = -3: |0.25 - 1| * 2.5 = 1.875
    # u = -1: |0.75 - 1| * 0.5 = 0.125;  u = -5: |0.75 - 1| * 4.5 = 1.125
    # mean over the targets, sum over the fractions: (0.125 + 1.875 + 0.125 + 1.125) / 2 = 1.625
    loss = quantile_huber(
        torch.tensor([[0.0, 2.0]]),
        torch.tensor([[1.0, -3.0]]),
        torch.tensor([0.25, 0.75]),
        kappa=1.0,
    )
    assert loss.tolist() == [pytest.approx(1.625)]


def test_kappa_divides_the_quantile_huber_loss():
    # tau = 0.5, u = 4, kappa = 2: 0.5 * 2 (4 - 1) / 2 = 1.5
    loss = quantile_huber(
        torch.tensor([[0.0]]), torch.tensor([[4.0]]), torch.tensor([[0.5]]), kappa=2.0
    )
    assert loss.tolist() == [1.5]


def test_fractions_of_each_sample_are_used_for_that_sample():
    quantiles, targets = torch.zeros(2, 1), torch.full((2, 1), 3.0)
    loss = quantile_huber(quantiles, targets, torch.tensor([[0.1], [0.9]]), kappa=1.0)
    assert loss.tolist() == [pytest.approx(0.25), pytest.approx(2.25)]


def test_the_targets_get_no_gradient():
    targets = torch.ones(1, 1, requires_grad=True)
    quantiles = torch.zeros(1, 1, requires_grad=True)
    quantile_huber(quantiles, targets, torch.tensor([0.5]), 1.0).sum().backward()
    assert targets.grad is None
    assert quantiles.grad is not None


def test_descending_the_loss_finds_the_quantiles_of_a_distribution():
    returns = torch.linspace(0.0, 10.0, 201)[None, :]
    fractions = torch.tensor([0.1, 0.5, 0.9])
    quantiles = torch.full((1, 3), 5.0, requires_grad=True)
    optimizer = torch.optim.SGD([quantiles], lr=0.2)
    for _ in range(400):
        optimizer.zero_grad()
        quantile_huber(quantiles, returns, fractions, kappa=0.01).sum().backward()
        optimizer.step()
    assert quantiles.detach()[0].tolist() == pytest.approx([1.0, 5.0, 9.0], abs=0.15)


def test_a_moved_distribution_is_shared_between_the_neighbouring_atoms():
    # r = 0.5, gamma = 1 on the support (-1, 0, 1): 0 -> 0.5, 1 -> 1.5 clipped to 1.
    projected = project_distribution(
        torch.tensor([[0.0, 0.4, 0.6]]),
        torch.tensor([0.5]),
        torch.tensor([1.0]),
        torch.tensor([-1.0, 0.0, 1.0]),
    )
    assert projected[0].tolist() == pytest.approx([0.0, 0.2, 0.8])


def test_after_the_end_only_the_reward_is_left_of_a_distribution():
    projected = project_distribution(
        torch.tensor([[0.3, 0.3, 0.4]]),
        torch.tensor([-0.25]),
        torch.tensor([0.0]),
        torch.tensor([-1.0, 0.0, 1.0]),
    )
    assert projected[0].tolist() == pytest.approx([0.25, 0.75, 0.0])


def test_the_cross_entropy_agrees_with_the_hand_computed_sum():
    log_probabilities = torch.log(torch.tensor([[0.5, 0.25, 0.25]]))
    target = torch.tensor([[0.5, 0.5, 0.0]])
    expected = 0.5 * math.log(2) + 0.5 * math.log(4)
    assert cross_entropy(log_probabilities, target).tolist() == [pytest.approx(expected)]
