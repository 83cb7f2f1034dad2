import json

import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.training import runs
from twinscrew.training.commands import train_report
from twinscrew.training.report import find_runs, learning_curve, logged


def run(folder, rates, algorithm="ac_iqn", every=100):
    folder.mkdir(parents=True)
    told = {"settings": {"agent": {"algorithm": algorithm}}}
    (folder / runs.CONFIG).write_text(json.dumps(told))
    runs.append_record(folder / runs.LOG, {"event": "start"})
    for k, rate in enumerate(rates):
        record = {"event": "evaluation", "transitions": (k + 1) * every, "success": rate}
        runs.append_record(
            folder / runs.LOG, record | {"travel_time_s": 20.0, "cumulative_reward": 3.0}
        )
    return folder


def test_the_curve_is_the_mean_with_its_standard_error(tmp_path):
    folders = [run(tmp_path / "0", [0.0, 0.4]), run(tmp_path / "1", [0.2, 0.8])]
    curve = learning_curve(folders, "success")
    assert curve.transitions.tolist() == [100, 200]
    assert curve.mean.tolist() == pytest.approx([0.1, 0.6])
    assert curve.error.tolist() == pytest.approx([0.1, 0.2])
    assert curve.seeds == 2


def test_it_ends_where_the_shortest_run_ends_and_interpolates_between(tmp_path):
    folders = [run(tmp_path / "0", [0.0, 1.0]), run(tmp_path / "1", [0.5, 0.5, 0.5], every=60)]
    curve = learning_curve(folders, "success")
    assert curve.transitions.tolist() == [100]
    assert curve.mean.tolist() == pytest.approx([0.25])


def test_one_seed_has_no_error(tmp_path):
    assert learning_curve([run(tmp_path / "0", [0.3])], "success").error.tolist() == [0.0]


def test_runs_are_found_below_a_folder_by_algorithm(tmp_path):
    run(tmp_path / "a" / "seed_0", [0.1])
    run(tmp_path / "a" / "seed_1", [0.1])
    run(tmp_path / "b" / "seed_0", [0.1], algorithm="sac")
    assert {name: len(found) for name, found in find_runs([tmp_path]).items()} == {
        "ac_iqn": 2,
        "sac": 1,
    }


def test_a_folder_without_runs_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="no training run here"):
        find_runs([tmp_path])


def test_a_log_of_an_older_version_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"regret.*older version"):
        learning_curve([run(tmp_path / "0", [0.5])], "regret")


@pytest.mark.slow
def test_of_an_older_log_what_it_has_is_drawn(tmp_path):
    old = tmp_path / "a" / "seed_0"
    run(old, [])
    told = {"event": "evaluation", "transitions": 100, "success": 0.5, "travel_time_s": 20.0}
    runs.append_record(old / runs.LOG, told)
    assert set(logged([old])) == {"success", "travel_time_s"}
    assert set(logged([old, run(tmp_path / "b", [0.1])])) == {"success", "travel_time_s"}
    train_report([tmp_path / "a"], tmp_path / "out")
    assert (tmp_path / "out" / "learning_curves.png").is_file()


def test_a_run_without_evaluations_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="not been evaluated"):
        learning_curve([run(tmp_path / "0", [])], "success")


def test_the_figure_is_drawn(tmp_path, capsys):
    run(tmp_path / "a" / "seed_0", [0.1, 0.2])
    train_report([tmp_path / "a"], tmp_path / "out")
    assert (tmp_path / "out" / "learning_curves.png").read_bytes()[:4] == b"\x89PNG"
    assert "learning_curves.png" in capsys.readouterr().out


def test_a_log_whose_numbers_are_none_is_refused_by_name(tmp_path):
    folder = run(tmp_path / "0", ["much"])
    with pytest.raises(ConfigError, match=r"log\.jsonl: damaged, or of another version"):
        learning_curve([folder], "success")


def test_a_run_that_does_not_say_its_algorithm_is_refused_by_name(tmp_path):
    folder = run(tmp_path / "0", [0.1])
    (folder / runs.CONFIG).write_text(json.dumps({"settings": {"agent": None}}))
    with pytest.raises(ConfigError, match=r"config\.json: damaged, or of another version"):
        find_runs([tmp_path])
