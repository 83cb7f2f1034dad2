import pytest
import torch

from twinscrew.training.buffer import TRANSITION_COLUMNS, ReplayBuffer, split_rows


def rows(*numbers):
    return torch.tensor(numbers, dtype=torch.float32)[:, None].expand(-1, TRANSITION_COLUMNS)


def test_the_oldest_transitions_make_room():
    buffer = ReplayBuffer(4)
    buffer.add(rows(1, 2, 3))
    buffer.add(rows(4, 5))
    assert len(buffer) == 4
    assert sorted(buffer.rows[:, 0].tolist()) == [2, 3, 4, 5]


def test_more_than_it_holds_leaves_the_newest():
    buffer = ReplayBuffer(3)
    buffer.add(rows(1, 2, 3, 4, 5))
    assert sorted(buffer.rows[:, 0].tolist()) == [3, 4, 5]


def test_only_what_was_stored_is_drawn_and_all_of_it():
    buffer = ReplayBuffer(100)
    buffer.add(rows(1, 2, 3))
    batch = split_rows(buffer.sample(300, torch.Generator().manual_seed(0)).rows)
    assert set(batch.reward.tolist()) == {1, 2, 3}


def test_the_same_generator_draws_the_same():
    buffer = ReplayBuffer(100)
    buffer.add(rows(*range(50)))
    draws = [buffer.sample(20, torch.Generator().manual_seed(4)).rows for _ in range(2)]
    assert torch.equal(*draws)


def test_a_cleared_buffer_starts_again():
    buffer = ReplayBuffer(10)
    buffer.add(rows(1, 2))
    buffer.clear()
    buffer.add(rows(9))
    assert len(buffer) == 1
    assert split_rows(buffer.sample(5, torch.Generator()).rows).reward.tolist() == [9] * 5


def test_a_row_is_read_column_by_column():
    row = torch.arange(TRANSITION_COLUMNS, dtype=torch.float32)[None]
    batch = split_rows(row)
    assert batch.observations.ego[0].tolist() == list(range(7))
    assert batch.observations.objects[0, 0].tolist() == list(range(7, 12))
    assert batch.observations.mask[0].tolist() == list(range(32, 37))
    assert batch.action[0].tolist() == [37, 38]
    assert batch.reward.tolist() == [39]
    assert batch.discount.tolist() == [40]
    assert batch.next_observations.mask[0, -1].item() == pytest.approx(TRANSITION_COLUMNS - 1)
