"""What a chunk of an MCAP file holds, however compressed, whatever it says of its size."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import IO, Any, BinaryIO, Final, cast

import zstandard
from mcap.exceptions import EndOfFile
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from twinscrew.runtime.errors import one_of

MAX_SIZE: Final = 1 << 30
"""[B] Nobody's records and chunks come near it; a longer one is an error, not an allocation."""
ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
"""A Zstandard frame begins with it (RFC 8878, 3.1.1); no message in CDR does."""


class Bounded:
    """A stream that ends where its file ends: mcap's reader believes every length it reads."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._size = os.fstat(stream.fileno()).st_size
        self.seek = stream.seek
        self.tell = stream.tell

    def read(self, size: int = -1) -> bytes:
        """Read as any stream does; `EndOfFile` if the file has fewer bytes."""
        if size > self._size - self._stream.tell():
            raise EndOfFile
        return self._stream.read(size)


def reader(stream: BinaryIO, *, whole: bool) -> StreamReader:
    """Read records, of a whole file or from here on."""
    return StreamReader(
        cast("IO[bytes]", Bounded(stream)),
        skip_magic=not whole,
        emit_chunks=True,
        validate_crcs=whole,
        record_size_limit=MAX_SIZE,
    )


def chunk_at(stream: BinaryIO, place: int) -> list[McapRecord]:
    """Give the records of the chunk at a place of a file; errors as `records_of`."""
    stream.seek(place)
    chunk = next(reader(stream, whole=False).records)
    if not isinstance(chunk, Chunk):
        raise ValueError(f"no chunk at byte {place}")
    return records_of(chunk)


def records_of(chunk: Chunk) -> list[McapRecord]:
    """Give the records of a chunk.

    Raises
    ------
    ValueError
        An unknown compression, a size that is not the data's or beyond `MAX_SIZE`, a wrong
        checksum. What else damage makes the libraries raise comes through.
    """
    if chunk.compression not in _DECOMPRESS:
        raise ValueError(f"compression {one_of(chunk.compression, _DECOMPRESS)}")
    data = _DECOMPRESS[chunk.compression](chunk.data, _allowed(chunk.uncompressed_size) + 1)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"a chunk is not the {chunk.uncompressed_size} bytes that it says")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def plain(payload: bytes) -> bytes:
    """Give a message that `ros2 bag record --compression-mode message` may have compressed."""
    if not payload.startswith(ZSTD_MAGIC):
        return payload
    size = _allowed(max(zstandard.frame_content_size(payload), 0)) or MAX_SIZE
    return _zstd(payload, size)


def _allowed(size: int) -> int:
    if size > MAX_SIZE:
        raise ValueError(f"{size} bytes uncompressed; allowed: {MAX_SIZE}")
    return size


def _zstd(data: bytes, most: int) -> bytes:
    return zstandard.ZstdDecompressor().stream_reader(data).read(most)


def _lz4(data: bytes, most: int) -> bytes:
    import lz4.frame

    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most))


def _as_it_is(data: bytes, most: int) -> bytes:  # noqa: ARG001
    return data


_DECOMPRESS: Final[dict[str, Callable[[Any, int], bytes]]] = {
    "": _as_it_is,
    "zstd": _zstd,
    "lz4": _lz4,
}
