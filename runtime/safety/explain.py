"""Says in one sentence what the vessel is doing and why, with the numbers that it is made of.

`explain` is a pure function of a decision and of what was known when it was made. The runtime
publishes and records its answer beside the decision; the live page and a replay of an older
recording call the same function. A neural network has no reasons to give: the sentence names the
rule or the track that is most urgent, what the thrust does, and how near the alternatives would
come. It claims no more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages.types import Decision, Explanation, Float64, Odometry, Tracks
from twinscrew.runtime.policy.colregs import DEFAULT as COLREGS
from twinscrew.runtime.policy.colregs import Situation, situation
from twinscrew.runtime.policy.observation import DEFAULTS as OBSERVATION
from twinscrew.runtime.safety.events import (
    ASSURANCE_INTERVENED,
    ASSURANCE_RELEASED,
    GUARD_TRIPPED,
    PERCEPTION_ERROR,
    POLICY_ERROR,
)

OWN_RADIUS_M = OBSERVATION.own_radius_m
"""[m] The own hull as a circle: what the policy is trained with and the reports measure from."""
NEAR_M = 5.0
"""[m] A track that passes farther off than this is not worth a sentence."""
AHEAD_S = 10.0
"""[s] Nor is one that is nearest later than this: 30 m at full speed."""
TURN_N = 150.0
"""[N] Propellers that differ by more turn the vessel; three tenths of what the assurance uses."""
ALTERNATIVE_RAD = math.radians(30.0)
"""[rad] How far the alternatives to port and to starboard alter course: clearly, as rule 8 asks."""
RULES = {Situation.HEAD_ON: 14, Situation.GIVE_WAY: 15}
_STAND_ON = 17
_FAILURES = (PERCEPTION_ERROR.name, POLICY_ERROR.name, GUARD_TRIPPED.name)


@dataclass(frozen=True, slots=True)
class Approach:
    """How near each track comes if nobody alters course or speed."""

    cpa_m: Float64
    """[m] (K,) Least distance between the two circles' surfaces; negative: they overlap."""
    tcpa_s: Float64
    """[s] (K,) When; 0 if it is growing already."""


def closest_approach(
    p: Float64, v: Float64, radius: Float64, own_radius_m: float = OWN_RADIUS_M
) -> Approach:
    """Give the closest points of approach.

    Parameters
    ----------
    p : (K, 2) float64
        [m] The others' centres, seen from the own one.
    v : (K, 2) float64
        [m/s] Their velocities less the own one, in the same axes.
    radius : (K,) float64
        [m] Their radii.
    own_radius_m
        [m] The own one.
    """
    square = (v**2).sum(axis=-1)
    moving = square > 1e-12  # below 1 um/s nothing comes nearer
    tcpa_s = np.where(
        moving, np.maximum(-(p * v).sum(axis=-1) / np.where(moving, square, 1.0), 0.0), 0.0
    )
    nearest = p + v * tcpa_s[..., None]
    return Approach(np.hypot(nearest[..., 0], nearest[..., 1]) - radius - own_radius_m, tcpa_s)


def velocity_over_ground(odometry: Odometry) -> Float64:
    """Give north and east velocity, (2,) [m/s]."""
    velocity: Float64 = (rotation_from_quaternion(odometry.q_NB) @ odometry.velocity_B)[:2]
    return velocity


def assurance_manoeuvre(decision: Decision, before: str) -> str:
    """Give what the assurance does after a decision: the event's words, or nothing.

    Parameters
    ----------
    before
        What it did after the decision before: a manoeuvre goes on until it is released.
    """
    for event in decision.events:
        if event.name == ASSURANCE_INTERVENED.name:
            before = event.detail
        elif event.name == ASSURANCE_RELEASED.name:
            before = ""
    return before


