"""Scenario-based predictive control: a few courses and speeds, each seen to a far horizon.

The other planners of the paper hold a thrust rate for 4 s. This one chooses among alterations of
course and speed, as a mariner does, and looks as far ahead as the rules reach: each candidate is
followed for the whole horizon by a hull that turns and slows as fast as ours can, while the others
keep course and speed. A candidate costs by how near and how soon it comes to anything, by a broken
rule, and by what it leaves of the way to the goal. For who has to give way itself the boat stands
on until there is little time left.

Source: Johansen, Perez, Cristofaro (2016), Ship collision avoidance and COLREGS compliance using
simulation-based control behavior selection with predictive hazard assessment, IEEE Trans. Intell.
Transp. Syst. 17 (12).
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from msgspec import Meta

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.planners import seen_objects
from twinscrew.runtime.policy.velocity_obstacles import (
    VelocityPlanner,
    VelocitySettings,
    role_of,
    time_to,
    towards_goal,
)
from twinscrew.runtime.settings import NonNegative, Positive


class ScenarioMpcSettings(VelocitySettings, frozen=True, kw_only=True):
    """Candidates, horizon and cost."""

    alterations_deg: Annotated[tuple[float, ...], Meta(min_length=1)] = (
        *(0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 120.0),
        *(-15.0, -30.0, -45.0, -60.0, -75.0, -90.0, -120.0),
    )
    """[deg] From the course to the goal, to starboard; the first wins where costs are equal."""
    speeds: Annotated[tuple[float, ...], Meta(min_length=1)] = (1.0, 0.5, 0.0)
    """[-] Shares of the speed to the goal."""
    horizon_s: Positive = 20.0
    """[s] How far ahead."""
    step_s: Positive = 0.5
    """[s] Time step of the prediction."""
    turn_rate_radps: Positive = 0.4
    """[rad/s] How fast the hull's course turns,"""
    slowing_mps2: Positive = 0.4
    """[m/s2] and how fast its speed changes."""
    contact_m: NonNegative = 1.0
    """[m] Surfaces so near are in contact;"""
    near_m: Positive = 5.0
    """[m] nothing farther is a risk."""
    contact_cost: NonNegative = 100.0
    """[-] Of a contact now; less by how late it would be,"""
    risk_cost: NonNegative = 5.0
    """[-] of surfaces `contact_m` apart, falling to nothing at `near_m`."""
    rule_cost: NonNegative = 10.0
    """[-] Of passing on the wrong side; and of a turn to port by who gives way or acts late."""
    late_s: Positive = 15.0
    """[s] Time constant with which a cost falls with the time until then."""
    alter_cost: NonNegative = 1.0
    """[1/rad] Of an alteration of course,"""
    port_cost: NonNegative = 0.5
    """[1/rad] more for one to port,"""
    slow_cost: NonNegative = 2.0
    """[-] of all the speed taken off."""


class ScenarioMpcPolicy(VelocityPlanner):
    """Chooses an alteration of course and speed that is safe and lawful to a far horizon."""

    name = "sbmpc"

    def __init__(self, settings: ScenarioMpcSettings | None = None) -> None:
        self.settings: ScenarioMpcSettings = settings or ScenarioMpcSettings()
        super().__init__(self.settings)

    def velocity(self, observation: Observation) -> Float64:
        """Give the velocity wanted now, (2,) [m/s], frame B."""
        wanted = towards_goal(observation, self.settings)
        turn, share = candidates(self.settings)
        best = int(np.argmin(candidate_costs(observation, wanted, self.settings)))
        angle = math.atan2(wanted[1], wanted[0]) + turn[best]
        size = share[best] * math.hypot(*wanted)
        return np.array([size * math.cos(angle), size * math.sin(angle)])


def candidates(settings: ScenarioMpcSettings) -> tuple[Float64, Float64]:
    """Give every pair of an alteration [rad] and a share of the speed [-], (C,) each."""
    turns = np.radians(settings.alterations_deg)
    return np.tile(turns, len(settings.speeds)), np.repeat(settings.speeds, len(turns))


