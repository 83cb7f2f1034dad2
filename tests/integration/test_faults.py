"""Faults on real processes: `twinscrew faults`, and `twinscrew sitl --faults`.

How fast the boat reacts is for `make faults` to say, on a machine that is not busy with tests: here
promises are so generous, or so impossible, that no speed of this machine decides.
"""

from pathlib import Path

import pytest
from tests.harness.commands import as_json, twinscrew

from twinscrew.runtime.recording.recording import find_recordings

pytestmark = pytest.mark.realtime

STOPS = """
[promise]
fault = "scans stop"
reaction = "neutral"
neutral_s = 60.0
event = "lidar_stale"
event_s = 60.0
state = "safe"
moves_again_s = 60.0
[[fault]]
at_s = 4.0
for_s = 3.0
kind = "drop"
target = "points"
"""
IMPOSSIBLE = STOPS.replace('state = "safe"', "sails_on = true").replace("60.0", "60.5")
KILLED = """
[promise]
fault = "kill -9 of the runtime"
reaction = "the autopilot's failsafe"
neutral_s = 60.0
[[fault]]
at_s = 4.0
for_s = 3.0
kind = "kill"
target = "runtime"
"""


BY_TOPIC = """
autopilot = "thrust"
[promise]
fault = "kill -9 of the runtime"
reaction = "the process beside it sends zero"
neutral_s = 60.0
[[fault]]
at_s = 4.0
for_s = 6.0
kind = "kill"
target = "runtime"
"""


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def test_promises_are_measured_and_a_broken_one_is_named_and_the_status_1(tmp_path: Path) -> None:
    files = [
        written(tmp_path, "stops", STOPS),
        written(tmp_path, "impossible", IMPOSSIBLE),
        written(tmp_path, "killed", KILLED),
    ]
    words = [word for file in files for word in ("--only", file)]
    done = twinscrew("faults", *words, "--json", "--out", tmp_path / "kept")
    report = as_json(done)
    found = report["faults"]
    assert done.returncode == 1
    assert report["kept"] is False
    assert found["stops"]["kept"] is True, found["stops"]
    whats = [row["what"] for row in found["stops"]["rows"]]
    assert whats == ["neutral", "lidar_stale", "state", "turns again", "unhandled exceptions"]
    broken = [row["what"] for row in found["impossible"]["rows"] if not row["kept"]]
    assert broken == ["sails on"]
    assert found["killed"]["kept"] is True, found["killed"]
    recordings = find_recordings(tmp_path / "kept" / "killed")
    assert [recording.whole for recording in recordings] == [False, True]


@pytest.mark.nightly
def test_a_voyage_with_faults_says_what_was_promised_and_measured(tmp_path: Path) -> None:
    file = written(tmp_path, "stops", STOPS.replace("[[fault]]", '[[fault]]\nvessel = "wamv2"'))
    words = ("--scenario", "head_on", "--max-time", 12, "--out", tmp_path / "run", "--json")
    done = twinscrew("sitl", *words, "--faults", file)
    report = as_json(done)
    assert set(report["faults"]) == {"wamv2"}
    assert report["faults"]["wamv2"]["kept"] is True, report["faults"]
    assert {vessel["name"] for vessel in report["vessels"]} == {"wamv1", "wamv2"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sitl", "--lockstep", "--faults", "lidar_drop"), "only in real time"),
        (("sitl", "--faults", "lidar_dorp"), "'lidar_dorp' is not one of"),
        (("faults", "--only", "lidar_dorp"), "'lidar_dorp' is not one of"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_sails(tmp_path: Path, words, said) -> None:
    done = twinscrew(*words, "--out", tmp_path / "run")
    assert done.returncode == 2
    assert said in done.stderr


@pytest.mark.slow
def test_thrusters_by_topic_stand_still_when_their_runtime_is_killed(tmp_path: Path) -> None:
    file = written(tmp_path, "by_topic", BY_TOPIC)
    done = twinscrew("faults", "--only", file, "--json", "--out", tmp_path / "kept")
    assert done.returncode == 0, done.stderr
    (neutral, *_) = as_json(done)["faults"]["by_topic"]["rows"]
    assert (neutral["what"], neutral["kept"]) == ("neutral", True)
    assert neutral["measured"] not in ("never", "never turned")


def test_what_thrusters_by_topic_do_not_have_is_refused_by_name(tmp_path: Path) -> None:
    text = BY_TOPIC.replace('"kill"', '"drop"').replace('"runtime"', '"to_autopilot"')
    done = twinscrew("faults", "--only", written(tmp_path, "cut", text))
    assert done.returncode == 2
    assert "to_autopilot: of thrusters by topic there is no autopilot" in done.stderr
    voyage = twinscrew("sitl", "--faults", written(tmp_path, "own", BY_TOPIC))
    assert voyage.returncode == 2
    assert "autopilot: thrusters by topic are tried with `twinscrew faults" in voyage.stderr