def explain(
    decision: Decision,
    odometry: Odometry,
    goal_N: Float64 | None,
    *,
    engaged: bool,
    assurance: str = "",
    holding: bool = False,
) -> Explanation:
    """Say what a decision does and why.

    Parameters
    ----------
    decision
        With the tracks that it was made from.
    odometry
        The vessel's state then.
    goal_N : (2,) float64 or None
        [m] North and east of the present goal.
    engaged
        Whether the thrust acts.
    assurance
        What the assurance does instead of the policy's command (`assurance_manoeuvre`).
    holding
        Whether it is to stay at the goal, and is near enough to do so.
    """
    failures = [event for event in decision.events if event.name in _FAILURES]
    if failures:
        why = failures[0]
        return _said(decision, f"Propellers at rest: {why.name.replace('_', ' ')}, {why.detail}.")
    if holding and engaged and not assurance and goal_N is not None:
        action = _action(decision.thrust, odometry)
        off_m = _distance(odometry, goal_N)
        return _said(decision, f"Holding its place, {off_m:.1f} m off, {action}.")
    if decision.arrived and not holding:
        off = "" if goal_N is None else f", {_distance(odometry, goal_N):.1f} m from the goal"
        return _said(decision, f"Arrived: propellers at rest{off}.")
    if goal_N is None:
        return _said(decision, "Waiting for a goal: propellers at rest.")
    if not engaged:
        what = "the autopilot is not armed, not in MANUAL, does not obey, or an input is stale"
        return _said(decision, f"Not driving, propellers at rest: {what}.")
    return _under_way(decision, odometry, goal_N, assurance)


def _under_way(
    decision: Decision, odometry: Odometry, goal_N: Float64, assurance: str
) -> Explanation:
    tracks = decision.tracks
    v_ego = velocity_over_ground(odometry)
    p = tracks.p_N - odometry.position_N[:2]
    approach = closest_approach(p, tracks.v_N - v_ego, tracks.radius)
    duties = _duties(p, tracks.v_N, v_ego)
    action = _action(decision.thrust, odometry)
    chosen = _most_urgent(approach, duties)
    others = _alternatives(p, tracks, v_ego) if chosen is not None else ""
    if assurance:
        # The event reads "brake: the command meets track 3 in 1.0 s at 1.4 m/s".
        name, _, why = assurance.partition(": ")
        sentence = f"The assurance overrides the policy ({name})"
        return _said(decision, f"{sentence}{': ' if why else ''}{why}.{others}", chosen, approach)
    if chosen is None:
        where = f"{_distance(odometry, goal_N):.1f} m off, bearing {_bearing(odometry, goal_N)}"
        nothing = f"nothing comes within {NEAR_M:g} m in {AHEAD_S:g} s"
        return _said(decision, f"Sailing to the goal, {where}, {action}; {nothing}.")
    track, duty = int(tracks.id[chosen]), int(duties[chosen])
    still = np.hypot(*tracks.v_N[chosen]) < COLREGS.min_speed_mps
    cpa_m, tcpa_s = float(approach.cpa_m[chosen]), float(approach.tcpa_s[chosen])
    near = f"contact in {tcpa_s:.0f} s" if cpa_m <= 0.0 else f"CPA {cpa_m:.1f} m in {tcpa_s:.0f} s"
    if tcpa_s == 0.0:
        near = f"{max(cpa_m, 0.0):.1f} m off and opening"
    sentence = _duty_words(track, duty, action, still=bool(still))
    return _said(decision, f"{sentence}: {near}.{others}", chosen, approach, duty)


def _duties(p: Float64, v_N: Float64, v_ego: Float64) -> Float64:
    """Give the rule that is between the vessel and each track: 14, 15, 17 (stand on) or 0."""
    ego = np.broadcast_to(v_ego, v_N.shape)
    asked = situation(p, v_N, ego)
    of_others = situation(-p, ego, v_N)
    rules = np.zeros(len(p))
    rules[of_others == Situation.GIVE_WAY] = _STAND_ON
    for kind, rule in RULES.items():
        rules[asked == kind] = rule
    return rules


