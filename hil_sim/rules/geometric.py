"""Judge A: the rules of the road as geometry of courses over ground.

It goes by courses, circles and predicted distances, as runtime/policy/colregs.py does, but sees
farther than that file's zones, which stay the policy's own definition of a situation: a judge must
see an encounter that the policy overlooks. Rules are those of the International Regulations for
Preventing Collisions at Sea 1972 for vessels in sight of one another. Distances are in lengths of
the vessel that is judged.

A meeting begins with a risk of collision: within sight and on present courses and speeds the two
would come nearer than `risk_gap`, soon, and this for `confirm_s`. It ends when they draw apart, or
one has ended. In it the vessel kept

- rule 13 (overtaking: it comes up from more than 22.5 degrees abaft the other's beam, and faster):
  if it stayed clear of the other;
- rule 14 (head-on: courses nearly reciprocal, each nearly ahead of the other): if the other passed
  on its port side, and it did not turn to port before;
- rule 15 (the other crosses from starboard): if it did not cross ahead and stayed clear;
- rule 17 (the other crosses from port, or overtakes): if it kept course and speed until the other
  had plainly not given way, and did not then turn to port for a vessel on its port side;

and in all, if the two did not touch. What is possible without contact is found by trial: the
vessel alters course and speed at the beginning in steps, everybody else moves as they really did.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.experiments.encounters import crossed_ahead, passed_to_port
from twinscrew.hil_sim.rules.evidence import STEP_S, Body, Finding, Role, Tracks
from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Positive, Settings

Flags = NDArray[np.bool_]


class GeometricSettings(Settings, frozen=True, kw_only=True):
    """What the rules leave open, for vessels of the judged one's size. Lengths are its own."""

    sight: Positive = 12.0
    """[lengths] Farther off nobody is met."""
    risk_gap: Positive = 1.0
    """[lengths] Who would pass nearer than this, outline to outline, is in risk of collision,"""
    risk_s: Positive = 20.0
    """[s] if it is to happen within this time."""
    confirm_s: Positive = 1.0
    """[s] So long a risk must last."""
    under_way_s: Positive = 4.0
    """[s] From its start on a vessel gathers way so long, and keeps no course yet."""
    least_speed_mps: Positive = 0.5
    """[m/s] Who is slower has stopped (paper, sec. IV): rules 13 to 17 say nothing of the two."""
    clear: Positive = 0.2
    """[lengths] Who stays farther off is well clear: 1 m, as in colregs.py."""
    nearly: Positive = math.radians(22.5)
    """[rad] Courses and bearings off by less are "nearly" reciprocal, or ahead."""
    abaft: Positive = math.radians(112.5)
    """[rad] From the bow: 22.5 degrees abaft the beam (rule 13 b)."""
    keeps_course: Positive = math.radians(15.0)
    """[rad] Who alters course by less keeps it."""
    slower: Positive = 0.7
    """[-] Who goes at less than this share of the speed has slowed,"""
    faster: Positive = 1.5
    """[-] at more has sped up."""
    plain_s: Positive = 8.0
    """[s] With the risk still there so long before contact, the other has not given way."""
    past_s: Positive = 2.0
    """[s] Who draws apart for so long is past and clear."""
    readable: Positive = math.radians(30.0)
    """[rad] An alteration of this size is readily apparent (rule 8 b), or half the speed off;"""
    early_s: Positive = 4.0
    """[s] so long before the two are nearest it is in ample time."""
    first: Positive = math.radians(10.0)
    """[rad] Less is no alteration."""
    lasts_s: Positive = 5.0
    """[s] Its size is reached within this time."""
    turn_rate_radps: Positive = 0.5
    """[rad/s] How fast a vessel could have turned (docs/simulator.md: turning circle),"""
    slowing_mps2: Positive = 0.3
    """[m/s2] and lost way, in the trials of what was possible."""


DEFAULT = GeometricSettings()
TURNS_DEG = (0, 15, 30, 45, 60, 75, 90, 120, -30, -60, -90)
"""[deg] Alterations that are tried for what was possible,"""
SPEEDS = (1.0, 0.5, 0.1)
"""[-] each with these shares of the speed."""


@dataclass(frozen=True, slots=True)
class _Two:
    """T samples of two vessels."""

    p: Float64
    """[m] [N] (T, 2, 2) The judged one's and the other's positions; NaN where one is not there."""
    v: Float64
    """[m/s] [N] (T, 2, 2)"""
    heading: Float64
    """[rad] [N] (T, 2)"""
    bodies: tuple[Body, Body]
    ended_s: float
    """[s] When the first of the two ended."""


