"""Prioritised replay (Schaul et al. 2016): what surprised is drawn more often, and weighted less.

Priorities lie in blocks whose sums are kept: a draw finds its block among their running sums, then
its place in the block, for the whole batch at once.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from twinscrew.runtime.settings import Fraction, NonNegative, Settings
from twinscrew.training.buffer import Drawn, ReplayBuffer

BLOCK = 1024
"""[-] Transitions in a block; about the root of a million."""
_LEAST = 1e-6  # [-] keeps every transition possible


class PrioritySettings(Settings, frozen=True):
    """How much surprise counts."""

    exponent: NonNegative = 0.5
    """[-] alpha: a transition is drawn in proportion to its loss to this power; 0 is uniform."""
    correction_start: Fraction = 0.4
    """[-] beta: how much of the bias of the draw its weight undoes, at first,"""
    correction_end: Fraction = 1.0
    """[-] and at the end."""


class PrioritisedReplay(ReplayBuffer):
    """A replay buffer that draws by priority; new transitions have the greatest seen so far."""

    def __init__(self, capacity: int, settings: PrioritySettings) -> None:
        super().__init__(capacity)
        self.settings = settings
        self.correction = settings.correction_start
        blocks = -(-capacity // BLOCK)
        self._priority = torch.zeros(blocks, BLOCK, dtype=torch.float64)
        self._sums = torch.zeros(blocks, dtype=torch.float64)
        self._greatest = 1.0

    def clear(self) -> None:
        """Forget every transition and priority."""
        super().clear()
        self._priority.zero_()
        self._sums.zero_()

    def advance(self, progress: float) -> None:
        """Say how far the run is, in [0, 1]: beta rises linearly."""
        s = self.settings
        self.correction = s.correction_start + progress * (s.correction_end - s.correction_start)

    def add(self, rows: Tensor) -> Tensor:
        """Store transitions, (K, 78), with the greatest priority."""
        places = super().add(rows)
        self._assign(places, torch.full((len(places),), self._greatest, dtype=torch.float64))
        return places

    def sample(self, count: int, generator: torch.Generator) -> Drawn:
        """Draw `count` transitions by priority, with weights (N P)^-beta, the greatest 1."""
        ends = self._sums.cumsum(0)
        aim = torch.rand(count, generator=generator, dtype=torch.float64) * ends[-1]
        block = torch.searchsorted(ends, aim, right=True).clamp(max=len(ends) - 1)
        inner = self._priority[block].cumsum(1)
        rest = (aim - ends[block] + self._sums[block])[:, None]
        column = torch.searchsorted(inner, rest, right=True).squeeze(1).clamp(max=BLOCK - 1)
        places = (block * BLOCK + column).clamp(max=len(self) - 1)
        share = self._priority.view(-1)[places] / ends[-1]
        weight = (len(self) * share).clamp(min=_LEAST) ** -self.correction
        return Drawn(self.rows[places], (weight / weight.max()).float(), places)

    def state(self) -> dict[str, Any]:
        """Give priorities too."""
        used = self._priority.view(-1)[: len(self)].clone()
        told = {"priority": used, "greatest": self._greatest, "correction": self.correction}
        return super().state() | told

    def restore(self, state: dict[str, Any]) -> None:
        """Take a `state` back."""
        super().restore(state)
        self._greatest, self.correction = state["greatest"], state["correction"]
        self._assign(torch.arange(len(self)), state["priority"])

    def reprioritise(self, places: Tensor, losses: Tensor) -> None:
        """Set priorities from the losses, (B,), that an update gave."""
        priority = (losses.double().cpu().abs() + _LEAST) ** self.settings.exponent
        self._greatest = max(self._greatest, float(priority.max()))
        self._assign(places, priority)

    def _assign(self, places: Tensor, priority: Tensor) -> None:
        self._priority.view(-1)[places] = priority
        blocks = torch.unique(places // BLOCK)
        self._sums[blocks] = self._priority[blocks].sum(1)
