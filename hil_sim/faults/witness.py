"""Who looks at the boat from outside: its propellers, its autopilot, what it says in public."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

import numpy as np

from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.hil_sim.faults.timeline import Span, Timeline, spans
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.link.ardupilot.thrust import STOP_US, paddles
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, HealthEvent

DRIVES = ("active", "degraded")
"""States in which the decisions are the boat's."""
SIDES = ((0, 1), (0, -1), (1, 1), (1, -1))
"""Each propeller, ahead and astern."""
UNDER_WAY_M_S = 0.5
"""[m/s] Faster than this a vessel moves 5 cm between two scans of 10 Hz: it is seen to move."""
_LINK = AutopilotSettings()

Directions = tuple[int, int]
"""What a decision asks of the propellers, left and right: 1 ahead, -1 astern, 0 nothing."""


class Witness:
    """Remembers of one vessel what changed, and when [s] by the system's monotonic clock."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.turns = Timeline(False)
        """Whether the propellers are asked to turn."""
        self.moves = Timeline(False)
        """Whether the vessel moves, faster than `UNDER_WAY_M_S`."""
        self.bridge = Timeline(Bridge("", armed=False))
        """What the autopilot shows."""
        self.asks: Timeline[Directions] = Timeline((0, 0))
        """What the decisions ask of the propellers."""
        self.state = Timeline("")
        """The state that the boat says it is in, as "safe"; empty before it said so."""
        self.events: list[tuple[float, HealthEvent]] = []
        """What the runtime said on `diagnostics`, when it came over the bus."""
        self.decided: list[float] = []
        """[s] When decisions came over the bus."""
        self._clock = clock

    def look(self, thrust_N: Float64, bridge: Bridge, speed_m_s: float) -> None:
        """See what the autopilot asks of the propellers, (2,) [N], and how fast the vessel is."""
        now_s = self._clock()
        self.moves.note(now_s, speed_m_s > UNDER_WAY_M_S)
        self.turns.note(now_s, bool(np.any(thrust_N != 0.0)))
        self.bridge.note(now_s, bridge)

    def hear(self, message: Received) -> None:
        """Take health events from the bus; in its thread."""
        with suppress(MessageError):
            now_s = self._clock()
            for event in cdr.decode_diagnostics(message.payload):
                self.events.append((now_s, event))
                if event.name in ("state", "state_now"):
                    self.state.note(now_s, event.detail.split(" -> ")[-1])

    def read(self, message: Received) -> None:
        """Take a decision from the bus; in its thread."""
        with suppress(MessageError):
            now_s = self._clock()
            self.asks.note(now_s, directions(cdr.decode_decision(message.payload).thrust))
            self.decided.append(now_s)

    def turning(self, at_s: float) -> bool:
        """Tell whether the propellers turned at a time."""
        return self.turns.at(at_s)

    def under_way(self, at_s: float) -> bool:
        """Tell whether the vessel moved at a time, by its propellers."""
        return self.turns.at(at_s) and self.moves.at(at_s)

    def rests(self, begin_s: float, end_s: float) -> list[Span]:
        """Give when the propellers stood still, between two times."""
        return spans(lambda t: not self.turns.at(t), (self.turns,), begin_s, end_s)

    def stops(self, begin_s: float, end_s: float) -> list[Span]:
        """Give when they stood still and the boat had not decided so."""
        lines = (self.turns, self.state, self.asks)
        return spans(lambda t: not (self.turns.at(t) or self._chose(t)), lines, begin_s, end_s)

    def sails_from(self, begin_s: float) -> float | None:
        """Give when [s] the boat sailed first from a time on; None: never.

        Its propellers turn, or it drives and a decision of that time asks for nothing.
        """
        if self.turning(begin_s):
            return begin_s
        turned_s = self.turns.changes(begin_s, np.inf)[:1]
        chose_s = [t for t in self.decided if t >= begin_s and self._chose(t)][:1]
        return min([*turned_s, *chose_s], default=None)

    def asked(self, begin_s: float, end_s: float) -> list[Span]:
        """Give when a propeller was asked to turn, and the same way all the time, in MANUAL."""
        lines = (self.asks, self.bridge)
        return [
            span
            for side, way in SIDES
            for span in spans(partial(self._asks, side, way), lines, begin_s, end_s)
        ]

    def heard(self, name: str, since_s: float, says: str = "") -> float | None:
        """Give when [s] an event of this name, with these words, came first since; None: never."""
        return next(
            (t for t, e in self.events if e.name == name and t >= since_s and says in e.detail),
            None,
        )

    def states(self, begin_s: float, end_s: float) -> set[str]:
        """Give the states that the boat said it was in between two times, as "safe"."""
        times = [begin_s, *self.state.changes(begin_s, end_s)]
        return {self.state.at(t) for t in times} - {""}

    def _chose(self, at_s: float) -> bool:
        return self.state.at(at_s) in DRIVES and self.asks.at(at_s) == (0, 0)

    def _asks(self, side: int, way: int, at_s: float) -> bool:
        bridge = self.bridge.at(at_s)
        ready = bridge.armed and bridge.mode == Mode.MANUAL.name
        return ready and self.asks.at(at_s)[side] == way


def directions(thrust_N: Float64) -> Directions:
    """Give which way a thrust, (2,) [N], turns the propellers; less than is told apart is nothing.

    The link cannot tell outputs from stop that are nearer to it than its tolerance.
    """
    off_us = np.array(paddles(thrust_N, _LINK.paddles)) - STOP_US
    left, right = np.where(np.abs(off_us) > _LINK.obey_tolerance_us, np.sign(off_us), 0)
    return int(left), int(right)