@dataclass(frozen=True, slots=True)
class _Meeting:
    """Samples of a meeting: [begin, end), and when the roles were clear."""

    begin: int
    clear: int
    end: int
    role: Role


def judge(tracks: Tracks, settings: GeometricSettings = DEFAULT) -> tuple[Finding, ...]:
    """Give what every vessel of ours did in its meetings, ordered by their beginnings."""
    found = []
    for ego, body in enumerate(tracks.bodies):
        for other in range(len(tracks.bodies)) if body.ours else ():
            if other != ego:
                two = _two(tracks, ego, other)
                found += [
                    _finding(tracks, two, (ego, other), meeting, settings)
                    for meeting in _meetings(two, tracks.times, settings)
                ]
    return tuple(sorted(found, key=lambda one: (one.begin_s, one.ego, one.other)))


def velocities(p: Float64) -> Float64:
    """Give velocities (T, 2) [m/s] of positions every `STEP_S`, over 1 s; NaN at the ends."""
    v = np.full_like(p, np.nan)
    half = round(0.5 / STEP_S)
    v[half:-half] = (p[2 * half :] - p[: -2 * half]) / (2 * half * STEP_S)
    return v


def _two(tracks: Tracks, ego: int, other: int) -> _Two:
    pose = tracks.pose_N[:, [ego, other]]
    bodies = tracks.bodies[ego], tracks.bodies[other]
    ended = min(math.inf if body.ended_s is None else body.ended_s for body in bodies)
    v = np.stack([velocities(pose[:, k, :2]) for k in range(2)], axis=1)
    return _Two(pose[..., :2], v, pose[..., 2], bodies, ended)


# -- Meetings, and the roles in them.


def _meetings(two: _Two, times: Float64, s: GeometricSettings) -> Iterator[_Meeting]:
    length = two.bodies[0].length_m
    risk, _ = _risk(two, two.v[:, 0], s)
    with np.errstate(invalid="ignore"):
        speed = np.hypot(two.v[..., 0], two.v[..., 1])
        distance = np.hypot(*(two.p[:, 1] - two.p[:, 0]).T)
        risk &= (speed >= s.least_speed_mps).all(axis=1) & (distance <= s.sight * length)
        apart = np.diff(distance, append=np.nan) > 0.0
    risk &= (times >= s.under_way_s) & (times <= two.ended_s)
    confirm, past = round(s.confirm_s / STEP_S), round(s.past_s / STEP_S)
    begin = 0
    while (begin := _lasting(risk, confirm, begin)) < len(risk):
        clear = min(begin + confirm, len(risk) - 1)
        end = min(_lasting(apart, past, clear) + past, len(risk))
        there = np.isfinite(distance[begin:end]) & (times[begin:end] <= two.ended_s + STEP_S)
        end = begin + (int(there.argmin()) if not there.all() else len(there))
        role = _role(two, min(clear, end - 1), s)
        if role is not None and end - begin > 1:
            yield _Meeting(begin, min(clear, end - 1), end, role)
        begin = max(end, begin + 1)


def _lasting(flags: Flags, least: int, begin: int) -> int:
    """Give where, from `begin` on, `flags` first stays true for `least` samples; else the end."""
    count = 0
    for k in range(begin, len(flags)):
        count = count + 1 if flags[k] else 0
        if count > least:
            return k - least
    return len(flags)


def _risk(two: _Two, v_ego: Float64, s: GeometricSettings) -> tuple[Flags, Float64]:
    """Tell, (T,), whether the two are in risk of collision, and in which time [s] they pass.

    With velocities (T, 2) [m/s] of the judged vessel that may be others than it really had.
    """
    p, v = two.p[:, 1] - two.p[:, 0], two.v[:, 1] - v_ego
    with np.errstate(invalid="ignore", divide="ignore"):
        until = -(p * v).sum(axis=1) / np.maximum((v * v).sum(axis=1), 1e-9)
        at = p + v * until[:, None]
        gap = np.hypot(*at.T) - two.bodies[0].radius_m - _across(two.bodies[1])
        soon = (until >= 0.0) & (until <= s.risk_s)
        near: Flags = soon & (gap <= s.risk_gap * two.bodies[0].length_m)
    return near, until


