import gc
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import tracemalloc

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Engagement
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.recording.settings import RecorderSettings
from twinscrew.runtime.recording.writer import BagWriter

MS = 1_000_000


def inputs(path):
    (recording,) = find_recordings(path)
    return [(m.topic, m.payload, m.time_ns) for m in recording.inputs()]


@pytest.mark.parametrize("lossless", [True, False], ids=["lock-step", "real time"])
def test_what_was_recorded_comes_back_byte_for_byte_in_order(tmp_path, lossless):
    made = [
        (("points", "odometry", "goal", "engagement")[i % 4], os.urandom(i), (i + 1) * MS)
        for i in range(200)
    ]
    with Recorder(tmp_path / "bag", "wamv1", {}, lossless=lossless) as recorder:
        for message in made:
            recorder.record(*message)
    assert recorder.dropped == 0
    assert inputs(tmp_path) == made


def test_times_that_stand_still_or_go_back_are_made_to_increase(tmp_path):
    with Recorder(tmp_path / "bag", "wamv1", {}, lossless=True) as recorder:
        for time_ns in (5, 5, 3, 9):
            recorder.record("goal", b"%d" % time_ns, time_ns)
    assert inputs(tmp_path) == [
        ("goal", b"5", 5),
        ("goal", b"5", 6),
        ("goal", b"3", 7),
        ("goal", b"9", 9),
    ]


def test_metadata_come_back_with_the_versions_of_the_software(tmp_path):
    metadata = {"seeds": [1, 2], "config": {"goal": {"x": 1.5}}, "policy_sha256": "ab"}
    Recorder(tmp_path / "bag", "wamv1", metadata).close()
    (recording,) = find_recordings(tmp_path)
    assert recording.vessel == "wamv1"
    assert {name: recording.metadata[name] for name in metadata} == metadata
    assert {"twinscrew", "numpy", "onnxruntime"} <= set(recording.metadata["software"])


def test_ros_tools_read_the_bag_with_its_types(tmp_path):
    path = tmp_path / "bag"
    with Recorder(path, "wamv1", {}) as recorder:
        recorder.record("engagement", cdr.encode_engagement(ENGAGED), 7)
        recorder.record("thrust_left", cdr.encode_thrust(12.5), 8)
    with Reader(path) as reader:
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        assert reader.message_count == 2
    assert types == {
        "/wamv1/engagement": "twinscrew_msgs/msg/Engagement",
        "/wamv1/thrusters/left/thrust": "std_msgs/msg/Float64",
    }
    with (path / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [message for *_, message in reader.iter_decoded_messages()]
    assert (messages[0].engaged, messages[1].data) == (True, 12.5)


ENGAGED = Engagement(stamp_ns=5, engaged=True)


def test_a_folder_that_holds_something_is_refused(tmp_path):
    (tmp_path / "old.mcap").touch()
    with pytest.raises(RecordingError, match="exists and is not empty"):
        Recorder(tmp_path, "wamv1", {})


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="file"):
        Recorder(tmp_path / "file" / "bag", "wamv1", {})


def test_a_topic_outside_the_table_is_refused_at_once(tmp_path):
    with (
        Recorder(tmp_path / "bag", "wamv1", {}) as recorder,
        pytest.raises(RecordingError, match="'lidar' is not one of 'points'"),
    ):
        recorder.record("lidar", b"", 1)


def test_a_disk_that_cannot_follow_costs_messages_but_no_time(tmp_path, monkeypatch):
    """The writer is held; `record` must come back and count what it could not keep."""
    free, write = threading.Event(), BagWriter.write

    def slow(self, *message):
        free.wait()
        write(self, *message)

    monkeypatch.setattr(BagWriter, "write", slow)
    settings = RecorderSettings(queue_mb=0.01, flush_s=0.001)
    recorder = Recorder(tmp_path / "bag", "wamv1", {}, settings)
    for number in range(100):
        recorder.record("points", bytes(1000), number)
    free.set()
    recorder.close()
    kept = len(inputs(tmp_path))
    assert kept == 10
    assert recorder.dropped == 100 - kept


def test_a_failing_disk_is_told_and_everything_after_it_counted(tmp_path, monkeypatch):
    failed = threading.Event()

    def full(self, *message):
        failed.set()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(BagWriter, "write", full)
    recorder = Recorder(tmp_path / "bag", "wamv1", {}, RecorderSettings(flush_s=0.001))
    recorder.record("goal", b"a", 1)
    assert failed.wait(20)
    with pytest.raises(RecordingError, match="No space left on device"):
        recorder.close()
    recorder.record("goal", b"b", 2)
    assert "No space left" in recorder.failure
    assert recorder.dropped == 2


