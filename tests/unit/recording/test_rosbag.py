"""Bags read by way of their metadata.yaml: as another program writes them, and damaged."""

import random
import shutil
import sqlite3
from contextlib import closing, suppress

import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.recording.recording import find_recordings

NAME, TYPE = "/wamv/" + TOPICS["odometry"].key, TOPICS["odometry"].ros_type


def write(path, plugin=StoragePlugin.SQLITE3, mode=None):
    writer = Writer(path, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(NAME, TYPE, typestore=type_store())
        for time_ns in (30, 10, 20):
            writer.write(connection, time_ns, b"\x00\x01odometry %d" % time_ns)
    return path


def times(path):
    (recording,) = find_recordings(path)
    assert all(m.payload == b"\x00\x01odometry %d" % m.time_ns for m in recording.inputs())
    return [message.time_ns for message in recording.inputs()]


@pytest.mark.parametrize(
    ("plugin", "mode"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
    ],
)
def test_compressed_bags_are_read_by_folder_and_by_file(tmp_path, plugin, mode):
    bag = write(tmp_path / "bag", plugin, mode)
    (file,) = (file for file in bag.iterdir() if file.name != "metadata.yaml")
    assert times(bag) == times(file) == [10, 20, 30]


def test_a_bag_without_metadata_is_refused_with_what_makes_them(tmp_path):
    bag = write(tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    with pytest.raises(RecordingError, match=r"no metadata\.yaml: `ros2 bag reindex"):
        times(bag)


@pytest.mark.parametrize(
    "metadata",
    [b"", b"[1]", b"a: [1", b"a: 1", bytes(range(256)), b"rosbag2_bagfile_information: 3"],
    ids=["empty", "list", "unclosed", "other", "binary", "number"],
)
def test_metadata_that_are_none_are_refused_in_one_line(tmp_path, metadata):
    bag = write(tmp_path / "bag")
    (bag / "metadata.yaml").write_bytes(metadata)
    with pytest.raises(RecordingError, match=r"bag: damaged: .+") as refused:
        times(bag)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "change",
    [
        "drop table messages",
        "drop table topics",
        "update messages set data = 'text'",
        "update messages set timestamp = 'noon'",
    ],
)
def test_a_database_that_holds_something_else_is_refused(tmp_path, change):
    bag = write(tmp_path / "bag")
    with closing(sqlite3.connect(bag / "bag.db3")) as database:
        database.execute(change)
        database.commit()
    with pytest.raises(RecordingError, match="bag: damaged"):
        times(bag)


def test_a_database_with_any_bytes_changed_is_read_or_refused(tmp_path):
    whole, generator = write(tmp_path / "whole"), random.Random(1)
    data = (whole / "whole.db3").read_bytes()
    bag = shutil.copytree(whole, tmp_path / "bag")
    refused = 0
    for _ in range(60):
        changed = bytearray(data)
        for place in generator.choices(range(len(data)), k=8):
            changed[place] = generator.randrange(256)
        (bag / "whole.db3").write_bytes(changed)
        with suppress(RecordingError):
            for recording in find_recordings(bag):
                list(recording.messages())
            continue
        refused += 1
    assert refused > 5