def _across(body: Body) -> float:
    """[m] Give how far a body counts from its middle: its circle, or for a ship the mean half."""
    return body.radius_m if body.circle else (body.length_m + body.beam_m) / 4


def _role(two: _Two, k: int, s: GeometricSettings) -> Role | None:
    """Say what the judged vessel is to do at a sample; None if the rules ask nothing."""
    p, (v_ego, v_other) = two.p[k, 1] - two.p[k, 0], two.v[k]
    course, their = math.atan2(v_ego[1], v_ego[0]), math.atan2(v_other[1], v_other[0])
    if not math.isfinite(course + their):
        return None
    speed, theirs = math.hypot(*v_ego), math.hypot(*v_other)
    bearing = _wrapped(math.atan2(p[1], p[0]) - course)
    aspect = _wrapped(math.atan2(-p[1], -p[0]) - their)
    if abs(aspect) > s.abaft and speed > theirs:
        return "overtaking"
    if abs(bearing) > s.abaft:
        return "stand_on" if theirs > speed else None
    reciprocal = abs(_wrapped(their - course - math.pi)) <= s.nearly
    if reciprocal and max(abs(bearing), abs(aspect)) <= s.nearly:
        return "head_on"
    return "give_way" if bearing > 0.0 else "stand_on"


def _wrapped(angle: float) -> float:
    return float(wrap(angle))


# -- What was done in a meeting.


def _finding(
    tracks: Tracks, two: _Two, pair: tuple[int, int], meeting: _Meeting, s: GeometricSettings
) -> Finding:
    window = slice(meeting.begin, meeting.end)
    gaps = outline_gaps(two.p[window], two.heading[window], two.bodies)
    nearest = meeting.begin + int(np.nanargmin(gaps))
    contact = _touched(tracks, two, nearest, float(np.nanmin(gaps)))
    why = "it touched the other" if contact else _fault(two, meeting, nearest, s)
    altered, at, slowed = _alteration(two, meeting, nearest, s)
    before_s = None if at is None else round(STEP_S * (nearest - at), 3)
    readable = None
    if meeting.role != "stand_on":
        early = before_s is not None and before_s >= s.early_s
        readable = bool(early and (abs(altered) >= s.readable or slowed))
    possible = True if not why else _possible(tracks, two, pair, meeting, s)
    return Finding(
        ego=pair[0],
        other=pair[1],
        role=meeting.role,
        begin_s=round(float(tracks.times[meeting.begin]), 3),
        nearest_s=round(float(tracks.times[nearest]), 3),
        end_s=round(float(tracks.times[meeting.end - 1]), 3),
        kept=not why,
        why=why,
        contact=contact,
        closest_m=round(float(np.nanmin(gaps)), 3),
        altered_deg=round(math.degrees(altered), 1),
        altered_before_s=before_s,
        readable=readable,
        possible=possible,
    )


def _touched(tracks: Tracks, two: _Two, nearest: int, gap: float) -> bool:
    """Tell whether the two touched: their outlines do, or the voyage ended in it."""
    own = two.bodies[0]
    if own.outcome == "collision" and own.ended_s is not None:
        ends_here = abs(float(tracks.times[nearest]) - own.ended_s) <= 1.0
        return ends_here and gap <= 1.5
    return gap <= 0.0 and own.outcome is None


def _fault(two: _Two, meeting: _Meeting, nearest: int, s: GeometricSettings) -> str:
    """Say which rule was not kept, and how; nothing if it was."""
    window = slice(meeting.begin, meeting.end)
    p, v = two.p[window], two.v[window]
    length = two.bodies[0].length_m
    gap = float(np.nanmin(outline_gaps(p, two.heading[window], two.bodies)))
    close = f"it came within {gap:.1f} m" if gap < s.clear * length else ""
    if meeting.role == "overtaking":
        return close
    if meeting.role == "head_on":
        course = _course(two.v[nearest, 0], two.heading[nearest, 0])
        there = two.p[nearest, 1] - two.p[nearest, 0]
        if not passed_to_port(there, course):
            return "the other passed to starboard"
        turned, _ = _deviation(two, meeting, *_kept(two, meeting))
        port = float(turned[: nearest - meeting.begin + 1].min())
        return f"it turned {-math.degrees(port):.0f} deg to port" if port < -s.keeps_course else ""
    if meeting.role == "give_way":
        moving = np.isfinite(v).all(axis=(1, 2))
        if moving.any() and crossed_ahead(p[moving, 0], p[moving, 1], v[moving, 1]):
            return "it crossed ahead"
        return close
    return _not_standing_on(two, meeting, nearest, s)


