"""Reads a rosbag2 in SQLite, as ROS 2 Humble records by default, or whose files are compressed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from twinscrew.runtime.app.mcap_file import BagMessage
from twinscrew.runtime.errors import RecordingError

if TYPE_CHECKING:
    from rosbags.rosbag2 import Reader

METADATA: Final = "metadata.yaml"


class Rosbag:
    """A folder with `metadata.yaml` and `*.db3`, `*.db3.zstd` or `*.mcap.zstd` files."""

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
                payload = bytes(memoryview(payload))  # a damaged one may be anything
                yield BagMessage(connection.topic, connection.msgtype, payload, int(time_ns))

    @contextmanager
    def _open(self) -> Iterator[Reader]:
        from rosbags.rosbag2 import Reader

        if not (self._path / METADATA).is_file():
            mended = f"`ros2 bag reindex {self._path}` makes one"
            raise RecordingError(f"{self._path}: has no {METADATA}: {mended}")
        try:
            with Reader(self._path) as reader:
                yield reader
        except Exception as error:  # rosbags, YAML, SQLite and Zstandard have no common one
            what = (str(error) or type(error).__name__).splitlines()[0]
            raise RecordingError(f"{self._path}: damaged: {what}") from error
