"""What is kept of experience: n-step transitions, draws, priorities, files, rollouts."""

import os

import numpy as np
import pytest
import torch

from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.training.perception import PACKED_COLUMNS
from twinscrew.training.replay import (
    BLOCK,
    TRANSITION_COLUMNS,
    Drawn,
    PrioritisedReplay,
    PrioritySettings,
    Replay,
    Rollout,
    Step,
    split_rows,
)


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


def joiner(steps, discount, slots):
    made = Replay(100, steps, discount)
    made.begin(slots)
    return made


def read(replay, one):
    """(first observation, reward, discount, last observation) of what a step completes."""
    before = replay.added
    count = replay.add(one)
    batch = split_rows(replay.rows[torch.arange(before, before + count) % len(replay.rows)])
    first, last = batch.observations.ego[:, 0], batch.next_observations.ego[:, 0]
    return [
        tuple(round(float(x), 5) for x in row)
        for row in zip(first, batch.reward, batch.discount, last, strict=True)
    ]


def filled(capacity, *counts, made=None):
    """A replay whose transitions have rewards 0, 1, ... in their order."""
    made, first = Replay(capacity, 1, 0.9) if made is None else made, 0
    for count in counts:
        made.begin(count)
        made.add(step(0, list(range(first, first + count))))
        first += count
    return made


def rewards(replay):
    return replay.rows[:, PACKED_COLUMNS + 2]


# -- n steps


def test_one_step_transitions_come_out_at_once():
    assert read(joiner(1, 0.9, 2), step(0, [1.0, 2.0])) == [(0, 1, 0.9, 1), (0, 2, 0.9, 1)]


def test_three_steps_are_summed_and_discounted():
    join = joiner(3, 0.5, 1)
    assert read(join, step(0, [1.0])) == read(join, step(1, [2.0])) == []
    assert read(join, step(2, [4.0])) == [(0, 1 + 1 + 1, 0.125, 3)]
    assert read(join, step(3, [8.0])) == [(1, 2 + 2 + 2, 0.125, 4)]


def test_every_open_start_is_closed_when_a_vessel_ends():
    join = joiner(3, 0.5, 1)
    join.add(step(0, [1.0]))
    rows = read(join, step(1, [2.0], terminated=[True]))
    assert sorted(rows) == [(0, 2.0, 0.0, 2), (1, 2.0, 0.0, 2)]


def test_a_truncated_vessel_is_bootstrapped_over_the_steps_it_sailed():
    join = joiner(3, 0.5, 1)
    join.add(step(0, [1.0]))
    rows = read(join, step(1, [2.0], truncated=[True]))
    assert sorted(rows) == [(0, 2.0, 0.25, 2), (1, 2.0, 0.5, 2)]


def test_nothing_is_joined_across_an_end_or_where_fresh_episodes_begin():
    join = joiner(3, 0.5, 1)
    join.add(step(0, [1.0], terminated=[True]))
    assert read(join, step(1, [1.0])) == read(join, step(2, [1.0])) == []
    assert read(join, step(3, [1.0])) == [(1, 1.75, 0.125, 4)]
    join.begin(1)
    assert read(join, step(4, [1.0])) == read(join, step(5, [1.0])) == []


def test_vessels_that_left_the_map_give_nothing():
    assert read(joiner(1, 0.9, 2), step(0, [1.0, 2.0], active=[False, True])) == [(0, 2, 0.9, 1)]


def test_every_step_sailed_becomes_exactly_one_transition():
    generator = np.random.default_rng(5)
    slots, joined = 6, joiner(3, 0.99, 6)
    active = np.ones(slots, bool)
    sailed, given, open_starts = 0, 0, np.zeros(slots, int)
    for k in range(200):
        terminated = active & (generator.random(slots) < 0.1)
        truncated = active & ~terminated & (generator.random(slots) < 0.05)
        given += joined.add(step(k, np.ones(slots), terminated, truncated, active))
        sailed += int(active.sum())
        open_starts = np.where(active, open_starts + 1, 0)
        open_starts[terminated | truncated] = 0
        active = np.where(active, ~(terminated | truncated), generator.random(slots) < 0.3)
    assert given == sailed - int(np.minimum(open_starts, 2).sum())


# -- uniform draws


def test_the_oldest_transitions_make_room():
    assert sorted(rewards(filled(4, 3, 2)).tolist()) == [1, 2, 3, 4]
    assert sorted(rewards(filled(3, 5)).tolist()) == [2, 3, 4]


def test_only_what_was_stored_is_drawn_and_all_of_it_the_same_by_the_same_generator():
    replay = filled(100, 3)
    one, other = (replay.sample(300, torch.Generator().manual_seed(0)).rows for _ in range(2))
    assert set(split_rows(one).reward.tolist()) == {0, 1, 2}
    assert torch.equal(one, other)


