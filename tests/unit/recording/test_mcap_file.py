"""MCAP files as any writer may write them."""

from itertools import product

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.recording.files import McapFile

TIMES = (3, 1, 2, 2, 0)
IN_ORDER = [
    (time, b"\x00\x01message %d" % number)
    for time, number in ((0, 4), (1, 1), (2, 2), (2, 3), (3, 0))
]
INDEXES = (IndexType.ALL, IndexType.NONE, IndexType.CHUNK, IndexType.MESSAGE)


def write(path, times=TIMES, **options):
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=60, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/said", "cdr", schema)
        for number, time in enumerate(times):
            writer.add_message(channel, time, b"\x00\x01message %d" % number, time, number)
        writer.finish()
    return McapFile(path)


def contents(file):
    return [(message.time_ns, message.payload) for message in file.messages()]


@pytest.mark.parametrize("compression", list(CompressionType))
def test_every_compression_is_read(tmp_path, compression):
    assert contents(write(tmp_path / "a.mcap", compression=compression)) == IN_ORDER


@pytest.mark.parametrize("index", INDEXES)
@pytest.mark.parametrize("chunked", [True, False])
def test_whatever_a_writer_may_leave_out_messages_come_by_time_and_topics_by_type(
    tmp_path, index, chunked
):
    choices = ("repeat_channels", "repeat_schemas", "use_statistics", "use_summary_offsets")
    for kept in product((True, False), repeat=len(choices)):
        options = dict(zip(choices, kept, strict=True))
        file = write(tmp_path / "a.mcap", index_types=index, use_chunking=chunked, **options)
        assert contents(file) == IN_ORDER, options
        assert file.topics() == {"/said": "std_msgs/msg/String"}, options


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE])
def test_a_payload_with_a_byte_changed_is_noticed_with_and_without_an_index(tmp_path, index):
    path = tmp_path / "a.mcap"
    write(path, index_types=index, compression=CompressionType.NONE)
    path.write_bytes(path.read_bytes().replace(b"message 2", b"message 7"))
    with pytest.raises(RecordingError, match="damaged: crc"):
        list(McapFile(path).messages())


def test_an_index_that_points_elsewhere_is_refused(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, times=(1,), compression=CompressionType.NONE)
    data = bytearray(path.read_bytes())
    begin = data.index((1).to_bytes(8, "little") * 2, data.rindex(b"std_msgs"))
    data[begin + 16] ^= 1  # of the chunk's place, after its times
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged"):
        list(McapFile(path).messages())