def _course(v: Float64, heading: float) -> float:
    """[rad] Give the course of a velocity, or the heading of who has none."""
    return math.atan2(v[1], v[0]) if math.hypot(*v) >= DEFAULT.least_speed_mps else heading


def _not_standing_on(two: _Two, meeting: _Meeting, nearest: int, s: GeometricSettings) -> str:
    """Say what a stand-on vessel did besides standing on; nothing if it did."""
    course, speed = _kept(two, meeting)
    held = np.broadcast_to(
        speed * np.array([math.cos(course), math.sin(course)]), two.p[:, 0].shape
    )
    risk, until = _risk(two, held, s)
    turned, share = _deviation(two, meeting, course, speed)
    free = _lasting(~risk, round(s.past_s / STEP_S), meeting.clear)
    plain = np.flatnonzero(risk[meeting.clear :] & (until[meeting.clear :] <= s.plain_s))
    plainly = meeting.clear + int(plain[0]) if len(plain) else meeting.end
    until_k = min(free, plainly, nearest)
    for k in range(meeting.clear, until_k):
        j = k - meeting.begin
        if abs(turned[j]) > s.keeps_course:
            return f"it altered course by {math.degrees(turned[j]):.0f} deg before it was plain"
        if not s.slower <= share[j] <= s.faster:
            return f"it went at {100 * share[j]:.0f} % of its speed before it was plain"
    crossing = abs(_bearing(two, meeting.clear)) <= s.abaft
    later = turned[max(plainly - meeting.begin, 0) : nearest - meeting.begin + 1]
    if plainly < nearest and crossing and len(later) and later.min() < -s.keeps_course:
        return (
            f"it turned {-math.degrees(later.min()):.0f} deg to port for a vessel on its port side"
        )
    return ""


def _bearing(two: _Two, k: int) -> float:
    p, v = two.p[k, 1] - two.p[k, 0], two.v[k, 0]
    return _wrapped(math.atan2(p[1], p[0]) - math.atan2(v[1], v[0]))


def _steady(two: _Two, course: float, speed: float) -> Float64:
    """Give the velocity, (T, 2) [m/s], of who keeps a course [rad] and a speed [m/s]."""
    velocity = speed * np.array([math.cos(course), math.sin(course)])
    return np.broadcast_to(velocity, two.p[:, 0].shape)


def _kept(two: _Two, meeting: _Meeting) -> tuple[float, float]:
    """Give the course [rad] and speed [m/s] of the judged vessel when the meeting began."""
    first = two.v[meeting.begin : meeting.clear + 1, 0]
    mean = np.nanmean(first, axis=0)
    return math.atan2(mean[1], mean[0]), max(float(np.hypot(*mean)), 1e-3)


def _deviation(
    two: _Two, meeting: _Meeting, course: float, speed: float
) -> tuple[Float64, Float64]:
    """Give turns from a course [rad, starboard], and shares of a speed [-], (n,) each."""
    v = two.v[meeting.begin : meeting.end, 0]
    fast = np.hypot(*v.T)
    with np.errstate(invalid="ignore"):
        slow = ~(fast >= DEFAULT.least_speed_mps)
        turned = wrap(np.arctan2(v[:, 1], v[:, 0]) - course)
    turned = np.where(slow, 0.0, turned)
    return np.nan_to_num(turned), np.nan_to_num(fast / speed, nan=1.0)


def _alteration(
    two: _Two, meeting: _Meeting, nearest: int, s: GeometricSettings
) -> tuple[float, int | None, bool]:
    """Give the first alteration: size [rad, starboard], when, and if half the speed went off."""
    course, speed = _kept(two, meeting)
    turned, share = _deviation(two, meeting, course, speed)
    until = nearest - meeting.begin + 1
    starts = np.flatnonzero((np.abs(turned[:until]) >= s.first) | (share[:until] <= s.slower))
    if not len(starts):
        return 0.0, None, False
    first = int(starts[0])
    stretch = slice(first, min(first + round(s.lasts_s / STEP_S), until))
    side = np.sign(turned[first]) or 1.0
    size = float((side * turned[stretch]).max())
    size = side * size if size >= s.first else 0.0
    return size, meeting.begin + first, bool((share[stretch] <= 0.5).any())


