"""What a recording's core took in, taken in again, gives the same decisions."""

import hashlib
import json
import platform
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import msgspec
import numpy as np
import onnx
import pytest
import typer
from rosbags.rosbag2 import StoragePlugin, Writer
from tests.harness.boat import SECOND, cloud, feed, odometry, stamp
from tests.harness.circling import EPOCH_NS, Circling

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.runtime.cli.replay import replay as replay_command
from twinscrew.runtime.errors import ConfigError, RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.messages.types import Engagement, Goal
from twinscrew.runtime.recording.files import McapFile
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.settings import CONFIG_DIR, convert
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.mission import MissionSettings
from twinscrew.runtime.vessel.outputs import Publisher
from twinscrew.runtime.vessel.replay import Replay, combined_sha256, replay
from twinscrew.runtime.vessel.summary import metadata_of
from twinscrew.runtime.vessel.vessel import vessel_for_replay

BRIEF = replace(load_scenario("passage"), time_limit_s=4.0)
CONFIG = RuntimeConfig(sensor="vrx16", mission=MissionSettings(waypoints_m=((60.0, 0.0),)))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("replay") / "run"
    report = sail(BRIEF, SitlSettings(sensor="vrx16", lockstep=True), folder)
    return folder, report.sha256


def only(folder: Path, **options: object) -> Replay:
    (recording,) = find_recordings(folder)
    return replay(recording, **options)


def good(time_s: float) -> list[tuple[str, bytes]]:
    return [
        ("odometry", cdr.encode_odometry(odometry(time_s, north=time_s))),
        ("points", cdr.encode_point_cloud(cloud(time_s))),
    ]


def engaged(yes: bool) -> tuple[str, bytes]:
    return "engagement", cdr.encode_engagement(Engagement(stamp_ns=stamp(0), engaged=yes))


def rough_afternoon() -> Iterator[tuple[str, bytes]]:
    """Everything that a core can be told, good and bad, in an order that matters."""
    generator = np.random.default_rng(4)
    yield engaged(True)
    for k in range(120):
        for topic, payload in good(0.1 * k):
            yield topic, payload
            if generator.random() < 0.2:
                yield topic, payload
            if generator.random() < 0.2:
                yield topic, payload[: generator.integers(len(payload))]
        if k in (30, 50):
            yield engaged(k == 50)
        if k == 70:
            goal = Goal(stamp_ns=stamp(7), position_N=np.array([5.0, -30.0]))
            yield "goal", cdr.encode_goal(goal)
        if k == 90:
            yield "odometry", cdr.encode_odometry(odometry(9.05, north=200.0))
    for k in range(30):
        yield from good(-3600 + 0.1 * k)


def record(folder: Path, config: RuntimeConfig = CONFIG) -> str:
    vessel = vessel_for_replay(config)
    metadata = metadata_of(config, vessel.pipeline.policy)
    with Recorder(folder, config.name, metadata, config.recording, lossless=True) as recorder:
        publisher = Publisher(None, recorder, clock_ns=lambda: 0)
        for topic, payload in rough_afternoon():
            publisher.publish(feed(vessel, topic, payload))
    assert publisher.decisions > 100
    return publisher.sha256


