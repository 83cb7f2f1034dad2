from pathlib import Path

import pytest

from twinscrew.hil_sim.experiments.plan import Experiment, Method, SetSettings
from twinscrew.hil_sim.experiments.results import EXPERIMENT_FILE, begin, go_on, read_folder
from twinscrew.runtime.errors import ConfigError

EXPERIMENT = Experiment(
    methods=(Method(name="apf", policy="apf", sha256="1"),),
    sets=(SetSettings(name="one", vessels=2),),
    variants=((), ("no_wind", "no_waves")),
)


def test_a_folder_carries_its_experiment(tmp_path: Path) -> None:
    made = begin(tmp_path / "x", EXPERIMENT)
    assert read_folder(tmp_path / "x") == made
    assert made.experiment == EXPERIMENT
    assert made.origins[0].software["numpy"]
    assert made.origins[0].commit


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 1},
        {"episodes": 99},
        {"sensor": "vrx16"},
        {"sets": (SetSettings(name="one", vessels=3),)},
    ],
)
def test_another_experiment_is_refused_with_what_differs(tmp_path: Path, change) -> None:
    begin(tmp_path / "x", EXPERIMENT)
    same = {key: getattr(EXPERIMENT, key) for key in change}
    go_on(tmp_path / "x", same)
    with pytest.raises(ConfigError, match=f"results of another experiment: {next(iter(change))}"):
        go_on(tmp_path / "x", change)


def test_a_method_with_another_policy_is_refused(tmp_path: Path) -> None:
    begin(tmp_path / "x", EXPERIMENT)
    other = Method(name="apf", policy="apf", sha256="2")
    with pytest.raises(ConfigError, match="apf is another policy"):
        go_on(tmp_path / "x", {"methods": (other,)})


def test_an_experiment_may_grow_by_episodes_methods_and_variants(tmp_path: Path) -> None:
    begin(tmp_path / "x", EXPERIMENT)
    mpc = Method(name="mpc", policy="mpc", sha256="3")
    more = {"methods": (mpc,), "episodes": 200, "variants": ((), ("vanish",))}
    grown = go_on(tmp_path / "x", more).experiment
    assert grown == Experiment(
        methods=(*EXPERIMENT.methods, mpc),
        sets=EXPERIMENT.sets,
        episodes=200,
        variants=(*EXPERIMENT.variants, ("vanish",)),
    )
    assert read_folder(tmp_path / "x").experiment == grown
    assert go_on(tmp_path / "x", {}).experiment == grown


def test_a_folder_that_holds_something_is_not_begun_in(tmp_path: Path) -> None:
    (tmp_path / "something").touch()
    with pytest.raises(ConfigError, match="not empty"):
        begin(tmp_path, EXPERIMENT)


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="file"):
        begin(tmp_path / "file", EXPERIMENT)


def test_what_is_no_results_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="not a folder of results"):
        read_folder(tmp_path)
    with pytest.raises(ConfigError, match="no such folder"):
        read_folder(tmp_path / "x")


@pytest.mark.parametrize(
    "content", [b"{", b'{"x": "\xff"}', pytest.param(b"[" * 100_000, id="deep")]
)
def test_a_damaged_experiment_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    (tmp_path / EXPERIMENT_FILE).write_bytes(content)
    with pytest.raises(ConfigError, match=f"{EXPERIMENT_FILE}: damaged"):
        read_folder(tmp_path)


def test_a_different_checkout_that_goes_on_is_noted(tmp_path: Path) -> None:
    begin(tmp_path / "x", EXPERIMENT)
    file = tmp_path / "x" / EXPERIMENT_FILE
    commit = read_folder(tmp_path / "x").origins[0].commit
    file.write_text(file.read_text().replace(commit, "0123456789ab"))
    commits = [origin.commit for origin in go_on(tmp_path / "x", {}).origins]
    assert commits == ["0123456789ab", commit]
    assert len(go_on(tmp_path / "x", {}).origins) == 2
