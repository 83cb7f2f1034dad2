"""Tracks of vessels that say who they are: what AIS reports becomes a track, or names one.

A report belongs to the vessel that it names, so nothing is shared among tracks by probabilities,
and a report says nothing about any other vessel. What is left to decide is whether that vessel is
the one which another sensor follows already. It is if that track lies within the outline which the
vessel reports, and moves as it does, both as exactly as they are known. Then the track takes the
name, and the reports correct it only while no sharper sensor does. One ship is one track.

The LiDAR's objects are not assigned to what AIS alone has shown: a report that is off by 10 m would
take a buoy for the ship. A ship that the LiDAR comes to see gets a track of its own, which takes
over name and identity once it has been confirmed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.detections import Look, SourceSettings
from twinscrew.runtime.tracking.joint import started
from twinscrew.runtime.tracking.kalman import STATES, FilterBank
from twinscrew.runtime.tracking.track import Named, Track, sigma_m

POSITION_ONLY = np.eye(2, STATES)
VELOCITY_ONLY = np.eye(2, STATES, k=2)
SHARP_S = 1.5
"""[s] A track that the LiDAR has seen more lately than this is known better than by any report."""
FIRST_EXISTENCE, ANOTHER_REPORT = 0.99, 0.3
"""[-] Probability that a vessel exists which reports itself, and what a further report adds to it
at most: what the LiDAR has not seen where it should have is not believed at once again."""
SLACK_M, SLACK_MPS = 3.0, 0.5
"""[m], [m/s] How far sensors may disagree about one ship beyond what they say of themselves: they
see different parts of it, at slightly different times."""
PART_M = 6.0
"""[m] What the LiDAR sees this near a ship's outline is a part of the ship."""
EDGE_M = 3.0
"""[m] How well parts that are seen tell where the outline lies, each scan."""
WHOLE = 0.6
"""[-] A track of the LiDAR whose radius is a smaller share of the ship's is a part of it."""
APART_SIGMA = 3.0
"""[-] Tracks that differ by more than this are two vessels."""


@dataclass(frozen=True, slots=True)
class Report:
    """What a named detection knows beside its position: the `extras` of a look."""

    named: Named
    v_N: Float64 | None
    """[m/s] [N] (2,) Velocity over ground; None: not told."""
    v_sigma_mps: float = 0.5
    """[m/s] Standard deviation of each of its components."""
    names_only: bool = False
    """Whether it only says what its vessel is called, and how large it is: no new position."""


def take_named(
    tracks: list[Track],
    look: Look,
    source: SourceSettings,
    bank: FilterBank,
    *,
    number: int,
    stamp_ns: int,
    first_speed_mps: float,
) -> None:
    """Correct, name or start a track for each report of a look; tracks are predicted to its time.

    Parameters
    ----------
    tracks
        All tracks; what is started is appended.
    look, source
        Positions with a `Report` each, and the settings of their source.
    bank
        The filter.
    number, stamp_ns
        Of the look: the tracks' keys, and its time [ns].
    first_speed_mps
        [m/s] Standard deviation of an unknown velocity.
    """
    for m, report in enumerate(look.extras):
        track = _of(tracks, report.named.identity)
        if report.names_only:
            if track is not None:
                track.named = report.named
                track.radius = track.radius if track.scans else report.named.radius_m
            continue
        z, R = look.z[m], look.R[m]
        if track is not None and track.scans and not _agree(track, report, z, R):
            track.named = None  # the LiDAR follows something else by now
            track.sources -= {look.source}
            track = None
        if track is None:
            track = _unnamed(tracks, report, z, R)
        if track is None:
            sigma_mps = first_speed_mps if report.v_N is None else report.v_sigma_mps
            begun = (FIRST_EXISTENCE, stamp_ns, sigma_mps, report.v_N)
            track = started(look, m, source, (number, m), *begun)
            tracks.append(track)
        else:
            _correct(track, report, z, look.H[m], R, bank, first_speed_mps)
            track.existence = min(track.existence + ANOTHER_REPORT * (1.0 - track.existence), 0.999)
        track.named = report.named
        track.sources |= {look.source}
        if not track.scans:
            track.radius = report.named.radius_m


def only_named(track: Track, sources: frozenset[str]) -> bool:
    """Tell whether all that is known of a track is what its vessel has reported."""
    return track.named is not None and not track.scans and track.sources <= sources


