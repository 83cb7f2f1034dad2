import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from twinscrew.runtime.errors import ConfigError, RecordingError
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.recording.recording import (
    DecisionHash,
    decisions_sha256,
    find_recordings,
    read_inputs,
)


def record(path, vessel="wamv1", count=40):
    with Recorder(path, vessel, {}, lossless=True) as recorder:
        for number in range(count):
            recorder.record("points", bytes(3_000), 10 * number + 1)
            recorder.record("decision", b"%s %d" % (vessel.encode(), number), 10 * number + 2)
    return path / f"{path.name}_0.mcap"


def foreign(path, topics, plugin=StoragePlugin.MCAP):
    """Make a bag with another program: rosbags."""
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for name, ros_type, messages in topics:
            connection = writer.add_connection(name, ros_type, typestore=type_store())
            for time_ns, payload in messages:
                writer.write(connection, time_ns, payload)
    return path


POINTS, ODOMETRY = TOPICS["points"].ros_type, TOPICS["odometry"].ros_type
VRX = [
    ("/wamv/" + TOPICS["odometry"].key, ODOMETRY, [(20, b"o20"), (40, b"o40")]),
    ("/wamv/" + TOPICS["points"].key, POINTS, [(10, b"p10"), (30, b"p30")]),
    ("/wamv/sensors/imu/imu/data", "sensor_msgs/msg/Imu", [(15, b"i")]),
]
IN_ORDER = [("points", b"p10"), ("odometry", b"o20"), ("points", b"p30"), ("odometry", b"o40")]


def contents(messages):
    return [(m.topic, m.payload) for m in messages]


def test_a_run_a_bag_and_a_file_are_all_recordings(tmp_path):
    file = record(tmp_path / "run" / "wamv1")
    for path in (tmp_path / "run", file.parent, file):
        assert len(list(read_inputs(path))) == 40
        (recording,) = find_recordings(path)
        assert recording.vessel == "wamv1"
        assert recording.whole


def test_a_run_of_several_vessels_gives_one_recording_each(tmp_path):
    for vessel in ("wamv2", "wamv1"):
        record(tmp_path / vessel, vessel)
    recordings = find_recordings(tmp_path)
    assert [r.vessel for r in recordings] == ["wamv1", "wamv2"]
    assert next(recordings[1].decisions()) == b"wamv2 0"
    with pytest.raises(RecordingError, match=r"several recordings \(wamv1, wamv2\)"):
        read_inputs(tmp_path)


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_bag_of_another_program_with_vrxs_names_is_understood(tmp_path, plugin):
    bag = foreign(tmp_path / "vrx", VRX, plugin)
    assert contents(read_inputs(bag)) == IN_ORDER


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_what_a_bag_holds_is_known_without_reading_it(tmp_path, plugin, monkeypatch):
    (recording,) = find_recordings(foreign(tmp_path / "vrx", VRX, plugin))
    for source in recording.sources:
        monkeypatch.setattr(type(source), "messages", None)
    held = {name for name in TOPICS if recording.has(name)}
    assert held == {"points", "odometry", "imu"}
    assert recording.is_foreign


def test_a_file_cut_off_tells_what_it_holds_too(tmp_path):
    file = record(tmp_path / "bag")
    file.write_bytes(file.read_bytes()[:-2000])
    (recording,) = find_recordings(file)
    assert not recording.whole
    assert not recording.is_foreign
    assert recording.has("points")
    assert not recording.has("odometry")


def test_a_mapping_says_what_the_topics_of_another_boat_are(tmp_path):
    names = {"/odom": VRX[0][2], "/velodyne_points": VRX[1][2]}
    types = {"/odom": ODOMETRY, "/velodyne_points": POINTS}
    bag = foreign(tmp_path / "boat", [(n, types[n], m) for n, m in names.items()])
    mapping = tmp_path / "topics.toml"
    mapping.write_text('[topics]\n"/odom" = "odometry"\n"/velodyne_points" = "points"\n')
    assert contents(read_inputs(bag, mapping)) == IN_ORDER
    with pytest.raises(RecordingError, match=r"none of .*'points'.*only \['/odom'.*mapping"):
        list(read_inputs(bag))


