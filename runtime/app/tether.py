"""Lets a program end with whoever started it, however that one ended."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable

STANDARD_INPUT = 0


def at_end_of_input(do: Callable[[], object]) -> None:
    """Call something, in a thread of its own, when standard input ends.

    Who starts a program holds the other end of a pipe. It closes when that one ends, even if it
    is killed: nothing else tells of that.
    """
    threading.Thread(target=_wait, args=(do,), daemon=True, name="tether").start()


def _wait(do: Callable[[], object]) -> None:
    try:
        while os.read(STANDARD_INPUT, 4096):
            pass
    except OSError:
        pass  # closed already
    do()
