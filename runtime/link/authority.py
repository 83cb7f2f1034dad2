"""Who has the boat: when we may ask for MANUAL and for arming. A pilot's choice always wins.

The rules, all of them:

1. MANUAL is ours. Any other mode is somebody else's.
2. At first contact we may ask for MANUAL if the boat is disarmed; an armed one is a pilot's.
3. If MANUAL turns into another mode, a pilot took the boat, and we ask no more until he gives it
   back by choosing MANUAL. The one exception to 2 and 3: HOLD that the autopilot's own radio
   failsafe chose (it says so), which we may leave again.
4. We arm at most once, if told to. A boat that was armed and is disarmed stays so.

An operator's explicit word (`ask_again`) starts over.
"""

from __future__ import annotations

import math
from enum import Enum

from twinscrew.runtime.link.modes import HOLD, INITIALISING, MANUAL

FAILSAFE_WINDOW_S = 3.0
"""[s] The failsafe's message and its mode change belong together if they come this near."""


class AskManual(Enum):
    """When the link may ask for MANUAL mode."""

    NEVER = "never"
    AT_START = "at_start"
    AFTER_FAILSAFE = "after_failsafe"
    """At the start, and when the radio failsafe chose HOLD."""


class Authority:
    """Remembers who has the boat; times are the caller's."""

    def __init__(self, ask_manual: AskManual, *, arm: bool) -> None:
        self._ask_manual = ask_manual
        self._arm = arm
        self.mode: int | None = None
        """The autopilot's mode; None before it told."""
        self.armed = False
        self.was_armed = False
        """True once the boat was armed: from then on disarming is somebody's decision."""
        self.taken = False
        """True while a pilot has the boat."""
        self.held = False
        """True while the radio failsafe's HOLD is on."""
        self._changed_s = self._failsafe_s = -math.inf

    def ask_again(self) -> None:
        """Start over, on an operator's word: ask for MANUAL and arm as at the start."""
        self.taken = self.held = False
        self.was_armed = self.armed

    @property
    def asks_manual(self) -> bool:
        """Whether to ask for MANUAL now."""
        if self.mode in (None, MANUAL) or self.taken or self._ask_manual is AskManual.NEVER:
            return False
        return not self.held or self._ask_manual is AskManual.AFTER_FAILSAFE

    @property
    def asks_arming(self) -> bool:
        """Whether to ask for arming now."""
        return self._arm and self.mode == MANUAL and not self.armed and not self.was_armed

    @property
    def drives(self) -> bool:
        """Whether thrust may act: armed, in MANUAL."""
        return self.armed and self.mode == MANUAL

    def heard(self, mode: int, armed: bool, now_s: float) -> None:
        """Take the mode and arming of a heartbeat."""
        before, self.mode = self.mode, mode
        self.note_armed(armed)
        if mode == MANUAL:
            self.taken = self.held = False
            if before != MANUAL:
                self._failsafe_s = -math.inf  # used up: it excuses one HOLD, not the next
        elif mode != before:
            self._changed_s = now_s
            self.held = mode == HOLD and self._failsafe_is_near()
            self.taken = not self.held and (armed or before not in (None, INITIALISING))

    def note_armed(self, armed: bool) -> None:
        """Take word that the boat is armed or not (a heartbeat, or the answer to arming)."""
        self.armed = armed
        self.was_armed = self.was_armed or armed

    def failsafe(self, now_s: float) -> None:
        """Take word of the radio failsafe; it may come before or after the mode change."""
        self._failsafe_s = now_s
        if self.mode == HOLD and self.taken and self._failsafe_is_near():
            self.held, self.taken = True, False

    def _failsafe_is_near(self) -> bool:
        if not math.isfinite(self._changed_s + self._failsafe_s):
            return False
        return abs(self._changed_s - self._failsafe_s) < FAILSAFE_WINDOW_S
