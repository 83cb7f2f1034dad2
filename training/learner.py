"""How an update is made: by one agent alone, or by those of several seeds with stacked parameters.

There is one update (`Learner.learn`): the learning rates, then each descent of the algorithm's own
losses, then the networks that follow. The two learners differ only in how they get a gradient: a
stack takes the same losses under `torch.vmap`. Seed k's part of every stacked tensor is what an
agent of its own would hold: gradients are limited seed by seed, one Adam serves all, for its steps
are element by element, and what is random comes from each seed's own generator. So on one device
all seeds cost few, wide operations instead of many narrow ones.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.func import functional_call, grad, stack_module_state
from torch.optim import Optimizer

from twinscrew.training.agents.base import Agent, Descent, Draws, Lesson, Metrics
from twinscrew.training.networks import Observations, Seen, with_risk
from twinscrew.training.replay import Batch, Drawn

Named = dict[str, Tensor]


class Learner(ABC):
    """Who acts and learns in a training loop: the agents of K seeds."""

    agents: Sequence[Agent[Any]]
    optimizers: Mapping[str, Optimizer]

    @abstractmethod
    def act(self, observations: Observations, risk: Tensor | None) -> Tensor:
        """Give exploring actions (K, M, 2) for observations (K, M, ...) and levels (K, M, 1)."""

    @abstractmethod
    def update(self, drawn: Sequence[Drawn], progress: float) -> list[Metrics]:
        """Learn from each seed's transitions; give each seed's figures."""

    @abstractmethod
    def settle(self) -> None:
        """Give the agents what they have learnt."""

    @abstractmethod
    def _lesson(self, batch: Batch) -> Lesson: ...

    @abstractmethod
    def _descend(self, descent: Descent, lesson: Lesson) -> Metrics:
        """Take one step down the gradient of a loss by its learners alone, each norm limited."""

    @abstractmethod
    def _parameters(self, network: str) -> list[Tensor]: ...

    def learn(self, batch: Batch, progress: float) -> Metrics:
        """Make one update; `progress`, in [0, 1], through the phase sets the learning rates."""
        first, told = self.agents[0], Metrics()
        final = first.settings.final_rate
        for name, rate in first.rates().items():
            for group in self.optimizers[name].param_groups:
                group["lr"] = rate * (1.0 - (1.0 - final) * min(max(progress, 0.0), 1.0))
        lesson = self._lesson(batch)
        for descent in first.descents():
            told |= self._descend(descent, lesson)
        for agent in self.agents:
            agent.updates += 1
        with torch.no_grad():
            for target, online, rate in first.due():
                pairs = zip(self._parameters(target), self._parameters(online), strict=True)
                for old, new in pairs:
                    old.lerp_(new, rate)
        return told


class Alone(Learner):
    """One agent."""

    def __init__(self, agent: Agent[Any]) -> None:
        self.agents, self.optimizers = (agent,), agent.optimizers

    def act(self, observations: Observations, risk: Tensor | None) -> Tensor:
        """Give exploring actions, (1, M, 2)."""
        mine = Observations(*(part[0] for part in observations))
        level = None if risk is None else risk[0]
        return self.agents[0].act(mine, explore=True, risk=level)[None]

    def update(self, drawn: Sequence[Drawn], progress: float) -> list[Metrics]:
        """Learn from the one seed's transitions."""
        return [self.learn(drawn[0].batch(self.agents[0].device), progress)]

    def settle(self) -> None:
        """Do nothing: what is learnt is the agent's."""

    def _lesson(self, batch: Batch) -> Lesson:
        (agent,) = self.agents
        return agent.prepare(batch, agent.brought(agent.chance(len(batch.action))))

    def _descend(self, descent: Descent, lesson: Lesson) -> Metrics:
        (agent,) = self.agents
        loss, told = descent.loss(lesson)
        parts = [list(agent.networks[network].parameters()) for network, _ in descent.learners]
        gradients = iter(torch.autograd.grad(loss, [p for part in parts for p in part]))
        for part, (_, optimizer) in zip(parts, descent.learners, strict=True):
            for parameter in part:
                parameter.grad = next(gradients)
            nn.utils.clip_grad_norm_(part, agent.settings.gradient_norm)
            self.optimizers[optimizer].step()
        return {name: value.detach() for name, value in told.items()}

    def _parameters(self, network: str) -> list[Tensor]:
        return list(self.agents[0].networks[network].parameters())


class _Networks(nn.Module):
    """An agent's networks as one module whose call is any of the agent's functions."""

    def __init__(self, agent: Agent[Any]) -> None:
        super().__init__()
        for name, network in agent.networks.items():
            self.add_module(f"its_{name}", network)  # a bare name could be one of the class's own

    def forward(self, function: Any, *arguments: Any) -> Any:
        """Call a function of the agent, which reads its networks."""
        return function(*arguments)


