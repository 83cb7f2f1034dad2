"""Files of faults: what is refused, in which words, and what ships."""

from pathlib import Path

import pytest

from twinscrew.hil_sim.faults.assemble import plans_by_vessel
from twinscrew.hil_sim.faults.kinds import KINDS
from twinscrew.hil_sim.faults.plan import load_plan
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import CONFIG_DIR

SHIPPED = sorted(path.stem for path in (CONFIG_DIR / "faults").glob("*.toml"))
DROP = '[[fault]]\nat_s = 1.0\nfor_s = 2.0\nkind = "drop"\ntarget = "points"\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["fault", "required"]),
        ("fault = []", ["fault", "length"]),
        (DROP + 'when = "now"', ["fault[0].when", "unknown key"]),
        (DROP.replace("drop", "drip"), ["fault[0].kind", "'drip'", "'drop'", "'cpu_hog'"]),
        (
            DROP.replace("points", "autopilot"),
            ["fault[0].target", "'autopilot'", "'points'", "'mavlink'"],
        ),
        (DROP.replace("1.0", "-1.0"), ["fault[0].at_s", ">= 0"]),
        (DROP.replace("for_s = 2.0\n", ""), ["fault[0].for_s", "> 0"]),
        (DROP + "parameters = { part = 0.5 }", ["fault[0].parameters.part", "allowed: share"]),
        (DROP + "parameters = { share = 1.5 }", ["fault[0].parameters.share", "<= 1", "1.5"]),
        (DROP + 'vessel = "wamv9"', ["fault[0].vessel", "'wamv9'", "'wamv1'", "'all'"]),
        (DROP + "[promise]\n", ["promise", "fault"]),
        (
            DROP + '[promise]\nfault = "x"\nreaction = "y"\nneutral_s = 0\n',
            ["promise.neutral_s", "> 0"],
        ),
    ],
)
def test_what_cannot_be_used_is_refused_with_key_value_and_what_is_allowed(
    tmp_path: Path, text: str, words: list[str]
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as refusal:
        load_plan(path, ("wamv1", "wamv2"))
    for word in [str(path), *words]:
        assert word in str(refusal.value)


def test_a_name_that_is_not_shipped_is_refused_with_those_that_are() -> None:
    with pytest.raises(ConfigError, match="lidar_drop"):
        load_plan("lidar_dorp")


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_file_promises_something_that_can_be_measured(name: str) -> None:
    plan = load_plan(name)
    promise = plan.promise
    assert plan.name == name
    assert promise is not None
    assert promise.neutral_s or promise.moves_again_s or promise.sails_on or promise.event


def test_every_kind_of_fault_ships_in_some_file() -> None:
    used = {fault.kind for name in SHIPPED for fault in load_plan(name).fault}
    assert used == set(KINDS)


def test_a_vessel_gets_its_faults_and_those_of_all_and_the_first_the_machines(
    tmp_path: Path,
) -> None:
    text = (
        DROP
        + 'vessel = "wamv2"\n'
        + DROP.replace("points", "odometry")
        + DROP.replace("drop", "cpu_hog").replace("points", "machine")
    )
    names = ("wamv1", "wamv2")
    plans = plans_by_vessel(load_plan(written(tmp_path, text), names), names)
    targets = [[fault.target for fault in plan.fault] for plan in plans]
    assert targets == [["odometry", "machine"], ["points", "odometry"]]
