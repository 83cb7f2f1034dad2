"""What every agent is: named networks and optimisers, and an update made of a few descents."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import torch
from msgspec import Meta
from torch import Tensor, nn
from torch.optim import Optimizer

from twinscrew.runtime.settings import Count, Fraction, Positive, Settings
from twinscrew.training.agents.lesson import Descent, Draws, Lesson, Metrics
from twinscrew.training.agents.steps import anneal, blend, descend
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import See, Seen, heed
from twinscrew.training.networks import NetworkSettings, Pilot
from twinscrew.training.observations import Observations

Rate = Annotated[float, Meta(gt=0.0, le=1.0)]


class AgentSettings(Settings, frozen=True):
    """What all agents are told."""

    network: NetworkSettings = NetworkSettings()
    """The shape of the networks."""
    learning_rate: Positive = 5e-4
    """[-] Adam's step for the critic, at the start."""
    final_rate: Fraction = 0.05
    """[-] What the learning rates fall to, linearly over a phase, as a share of their start."""
    gradient_norm: Positive = 10.0
    """[-] Gradients are scaled down to this norm."""
    target_rate: Rate = 0.005
    """[-] beta: share of the online parameters in a target update (alg. 2); 1 is a copy."""
    target_every: Count = 1
    """[updates] k: how often the target networks are updated (alg. 2)."""
    average_rate: Rate = 0.001
    """[-] Share of the newest parameters in the running average that is deployed; 1 is none."""
    bfloat16: bool = True
    """Multiply matrices in bfloat16; outputs, targets, losses and parameters stay float32."""


S = TypeVar("S", bound=AgentSettings)


class Agent(ABC, Generic[S]):
    """A learner: its named networks and optimisers, a generator, a count of updates."""

    continuous: ClassVar[bool] = True
    """Whether any action in [-1, 1]^2 can be taken: exploration may then add noise to it."""
    targets: ClassVar[tuple[tuple[str, str], ...]]
    """Names of the target networks and of what they follow."""
    averages: ClassVar[tuple[tuple[str, str], ...]]
    """Names of the running averages and of what they follow."""

    def __init__(self, settings: S, seed: int, device: str) -> None:
        self.settings = settings
        self.device = torch.device(device)
        self.see = See(settings.network).to(self.device)
        self.generator = torch.Generator().manual_seed(seed)
        self.updates = 0
        self.networks: dict[str, nn.Module] = {}
        self.optimizers: dict[str, Optimizer] = {}
        torch.manual_seed(seed)  # what initialises the networks

    def act(
        self, observations: Observations, *, explore: bool, risk: Tensor | None = None
    ) -> Tensor:
        """Give actions (B, 2) in [-1, 1], at risk levels, (B, 1), if the agent is told of any."""
        with torch.no_grad():
            seen = self.see(observations)
            draws = self.brought(self.acting_chance(len(seen.ego))) if explore else {}
            return self.choose(seen if risk is None else heed(seen, risk), draws, explore=explore)

    @abstractmethod
    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:
        """Give actions (B, 2); `explore` takes the newest network and the agent's own noise."""

    @abstractmethod
    def random(self, count: int) -> Tensor:
        """Give random actions (count, 2) in [-1, 1] of the kind that the agent can take."""

    @abstractmethod
    def descents(self) -> tuple[Descent, ...]:
        """Give the steps of an update, in their order."""

    @abstractmethod
    def rates(self) -> dict[str, float]:
        """Give the optimisers' learning rates at the start of a phase."""

    @abstractmethod
    def deployed(self, radius_margin: float) -> Pilot:
        """Give the policy that is evaluated and exported: observations to actions (B, 2)."""

    def chance(self, batch: int) -> Draws:  # noqa: ARG002
        """Draw what an update of a batch takes from the agent's generator."""
        return {}

    def acting_chance(self, count: int) -> Draws:  # noqa: ARG002
        """Draw what exploring actions take from the agent's generator."""
        return {}

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Learn from a batch; `progress`, in [0, 1], through the phase sets the learning rates."""
        self.anneal(progress)
        lesson = self.prepare(batch, self.brought(self.chance(len(batch.action))))
        told: Metrics = {}
        for loss, learners in self.descents():
            value, metrics = loss(lesson)
            pairs = [(self.networks[net], self.optimizers[name]) for net, name in learners]
            descend(value, pairs, self.settings.gradient_norm)
            told |= {name: metric.detach() for name, metric in metrics.items()}
        self.updates += 1
        for target, online, rate in self.due():
            blend(self.networks[target], self.networks[online], rate)
        return told

    def brought(self, draws: Draws) -> Draws:
        """Give what was drawn on the agent's device."""
        return {name: drawn.to(self.device) for name, drawn in draws.items()}

    def prepare(self, batch: Batch, draws: Draws) -> Lesson:
        """Turn a batch into a lesson."""
        weight = torch.ones_like(batch.reward) if batch.weight is None else batch.weight
        return Lesson(
            self.see(batch.observations),
            self.see(batch.next_observations),
            batch.action,
            batch.reward,
            batch.discount,
            weight,
            draws,
        )

    def anneal(self, progress: float) -> None:
        """Set the learning rates for where the phase is, in [0, 1]."""
        for name, rate in self.rates().items():
            anneal(self.optimizers[name], rate, self.settings.final_rate, progress)

    def due(self) -> list[tuple[str, str, float]]:
        """Give which networks follow which after this update, and by which share."""
        s = self.settings
        due = [(*pair, s.average_rate) for pair in self.averages]
        if self.updates % s.target_every == 0:
            due += [(*pair, s.target_rate) for pair in self.targets]
        return due

    def owner(self, optimizer: str) -> str:
        """Give the name of the network whose parameters an optimiser moves."""
        moved = self.optimizers[optimizer].param_groups[0]["params"][0]
        return next(
            name
            for name, network in self.networks.items()
            if any(parameter is moved for parameter in network.parameters())
        )

    def retune(self, settings: S) -> None:
        """Go on under other settings; the networks stay."""
        self.settings = settings

    def keep(self, **parts: nn.Module | Optimizer) -> None:
        """Name the parts that a checkpoint holds."""
        for name, part in parts.items():
            if isinstance(part, nn.Module):
                self.networks[name] = part
            else:
                self.optimizers[name] = part

    def state(self) -> dict[str, Any]:
        """Give all that is learnt, as tensors, numbers and plain containers of them."""
        networks = {name: network.state_dict() for name, network in self.networks.items()}
        optimizers = {name: one.state_dict() for name, one in self.optimizers.items()}
        return (
            networks
            | optimizers
            | {"generator": self.generator.get_state(), "updates": self.updates}
        )

    def restore(self, state: dict[str, Any]) -> None:
        """Take a `state` back.

        Raises
        ------
        KeyError, RuntimeError, ValueError
            The state is that of other networks.
        """
        for name, network in self.networks.items():
            network.load_state_dict(state[name])
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(state[name])
        self.generator.set_state(state["generator"])
        self.updates = int(state["updates"])
