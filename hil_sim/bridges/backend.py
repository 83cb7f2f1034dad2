"""One ArduPilot's physics in lock-step: it asks for a frame, and waits until the world is there.

The simulator's world moves in steps of 10 ms and in real time; ArduPilot asks for 50 to 1200 frames
a second. Each frame moves ArduPilot's own time on by one frame's length, and is answered as soon as
the world has passed that time, from between its two last states. So no frame is ever guessed ahead,
and ArduPilot is never further than one frame behind the world.
"""

from __future__ import annotations

from twinscrew.hil_sim.bridges.ardupilot_json import (
    ServoFrame,
    decode_servos,
    encode_motion,
)
from twinscrew.hil_sim.bridges.inertial import Moment, motion_between

SHORTEST_S, LONGEST_S = 2e-4, 0.05
"""[s] Frames are at least and at most this long; ArduPilot takes no 0.1 s."""
_ROUNDING_S = 1e-9


class JsonBackend:
    """What answers one ArduPilot. Sans-IO: datagrams and moments in, datagrams out."""

    def __init__(self, now: Moment) -> None:
        """Begin with the vessel as it is now."""
        self.restarts = 0
        """[-] How often ArduPilot began to count anew."""
        self.malformed = 0
        """[-] Datagrams that were no servo frame."""
        self.pwm_us: tuple[int, ...] = ()
        """[us] What its outputs are; empty before it was heard."""
        self._before = self._after = now
        self._waiting: ServoFrame | None = None
        self._frame: int | None = None
        self._answer = b""
        self._time_s = self._began_s = now.time_s

    @property
    def heard(self) -> bool:
        """Whether ArduPilot was ever heard."""
        return bool(self.pwm_us)

    @property
    def caught_up(self) -> bool:
        """Whether nothing can happen until the world moves on: it waits for a later frame."""
        return not self.heard or (self._waiting is not None and not self._can_answer())

    def move(self, now: Moment) -> None:
        """Take the vessel's next moment."""
        self._before, self._after = self._after, now

    def receive(self, datagram: bytes) -> bool:
        """Take a datagram; False, and nothing has changed, if it is no servo frame."""
        frame = decode_servos(datagram)
        if frame is None:
            self.malformed += 1
            return False
        if self._frame is None or frame.count < self._frame:
            self._begin()
        self.pwm_us = frame.pwm_us
        self._waiting = frame
        return True

    def answer(self) -> bytes:
        """Give the answer to the frame that waits; empty if it must wait on, or none does."""
        frame = self._waiting
        if frame is None:
            return b""
        if frame.count == self._frame:  # asked again: the answer was lost, or came too late
            self._waiting = None
            return self._answer
        if not self._can_answer():
            return b""
        self._time_s += _length_s(frame)
        told_s = self._time_s - self._began_s
        at_s = min(max(self._time_s, self._before.time_s), self._after.time_s)
        self._answer = encode_motion(motion_between(self._before, self._after, at_s, told_s))
        self._frame, self._waiting = frame.count, None
        return self._answer

    def _can_answer(self) -> bool:
        frame = self._waiting
        if frame is None:
            return False
        due_s = self._time_s + _length_s(frame)
        return frame.count == self._frame or due_s <= self._after.time_s + _ROUNDING_S

    def _begin(self) -> None:
        """Start ArduPilot's time at zero, here and now: it has just been switched on."""
        self.restarts += self._frame is not None
        self._frame = None
        self._time_s = self._began_s = self._after.time_s


def _length_s(frame: ServoFrame) -> float:
    return min(LONGEST_S, max(SHORTEST_S, 1.0 / max(1, frame.rate_hz)))
