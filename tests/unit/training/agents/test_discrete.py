import pytest
import torch
from torch import nn

from twinscrew.training.agents.dqn import Dqn, DqnSettings
from twinscrew.training.agents.values import (
    LEVELS,
    PAIRS,
    Greedy,
    action_number,
    action_table,
    taken,
)


def test_there_are_25_pairs_of_the_five_levels():
    table = action_table()
    assert table.shape == (PAIRS, 2)
    assert {tuple(row) for row in table.tolist()} == {(i, j) for i in LEVELS for j in LEVELS}


def test_numbers_and_pairs_belong_together():
    assert action_number(action_table()).tolist() == list(range(PAIRS))


def test_what_lies_between_levels_is_rounded_to_the_nearest():
    between = torch.tensor([[0.2, -0.3], [7.0, -7.0]])
    assert action_table()[action_number(between)].tolist() == [[0.0, -0.5], [1.0, -1.0]]


def test_the_value_of_the_action_taken_is_picked():
    values = torch.arange(6.0).view(2, 3)
    assert taken(values, torch.tensor([2, 0])).tolist() == [2.0, 3.0]


def test_all_quantiles_of_the_action_taken_are_picked():
    quantiles = torch.arange(12.0).view(2, 2, 3)
    assert taken(quantiles, torch.tensor([1, 2])).tolist() == [[1.0, 4.0], [8.0, 11.0]]


def test_random_pairs_are_pairs_and_all_of_them_come():
    drawn = Dqn(DqnSettings(), 0).random(2000)
    assert set(action_number(drawn).tolist()) == set(range(PAIRS))


def test_the_greedy_policy_takes_the_most_valuable_pair():
    class Fixed(nn.Module):
        def forward(self, seen):
            return nn.functional.one_hot(torch.tensor([7, 24]), PAIRS).float()

    assert Greedy(Fixed())(None).tolist() == action_table()[[7, 24]].tolist()


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_survives_the_way_there_and_back(level):
    pair = torch.tensor([[level, -level]])
    assert action_table()[action_number(pair)].tolist() == pair.tolist()
