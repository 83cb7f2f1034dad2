"""The reward, paper, eq. (16): what a vessel is told about the decision it just made."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.policy.colregs import (
    ColregsSettings,
    Situation,
    situation,
    starboard_turn,
)
from twinscrew.runtime.settings import NonNegative, Settings

Mask = NDArray[np.bool_]
NonPositive = Annotated[float, Meta(le=0.0)]


class RewardSettings(Settings, frozen=True):
    """The paper's weights (sec. V)."""

    step: float = -0.1
    """[-] Every decision."""
    forward: NonNegative = 1.0
    """[1/m] For every metre that the goal came nearer."""
    collision: NonPositive = -5.0
    """[-] Touching anything."""
    goal: NonNegative = 10.0
    """[-] Reaching the goal."""
    colregs: NonPositive = -0.1
    """[1/rad] Times the angle by which the course lies to port of the compliant one."""
    which: Literal["closest", "first"] = "closest"
    """Who is checked: the closest vessel (paper) or the first that qualifies (reference)."""
    rules: ColregsSettings = ColregsSettings()
    """The zones."""


def reward(
    progress: Float64, collided: Mask, reached: Mask, turn: Float64, settings: RewardSettings
) -> Float32:
    """Give the reward, eq. (16); all arguments and the result are (E, V).

    Parameters
    ----------
    progress
        [m] By how much the distance to the goal decreased.
    collided, reached
        Whether the vessel touched anything, or is at its goal.
    turn
        [rad] max(delta, 0) in a COLREGs situation, else 0.
    settings
        The weights.
    """
    total = settings.step + settings.forward * progress + settings.colregs * turn
    total += settings.collision * collided
    total += settings.goal * reached
    return total.astype(np.float32)


def colregs_turn(
    objects: Float32, mask: Float32, v_ego: Float64, ego_radius: float, settings: RewardSettings
) -> Float64:
    """Give max(delta, 0) [rad] towards the vessel that is checked, 0 without such a situation.

    Parameters
    ----------
    objects, mask : (E, V, K, 5), (E, V, K) float32
        As perceived, frame B.
    v_ego : (E, V, 2) float
        [m/s] Surge and sway over ground.
    ego_radius : float
        [m]
    settings
        Zones, and who is checked.

    Returns
    -------
    turn : (E, V) float64
    """
    turn = np.zeros(mask.shape[:2])
    where, checked = _checked(objects, mask, v_ego, settings)
    if len(checked):
        ego = v_ego[where]
        angle = starboard_turn(checked[:, :2], checked[:, 4], ego, ego_radius, settings.rules)
        turn[where] = angle
    return turn


def _checked(
    objects: Float32, mask: Float32, v_ego: Float64, settings: RewardSettings
) -> tuple[tuple[NDArray[np.intp], ...], Float64]:
    """Give where there is a COLREGs situation, and the object, (n, 5), it is with."""
    rules = settings.rules
    slow = rules.min_speed_mps**2
    candidate = np.square(objects[..., 2]) + np.square(objects[..., 3]) >= slow
    candidate &= mask > 0
    candidate &= (np.square(v_ego).sum(axis=-1) >= slow)[..., None]
    if settings.which == "closest":  # nearest first: the first moving object of each vessel
        episode, vessel = np.nonzero(candidate.any(axis=-1))
        k = candidate.argmax(axis=-1)[episode, vessel]
    else:
        episode, vessel, k = np.nonzero(candidate)
    chosen = objects[episode, vessel, k].astype(np.float64)
    kind = situation(chosen[:, :2], chosen[:, 2:4], v_ego[episode, vessel], rules)
    kept = np.flatnonzero(kind != Situation.NONE)
    if settings.which == "first":  # of those that qualify, the first of each vessel
        row = episode * mask.shape[1] + vessel
        kept = kept[np.unique(row[kept], return_index=True)[1]]
    return (episode[kept], vessel[kept]), chosen[kept]
