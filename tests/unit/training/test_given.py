"""An experiment's episodes in the training environment."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.training.batch_policy import open_policy
from twinscrew.training.environment import EnvironmentSettings
from twinscrew.training.given import FILE, GivenEnv, evaluate_given, read_given

EPISODES = {
    "sets": [
        {
            "name": "one buoy",
            "episodes": [
                {
                    "starts": [[5.0, 6.0, 0.5], [40.0, 41.0, -2.0]],
                    "goals": [[15.0, 16.0], [30.0, 29.0]],
                    "buoys": [[22.0, 45.0, 0.75]],
                },
                {
                    "starts": [[6.0, 6.0, 0.0], [45.0, 45.0, 3.0]],
                    "goals": [[16.0, 6.0], [35.0, 45.0]],
                    "buoys": [[30.0, 10.0, 0.75]],
                },
            ],
        },
        {
            "name": "none",
            "episodes": [{"starts": [[5.0, 5.0, 0.0]], "goals": [[12.0, 5.0]], "buoys": []}],
        },
    ]
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / FILE).write_text(json.dumps(EPISODES))
    return tmp_path


def test_vessels_begin_where_they_are_told_and_see_their_goals_there(folder: Path) -> None:
    given = read_given(folder)["one buoy"]
    seen = GivenEnv(given, EnvironmentSettings(), seed=1).reset()
    c, s = np.cos(0.5), np.sin(0.5)
    assert seen.ego[0, 0, :2] == pytest.approx([10 * c + 10 * s, 10 * c - 10 * s], abs=0.3)
    assert (seen.ego[..., 2:] == 0.0).all()


def test_buoys_stand_where_they_are_told(folder: Path) -> None:
    given = read_given(folder)["one buoy"]
    near = given._replace(buoy=given.start[:, :1] + 10.0)
    seen = GivenEnv(near, EnvironmentSettings(), seed=1).reset()
    assert seen.mask[:, 0].sum(axis=1).tolist() == [1.0, 1.0]
    assert np.hypot(*seen.objects[:, 0, 0, :2].T) == pytest.approx([10.0, 10.0], abs=0.5)


def test_a_policy_is_scored_on_every_episode_of_every_set(folder: Path) -> None:
    sets = read_given(folder)
    assert list(sets) == ["one buoy", "none"]
    for given in sets.values():
        result = evaluate_given(open_policy("apf"), given)
        assert result.episodes == len(given.start)
        assert result.success_rate == 1.0
        assert result.travel_time_s is not None
        assert result.travel_time_s < 30.0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        '{"sets": [{"name": "x", "episodes": [{}]}]}',
        pytest.param("[" * 100_000, id="deep"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(ConfigError, match="no episodes of an experiment"):
        read_given(tmp_path)


def test_a_folder_without_the_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        read_given(tmp_path)
