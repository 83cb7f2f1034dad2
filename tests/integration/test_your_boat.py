"""docs/your-boat.md, as far as a simulator can: from a file of eight numbers to a voyage."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from tests.harness.commands import as_json, twinscrew

pytestmark = pytest.mark.slow

LEAST = """[vessel]
name = "My boat"
length_m = 1.6
beam_m = 0.9
mass_kg = 45.0
thruster_spacing_m = 0.6
thrust_max_n = {ahead}
thrust_min_n = -35.0
top_speed_mps = {top}
"""


@pytest.fixture(scope="module")
def boat(tmp_path_factory: pytest.TempPathFactory):
    """A boat, what its owner wrote down of it, its recorded trials, and what was identified."""
    folder = tmp_path_factory.mktemp("boat")
    (folder / "truth.toml").write_text(LEAST.format(ahead=60.0, top=2.4))
    (folder / "my_boat.toml").write_text(LEAST.format(ahead=68.0, top=2.7))
    sailed = twinscrew(
        *("sitl", "--lockstep", "--json", "--trial", "all", "--max-time", 170),
        *("--vessel", folder / "truth.toml", "--believed", folder / "my_boat.toml"),
        *("--out", folder / "trials"),
    )
    found = twinscrew(
        *("identify", folder / "trials", "--vessel", folder / "my_boat.toml"),
        *("--out", folder / "identified.toml", "--json"),
    )
    return folder, sailed, found


def test_the_trials_are_sailed_to_their_end_and_recorded(boat) -> None:
    _, sailed, _ = boat
    report = as_json(sailed)
    assert sailed.returncode == 0, sailed.stderr
    assert [vessel["outcome"] for vessel in report["vessels"]] == ["done"]


def test_a_replay_of_a_trial_gives_the_same_decisions(boat) -> None:
    folder, _, _ = boat
    again = twinscrew("replay", folder / "trials", "--json")
    assert again.returncode == 0, again.stdout + again.stderr
    assert as_json(again)["same"] is True


def test_what_is_identified_predicts_and_is_nearer_the_truth(boat) -> None:
    folder, _, found = boat
    told = as_json(found)
    assert told["validation"]["position_rmse_5s_m"] < 0.1 * 1.6
    assert told["validation"]["position_rmse_5s_m"] < told["given"]["position_rmse_5s_m"]
    assert told["estimates"]["top_speed_mps"]["value"] == pytest.approx(2.4, rel=0.05)
    assert told["estimates"]["thrust_max_n"]["value"] == pytest.approx(60.0, rel=0.1)
    file = tomllib.loads((folder / "identified.toml").read_text())
    assert file["vessel"] == told["vessel"]
    assert (folder / "identified.png").is_file()
    assert (folder / "identified.svg").is_file()


def test_the_doctor_tells_the_identified_file_from_one_with_twice_the_mass(boat) -> None:
    folder, _, _ = boat
    text = (folder / "my_boat.toml").read_text().replace("mass_kg = 45.0", "mass_kg = 90.0")
    (folder / "wrong.toml").write_text(text)
    verdicts = {}
    for name in ("identified", "wrong"):
        file = folder / f"{name}.toml"
        words = ("doctor", "--vessel", file, "--recording", folder / "trials", "--json")
        checks = json.loads(twinscrew(*words).stdout)["checks"]
        line = next(check for check in checks if check["what"] == f"vessel {file}")
        verdicts[name] = line["verdict"], line["found"]
    assert verdicts["identified"][0] == "OK", verdicts
    assert verdicts["wrong"][0] == "FAIL", verdicts
    assert "mass_kg = 90" in verdicts["wrong"][1]


def test_the_identified_boat_sails_to_its_goal(boat) -> None:
    folder, _, _ = boat
    done = twinscrew(
        *("sitl", "--lockstep", "--json", "--vessel", folder / "identified.toml", "--policy"),
        *("mpc", "--vessels", 1, "--seed", 1, "--out", folder / "voyage"),
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_in_real_time_a_trial_is_sailed_by_a_runtime_of_its_own(tmp_path: Path) -> None:
    done = twinscrew(
        *("sitl", "--trial", "stop", "--vessel", "blueboat", "--max-time", 12, "--json"),
        *("--out", tmp_path / "run"),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert as_json(done)["vessels"][0]["outcome"] == "done"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("straight",), "trial.around_m"),
        (("straight", "--around", "5"), "got 5 m"),
        (("straight", "--box", "1,2,3"), "box_m"),
        (("straight", "--box", "a,b,c,d"), "--box"),
        (("sideways", "--around", "99"), "'sideways' is not one of"),
    ],
)
def test_a_trial_without_room_is_refused_before_anything_moves(
    tmp_path: Path, words: tuple[str, ...], says: str
) -> None:
    (tmp_path / "boat.toml").write_text('vessel = "otter"\npolicy = "mpc"\n')
    refused = twinscrew("trial", *words, "--config", tmp_path / "boat.toml")
    assert refused.returncode == 2
    assert says in refused.stderr
