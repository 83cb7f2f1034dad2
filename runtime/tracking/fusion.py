"""One tracker for every sensor: looks of any source in, tracks with existence out.

Each look is a chance to be detected by its own source only. Looks that come late are put in order:
the tracker goes back to before them and takes in again what came after. No clock and no randomness:
time comes with the looks' stamps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from twinscrew.runtime._native import association_marginals, pair_fits
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.detections import Look, SourceSettings
from twinscrew.runtime.tracking.existence import (
    Clutter,
    ExistenceSettings,
    Presence,
    VesselSettings,
    has_moved,
    in_sector,
    shadowed,
    visibility,
)
from twinscrew.runtime.tracking.kalman import (
    STATES,
    FilterBank,
    acceleration_psd,
    bias_noise,
    first_covariance,
    motion_noise,
    transition,
)


class FusionSettings(Settings, frozen=True, kw_only=True):
    """How looks become tracks."""

    sources: dict[str, SourceSettings] = msgspec.field(default_factory=dict)
    """The sources, by name."""
    existence: ExistenceSettings = ExistenceSettings()
    """When tracks are reported and dropped."""
    vessel: VesselSettings = VesselSettings()
    """Which tracks are one vessel."""
    acceleration_psd: Positive = 0.3
    """[m2/s3] Density of the white acceleration of what is under way."""
    rest_psd: Positive = 0.05
    """[m2/s3] The same of what lies still."""
    under_way_mps: Positive = 0.5
    """[m/s] At this speed the density is half-way between the two."""
    first_speed_mps: Positive = 2.5
    """[m/s] Standard deviation of each velocity component of an object just met."""
    bias_time_s: Positive = 8.0
    """[s] Time constant with which the visible centroid wanders over the hull."""
    gate_sigma: Positive = 4.0
    """[-] Detections farther than this from a track's prediction are not its own."""
    buffer_s: NonNegative = 4.0
    """[s] Looks that come up to so late are put in order; later ones are left out."""


@dataclass(slots=True, eq=False)
class FusedTrack:
    """What is known of one target."""

    x: Float64
    P: Float64
    presence: Presence
    shape_m2: Float64
    id: int = -1

    @property
    def confirmed(self) -> bool:
        """Whether it has been reported."""
        return self.id >= 0

    def copy(self) -> FusedTrack:
        """Give it as it is now."""
        known = replace(self.presence, visible=dict(self.presence.visible))
        return FusedTrack(self.x, self.P, known, self.shape_m2, self.id)


@dataclass(frozen=True, slots=True)
class _Taken:
    """A look, and what was known before it."""

    stamp_ns: int
    number: int
    look: Look
    tracks: list[FusedTrack]
    last_ns: int | None
    clutter: dict[str, Clutter]


