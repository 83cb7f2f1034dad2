"""Reads a rosbag2 in SQLite, as ROS 2 Humble records by default."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from twinscrew.runtime.app.mcap_file import BagMessage
from twinscrew.runtime.errors import RecordingError

if TYPE_CHECKING:
    from rosbags.rosbag2 import Reader


class SqliteBag:
    """A folder with `metadata.yaml` and `*.db3` files."""

    whole = True

    def __init__(self, path: Path) -> None:
        self._path = path if path.is_dir() else path.parent

    def metadata(self, name: str) -> None:  # noqa: ARG002
        """Say that there is no metadata of ours."""
        return

    def topics(self) -> dict[str, str]:
        """Give the types of its topics by their names; a `RecordingError` if it is damaged."""
        with self._open() as reader:
            return {connection.topic: connection.msgtype for connection in reader.connections}

    def messages(self) -> Iterator[BagMessage]:
        """Give the messages in the order of their times; a `RecordingError` if it is damaged."""
        with self._open() as reader:
            for connection, time_ns, payload in reader.messages():
                yield BagMessage(connection.topic, connection.msgtype, payload, time_ns)

    @contextmanager
    def _open(self) -> Iterator[Reader]:
        from rosbags.rosbag2 import Reader, ReaderError

        try:
            with Reader(self._path) as reader:
                yield reader
        except (ReaderError, OSError) as error:
            raise RecordingError(f"{self._path}: {error}") from error
