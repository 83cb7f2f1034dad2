"""How much work a call does, counted and not timed: the same on any machine, under any load.

And how much of it a property test asks for.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from types import FrameType


def calls_of(action: Callable[[], object]) -> int:
    """Count the calls, of Python's and of C's functions, that an action makes."""
    count = 0

    def note(frame: FrameType, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before, collects = sys.getprofile(), gc.isenabled()
    gc.disable()  # what a collection calls is not the action's
    sys.setprofile(note)
    try:
        action()
    finally:
        sys.setprofile(before)
        if collects:
            gc.enable()
    return count


def examples(count: int) -> int:
    """Give how many examples a property test plays that plays `count` at a landing."""
    return count * (10 if os.environ.get("HYPOTHESIS_PROFILE") == "wide" else 1)
