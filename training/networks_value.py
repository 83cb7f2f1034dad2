"""Networks of the other agents, on the same encoders: the same trunk without actor or quantiles.

Paper, sec. V: "mostly the same as AC-IQN, except for necessary modifications to match the
corresponding input and output".
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from twinscrew.training.encoders import Seen, make_encoder
from twinscrew.training.networks import ACTIONS, CosineEmbedding, NetworkSettings


class Trunk(nn.Module):
    """Encoder -> 128 -> 128, ReLU."""

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        self.width = settings.hidden_width
        self.hidden1 = nn.Linear(self.encoder.width, self.width)
        self.hidden2 = nn.Linear(self.width, self.width)

    def forward(self, seen: Seen) -> Tensor:
        """Give features (B, 128)."""
        return torch.relu(self.hidden2(torch.relu(self.hidden1(self.encoder(seen)))))


class QNetwork(nn.Module):
    """The values of discrete actions."""

    def __init__(self, settings: NetworkSettings, actions: int) -> None:
        super().__init__()
        self.trunk = Trunk(settings)
        self.output = nn.Linear(self.trunk.width, actions)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        values: Tensor = self.output(self.trunk(seen))
        return values


class QuantileQNetwork(nn.Module):
    """Quantiles of the returns of discrete actions: the critic without its action branch."""

    def __init__(self, settings: NetworkSettings, actions: int) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        hidden = settings.hidden_width
        self.embedding = CosineEmbedding(settings.cosines, self.encoder.width)
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, actions)

    def forward(self, seen: Seen, fractions: Tensor) -> Tensor:
        """Give quantiles (B, N, A) at `fractions`, (N,) or (B, N)."""
        state = self.encoder(seen)[:, None, :]
        hidden = torch.relu(self.hidden1(state * self.embedding(fractions)))
        quantiles: Tensor = self.output(torch.relu(self.hidden2(hidden)))
        return quantiles


class ActionCritic(nn.Module):
    """The value of a continuous action: state -> 128 (.) action -> 128 -> 1."""

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        hidden = settings.hidden_width
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.action = nn.Linear(ACTIONS, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, seen: Seen, action: Tensor) -> Tensor:
        """Give values (B,)."""
        hidden = torch.relu(self.hidden1(self.encoder(seen)))
        hidden = torch.relu(self.hidden2(hidden * torch.relu(self.action(action))))
        value: Tensor = self.output(hidden)
        return value.squeeze(-1)


class GaussianActor(nn.Module):
    """A Gaussian over actions before squashing."""

    def __init__(self, settings: NetworkSettings, log_sigma: tuple[float, float]) -> None:
        super().__init__()
        self.trunk = Trunk(settings)
        self.mean = nn.Linear(self.trunk.width, ACTIONS)
        self.log_sigma = nn.Linear(self.trunk.width, ACTIONS)
        self.limits = log_sigma

    def forward(self, seen: Seen) -> tuple[Tensor, Tensor]:
        """Give mean and log standard deviation, (B, 2) each."""
        features = self.trunk(seen)
        return self.mean(features), self.log_sigma(features).clamp(*self.limits)


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