def test_in_lock_step_a_failing_disk_stops_the_run(tmp_path, monkeypatch):
    def full(self, *message):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(BagWriter, "write", full)
    recorder = Recorder(tmp_path / "bag", "wamv1", {}, lossless=True)
    with pytest.raises(RecordingError, match="No space left on device"):
        recorder.record("goal", b"a", 1)
    recorder.close()


def test_files_change_by_size_and_age_and_the_order_holds(tmp_path):
    settings = RecorderSettings(rotate_mb=0.1, rotate_s=1.0)
    with Recorder(tmp_path / "bag", "wamv1", {"a": 1}, settings, lossless=True) as recorder:
        for number in range(30):
            recorder.record("points", bytes(20_000), number * 10 * MS)
        for number in range(12):
            recorder.record("goal", b"%d" % number, 1_000 * MS + number * 300 * MS)
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert 7 <= len(files) <= 11
    messages = inputs(tmp_path)
    assert len(messages) == 42
    assert [m[2] for m in messages] == sorted(m[2] for m in messages)
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 42


def test_the_oldest_files_go_when_the_quota_is_used_up(tmp_path):
    settings = RecorderSettings(rotate_mb=0.1, quota_mb=0.3)
    with Recorder(tmp_path / "bag", "wamv1", {}, settings, lossless=True) as recorder:
        for number in range(100):
            recorder.record("points", bytes(20_000), 1 + number)
    size = sum(file.stat().st_size for file in (tmp_path / "bag").glob("*.mcap"))
    assert size < 0.5e6
    times = [time_ns for _, _, time_ns in inputs(tmp_path)]
    assert times == list(range(times[0], 101))
    assert times[0] > 50


def test_a_finished_file_that_is_moved_away_does_not_end_the_recording(tmp_path):
    bag, elsewhere = tmp_path / "bag", tmp_path / "elsewhere"
    elsewhere.mkdir()
    settings = RecorderSettings(rotate_mb=0.1, quota_mb=0.3)
    with Recorder(bag, "wamv1", {}, settings, lossless=True) as recorder:
        for number in range(100):
            recorder.record("points", bytes(20_000), 1 + number)
            if number in (20, 40, 60):
                first = min(bag.glob("*.mcap"), key=lambda file: file.stat().st_mtime_ns)
                first.rename(elsewhere / first.name)
    assert len(list(elsewhere.iterdir())) == 3
    assert inputs(bag)[-1][2] == 100
    with Reader(bag) as reader:  # its metadata name no file that is not there
        assert reader.message_count == len(inputs(bag))


def test_a_folder_that_becomes_unreadable_is_told_and_not_a_traceback(tmp_path):
    bag = tmp_path / "bag"
    recorder = Recorder(bag, "wamv1", {}, RecorderSettings(rotate_mb=0.01), lossless=True)
    recorder.record("points", bytes(20_000), 1)
    shutil.rmtree(bag)
    with pytest.raises(RecordingError, match="bag"):
        recorder.record("points", bytes(20_000), 2)


def test_memory_does_not_grow_with_the_files_that_are_closed(tmp_path):
    """Four megabytes in twenty files: their indices would be 0.3 MB (measured)."""
    settings = RecorderSettings(rotate_mb=0.2)
    sizes = []
    with Recorder(tmp_path / "bag", "wamv1", {}, settings, lossless=True) as recorder:
        tracemalloc.start()
        try:
            for number in range(4_000):
                recorder.record("odometry", bytes(1_000), 1 + number)
                if number % 1_000 == 999:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert sizes[-1] - sizes[0] < 100_000, sizes


KILLED = textwrap.dedent(
    """
    import sys, time
    from pathlib import Path
    from twinscrew.runtime.recording.recorder import Recorder

    recorder = Recorder(Path(sys.argv[1]), "wamv1", {"seed": 4})
    start_ns = time.time_ns()
    for number in range(10**9):
        recorder.record("odometry", number.to_bytes(8, "little") * 90, time.time_ns())
        if number % 2 == 0:
            recorder.record("points", bytes(40_000), time.time_ns())
        if number % 20 == 19:
            print(number, flush=True)
        time.sleep(0.01)
    """
)


def test_after_kill_9_all_but_the_last_second_can_be_read(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path / "bag")], stdout=subprocess.PIPE, text=True
    )
    try:
        for line in process.stdout:
            if int(line) > 150:
                break
        process.send_signal(signal.SIGKILL)
        last = max(int(line), *(int(more) for more in process.stdout), 0)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    (recording,) = find_recordings(tmp_path)
    assert not recording.whole
    assert recording.metadata["seed"] == 4
    messages = [m for m in recording.inputs() if m.topic == "odometry"]
    numbers = [int.from_bytes(m.payload[:8], "little") for m in messages]
    assert numbers == list(range(len(numbers)))
    # 100 messages a second: one second before the last word of the process must be there.
    assert len(numbers) > last - 100
