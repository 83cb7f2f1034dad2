"""The recorder: everything that decides a run, in the order in which it was taken in."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from twinscrew.runtime.errors import RecordingError, one_of
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.recording.settings import RecorderSettings
from twinscrew.runtime.recording.writer import BagWriter

_SOFTWARE: Final = ("twinscrew", "numpy", "scipy", "filterpy", "onnxruntime", "eclipse-zenoh")
"""What a decision's bits may depend on."""


class Recorder:
    """Writes a vessel's recording from a thread of its own; the loop never waits for the disk.

    With `lossless`, `record` itself writes and nothing is ever dropped: for lock-step, where time
    waits. `record` is for one thread.
    """

    def __init__(
        self,
        path: Path,
        vessel: str,
        metadata: Mapping[str, Any],
        settings: RecorderSettings | None = None,
        *,
        lossless: bool = False,
    ) -> None:
        """Begin a recording.

        Parameters
        ----------
        path
            The bag's folder; made if it is not there.
        vessel
            The vessel's namespace, as "wamv1".
        metadata
            What a replay must know, as values that JSON can hold: configuration, hash of the
            policy, seeds. Versions of the software are added.

        Raises
        ------
        RecordingError
            The folder is not empty or cannot be written to.
        """
        self._settings = settings or RecorderSettings()
        self._bag = BagWriter(path, vessel, {"software": software(), **metadata}, self._settings)
        self._queue: deque[tuple[str, bytes, int]] = deque()
        # Each counter is written by one thread only, so that no lock is needed.
        self._bytes_in = self._bytes_out = 0
        self._dropped = self._lost = 0
        self._failure: str | None = None
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        if not lossless:
            self._thread = threading.Thread(target=self._work, name="recorder", daemon=True)
            self._thread.start()

    def record(self, topic: str, payload: bytes, time_ns: int) -> None:
        """Record a message of a topic of `TOPICS`.

        Parameters
        ----------
        time_ns
            [ns] The log's time; raised where it does not increase.

        Raises
        ------
        RecordingError
            There is no such topic; or, with `lossless`, it cannot be written.
        """
        if topic not in TOPICS:
            raise RecordingError(f"topic {one_of(topic, TOPICS)}")
        if self._thread is None:
            self._write(topic, payload, time_ns)
            return
        waiting = self._bytes_in - self._bytes_out
        if self._failure is not None or waiting + len(payload) > self._settings.queue_mb * 1e6:
            self._dropped += 1
            return
        self._bytes_in += len(payload)
        self._queue.append((topic, payload, time_ns))

    @property
    def dropped(self) -> int:
        """How many messages are missing from the recording."""
        return self._dropped + self._lost

    @property
    def failure(self) -> str | None:
        """Why nothing is recorded any more (the disk is full, ...); None while all is well."""
        return self._failure

    def close(self) -> None:
        """Write what waits, and finish the bag.

        Raises
        ------
        RecordingError
            It could not be finished; what was flushed is readable.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        if self._failure is not None:
            raise RecordingError(self._failure)
        try:
            self._bag.close()
        except OSError as error:
            raise RecordingError(f"the recording cannot be finished: {error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _work(self) -> None:
        """Write what waits, again and again, until closed."""
        type_store()  # takes 0.1 s: now, and not while the first scans are worked on
        closing = False
        while not closing and self._failure is None:
            closing = self._closing.wait(self._settings.flush_s)
            self._drain()

    def _drain(self) -> None:
        try:
            while self._queue:
                topic, payload, time_ns = self._queue.popleft()
                self._write(topic, payload, time_ns)
                self._bytes_out += len(payload)
            self._bag.flush()
        except (RecordingError, OSError) as error:
            self._failure = str(error)
            self._lost += 1 + len(self._queue)
            self._queue.clear()
            self._bag.abort()

    def _write(self, topic: str, payload: bytes, time_ns: int) -> None:
        try:
            self._bag.write(topic, payload, time_ns)
        except OSError as error:
            raise RecordingError(f"the recording cannot go on: {error}") from error


def software() -> dict[str, str]:
    """Give the versions of what a decision's bits may depend on."""
    versions = {}
    for name in _SOFTWARE:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions
