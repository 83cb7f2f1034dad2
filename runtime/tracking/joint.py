"""What a look of any source says of all tracks: joint probabilistic data association.

The probabilities with which detections belong to tracks are found for all pairs at once. Each track
takes in the mixture of what its detections say; each detection that belongs to none may be a new
target. Parts of one vessel are found afterwards.

Source: Musicki, Evans (2004), Joint integrated probabilistic data association: JIPDA, IEEE Trans.
AES 40(3).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from twinscrew.runtime._native import association_marginals, mixtures, pair_fits, shadowed
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.detections import Look, SourceSettings
from twinscrew.runtime.tracking.kalman import STATES, first_covariance
from twinscrew.runtime.tracking.track import (
    Clutter,
    ExistenceSettings,
    Track,
    in_sector,
    sigma_m,
    states,
)

LIKELY = 1e-4
"""[-] Pairs less probable than this are left out of the mixture."""
MOST_EXISTENCE, LEAST_VISIBLE, MOST_VISIBLE = 0.9999, 0.02, 0.999
"""[-] Nothing is ever quite certain."""
EVERYWHERE_PER_RAD = 1.0
"""[1/rad] Where bearings of nothing are denser, one that fits does not tell a track from land."""
DOUBLE_M, DOUBLE_MPS, TENTATIVE_MPS = 6.0, 2.0, 7.0
"""[m], [m/s] Tracks that differ by less are one; the last is for those never reported."""


def take_look(
    tracks: list[Track],
    look: Look,
    source: SourceSettings,
    existence: ExistenceSettings,
    clutter: Clutter,
    *,
    number: int,
    stamp_ns: int,
    gate_sigma: float,
    first_speed_mps: float,
) -> None:
    """Correct predicted tracks by a look, and append those that it starts.

    Parameters
    ----------
    tracks
        All tracks, at the look's time.
    look, source
        The look, and its source's settings.
    existence, gate_sigma, first_speed_mps
        Settings of the tracker.
    clutter
        What is known of the source's false detections; it learns.
    number, stamp_ns
        Of the look: the tracks' keys, and the time [ns] at which the scene was like this.
    """
    look, distance = _within_range(look, source)
    density = clutter.density(distance)
    chance = chances(tracks, look, source, existence)
    beta = association_marginals(_weights(tracks, look, source, chance, density, gate_sigma))
    tells = source.measures == "position" or bool((density < EVERYWHERE_PER_RAD).all())
    _correct(tracks, look, source, chance, beta, tells=tells)
    settled = [track.detections >= existence.settled_hits for track in tracks]
    held = beta[settled].sum(axis=0)
    clutter.learn(stamp_ns, distance, 1.0 - np.minimum(held, 1.0))
    if source.measures == "position":
        free = 1.0 - np.minimum(beta.sum(axis=0), 1.0)
        new = free * existence.birth / (existence.birth + density)
        for m in np.flatnonzero(new > existence.drop_tentative).tolist():
            key = (number, m)
            tracks.append(started(look, m, source, key, float(new[m]), stamp_ns, first_speed_mps))


def chances(
    tracks: Sequence[Track], look: Look, source: SourceSettings, existence: ExistenceSettings
) -> Float64:
    """Give how likely a look detects each track, if that exists: v p_D, (K,)."""
    if not tracks:
        return np.zeros(0)
    x, _ = states(tracks)
    offset = x[:, :2] - look.origin_N
    chance = source.detection_probability(np.hypot(offset[:, 0], offset[:, 1]))
    chance = chance * in_sector(offset, look.heading, source.sector_rad)
    hides = np.array([track.confirmed for track in tracks])
    chance[shadowed(offset, hides, existence.shadow_m)] *= existence.shadow
    seen = np.array([track.visible.get(look.source, source.visible) for track in tracks])
    product: Float64 = chance * seen
    return product


def missed(
    tracks: Sequence[Track], name: str, source: SourceSettings, chance: Float64, beta: Float64
) -> None:
    """Take in that a look detected tracks with probabilities `beta`, (K,), or else missed them.

    `chance`, (K,), is v p_D. Musicki and Evans (2004), sec. III; Brekke et al. (2021), sec. IV.
    """
    r = np.array([track.existence for track in tracks])
    v = np.array([track.visible.get(name, source.visible) for track in tracks])
    undetected = (1.0 - beta) / (1.0 - r * chance)
    exists = beta + undetected * r * (1.0 - chance)
    sees = np.clip((beta + undetected * r * (v - chance)) / exists, LEAST_VISIBLE, MOST_VISIBLE)
    exists = np.minimum(exists, MOST_EXISTENCE)
    for track, known, visible in zip(tracks, exists.tolist(), sees.tolist(), strict=True):
        track.existence = known
        track.visible = track.visible | {name: visible}


def _within_range(look: Look, source: SourceSettings) -> tuple[Look, Float64]:
    """Give a look without what lies beyond the source's range, and the distances (M,) [m]."""
    if source.measures == "bearing":
        return look, np.zeros(len(look.z))
    offset = look.z - look.origin_N
    distance = np.hypot(offset[:, 0], offset[:, 1])
    near = distance < source.max_range_m
    if near.all():
        return look, distance
    look = replace(look, z=look.z[near], H=look.H[near], R=look.R[near], R_rad2=look.R_rad2[near])
    return look, distance[near]


def _weights(
    tracks: Sequence[Track],
    look: Look,
    source: SourceSettings,
    chance: Float64,
    density: Float64,
    gate_sigma: float,
) -> Float64:
    """Give each pair's weight against "not detected", (K, M)."""
    if not tracks or not len(density):
        return np.zeros((len(tracks), len(density)))
    x, P = states(tracks)
    origin = look.origin_N.tolist()
    _, per_m = pair_fits(x, P, look.z, look.H, look.R, look.R_rad2, origin, gate_sigma)
    if source.measures == "bearing":  # the density of clutter is one of directions
        per_m = per_m * np.hypot(*(x[:, :2] - look.origin_N).T)[:, None]
    a = np.array([track.existence for track in tracks]) * chance
    weights: Float64 = (a / (1.0 - a))[:, None] * per_m / density
    return weights


def _correct(
    tracks: Sequence[Track],
    look: Look,
    source: SourceSettings,
    chance: Float64,
    beta: Float64,
    *,
    tells: bool,
) -> None:
    """Let each track take in what a look says of it; if it `tells`, that the source has seen it."""
    if not tracks:
        return
    sums = beta.sum(axis=1)
    missed(tracks, look.source, source, chance, sums)
    detected = sums.tolist()
    for k, track in enumerate(tracks):
        if detected[k] > 0.5:
            track.age_s = 0.0
            track.detections += 1
            if tells:
                track.sources |= {look.source}
            if any(source.shape_m):
                track.shape_m2 = np.square(source.shape_m)
    likely = beta > LIKELY
    rows = np.flatnonzero(likely.any(axis=1))
    if not len(rows):
        return
    x, P = states(tracks)
    exists = np.array([t.existence for t in tracks])
    shares = np.where(likely, beta / np.maximum(exists, sums)[:, None], 0.0)[rows]
    origin = look.origin_N.tolist()
    found = mixtures(x[rows], P[rows], look.z, look.H, look.R, look.R_rad2, origin, shares)
    x, P = found[:, :STATES], found[:, STATES:].reshape(-1, STATES, STATES)
    for n, k in enumerate(rows.tolist()):
        tracks[k].x, tracks[k].P = x[n], P[n]


def started(
    look: Look,
    m: int,
    source: SourceSettings,
    key: tuple[int, int],
    existence: float,
    stamp_ns: int,
    speed_sigma_mps: float,
    v_N: Float64 | None = None,
) -> Track:
    """Begin a track at a measurement, with a velocity [m/s] if one is told; else at rest.

    `speed_sigma_mps` is the standard deviation of each component of the velocity.
    """
    z, R, shape = look.z[m], look.R[m], np.square(source.shape_m)
    velocity, variance = np.zeros(2) if v_N is None else v_N, speed_sigma_mps**2
    return Track(
        np.concatenate([z, velocity, np.zeros(STATES - 4)]),
        first_covariance(look.H[m], R, np.array([0.0, 0.0, variance, variance, *shape])),
        key=key,
        source=look.source,
        stamp_ns=stamp_ns,
        first_R=R,
        radius=source.radius_m,
        existence=existence,
        shape_m2=shape,
    )


def may_be_reported(
    track: Track, sources: Mapping[str, SourceSettings], stamp_ns: int, least: float
) -> bool:
    """Tell whether a track exists surely enough, and is no land."""
    if track.confirmed or track.existence <= least:
        return False
    for name in track.sources & sources.keys():
        source = sources[name]
        steady = (stamp_ns - track.first_ns) * 1e-9 > source.steady_s > 0.0
        if track.moved or not source.sees_land or steady:
            return True
    return False


def without_doubles(
    tracks: Sequence[Track], settings: ExistenceSettings, known: Sequence[Track]
) -> list[Track]:
    """Leave out what does not exist, is nowhere, or is a double of another or a `known` track."""
    existing = []
    for track in sorted(tracks, key=_seniority):
        least = settings.drop if track.confirmed else settings.drop_tentative
        most = 3.0 * settings.known_m if track.confirmed else settings.tentative_known_m
        if track.named is not None or (track.existence >= least and sigma_m(track.P) <= most):
            existing.append(track)
    if not existing:
        return []
    everything = [*known, *existing]
    x = np.array([track.x[:4] for track in everything])
    d = x[len(known) :, None] - x
    limit = np.array([DOUBLE_MPS if track.confirmed else TENTATIVE_MPS for track in existing])
    alike = np.hypot(d[..., 0], d[..., 1]) < DOUBLE_M
    alike &= np.hypot(d[..., 2], d[..., 3]) < limit[:, None]
    kept = np.zeros(len(everything), np.bool_)
    kept[: len(known)] = True
    for k in range(len(existing)):
        kept[len(known) + k] = not (alike[k] & kept).any()
    return [track for track, keep in zip(everything, kept, strict=True) if keep][len(known) :]


def _seniority(track: Track) -> tuple[bool, float]:
    """Sort reported tracks first, by identity; others by existence."""
    return not track.confirmed, track.id if track.confirmed else -track.existence


class VesselSettings(Settings, frozen=True, kw_only=True):
    """Which tracks are parts of one vessel: its hull, its wake, what it tows.

    Parts keep their places relative to one another. The foremost is reported, under the identity
    that the vessel had first; the others only keep their detections from disturbing it.
    """

    length_m: NonNegative = 0.0
    """[m] Parts are at most this far apart along the course; 0: every track is a vessel."""
    beam_m: NonNegative = 3.0
    """[m] They are this far apart across it, and this"""
    spread: NonNegative = 0.5
    """[-] share of their distance more: a tow sways, a wake spreads."""
    least_mps: Positive = 0.5
    """[m/s] What is slower has no course."""
    speed_mps: NonNegative = 1.2
    """[m/s] Their velocities differ by at most this, and"""
    speed_sigma: NonNegative = 2.0
    """[-] so many standard deviations."""
    hold_s: NonNegative = 2.0
    """[s] Parts for so long remain parts up to"""
    hold: Positive = 1.5
    """[-] so many times all these limits."""
    apart_s: NonNegative = 3.0
    """[s] They are reported by themselves once they have been beyond for so long."""
    lead_s: NonNegative = 2.0
    """[s] A part that leads, or that more sources see, for so long is the vessel from then on."""
    lead_m: Positive = 8.0
    """[m] So much farther ahead counts as much as a further source;"""
    lead: NonNegative = 0.5
    """[-] and by so much it must win."""


def find_parts(
    tracks: Sequence[Track],
    settings: VesselSettings,
    sources: Mapping[str, SourceSettings],
    stamp_ns: int,
) -> None:
    """Find which reported tracks are parts of one vessel, and which of them leads."""
    heads: list[Track] = []
    for track in sorted((t for t in tracks if t.confirmed), key=lambda t: t.id):
        known_s = (stamp_ns - track.part_since_ns) * 1e-9
        head = None
        for other in heads:
            held = track.part_of == other.key and known_s > settings.hold_s
            if are_one_vessel(track, other, settings, settings.hold if held else 1.0):
                head = other
                break
        if head is None:
            if not _just_left(track, heads, settings, known_s, stamp_ns):
                track.part_of = None
                heads.append(track)
            continue
        track.apart_ns = None
        if track.part_of != head.key:
            track.part_of, track.part_since_ns, known_s = head.key, stamp_ns, 0.0
        if known_s >= settings.lead_s and _leads(track, head, settings, sources):
            track.id, head.id = head.id, track.id
            track.key, head.key = head.key, track.key
            head.part_of, track.part_of = track.key, None
            head.part_since_ns = track.part_since_ns
            heads[heads.index(head)] = track


def _just_left(
    track: Track, heads: Sequence[Track], settings: VesselSettings, known_s: float, stamp_ns: int
) -> bool:
    """Tell whether a track was a part for long, and has not been apart for long."""
    was_part = known_s > settings.hold_s and any(h.key == track.part_of for h in heads)
    if not was_part:
        track.apart_ns = None
        return False
    if track.apart_ns is None:
        track.apart_ns = stamp_ns
    return (stamp_ns - track.apart_ns) * 1e-9 < settings.apart_s


def are_one_vessel(track: Track, other: Track, settings: VesselSettings, scale: float) -> bool:
    """Tell whether two tracks lie along one course and keep their places."""
    v = 0.5 * (track.x[2:4] + other.x[2:4])
    speed = math.hypot(v[0], v[1])
    if speed < settings.least_mps:
        return False
    d, dv = track.x[:2] - other.x[:2], track.x[2:4] - other.x[2:4]
    along = abs(float(d @ v)) / speed
    across = abs(float(v[0] * d[1] - v[1] * d[0])) / speed
    sigma = math.sqrt(0.5 * float(np.trace(track.P[2:4, 2:4] + other.P[2:4, 2:4])))
    return (
        along < scale * settings.length_m
        and across < scale * (settings.beam_m + settings.spread * along)
        and math.hypot(dv[0], dv[1]) < scale * (settings.speed_mps + settings.speed_sigma * sigma)
    )


def _leads(
    track: Track, head: Track, settings: VesselSettings, sources: Mapping[str, SourceSettings]
) -> bool:
    u = track.x[2:4] + head.x[2:4]
    ahead = float((track.x[:2] - head.x[:2]) @ u) / max(math.hypot(u[0], u[1]), 1e-6)
    lead = min(max(ahead / settings.lead_m, -1.0), 1.0)
    places = [name for name, source in sources.items() if source.measures == "position"]
    seen, head_seen = (sum(t.visible.get(name, 0.0) for name in places) for t in (track, head))
    return seen + lead > head_seen + settings.lead