def test_a_mapping_to_a_topic_of_another_type_is_refused(tmp_path):
    bag = foreign(tmp_path / "boat", [("/odom", ODOMETRY, [(1, b"o")])])
    mapping = tmp_path / "topics.toml"
    mapping.write_text('[topics]\n"/odom" = "points"\n')
    with pytest.raises(RecordingError, match=r"/odom holds nav_msgs/msg/Odometry, but points is"):
        list(read_inputs(bag, mapping))


def test_a_mapping_to_a_topic_that_does_not_exist_is_refused_with_those_that_do(tmp_path):
    mapping = tmp_path / "topics.toml"
    mapping.write_text('[topics]\n"/odom" = "odometer"\n')
    with pytest.raises(ConfigError, match=r"topics\.toml.*'odometer' is not one of 'points'"):
        find_recordings(record(tmp_path / "bag"), mapping)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "no such file or folder"),
        (lambda path: path.mkdir(), "holds no recording"),
        (lambda path: path.write_bytes(b""), "not an MCAP file"),
        (lambda path: path.write_text("hello world"), "not an MCAP file"),
        (lambda path: path.write_text("#ROSBAG V2.0\n"), "not an MCAP file, but a ROS 1 bag"),
        (lambda path: path.write_text("SQLite format 3\0"), "not an MCAP file, but SQLite"),
    ],
    ids=["nothing", "empty folder", "empty file", "text", "ROS 1", "SQLite"],
)
def test_what_is_no_recording_is_refused_in_clear_words(tmp_path, make, words):
    path = tmp_path / "thing"
    make(path)
    with pytest.raises(RecordingError, match=f"thing: {words}"):
        find_recordings(path)


def test_a_file_cut_anywhere_gives_its_beginning(tmp_path):
    file = record(tmp_path / "bag", count=20)
    data = file.read_bytes()
    everything = [m.time_ns for m in read_inputs(file)]
    counts = []
    for size in range(8, len(data), 611):
        file.write_bytes(data[:size])
        times = [m.time_ns for m in read_inputs(file)]
        assert times == everything[: len(times)]
        counts.append(len(times))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == len(everything)


def test_a_file_with_any_byte_changed_is_read_or_refused(tmp_path):
    file = record(tmp_path / "bag", count=10)
    data = bytearray(file.read_bytes())
    refused = 0
    for place in range(8, len(data), 97):
        data[place] ^= 0xFF
        file.write_bytes(data)
        try:
            for recording in find_recordings(file):
                list(recording.messages())
        except RecordingError as error:
            assert "bag_0.mcap" in str(error)  # noqa: PT017
            refused += 1
        data[place] ^= 0xFF
    assert refused > 100


def test_a_payload_with_a_byte_changed_is_noticed(tmp_path):
    file = record(tmp_path / "bag")
    data = bytearray(file.read_bytes())
    data[data.index(b"wamv1 7")] ^= 1
    file.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged: crc"):
        list(read_inputs(file))


@pytest.mark.parametrize("said", [b"{wamv1}", b"[1,[2]]", b"1234567"])
def test_metadata_that_are_not_what_they_should_be_are_refused(tmp_path, said):
    file = record(tmp_path / "bag", count=0)
    file.write_bytes(file.read_bytes().replace(b'"wamv1"', said))
    with pytest.raises(RecordingError, match="metadata are damaged"):
        find_recordings(file)


def test_the_hash_of_a_run_tells_where_one_decision_ends():
    assert decisions_sha256([b"ab", b"c"]) != decisions_sha256([b"a", b"bc"])
    assert decisions_sha256([b"ab", b"c"]) != decisions_sha256([b"c", b"ab"])
    run = DecisionHash()
    for decision in (b"ab", b"c"):
        run.add(decision)
    assert run.hexdigest() == decisions_sha256([b"ab", b"c"])
    assert len(run.hexdigest()) == 64