def hand_over(tracks: Sequence[Track], sources: frozenset[str], bank: FilterBank) -> list[Track]:
    """Give the tracks without those of reports whose vessel the LiDAR follows now.

    The LiDAR's track takes over name and identity. A track that is much smaller than the ship is a
    part of it: it takes the ship's velocity, and the ship stays a track of its own.
    """
    gone: list[Track] = []
    seen = [t for t in tracks if t.scans and t.confirmed and t.named is None]
    for track in tracks:
        if not seen or not only_named(track, sources):
            continue
        assert track.named is not None  # noqa: S101  (`only_named`)
        report = Report(track.named, track.x[2:4], math.sqrt(track.P[2, 2]))
        small = WHOLE * track.named.radius_m
        _join_parts(track, [t for t in seen if t.radius < small], report, bank)
        fits = [
            t for t in seen if t.radius >= small and _agree(t, report, track.x[:2], track.P[:2, :2])
        ]
        if not fits:
            continue
        nearest = min(fits, key=lambda t: float(np.hypot(*(t.x[:2] - track.x[:2]))))
        _learn_velocity(nearest, report, bank)
        nearest.named = track.named
        nearest.sources |= track.sources
        nearest.existence = max(nearest.existence, track.existence)
        if track.confirmed:
            nearest.id, nearest.key = track.id, track.key
        seen.remove(nearest)
        gone.append(track)
    return [track for track in tracks if track not in gone] if gone else list(tracks)


def _join_parts(ship: Track, tracks: Sequence[Track], report: Report, bank: FilterBank) -> None:
    """Let what the LiDAR sees at a ship's outline move as the ship does, and the ship lie there.

    A scan shows where the surface is, but not how a part that just comes into sight moves; the ship
    tells that. Its own position, by satellite, is off by some metres: the outline moves to what is
    seen outside of it.
    """
    assert ship.named is not None  # noqa: S101  (`only_named`)
    outside: list[Float64] = []
    for part in tracks:
        if part.age_s > 0.0:
            continue
        beyond = beyond_outline(part.x[:2], ship.x[:2], ship.named)
        if math.hypot(beyond[0], beyond[1]) > PART_M:
            continue
        if not ship.sources & part.sources:  # once: a part that comes into sight grows
            _learn_velocity(part, report, bank)
            part.sources |= ship.sources
        outside.append(beyond)
    if not outside:
        return
    farthest = max(outside, key=lambda d: math.hypot(d[0], d[1]))
    if math.hypot(farthest[0], farthest[1]) > 0.0:
        z, R = ship.x[:2] + farthest, EDGE_M**2 * np.eye(2)
        x, P = bank.update(ship.x[None], ship.P[None], z[None], POSITION_ONLY[None], R[None])
        ship.x, ship.P = x[0], P[0]


def pass_on_names(before: Sequence[Track], after: Sequence[Track]) -> None:
    """Let what has absorbed a named track, as the nearest one that is left, take over its name."""
    kept = {id(track) for track in after}
    for gone in before:
        if gone.named is None or id(gone) in kept:
            continue
        heirs = [t for t in after if t.confirmed and t.named is None and t.age_s == 0.0]
        if heirs:
            heir = min(heirs, key=lambda t: float(np.hypot(*(t.x[:2] - gone.x[:2]))))
            heir.named, heir.sources = gone.named, heir.sources | gone.sources
            heir.id, heir.key = gone.id, gone.key


def is_seen_in_part(track: Track, tracks: Sequence[Track]) -> bool:
    """Tell whether the LiDAR sees something where a reported vessel lies."""
    assert track.named is not None  # noqa: S101  (asked of reported vessels only)
    limit = APART_SIGMA * math.hypot(sigma_m(track.P), SLACK_M)
    return any(
        outline_distance(other.x[:2], track.x[:2], track.named) <= limit
        for other in tracks
        if other.scans and other.age_s == 0.0
    )


def is_believed(track: Track, stamp_ns: int) -> bool:
    """Tell whether a vessel's last report is young enough to be believed."""
    return track.named is not None and stamp_ns <= track.named.until_ns


