"""How episodes begin, as a file."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from twinscrew.hil_sim.experiments.plan import Experiment, Method, SetSettings, tasks
from twinscrew.hil_sim.experiments.results import BEGINNINGS_FILE, beginnings, write_beginnings
from twinscrew.runtime.errors import RecordingError

SETS = (SetSettings(name="two", vessels=2, buoys=0), SetSettings(name="four", vessels=4, buoys=2))


def experiment(episodes: int = 2) -> Experiment:
    methods = (Method(name="apf", policy="apf", sha256="0"),)
    return Experiment(methods=methods, sets=SETS, episodes=episodes, seed=4)


def test_they_are_those_of_the_episodes_that_are_sailed() -> None:
    told = {one.name: one.episodes for one in beginnings(experiment())}
    for task in tasks(experiment()):
        scenario, beginning = task.set.draw(task.seed), told[task.set.name][task.episode]
        assert np.array_equal(scenario.starts, beginning.starts)
        assert np.array_equal(scenario.goals, beginning.goals)
        assert np.array_equal(scenario.buoys, np.reshape(beginning.buoys, (-1, 3)))


def test_the_file_grows_with_the_experiment_and_never_shrinks(tmp_path: Path) -> None:
    def sizes() -> list[int]:
        sets = msgspec.json.decode((tmp_path / BEGINNINGS_FILE).read_bytes())["sets"]
        return [len(one["episodes"]) for one in sets]

    for episodes, expected in ((2, 2), (3, 3), (1, 3)):
        write_beginnings(tmp_path, experiment(episodes))
        assert sizes() == [expected, expected]


def test_a_damaged_file_is_written_anew(tmp_path: Path) -> None:
    (tmp_path / BEGINNINGS_FILE).write_bytes(b'{"sets": [')
    write_beginnings(tmp_path, experiment())
    assert len(msgspec.json.decode((tmp_path / BEGINNINGS_FILE).read_bytes())["sets"]) == 2


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nowhere"):
        write_beginnings(tmp_path / "nowhere", experiment())
