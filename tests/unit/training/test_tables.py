import json

import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.training import runs
from twinscrew.training.commands import train_report
from twinscrew.training.report import chosen, find_runs, seeds_table


def run(folder, *evaluations):
    folder.mkdir(parents=True)
    told = {"settings": {"agent": {"algorithm": "ac_iqn"}}}
    (folder / runs.CONFIG).write_text(json.dumps(told))
    common = {"event": "evaluation", "transitions": 500_000, "seconds": 90.0}
    for evaluation in evaluations:
        record = {"travel_time_s": 20.0, "cumulative_reward": 31.0, **evaluation}
        runs.append_record(folder / runs.LOG, common | record)
    return folder


def cells(line):
    return [cell.strip() for cell in line.strip("|\n").split("|")]


def test_a_row_is_the_mean_with_the_worst_and_the_best_seed(tmp_path):
    for seed, success in enumerate((0.5, 0.9, 0.7)):
        run(tmp_path / "a_paper" / f"seed_{seed}", {"success": success})
    run(tmp_path / "b_more" / "seed_0", {"success": 0.25, "rough_success": 0.125})
    table = seeds_table(find_runs([tmp_path], "folder")).splitlines()
    assert cells(table[0])[:3] == ["configuration", "seeds", "success"]
    assert cells(table[2]) == [
        *("a_paper", "3", "0.700 (0.500 .. 0.900)", "-", "20.0", "31.0", "0.50", "1.5")
    ]
    assert cells(table[3])[:4] == ["b_more", "1", "0.250", "0.125"]


@pytest.mark.parametrize(("which", "time"), [("last", 30.0), ("best", 18.0)])
def test_the_best_evaluation_is_the_one_that_selection_took(tmp_path, which, time):
    folder = run(
        tmp_path / "seed_0",
        {"success": 0.99, "rough_success": 0.5, "travel_time_s": 10.0},
        {"success": 0.9, "rough_success": 0.9, "travel_time_s": 18.0},
        {"success": 0.9, "rough_success": 0.9, "travel_time_s": 30.0},
    )
    assert chosen(folder, which)["travel_time_s"] == time


def test_the_command_prints_the_table(tmp_path, capsys):
    run(tmp_path / "mine" / "seed_0", {"success": 1.0})
    train_report([tmp_path], table=True)
    assert "| mine | 1 | 1.000 | - | 20.0 |" in capsys.readouterr().out


@pytest.mark.parametrize("which", ["last", "best"])
@pytest.mark.parametrize("record", [{}, {"success": "high"}, {"success": None, "seconds": []}])
def test_an_evaluation_that_tells_something_else_is_refused_by_its_file(tmp_path, which, record):
    folder = run(tmp_path / "a" / "seed_0", record)
    with pytest.raises(ConfigError, match=r"log\.jsonl: damaged, or of another version"):
        chosen(folder, which)