def candidate_costs(
    observation: Observation, wanted: Float64, settings: ScenarioMpcSettings
) -> Float64:
    """Give what each of the `candidates` costs, (C,), for a velocity to the goal (2,) [m/s].

    Who gives way, or acts late for one who should have, leaves the other to port, and does not turn
    to port, where there is a risk of collision on the way to the goal (rules 14, 15, 17 c).
    """
    turn, share = candidates(settings)
    cost = settings.alter_cost * np.abs(turn) + settings.slow_cost * (1.0 - share)
    cost += settings.port_cost * np.maximum(-turn, 0.0)
    way = paths(observation, wanted, settings)
    worst = np.zeros(len(turn))
    for x, y, v_x, v_y, radius in seen_objects(observation, settings).tolist():
        p, v_other = np.array([x, y]), np.array([v_x, v_y])
        reach = radius + settings.own_radius_m
        danger = _danger(way, p, v_other, reach, settings)
        if math.hypot(v_x, v_y) >= settings.colregs.min_speed_mps:
            until_s = time_to(p, wanted - v_other, reach + settings.contact_m)
            role = role_of(p, v_other, wanted, settings)
            if role == "stand_on" and until_s > settings.stand_on_s:
                continue  # she is to keep out of the way, and has the time for it
            if role in ("give_way", "stand_on") and until_s <= settings.horizon_s:
                wrong = _passes_starboard(way, p, v_other, settings) | (turn < 0.0)
                danger += settings.rule_cost * wrong
        worst = np.maximum(worst, danger)
    total: Float64 = cost + worst
    return total


def paths(observation: Observation, wanted: Float64, settings: ScenarioMpcSettings) -> Float64:
    """Give where the hull would be on each candidate, (T, C, 2) [m], frame B of now."""
    turn, share = candidates(settings)
    v = observation.ego[2:4].astype(np.float64)
    dt, count = settings.step_s, max(1, round(settings.horizon_s / settings.step_s))
    speed = np.full(len(turn), math.hypot(*v))
    moving = speed[0] >= settings.colregs.min_speed_mps
    course = np.full(len(turn), math.atan2(v[1], v[0]) if moving else 0.0)
    target = math.atan2(wanted[1], wanted[0]) + turn
    size = share * math.hypot(*wanted)
    place, way = np.zeros((len(turn), 2)), np.empty((count, len(turn), 2))
    most_turn, most_change = settings.turn_rate_radps * dt, settings.slowing_mps2 * dt
    for k in range(count):
        off = np.remainder(target - course + np.pi, 2 * np.pi) - np.pi
        course = course + np.clip(off, -most_turn, most_turn)
        speed = speed + np.clip(size - speed, -most_change, most_change)
        place = place + dt * speed[:, None] * np.column_stack([np.cos(course), np.sin(course)])
        way[k] = place
    return way


def _danger(
    way: Float64, p: Float64, v_other: Float64, reach: float, settings: ScenarioMpcSettings
) -> Float64:
    """Give the cost of coming near one object that keeps its course, (C,): the worst moment's."""
    time = settings.step_s * np.arange(1, len(way) + 1)
    offset = p + time[:, None] * v_other
    d = np.hypot(*(way - offset[:, None]).transpose(2, 0, 1)) - reach
    span = max(settings.near_m - settings.contact_m, 1e-6)
    near = np.clip((settings.near_m - d) / span, 0.0, 1.0)
    cost = settings.risk_cost * near + settings.contact_cost * (d <= settings.contact_m)
    worst: Float64 = (cost * np.exp(-time / settings.late_s)[:, None]).max(axis=0)
    return worst


def _passes_starboard(
    way: Float64, p: Float64, v_other: Float64, settings: ScenarioMpcSettings
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Tell, (C,), on which candidates the other is to starboard when it is nearest."""
    time = settings.step_s * np.arange(1, len(way) + 1)
    relative = (p + time[:, None] * v_other)[:, None] - way
    nearest = np.hypot(relative[..., 0], relative[..., 1]).argmin(axis=0)
    each = np.arange(way.shape[1])
    velocity = np.gradient(way, settings.step_s, axis=0)[nearest, each] - v_other
    there = relative[nearest, each]
    side = velocity[:, 0] * there[:, 1] - velocity[:, 1] * there[:, 0]
    starboard: np.ndarray[tuple[int], np.dtype[np.bool_]] = side > 0.0
    return starboard
