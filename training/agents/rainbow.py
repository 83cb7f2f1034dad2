"""Rainbow (Hessel et al. 2018): C51, dueling, noisy, double; multi-step and priorities outside.

The n-step returns come from the loop (`n_steps`), the priorities from the replay (`priority`).
"""

from __future__ import annotations

from typing import Annotated

import torch
from msgspec import Meta
from torch import Tensor, nn

from twinscrew.runtime.settings import Positive
from twinscrew.training.agents.base import AgentSettings, Draws, Lesson, Metrics, td_target
from twinscrew.training.agents.values import PAIRS, ValueAgent, action_number
from twinscrew.training.networks import NetworkSettings, Pilot, Seen, make_encoder


class RainbowSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="rainbow"):
    """Rainbow."""

    atoms: Annotated[int, Meta(ge=2, le=1001)] = 51
    """[-] Of the return's distribution (paper: 51)."""
    support_min: float = -40.0
    """[-] Least return; the reference's support [-1, 1] cannot hold returns of +-40,"""
    support_max: float = 60.0
    """[-] and the greatest."""
    sigma0: Positive = 0.05
    """[-] Initial noise of the noisy layers (paper: 0.05)."""


class NoisyLinear(nn.Module):
    """A layer whose weights have learnt noise, factorised (Fortunato et al. 2018, eq. 10).

    The noise is that of `noise`, until it is drawn anew; `quiet` takes the means alone.
    """

    noise_in: Tensor
    noise_out: Tensor

    def __init__(self, inputs: int, outputs: int, sigma0: float) -> None:
        super().__init__()
        bound, spread = inputs**-0.5, sigma0 * inputs**-0.5
        self.weight = nn.Parameter(torch.empty(outputs, inputs).uniform_(-bound, bound))
        self.bias = nn.Parameter(torch.empty(outputs).uniform_(-bound, bound))
        self.weight_sigma = nn.Parameter(torch.full((outputs, inputs), spread))
        self.bias_sigma = nn.Parameter(torch.full((outputs,), spread))
        self.register_buffer("noise_in", torch.zeros(inputs))
        self.register_buffer("noise_out", torch.zeros(outputs))

    def draw(self, generator: torch.Generator) -> None:
        """Draw the noise anew: f(x) = sign(x) sqrt|x| of Gaussians."""
        for noise in (self.noise_in, self.noise_out):
            drawn = torch.randn(len(noise), generator=generator)
            noise.copy_(drawn.sign() * drawn.abs().sqrt())

    def quiet(self) -> None:
        """Take the means alone, for acting greedily."""
        self.noise_in.zero_()
        self.noise_out.zero_()

    def forward(self, features: Tensor) -> Tensor:
        """Give (B, outputs)."""
        weight = self.weight + self.weight_sigma * torch.outer(self.noise_out, self.noise_in)
        return nn.functional.linear(features, weight, self.bias + self.bias_sigma * self.noise_out)


class DuelingDistribution(nn.Module):
    """Rainbow's head: dueling, noisy, over the atoms of a fixed support (Hessel et al. 2018)."""

    def __init__(self, settings: NetworkSettings, actions: int, atoms: int, sigma0: float) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        self.shape = (actions, atoms)
        hidden = settings.hidden_width
        self.hidden = nn.Linear(self.encoder.width, hidden)
        self.value_hidden = NoisyLinear(hidden, hidden, sigma0)
        self.value = NoisyLinear(hidden, atoms, sigma0)
        self.advantage_hidden = NoisyLinear(hidden, hidden, sigma0)
        self.advantage = NoisyLinear(hidden, actions * atoms, sigma0)

    def forward(self, seen: Seen) -> Tensor:
        """Give log probabilities (B, A, K)."""
        features = torch.relu(self.hidden(self.encoder(seen)))
        value = self.value(torch.relu(self.value_hidden(features))).float()[:, None, :]
        advantage = self.advantage(torch.relu(self.advantage_hidden(features))).float()
        advantage = advantage.view(-1, *self.shape)
        logits = value + advantage - advantage.mean(1, keepdim=True)
        return torch.log_softmax(logits, dim=2)


