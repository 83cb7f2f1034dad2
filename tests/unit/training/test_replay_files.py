import pytest
import torch

from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.training import runs
from twinscrew.training.buffer import TRANSITION_COLUMNS, ReplayBuffer
from twinscrew.training.priority import PrioritisedReplay, PrioritySettings
from twinscrew.training.replay_files import ReplayFiles


def rows(count, first=0):
    return (first + torch.arange(count, dtype=torch.float32))[:, None].expand(
        -1, TRANSITION_COLUMNS
    )


def taken_up(folder, kept, capacity=10):
    replay = ReplayBuffer(capacity)
    files = ReplayFiles(folder, replay)
    files.restore(kept)
    return replay, files


def files_of(folder):
    return sorted(file.name for file in folder.glob("*.npy"))


@pytest.mark.parametrize("counts", [(4,), (4, 3), (4, 9), (4, 3, 8), (25, 1), (10, 10)])
def test_what_is_kept_comes_back_in_its_places(tmp_path, counts):
    replay = ReplayBuffer(10)
    files, first = ReplayFiles(tmp_path, replay), 0
    for count in counts:
        replay.add(rows(count, first))
        first += count
        kept = files.save()
        files.tidy()
    again, _ = taken_up(tmp_path, kept)
    assert len(again) == len(replay)
    assert torch.equal(again.rows, replay.rows)
    assert again.add(rows(3)).tolist() == replay.add(rows(3)).tolist()


def test_only_what_is_new_is_written_and_what_is_overwritten_is_removed(tmp_path):
    replay = ReplayBuffer(10)
    files = ReplayFiles(tmp_path, replay)
    for _ in range(4):
        replay.add(rows(5))
        kept = files.save()
        files.tidy()
    assert kept["parts"] == [[10, 15], [15, 20]]
    assert files_of(tmp_path) == ["replay_0_10.npy", "replay_0_15.npy"]


def test_the_files_of_the_last_checkpoint_stay_until_the_next_has_taken_its_place(tmp_path):
    replay = ReplayBuffer(10)
    files = ReplayFiles(tmp_path, replay)
    replay.add(rows(8))
    kept = files.save()
    replay.clear()
    replay.add(rows(9, first=100))
    files.save()  # and then the process is killed
    again, resumed = taken_up(tmp_path, kept)
    assert again.rows[:8, 0].tolist() == list(range(8))
    resumed.tidy()
    assert files_of(tmp_path) == ["replay_0_0.npy"]


def test_an_emptied_replay_begins_anew(tmp_path):
    replay = ReplayBuffer(10)
    files = ReplayFiles(tmp_path, replay)
    replay.add(rows(8))
    files.save()
    replay.clear()
    replay.add(rows(2, first=50))
    again, _ = taken_up(tmp_path, files.save())
    assert len(again) == 2
    assert again.rows[:2, 0].tolist() == [50.0, 51.0]


def test_what_was_dropped_is_removed(tmp_path):
    replay = ReplayBuffer(10)
    files = ReplayFiles(tmp_path, replay)
    replay.add(rows(8))
    files.save()
    files.drop()
    files.tidy()
    assert files_of(tmp_path) == []


def test_priorities_come_back(tmp_path):
    def make():
        return PrioritisedReplay(2000, PrioritySettings())

    replay = make()
    places = replay.add(rows(1500))
    replay.reprioritise(places, torch.rand(1500, generator=torch.Generator().manual_seed(0)))
    replay.advance(0.5)
    again = make()
    ReplayFiles(tmp_path, again).restore(ReplayFiles(tmp_path, replay).save())
    one, other = (r.sample(64, torch.Generator().manual_seed(1)) for r in (replay, again))
    assert torch.equal(one.places, other.places)
    assert torch.equal(one.weight, other.weight)


def test_a_full_disk_leaves_the_last_files(tmp_path, monkeypatch):
    replay = ReplayBuffer(10)
    files = ReplayFiles(tmp_path, replay)
    replay.add(rows(4))
    kept = files.save()
    replay.add(rows(4, first=4))

    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(runs.os, "fsync", full)
    with pytest.raises(TwinscrewError, match="No space left"):
        files.save()
    assert files_of(tmp_path) == ["replay_0_0.npy"]
    assert taken_up(tmp_path, kept)[0].rows[:4, 0].tolist() == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize("damage", ["gone", "cut", "other"])
def test_a_damaged_file_is_named(tmp_path, damage):
    replay = ReplayBuffer(10)
    files = ReplayFiles(tmp_path, replay)
    replay.add(rows(4))
    kept = files.save()
    file = tmp_path / "replay_0_0.npy"
    if damage == "gone":
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:200] if damage == "cut" else b"nothing")
    with pytest.raises(ConfigError, match=r"replay cannot be read.*|.*replay_0_0\.npy"):
        taken_up(tmp_path, kept)
