"""What each vessel sees: its own state and the nearest objects around it, in its own frame.

The same definitions as `runtime.policy.observation`, for V vessels in E episodes at once. Vectors
in the plane are complex numbers, north + i east: a product with exp(i heading) turns B into N.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.training.imperfections import Imperfections
from twinscrew.training.perception_noise import Noise

Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]


class Observations(NamedTuple):
    """What the vessels see, raw SI units, frame B; zeros for vessels that are not on the water."""

    ego: Float32
    """(E, V, 7) Goal x, y [m]; surge, sway [m/s]; yaw rate [rad/s]; thrusts [N]. Eq. (2)."""
    objects: Float32
    """(E, V, K, 5) x, y [m]; vx, vy over ground [m/s]; radius [m]; nearest first. Eq. (3)."""
    mask: Float32
    """(E, V, K) 1 where there is an object, 0 where there is padding."""


class Things(NamedTuple):
    """O objects in E episodes; the first V of them are the vessels themselves."""

    position: Complex
    """(E, O) [m] [N]"""
    velocity: Complex
    """(E, O) [m/s] [N]"""
    radius: Float64
    """(E, O) [m] or (O,)"""
    there: Mask
    """(E, O) Whether there is such an object."""


def see_ego(
    position: Complex, heading: Complex, goal: Complex, nu: Float64, thrust: Float64
) -> Float32:
    """Give the ego states, (E, V, 7), eq. (2).

    Parameters
    ----------
    position, goal : (E, V) complex
        [m] [N]
    heading : (E, V) complex
        [-] exp(i heading).
    nu : (3, E, V)
        Surge, sway [m/s], yaw rate [rad/s].
    thrust : (2, E, V)
        Left, right [N].
    """
    ego = np.empty((*position.shape, 7), np.float32)
    goal_B = (goal - position) * heading.conj()
    ego[..., 0] = goal_B.real
    ego[..., 1] = goal_B.imag
    ego[..., 2:5] = nu.transpose(1, 2, 0)
    ego[..., 5:7] = thrust.transpose(1, 2, 0)
    return ego


def see_objects(
    heading: Complex,
    things: Things,
    noise: Noise,
    range_m: float,
    most: int,
    imperfections: Imperfections | None = None,
) -> tuple[Float32, Float32]:
    """Give the perceived objects, eq. (3), nearest surface first, and their mask.

    Parameters
    ----------
    heading : (E, V) complex
        [-] exp(i heading) of the vessels.
    things
        Everything on the water.
    noise
        How wrong they are seen, (E, V, O).
    range_m : float
        [m] An object is seen while the nearest point of its true circle, at its perceived place,
        is within this.
    most : int
        K: how many objects are given.
    imperfections
        What else goes wrong.

    Returns
    -------
    objects : (E, V, K, 5) float32
    mask : (E, V, K) float32
    """
    vessels = heading.shape[1]
    place = things.position.astype(np.complex64)
    p = place[:, None, :] - place[:, :vessels, None] + noise.position
    distance = np.abs(p)
    v = things.velocity.astype(np.complex64)[:, None, :] + noise.velocity
    true_radius = np.broadcast_to(things.radius, things.there.shape)[:, None, :].astype(np.float32)
    radius = true_radius * noise.radius
    seen = distance <= true_radius + np.float32(range_m)
    seen &= things.there[:, None, :]
    seen[:, np.arange(vessels), np.arange(vessels)] = False
    if imperfections is not None:
        p, v, radius, seen = imperfections.distort(p, v, radius, seen)
        distance = np.abs(p)
    turn = heading.conj().astype(np.complex64)[..., None]
    p, v = p * turn, v * turn
    features = np.empty((*p.shape, 5), np.float32)
    for column, part in enumerate((p.real, p.imag, v.real, v.imag, radius)):
        features[..., column] = part
    surface = np.where(seen, distance - radius, np.float32(np.inf))
    return _nearest(features, surface, most)


def _nearest(features: Float32, surface: Float32, most: int) -> tuple[Float32, Float32]:
    """Give the rows, (E, V, K, 5), of the smallest finite surface distances, sorted."""
    episodes, vessels, count = surface.shape
    order = np.argsort(surface, axis=-1, kind="stable")[..., :most]
    rows = order + count * np.arange(episodes * vessels).reshape(episodes, vessels, 1)
    mask = np.zeros((episodes, vessels, most), np.float32)
    objects = np.zeros((episodes, vessels, most, 5), np.float32)
    kept = order.shape[-1]
    mask[..., :kept] = surface.reshape(-1).take(rows) < np.inf
    objects[..., :kept, :] = features.reshape(-1, 5).take(rows, axis=0)
    objects *= mask[..., None]
    objects += 0.0  # and no negative zeros
    return objects, mask
