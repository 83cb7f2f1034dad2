"""The paper's two classical baselines (sec. VI): artificial potential field, predictive control.

Both simulate the same 25 actions from the present state and take the cheapest. Their numbers are
those of the default vessel; another hull is planned for in its own units (`hull_units`), so that
one set of numbers serves all.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.colregs import (
    ColregsSettings,
    Situation,
    situation,
    starboard_turn,
)
from twinscrew.runtime.policy.observation import PAPER, Shown, require_finite
from twinscrew.runtime.policy.vessel_model import (
    Rollout,
    VesselModel,
    VesselParameters,
    action_set,
    alignment,
    rollout,
)
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel


class PlannerSettings(Settings, frozen=True, kw_only=True):
    """What a planner knows of its vessel and of what it is shown."""

    own_radius_m: NonNegative = load_vessel().radius_m
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

    @property
    def shown(self) -> Shown:
        """What the planner takes."""
        return PAPER

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
    """[-] How many there are where COLREGs forbid to go."""
    virtual_spacing_m: Positive = 5.0
    """[m] Distance between them."""
    speed_weight: NonNegative = 0.15
    """[rad s/m] What a wrong speed along the force costs, against a wrong heading."""
    look_s: Positive = 0.5
    """[s] The velocity is compared so long after the decision: one decision period."""
    arrival_s: Positive = 4.0
    """[s] The force asks for a speed of |F| / k_att a so long: near the goal, what is left of the
    way in this time. The authors' code wants all speed along F always; so a vessel circles its
    goal at its turning radius, which is why they count 4 m as there."""


class ApfPolicy(Planner):
    """The potential field: the goal attracts, objects repel.

    Virtual obstacles stand where COLREGs forbid to go. The action is taken whose velocity, a
    moment later, fits the force best.
    """

    name = "apf"

    def __init__(self, settings: ApfSettings | None = None) -> None:
        self.settings = settings or ApfSettings()
        super().__init__(self.settings)

    def costs(self, observation: Observation) -> Float64:
        """Give the difference between the velocity `look_s` later and the force, (25,).

        In direction, by the heading: a hull goes where its bow points, and the time is too short
        to tell by the velocity where a turn leads. In size, along the force.
        """
        settings = self.settings
        force = total_force(observation, settings)
        after = self._simulate(observation, steps=1, step_s=settings.look_s)
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


class MpcSettings(PlannerSettings, frozen=True, kw_only=True):
    """The horizon and the cost (paper, sec. VI; the authors' code where it is silent)."""

    steps: Count = 5
    """[-] T: control steps in the horizon."""
    step_s: Positive = 0.8
    """[s] Length of one, so that the horizon is 4 s. The paper does not say it. With the authors'
    0.2 s, or one decision period, the way round a buoy is never seen: vessels hit it or lie there.
    """
    integration_s: Positive = 0.2
    """[s] Longest time step of the simulated vessel: 4 s ahead need not be known to the metre."""
    goal_steps: Count = 1
    """[-] The way to the goal is judged over these first control steps: soon after the vessel
    decides afresh. Over the whole horizon a turn would seem to last, and braking would win."""
    goal_weight: NonNegative = 20.0
    """[1/rad] What heading off the goal costs."""
    speed_weight: NonNegative = 0.7
    """[rad s/m] What speed towards the goal is worth against heading towards it. With the authors'
    0.15, to lie before a buoy for ever is cheaper than to turn by half a radian."""
    safe_distance_m: Positive = 4.0
    """[m] d_safe, between surfaces: nothing farther is a risk. The authors' 10 m between centres,
    less the hulls of two vessels."""
    risk_floor_m: Positive = 2.0
    """[m] The risk rises no more when nearer than this."""
    risk_power: NonNegative = 4.0
    """[-] q: how steeply the risk rises with nearness."""
    risk_decay: NonNegative = 1.0
    """[-] p: how fast the risk falls with the time until then, in control steps."""
    contact_cost: NonNegative = 50.0
    """[-] What a contact costs."""
    contact_margin_m: NonNegative = 1.0
    """[m] Surfaces so near are in contact."""
    colregs_cost: NonNegative = 10.0
    """[-] kappa M: what a violation of COLREGs costs."""
    violation_rad: Positive = 0.15
    """[rad] Costs that when the course is 9 degrees short of the compliant one, on average."""
    transition_cost: NonNegative = 2.0
    """[-] lambda: what it costs to bring a vessel from port to starboard."""
    transition_range_m: Positive = 10.0
    """[m] Between centres; a vessel farther off may change sides."""
    effort_weight: NonNegative = 0.0005
    """[1/(N s)] What thrust costs."""


class MpcPolicy(Planner):
    """Predictive control: each action over a horizon, the other vessels going straight on.

    Source of the cost's terms: Hagen, Kufoalor, Brekke, Johansen (2018), MPC-based collision
    avoidance strategy for existing marine vessel guidance systems, ICRA.
    """

    name = "mpc"

    def __init__(self, settings: MpcSettings | None = None) -> None:
        self.settings = settings or MpcSettings()
        super().__init__(self.settings)

    def costs(self, observation: Observation) -> Float64:
        """Give H, (25,), of each action of `action_set`."""
        settings = self.settings
        future = self._simulate(observation, settings.steps, settings.step_s)
        goal = observation.ego[:2].astype(np.float64)
        objects = seen_objects(observation, settings)
        cost = goal_cost(future, goal, settings) + effort_cost(future, settings)
        if len(objects):
            per_object = collision_cost(future, objects, settings)
            per_object += colregs_cost(future, objects, settings)
            cost += per_object.max(axis=-1)
        return cost


def goal_cost(future: Rollout, goal: Float64, settings: MpcSettings) -> Float64:
    """Give what each action loses on the way to the goal, (K,), on average over `goal_steps`."""
    first = slice(settings.goal_steps)
    pose = future.pose[first]
    angle, speed = alignment(pose[..., 2], future.velocity[first], goal - pose[..., :2])
    cost: Float64 = settings.goal_weight * (angle - settings.speed_weight * speed).mean(axis=0)
    return cost


def effort_cost(future: Rollout, settings: MpcSettings) -> Float64:
    """Give the cost of the thrust over the horizon, (K,)."""
    impulse = np.abs(future.thrust).sum(axis=(0, 2)) * settings.step_s
    cost: Float64 = settings.effort_weight * impulse
    return cost


def relative_positions(future: Rollout, objects: Float64, settings: MpcSettings) -> Float64:
    """Give where objects, going straight on, are seen from, (T, K, M, 2) [m], axes of now."""
    time = settings.step_s * np.arange(1, settings.steps + 1)
    there = objects[:, :2] + time[:, None, None] * objects[:, 2:4]
    return there[:, None, :, :] - future.pose[:, :, None, :2]


def collision_cost(future: Rollout, objects: Float64, settings: MpcSettings) -> Float64:
    """Give max_t C R, (K, M): how near, how soon. Hagen et al. (2018), eqs. 5 and 6."""
    p = relative_positions(future, objects, settings)
    d = np.hypot(p[..., 0], p[..., 1]) - objects[:, 4] - settings.own_radius_m
    contact = d <= settings.contact_margin_m
    cost = np.maximum(settings.safe_distance_m - d, 0.0) + settings.contact_cost * contact
    nearness = settings.safe_distance_m / np.maximum(d, settings.risk_floor_m)
    soon = 1.0 / np.arange(1, settings.steps + 1)[:, None, None] ** settings.risk_decay
    worst: Float64 = (cost * nearness**settings.risk_power * soon).max(axis=0)
    return worst


def colregs_cost(future: Rollout, objects: Float64, settings: MpcSettings) -> Float64:
    """Give kappa M + lambda T, (K, M), averaged over the horizon.

    M is in proportion to how far the course falls short of the compliant one, as in the paper's
    reward. The maximum over time, as published, would charge every action for the violation of the
    first instant, which none can avoid, and so tell none apart. The course is the heading, at no
    less than twice the speed at which the rules begin: stopping is no way out of them.
    """
    p = relative_positions(future, objects, settings)
    rules = settings.colregs
    heading = future.pose[..., 2]
    speed = np.hypot(future.nu[..., 0], future.nu[..., 1])
    course = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    v = np.maximum(speed, 2.0 * rules.min_speed_mps)[..., None] * course
    v_ego = np.broadcast_to(v[:, :, None, :], p.shape)
    v_other = np.broadcast_to(objects[:, 2:4], p.shape)
    bound = situation(p, v_other, v_ego, rules) != Situation.NONE
    short = starboard_turn(p, objects[:, 4], v_ego, settings.own_radius_m, rules)
    violation = (bound * short).mean(axis=0) / settings.violation_rad
    transition = to_starboard(future, objects, p, settings).mean(axis=0)
    cost: Float64 = settings.colregs_cost * violation + settings.transition_cost * transition
    return cost


def to_starboard(future: Rollout, objects: Float64, p: Float64, settings: MpcSettings) -> Float64:
    """Tell, (T, K, M), where a near vessel that is to port now will be to starboard."""
    moving = np.hypot(objects[:, 2], objects[:, 3]) >= settings.colregs.min_speed_mps
    now_to_port = objects[:, 1] < 0.0
    cosine, sine = np.cos(future.pose[..., 2]), np.sin(future.pose[..., 2])
    starboard = cosine[..., None] * p[..., 1] - sine[..., None] * p[..., 0] > 0.0
    near = np.hypot(p[..., 0], p[..., 1]) <= settings.transition_range_m
    crossed: Float64 = (moving & now_to_port & starboard & near).astype(np.float64)
    return crossed