class MeanReturn(nn.Module):
    """Action values: the mean of the return's distribution."""

    support: Tensor

    def __init__(self, distribution: nn.Module, support: Tensor) -> None:
        super().__init__()
        self.distribution = distribution
        self.register_buffer("support", support, persistent=False)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        logs: Tensor = self.distribution(seen)
        return (logs.exp() * self.support).sum(2)


def project_distribution(
    probabilities: Tensor, reward: Tensor, discount: Tensor, support: Tensor
) -> Tensor:
    """Project r + gamma Z(s') onto a fixed support (C51, alg. 1).

    Parameters
    ----------
    probabilities : (B, K)
        Of the next state's return, on `support`.
    reward, discount : (B,)
        As in `td_target`.
    support : (K,)
        Equally spaced returns; what falls outside is moved to the nearest end.

    Returns
    -------
    (B, K)
        Probabilities on `support` again; each row sums to one.
    """
    low, step = support[0], support[1] - support[0]
    moved = td_target(reward, discount, support.expand_as(probabilities))
    place = ((moved - low) / step).clamp(0, len(support) - 1)
    below = place.floor().long().clamp(max=len(support) - 2)
    share = place - below
    projected = torch.zeros_like(probabilities)
    projected.scatter_add_(1, below, probabilities * (1.0 - share))
    projected.scatter_add_(1, below + 1, probabilities * share)
    return projected


def cross_entropy(log_probabilities: Tensor, target: Tensor) -> Tensor:
    """Give the cross entropy of each sample, (B,), of two distributions (B, K)."""
    return -(target.detach() * log_probabilities).sum(1)


class Rainbow(ValueAgent[RainbowSettings], online="online"):
    """The learner."""

    def __init__(self, settings: RainbowSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        s = settings
        self.support = torch.linspace(s.support_min, s.support_max, s.atoms, device=self.device)
        self.furnish(DuelingDistribution(s.network, PAIRS, s.atoms, s.sigma0))

    def values(self, network: nn.Module) -> nn.Module:
        """Give the mean of the network's distribution."""
        return MeanReturn(network, self.support)

    def chance(self, batch: int) -> Draws:  # noqa: ARG002
        """Draw the noise of the network's and the target's layers, which keep it."""
        for network in (self.network, self.target):
            for layer in noisy(network):
                layer.draw(self.generator)
        return {}

    def acting_chance(self, count: int) -> Draws:  # noqa: ARG002
        """Draw the noise of the network's layers: it explores."""
        for layer in noisy(self.network):
            layer.draw(self.generator)
        return {}

    def loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the weighted mean of the samples' losses, which are their new priorities."""
        losses = self.losses(lesson)
        loss = (lesson.weight * losses).mean()
        return loss, {"critic_loss": loss, "priority": losses}

    def losses(self, lesson: Lesson) -> Tensor:
        """Give each sample's cross entropy, (B,), against the projected next distribution."""
        rows = torch.arange(len(lesson.action), device=self.device)
        with torch.no_grad(), self.mixed():
            choice = self.network(lesson.following).float()
            after = self.target(lesson.following).float()
        best = (choice.exp() * self.support).sum(2).argmax(1)
        target = project_distribution(
            after[rows, best].exp(), lesson.reward, lesson.discount, self.support
        )
        with self.mixed():
            logs = self.network(lesson.seen)
        return cross_entropy(logs.float()[rows, action_number(lesson.action)], target)

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network, without its noise."""
        for layer in noisy(self.average):
            layer.quiet()
        return super().deployed(radius_margin)


def noisy(network: nn.Module) -> list[NoisyLinear]:
    """Give the layers with noise."""
    return [layer for layer in network.modules() if isinstance(layer, NoisyLinear)]