def _most_urgent(approach: Approach, duties: Float64) -> int | None:
    """Give the track to speak of: a rule's before others, then the one that comes too near first.

    None if nothing comes near.
    """
    near = (approach.cpa_m < NEAR_M) & (approach.tcpa_s < AHEAD_S)
    # Far ones that recede are over; a vessel in a rule's zone counts however far it will pass.
    going = (approach.tcpa_s > 0.0) | (approach.cpa_m < 1.0)
    counts = (near & going) | (np.isin(duties, list(RULES.values())) & (approach.tcpa_s < AHEAD_S))
    if not counts.any():
        return None
    by_rule = np.where(np.isin(duties, list(RULES.values())), 0, 1)
    order = np.lexsort((approach.cpa_m + 0.5 * approach.tcpa_s, by_rule))
    return int(next(k for k in order if counts[k]))


def _duty_words(track: int, duty: int, action: str, *, still: bool) -> str:
    to_starboard = "starboard" in action or "slowing" in action or "astern" in action
    match duty:
        case 15 if to_starboard:
            return f"Giving way to track {track} on the starboard side (rule 15), {action}"
        case 15:
            return f"Asked to give way to track {track} on the starboard side (rule 15), {action}"
        case 14:
            return f"Meeting track {track} head-on (rule 14), {action}"
        case 17 if action == "holding course":
            return f"Standing on for track {track}, which has to give way (rule 17), {action}"
        case 17:
            return f"Track {track} has to give way (rule 17), yet {action}"
    what = "which stands still" if still else "no rule applies"
    return f"Keeping clear of track {track} ({what}), {action}"


def _action(thrust: Float64, odometry: Odometry) -> str:
    left, right = (float(side) for side in thrust)
    mean, difference = (left + right) / 2, left - right
    words = []
    if abs(difference) > TURN_N:
        words.append(f"turning to {'starboard' if difference > 0 else 'port'}")
    if mean < -TURN_N / 3:
        words.append("slowing down" if odometry.velocity_B[0] > 0.3 else "going astern")
    return " and ".join(words) or "holding course"


def _alternatives(p: Float64, tracks: Tracks, v_ego: Float64) -> str:
    """Say how near the nearest track comes on present course, on others, and after stopping."""
    c, s = math.cos(ALTERNATIVE_RAD), math.sin(ALTERNATIVE_RAD)
    north, east = v_ego.tolist()  # clockwise is to starboard: north to east
    to_port, to_starboard = (
        (c * north + s * east, c * east - s * north),
        (
            c * north - s * east,
            c * east + s * north,
        ),
    )
    ways = np.array([(north, east), to_port, to_starboard, (0.0, 0.0)])
    v = tracks.v_N - ways[:, None, :]
    tcpa_s = np.minimum(closest_approach(p, v, tracks.radius).tcpa_s, AHEAD_S)
    places = p + v * tcpa_s[..., None]
    gaps = np.hypot(places[..., 0], places[..., 1]) - tracks.radius - OWN_RADIUS_M
    turn = f"{round(math.degrees(ALTERNATIVE_RAD))}\u00b0 to"
    names = ("straight on", f"{turn} port", f"{turn} starboard", "stopping")
    told = [f"{name} {_gap(gap)}" for name, gap in zip(names, gaps.min(axis=1), strict=True)]
    return f" Nearest within {AHEAD_S:g} s: {', '.join(told)}."


def _gap(gap_m: float) -> str:
    return "contact" if gap_m <= 0.0 else f"{gap_m:.1f} m"


def _distance(odometry: Odometry, goal_N: Float64) -> float:
    return float(np.hypot(*(goal_N - odometry.position_N[:2])))


def _bearing(odometry: Odometry, goal_N: Float64) -> str:
    north, east = goal_N - odometry.position_N[:2]
    return f"{round(math.degrees(math.atan2(east, north))) % 360:03d}\u00b0"


def _said(
    decision: Decision,
    sentence: str,
    chosen: int | None = None,
    approach: Approach | None = None,
    duty: int = 0,
) -> Explanation:
    about: Sequence[float] = (-1, math.nan, math.nan)
    if chosen is not None and approach is not None:
        about = (decision.tracks.id[chosen], approach.cpa_m[chosen], approach.tcpa_s[chosen])
    return Explanation(
        stamp_ns=decision.stamp_ns,
        sequence=decision.sequence,
        sentence=sentence,
        track=int(about[0]),
        rule=duty,
        cpa_m=float(about[1]),
        tcpa_s=float(about[2]),
    )
