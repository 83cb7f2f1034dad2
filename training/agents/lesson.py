"""What an update is made of: a lesson, and descents of losses that it defines.

A loss is a function of a lesson (a batch and the random numbers it is learnt with) and of the
networks' parameters alone: so several seeds can learn at once, their parameters stacked
(`stack.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor

from twinscrew.training.encoders import Seen

Metrics = dict[str, Tensor]
Draws = dict[str, Tensor]


class Lesson(NamedTuple):
    """A batch of B transitions as features, with the random numbers that an update takes."""

    seen: Seen
    following: Seen
    """What was seen when the n steps were over."""
    action: Tensor
    """(B, 2) in [-1, 1]."""
    reward: Tensor
    """(B,) Discounted sum over the n steps."""
    discount: Tensor
    """(B,) gamma^n; 0 where the episode ended."""
    weight: Tensor
    """(B,) Of each sample's loss: 1 unless transitions are drawn by priority."""
    draws: Draws
    """What the agent's `chance` gave."""


class Descent(NamedTuple):
    """One step of an update: a loss, and who goes down its gradient."""

    loss: Callable[[Lesson], tuple[Tensor, Metrics]]
    """Gives the loss, and what is told of it."""
    learners: tuple[tuple[str, str], ...]
    """Names of the networks and of their optimisers."""