def outline_distance(p_N: Float64, centre_N: Float64, named: Named) -> float:
    """[m] Give the distance from a place to the outline of a vessel that lies at `centre_N`."""
    d = p_N - centre_N
    if math.isnan(named.half_length_m) or math.isnan(named.heading):
        return max(float(np.hypot(*d)) - named.radius_m, 0.0)
    beyond = beyond_outline(p_N, centre_N, named)
    return math.hypot(beyond[0], beyond[1])


def beyond_outline(p_N: Float64, centre_N: Float64, named: Named) -> Float64:
    """Give the way, (2,) [m] [N], from the nearest point of an outline to a place; 0 within it."""
    d = p_N - centre_N
    if math.isnan(named.half_length_m) or math.isnan(named.heading):
        distance = float(np.hypot(*d))
        return d * (max(distance - named.radius_m, 0.0) / max(distance, 1e-6))
    c, s = math.cos(named.heading), math.sin(named.heading)
    ahead, abeam = c * d[0] + s * d[1], c * d[1] - s * d[0]
    ahead -= min(max(ahead, -named.half_length_m), named.half_length_m)
    abeam -= min(max(abeam, -named.half_beam_m), named.half_beam_m)
    return np.array([c * ahead - s * abeam, s * ahead + c * abeam])


def _of(tracks: Sequence[Track], identity: str) -> Track | None:
    for track in tracks:
        if track.named is not None and track.named.identity == identity:
            return track
    return None


def _agree(track: Track, report: Report, z: Float64, R: Float64) -> bool:
    """Tell whether a track can be the vessel that reports itself at `z`, (2,) [m]."""
    S = sigma_m(track.P) ** 2 + 0.5 * float(np.trace(R)) + SLACK_M**2
    if outline_distance(track.x[:2], z, report.named) > APART_SIGMA * math.sqrt(S):
        return False
    if report.v_N is None:
        return True
    dv = track.x[2:4] - report.v_N
    variance = 0.5 * float(np.trace(track.P[2:4, 2:4])) + report.v_sigma_mps**2 + SLACK_MPS**2
    return math.hypot(dv[0], dv[1]) <= APART_SIGMA * math.sqrt(variance)


def _unnamed(tracks: Sequence[Track], report: Report, z: Float64, R: Float64) -> Track | None:
    """Give the track of another sensor that is this vessel; None if none is."""
    fits = [
        track
        for track in tracks
        if track.confirmed
        and track.named is None
        and _agree(track, report, z, R)
        and (not track.scans or track.radius >= WHOLE * report.named.radius_m)
    ]
    if not fits:
        return None
    return min(fits, key=lambda track: (float(np.hypot(*(track.x[:2] - z))), track.id))


def _correct(
    track: Track,
    report: Report,
    z: Float64,
    H: Float64,
    R: Float64,
    bank: FilterBank,
    first_speed_mps: float,
) -> None:
    """Take in a report, unless the LiDAR knows better; one from far off starts the state afresh."""
    if track.scans and track.age_s < SHARP_S:
        _learn_velocity(track, report, bank)
        return
    track.age_s = 0.0
    track.detections += 1
    d = z - H @ track.x
    S = H @ track.P @ H.T + R
    if float(d @ np.linalg.solve(S, d)) > APART_SIGMA**2:
        track.x = np.concatenate([z, np.zeros(STATES - 2)])
        track.P = np.diag([R[0, 0], R[1, 1], *[first_speed_mps**2] * 2, *track.shape_m2])
    x, P = bank.update(track.x[None], track.P[None], z[None], H[None], R[None])
    if report.v_N is not None:
        noise = report.v_sigma_mps**2 * np.eye(2)
        x, P = bank.update(x, P, report.v_N[None], VELOCITY_ONLY[None], noise[None])
    track.x, track.P = x[0], P[0]


def _learn_velocity(track: Track, report: Report, bank: FilterBank) -> None:
    """Let a track of the LiDAR take the velocity that its ship tells.

    The LiDAR knows best where the surface is. How a long ship moves of which a part comes into
    sight it does not: that part grows.
    """
    if report.v_N is None:
        return
    noise = (report.v_sigma_mps**2) * np.eye(2)
    x, P = bank.update(
        track.x[None], track.P[None], report.v_N[None], VELOCITY_ONLY[None], noise[None]
    )
    track.x, track.P = x[0], P[0]
