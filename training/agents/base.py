"""What every agent is, and the few things that all of them do the same way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import torch
from msgspec import Meta
from torch import Tensor, nn

from twinscrew.runtime.settings import Count, Fraction, Positive, Settings
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import See, Seen, heed
from twinscrew.training.networks import NetworkSettings, Pilot
from twinscrew.training.observations import Observations

Rate = Annotated[float, Meta(gt=0.0, le=1.0)]
Metrics = dict[str, Tensor]


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

    def __init__(self, settings: S, seed: int, device: str) -> None:
        self.settings = settings
        self.device = torch.device(device)
        self.see = See(settings.network).to(self.device)
        self.generator = torch.Generator().manual_seed(seed)
        self.updates = 0
        self._parts: dict[str, nn.Module | torch.optim.Optimizer] = {}
        torch.manual_seed(seed)  # what initialises the networks

    def act(
        self, observations: Observations, *, explore: bool, risk: Tensor | None = None
    ) -> Tensor:
        """Give actions (B, 2) in [-1, 1], at risk levels, (B, 1), if the agent is told of any."""
        with torch.no_grad():
            seen = self.see(observations)
            return self.choose(seen if risk is None else heed(seen, risk), explore=explore)

    @abstractmethod
    def choose(self, seen: Seen, *, explore: bool) -> Tensor:
        """Give actions (B, 2); `explore` adds the agent's own noise, if it has any."""

    @abstractmethod
    def random(self, count: int) -> Tensor:
        """Give random actions (count, 2) in [-1, 1] of the kind that the agent can take."""

    @abstractmethod
    def update(self, batch: Batch, progress: float) -> Metrics:
        """Learn from a batch; `progress`, in [0, 1], through the phase sets the learning rates."""

    @abstractmethod
    def deployed(self, radius_margin: float) -> Pilot:
        """Give the policy that is evaluated and exported: observations to actions (B, 2)."""

    def retune(self, settings: S) -> None:
        """Go on under other settings; the networks stay."""
        self.settings = settings

    def keep(self, **parts: nn.Module | torch.optim.Optimizer) -> None:
        """Name the parts that a checkpoint holds."""
        self._parts.update(parts)

    def state(self) -> dict[str, Any]:
        """Give all that is learnt, as tensors, numbers and plain containers of them."""
        state: dict[str, Any] = {name: part.state_dict() for name, part in self._parts.items()}
        return state | {"generator": self.generator.get_state(), "updates": self.updates}

    def restore(self, state: dict[str, Any]) -> None:
        """Take a `state` back.

        Raises
        ------
        KeyError, RuntimeError, ValueError
            The state is that of other networks.
        """
        for name, part in self._parts.items():
            part.load_state_dict(state[name])
        self.generator.set_state(state["generator"])
        self.updates = int(state["updates"])


def blend(target: nn.Module, online: nn.Module, rate: float) -> None:
    """Update a target network: theta' <- rate theta + (1 - rate) theta' (alg. 2)."""
    with torch.no_grad():
        for old, new in zip(target.parameters(), online.parameters(), strict=True):
            old.lerp_(new, rate)


def descend(
    optimizer: torch.optim.Optimizer, loss: Tensor, parameters: Iterable[Tensor], norm: float
) -> None:
    """Take one step down the gradient of a loss, the gradient's norm limited."""
    optimizer.zero_grad()
    torch.autograd.backward(loss)
    nn.utils.clip_grad_norm_(parameters, norm)
    optimizer.step()


def adam(module: nn.Module, rate: float) -> torch.optim.Adam:
    """Give Adam over a module's parameters."""
    return torch.optim.Adam(module.parameters(), lr=rate, fused=True)


def anneal(optimizer: torch.optim.Optimizer, rate: float, final: float, progress: float) -> None:
    """Set the learning rate: linear from `rate` to `final` times it over progress in [0, 1]."""
    for group in optimizer.param_groups:
        group["lr"] = rate * (1.0 - (1.0 - final) * min(max(progress, 0.0), 1.0))


def wide(enabled: bool, device: str = "cpu") -> torch.autocast:
    """Multiply matrices in bfloat16 inside this context, if enabled."""
    return torch.autocast(device, dtype=torch.bfloat16, enabled=enabled)