class Fusion:
    """Follows what the sources detect."""

    def __init__(self, settings: FusionSettings) -> None:
        self.settings = settings
        self._bank = FilterBank()
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._tracks: list[FusedTrack] = []
        self._clutter = {name: Clutter(s) for name, s in self.settings.sources.items()}
        self._taken: list[_Taken] = []
        self._ids: dict[tuple[int, int], int] = {}
        self._last_ns: int | None = None
        self._used_ns: dict[str, int] = {}
        self._numbers = 0

    def take(self, look: Look) -> bool:
        """Take in a look; False if it was left out, for it came too late or tells nothing new."""
        source = self.settings.sources[look.source]
        stamp_ns = look.stamp_ns - round(source.delay_s * NANOSECONDS_PER_SECOND)
        used_ns = self._used_ns.get(look.source)
        if used_ns is not None and abs(stamp_ns - used_ns) < source.correlation_s * 1e9:
            return False
        if self._last_ns is not None and stamp_ns < self._last_ns - self.settings.buffer_s * 1e9:
            return False
        self._used_ns[look.source] = stamp_ns
        again = self._go_back(stamp_ns)
        self._numbers += 1
        self._step(stamp_ns, self._numbers, look)
        for taken in again:
            self._step(taken.stamp_ns, taken.number, taken.look)
        oldest_ns = (self._last_ns or 0) - self.settings.buffer_s * 1e9
        self._taken = [taken for taken in self._taken if taken.stamp_ns >= oldest_ns]
        return True

    def _go_back(self, stamp_ns: int) -> list[_Taken]:
        """Undo the looks after a time; give them."""
        count = len(self._taken)
        while count and self._taken[count - 1].stamp_ns > stamp_ns:
            count -= 1
        later = self._taken[count:]
        if later:
            before = later[0]
            self._tracks, self._last_ns = before.tracks, before.last_ns
            self._clutter = before.clutter
            self._taken = self._taken[:count]
        return later

    def _step(self, stamp_ns: int, number: int, look: Look) -> None:
        if self.settings.buffer_s:
            known = [track.copy() for track in self._tracks]
            clutter = {name: density.copy() for name, density in self._clutter.items()}
            self._taken.append(_Taken(stamp_ns, number, look, known, self._last_ns, clutter))
        dt = 0.0 if self._last_ns is None else (stamp_ns - self._last_ns) / NANOSECONDS_PER_SECOND
        self._last_ns = stamp_ns
        self._predict(dt)
        self._update(stamp_ns, number, look)
        self._confirm(stamp_ns)
        self._drop()
        if self.settings.vessel.length_m:
            self._find_parts(stamp_ns)

    def _predict(self, dt: float) -> None:
        if not self._tracks or dt <= 0.0:
            return
        x, P = self._moved(self._tracks, dt)
        survives = math.exp(-dt / self.settings.existence.lifetime_s)
        for k, track in enumerate(self._tracks):
            track.x, track.P = x[k], P[k]
            presence = track.presence
            presence.existence *= survives
            for name in presence.visible:
                source = self.settings.sources[name]
                presence.visible[name] = visibility(presence, name, source, dt)

    def _moved(self, tracks: list[FusedTrack], dt: float) -> tuple[Float64, Float64]:
        """Give states and covariances, (K, 6) and (K, 6, 6), `dt` [s] later."""
        settings = self.settings
        x, P = np.array([t.x for t in tracks]), np.array([t.P for t in tracks])
        psd = acceleration_psd(
            x,
            rest=settings.rest_psd,
            under_way=settings.acceleration_psd,
            speed_mps=settings.under_way_mps,
        )
        Q = psd[:, None, None] * motion_noise(dt, 1.0)
        Q += bias_noise(dt, settings.bias_time_s, np.array([t.shape_m2 for t in tracks]))
        return self._bank.predict(x, P, transition(dt, settings.bias_time_s), Q)

    def _update(self, stamp_ns: int, number: int, look: Look) -> None:
        source, tracks = self.settings.sources[look.source], self._tracks
        look, distance = _within(look, source)
        clutter = self._clutter[look.source]
        density = clutter.density(distance)
        chance = self._chances(look, source)  # of detection, if the track exists: v p_D
        beta = association_marginals(self._weights(look, source, chance, density))
        self._correct(look, source, chance, beta)
        owned = beta.sum(axis=0) if len(tracks) else np.zeros(len(density))
        settled = [t.presence.hits >= self.settings.existence.settled_hits for t in tracks]
        held = beta[settled].sum(axis=0) if any(settled) else np.zeros(len(density))
        clutter.learn(stamp_ns, distance, 1.0 - np.minimum(held, 1.0))
        if source.measures == "position":
            self._start(stamp_ns, number, look, source, 1.0 - np.minimum(owned, 1.0), density)

    def _chances(self, look: Look, source: SourceSettings) -> Float64:
        """Give v p_D of each track."""
        if not self._tracks:
            return np.zeros(0)
        existence = self.settings.existence
        offset = np.array([track.x[:2] for track in self._tracks]) - look.origin_N
        chance = source.detection_probability(np.hypot(offset[:, 0], offset[:, 1]))
        chance = chance * in_sector(offset, look.heading, source.sector_rad)
        hides = np.array([track.confirmed for track in self._tracks])
        chance[shadowed(offset, hides, existence)] *= existence.shadow
        for track in self._tracks:
            track.presence.visible.setdefault(look.source, source.visible)
        seen = np.array([track.presence.visible[look.source] for track in self._tracks])
        product: Float64 = chance * seen
        return product

    def _weights(
        self, look: Look, source: SourceSettings, chance: Float64, density: Float64
    ) -> Float64:
        """Give each pair's weight against "not detected", (K, M)."""
        if not len(chance) or not len(density):
            return np.zeros((len(chance), len(density)))
        x, P = _states(self._tracks)
        origin = look.origin_N.tolist()
        gate = self.settings.gate_sigma
        _, per_m = pair_fits(x, P, look.z, look.H, look.R, look.R_rad2, origin, gate)
        if source.measures == "bearing":  # the density of clutter is one of directions
            per_m = per_m * np.hypot(*(x[:, :2] - look.origin_N).T)[:, None]
        a = np.array([track.presence.existence for track in self._tracks]) * chance
        weights: Float64 = (a / (1.0 - a))[:, None] * per_m / density
        return weights

    def _correct(self, look: Look, source: SourceSettings, chance: Float64, beta: Float64) -> None:
        """Let each track take in what a look says of it: Musicki and Evans (2004), sec. III."""
        rows, columns = np.nonzero(beta > 1e-4)
        if len(rows):
            x, P = _states(self._tracks)
            H, R = look.H[columns], look.R[columns].copy()
            offset = x[rows, :2] - look.origin_N
            grown = look.R_rad2[columns] * (offset**2).sum(axis=1)
            R += grown[:, None, None] * np.eye(R.shape[1])
            x_new, P_new = self._bank.update(x[rows], P[rows], look.z[columns], H, R)
        for k, track in enumerate(self._tracks):
            presence, r, vp = track.presence, track.presence.existence, chance[k]
            v = presence.visible[look.source]
            detected = float(beta[k].sum())
            missed = 1.0 - detected
            unseen = missed * r * (1.0 - vp) / (1.0 - r * vp)
            hidden = missed * r * (v - vp) / (1.0 - r * vp)  # not detected, though visible
            presence.existence = min(detected + unseen, 0.9999)
            presence.visible[look.source] = min(
                max((detected + hidden) / (detected + unseen), 0.02), 0.999
            )
            mine = np.flatnonzero(rows == k)
            if len(mine):
                share = beta[k, columns[mine]] / (detected + unseen)
                track.x, track.P = _mixed(track.x, track.P, x_new[mine], P_new[mine], share)
            if detected > 0.5:
                presence.hits += 1
                presence.sources |= {look.source}
                if any(source.shape_m):
                    track.shape_m2 = np.square(source.shape_m)

    def _start(
        self,
        stamp_ns: int,
        number: int,
        look: Look,
        source: SourceSettings,
        free: Float64,
        density: Float64,
    ) -> None:
        """Start a track from each detection that may be a new target."""
        existence = self.settings.existence
        new = free * existence.birth / (existence.birth + density)
        speed = self.settings.first_speed_mps**2
        shape = np.square(source.shape_m)
        for m in np.flatnonzero(new > existence.drop_tentative).tolist():
            prior = np.array([0.0, 0.0, speed, speed, *shape])
            z, R = look.z[m], look.R[m]
            self._tracks.append(
                FusedTrack(
                    x=np.concatenate([z, np.zeros(STATES - 2)]),
                    P=first_covariance(look.H[m], R, prior),
                    presence=Presence(
                        existence=float(new[m]),
                        first_N=z,
                        first_R=R,
                        first_ns=stamp_ns,
                        key=(number, m),
                        sources=frozenset((look.source,)),
                    ),
                    shape_m2=shape,
                )
            )

    def _confirm(self, stamp_ns: int) -> None:
        settings = self.settings.existence
        for track in self._tracks:
            presence = track.presence
            presence.moved = has_moved(presence, track.x[:2], track.P, settings)
            if track.confirmed or presence.existence <= settings.confirm:
                continue
            if presence.moved or self._is_no_land(presence, stamp_ns):
                track.id = self._ids.setdefault(presence.key, len(self._ids))

    def _is_no_land(self, presence: Presence, stamp_ns: int) -> bool:
        for name in presence.sources:
            source = self.settings.sources[name]
            steady = (stamp_ns - presence.first_ns) * 1e-9 > source.steady_s > 0.0
            if not source.sees_land or steady:
                return True
        return False

    def _drop(self) -> None:
        """Drop what does not exist, is nowhere, or is another track's double."""
        settings = self.settings.existence
        kept: list[FusedTrack] = []
        for track in sorted(self._tracks, key=_seniority):
            least = settings.drop if track.confirmed else settings.drop_tentative
            most = 3.0 * settings.known_m if track.confirmed else settings.tentative_known_m
            if track.presence.existence < least or _sigma(track.P) > most:
                continue
            if not any(_are_doubles(track, other) for other in kept):
                kept.append(track)
        self._tracks = kept

    def _find_parts(self, stamp_ns: int) -> None:
        """Find which reported tracks are parts of one vessel, and which of them leads."""
        settings = self.settings.vessel
        heads: list[FusedTrack] = []
        for track in sorted((t for t in self._tracks if t.confirmed), key=lambda t: t.id):
            part = track.presence
            known_s = (stamp_ns - part.part_since_ns) * 1e-9
            head = None
            for other in heads:
                held = part.part_of == other.presence.key and known_s > settings.hold_s
                if are_one_vessel(track, other, settings, settings.hold if held else 1.0):
                    head = other
                    break
            if head is None:
                part.part_of = None
                heads.append(track)
                continue
            if part.part_of != head.presence.key:
                part.part_of, part.part_since_ns, known_s = head.presence.key, stamp_ns, 0.0
            if known_s >= settings.lead_s and self._leads(track, head):
                track.id, head.id = head.id, track.id
                part.key, head.presence.key = head.presence.key, part.key
                head.presence.part_of, part.part_of = part.key, None
                head.presence.part_since_ns = part.part_since_ns
                heads[heads.index(head)] = track

    def _leads(self, track: FusedTrack, head: FusedTrack) -> bool:
        settings = self.settings.vessel
        u = track.x[2:4] + head.x[2:4]
        ahead = float((track.x[:2] - head.x[:2]) @ u) / max(math.hypot(u[0], u[1]), 1e-6)
        lead = min(max(ahead / settings.lead_m, -1.0), 1.0)
        return self._seen(track) + lead > self._seen(head) + settings.lead

    def _seen(self, track: FusedTrack) -> float:
        """Give how many sources of positions see a track."""
        visible = track.presence.visible
        return sum(
            visible.get(n, 0.0)
            for n, s in self.settings.sources.items()
            if s.measures == "position"
        )

    def tracks_at(self, stamp_ns: int, own_N: Float64) -> list[FusedTrack]:
        """Give the reported tracks at a time, seen from a place (2,) [m]; by identity."""
        settings = self.settings.existence
        reported = [
            track.copy()
            for track in self._tracks
            if track.confirmed
            and track.presence.part_of is None
            and track.presence.existence >= settings.report
        ]
        if not reported or self._last_ns is None:
            return []
        dt = max((stamp_ns - self._last_ns) / NANOSECONDS_PER_SECOND, 0.0)
        x, P = self._moved(reported, dt)
        for k, track in enumerate(reported):
            track.x, track.P = x[k], P[k]
        near = [
            track
            for track in reported
            if _sigma(track.P) <= settings.known_m
            and math.hypot(*(track.x[:2] - own_N)) <= settings.report_range_m
        ]
        return sorted(near, key=lambda track: track.id)


