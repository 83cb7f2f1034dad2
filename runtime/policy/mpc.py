"""Model predictive control: the paper's second classical baseline (sec. VI), after Hagen et al.

Each of the 25 actions is simulated over a horizon of control steps, the other vessels going
straight on; the cheapest is taken. Source of the cost's terms: Hagen, Kufoalor, Brekke, Johansen
(2018), MPC-based collision avoidance strategy for existing marine vessel guidance systems, ICRA.
"""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.colregs import Situation, situation, starboard_turn
from twinscrew.runtime.policy.planner import Planner, PlannerSettings, seen_objects
from twinscrew.runtime.policy.rollout import Rollout, alignment
from twinscrew.runtime.settings import Count, NonNegative, Positive


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
    """The predictive controller as a policy."""

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
