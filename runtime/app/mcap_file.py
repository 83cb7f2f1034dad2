"""Reads one MCAP file, whole or cut off."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO, Final, NamedTuple, cast

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from twinscrew.runtime.errors import RecordingError

MAGIC: Final = b"\x89MCAP0\r\n"
"""An MCAP file begins with it, and ends with it if it was finished."""
MAX_RECORD: Final = 1 << 30
"""[B] No record of ours comes near it; a longer one is an error, not an allocation."""

_DAMAGE: Final = (
    McapError,
    MemoryError,  # an absurd size of an uncompressed chunk
    OSError,  # a place before the beginning of the file
    ValueError,  # a checksum, a string that is not UTF-8, an unknown number
    LookupError,
    RuntimeError,  # lz4
    OverflowError,
    struct.error,
    zstandard.ZstdError,
)
"""What reading a damaged file raises, whoever notices."""


class BagMessage(NamedTuple):
    """A message of a bag."""

    name: str
    """Its topic's ROS name, as "/wamv1/goal"."""
    ros_type: str
    payload: bytes
    time_ns: int


class McapFile:
    """An MCAP file of ROS 2 messages.

    A file without its end (the recorder was killed) is read up to its last whole chunk.
    """

    def __init__(self, path: Path) -> None:
        """Look at a file.

        Raises
        ------
        RecordingError
            It cannot be opened or is not an MCAP file.
        """
        self.path = path
        try:
            with path.open("rb") as stream:
                begins = stream.read(len(MAGIC)) == MAGIC
                stream.seek(0, 2)
                stream.seek(max(0, stream.tell() - len(MAGIC)))
                ends = stream.read() == MAGIC
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from error
        if not begins:
            raise RecordingError(f"{path}: not an MCAP file")
        self.whole = ends and path.stat().st_size > len(MAGIC)
        """False if the file was cut off."""

    def metadata(self, name: str) -> dict[str, str] | None:
        """Give the first metadata record of a name, of those that stand before any message."""
        with self._damage():
            for record in self._records():
                if isinstance(record, Metadata) and record.name == name:
                    return dict(record.metadata)
                if isinstance(record, Message):
                    break
        return None

    def topics(self) -> dict[str, str]:
        """Give the types of its topics by their names: from its end, or by reading if it has none.

        Raises
        ------
        RecordingError
            The file is damaged.
        """
        with self._damage():
            schemas, channels = self._summary() if self.whole else self._described()
            return {
                channel.topic: schemas[channel.schema_id].name
                for channel in channels.values()
                if channel.schema_id in schemas
            }

    def messages(self) -> Iterator[BagMessage]:
        """Give the messages in the order of their times.

        Raises
        ------
        RecordingError
            The file is damaged.
        """
        with self._damage():
            yield from self._in_time_order() if self.whole else self._in_file_order()

    @contextmanager
    def _damage(self) -> Iterator[None]:
        """Turn what a damaged file raises into a `RecordingError`."""
        try:
            yield
        except _DAMAGE as error:
            what = str(error) or type(error).__name__
            raise RecordingError(f"{self.path}: damaged: {what}") from error

    def _summary(self) -> tuple[Mapping[int, Schema], Mapping[int, Channel]]:
        with self.path.open("rb") as stream:
            bounded = cast("IO[bytes]", _Bounded(stream))
            summary = SeekingReader(bounded, record_size_limit=MAX_RECORD).get_summary()
        if summary is None or not summary.channels:  # a writer may leave the summary out
            return self._described()
        return summary.schemas, summary.channels

    def _described(self) -> tuple[Mapping[int, Schema], Mapping[int, Channel]]:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
        return schemas, channels

    def _in_time_order(self) -> Iterator[BagMessage]:
        with self.path.open("rb") as stream:
            bounded = cast("IO[bytes]", _Bounded(stream))
            reader = SeekingReader(bounded, validate_crcs=True, record_size_limit=MAX_RECORD)
            for schema, channel, message in reader.iter_messages():
                yield _message(schema, channel, message)

    def _in_file_order(self) -> Iterator[BagMessage]:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                yield _message(schemas.get(channel.schema_id), channel, record)

    def _records(self) -> Iterator[McapRecord]:
        """Give records as they stand in the file, up to its end or where it was cut off."""
        with self.path.open("rb") as stream:
            bounded = cast("IO[bytes]", _Bounded(stream))
            reader = StreamReader(bounded, validate_crcs=True, record_size_limit=MAX_RECORD)
            try:
                yield from reader.records
            except EndOfFile:
                if self.whole:
                    raise


class _Bounded:
    """A stream that ends where its file ends: mcap's reader believes every length it reads."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._size = os.fstat(stream.fileno()).st_size
        self.seek = stream.seek
        self.tell = stream.tell

    def read(self, size: int = -1) -> bytes:
        if size > self._size - self._stream.tell():
            raise EndOfFile
        return self._stream.read(size)


def _message(schema: Schema | None, channel: Channel, message: Message) -> BagMessage:
    ros_type = "" if schema is None else schema.name
    return BagMessage(channel.topic, ros_type, message.data, message.log_time)
