"""Encounters between vessels, and whether they did what the COLREGs ask.

An encounter begins where runtime/policy/colregs.py finds a head-on or give-way situation, by the
true positions and velocities, and lasts until the two were nearest. In it a vessel acted as asked

- head-on (rule 14): if the other passed on its port side;
- give-way (rule 15): if it did not cross ahead of the other;
- and in both: if the two did not touch.

Where it did not, the question is whether that was safer. The answer compares how near it came to
anything at all with how near it would have come by the rules: it keeps to the compliant course
(`colregs.compliant_course`) at its speed; the other does the same in a head-on encounter, and
stands on (course and speed) in a crossing; everybody else moves as they really did.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.colregs import Situation, compliant_course, situation
from twinscrew.runtime.settings import Count, Positive, Settings

Kind = Literal["head_on", "give_way"]
KINDS: dict[int, Kind] = {Situation.HEAD_ON: "head_on", Situation.GIVE_WAY: "give_way"}


TOUCH_MARGIN_M = 0.7
"""[m] Two vessels come this much nearer between samples of the log: 0.1 s at 2 x 3.3 m/s."""


class EncounterSettings(Settings, frozen=True, kw_only=True):
    """When an encounter is one, and what a vessel could have done instead."""

    least_samples: Count = 3
    """[-] A situation that lasts fewer samples of the log is not counted."""
    horizon_s: Positive = 10.0
    """[s] An encounter ends this long after its beginning at the latest: 33 m at full speed."""
    turn_rate_radps: Positive = 0.5
    """[rad/s] Steady turn at speed (docs/simulator.md: turning circle, 2.98 m/s on 11.7 m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What really happened in an episode, at T times, to V vessels and B buoys."""

    times: Float64
    """[s] (T,)"""
    p_N: Float64
    """[m] [N] (T, V, 2)"""
    v_N: Float64
    """[m/s] [N] (T, V, 2) Over ground."""
    heading: Float64
    """[rad] [N] (T, V)"""
    ended_s: Float64
    """[s] (V,) When each vessel's voyage ended; after it, it is in no encounter."""
    gone_s: Float64
    """[s] (V,) When each vessel left the map; infinite if it stayed."""
    buoys: Float64
    """[m] [N] (B, 3) North, east, radius."""
    radius: float
    """[m] Of a vessel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter:
    """One vessel's part in a meeting of two."""

    kind: Kind
    ego: int
    other: int
    begin_s: float
    """[s] When the situation began."""
    end_s: float
    """[s] When the two were nearest."""
    acted: bool
    """True if the ego vessel did what the rule asks."""
    touched: bool
    """True if the two touched."""
    gap_m: float
    """[m] Least distance between the ego's surface and anything's, from begin to the horizon."""
    rule_gap_m: float
    """[m] The same, had the two gone by the rules."""

    @property
    def safer(self) -> bool:
        """True if what it did kept it farther off than the rules would have."""
        return self.gap_m > self.rule_gap_m


def find_encounters(
    course: Course, settings: EncounterSettings | None = None
) -> tuple[Encounter, ...]:
    """Give every encounter of every vessel, ordered by their beginnings."""
    rules = settings or EncounterSettings()
    count = course.p_N.shape[1]
    found = [
        encounter
        for ego in range(count)
        for other in range(count)
        if ego != other
        for encounter in _between(course, ego, other, rules)
    ]
    return tuple(sorted(found, key=lambda e: (e.begin_s, e.ego, e.other)))


def _between(course: Course, ego: int, other: int, settings: EncounterSettings) -> list[Encounter]:
    over_s = min(course.ended_s[ego], course.ended_s[other])
    stop = int(np.searchsorted(course.times, over_s, side="right"))
    p = course.p_N[:stop, other] - course.p_N[:stop, ego]
    if not stop:
        return []
    kinds = situation(p, course.v_N[:stop, other], course.v_N[:stop, ego])
    found, busy = [], 0
    for begin, _ in runs(kinds, settings.least_samples):
        if begin < busy:
            continue
        last = course.times[begin] + settings.horizon_s
        end = min(int(np.searchsorted(course.times, last, side="right")), stop)
        found.append(_judge(course, ego, other, KINDS[int(kinds[begin])], begin, end, settings))
        busy = end
    return found


def _judge(
    course: Course,
    ego: int,
    other: int,
    kind: Kind,
    begin: int,
    end: int,
    settings: EncounterSettings,
) -> Encounter:
    """Judge one encounter between two samples of the log, [begin, end)."""
    p = course.p_N[begin:end, other] - course.p_N[begin:end, ego]
    distance = np.hypot(*p.T)
    nearest = int(distance.argmin())
    cpa = begin + nearest
    together = course.gone_s[ego] == course.gone_s[other] < np.inf
    touched = bool(together and distance[nearest] <= 2 * course.radius + TOUCH_MARGIN_M)
    if kind == "head_on":
        right = passed_to_port(p[nearest], float(course.heading[cpa, ego]))
    else:
        window = slice(begin, cpa + 1)
        others = course.p_N[window, other], course.v_N[window, other]
        right = not crossed_ahead(course.p_N[window, ego], *others)
    real = course.p_N[begin:end]
    asked = _by_the_rules(course, ego, other, kind, begin, end, settings)
    return Encounter(
        kind=kind,
        ego=ego,
        other=other,
        begin_s=float(course.times[begin]),
        end_s=float(course.times[cpa]),
        acted=right and not touched,
        touched=touched,
        gap_m=_least_gap(course, ego, real, begin, end),
        rule_gap_m=_least_gap(course, ego, asked, begin, end),
    )


def _by_the_rules(
    course: Course,
    ego: int,
    other: int,
    kind: Kind,
    begin: int,
    end: int,
    settings: EncounterSettings,
) -> Float64:
    """Give where all would have been, (n, V, 2) [m] N, had the two gone by the rules."""
    tracks = course.p_N[begin:end].copy()
    two = [ego, other]
    tracks[:, two] = rule_tracks(
        course.p_N[begin, two],
        course.v_N[begin, two],
        (True, kind == "head_on"),
        course.radius,
        settings.turn_rate_radps,
        course.times[begin:end],
    )
    return tracks


def _least_gap(course: Course, ego: int, tracks: Float64, begin: int, end: int) -> float:
    """Give the least distance of the ego's surface, on tracks (n, V, 2), to others and buoys."""
    track = tracks[:, ego]
    offset = np.delete(tracks, ego, axis=1) - track[:, None]
    gaps = np.hypot(offset[..., 0], offset[..., 1]) - 2 * course.radius
    gone = course.times[begin:end, None] > np.delete(course.gone_s, ego)
    least = np.where(gone, np.inf, gaps).min(initial=np.inf)
    offset = course.buoys[None, :, :2] - track[:, None]
    gaps = np.hypot(offset[..., 0], offset[..., 1]) - course.radius - course.buoys[:, 2]
    return float(min(least, gaps.min(initial=np.inf)))


# -- What vessels do in an encounter, as geometry: on which side, ahead or astern, on which course.

SLOWEST_MPS = 0.5
"""[m/s] Slower, a velocity says little of a course (paper, sec. IV)."""


def runs(kinds: NDArray[np.int8], least: int) -> list[tuple[int, int]]:
    """Give the stretches [begin, end) in which `kinds` stays at one value that is not zero."""
    edges = np.flatnonzero(np.diff(kinds)) + 1
    begins, ends = np.r_[0, edges], np.r_[edges, len(kinds)]
    return [
        (int(b), int(e))
        for b, e in zip(begins, ends, strict=True)
        if kinds[b] != Situation.NONE and e - b >= least
    ]


def passed_to_port(p: Float64, heading: float) -> bool:
    """Tell whether a place, (2,) from the vessel in N, is on the vessel's port side."""
    across = np.cos(heading) * p[1] - np.sin(heading) * p[0]
    return bool(across < 0.0)


def crossed_ahead(p_ego_N: Float64, p_other_N: Float64, v_other_N: Float64) -> bool:
    """Tell whether the ego vessel crossed the other's track from its port side, ahead of it.

    All arguments are (n, 2). Where the other nearly stands still, its last course counts.
    """
    along = _courses(v_other_N)
    p = p_ego_N - p_other_N
    ahead = (p * along).sum(axis=1)
    across = along[:, 0] * p[:, 1] - along[:, 1] * p[:, 0]
    crossing = (across[:-1] < 0.0) & (across[1:] >= 0.0)
    return bool((crossing & (ahead[1:] > 0.0)).any())


def rule_tracks(
    p_N: Float64,
    v_N: Float64,
    acts: tuple[bool, bool],
    radius: float,
    turn_rate_radps: float,
    times: Float64,
) -> Float64:
    """Give where two vessels would be that go by the rules, each at its speed.

    Parameters
    ----------
    p_N, v_N : (2, 2) float64
        Positions [m] and velocities [m/s] at the beginning, a row a vessel.
    acts : (bool, bool)
        Who turns to starboard whenever its course falls short of `colregs.compliant_course`; the
        other stands on, with its course and speed.
    radius : float
        [m] Of either vessel.
    turn_rate_radps : float
        [rad/s] How fast a vessel turns.
    times : (n,) float64
        [s] Rising.

    Returns
    -------
    tracks : (n, 2, 2) float64
        [m] N.
    """
    speed, course = np.hypot(*v_N.T), np.arctan2(v_N[:, 1], v_N[:, 0])
    tracks = np.empty((len(times), 2, 2))
    tracks[0] = p_N
    for k, dt in enumerate(np.diff(times)):
        asked = compliant_course(tracks[k, ::-1] - tracks[k], np.full(2, radius), radius)
        short = np.remainder(asked - course + np.pi, 2 * np.pi) - np.pi
        course = course + np.where(acts, np.clip(short, 0.0, turn_rate_radps * dt), 0.0)
        step = speed[:, None] * np.column_stack([np.cos(course), np.sin(course)])
        tracks[k + 1] = tracks[k] + dt * step
    return tracks


def _courses(v_N: Float64, slowest: float = SLOWEST_MPS) -> Float64:
    """Give unit vectors along velocities, (n, 2); a slow one takes over the one before it."""
    speed = np.hypot(*v_N.T)
    fast = speed >= slowest
    fast[0] = True
    last = np.maximum.accumulate(np.where(fast, np.arange(len(v_N)), 0))
    unit: Float64 = v_N[last] / np.maximum(speed[last], 1e-9)[:, None]
    return unit