def test_a_cleared_replay_starts_again():
    replay = filled(10, 2)
    replay.clear()
    replay.begin(1)
    replay.add(step(0, [9.0]))
    assert len(replay) == 1
    assert split_rows(replay.sample(5, torch.Generator()).rows).reward.tolist() == [9] * 5


def test_a_row_is_read_column_by_column():
    batch = split_rows(torch.arange(TRANSITION_COLUMNS, dtype=torch.float32)[None])
    assert batch.observations.ego[0].tolist() == list(range(7))
    assert batch.observations.objects[0, 0].tolist() == list(range(7, 12))
    assert batch.observations.mask[0].tolist() == list(range(32, 37))
    assert batch.action[0].tolist() == [37, 38]
    assert (batch.reward.tolist(), batch.discount.tolist()) == ([39], [40])
    assert batch.next_observations.mask[0, -1].item() == TRANSITION_COLUMNS - 1


# -- priorities


def prioritised(count, capacity=3 * BLOCK, exponent=1.0, correction=1.0):
    settings = PrioritySettings(exponent=exponent, correction_start=correction)
    return filled(capacity, count, made=PrioritisedReplay(settings, capacity))


def lose(replay, places, losses):
    drawn = Drawn(replay.rows[places], places=torch.as_tensor(places))
    replay.learnt(drawn, torch.as_tensor(losses), 0.0)


def shares(made, count, draws=40_000):
    places = made.sample(draws, torch.Generator().manual_seed(0)).places
    return torch.bincount(places, minlength=count).double() / draws


def test_transitions_are_drawn_in_proportion_to_their_priority_in_every_block():
    count = 2 * BLOCK + 10
    made = prioritised(count)
    losses = torch.full((count,), 1e-4)
    favoured = torch.tensor([0, BLOCK, BLOCK + 7, 2 * BLOCK + 9])
    losses[favoured] = torch.tensor([100.0, 200.0, 300.0, 400.0])
    lose(made, torch.arange(count), losses)
    assert shares(made, count)[favoured].tolist() == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=0.01)


def test_an_exponent_of_zero_draws_uniformly():
    made = prioritised(10, exponent=0.0)
    lose(made, torch.arange(10), torch.arange(10.0))
    assert shares(made, 10).tolist() == pytest.approx([0.1] * 10, abs=0.01)


def test_new_transitions_have_the_greatest_priority():
    made = prioritised(2)
    lose(made, torch.tensor([0, 1]), torch.tensor([9.0, 9.0]))
    made.begin(1)
    made.add(step(0, [1.0]))
    assert shares(made, 3).tolist() == pytest.approx([1 / 3] * 3, abs=0.01)


def test_full_correction_makes_the_weighted_draw_uniform():
    made = prioritised(2)
    lose(made, torch.tensor([0, 1]), torch.tensor([3.0, 1.0]))
    batch = made.sample(1000, torch.Generator().manual_seed(1))
    weight = {int(p): float(w) for p, w in zip(batch.places, batch.weight, strict=True)}
    assert weight == pytest.approx({1: 1.0, 0: 1 / 3}, rel=1e-3)
    assert split_rows(batch.rows).reward.tolist() == batch.places.tolist()


def test_correction_rises_linearly_and_losses_are_needed():
    made = filled(10, 4, made=PrioritisedReplay(PrioritySettings(), 10))
    drawn = made.sample(2, torch.Generator().manual_seed(0))
    made.learnt(drawn, torch.ones(2), 0.5)
    assert made.correction == pytest.approx(0.7)
    with pytest.raises(ConfigError, match="gives no priorities"):
        made.learnt(drawn, None, 0.5)


# -- files


def taken_up(folder, kept, capacity=10):
    replay = Replay(capacity)
    replay.restore(folder, kept)
    return replay


def files_of(folder):
    return sorted(file.name for file in folder.glob("*.npy"))


def more(replay, count):
    """Add so many transitions, numbered on."""
    replay.begin(count)
    replay.add(step(0, list(range(replay.added, replay.added + count))))


@pytest.mark.parametrize("counts", [(4,), (4, 3), (4, 9), (4, 3, 8), (25, 1), (10, 10)])
def test_what_is_kept_comes_back_in_its_places(tmp_path, counts):
    replay = Replay(10)
    for count in counts:
        more(replay, count)
        kept = replay.save(tmp_path, finished=False)
        replay.tidy(tmp_path)
    again = taken_up(tmp_path, kept)
    assert len(again) == len(replay)
    assert torch.equal(again.rows, replay.rows)
    more(again, 3)
    more(replay, 3)
    assert torch.equal(again.rows, replay.rows)


