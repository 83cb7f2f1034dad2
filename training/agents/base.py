"""What every algorithm is made of: named networks and optimisers, and an update of a few descents.

An algorithm is one file beside this: its settings, its networks, its losses. It says in `descents`
which losses an update consists of and which networks go down each, and the rest is here. A loss is
a function of a lesson (a batch and the random numbers it is learnt with) and of the networks'
parameters alone, so that several seeds can learn at once with stacked parameters (`learner.py`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, Literal, NamedTuple, TypeVar

import torch
from msgspec import Meta
from torch import Tensor, nn
from torch.optim import Optimizer

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Count, Fraction, Positive, Settings
from twinscrew.training.networks import NetworkSettings, Observations, Pilot, See, Seen, with_risk

if TYPE_CHECKING:
    from twinscrew.training.replay import Batch, Memory, Rollout
    from twinscrew.training.settings import TrainSettings

NEW_PARTS = {"contour", "beyond"}
"""Parts of networks that a run may add to those that it begins from: they begin at zero."""
Rate = Annotated[float, Meta(gt=0.0, le=1.0)]
Metrics = dict[str, Tensor]
Draws = dict[str, Tensor]


class AgentSettings(Settings, frozen=True):
    """What all algorithms have in common."""

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
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """Of matrix products; outputs, targets, losses and parameters are always float32. "auto": what
    `twinscrew train` finds faster on this machine; float32 where nobody has tried."""
    bfloat16: bool | None = None
    """The older way to say so: true is precision "bfloat16", false "float32"."""

    @property
    def mixed(self) -> bool:
        """Whether matrices are multiplied in bfloat16."""
        return self.precision == "bfloat16" if self.bfloat16 is None else self.bfloat16


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
    extra: Tensor
    """(B, X) What the algorithm's `study` gave."""
    draws: Draws
    """What the algorithm's `chance` gave."""


class Descent(NamedTuple):
    """One step of an update: a loss, and who goes down its gradient."""

    loss: Callable[[Lesson], tuple[Tensor, Metrics]]
    """Gives the loss, and figures to log."""
    learners: tuple[tuple[str, str], ...]
    """Names of the networks and of their optimisers."""


S = TypeVar("S", bound=AgentSettings)


