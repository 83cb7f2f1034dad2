"""`metadata.yaml`, as ROS 2 Humble's rosbag2 reads it, and everybody since."""

from pathlib import Path

from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML
from tests.harness.boat import odometry

from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recorder import Recorder

HUMBLES = {
    "version": int,
    "storage_identifier": str,
    "relative_file_paths": list,
    "duration": dict,
    "starting_time": dict,
    "message_count": int,
    "topics_with_message_count": list,
    "compression_format": str,
    "compression_mode": str,
    "files": list,
}
"""Keys that the decoder of Humble's rosbag2_storage (yaml.hpp, version 5) asks for, with types."""
HUMBLES_TOPIC = ("name", "type", "serialization_format", "offered_qos_profiles")


def recorded(folder: Path) -> Path:
    with Recorder(folder / "bag", "wamv", {}) as recorder:
        recorder.record("odometry", cdr.encode_odometry(odometry(1.0)), 10)
        recorder.record("static_transforms", cdr.encode_transforms([], stamp_ns=1), 11)
        recorder.record("enable", cdr.encode_enable(True), 12)
    return folder / "bag"


def test_it_has_what_humble_asks_for_in_the_types_that_it_reads(tmp_path: Path) -> None:
    text = (recorded(tmp_path) / "metadata.yaml").read_text()
    bag = YAML(typ="safe").load(text)["rosbag2_bagfile_information"]
    assert bag["version"] == 5
    assert {key: type(bag[key]) for key in HUMBLES} == HUMBLES
    assert [set(file) for file in bag["files"]] == [
        {"path", "starting_time", "duration", "message_count"}
    ]
    for topic in bag["topics_with_message_count"]:
        assert type(topic["message_count"]) is int
        for key in HUMBLES_TOPIC:  # a list of qualities, as later versions have it, throws there
            assert type(topic["topic_metadata"][key]) is str
        (quality,) = YAML(typ="safe").load(topic["topic_metadata"]["offered_qos_profiles"])
        numbers = ("history", "depth", "reliability", "durability", "liveliness")
        assert all(type(quality[key]) is int for key in numbers)
        assert set(quality["deadline"]) == {"sec", "nsec"}


def test_static_transforms_are_played_to_those_who_come_late(tmp_path: Path) -> None:
    with Reader(recorded(tmp_path)) as reader:
        found = {}
        for connection in reader.connections:
            (quality,) = connection.ext.offered_qos_profiles
            assert (quality.history, quality.reliability) == (
                QosHistory.KEEP_LAST,
                QosReliability.RELIABLE,
            )
            found[connection.topic] = quality.durability
    late, only_now = QosDurability.TRANSIENT_LOCAL, QosDurability.VOLATILE
    assert found == {
        "/tf_static": late,
        "/wamv/enable": only_now,
        "/wamv/sensors/position/ground_truth_odometry": only_now,
    }