def test_only_what_is_new_is_written_and_what_is_overwritten_is_removed(tmp_path):
    replay = Replay(10)
    for _ in range(4):
        more(replay, 5)
        kept = replay.save(tmp_path, finished=False)
        replay.tidy(tmp_path)
    assert kept["parts"] == [[10, 15], [15, 20]]
    assert files_of(tmp_path) == ["replay_0_10.npy", "replay_0_15.npy"]
    assert replay.save(tmp_path, finished=True) is None
    replay.tidy(tmp_path)
    assert files_of(tmp_path) == []


def test_the_files_of_the_last_checkpoint_stay_until_the_next_has_taken_its_place(tmp_path):
    replay = Replay(10)
    more(replay, 8)
    kept = replay.save(tmp_path, finished=False)
    replay.clear()
    more(replay, 9)
    replay.save(tmp_path, finished=False)  # and then the process is killed
    again = taken_up(tmp_path, kept)
    assert rewards(again)[:8].tolist() == list(range(8))
    again.tidy(tmp_path)
    assert files_of(tmp_path) == ["replay_0_0.npy"]


def test_priorities_come_back(tmp_path):
    def make():
        return PrioritisedReplay(PrioritySettings(), 2000)

    replay, again = make(), make()
    more(replay, 1500)
    lose(replay, torch.arange(1500), torch.rand(1500, generator=torch.Generator().manual_seed(0)))
    again.restore(tmp_path, replay.save(tmp_path, finished=False))
    one, other = (r.sample(64, torch.Generator().manual_seed(1)) for r in (replay, again))
    assert torch.equal(one.places, other.places)
    assert torch.equal(one.weight, other.weight)


def test_a_full_disk_leaves_the_last_files(tmp_path, monkeypatch):
    replay = Replay(10)
    more(replay, 4)
    kept = replay.save(tmp_path, finished=False)
    more(replay, 4)

    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TwinscrewError, match="No space left"):
        replay.save(tmp_path, finished=False)
    assert files_of(tmp_path) == ["replay_0_0.npy"]
    assert rewards(taken_up(tmp_path, kept))[:4].tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("damage", ["gone", "cut", "other"])
def test_a_damaged_file_is_named(tmp_path, damage):
    replay = Replay(10)
    more(replay, 4)
    kept = replay.save(tmp_path, finished=False)
    file = tmp_path / "replay_0_0.npy"
    if damage == "gone":
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:200] if damage == "cut" else b"nothing")
    with pytest.raises(ConfigError, match=r"replay_0_0\.npy: replay cannot be read"):
        taken_up(tmp_path, kept)


# -- rollouts


class Student:
    """Studies a rollout by numbering its transitions."""

    def study(self, rollout):
        count = len(rollout.batch(torch.device("cpu")).reward)
        return torch.arange(count, dtype=torch.float32)[:, None]


def rollout_of(*steps, discount=0.5):
    made = Rollout(len(steps), discount)
    made.begin(len(steps[0].reward))
    for one in steps:
        made.add(one)
    made.study(Student())
    return made


def test_a_rollout_is_ready_at_its_horizon_and_then_forgotten():
    made = Rollout(2, 0.9)
    made.begin(3)
    assert made.add(step(0, [1.0] * 3, active=[True, False, True])) == 2
    assert made.ready(10**9) == 0
    made.add(step(1, [1.0] * 3))
    assert made.ready(10**9) == 2
    made.done()
    assert made.ready(0) == 0


def test_advantages_run_back_along_each_vessels_way_and_stop_at_its_end():
    made = rollout_of(
        step(0, [0.0, 0.0, 0.0], active=[True, True, False]),
        step(1, [0.0] * 3, terminated=[False, True, False], active=[True, True, False]),
        step(2, [0.0] * 3, truncated=[False, False, True], active=[True, True, True]),
    )
    delta = torch.tensor([1.0, 10.0, 2.0, 20.0, 4.0, 40.0, 400.0])  # step by step, active slots
    found = made.accumulate(delta, trace=0.5)  # gamma lambda = 1/4
    expected = [1 + (2 + 4 / 4) / 4, 10 + 20 / 4, 2 + 4 / 4, 20.0, 4.0, 40.0, 400.0]
    assert found.tolist() == pytest.approx(expected)


def test_a_terminal_decision_is_not_bootstrapped_and_a_truncated_one_is():
    made = rollout_of(
        step(0, [1.0, 1.0], terminated=[True, False], truncated=[False, True]), discount=0.9
    )
    assert made.batch(torch.device("cpu")).discount.tolist() == pytest.approx([0.0, 0.9])


def test_every_transition_of_a_rollout_is_drawn_once_before_any_comes_again():
    made = rollout_of(*(step(k, [float(k)] * 5) for k in range(4)))
    generator = torch.Generator().manual_seed(0)
    drawn = torch.cat([made.sample(8, generator).extra[:, 0] for _ in range(5)])
    assert sorted(drawn[:20].tolist()) == sorted(drawn[20:].tolist()) == list(range(20))