# -- What would have been possible.


def _possible(
    tracks: Tracks, two: _Two, pair: tuple[int, int], meeting: _Meeting, s: GeometricSettings
) -> bool:
    """Tell whether some alteration keeps the rule and touches nobody."""
    samples = slice(meeting.begin, meeting.end)
    course, speed = _kept(two, meeting)
    for turn_deg in TURNS_DEG:
        for share in SPEEDS:
            if meeting.role == "stand_on" and share != 1.0:
                continue
            p = _alternative(two, meeting, course, speed, math.radians(turn_deg), share, s)
            tried = _with_ego(two, samples, p)
            gaps = outline_gaps(tried.p[samples], tried.heading[samples], two.bodies)
            nearest = meeting.begin + int(np.nanargmin(gaps))
            clear = np.nanmin(gaps) > 0.0 and not _fault(tried, meeting, nearest, s)
            if clear and _touches_nobody(tracks, pair, samples, p):
                return True
    return False


def _alternative(
    two: _Two,
    meeting: _Meeting,
    course: float,
    speed: float,
    turn: float,
    share: float,
    s: GeometricSettings,
) -> Float64:
    """Give where the judged vessel would be, (n, 2) [m] N, had it altered course and speed.

    Who stands on alters them when it is plain that the other gives no way.
    """
    count = meeting.end - meeting.begin
    t = STEP_S * np.arange(count)
    after = np.zeros(count)
    if meeting.role == "stand_on":
        risk, until = _risk(two, _steady(two, course, speed), s)
        plain = np.flatnonzero((risk & (until <= s.plain_s))[meeting.begin : meeting.end])
        t_plain = t[plain[0]] if len(plain) else np.inf
        after = np.maximum(t - t_plain, 0.0)
    else:
        after = t
    angle = course + np.sign(turn) * np.minimum(s.turn_rate_radps * after, abs(turn))
    fast = np.maximum(speed - s.slowing_mps2 * after, share * speed) if share < 1.0 else speed
    steps = STEP_S * (fast * np.exp(1j * angle))
    way = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    return two.p[meeting.begin, 0] + np.column_stack([way.real, way.imag])


def _with_ego(two: _Two, samples: slice, p: Float64) -> _Two:
    """Put other positions, (n, 2) [m] N, in the place of the judged vessel's."""
    places, v, heading = two.p.copy(), two.v.copy(), two.heading.copy()
    places[samples, 0] = p
    v[samples, 0] = np.gradient(p, STEP_S, axis=0)
    heading[samples, 0] = np.arctan2(v[samples, 0, 1], v[samples, 0, 0])
    return replace(two, p=places, v=v, heading=heading)


def _touches_nobody(tracks: Tracks, pair: tuple[int, int], samples: slice, p: Float64) -> bool:
    """Tell whether a track, (n, 2) [m] N, keeps off all but the two, and off what is fixed."""
    own = tracks.bodies[pair[0]]
    for k, body in enumerate(tracks.bodies):
        if k not in pair:
            distance = np.hypot(*(tracks.pose_N[samples, k, :2] - p).T)
            if (distance <= own.radius_m + _across(body)).any():
                return False
    offset = tracks.fixed[None, :, :2] - p[:, None]
    gaps = np.hypot(offset[..., 0], offset[..., 1]) - tracks.fixed[:, 2] - own.radius_m
    return bool((gaps > 0.0).all())


def outline_gaps(p: Float64, heading: Float64, bodies: tuple[Body, Body]) -> Float64:
    """Give distances (T,) [m] of a vessel's circle from another's outline; negative: they overlap.

    Parameters
    ----------
    p : (T, 2, 2) float64
        [m] [N] The two's positions.
    heading : (T, 2) float64
        [rad] [N]
    bodies
        The two: the first counts as the circle around it.
    """
    own, other = bodies
    d = p[:, 0] - p[:, 1]
    if other.circle:
        gaps: Float64 = np.hypot(*d.T) - own.radius_m - other.radius_m
        return gaps
    c, s = np.cos(heading[:, 1]), np.sin(heading[:, 1])
    along = np.abs(c * d[:, 0] + s * d[:, 1]) - other.length_m / 2
    across = np.abs(c * d[:, 1] - s * d[:, 0]) - other.beam_m / 2
    outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    from_box: Float64 = outside + np.minimum(np.maximum(along, across), 0.0) - own.radius_m
    return from_box
