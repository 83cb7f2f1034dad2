"""n-step transitions from what the vectorised environment says, without a loop over vessels."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32

Bool = NDArray[np.bool_]
Slots = NDArray[np.intp]


class Step(NamedTuple):
    """One step of M slots (a slot is a place for a vessel in an episode)."""

    observation: Float32
    """(M, 37) Packed observations that were acted on."""
    action: Float32
    """(M, 2) in [-1, 1]."""
    reward: Float32
    """(M,)"""
    terminated: Bool
    """(M,) Goal or collision: nothing follows."""
    truncated: Bool
    """(M,) Time is up: the return goes on beyond what was seen."""
    active: Bool
    """(M,) Slots that held a sailing vessel when the step began."""
    next_observation: Float32
    """(M, 37) After the step, before any reset."""


class NStep:
    """Joins consecutive steps of each slot to transitions over up to n steps.

    A start is given out when n steps have followed, or as soon as its trajectory ends: so every
    step that a vessel sailed becomes exactly one transition, except those still open.
    """

    def __init__(self, steps: int, discount: float, slots: int) -> None:
        self.discount = discount
        self._steps: deque[Step] = deque(maxlen=steps)
        self._length = np.zeros(slots, dtype=np.int64)

    def push(self, step: Step) -> tuple[Float32, Slots]:
        """Take one step; give the transitions that are now complete, (K, 78), and their slots."""
        self._steps.append(step)
        self._length = np.where(step.active, self._length + 1, 0)
        done = step.terminated | step.truncated
        going_on = np.where(step.terminated, 0.0, 1.0)
        reward = np.zeros(len(step.reward))
        complete: list[Float32] = []
        slots: list[Slots] = []
        for back, start in enumerate(reversed(self._steps)):
            reward = start.reward + self.discount * reward
            oldest = back + 1 == self._steps.maxlen
            ready = np.flatnonzero((self._length > back) & (done | oldest))
            parts: list[NDArray[Any]] = [
                start.observation[ready],
                start.action[ready],
                reward[ready, None],
                (self.discount ** (back + 1) * going_on)[ready, None],
                step.next_observation[ready],
            ]
            complete.append(np.concatenate(parts, axis=1, dtype=np.float32))
            slots.append(ready)
        self._length[done] = 0
        return np.concatenate(complete), np.concatenate(slots)
