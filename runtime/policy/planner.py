"""What both classical baselines share: simulate the paper's 25 actions, take the best."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.colregs import ColregsSettings
from twinscrew.runtime.policy.observation import require_finite
from twinscrew.runtime.policy.rollout import Rollout, action_set, rollout
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.settings import NonNegative, Positive, Settings


class PlannerSettings(Settings, frozen=True, kw_only=True):
    """What a planner knows of its vessel and of what it is shown."""

    own_radius_m: NonNegative = 2.795
    """[m] Radius of the own hull."""
    radius_factor: Positive = 1.25
    """[-] Objects count as larger by this: what is seen of them has 0.8 of their radius, in the
    training environment and, as the side that faces the LiDAR is seen alone, at sea."""
    period_s: Positive = 0.5
    """[s] Time between two decisions."""
    integration_s: Positive = 0.1
    """[s] Longest time step of the simulated vessel."""
    colregs: ColregsSettings = ColregsSettings()
    vessel: VesselParameters = VesselParameters()


class Planner(ABC):
    """A policy that simulates every action and takes the cheapest; it remembers nothing."""

    name: str

    def __init__(self, settings: PlannerSettings) -> None:
        self._plan = settings
        self._model = VesselModel(settings.vessel)
        self._actions = action_set()

    @property
    def period_s(self) -> float:
        """[s] Time between two decisions."""
        return self._plan.period_s

    def act(self, observation: Observation) -> Float64:
        """Give the thrust rates, (2,) [N/s], of the cheapest action.

        Raises
        ------
        PolicyError
            The observation is not finite.
        """
        require_finite(observation)
        action: Float64 = self._actions[int(np.argmin(self.costs(observation)))].copy()
        return action

    @abstractmethod
    def costs(self, observation: Observation) -> Float64:
        """Give what each action of `action_set` costs, (25,)."""

    def reset(self) -> None:  # noqa: B027  (nothing is remembered, in any planner)
        """Do nothing: every decision starts afresh."""

    def _simulate(self, observation: Observation, steps: int, step_s: float) -> Rollout:
        ego = observation.ego.astype(np.float64)
        dt = self._plan.integration_s
        return rollout(self._model, ego, self._actions, steps=steps, step_s=step_s, dt=dt)


def seen_objects(observation: Observation, settings: PlannerSettings) -> Float64:
    """Give the objects that are no padding, (K, 5) float64, with the radii that they count with."""
    objects = observation.objects[observation.mask > 0].astype(np.float64)
    objects[:, 4] *= settings.radius_factor
    return objects
