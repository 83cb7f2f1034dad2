"""Encoders: from a batch of observations to what the networks think of it.

Padding has no influence.
`PaperEncoder` is the paper's (fig. 5). `SetEncoder` is ours: the same answer in whatever order the
objects come, and the encounter's geometry given instead of left to be learnt.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import torch
from msgspec import Meta
from torch import Tensor, nn

from twinscrew.runtime.messages.types import OBSERVED_OBJECTS
from twinscrew.runtime.settings import Settings
from twinscrew.training.features import (
    EGO_FEATURES,
    OBJECT_FEATURES,
    Scales,
    ego_features,
    object_features,
    raw_scales,
)
from twinscrew.training.observations import EGO_COLUMNS, OBJECT_COLUMNS, Observations

Width = Annotated[int, Meta(ge=8, le=2048)]


class EncoderSettings(Settings, frozen=True):
    """How observations become features."""

    kind: Literal["set", "paper"] = "set"
    """"paper" is the paper's encoder; "set" pools one shared object network by maximum and sum."""
    normalise: bool = True
    """Scale raw SI units to about one first ("paper" only; "set" always does)."""
    ego_width: Width = 64
    """[-] Features of the ego state ("set" only; the paper's has 56)."""
    object_width: Width = 96
    """[-] Features of an object ("set" only; the paper's has 40)."""
    scales: Scales = Scales()
    """The units of the normalised features."""


class Seen(NamedTuple):
    """A batch of observations as features without parameters: the networks' input."""

    ego: Tensor
    """(B, E)"""
    objects: Tensor
    """(B, K, F); zeros where there is padding."""
    present: Tensor
    """(B, K, 1): 1 where there is an object."""


def heed(seen: Seen, risk: Tensor) -> Seen:
    """Give what is seen with a risk level, (B, 1) or (1, 1) in (0, 1], as one more ego feature."""
    return seen._replace(ego=torch.cat([seen.ego, risk.expand(seen.ego.shape[0], 1)], dim=1))


class See(nn.Module):
    """Turns observations into features; nothing here is learnt, so it is done once a batch."""

    ego_scale: Tensor
    object_scale: Tensor

    def __init__(self, settings: EncoderSettings) -> None:
        super().__init__()
        self.geometry = settings.kind == "set"
        self.scales = settings.scales
        ones = torch.ones(EGO_COLUMNS), torch.ones(OBJECT_COLUMNS)
        ego, objects = raw_scales(settings.scales) if settings.normalise else ones
        self.register_buffer("ego_scale", ego, persistent=False)
        self.register_buffer("object_scale", objects, persistent=False)

    def forward(self, observations: Observations) -> Seen:
        """Give the features of a batch; whatever lies in padded rows has no influence."""
        ego, objects, mask = observations
        present = mask[:, :, None]
        objects = torch.where(present > 0, objects, 0.0)
        if self.geometry:
            objects = object_features(ego, objects, self.scales)
            ego = ego_features(ego, self.scales)
        else:
            ego, objects = ego * self.ego_scale, objects * self.object_scale
        return Seen(ego, objects, present)


class PaperEncoder(nn.Module):
    """Ego 7 -> 56, each object 5 -> 40 with shared weights, concatenated to 256 (paper, fig. 5)."""

    EGO, OBJECT = 56, 40

    def __init__(self, extra: int = 0) -> None:
        super().__init__()
        self.width = self.EGO + OBSERVED_OBJECTS * self.OBJECT
        self.ego = nn.Linear(EGO_COLUMNS + extra, self.EGO)
        self.object = nn.Linear(OBJECT_COLUMNS, self.OBJECT)

    def forward(self, seen: Seen) -> Tensor:
        """Give features (B, 256)."""
        theirs = torch.relu(self.object(seen.objects)) * seen.present
        return torch.cat([torch.relu(self.ego(seen.ego)), theirs.flatten(1)], dim=1)


class SetEncoder(nn.Module):
    """One network over every object, pooled by maximum and sum, beside the ego state's features."""

    def __init__(self, settings: EncoderSettings, extra: int = 0) -> None:
        super().__init__()
        wide = settings.object_width
        self.width = settings.ego_width + 2 * wide
        self.ego = nn.Linear(EGO_FEATURES + extra, settings.ego_width)
        self.object_seen = nn.Linear(OBJECT_FEATURES, wide)
        self.object_ego = nn.Linear(EGO_FEATURES + extra, wide, bias=False)
        self.object_hidden = nn.Linear(wide, wide)

    def forward(self, seen: Seen) -> Tensor:
        """Give features (B, ego width + 2 object width)."""
        # A layer over [object, ego] is the sum of two: the ego's share is the same for all objects.
        each = self.object_seen(seen.objects) + self.object_ego(seen.ego)[:, None, :]
        each = torch.relu(self.object_hidden(torch.relu(each))) * seen.present
        # After a ReLU nothing is below zero, so padding never is the maximum.
        return torch.cat([torch.relu(self.ego(seen.ego)), each.amax(1), each.sum(1)], dim=1)


def make_encoder(settings: EncoderSettings, extra: int = 0) -> PaperEncoder | SetEncoder:
    """Build the encoder that the settings name, with `extra` more ego features (`heed`)."""
    return PaperEncoder(extra) if settings.kind == "paper" else SetEncoder(settings, extra)
