"""Artificial potential field: the paper's first classical baseline (sec. VI).

The goal attracts, objects repel, and virtual obstacles stand where COLREGs forbid to go. Of the 25
actions the one is taken whose velocity, one decision later, fits the force best.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.colregs import Situation, situation
from twinscrew.runtime.policy.planner import Planner, PlannerSettings, seen_objects
from twinscrew.runtime.policy.rollout import alignment
from twinscrew.runtime.settings import NonNegative, Positive


class ApfSettings(PlannerSettings, frozen=True, kw_only=True):
    """The potential field (paper, sec. VI)."""

    attraction: Positive = 50.0
    """[-] k_att."""
    repulsion: NonNegative = 500.0
    """[-] k_rep."""
    reach_m: Positive = 15.0
    """[m] d_0: what is farther does not repel."""
    nearest_m: Positive = 0.5
    """[m] Distances count as no less than this: the potential has a pole."""
    clearance_m: NonNegative = 1.0
    """[m] Distances are between the hulls' surfaces, less this. The paper's formula has the
    distance between positions: with it, 500 and 50 let nearly all vessels touch."""
    virtual_obstacles: Annotated[int, Meta(ge=0)] = 4
    """[-] How many stand where COLREGs forbid to go."""
    virtual_spacing_m: Positive = 5.0
    """[m] Distance between them."""
    speed_weight: NonNegative = 0.15
    """[rad s/m] What a wrong speed along the force costs, against a wrong heading."""
    arrival_s: Positive = 4.0
    """[s] The force asks for a speed of |F| / k_att a so long: near the goal, what is left of the
    way in this time. The authors' code wants all speed along F always; so a vessel circles its
    goal at its turning radius, which is why they count 4 m as there."""


class ApfPolicy(Planner):
    """The potential field as a policy."""

    name = "apf"

    def __init__(self, settings: ApfSettings | None = None) -> None:
        self.settings = settings or ApfSettings()
        super().__init__(self.settings)

    def costs(self, observation: Observation) -> Float64:
        """Give the difference between the velocity one decision later and the force, (25,).

        In direction, by the heading: a hull goes where its bow points, and one decision is too
        short to tell by the velocity where a turn leads. In size, along the force.
        """
        settings = self.settings
        force = total_force(observation, settings)
        after = self._simulate(observation, steps=1, step_s=settings.period_s)
        angle, speed = alignment(after.pose[0, :, 2], after.velocity[0], force)
        wanted = math.hypot(*force) / (settings.attraction * settings.arrival_s)
        wrong = np.abs(speed - min(wanted, settings.vessel.top_speed))
        cost: Float64 = angle + settings.speed_weight * wrong
        return cost


def total_force(observation: Observation, settings: ApfSettings) -> Float64:
    """Give F = -grad U_att - grad U_rep, (2,), frame B.

    Of moving objects only those count that are approached. What stands still always counts: who
    has just turned away from a buoy would turn back to it at once, and so on for ever.
    """
    goal = observation.ego[:2].astype(np.float64)
    velocity = observation.ego[2:4].astype(np.float64)
    p, v, radius = obstacles(observation, settings)
    repels = is_static(v, settings) | (np.sum(p * (velocity - v), axis=1) > 0.0)
    repulsion = repulsive_forces(p[repels], radius[repels], goal, settings)
    force: Float64 = attractive_force(goal, settings) + repulsion.sum(axis=0)
    return force


def is_static(v: Float64, settings: ApfSettings) -> NDArray[np.bool_]:
    """Tell, (K,), which velocities, (K, 2) [m/s], are no vessel's under way."""
    static: NDArray[np.bool_] = np.hypot(v[:, 0], v[:, 1]) < settings.colregs.min_speed_mps
    return static


def attractive_force(goal: Float64, settings: ApfSettings) -> Float64:
    """Give -grad of U_att = k_att d_g^2 / 2, (2,), for a goal seen at (2,) [m]."""
    force: Float64 = settings.attraction * goal
    return force


def repulsive_forces(p: Float64, radius: Float64, goal: Float64, settings: ApfSettings) -> Float64:
    """Give -grad of U_rep = k_rep (1/d - 1/d_0)^2 d_g^2 / 2, (K, 2), one row an obstacle.

    Both factors depend on where the vessel is: the first part pushes away from the obstacle, the
    second pulls to the goal.

    Parameters
    ----------
    p : (K, 2) float64
        Obstacles [m], frame B.
    radius : (K,) float64
        What is taken off their distance [m].
    goal : (2,) float64
        The goal [m], frame B.
    settings
        The field.
    """
    centre = np.hypot(p[:, 0], p[:, 1])
    d = np.maximum(centre - radius, settings.nearest_m)
    away = -p / np.maximum(centre, 1e-9)[:, None]
    nearness = np.maximum(1.0 / d - 1.0 / settings.reach_m, 0.0)
    push = settings.repulsion * nearness / d**2 * float(goal @ goal)
    pull = settings.repulsion * nearness**2
    force: Float64 = push[:, None] * away + pull[:, None] * goal
    return force


def obstacles(observation: Observation, settings: ApfSettings) -> tuple[Float64, Float64, Float64]:
    """Give everything that repels: positions [m], velocities [m/s], both (K, 2), radii (K,) [m]."""
    objects = seen_objects(observation, settings)
    virtual = virtual_obstacles(observation, settings)
    seen = np.concatenate([objects, virtual])
    return seen[:, :2], seen[:, 2:4], seen[:, 4] + settings.own_radius_m + settings.clearance_m


def virtual_obstacles(observation: Observation, settings: ApfSettings) -> Float64:
    """Give objects, (M, 5), that stand where COLREGs forbid to go (Naeem et al., 2016).

    Crossing: ahead of the stand-on vessel, so that the own vessel passes astern of it. Head-on:
    to starboard of the other vessel, so that both pass port to port. Each is as large as the
    vessel that it belongs to.
    """
    objects = seen_objects(observation, settings)
    v_ego = np.broadcast_to(observation.ego[2:4].astype(np.float64), (len(objects), 2))
    found = situation(objects[:, :2], objects[:, 2:4], v_ego, settings.colregs)
    steps = settings.virtual_spacing_m * np.arange(1, settings.virtual_obstacles + 1)
    rows = [np.empty((0, 5))]
    for other, which in zip(objects, found, strict=True):
        if which == Situation.NONE:
            continue
        ahead = other[2:4] / math.hypot(*other[2:4])
        side = ahead if which == Situation.GIVE_WAY else np.array([-ahead[1], ahead[0]])
        standing = np.zeros((len(steps), 5))
        standing[:, :2] = other[:2] + steps[:, None] * side
        standing[:, 4] = other[4]
        rows.append(standing)
    return np.concatenate(rows)