class Stack(Learner):
    """K agents of one configuration, learning together.

    Parameters
    ----------
    agents
        Of K seeds, alike in settings and device. They keep what is not stacked: generators, counts;
        `settle` gives them their parameters back.
    """

    def __init__(self, agents: Sequence[Agent[Any]]) -> None:
        self.agents, self.first = agents, agents[0]
        self._whole = _Networks(self.first)
        stacked, _ = stack_module_state([_Networks(agent) for agent in agents])
        self.parameters: Named = {name: p.detach() for name, p in stacked.items()}
        self.optimizers = {name: self._optimizer(name) for name in self.first.optimizers}

    def act(self, observations: Observations, risk: Tensor | None) -> Tensor:
        """Give exploring actions, (K, M, 2)."""
        count = observations.ego.shape[1]
        draws = self._drawn([agent.acting_chance(count) for agent in self.agents])
        seen = self.first.see(Observations(*(part.flatten(0, 1) for part in observations)))
        seen = seen if risk is None else with_risk(seen, risk.flatten(0, 1))
        seen = Seen(*(part.unflatten(0, (len(self.agents), count)) for part in seen))
        state = {**self.parameters, **self._buffers()}

        def choose(state: Named, seen: Seen, draws: Draws) -> Tensor:
            def mine() -> Tensor:
                return self.first.choose(seen, draws, explore=True)

            return functional_call(self._whole, state, (mine,))  # type: ignore[no-any-return]

        with torch.no_grad():
            actions: Tensor = torch.vmap(choose)(state, seen, draws)
        return actions

    def update(self, drawn: Sequence[Drawn], progress: float) -> list[Metrics]:
        """Learn from transitions of every seed, moved to the device together."""
        weights = [torch.ones(len(o.rows)) if o.weight is None else o.weight for o in drawn]
        extra = [one.extra for one in drawn if one.extra is not None]
        whole = Drawn(
            torch.stack([one.rows for one in drawn]),
            torch.stack(weights),
            extra=torch.stack(extra) if extra else None,
        )
        told = self.learn(whole.batch(self.first.device), progress)
        return [{name: value[k] for name, value in told.items()} for k in range(len(self.agents))]

    def settle(self) -> None:
        """Give every agent its parameters, and its optimisers their state."""
        with torch.no_grad():
            for k, agent in enumerate(self.agents):
                for name, parameter in _Networks(agent).named_parameters():
                    parameter.copy_(self.parameters[name][k])
                for name, optimizer in self.optimizers.items():
                    agent.optimizers[name].load_state_dict(_part_of(optimizer, k))

    def _lesson(self, batch: Batch) -> Lesson:
        draws = self._drawn([agent.chance(batch.action.shape[1]) for agent in self.agents])
        self._kept = self._buffers()
        if batch.extra is None:
            batch = batch._replace(extra=batch.reward[..., None][..., :0])
        lesson: Lesson = torch.vmap(self.first.prepare)(batch, draws)
        return lesson

    def _descend(self, descent: Descent, lesson: Lesson) -> Metrics:
        names = [self._names(network) for network, _ in descent.learners]
        learnt = {name: self.parameters[name] for part in names for name in part}
        rest = {name: p for name, p in self.parameters.items() if name not in learnt} | self._kept

        def loss(learnt: Named, rest: Named, lesson: Lesson) -> tuple[Tensor, Metrics]:
            return functional_call(self._whole, {**rest, **learnt}, (descent.loss, lesson))  # type: ignore[no-any-return]

        gradients, told = torch.vmap(grad(loss, has_aux=True))(learnt, rest, lesson)
        for part, (_, optimizer) in zip(names, descent.learners, strict=True):
            limit({name: gradients[name] for name in part}, self.first.settings.gradient_norm)
            for name in part:
                self.parameters[name].grad = gradients[name]
            self.optimizers[optimizer].step()
        metrics: Metrics = told
        return metrics

    def _parameters(self, network: str) -> list[Tensor]:
        return [self.parameters[name] for name in self._names(network)]

    def _drawn(self, draws: Sequence[Draws]) -> Draws:
        """Give the seeds' random numbers as one tensor each, (K, ...), on the device."""
        stacked = {name: torch.stack([one[name] for one in draws]) for name in draws[0]}
        return self.first.brought(stacked)

    def _names(self, network: str) -> list[str]:
        named = self.first.networks[network].named_parameters()
        return [f"its_{network}.{name}" for name, _ in named]

    def _buffers(self) -> Named:
        """Stack what the networks of each seed keep beside parameters: the noise of noisy layers.

        What is not kept in a checkpoint is the same for every seed.
        """
        kept = [name for name in self._whole.state_dict() if name not in self.parameters]
        if not kept:
            return {}
        states = [_Networks(agent).state_dict() for agent in self.agents]
        return {name: torch.stack([state[name] for state in states]) for name in kept}

    def _optimizer(self, name: str) -> torch.optim.Adam:
        """Give one Adam over the stacked parameters of an optimiser, with the agents' state."""
        rate = self.first.optimizers[name].param_groups[0]["lr"]
        made = torch.optim.Adam(self._parameters(self.first.owner(name)), lr=rate, fused=True)
        states = [agent.optimizers[name].state_dict() for agent in self.agents]
        if states[0]["state"]:
            made.load_state_dict(_join(states))
        return made


def limit(gradients: Named, norm: float) -> None:
    """Scale gradients (K, ...) so that each seed's norm over all of them is at most `norm`."""
    squares = [
        gradient.reshape(len(gradient), -1).square().sum(1) for gradient in gradients.values()
    ]
    total = torch.stack(squares).sum(0).sqrt()
    share = (norm / (total + 1e-6)).clamp(max=1.0)  # as torch.nn.utils.clip_grad_norm_
    for gradient in gradients.values():
        gradient.mul_(share.view(-1, *[1] * (gradient.dim() - 1)))


def _part_of(optimizer: Optimizer, k: int) -> dict[str, Any]:
    """Give seed k's part of an optimiser's state."""
    whole = optimizer.state_dict()
    state = {
        number: {name: (v if name == "step" else v[k]).clone() for name, v in values.items()}
        for number, values in whole["state"].items()
    }
    return {**whole, "state": state}


def _join(states: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Stack the optimisers' states of all seeds."""
    joined = {
        number: {
            name: values[name].clone()
            if name == "step"
            else torch.stack([state["state"][number][name] for state in states])
            for name in values
        }
        for number, values in states[0]["state"].items()
    }
    return {**states[0], "state": joined}
