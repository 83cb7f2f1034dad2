import lz4.frame
import pytest
import zstandard
from mcap.records import Chunk

from twinscrew.runtime.recording.files import MAX_SIZE, plain, records_of

COMPRESS = {"": bytes, "zstd": zstandard.compress, "lz4": lz4.frame.compress}


def chunk(compression, data, size):
    return Chunk(
        compression=compression,
        data=data,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=size,
    )


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_becomes_far_larger_than_it_says_is_refused_and_never_made(compression):
    bomb = COMPRESS[compression](bytes(50_000_000))
    with pytest.raises(ValueError, match="not the 1000 bytes"):
        records_of(chunk(compression, bomb, 1000))


@pytest.mark.parametrize("compression", list(COMPRESS))
def test_a_chunk_that_says_too_large_a_size_is_refused(compression):
    with pytest.raises(ValueError, match=f"allowed: {MAX_SIZE}"):
        records_of(chunk(compression, b"", MAX_SIZE + 1))


def test_a_compression_that_nobody_knows_is_named_with_those_that_are():
    with pytest.raises(ValueError, match="'snappy' is not one of '', 'zstd', 'lz4'"):
        records_of(chunk("snappy", b"", 0))


def test_a_message_that_was_compressed_by_itself_comes_back_plain():
    payload = b"\x00\x01\x00\x00" + bytes(range(200))
    unsized = zstandard.ZstdCompressor(write_content_size=False).compress(payload)
    assert plain(payload) == plain(zstandard.compress(payload)) == plain(unsized) == payload


def test_a_message_that_would_become_too_large_is_refused():
    frame = bytearray(zstandard.compress(bytes(70_000)))
    frame[4] = 0b11100000  # the frame's content size takes 8 bytes: RFC 8878, 3.1.1.1
    frame[5:9] = (MAX_SIZE + 1).to_bytes(8, "little")
    with pytest.raises(ValueError, match="allowed"):
        plain(bytes(frame))
