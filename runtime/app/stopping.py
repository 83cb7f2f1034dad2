"""A request to stop, as a signal's handler may make it."""

from __future__ import annotations


class StopRequest:
    """Is made once, and stays.

    It is no `threading.Event`: setting that takes a lock, and a second signal, whose handler runs
    in the middle of the first one's, would wait for ever for the lock which that one holds.
    """

    def __init__(self) -> None:
        self._is_made = False

    def make(self, *_signal: object) -> None:
        """Ask to stop; also as a signal's handler, and from any thread."""
        self._is_made = True

    def __call__(self) -> bool:
        """Tell whether somebody asked to stop."""
        return self._is_made
