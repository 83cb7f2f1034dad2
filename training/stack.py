"""Several seeds of an agent that learn at once: their parameters stacked, their losses mapped.

Seed k's part of every tensor is what an agent of its own would hold: the losses are the agent's own
functions under `torch.vmap`, gradients are limited seed by seed, and one Adam serves all, for its
steps are element by element. So on one device all seeds cost few, wide operations instead of many
narrow ones. What is random comes from each seed's own generator.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.func import functional_call, grad, stack_module_state

from twinscrew.training.agents.base import Agent
from twinscrew.training.agents.lesson import Descent, Draws, Lesson, Metrics
from twinscrew.training.agents.steps import anneal
from twinscrew.training.buffer import Batch, Drawn
from twinscrew.training.encoders import Seen, heed
from twinscrew.training.observations import Observations

Named = dict[str, Tensor]


class _Networks(nn.Module):
    """An agent's networks as one module whose call is any of the agent's functions."""

    def __init__(self, agent: Agent[Any]) -> None:
        super().__init__()
        for name, network in agent.networks.items():
            self.add_module(f"its_{name}", network)  # a bare name could be one of the class's own

    def forward(self, function: Any, *arguments: Any) -> Any:
        """Call a function of the agent, which reads its networks."""
        return function(*arguments)


class Stack:
    """K agents of one configuration, learning together.

    Parameters
    ----------
    agents
        Of K seeds, alike in settings and device. They keep what is not stacked: generators, counts;
        `settle` gives them their parameters back.
    """

    def __init__(self, agents: Sequence[Agent[Any]]) -> None:
        self.agents = agents
        self.first = agents[0]
        self._whole = _Networks(self.first)
        modules = [_Networks(agent) for agent in agents]
        stacked, _ = stack_module_state(modules)
        self.parameters: Named = {name: p.detach() for name, p in stacked.items()}
        self.optimizers = {name: self._optimizer(name) for name in self.first.optimizers}

    def act(self, observations: Observations, risk: Tensor | None) -> Tensor:
        """Give exploring actions (K, B, 2) for observations (K, B, ...) and levels (K, B, 1)."""
        count = observations.ego.shape[1]
        draws = self._drawn([agent.acting_chance(count) for agent in self.agents])
        seen = self.first.see(Observations(*(part.flatten(0, 1) for part in observations)))
        seen = seen if risk is None else heed(seen, risk.flatten(0, 1))
        seen = Seen(*(part.unflatten(0, (len(self.agents), count)) for part in seen))
        state = {**self.parameters, **self._buffers()}
        with torch.no_grad():
            actions: Tensor = torch.vmap(self._choose)(state, seen, draws)
        return actions

    def update(self, drawn: Sequence[Drawn], progress: float) -> list[Metrics]:
        """Take one update with transitions of every seed; give what each seed's tells."""
        first, batch = self.first, self._batch(drawn)
        for name, rate in first.rates().items():
            anneal(self.optimizers[name], rate, first.settings.final_rate, progress)
        draws = self._drawn([agent.chance(batch.action.shape[1]) for agent in self.agents])
        lesson = torch.vmap(first.prepare)(batch, draws)
        buffers, told = self._buffers(), Metrics()
        for descent in first.descents():
            told |= self._descend(descent, lesson, buffers)
        for agent in self.agents:
            agent.updates += 1
        for target, online, rate in first.due():
            self._blend(target, online, rate)
        return [{name: value[k] for name, value in told.items()} for k in range(len(self.agents))]

    def _batch(self, drawn: Sequence[Drawn]) -> Batch:
        """Give the transitions of all seeds as one batch (K, B, ...), moved in two pieces."""
        weights = [torch.ones(len(o.rows)) if o.weight is None else o.weight for o in drawn]
        rows = torch.stack([one.rows for one in drawn])
        return Drawn(rows, torch.stack(weights)).batch(self.first.device)

    def _drawn(self, draws: Sequence[Draws]) -> Draws:
        """Give the seeds' random numbers as one tensor each, (K, ...), on the device."""
        stacked = {name: torch.stack([one[name] for one in draws]) for name in draws[0]}
        return self.first.brought(stacked)

    def settle(self) -> None:
        """Give every agent its parameters, and its optimisers their state."""
        with torch.no_grad():
            for k, agent in enumerate(self.agents):
                for name, parameter in _Networks(agent).named_parameters():
                    parameter.copy_(self.parameters[name][k])
                for name, optimizer in self.optimizers.items():
                    agent.optimizers[name].load_state_dict(_part_of(optimizer, k))

    def _choose(self, state: Named, seen: Seen, draws: Draws) -> Tensor:
        def choose() -> Tensor:
            return self.first.choose(seen, draws, explore=True)

        return functional_call(self._whole, state, (choose,))  # type: ignore[no-any-return]

    def _descend(self, descent: Descent, lesson: Lesson, buffers: Named) -> Metrics:
        """Take one step of all seeds, the gradient of each limited by itself."""
        names = [self._names(network) for network, _ in descent.learners]
        learnt = {name: self.parameters[name] for part in names for name in part}
        rest = {name: p for name, p in self.parameters.items() if name not in learnt} | buffers

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

    def _blend(self, target: str, online: str, rate: float) -> None:
        for old, new in zip(self._names(target), self._names(online), strict=True):
            self.parameters[old].lerp_(self.parameters[new], rate)

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
        network = self.first.owner(name)
        parameters = [self.parameters[parameter] for parameter in self._names(network)]
        rate = self.first.optimizers[name].param_groups[0]["lr"]
        made = torch.optim.Adam(parameters, lr=rate, fused=True)
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


def _part_of(optimizer: torch.optim.Adam, k: int) -> dict[str, Any]:
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
