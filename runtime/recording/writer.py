"""Writes a rosbag2 in MCAP that a crash cannot take away.

A message is in the file, as far as the system is concerned, after `flush` and the end of its
chunk. Chunks are small and files change by size and age, so that `kill -9` costs less than a
second; a file that was cut off is still read up to its last chunk. (rosbags' own writer keeps
1 MiB chunks and an unflushed buffer, and its reader refuses a file without its end.)
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

from mcap.writer import CompressionType, Writer

from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.files import replace_file
from twinscrew.runtime.messages.topics import TOPICS, definition, ros_name, type_hash
from twinscrew.runtime.recording.settings import BagSettings

METADATA_RECORD: Final = "twinscrew"
"""Name of the MCAP metadata record that says what the recording is of; values are JSON."""
METADATA_FILE: Final = "metadata.yaml"

VERSION: Final = 5
"""Of `metadata.yaml`."""
KEEP_LAST, RELIABLE, TRANSIENT_LOCAL, VOLATILE, AUTOMATIC = 1, 1, 1, 2, 1
"""Numbers of rmw (rmw/types.h)."""
FOREVER: Final = {"sec": 9223372036, "nsec": 854775807}

_COMPRESSIONS: Final = {
    "none": CompressionType.NONE,
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
}


@dataclass(slots=True)
class _File:
    """One file of the bag."""

    path: Path
    stream: BinaryIO
    writer: Writer
    contents: FileContents
    channels: dict[str, int] = field(default_factory=dict)


class _Finished(NamedTuple):
    """A file that is closed: without its writer, which holds an index of every chunk."""

    path: Path
    contents: FileContents


class BagWriter:
    """A folder of MCAP files of one vessel, with `metadata.yaml`. For one thread."""

    def __init__(
        self,
        path: Path,
        vessel: str,
        metadata: Mapping[str, Any],
        settings: BagSettings | None = None,
    ) -> None:
        """Begin a bag.

        Raises
        ------
        RecordingError
            The folder exists and holds something, or cannot be written to.
        """
        self._path, self._vessel = path, vessel
        self._settings = settings or BagSettings()
        names = {name: ros_name(topic, vessel) for name, topic in TOPICS.items()}
        self._names = names
        self._metadata = {
            key: json.dumps(value)
            for key, value in {**metadata, "vessel": vessel, "topics": names}.items()
        }
        self._closed: list[_Finished] = []
        self._last_ns = 0
        self._number = 0
        try:
            path.mkdir(parents=True, exist_ok=True)
            if any(path.iterdir()):
                raise RecordingError(f"{path}: exists and is not empty")
            self._file = self._open()
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from error

    def write(self, topic: str, payload: bytes, time_ns: int) -> None:
        """Add a message; times are made strictly increasing, so that the order is kept."""
        time_ns = max(time_ns, self._last_ns + 1)
        self._last_ns = time_ns
        if self._is_full(self._file, time_ns):
            self._finish(self._file)
            self._keep_quota()
            self._file = self._open()
        file, contents = self._file, self._file.contents
        channel = file.channels.get(topic) or self._add_channel(file, topic)
        contents.first_ns = contents.first_ns or time_ns
        contents.last_ns = time_ns
        contents.counts[topic] += 1
        file.writer.add_message(channel, time_ns, payload, time_ns, contents.counts[topic])

    def flush(self) -> None:
        """Hand everything of finished chunks to the system."""
        self._file.stream.flush()

    def close(self) -> None:
        """Finish the last file and write the bag's metadata."""
        self._finish(self._file)
        self._write_metadata_file()

    def abort(self) -> None:
        """Leave the last file as it is on the disk."""
        with suppress(OSError):
            self._file.stream.close()

    def _open(self) -> _File:
        path = self._path / f"{self._path.name}_{self._number}.mcap"
        self._number += 1
        stream = path.open("xb")
        writer = Writer(
            stream,
            chunk_size=self._settings.chunk_kb * 1024,
            compression=_COMPRESSIONS[self._settings.compression],
        )
        writer.start(profile="ros2", library="twinscrew")
        writer.add_metadata(METADATA_RECORD, self._metadata)
        return _File(path, stream, writer, FileContents(path.name))

    def _add_channel(self, file: _File, topic: str) -> int:
        ros_type = TOPICS[topic].ros_type
        text = definition(ros_type).encode()
        schema = file.writer.register_schema(ros_type, "ros2msg", text)
        qos = {"offered_qos_profiles": ""}
        channel = file.writer.register_channel(self._names[topic], "cdr", schema, qos)
        file.channels[topic] = channel
        return channel

    def _is_full(self, file: _File, time_ns: int) -> bool:
        first_ns = file.contents.first_ns or time_ns
        old = time_ns - first_ns > self._settings.rotate_s * 1e9
        return old or file.stream.tell() > self._settings.rotate_mb * 1e6

    def _finish(self, file: _File) -> None:
        file.writer.finish()  # type: ignore[no-untyped-call]
        file.stream.close()
        self._closed.append(_Finished(file.path, file.contents))

    def _keep_quota(self) -> None:
        """Delete the oldest files while all together are too large; some may be gone already."""
        sizes = [_size(file.path) for file in self._closed]
        while len(sizes) > 1 and sum(sizes) > self._settings.quota_mb * 1e6:
            with suppress(OSError):  # a file that cannot be deleted is no reason to record no more
                self._closed.pop(0).path.unlink()
            sizes.pop(0)

    def _write_metadata_file(self) -> None:
        here = [file for file in self._closed if file.path.exists()]
        contents = [file.contents for file in here or self._closed[-1:]]
        text = metadata_yaml(contents, self._names, self._metadata)
        replace_file(self._path / METADATA_FILE, lambda out: out.write(text.encode()))


