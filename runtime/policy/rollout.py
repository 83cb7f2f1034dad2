"""What the vessel would do: the paper's 25 actions, simulated at once from the present state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.vessel_model import VesselModel

LEVELS = (-1000.0, -500.0, 0.0, 500.0, 1000.0)
"""[N/s] The action set A of each propeller (paper, sec. V-B)."""


def action_set() -> Float64:
    """Give the 25 actions, (25, 2) [N/s], the gentlest first: it wins where costs are equal."""
    left, right = np.meshgrid(LEVELS, LEVELS, indexing="ij")
    actions = np.column_stack([left.ravel(), right.ravel()])
    return actions[np.argsort(np.abs(actions).sum(axis=1), kind="stable")]


@dataclass(frozen=True, slots=True)
class Rollout:
    """K actions, each held for T control steps, in the present frame B."""

    pose: Float64
    """(T, K, 3) x, y [m], heading [rad] relative to now, at the end of each step."""
    nu: Float64
    """(T, K, 3) Surge, sway [m/s], yaw rate [rad/s] in the vessel's frame then."""
    thrust: Float64
    """(T, K, 2) [N] Left, right, during each step."""

    @property
    def velocity(self) -> Float64:
        """[m/s] (T, K, 2) Velocities in the present frame B."""
        cosine, sine = np.cos(self.pose[..., 2]), np.sin(self.pose[..., 2])
        surge, sway = self.nu[..., 0], self.nu[..., 1]
        return np.stack([cosine * surge - sine * sway, sine * surge + cosine * sway], axis=-1)


def rollout(
    model: VesselModel, ego: Float64, actions: Float64, *, steps: int, step_s: float, dt: float
) -> Rollout:
    """Simulate actions that are repeated every control step.

    Parameters
    ----------
    model
        The vessel.
    ego : (7,) float
        The ego state of an `Observation`.
    actions : (K, 2) float64
        Thrust rates [N/s].
    steps : int
        Number of control steps T.
    step_s : float
        Length of a control step [s].
    dt : float
        Longest time step of the integration [s].
    """
    count, substeps = len(actions), max(1, int(np.ceil(step_s / dt - 1e-9)))
    pose, nu = np.zeros((count, 3)), np.tile(np.asarray(ego[2:5], dtype=np.float64), (count, 1))
    thrust = np.tile(np.asarray(ego[5:7], dtype=np.float64), (count, 1))
    poses, nus = np.empty((steps, count, 3)), np.empty((steps, count, 3))
    thrusts = np.empty((steps, count, 2))
    for step in range(steps):
        thrust = model.apply(thrust, actions, step_s)
        for _ in range(substeps):
            pose, nu = model.step(pose, nu, thrust, step_s / substeps)
        poses[step], nus[step], thrusts[step] = pose, nu, thrust
    return Rollout(pose=poses, nu=nus, thrust=thrusts)


def alignment(heading: Float64, velocity: Float64, direction: Float64) -> tuple[Float64, Float64]:
    """Give how far headings are off a direction, and the speed made good along it.

    Parameters
    ----------
    heading : (...) float64
        [rad]
    velocity : (..., 2) float64
        [m/s] In the frame of the direction.
    direction : (..., 2) float64
        Of any length; straight ahead where it is zero.

    Returns
    -------
    angle : (...) float64
        [rad] In [0, pi].
    speed : (...) float64
        [m/s]
    """
    length = np.hypot(direction[..., 0], direction[..., 1])[..., None]
    unit = np.where(length > 0.0, direction / np.where(length > 0.0, length, 1.0), _AHEAD)
    difference = heading - np.arctan2(unit[..., 1], unit[..., 0])
    angle: Float64 = np.abs(np.remainder(difference + np.pi, 2 * np.pi) - np.pi)
    speed: Float64 = (velocity * unit).sum(axis=-1)
    return angle, speed


_AHEAD = np.array([1.0, 0.0])
