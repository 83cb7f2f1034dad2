"""The losses of every agent, as pure functions of tensors.

B is the batch, N and M are numbers of quantile fractions, A of discrete actions, K of atoms.
"""

from __future__ import annotations

import torch
from torch import Tensor


def stratified_fractions(count: int, generator: torch.Generator) -> Tensor:
    """Draw quantile fractions, (count,), one in each of `count` equal parts of [0, 1].

    Their mean has far less variance than that of independent draws. Multiplied by alpha they keep
    to the worst share of the returns: the mean of the quantiles is then their CVaR.
    """
    offset = torch.rand(count, generator=generator)
    return (torch.arange(count) + offset) / count


def uniform_fractions(batch: int, count: int, generator: torch.Generator) -> Tensor:
    """Draw quantile fractions, (batch, count), each from U([0, 1]) (paper, alg. 2)."""
    return torch.rand(batch, count, generator=generator)


def draw_fractions(
    batch: int, count: int, generator: torch.Generator, *, stratified: bool
) -> Tensor:
    """Draw fractions as a learner is told: (count,) for all samples, or (batch, count)."""
    if stratified:
        return stratified_fractions(count, generator)
    return uniform_fractions(batch, count, generator)


def worst_share(risk: Tensor, count: int) -> Tensor:
    """Give weights, (B, count), that turn stratified quantiles into their CVaR at (B, 1) levels.

    The first k of n stratified fractions cover [0, k / n]: with alpha = k / n the mean of their
    quantiles is that of the worst share alpha of the returns, without bias.
    """
    inside = torch.arange(count, device=risk.device) + 0.5 < risk * count
    return inside / (risk * count)


def td_target(reward: Tensor, discount: Tensor, next_value: Tensor) -> Tensor:
    """Give r + gamma Z(s'), (B, M), of rewards (B,), discounts (B,) and next values (B, M).

    `discount` is gamma^n, and 0 where the episode ended: a truncated one is bootstrapped.
    """
    return reward[:, None] + discount[:, None] * next_value


def huber(error: Tensor, kappa: float) -> Tensor:
    """Give L_kappa(u): u^2 / 2 up to kappa, linear beyond (paper, eq. 9)."""
    size = error.abs()
    return torch.where(size <= kappa, 0.5 * error * error, kappa * (size - 0.5 * kappa))


def quantile_huber(quantiles: Tensor, targets: Tensor, fractions: Tensor, kappa: float) -> Tensor:
    """Give the quantile Huber loss of each sample, (B,) (paper, eqs. 8 to 10).

    Parameters
    ----------
    quantiles : (B, N)
        Z at `fractions`.
    targets : (B, M)
        Samples of the return; no gradient is taken through them.
    fractions : (N,) or (B, N)
        tau_i.
    kappa
        Where the loss turns from square to linear.
    """
    error = targets.detach()[:, None, :] - quantiles[:, :, None]
    weight = (fractions[..., None] - (error.detach() < 0).float()).abs()
    return (weight * huber(error, kappa)).mean(2).sum(1) / kappa


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
