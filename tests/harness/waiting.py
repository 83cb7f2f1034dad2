"""Waits for what other processes do, as long as they need: no test depends on speed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

GIVE_UP_S = 200
"""[s] Not a limit of what is tested, only an end to waiting for what never comes."""
POLL_S = 0.02

T = TypeVar("T")


def wait_until(look: Callable[[], T | None]) -> T:
    """Give what `look` gives as soon as that is true."""
    until_s = time.monotonic() + GIVE_UP_S
    while time.monotonic() < until_s:
        found = look()
        if found:
            return found
        time.sleep(POLL_S)
    raise AssertionError(f"{look} did not come true in {GIVE_UP_S} s")
