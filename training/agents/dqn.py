"""DQN (Mnih et al. 2015), by choice with double estimation (van Hasselt et al. 2016)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from twinscrew.training.agents.base import (
    Agent,
    AgentSettings,
    Metrics,
    adam,
    anneal,
    blend,
    descend,
    wide,
)
from twinscrew.training.agents.discrete import (
    PAIRS,
    Greedy,
    action_number,
    random_pairs,
    taken,
)
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import Seen
from twinscrew.training.losses import huber, td_target
from twinscrew.training.networks import Pilot
from twinscrew.training.networks_value import QNetwork


class DqnSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="dqn"):
    """DQN."""

    double: bool = True
    """Let the online network choose the next action and the target network value it."""


class Dqn(Agent[DqnSettings]):
    """The learner."""

    continuous = False

    def __init__(self, settings: DqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.values = QNetwork(settings.network, PAIRS).to(self.device)
        self.target = copy.deepcopy(self.values)
        self.average = copy.deepcopy(self.values)
        self.optimizer = adam(self.values, settings.learning_rate)
        self.keep(
            values=self.values, target=self.target, average=self.average, optimizer=self.optimizer
        )

    def choose(self, seen: Seen, *, explore: bool) -> Tensor:
        """Give greedy pairs, (B, 2); exploration is added outside."""
        action: Tensor = Greedy(self.values if explore else self.average)(seen)
        return action

    def random(self, count: int) -> Tensor:
        """Give random pairs, (count, 2)."""
        return random_pairs(count, self.generator)

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Take one step."""
        s = self.settings
        anneal(self.optimizer, s.learning_rate, s.final_rate, progress)
        loss = self.loss(batch)
        descend(self.optimizer, loss, self.values.parameters(), s.gradient_norm)
        self.updates += 1
        if self.updates % s.target_every == 0:
            blend(self.target, self.values, s.target_rate)
        blend(self.average, self.values, s.average_rate)
        return {"critic_loss": loss.detach()}

    def loss(self, batch: Batch) -> Tensor:
        """Give the mean Huber loss of Q(s, a) against r + gamma Q'(s', argmax Q)."""
        seen, following = self.see(batch.observations), self.see(batch.next_observations)
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            target = self.target(following)
            choice = self.values(following) if self.settings.double else target
        best = taken(target, choice.argmax(1)).float()
        goal = td_target(batch.reward, batch.discount, best[:, None]).squeeze(1)
        with wide(self.settings.bfloat16, self.device.type):
            values = self.values(seen)
        return huber(goal - taken(values, action_number(batch.action)).float(), 1.0).mean()

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network."""
        return Pilot(self.see, Greedy(self.average), radius_margin)