@pytest.mark.slow
def test_a_replay_says_which_part_of_the_recording_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The quota deletes the oldest files; somebody may move any."""
    settings = {"rotate_mb": 0.02}
    config = convert({**msgspec.to_builtins(CONFIG), "recording": settings}, RuntimeConfig)
    record(tmp_path / "bag", config)
    files = sorted((tmp_path / "bag").glob("*.mcap"), key=lambda f: int(f.stem.split("_")[-1]))
    assert len(files) > 4
    assert only(tmp_path).missing == ()
    files[2].unlink()
    assert only(tmp_path).missing == ("part",)
    files[0].unlink()
    assert only(tmp_path).missing == ("beginning", "part")
    with pytest.raises(typer.Exit):
        replay_command(tmp_path, config=None, policy=None, topics=None, as_json=False)
    assert "its beginning is missing" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_every_vessel_of_a_run_decides_the_same_again(run: tuple[Path, str]) -> None:
    folder, sha256 = run
    replays = [replay(recording) for recording in find_recordings(folder)]
    assert all(r.same and r.whole for r in replays)
    assert all(r.decisions == r.recorded_decisions > 20 for r in replays)
    assert combined_sha256(r.sha256 for r in replays) == sha256


def test_a_recording_tells_everything_that_its_decisions_depend_on(run: tuple[Path, str]) -> None:
    """Configuration, the policy's bytes, the software's versions, the machine, the seed."""
    policy = (CONFIG_DIR / "policies" / "ac_iqn.onnx").read_bytes()
    for recording in find_recordings(run[0]):
        told = recording.metadata
        config = convert(told["config"], RuntimeConfig)
        assert config.name == recording.vessel
        assert config.sensor == "vrx16"
        assert config.recording.about == {"scenario": "passage", "seed": "0"}
        assert told["policy_sha256"] == hashlib.sha256(policy).hexdigest()
        for package in ("twinscrew", "numpy", "scipy", "onnxruntime", "eclipse-zenoh"):
            assert told["software"][package] == version(package)
        assert told["platform"]["python"] == platform.python_version()
        assert told["platform"]["architecture"] == platform.machine()


def test_replaying_twice_is_replaying_once(run: tuple[Path, str]) -> None:
    recording, *_ = find_recordings(run[0])
    assert replay(recording) == replay(recording)


def test_damaged_doubled_and_backward_inputs_are_replayed_too(tmp_path: Path) -> None:
    sha256 = record(tmp_path / "rough")
    again = only(tmp_path / "rough")
    assert again.same
    assert again.sha256 == sha256


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_recording_that_was_cut_off_gives_its_decisions_again(
    tmp_path: Path, share: float
) -> None:
    record(tmp_path / "cut")
    (file,) = (tmp_path / "cut").glob("*.mcap")
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    again = only(tmp_path / "cut")
    assert not again.whole
    assert again.same
    assert 0 < again.recorded_decisions <= again.decisions


def test_another_policy_decides_otherwise(run: tuple[Path, str]) -> None:
    recording, *_ = find_recordings(run[0])
    again = replay(recording, policy="apf")
    assert again.decisions == again.recorded_decisions
    assert not again.same


def test_a_policy_file_that_has_changed_since_is_refused(tmp_path: Path) -> None:
    policy = tmp_path / "policy.onnx"
    shutil.copy(CONFIG_DIR / "policies" / "ac_iqn.onnx", policy)
    record(tmp_path / "run", RuntimeConfig(policy=str(policy), sensor="vrx16"))
    assert only(tmp_path / "run").same
    model = onnx.load(policy)
    model.metadata_props.add(key="note", value="changed")
    onnx.save(model, policy)
    with pytest.raises(RecordingError, match=r"made with a policy of SHA-256 .* --policy"):
        only(tmp_path / "run")
    assert only(tmp_path / "run", policy=str(policy)).same


BOAT_TOML = 'sensor = "vrx16"\n[mission]\nwaypoints_m = [[60.0, 0.0]]\n'


def foreign(
    path: Path,
    messages: Iterable[tuple[str, bytes, float]],
    names: Mapping[str, str] | None = None,
    plugin: StoragePlugin = StoragePlugin.MCAP,
) -> Path:
    """Make a bag with another program; `names` are its topics' where they are not VRX's."""
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, payload, time_s in messages:
            if topic not in connections:
                name = (names or {}).get(topic, f"/boat/{TOPICS[topic].key}")
                ros_type = TOPICS[topic].ros_type
                connections[topic] = writer.add_connection(name, ros_type, typestore=type_store())
            writer.write(connections[topic], round(time_s * SECOND), payload)
    return path


def two_seconds() -> Iterator[tuple[str, bytes, float]]:
    for k in range(20):
        for topic, payload in good(0.1 * k):
            yield topic, payload, 0.1 * k


def test_a_bag_of_another_boat_is_decided_on_as_if_it_were_ours(tmp_path: Path) -> None:
    bag = foreign(tmp_path / "bag", two_seconds())
    config = tmp_path / "boat.toml"
    config.write_text(BOAT_TOML)
    again = only(bag, config=config)
    assert (again.decisions, again.recorded_decisions) == (20, 0)
    still = only(bag)  # without a goal
    assert again.sha256 != still.sha256


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_the_command_replays_a_bag_of_another_boat_whose_topics_a_file_names(
    tmp_path: Path, plugin: StoragePlugin, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"odometry": "/odometry/filtered", "points": "/velodyne_points"}
    bag = foreign(tmp_path / "bag", two_seconds(), names, plugin)
    mapping, config = tmp_path / "names.toml", tmp_path / "boat.toml"
    lines = [f'"{ros_name}" = "{topic}"' for topic, ros_name in names.items()]
    mapping.write_text("\n".join(["[topics]", *lines]))
    config.write_text(BOAT_TOML)
    replay_command(bag, config=config, policy=None, topics=mapping, as_json=True)
    told = json.loads(capsys.readouterr().out)
    (vessel,) = told["vessels"]
    assert (vessel["decisions"], vessel["recorded_decisions"]) == (20, 0)
    plain = foreign(tmp_path / "plain", two_seconds())
    assert told["decisions_sha256"] == only(plain, config=config).sha256


def test_inputs_that_could_not_be_used_are_told_by_kind_with_the_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def damaged() -> Iterator[tuple[str, bytes, float]]:
        for topic, payload, time_s in two_seconds():
            yield topic, payload[:40] if time_s < 0.55 else payload, time_s

    bag = foreign(tmp_path / "bag", damaged())
    replay_command(bag, config=None, policy=None, topics=None, as_json=True)
    (vessel,) = json.loads(capsys.readouterr().out)["vessels"]
    assert vessel["decisions"] == 14
    refused = vessel["refused"]["bad_message"]
    assert refused["count"] == 12
    assert refused["first"].startswith("odometry: nav_msgs/msg/Odometry: ends after 40")
    replay_command(bag, config=None, policy=None, topics=None, as_json=False)
    assert "bag: bad_message 12 times: odometry: nav_msgs" in capsys.readouterr().out


def test_a_bag_without_odometry_says_why_nothing_was_decided(tmp_path: Path) -> None:
    scans = (one for one in two_seconds() if one[0] == "points")
    again = only(foreign(tmp_path / "bag", scans))
    assert again.decisions == 0
    assert again.refused["odometry_missing"].count == 20


def test_a_bag_with_gps_and_imu_but_no_odometry_is_decided_on_by_the_estimate(
    tmp_path: Path,
) -> None:
    boat = Circling()
    sensed: list[tuple[str, bytes, float]] = []
    boat.spoil_imu = lambda imu, t: sensed.append(("imu", cdr.encode_imu(imu), t)) or imu
    boat.spoil_fix = lambda fix, t: sensed.append(("gps", cdr.encode_fix(fix), t)) or fix
    boat.sail(4.0)
    scans = [
        (
            "points",
            cdr.encode_point_cloud(replace(cloud(0.1 * k), stamp_ns=stamp(0.1 * k))),
            0.1 * k,
        )
        for k in range(1, 40)
    ]
    assert stamp(0) == EPOCH_NS
    bag = foreign(tmp_path / "bag", sorted([*sensed, *scans], key=lambda message: message[2]))
    config = tmp_path / "boat.toml"
    datum = "[estimation.datum]\nlatitude_deg = -33.7221\nlongitude_deg = 150.6739\n"
    config.write_text('odometry_source = "gps_imu"\n' + BOAT_TOML + datum)
    again = only(bag, config=config)
    assert 24 <= again.decisions <= 32  # of 39 scans: it takes a second of fixes to know the speed
    assert again == only(bag, config=config)


def test_a_recording_of_ours_in_which_nobody_drove_is_replayed_so(tmp_path: Path) -> None:
    vessel = vessel_for_replay(CONFIG)
    metadata = metadata_of(CONFIG, vessel.pipeline.policy)
    with Recorder(tmp_path / "idle", CONFIG.name, metadata, lossless=True) as recorder:
        publisher = Publisher(None, recorder, clock_ns=lambda: 0)
        for k in range(10):
            for topic, payload in good(0.1 * k):
                publisher.publish(feed(vessel, topic, payload))
    again = only(tmp_path / "idle")
    assert again.decisions == 10
    assert again.same


def test_a_recording_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record(tmp_path / "run")
    reads = []
    read = McapFile.messages
    monkeypatch.setattr(McapFile, "messages", lambda self: reads.append(1) or read(self))
    assert only(tmp_path / "run").same
    assert len(reads) == 1


def test_a_recorded_configuration_that_this_version_does_not_know_is_refused(
    tmp_path: Path,
) -> None:
    with Recorder(tmp_path / "old", "wamv", {"config": {"speed": 3}}, lossless=True) as recorder:
        recorder.record("points", good(0.0)[1][1], 0)
    with pytest.raises(ConfigError, match="old: speed: unknown key"):
        only(tmp_path / "old")


def test_one_vessels_hash_is_the_runs() -> None:
    assert combined_sha256(["ab"]) == "ab"
    assert combined_sha256(["ab", "cd"]) != combined_sha256(["cd", "ab"])
