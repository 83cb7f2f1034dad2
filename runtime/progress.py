"""Progress of long work where there is no terminal: lines for a log, in the place of a bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

EVERY_S = 10.0
"""[s] Between two lines."""


class ProgressLines:
    """Says how far the work is: at once, every ten seconds, and at the end."""

    def __init__(
        self,
        title: str,
        tell: Callable[[str], object] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Say nothing yet.

        Parameters
        ----------
        title
            Begins every line.
        tell
            Takes a line; without it standard error does.
        clock
            [s] Monotonic time.
        """
        self._title = title
        self._tell = tell or _to_standard_error
        self._clock = clock
        self._next_s = -float("inf")
        self._last = -1

    def update(self, done: int, total: int) -> None:
        """Note that so much of it is done; a line follows if it is time for one."""
        now_s = self._clock()
        if done == self._last or (now_s < self._next_s and done < total):
            return
        self._next_s, self._last = now_s + EVERY_S, done
        self._tell(f"{self._title}: {done} of {total}")


def _to_standard_error(words: str) -> None:
    print(words, file=sys.stderr, flush=True)
