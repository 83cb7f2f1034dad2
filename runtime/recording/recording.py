"""Reads recordings back: our own, and bags made elsewhere.

A recording is a folder of one vessel's bag files, or one such file. A run's folder holds several.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import msgspec

from twinscrew.runtime.errors import NOT_THE_FORMAT, RecordingError, one_of
from twinscrew.runtime.messages.topics import CORE_INPUTS, TOPICS
from twinscrew.runtime.recording.files import BagMessage, McapFile, Rosbag
from twinscrew.runtime.recording.writer import METADATA_RECORD
from twinscrew.runtime.settings import Settings, load

PATTERNS: Final = ("*.mcap", "*.db3", "*.mcap.zstd", "*.db3.zstd")
"""Names of the files of a bag."""
ROSBAG_SUFFIXES: Final = (".db3", ".zstd")
"""Of files that are read by way of their folder's metadata."""


class TopicMapping(Settings, frozen=True):
    """What the topics of a bag made elsewhere are to us: a TOML file."""

    topics: dict[str, str]
    """Names of `TOPICS` by names in the bag: "/velodyne_points" = "points"."""

    def __post_init__(self) -> None:
        for name in self.topics.values():
            if name not in TOPICS:
                raise ValueError(one_of(name, TOPICS))


class Recorded(NamedTuple):
    """A message as it was recorded."""

    topic: str
    """A name of `TOPICS`."""
    payload: bytes
    time_ns: int
    """[ns] The log's time."""


class Source(Protocol):
    """A file or folder that messages can be read from."""

    @property
    def whole(self) -> bool:
        """False if the file was cut off."""

    def metadata(self, name: str) -> dict[str, str] | None:
        """Give a metadata record, if there is one of that name."""

    def topics(self) -> Mapping[str, str]:
        """Give the types of the topics that it holds, by their ROS names."""

    def messages(self) -> Iterator[BagMessage]:
        """Give the messages in the order of their times."""


@dataclass(frozen=True, slots=True)
class Recording:
    """One vessel's recording."""

    path: Path
    """Its folder, or its only file."""
    vessel: str
    metadata: Mapping[str, Any]
    """What the recorder was given; empty if somebody else recorded it."""
    names: Mapping[str, str]
    """Names of `TOPICS` by names in the bag; empty: they are guessed by name and type."""
    sources: tuple[Source, ...]
    missing: tuple[str, ...] = ()
    """What files that are no longer there held: its "beginning", or a "part" within."""

    @property
    def whole(self) -> bool:
        """False if the recorder was killed: the end is missing."""
        return all(source.whole for source in self.sources)

    @property
    def is_foreign(self) -> bool:
        """True if somebody else recorded it: it says nothing of configuration and policy."""
        return not self.metadata

    def has(self, topic: str) -> bool:
        """Tell whether it holds a topic of `TOPICS`, without reading its messages.

        Raises
        ------
        RecordingError
            The recording is damaged, or the topic's messages are of a wrong type.
        """
        return any(
            self._name(name, ros_type) == topic
            for source in self.sources
            for name, ros_type in source.topics().items()
        )

    def messages(self, topics: Collection[str] = tuple(TOPICS)) -> Iterator[Recorded]:
        """Give the messages of some topics, in the order of their times.

        Raises
        ------
        RecordingError
            The recording is damaged, holds none of the topics, or messages of a wrong type.
        """
        seen: dict[str, str | None] = {}
        for source in self.sources:
            for message in source.messages():
                if message.name not in seen:
                    seen[message.name] = self._name(message.name, message.ros_type)
                name = seen[message.name]
                if name is not None and name in topics:
                    yield Recorded(name, message.payload, message.time_ns)
        if seen and not set(seen.values()) & set(topics):
            what = f"none of {sorted(topics)}, only {sorted(seen)}"
            raise RecordingError(f"{self.path}: {what}; a mapping can say what they are")

    def inputs(self) -> Iterator[Recorded]:
        """Give what the core took in; errors as `messages`."""
        return self.messages(CORE_INPUTS)

    def decisions(self) -> Iterator[bytes]:
        """Give the encoded decisions; errors as `messages`."""
        return (message.payload for message in self.messages(("decision",)))

    def _name(self, ros_name: str, ros_type: str) -> str | None:
        if not self.names:
            return _guess(ros_name, ros_type)
        name = self.names.get(ros_name)
        if name is not None and TOPICS[name].ros_type != ros_type:
            expected = TOPICS[name].ros_type
            what = f"{ros_name} holds {ros_type}, but {name} is {expected}"
            raise RecordingError(f"{self.path}: {what}")
        return name


