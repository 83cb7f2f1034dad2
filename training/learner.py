"""Who learns in a training loop: one agent, or those of several seeds as one (`stack.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from torch import Tensor

from twinscrew.training.agents.base import Agent
from twinscrew.training.agents.lesson import Metrics
from twinscrew.training.buffer import Drawn
from twinscrew.training.observations import Observations


class Learner(Protocol):
    """Who acts while experience is gathered: the agents of K seeds."""

    @property
    def agents(self) -> Sequence[Agent[Any]]:
        """One a seed."""

    def act(self, observations: Observations, risk: Tensor | None) -> Tensor:
        """Give exploring actions (K, M, 2) for observations (K, M, ...) and levels (K, M, 1)."""

    def update(self, drawn: Sequence[Drawn], progress: float) -> list[Metrics]:
        """Learn from each seed's transitions; give what each seed's update tells."""

    def settle(self) -> None:
        """Give the agents what they have learnt."""


class Alone:
    """One agent as a learner."""

    def __init__(self, agent: Agent[Any]) -> None:
        self.agents = (agent,)

    def act(self, observations: Observations, risk: Tensor | None) -> Tensor:
        """Give exploring actions, (1, M, 2)."""
        mine = Observations(*(part[0] for part in observations))
        level = None if risk is None else risk[0]
        return self.agents[0].act(mine, explore=True, risk=level)[None]

    def update(self, drawn: Sequence[Drawn], progress: float) -> list[Metrics]:
        """Learn from the one seed's transitions."""
        (agent,) = self.agents
        return [agent.update(drawn[0].batch(agent.device), progress)]

    def settle(self) -> None:
        """Do nothing: what is learnt is the agent's."""