def _size(path: Path) -> int:
    """Give a file's size [bytes]; 0 if it is no longer there, or cannot be looked at."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


# -- What rosbag2 wants to know of a bag: the content of its `metadata.yaml`.
#
# In version 5, which is Humble's: Humble reads no list of qualities of service, as later versions
# have it, and everybody since reads version 5. The keys that came later are there, too.


@dataclass(slots=True)
class FileContents:
    """What is in one file of a bag."""

    name: str
    """Its name within the bag's folder."""
    counts: Counter[str] = field(default_factory=Counter)
    """Messages of each topic."""
    first_ns: int = 0
    last_ns: int = 0
    """[ns] Times of its first and last message."""


def metadata_yaml(
    files: Sequence[FileContents], names: Mapping[str, str], custom: Mapping[str, str]
) -> str:
    """Give the text of `metadata.yaml`: JSON, which is YAML.

    Parameters
    ----------
    files
        At least one, in the order of their times.
    names
        The ROS names of the topics.
    custom
        What else to say.
    """
    whole = FileContents(
        name="",
        counts=sum((file.counts for file in files), Counter()),
        first_ns=files[0].first_ns,
        last_ns=files[-1].last_ns,
    )
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [file.name for file in files],
        **_span(whole),
        "topics_with_message_count": [
            {"topic_metadata": _topic(topic, names[topic]), "message_count": count}
            for topic, count in whole.counts.items()
        ],
        "compression_format": "",  # chunks are compressed within MCAP, not by rosbag2
        "compression_mode": "",
        "files": [{"path": file.name, **_span(file)} for file in files],
        "custom_data": dict(custom),
        "ros_distro": "jazzy",
    }
    return json.dumps({"rosbag2_bagfile_information": information}, indent=1) + "\n"


def _span(file: FileContents) -> dict[str, Any]:
    return {
        "starting_time": {"nanoseconds_since_epoch": file.first_ns},
        "duration": {"nanoseconds": file.last_ns - file.first_ns},
        "message_count": file.counts.total(),
    }


def _topic(topic: str, name: str) -> dict[str, Any]:
    ros_type, durable = TOPICS[topic].ros_type, TOPICS[topic].durable
    quality = {
        "history": KEEP_LAST,
        "depth": TOPICS[topic].depth,
        "reliability": RELIABLE,
        "durability": TRANSIENT_LOCAL if durable else VOLATILE,
        "deadline": FOREVER,
        "lifespan": FOREVER,
        "liveliness": AUTOMATIC,
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return {
        "name": name,
        "type": ros_type,
        "serialization_format": "cdr",
        "offered_qos_profiles": json.dumps([quality]),
        "type_description_hash": type_hash(ros_type),
    }