def are_one_vessel(
    track: FusedTrack, other: FusedTrack, settings: VesselSettings, scale: float
) -> bool:
    """Tell whether two tracks lie along one course and keep their places."""
    v = 0.5 * (track.x[2:4] + other.x[2:4])
    speed = math.hypot(v[0], v[1])
    if speed < 0.5:
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


def _within(look: Look, source: SourceSettings) -> tuple[Look, Float64]:
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


def _mixed(
    x: Float64, P: Float64, x_new: Float64, P_new: Float64, share: Float64
) -> tuple[Float64, Float64]:
    """Give mean and covariance of a mixture: (N,) shares of updates, the rest of no update."""
    rest = max(1.0 - float(share.sum()), 0.0)
    mean = rest * x + share @ x_new
    off, offs = x - mean, x_new - mean
    spread = rest * (P + np.outer(off, off))
    spread += np.einsum("n,nij->ij", share, P_new + offs[:, :, None] * offs[:, None, :])
    return mean, spread


def _states(tracks: list[FusedTrack]) -> tuple[Float64, Float64]:
    return np.array([t.x for t in tracks]), np.array([t.P for t in tracks])


def _sigma(P: Float64) -> float:
    """[m] Standard deviation of a position, the mean of both axes."""
    return math.sqrt(0.5 * (P[0, 0] + P[1, 1]))


def _seniority(track: FusedTrack) -> tuple[bool, float]:
    """Sort reported tracks first, by identity; others by existence."""
    return not track.confirmed, track.id if track.confirmed else -track.presence.existence


DOUBLE_M = 6.0
"""[m] Tracks nearer than this, with the same velocity, are one."""
DOUBLE_MPS = 2.0
"""[m/s] Velocities that differ by less are the same;"""
TENTATIVE_MPS = 7.0
"""[m/s] with a track that was never reported they hardly count."""


def _are_doubles(track: FusedTrack, other: FusedTrack) -> bool:
    d = track.x[:4] - other.x[:4]
    limit = DOUBLE_MPS if track.confirmed else TENTATIVE_MPS
    return math.hypot(d[0], d[1]) < DOUBLE_M and math.hypot(d[2], d[3]) < limit
