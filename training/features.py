"""What an observation means for the networks: fixed scales, and the geometry of an encounter.

Everything here is part of the exported graph, so it uses only a few, plain tensor operations, and
it is finite for every finite input.
"""

from __future__ import annotations

import torch
from torch import Tensor

from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel


class Scales(Settings, frozen=True):
    """The numbers that bring raw SI units to about one."""

    length_m: Positive = 20.0
    """[m] The perception range (paper, sec. IV)."""
    speed_mps: Positive = 3.0
    """[m/s] About the greatest speed ahead (paper, sec. III)."""
    yaw_rate_radps: Positive = 0.7
    """[rad/s] About the steady yaw rate at full thrust difference in the training dynamics."""
    thrust_n: Positive = 1000.0
    """[N] The greatest thrust (paper, sec. III)."""
    gap_m: Positive = 5.0
    """[m] Where distances between hulls begin to matter: one vessel length."""
    time_s: Positive = 10.0
    """[s] Encounters further ahead than this are all alike: about the range at closing speed."""
    ego_radius_m: NonNegative = load_vessel().radius_m
    """[m] Collision radius of the default vessel, half its diagonal."""


EGO_FEATURES = 11
OBJECT_FEATURES = 14
_TINY = 1e-3  # [m, m/s] keeps directions and times finite at rest and at no distance


def raw_scales(scales: Scales) -> tuple[Tensor, Tensor]:
    """Give the factors, (7,) and (5,), that bring raw ego and object columns to about one."""
    length, speed = 1.0 / scales.length_m, 1.0 / scales.speed_mps
    thrust = 1.0 / scales.thrust_n
    ego = [length, length, speed, speed, 1.0 / scales.yaw_rate_radps, thrust, thrust]
    return torch.tensor(ego), torch.tensor([length, length, speed, speed, length])


def _length(vector: Tensor) -> Tensor:
    return torch.sqrt((vector * vector).sum(-1, keepdim=True) + _TINY**2)


def ego_features(ego: Tensor, scales: Scales) -> Tensor:
    """Give the scaled ego state with the goal's distance and direction.

    Parameters
    ----------
    ego : (B, 7)
        Raw ego states, frame B.

    Returns
    -------
    (B, 11)
        The scaled state; the goal's direction (2), its distance in units of `length_m`, and a
        closeness that resolves the last metres.
    """
    goal = ego[:, :2]
    distance = _length(goal)
    near = scales.gap_m / (scales.gap_m + distance)
    factors = raw_scales(scales)[0].to(ego)
    return torch.cat([ego * factors, goal / distance, distance / scales.length_m, near], dim=1)


def object_features(ego: Tensor, objects: Tensor, scales: Scales) -> Tensor:
    """Give what matters in an encounter with each object.

    Parameters
    ----------
    ego : (B, 7)
        Raw ego states, frame B.
    objects : (B, K, 5)
        Raw object states, frame B; velocities over ground.

    Returns
    -------
    (B, K, 14)
        The scaled state (5); direction (2); relative velocity (2); gap between the hulls and its
        closeness; closing speed; time to, and gap at, the closest approach if neither turns.
    """
    position, velocity, radius = torch.split(objects, [2, 2, 1], dim=-1)
    relative = velocity - ego[:, None, 2:4]
    distance = _length(position)
    direction = position / distance
    reach = radius + scales.ego_radius_m
    gap = distance - reach
    closing = -(direction * relative).sum(-1, keepdim=True)
    # Straight tracks p + v t are closest at t = -(p . v) / |v|^2.
    time = closing * distance / ((relative * relative).sum(-1, keepdim=True) + _TINY)
    time = time.clamp(0.0, scales.time_s)
    miss = _length(position + relative * time) - reach
    factors = raw_scales(scales)[1].to(objects)
    return torch.cat(
        [
            objects * factors,
            direction,
            relative / scales.speed_mps,
            gap / scales.length_m,
            scales.gap_m / (scales.gap_m + gap.clamp(min=0.0)),
            closing / scales.speed_mps,
            time / scales.time_s,
            miss / scales.gap_m,
        ],
        dim=-1,
    )
