import numpy as np
import pytest

from twinscrew.training.buffer import TRANSITION_COLUMNS, split_rows
from twinscrew.training.nstep import NStep, Step
from twinscrew.training.observations import PACKED_COLUMNS


def push(join, one):
    """Push a step and give the transitions alone."""
    return join.push(one)[0]


def step(k, reward, terminated=(False,), truncated=(False,), active=None):
    """A step whose observation is k and whose next observation is k + 1 everywhere."""
    slots = len(reward)
    return Step(
        observation=np.full((slots, PACKED_COLUMNS), k, np.float32),
        action=np.full((slots, 2), k / 10, np.float32),
        reward=np.array(reward, np.float32),
        terminated=np.array(terminated) & np.ones(slots, bool),
        truncated=np.array(truncated) & np.ones(slots, bool),
        active=np.ones(slots, bool) if active is None else np.array(active),
        next_observation=np.full((slots, PACKED_COLUMNS), k + 1, np.float32),
    )


def read(rows):
    """(first observation, reward, discount, last observation) of each transition."""
    import torch

    batch = split_rows(torch.from_numpy(rows))
    first, last = batch.observations.ego[:, 0], batch.next_observations.ego[:, 0]
    return [
        tuple(round(float(x), 5) for x in row)
        for row in zip(first, batch.reward, batch.discount, last, strict=True)
    ]


def test_one_step_transitions_come_out_at_once():
    join = NStep(1, 0.9, 2)
    rows = push(join, step(0, [1.0, 2.0]))
    assert rows.shape == (2, TRANSITION_COLUMNS)
    assert read(rows) == [(0, 1, 0.9, 1), (0, 2, 0.9, 1)]


def test_three_steps_are_summed_and_discounted():
    join = NStep(3, 0.5, 1)
    assert len(push(join, step(0, [1.0]))) == 0
    assert len(push(join, step(1, [2.0]))) == 0
    assert read(push(join, step(2, [4.0]))) == [(0, 1 + 1 + 1, 0.125, 3)]
    assert read(push(join, step(3, [8.0]))) == [(1, 2 + 2 + 2, 0.125, 4)]


def test_every_open_start_is_closed_when_a_vessel_ends():
    join = NStep(3, 0.5, 1)
    push(join, step(0, [1.0]))
    rows = read(push(join, step(1, [2.0], terminated=[True])))
    assert sorted(rows) == [(0, 2.0, 0.0, 2), (1, 2.0, 0.0, 2)]


def test_a_truncated_vessel_is_bootstrapped_over_the_steps_it_sailed():
    join = NStep(3, 0.5, 1)
    push(join, step(0, [1.0]))
    rows = read(push(join, step(1, [2.0], truncated=[True])))
    assert sorted(rows) == [(0, 2.0, 0.25, 2), (1, 2.0, 0.5, 2)]


def test_nothing_is_joined_across_an_end():
    join = NStep(3, 0.5, 1)
    push(join, step(0, [1.0], terminated=[True]))
    assert len(push(join, step(1, [1.0]))) == 0
    assert len(push(join, step(2, [1.0]))) == 0
    assert read(push(join, step(3, [1.0]))) == [(1, 1.75, 0.125, 4)]


def test_vessels_that_left_the_map_give_nothing():
    join = NStep(1, 0.9, 2)
    assert read(push(join, step(0, [1.0, 2.0], active=[False, True]))) == [(0, 2, 0.9, 1)]


def test_every_step_sailed_becomes_exactly_one_transition():
    generator = np.random.default_rng(5)
    slots, joined = 6, NStep(3, 0.99, 6)
    active = np.ones(slots, bool)
    sailed, given, open_starts = 0, 0, np.zeros(slots, int)
    for k in range(200):
        terminated = active & (generator.random(slots) < 0.1)
        truncated = active & ~terminated & (generator.random(slots) < 0.05)
        rows = push(joined, step(k, np.ones(slots), terminated, truncated, active))
        sailed += int(active.sum())
        given += len(rows)
        open_starts = np.where(active, open_starts + 1, 0)
        open_starts[terminated | truncated] = 0
        active = np.where(active, ~(terminated | truncated), generator.random(slots) < 0.3)
    still_open = int(np.minimum(open_starts, 2).sum())
    assert given == sailed - still_open


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_the_reward_of_a_constant_reward_is_the_geometric_sum(steps):
    join = NStep(steps, 0.9, 1)
    rows = np.concatenate([push(join, step(k, [1.0])) for k in range(steps)])
    assert read(rows)[0][1] == pytest.approx((1 - 0.9**steps) / 0.1, abs=1e-4)


def test_every_transition_is_told_with_its_slot():
    join = NStep(2, 0.5, 3)
    join.push(step(0, [1.0, 2.0, 3.0]))
    rows, slots = join.push(step(1, [1.0, 2.0, 3.0], terminated=[False, True, False]))
    assert sorted(slots.tolist()) == [0, 1, 1, 2]
    assert len(rows) == 4