class Agent(ABC, Generic[S]):
    """A learner: its named networks and optimisers, a generator, a count of updates."""

    continuous: ClassVar[bool] = True
    """Whether any action in [-1, 1]^2 can be taken: exploration may then add noise to it."""
    on_policy: ClassVar[bool] = False
    """Whether it learns from its own newest actions alone: nothing random is mixed in then."""
    targets: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Names of the target networks and of what they follow."""
    averages: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Names of the running averages and of what they follow."""

    def __init__(self, settings: S, seed: int, device: str = "cpu") -> None:
        self.settings = settings
        self.device = torch.device(device)
        self.see = See(settings.network).to(self.device)
        self.generator = torch.Generator().manual_seed(seed)
        self.updates = 0
        self.networks: dict[str, nn.Module] = {}
        self.optimizers: dict[str, Optimizer] = {}
        torch.manual_seed(seed)  # what initialises the networks

    # What an algorithm has to say.

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

    # What it may say.

    def chance(self, batch: int) -> Draws:  # noqa: ARG002
        """Draw what an update of a batch takes from the agent's generator."""
        return {}

    def acting_chance(self, count: int) -> Draws:  # noqa: ARG002
        """Draw what exploring actions take from the agent's generator."""
        return {}

    def memory(self, settings: TrainSettings) -> Memory:
        """Give what keeps its experience: a replay, uniform or by priority."""
        from twinscrew.training.replay import make_replay

        return make_replay(settings)

    def study(self, rollout: Rollout) -> Tensor:
        """Give what an on-policy update needs beside each transition of a rollout, (n, X)."""
        raise NotImplementedError(f"{type(self).__name__} does not learn from rollouts")

    # What holds for all.

    def act(
        self, observations: Observations, *, explore: bool, risk: Tensor | None = None
    ) -> Tensor:
        """Give actions (B, 2) in [-1, 1], at risk levels, (B, 1), if the agent takes any."""
        with torch.no_grad():
            seen = self.see(observations)
            draws = self.brought(self.acting_chance(len(seen.ego))) if explore else {}
            seen = seen if risk is None else with_risk(seen, risk)
            return self.choose(seen, draws, explore=explore)

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Learn from a batch; `progress`, in [0, 1], through the phase sets the learning rates."""
        from twinscrew.training.learner import Alone

        return Alone(self).learn(batch, progress)

    def mixed(self) -> torch.autocast:
        """Multiply matrices in bfloat16 inside this context, if the settings say so."""
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.settings.mixed)

    def brought(self, draws: Draws) -> Draws:
        """Give what was drawn on the agent's device."""
        return {name: drawn.to(self.device) for name, drawn in draws.items()}

    def prepare(self, batch: Batch, draws: Draws) -> Lesson:
        """Turn a batch into a lesson."""
        reward = batch.reward
        weight = torch.ones_like(reward) if batch.weight is None else batch.weight
        return Lesson(
            self.see(batch.observations),
            self.see(batch.next_observations),
            batch.action,
            reward,
            batch.discount,
            weight,
            reward[..., None][..., :0] if batch.extra is None else batch.extra,
            draws,
        )

    def due(self) -> list[tuple[str, str, float]]:
        """Give which networks follow which after this update, and by which share (alg. 2)."""
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
                self.networks[name] = part.to(self.device)
            else:
                self.optimizers[name] = part

    def state(self) -> dict[str, Any]:
        """Give all that is learnt, as tensors, numbers and plain containers of them."""
        parts: Mapping[str, Any] = {**self.networks, **self.optimizers}
        learnt = {name: part.state_dict() for name, part in parts.items()}
        return {**learnt, "generator": self.generator.get_state(), "updates": self.updates}

    def start_from(self, state: dict[str, Any]) -> None:
        """Take over the networks of a run that may have known fewer inputs; nothing else.

        What reads the new inputs begins at zero, so that the networks answer as they did.

        Raises
        ------
        ConfigError
            They are networks of other sizes, or of fewer parts than the new inputs'.
        """
        for name, network in self.networks.items():
            mine, given = network.state_dict(), state[name]
            for key in mine.keys() | given.keys():
                if key not in given and set(key.split(".")) & NEW_PARTS:
                    continue
                shapes = [tuple(one[key].shape) if key in one else None for one in (given, mine)]
                if shapes[0] != shapes[1]:
                    raise ConfigError(
                        f"{name}.{key} has shape {shapes[0]}, the configuration's is {shapes[1]}",
                        key="--from",
                    )
            network.load_state_dict({**mine, **given})

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


class ActorSettings(AgentSettings, frozen=True):
    """What algorithms with an actor have in common."""

    actor_rate: Positive = 3e-4
    """[-] Adam's step for the actor, at the start."""


A = TypeVar("A", bound=ActorSettings)


class ActorAgent(Agent[A]):
    """A learner whose actions are continuous, with an actor that is averaged for deployment."""

    averages = (("average_actor", "actor"),)

    def random(self, count: int) -> Tensor:
        """Give uniform actions, (count, 2) in [-1, 1]."""
        return 2.0 * torch.rand(count, 2, generator=self.generator) - 1.0

    def rates(self) -> dict[str, float]:
        """Give the learning rates of critic and actor."""
        s = self.settings
        return {"critic_optimizer": s.learning_rate, "actor_optimizer": s.actor_rate}


def adam(module: nn.Module, rate: float) -> torch.optim.Adam:
    """Give Adam over a module's parameters."""
    return torch.optim.Adam(module.parameters(), lr=rate, fused=True)


def td_target(reward: Tensor, discount: Tensor, next_value: Tensor) -> Tensor:
    """Give r + gamma Z(s'), (B, M), of rewards (B,), discounts (B,) and next values (B, M).

    `discount` is gamma^n, and 0 where the episode ended: a truncated one is bootstrapped.
    """
    return reward[:, None] + discount[:, None] * next_value


def huber(error: Tensor, kappa: float) -> Tensor:
    """Give L_kappa(u): u^2 / 2 up to kappa, linear beyond (paper, eq. 10)."""
    size = error.abs()
    return torch.where(size <= kappa, 0.5 * error * error, kappa * (size - 0.5 * kappa))
