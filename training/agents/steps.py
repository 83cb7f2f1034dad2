"""What every update is made of: a step down a gradient, a learning rate, a target that follows."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.optim import Optimizer


def descend(loss: Tensor, learners: Sequence[tuple[nn.Module, Optimizer]], norm: float) -> None:
    """Take one step down the gradient of a loss by these networks alone, each norm limited."""
    parts = [list(network.parameters()) for network, _ in learners]
    gradients = iter(torch.autograd.grad(loss, [p for part in parts for p in part]))
    for part, (_, optimizer) in zip(parts, learners, strict=True):
        for parameter in part:
            parameter.grad = next(gradients)
        nn.utils.clip_grad_norm_(part, norm)
        optimizer.step()


def adam(module: nn.Module, rate: float) -> torch.optim.Adam:
    """Give Adam over a module's parameters."""
    return torch.optim.Adam(module.parameters(), lr=rate, fused=True)


def anneal(optimizer: Optimizer, rate: float, final: float, progress: float) -> None:
    """Set the learning rate: linear from `rate` to `final` times it over progress in [0, 1]."""
    for group in optimizer.param_groups:
        group["lr"] = rate * (1.0 - (1.0 - final) * min(max(progress, 0.0), 1.0))


def blend(target: nn.Module, online: nn.Module, rate: float) -> None:
    """Update a target network: theta' <- rate theta + (1 - rate) theta' (alg. 2)."""
    with torch.no_grad():
        for old, new in zip(target.parameters(), online.parameters(), strict=True):
            old.lerp_(new, rate)


def wide(enabled: bool, device: str = "cpu") -> torch.autocast:
    """Multiply matrices in bfloat16 inside this context, if enabled."""
    return torch.autocast(device, dtype=torch.bfloat16, enabled=enabled)
