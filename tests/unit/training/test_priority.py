import pytest
import torch

from twinscrew.training.buffer import TRANSITION_COLUMNS, split_rows
from twinscrew.training.priority import BLOCK, PrioritisedReplay, PrioritySettings


def replay(count, capacity=3 * BLOCK, exponent=1.0, correction=1.0):
    settings = PrioritySettings(exponent=exponent, correction_start=correction)
    made = PrioritisedReplay(capacity, settings)
    rows = torch.arange(count, dtype=torch.float32)[:, None].expand(-1, TRANSITION_COLUMNS)
    made.add(rows)
    return made


def shares(made, count, draws=40_000):
    places = made.sample(draws, torch.Generator().manual_seed(0)).places
    return torch.bincount(places, minlength=count).double() / draws


def test_transitions_are_drawn_in_proportion_to_their_priority_in_every_block():
    count = 2 * BLOCK + 10
    made = replay(count)
    losses = torch.full((count,), 1e-4)
    favoured = torch.tensor([0, BLOCK, BLOCK + 7, 2 * BLOCK + 9])
    losses[favoured] = torch.tensor([100.0, 200.0, 300.0, 400.0])
    made.reprioritise(torch.arange(count), losses)
    assert shares(made, count)[favoured].tolist() == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=0.01)


def test_an_exponent_of_zero_draws_uniformly():
    made = replay(10, exponent=0.0)
    made.reprioritise(torch.arange(10), torch.arange(10.0))
    assert shares(made, 10).tolist() == pytest.approx([0.1] * 10, abs=0.01)


def test_new_transitions_have_the_greatest_priority():
    made = replay(2)
    made.reprioritise(torch.tensor([0, 1]), torch.tensor([9.0, 9.0]))
    made.add(torch.zeros(1, TRANSITION_COLUMNS))
    assert shares(made, 3).tolist() == pytest.approx([1 / 3] * 3, abs=0.01)


def test_full_correction_makes_the_weighted_draw_uniform():
    made = replay(2)
    made.reprioritise(torch.tensor([0, 1]), torch.tensor([3.0, 1.0]))
    batch = made.sample(1000, torch.Generator().manual_seed(1))
    weight = {int(p): float(w) for p, w in zip(batch.places, batch.weight, strict=True)}
    assert weight[1] == pytest.approx(1.0)
    assert weight[0] == pytest.approx(1 / 3, rel=1e-3)


def test_the_rows_drawn_are_those_of_their_places():
    drawn = replay(50).sample(20, torch.Generator().manual_seed(2))
    assert split_rows(drawn.rows).reward.tolist() == drawn.places.tolist()


def test_nothing_beyond_what_is_stored_is_drawn():
    assert replay(3).sample(500, torch.Generator().manual_seed(3)).places.max() <= 2


def test_correction_rises_linearly():
    made = PrioritisedReplay(10, PrioritySettings())
    made.advance(0.5)
    assert made.correction == pytest.approx(0.7)
