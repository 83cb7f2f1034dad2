"""Actors and critics over an encoder (paper, fig. 5; parameters of the paper's and of ours)."""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

from twinscrew.training.encoders import EncoderSettings, See, Seen, Width, heed, make_encoder
from twinscrew.training.observations import Observations

ACTIONS = 2
"""[-] Left and right rate of change of thrust, in (-1, 1)."""


class NetworkSettings(EncoderSettings, frozen=True):
    """The networks of an agent."""

    critic: Literal["joined", "paper"] = "joined"
    """"joined": action and state join before the quantile; "paper": action after it (fig. 5)."""
    feature_width: Width = 256
    """[-] Width of the layer that the quantile embedding multiplies (paper: 256)."""
    hidden_width: Width = 128
    """[-] Width of the hidden layers (paper: 128)."""
    cosines: Width = 64
    """[-] Cosine features of a quantile fraction (paper: 64)."""


def squash(value: Tensor) -> Tensor:
    """Map any number into (-1, 1): (2 / pi) atan, slower to saturate than tanh."""
    return torch.atan(value) * (2.0 / math.pi)


class Actor(nn.Module):
    """A deterministic policy: what is seen to actions in (-1, 1)."""

    def __init__(self, settings: NetworkSettings, extra: int = 0) -> None:
        super().__init__()
        self.encoder = make_encoder(settings, extra)
        hidden = settings.hidden_width
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, ACTIONS)

    def forward(self, seen: Seen) -> Tensor:
        """Give actions (B, 2)."""
        hidden = torch.relu(self.hidden1(self.encoder(seen)))
        hidden = torch.relu(self.hidden2(hidden))
        return squash(self.output(hidden))


class CosineEmbedding(nn.Module):
    """Features of quantile fractions: ReLU(W cos(pi i tau) + b), i = 0, 1, ... (IQN, eq. 4)."""

    frequencies: Tensor

    def __init__(self, cosines: int, width: int) -> None:
        super().__init__()
        self.layer = nn.Linear(cosines, width)
        frequencies = math.pi * torch.arange(cosines, dtype=torch.float32)
        self.register_buffer("frequencies", frequencies, persistent=False)

    def forward(self, fractions: Tensor) -> Tensor:
        """Embed fractions, (..., N) in [0, 1], as (..., N, width)."""
        return torch.relu(self.layer(torch.cos(fractions[..., None] * self.frequencies)))


class PaperQuantileCritic(nn.Module):
    """The paper's critic: state (.) quantile -> 128 (.) action -> 128 -> 1 (fig. 5)."""

    def __init__(self, settings: NetworkSettings, extra: int = 0) -> None:
        super().__init__()
        self.encoder = make_encoder(settings, extra)
        hidden = settings.hidden_width
        self.embedding = CosineEmbedding(settings.cosines, self.encoder.width)
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.action = nn.Linear(ACTIONS, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, seen: Seen, action: Tensor, fractions: Tensor) -> Tensor:
        """Give the return's quantiles (B, N) at `fractions`, (N,) or (B, N)."""
        state = self.encoder(seen)[:, None, :]
        hidden = torch.relu(self.hidden1(state * self.embedding(fractions)))
        hidden = hidden * torch.relu(self.action(action))[:, None, :]
        value: Tensor = self.output(torch.relu(self.hidden2(hidden)))
        return value.squeeze(-1)


class QuantileCritic(nn.Module):
    """Our critic: (state, action) -> 256 (.) quantile -> 128 -> 1, fractions shared by the batch.

    What does not depend on the fraction is computed once a sample instead of once a fraction; one
    wide layer remains that is computed for every pair of them.
    """

    def __init__(self, settings: NetworkSettings, extra: int = 0) -> None:
        super().__init__()
        self.encoder = make_encoder(settings, extra)
        wide, hidden = settings.feature_width, settings.hidden_width
        self.state = nn.Linear(self.encoder.width, wide)
        self.action = nn.Linear(ACTIONS, wide, bias=False)
        self.joined = nn.Linear(wide, wide)
        self.embedding = CosineEmbedding(settings.cosines, wide)
        self.hidden = nn.Linear(wide, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, seen: Seen, action: Tensor, fractions: Tensor) -> Tensor:
        """Give the return's quantiles (B, N) at `fractions`, (N,)."""
        joined = torch.relu(self.state(self.encoder(seen)) + self.action(action))
        joined = torch.relu(self.joined(joined))
        # W (x (.) phi_n) = (W diag(phi_n)) x: the fractions are the batch's, so they go into the
        # weights, and no (B, N, width) product is ever formed.
        embedding = self.embedding(fractions)
        weight = self.hidden.weight.to(embedding.dtype) * embedding[:, None, :]
        hidden = functional.linear(
            joined, weight.flatten(0, 1), self.hidden.bias.repeat(len(embedding))
        )
        hidden = torch.relu(hidden).view(len(joined), len(embedding), -1)
        value: Tensor = self.output(hidden)
        return value.squeeze(-1)


def make_quantile_critic(
    settings: NetworkSettings, extra: int = 0
) -> PaperQuantileCritic | QuantileCritic:
    """Build the critic that the settings name, with `extra` more ego features."""
    kind = PaperQuantileCritic if settings.critic == "paper" else QuantileCritic
    return kind(settings, extra)


class Pilot(nn.Module):
    """A deterministic policy from raw observations: what is evaluated, deployed and exported."""

    factors: Tensor
    risk: Tensor | None

    def __init__(
        self, see: See, actor: nn.Module, radius_margin: float = 1.0, risk: float | None = None
    ) -> None:
        """Put a network behind its features.

        Parameters
        ----------
        see, actor
            Features without parameters, and the network over them.
        radius_margin
            [-] Multiplies every observed radius: perception sees a part of a hull, about 0.8 of
            its radius on average.
        risk
            [-] Level that holds where none is asked for, of a network conditioned on it.
        """
        super().__init__()
        self.see = see
        self.actor = actor
        factors = torch.tensor([1.0, 1.0, 1.0, 1.0, radius_margin], device=see.ego_scale.device)
        self.register_buffer("factors", factors, persistent=False)
        level = None if risk is None else torch.full((1, 1), risk, device=factors.device)
        self.register_buffer("risk", level, persistent=False)

    def forward(self, observations: Observations, risk: Tensor | None = None) -> Tensor:
        """Give actions (B, 2) in [-1, 1], at risk levels, (B, 1) or (1, 1), if there are any."""
        wary = observations._replace(objects=observations.objects * self.factors)
        seen = self.see(wary)
        if self.risk is not None:
            seen = heed(seen, self.risk if risk is None else risk)
        action: Tensor = self.actor(seen)
        return action
