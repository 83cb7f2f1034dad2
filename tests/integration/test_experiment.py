"""`twinscrew experiment` and `twinscrew report`, as users run them: in processes of their own."""

import json
import signal
from pathlib import Path

import psutil
import pytest
from tests.harness.commands import as_json, start, twinscrew
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.slow

SETS = """
[[set]]
name = "head on"
scenario = "head_on"

[[set]]
name = "two"
scenario = "random"
vessels = 2
"""
EPISODES = 2
TOTAL = 2 * 2 * EPISODES


@pytest.fixture(scope="module")
def words(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, ...]:
    """The experiment of all these tests, but for where to put it."""
    sets = tmp_path_factory.mktemp("sets") / "sets.toml"
    sets.write_text(SETS)
    chosen = ("--methods", "ac_iqn,apf", "--episodes", EPISODES, "--seed", 3)
    return ("experiment", "--sets", sets, *chosen)


@pytest.fixture(scope="module")
def whole(words, tmp_path_factory: pytest.TempPathFactory):
    """An uninterrupted run: its folder, and what it printed."""
    out = tmp_path_factory.mktemp("whole") / "out"
    done = twinscrew(*words, "--jobs", 1, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    return out, as_json(done)


def lines(out: Path) -> list[dict]:
    return [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]


def test_every_episode_has_a_line_and_the_figures_add_up(whole) -> None:
    out, answer = whole
    assert answer["episodes"] == answer["sailed_now"] == len(lines(out)) == TOTAL
    assert len({(r["method"], r["set"], r["episode"]) for r in lines(out)}) == TOTAL
    for cell in answer["cells"]:
        chosen = [r for r in lines(out) if (r["method"], r["set"]) == (cell["method"], cell["set"])]
        assert cell["episodes"] == len(chosen) == EPISODES
        assert cell["successes"] == sum(r["success"] for r in chosen)
        assert sum(cell["failures"].values()) == EPISODES - cell["successes"]


def test_methods_sail_the_same_episodes(whole) -> None:
    seeds = {(r["set"], r["episode"]): set() for r in lines(whole[0])}
    for record in lines(whole[0]):
        seeds[record["set"], record["episode"]].add(record["seed"])
    assert all(len(several) == 1 for several in seeds.values())


def test_an_experiment_killed_half_way_and_resumed_equals_an_uninterrupted_one(
    words, whole, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run = start(*words, "--jobs", 2, "--out", out, log=tmp_path / "log")
    children: list[psutil.Process] = []
    try:
        wait_until(lambda: _count(out) >= 2)
        children = psutil.Process(run.pid).children(recursive=True)
    finally:
        run.kill()  # SIGKILL: nothing can be tidied up
        run.wait()
    for child in children:
        if child.is_running():
            child.kill()
    with (out / "results.jsonl").open("ab") as file:
        file.write(b'{"method":"apf","set":"tw')  # as if it had been killed while writing
    kept = _count(out)
    assert kept < TOTAL
    answer = as_json(twinscrew("experiment", "--resume", out, "--jobs", 1, "--json"))
    assert (answer["kept"], answer["sailed_now"]) == (kept, TOTAL - kept)
    assert answer["results_sha256"] == whole[1]["results_sha256"]
    assert answer["cells"] == whole[1]["cells"]


def test_no_episode_is_lost_or_counted_twice_when_a_worker_is_killed(
    words, whole, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run = start(*words, "--jobs", 2, "--out", out, "--json", log=tmp_path / "log")
    wait_until(lambda: _count(out) >= 1)
    workers = [
        child
        for child in psutil.Process(run.pid).children(recursive=True)
        if "loky" in " ".join(child.cmdline()) and "tracker" not in " ".join(child.cmdline())
    ]
    workers[0].send_signal(signal.SIGKILL)
    assert run.wait() == 0, (tmp_path / "log").read_text()
    again = as_json(twinscrew(*words, "--resume", out, "--json"))
    assert again["sailed_now"] == 0
    assert again["results_sha256"] == whole[1]["results_sha256"]


def test_any_episode_is_sailed_again_alone_by_its_line_with_recordings(
    whole, tmp_path: Path
) -> None:
    line = TOTAL - 1
    words = ("--rerun", f"{whole[0]}:{line}", "--out", tmp_path / "again", "--json")
    answer = as_json(twinscrew("experiment", *words))
    assert answer["same"] is True
    assert answer["decisions_sha256"] == lines(whole[0])[line - 1]["decisions_sha256"]
    replayed = as_json(twinscrew("replay", tmp_path / "again", "--json"))
    assert replayed["decisions_sha256"] == answer["decisions_sha256"]
    assert (tmp_path / "again" / "trajectories.png").read_bytes().startswith(b"\x89PNG")


def test_a_folder_of_another_experiment_is_refused_and_left_alone(words, whole) -> None:
    out = whole[0]
    before = (out / "results.jsonl").read_bytes()
    refused = twinscrew(*words, "--seed", 4, "--resume", out)
    assert refused.returncode == 2
    assert "results of another experiment: seed 3, not 4" in refused.stderr
    over = twinscrew(*words, "--out", out)
    assert over.returncode == 2
    assert f"--resume {out}" in over.stderr
    assert (out / "results.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (("--methods", "apf,no_such"), "method 'no_such' has no policy"),
        (("--sets", "no_such"), "'no_such' is not one of"),
        (("--ablate", "no_sea"), "'no_sea' is not one of"),
        (("--engine", "dask"), "'dask' is not one of 'local', 'ray'"),
        (("--rerun", "nowhere"), "must be DIR:LINE"),
    ],
)
def test_what_cannot_be_sailed_is_refused_in_one_line_before_a_folder_is_made(
    words, tmp_path: Path, changes, said: str
) -> None:
    refused = twinscrew(*words, *changes, "--out", tmp_path / "out")
    assert refused.returncode == 2
    assert said in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_report_holds_the_figures_of_the_results(whole) -> None:
    out, answer = whole
    done = as_json(twinscrew("report", out, "--failures", 1, "--json"))
    text = Path(done["report"]).read_text()
    for cell in answer["cells"]:
        assert f"({cell['successes']}/{cell['episodes']})" in text
    for picture in done["figures"]:
        assert Path(picture).read_bytes().startswith(b"\x89PNG")
    assert {"success.png", "closest_approach.png", "open_water.png", "passage.png"} <= {
        Path(picture).name for picture in done["figures"]
    }
    for picture in text.split("](figures/")[1:]:
        assert (out / "figures" / picture.partition(")")[0]).is_file()


def test_the_same_episodes_are_scored_in_the_training_environment_and_set_beside(
    whole, tmp_path: Path
) -> None:
    out, _ = whole
    done = twinscrew("evaluate", "apf", "--on", out, "--json")
    assert done.returncode == 0, done.stderr
    rows = as_json(done)["settings"]
    assert [(row["name"], row["episodes"]) for row in rows] == [("head on", 2), ("two", 2)]
    (tmp_path / "apf.json").write_text(done.stdout)
    words = ("--evaluations", f"apf={tmp_path / 'apf.json'}", "--no-trajectories", "--json")
    text = Path(as_json(twinscrew("report", out, *words))["report"]).read_text()
    assert "From training to the simulator" in text


def _count(out: Path) -> int:
    file = out / "results.jsonl"
    return file.read_bytes().count(b"\n") if file.exists() else 0
