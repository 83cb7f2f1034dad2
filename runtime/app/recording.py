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
from typing import Any, Final, NamedTuple

from twinscrew.runtime.app.bag import METADATA_RECORD
from twinscrew.runtime.app.mcap_file import BagMessage, McapFile
from twinscrew.runtime.app.sqlite_bag import is_sqlite_bag, sqlite_messages
from twinscrew.runtime.errors import ConfigError, RecordingError, one_of
from twinscrew.runtime.messages.topics import CORE_INPUTS, TOPICS
from twinscrew.runtime.settings import Settings, load


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


@dataclass(frozen=True, slots=True)
class Recording:
    """One vessel's recording."""

    path: Path
    """Its folder, or its only file."""
    vessel: str
    metadata: Mapping[str, Any]
    """What the recorder was given; empty if somebody else recorded it."""
    whole: bool
    """False if the recorder was killed: the end of the last file is missing."""
    names: Mapping[str, str]
    """Names of `TOPICS` by names in the bag."""
    files: tuple[McapFile, ...]

    def messages(self, topics: Collection[str] = tuple(TOPICS)) -> Iterator[Recorded]:
        """Give the messages of some topics, in the order of their times.

        Raises
        ------
        RecordingError
            The recording is damaged, or a topic's messages are of a wrong type.
        """
        for message in self._all():
            name = self.names.get(message.name)
            if name in topics:
                _check_type(self.path, message, TOPICS[name].ros_type)
                yield Recorded(name, message.payload, message.time_ns)

    def inputs(self) -> Iterator[Recorded]:
        """Give what the core took in."""
        return self.messages(CORE_INPUTS)

    def decisions(self) -> Iterator[bytes]:
        """Give the encoded decisions."""
        return (message.payload for message in self.messages(("decision",)))

    def _all(self) -> Iterator[BagMessage]:
        if not self.files:
            yield from sqlite_messages(self.path)
        for file in self.files:
            yield from file.messages()
