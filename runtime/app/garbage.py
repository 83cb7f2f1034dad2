"""Python's cyclic garbage collector, kept out of the loop's work.

It runs by itself in the middle of whatever allocates, for as long as the program has objects. Here
what start-up made is never looked at again, and what came since is collected once a second, right
after a tick, when nothing is due for a while.
"""

from __future__ import annotations

import gc
from types import TracebackType
from typing import Final, Self

EVERY_S: Final = 1.0
"""[s] Between two collections of what is young, and"""
OLD_EVERY: Final = 30
"""[-] after so many of those one of everything that came since the start."""
ALL: Final = 2
"""The collector's oldest generation."""


class Garbage:
    """A context in which the collector runs when it is told to; afterwards it is as before."""

    def __init__(self) -> None:
        self._due_s = 0.0
        self._collections = 0

    def __enter__(self) -> Self:
        self._enabled = gc.isenabled()
        gc.collect()
        gc.freeze()
        gc.disable()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        gc.unfreeze()
        if self._enabled:
            gc.enable()

    def collect(self, now_s: float) -> bool:
        """Collect if it is time to; tell whether it was."""
        if now_s < self._due_s:
            return False
        self._due_s = now_s + EVERY_S
        self._collections += 1
        gc.collect(ALL if self._collections % OLD_EVERY == 0 else 0)
        return True