def find_recordings(path: Path, mapping: Path | None = None) -> list[Recording]:
    """Find the recordings in a run's folder, a bag's folder or one file, by name.

    Parameters
    ----------
    mapping
        A TOML file (`TopicMapping`) for bags made elsewhere. Without it, topics of such bags are
        recognised by the names and types of `TOPICS` under any namespace.

    Raises
    ------
    RecordingError
        There is none, or one of them is not a recording.
    ConfigError
        The mapping cannot be used.
    """
    names = {} if mapping is None else load(mapping, TopicMapping).topics
    if path.is_file():
        return [_recording(path, [path], names)]
    if not path.is_dir():
        raise RecordingError(f"{path}: no such file or folder")
    files = [file for pattern in PATTERNS for file in path.rglob(pattern) if file.is_file()]
    if not files:
        raise RecordingError(f"{path}: holds no recording ({', '.join(PATTERNS)})")
    folders = sorted({file.parent for file in files})
    return [
        _recording(folder, [file for file in files if file.parent == folder], names)
        for folder in folders
    ]


def read_inputs(path: Path, mapping: Path | None = None) -> Iterator[Recorded]:
    """Give what the core took in of the only recording at a path; errors as `find_recordings`."""
    recordings = find_recordings(path, mapping)
    if len(recordings) > 1:
        vessels = ", ".join(recording.vessel for recording in recordings)
        raise RecordingError(f"{path}: holds several recordings ({vessels}): choose one")
    return recordings[0].inputs()


class DecisionHash:
    """The hash of a run, made as it goes: SHA-256 over encoded decisions, each after its length."""

    def __init__(self) -> None:
        self._digest = hashlib.sha256()

    def add(self, encoded: bytes) -> None:
        """Take in the next decision."""
        self._digest.update(len(encoded).to_bytes(8, "little"))
        self._digest.update(encoded)

    def hexdigest(self) -> str:
        """Give the hash of what was taken in, in 64 hexadecimal digits."""
        return self._digest.hexdigest()


def decisions_sha256(encoded: Iterable[bytes]) -> str:
    """Give the hash of a run's encoded decisions (`DecisionHash`)."""
    run = DecisionHash()
    for payload in encoded:
        run.add(payload)
    return run.hexdigest()


def _recording(path: Path, files: list[Path], names: Mapping[str, str]) -> Recording:
    sources: tuple[Source, ...]
    if any(file.suffix in ROSBAG_SUFFIXES for file in files):
        sources = (Rosbag(path),)
    else:
        sources = tuple(McapFile(file) for file in sorted(files, key=_number))
    metadata = _metadata(path, sources[0])
    vessel = str(metadata.get("vessel", path.stem))
    if not names:
        names = {ros: name for name, ros in metadata.get("topics", {}).items() if name in TOPICS}
    missing = _missing(files) if metadata else ()
    return Recording(path, vessel, metadata, names, sources, missing)


def _missing(files: list[Path]) -> tuple[str, ...]:
    """Say what is not there of a recording of ours: its files are numbered from 0."""
    numbers = sorted(_number(file)[0] for file in files)
    beginning = ("beginning",) if numbers[0] > 0 else ()
    return (*beginning, "part") if numbers[-1] - numbers[0] >= len(numbers) else beginning


class _Said(msgspec.Struct, frozen=True):
    """What the metadata of one of our recordings say, as far as it is used."""

    vessel: str = ""
    topics: dict[str, str] = {}
    config: dict[str, Any] = {}
    policy_sha256: str = ""


def _metadata(path: Path, source: Source) -> dict[str, Any]:
    try:
        values = {k: json.loads(v) for k, v in (source.metadata(METADATA_RECORD) or {}).items()}
        msgspec.convert(values, _Said)
    except NOT_THE_FORMAT as error:
        raise RecordingError(f"{path}: its metadata are damaged: {error}") from error
    return values


def _number(file: Path) -> tuple[int, str]:
    """Order a bag's files: rosbag2 and we end their names with a number."""
    match = re.search(r"_(\d+)$", file.stem)
    return (int(match[1]) if match else 0, file.name)


def _guess(ros_name: str, ros_type: str) -> str | None:
    """Recognise a topic by the end of its name and its type."""
    return next(
        (
            topic.name
            for topic in TOPICS.values()
            if ros_type == topic.ros_type
            and f"/{ros_name}".endswith(f"/{topic.key.removeprefix('/')}")
        ),
        None,
    )
