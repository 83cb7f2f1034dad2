"""The tracker: what any source detects in, tracks with identity, velocity and covariance out.

One constant-velocity Kalman filter a track in frame N, so that the ego vessel's motion is removed
by odometry. The boat's LiDAR comes in by `step`: its objects are segmented, so each belongs to one
track at most (optimal assignment), and its segments measure velocities. Any other source comes in
by `take`: its detections are shared among tracks by their probabilities. What comes late is put in
order: the tracker goes back, takes it in, and takes in again what came after. No clock and no
randomness: time comes with the stamps.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    Objects,
    Odometry,
    Tracks,
)
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.association import Association, associate
from twinscrew.runtime.tracking.detections import Look, SourceSettings, no_detections
from twinscrew.runtime.tracking.joint import (
    VesselSettings,
    chances,
    find_parts,
    may_be_reported,
    missed,
    take_look,
    without_doubles,
)
from twinscrew.runtime.tracking.kalman import (
    STATES,
    FilterBank,
    acceleration_psd,
    add_bias_noise,
    add_slide_noise,
    first_covariance,
    motion_noise,
    transition,
)
from twinscrew.runtime.tracking.lidar import (
    NO_SEGMENTS,
    AtRest,
    Centroids,
    LidarExtras,
    Measurements,
    MeasurementSettings,
    RadiusSettings,
    SensorView,
    Viewpoint,
    join_fragments,
    smoothed_radius,
    told,
)
from twinscrew.runtime.tracking.lidar_motion import (
    VELOCITY,
    HullVelocity,
    HullVelocitySettings,
    LongObjects,
    LongObjectSettings,
    MeasuredVelocity,
    OutlineView,
    corrected,
)
from twinscrew.runtime.tracking.named import (
    WHOLE,
    hand_over,
    is_believed,
    is_seen_in_part,
    only_named,
    pass_on_names,
    take_named,
)
from twinscrew.runtime.tracking.ships import (
    SeenShip,
    ShipSettings,
    find_ships,
    in_outline,
    without,
)
from twinscrew.runtime.tracking.track import (
    Clutter,
    ExistenceSettings,
    LifeSettings,
    Named,
    Track,
    has_moved,
    is_absorbed,
    is_born,
    least_reported,
    lives,
    sigma_m,
    states,
)

LIDAR = "lidar"
"""Name of the source whose scans come in by `Tracker.step`."""
UNKNOWN_PIECE_M = 3.0
"""[m] By so much a piece of a long object may be elsewhere than before without having moved."""
UNKNOWN_PIECE_MPS = 1.5
"""[m/s] What is long mostly rests: standard deviation of its velocity while it is unknown."""
UNSEEN = 0.8
"""[-] What a scan leaves of the existence of a vessel that it should show, and does not."""
KEPT_IDENTITIES = 4096
"""Identities remembered for tracks that may be started again."""


class TrackerSettings(Settings, frozen=True, kw_only=True):
    """How detections become tracks."""

    measurement: MeasurementSettings = MeasurementSettings()
    """How the visible centroid relates to the centre."""
    displacement: HullVelocitySettings = HullVelocitySettings()
    """How velocities are measured from scan to scan."""
    standing: LongObjectSettings = LongObjectSettings()
    """When long objects are taken to lie at rest."""
    ships: ShipSettings = ShipSettings()
    """When they are followed as one long vessel."""
    radius: RadiusSettings = RadiusSettings()
    """How the radius is smoothed."""
    acceleration_psd: Positive = 1.0
    """[m2/s3] Density of the white acceleration of what is under way."""
    rest_psd: Positive = 0.05
    """[m2/s3] The same of what lies still: buoys do not speed up."""
    under_way_mps: Positive = 0.3
    """[m/s] At this speed the density is half-way between the two (paper: slower is no vessel)."""
    first_speed_mps: Positive = 2.0
    """[m/s] Standard deviation of each velocity component of an object just met."""
    gate_sigma: Positive = 3.5
    """[-] A measurement farther than this from every track's prediction starts a new one."""
    life: LifeSettings = LifeSettings()
    """When a track that the LiDAR sees is born and dropped."""
    max_gap_s: Annotated[float, Meta(gt=0.0)] = 5.0
    """[s] After a longer gap between scans everything is forgotten."""
    sources: dict[str, SourceSettings] = msgspec.field(default_factory=dict)
    """Sources beside the boat's LiDAR, by name."""
    existence: ExistenceSettings = ExistenceSettings()
    """When tracks that these sources see are reported and dropped."""
    vessel: VesselSettings = VesselSettings()
    """Which tracks are parts of one vessel."""
    buffer_s: NonNegative = 0.5
    """[s] What comes up to so late is put in order."""


@dataclass(frozen=True, slots=True)
class Scan:
    """The objects of a LiDAR scan, and from where it was taken."""

    objects: Objects
    viewpoint: Viewpoint


@dataclass(frozen=True, slots=True)
class _Step:
    """One look or scan, and what was known before it."""

    stamp_ns: int
    number: int
    what: Look | Scan
    tracks: list[tuple[Any, ...]]
    last_ns: int | None
    clutter: dict[str, Clutter]
    outlines: tuple[Any, ...]


class Tracker:
    """Follows every object around the vessel."""

    def __init__(
        self, settings: TrackerSettings | None = None, view: SensorView | None = None
    ) -> None:
        """Begin with nothing known; `view` is how the LiDAR looks at what is around."""
        self.settings = settings or TrackerSettings()
        self._hull_velocity = HullVelocity(self.settings.displacement)
        self._bank = FilterBank()
        view = view or SensorView()
        self._centroids = Centroids(self.settings.measurement, view)
        self._lidar, self._reach_m = _segmented(view), view.reach_m
        self._long = LongObjects(self.settings.standing)
        variance = self.settings.standing.sigma_mps**2
        self._still = MeasuredVelocity(np.zeros(2), variance * np.eye(2))
        self._maybe_still = MeasuredVelocity(np.zeros(2), UNKNOWN_PIECE_MPS**2 * np.eye(2))
        sources = self.settings.sources
        self._identifying = frozenset(name for name in sources if sources[name].identifies)
        psd = [s.acceleration_psd for s in sources.values() if s.identifies]
        self._named_psd = max((value for value in psd if value is not None), default=None)
        self._next_id = 0
        self.reset()

    def reset(self) -> None:
        """Forget everything but the identities already given: none is ever used twice."""
        self._tracks: list[Track] = []
        self._clutter = {name: Clutter(s) for name, s in self.settings.sources.items()}
        self._long.reset()
        self._history: list[_Step] = []
        self._identities: dict[tuple[int, int], int] = {}
        self._last_ns: int | None = None
        self._scan_ns: int | None = None
        self._used_ns: dict[str, int] = {}
        self._number = 0
        self._reported: Tracks | None = None
        self.note = ""
        """Why tracks were forgotten in the last step, in plain words; empty if they were not."""

    def step(self, objects: Objects, odometry: Odometry) -> Tracks:
        """Take in one scan of the LiDAR.

        Parameters
        ----------
        objects
            What perception found.
        odometry
            The vessel's state at the scan's stamp.

        Returns
        -------
        Tracks
            Every confirmed track, oldest first, at the scan's stamp, or at that of the latest look
            if this is later. A scan with the stamp of the last one changes nothing; one that comes
            later than the buffer allows, or long after the last, starts afresh and says so in
            `note`.
        """
        stamp_ns = objects.stamp_ns
        if stamp_ns == self._scan_ns and self._reported is not None:
            self.note = ""
            return self._reported
        self._start_afresh_after_a_jump(stamp_ns)
        self._insert(stamp_ns, Scan(objects, Viewpoint.of(odometry)))
        self._scan_ns = stamp_ns
        self._reported = self._report(max(stamp_ns, self._last_ns or stamp_ns))
        return self._reported

    def take(self, look: Look) -> bool:
        """Take in a look of another source.

        Returns
        -------
        bool
            False if it was left out: it came too late, or tells nothing new.
        """
        source = self.settings.sources[look.source]
        stamp_ns = look.stamp_ns - round(source.delay_s * NANOSECONDS_PER_SECOND)
        used_ns = self._used_ns.get(look.source)
        if used_ns is not None and abs(stamp_ns - used_ns) < source.correlation_s * 1e9:
            return False
        if self._last_ns is not None and stamp_ns < self._last_ns - self.settings.buffer_s * 1e9:
            return False
        self._used_ns[look.source] = stamp_ns
        self._insert(stamp_ns, look)
        return True

    def tracks_at(self, stamp_ns: int, own_N: Float64) -> list[Track]:
        """Give what is reported, by identity, as it is at a time, seen from a place (2,) [m]."""
        existence = self.settings.existence
        reported = [
            Track.restored(track.saved())
            for track in self._tracks
            if track.confirmed
            and track.part_of is None
            and track.existence >= least_reported(track, existence)
        ]
        if not reported or self._last_ns is None:
            return []
        dt = max((stamp_ns - self._last_ns) / NANOSECONDS_PER_SECOND, 0.0)
        x, P = self._moved(reported, dt, own_N)
        for k, track in enumerate(reported):
            track.x, track.P = x[k], P[k]
        near = [
            track
            for track in reported
            if sigma_m(track.P) <= existence.known_m
            and math.hypot(*(track.x[:2] - own_N)) <= existence.report_range_m
        ]
        return sorted(near, key=lambda track: track.id)

    def seen_by_others(self, stamp_ns: int, own_N: Float64) -> Tracks:
        """Give what sources beside the LiDAR have shown, as it is at a time [ns], from a place.

        For a boat whose LiDAR sends nothing: tracks that only the LiDAR knows are left out, since
        nobody would notice if they were no longer there.
        """
        shown = [track for track in self._shown() if track.sources - {LIDAR}]
        dt = max((stamp_ns - (self._last_ns or stamp_ns)) / NANOSECONDS_PER_SECOND, 0.0)
        return self._message(stamp_ns, shown, *self._moved(shown, dt, own_N))

    def _start_afresh_after_a_jump(self, stamp_ns: int) -> None:
        last_ns = stamp_ns if self._scan_ns is None else self._scan_ns
        dt = (stamp_ns - last_ns) / NANOSECONDS_PER_SECOND
        jumped = not -self.settings.buffer_s <= dt <= self.settings.max_gap_s
        if jumped:
            self.reset()
        self.note = f"time went on by {dt:.3f} s: tracks forgotten" if jumped else ""

    def _insert(self, stamp_ns: int, what: Look | Scan) -> None:
        """Take in a look or scan at its place in time, and again what came after it."""
        count = len(self._history)
        while count and self._history[count - 1].stamp_ns > stamp_ns:
            count -= 1
        later = self._history[count:]
        if later:
            before = later[0]
            self._tracks = [Track.restored(saved) for saved in before.tracks]
            self._last_ns, self._clutter = before.last_ns, before.clutter
            self._long.restore(before.outlines)
            self._history = self._history[:count]
        self._number += 1
        self._apply(stamp_ns, self._number, what)
        for step in later:
            self._apply(step.stamp_ns, step.number, step.what)

    def _apply(self, stamp_ns: int, number: int, what: Look | Scan) -> None:
        self._save(stamp_ns, number, what)
        dt = 0.0 if self._last_ns is None else (stamp_ns - self._last_ns) / NANOSECONDS_PER_SECOND
        dt = max(dt, 0.0)
        self._last_ns = stamp_ns
        if isinstance(what, Scan):
            self._take_scan(what, dt, number)
        else:
            self._take_look(what, dt, number, stamp_ns)

    def _save(self, stamp_ns: int, number: int, what: Look | Scan) -> None:
        """Remember what is known, for as long as something may come late."""
        oldest_ns = stamp_ns - round(self.settings.buffer_s * NANOSECONDS_PER_SECOND)
        while self._history and self._history[0].stamp_ns < oldest_ns:
            del self._history[0]
        if self.settings.buffer_s:
            tracks = [track.saved() for track in self._tracks]
            clutter = {name: density.copy() for name, density in self._clutter.items()}
            outlines = self._long.saved()
            self._history.append(
                _Step(stamp_ns, number, what, tracks, self._last_ns, clutter, outlines)
            )

    def _take_look(self, look: Look, dt: float, number: int, stamp_ns: int) -> None:
        settings = self.settings
        self._predict(dt, look.origin_N)
        if look.source in self._identifying:
            source, speed = settings.sources[look.source], settings.first_speed_mps
            take_named(
                self._tracks,
                look,
                source,
                self._bank,
                number=number,
                stamp_ns=stamp_ns,
                first_speed_mps=speed,
            )
            for track in self._tracks:
                if not track.confirmed and only_named(track, self._identifying):
                    self._name(track)
            return
        take_look(
            self._tracks,
            look,
            settings.sources[look.source],
            settings.existence,
            self._clutter[look.source],
            number=number,
            stamp_ns=stamp_ns,
            gate_sigma=settings.gate_sigma,
            first_speed_mps=settings.first_speed_mps,
        )
        self._confirm_existing(stamp_ns)
        seen_by_lidar = [track for track in self._tracks if track.scans]
        others = [track for track in self._tracks if not track.scans]
        self._tracks = seen_by_lidar + without_doubles(others, settings.existence, seen_by_lidar)
        if settings.vessel.length_m:
            find_parts(self._tracks, settings.vessel, settings.sources, stamp_ns)

    def _confirm_existing(self, stamp_ns: int) -> None:
        existence = self.settings.existence
        for track in self._tracks:
            track.moved = has_moved(track, existence)
            if may_be_reported(track, self.settings.sources, stamp_ns, existence.confirm):
                self._name(track)

    def _take_scan(self, scan: Scan, dt: float, number: int) -> None:
        objects, own = scan.objects, scan.viewpoint
        x, P = self._predict(dt, own.p_N)
        for track in self._tracks:
            if track.scans:
                track.scans += 1
        at_rest = self._long.at_rest(objects, own)
        ships: list[SeenShip] = []
        if False in at_rest or any(track.hull for track in self._tracks):
            ships = find_ships(
                self._tracks, x, objects, at_rest, own, self._reach_m, self.settings.ships
            )
        if ships:
            members = np.any([ship.members for ship in ships], axis=0)
            objects, at_rest = without(objects, at_rest, members)
        whole, said = self._joined(objects, told(objects, at_rest), x, own)
        measured = self._centroids.measure(whole, own, said)
        self._update(x, P, measured, own, number, {ship.track for ship in ships})
        for ship in ships:
            self._take_ship(ship, x[ship.track], P[ship.track], objects.stamp_ns, dt)
        self._drop()
        if self._identifying:
            self._tracks = hand_over(self._tracks, self._identifying, self._bank)

    def _predict(self, dt: float, own_N: Float64) -> tuple[Float64, Float64]:
        """Move every track on; give all states and covariances, (K, 6) and (K, 6, 6)."""
        if not self._tracks:
            return states(self._tracks)
        x, P = self._moved(self._tracks, dt, own_N)
        for k, track in enumerate(self._tracks):
            track.predicted(dt, x[k], P[k])
        if self.settings.sources and dt > 0.0:
            survives = math.exp(-dt / self.settings.existence.lifetime_s)
            usual = {name: self._source(name) for name in (LIDAR, *self.settings.sources)}
            drift = {n: (s.visible, math.exp(-dt / s.visible_s)) for n, s in usual.items()}
            for track in self._tracks:
                if track.named is None:
                    track.existence *= survives
                visible = {}
                for name, known in track.visible.items():
                    mean, kept = drift[name]  # a Markov chain of two states
                    visible[name] = mean + (known - mean) * kept
                track.visible = visible
        return x, P

    def _moved(self, tracks: Sequence[Track], dt: float, own_N: Float64) -> tuple[Float64, Float64]:
        """Give states and covariances of tracks `dt` [s] later, seen from a place (2,) [m]."""
        settings, time_s = self.settings, self.settings.measurement.bias_time_s
        x, P = states(tracks)
        if dt == 0.0:
            return x, P
        psd = acceleration_psd(
            x,
            rest=settings.rest_psd,
            under_way=settings.acceleration_psd,
            speed_mps=settings.under_way_mps,
        )
        if any(track.hull for track in tracks):
            long = [track.hull is not None for track in tracks]
            psd = np.where(long, np.minimum(psd, settings.ships.acceleration_psd), psd)
        if self._named_psd is not None:
            named = [only_named(track, self._identifying) for track in tracks]
            psd = np.where(named, np.minimum(psd, self._named_psd), psd)
        Q = psd[:, None, None] * motion_noise(dt, 1.0)
        add_bias_noise(Q, dt, time_s, self._bias_variance(tracks, x, own_N))
        slides = settings.standing.slide_mps * _floats([track.at_rest for track in tracks])
        add_slide_noise(Q, dt, slides)
        return self._bank.predict(x, P, transition(dt, time_s), Q)

    def _bias_variance(self, tracks: Sequence[Track], x: Float64, own_N: Float64) -> Float64:
        """Give how far what is detected of each track may be off its centre, (K, 2) [m2]."""
        if not any(track.scans for track in tracks):
            return np.array([track.shape_m2 for track in tracks])
        variance = self._centroids.bias_variance(x, _floats([t.radius for t in tracks]), own_N)
        for k, track in enumerate(tracks):
            if not track.scans:
                variance[k] = track.shape_m2
        return variance

    def _source(self, name: str) -> SourceSettings:
        return self.settings.sources.get(name, self._lidar)

    def _joined(
        self, objects: Objects, at_rest: Sequence[AtRest], x: Float64, own: Viewpoint
    ) -> tuple[Objects, Sequence[AtRest]]:
        """Put together what lies within the circle of one known track."""
        known = [k for k, t in enumerate(self._tracks) if t.confirmed and t.scans and not t.at_rest]
        if not known or len(objects.p_L) < 2:
            return objects, at_rest
        p_L = own.in_L(x[known, :2])
        radius = _floats([self._tracks[k].radius for k in known])
        return join_fragments(objects, at_rest, p_L, self.settings.life.join_share * radius)

    def _take_ship(self, ship: SeenShip, x: Float64, P: Float64, stamp_ns: int, dt: float) -> None:
        """Let a track take in what a scan shows of its long vessel."""
        track, settings = self._tracks[ship.track], self.settings
        if ship.v_N is not None:  # a piece until now
            x, speed = np.concatenate([ship.p_N, ship.v_N, np.zeros(2)]), settings.first_speed_mps
            P = np.diag([1.0, 1.0, speed**2, speed**2, P[4, 4], P[5, 5]])
        x[:2] += ship.shift_N
        H, R = np.eye(2, STATES), ship.R
        y = ship.p_N - x[:2]
        distance2 = float(y @ np.linalg.solve(P[:2, :2] + R, y))
        R = R * max(distance2 / settings.measurement.jump_sigma**2, 1.0)
        after, covariance = self._bank.update(x[None], P[None], ship.p_N[None], H[None], R[None])
        if ship.at_rest:
            v_N, noise = self._still.v_N[None], self._still.R[None]
            after, covariance = self._bank.update(after, covariance, v_N, VELOCITY[None], noise)
        extras = LidarExtras(stamp_ns, NO_SEGMENTS, ship.at_rest)
        track.seen(after[0], covariance[0], ship.hull.radius, extras)
        rest_s = ship.hull.rest_s + dt if ship.at_rest else 0.0
        track.hull = replace(ship.hull, rest_s=rest_s) if rest_s < settings.ships.rest_s else None

    def _update(
        self,
        x: Float64,
        P: Float64,
        measured: Measurements,
        own: Viewpoint,
        number: int,
        ships: Collection[int] = (),
    ) -> None:
        """Assign what was measured to tracks, those of the `ships` seen in this scan left out."""
        if self._identifying or ships or any(track.hull for track in self._tracks):
            found = self._associated(x, P, measured)
        else:
            found = associate(x, P, measured, self.settings.gate_sigma)
        found.unseen[:] = [k for k in found.unseen if k not in ships]
        if self.settings.sources and own.is_known:
            self._judge_existence(found, own, ships)
        if found.pairs:
            self._correct(x, P, measured, found, own)
        if found.new:
            z_N, radius = measured.z_N[found.new], measured.radius[found.new]
            for j, bias in zip(
                found.new, self._centroids.bias_variance(z_N, radius, own.p_N), strict=True
            ):
                self._tracks.append(self._born(measured, j, bias, (number, j)))

    def _associated(self, x: Float64, P: Float64, measured: Measurements) -> Association:
        """Assign what the LiDAR has measured; not to long vessels, nor to what AIS alone shows."""
        others = [
            k
            for k, track in enumerate(self._tracks)
            if track.hull is None and not only_named(track, self._identifying)
        ]
        if len(others) == len(self._tracks):
            return associate(x, P, measured, self.settings.gate_sigma)
        found = associate(x[others], P[others], measured, self.settings.gate_sigma)
        return Association(
            [(others[i], j, d2) for i, j, d2 in found.pairs],
            [others[i] for i in found.unseen],
            found.new,
        )

    def _judge_existence(self, found: Association, own: Viewpoint, ships: Collection[int]) -> None:
        """Let tracks that the LiDAR should have seen, and has not, exist less surely."""
        source = self._source(LIDAR)
        look = no_detections(LIDAR, own.p_N, own.heading)
        chance = chances(self._tracks, look, source, self.settings.existence)
        seen = np.zeros(len(self._tracks))
        seen[[i for i, _, _ in found.pairs]] = 1.0
        seen[list(ships)] = 1.0
        others: list[int] = []
        for k, track in enumerate(self._tracks):
            if not only_named(track, self._identifying):
                others.append(k)
            elif _surely_within(track, own.p_N, source) and not is_seen_in_part(
                track, self._tracks
            ):
                track.existence *= UNSEEN  # a vessel that is there is seen
        judged = [self._tracks[k] for k in others]
        missed(judged, LIDAR, source, chance[others], seen[others])

    def _correct(
        self, x: Float64, P: Float64, measured: Measurements, found: Association, own: Viewpoint
    ) -> None:
        """Let each track that was seen take in what was measured of it."""
        rows = [i for i, _, _ in found.pairs]
        seen = [j for _, j, _ in found.pairs]
        tracks = [self._tracks[i] for i in rows]
        extras = [measured.extras[j] for j in seen]
        limit2 = self.settings.measurement.jump_sigma**2
        radii = measured.radius[seen].tolist()
        P = self._reopened(P[rows], tracks, extras)
        for n, track in enumerate(tracks):
            if not track.scans:  # another source's until now: its shape has not been of interest
                track.scans, track.radius = 1, radii[n]
                place, size = x[rows[n] : rows[n] + 1], measured.radius[seen[n] : seen[n] + 1]
                P[n, 4:, 4:] = np.diag(self._centroids.bias_variance(place, size, own.p_N)[0])
        states = x[rows]
        velocities = [
            self._velocity(*each) for each in zip(tracks, extras, states.tolist(), strict=True)
        ]
        x, P = corrected(
            self._bank,
            states,
            P,
            (measured.z_N[seen], measured.H[seen], measured.R[seen]),
            _floats([distance2 for _, _, distance2 in found.pairs]) / limit2 - 1.0,
            velocities,
            self.settings.displacement.limit_sigma,
        )
        for n, track in enumerate(tracks):
            radius = smoothed_radius(track.radius, radii[n], self.settings.radius)
            track.seen(x[n], P[n], radius, extras[n])
            if not track.confirmed:
                self._confirm(track)

    def _reopened(self, P: Float64, tracks: list[Track], extras: list[LidarExtras]) -> Float64:
        """Let tracks forget their velocities if they rest, or move, otherwise than it seemed.

        Where a piece is of a long object of which nothing is known tells nothing of its velocity.
        """
        pairs = list(enumerate(zip(tracks, extras, strict=True)))
        turned = [
            n for n, (t, e) in pairs if isinstance(e.at_rest, bool) and e.at_rest != t.at_rest
        ]
        P[turned, 2:4, 2:4] += self.settings.first_speed_mps**2 * np.eye(2)
        sliding = [n for n, (_, e) in pairs if e.at_rest == "unknown"]
        P[sliding, :2, :2] += UNKNOWN_PIECE_M**2 * np.eye(2)
        return P

    def _velocity(
        self, track: Track, extras: LidarExtras, x: Sequence[float]
    ) -> MeasuredVelocity | None:
        """Measure by its segments how fast a track went since it was last seen."""
        if extras.at_rest is True:
            return self._still
        if extras.at_rest == "unknown":
            return self._maybe_still
        if track.extras is None or not len(extras.segments_N):
            return None
        north, east, v_north, v_east, along, across = x
        if math.hypot(along, across) > self.settings.displacement.astray * track.radius:
            return None
        return self._hull_velocity.measure(track.extras, extras, (v_north, v_east), (north, east))

    def _born(self, measured: Measurements, j: int, bias: Float64, key: tuple[int, int]) -> Track:
        speed = self.settings.first_speed_mps**2
        prior = np.array([0.0, 0.0, speed, speed, *bias])
        z_N, R, extras = measured.z_N[j], measured.R[j], measured.extras[j]
        track = Track(
            np.concatenate([z_N, np.zeros(STATES - 2)]),
            first_covariance(measured.H[j], R, prior),
            key=key,
            source=LIDAR,
            stamp_ns=extras.stamp_ns,
            first_R=R,
            radius=float(measured.radius[j]),
            existence=0.5,
            extras=extras,
        )
        self._confirm(track)
        return track

    def _confirm(self, track: Track) -> None:
        if is_born(track, self.settings.life):
            self._name(track)

    def _name(self, track: Track) -> None:
        """Give a track an identity: the one that it had when this was taken in before."""
        if track.key not in self._identities:
            if len(self._identities) >= KEPT_IDENTITIES:
                first = self._history[0].number if self._history else self._number
                kept = {key: id_ for key, id_ in self._identities.items() if key[0] >= first}
                self._identities = kept
            self._identities[track.key] = self._next_id
            self._next_id += 1
        track.id, track.confirmed = self._identities[track.key], True

    def _drop(self) -> None:
        life = self.settings.life
        for track in self._tracks:  # what the LiDAR has lost goes on as its vessel reports it
            if track.named is not None and track.scans and not lives(track, life):
                track.scans, track.hits, track.extras = 0, 0, None
                track.sources -= {LIDAR}
        alive = [track for track in self._tracks if self._is_alive(track)]
        self._tracks = [t for t in alive if t.age_s == 0.0 or not is_absorbed(t, alive, life)]
        long = [track for track in alive if track.hull is not None and track.age_s == 0.0]
        if long:
            self._tracks = [track for track in self._tracks if not self._is_part(track, long)]
        if len(self._tracks) < len(alive):
            pass_on_names(alive, self._tracks)

    def _is_part(self, track: Track, long: Sequence[Track]) -> bool:
        """Tell whether an unseen track lies within the outline of a long vessel that was seen."""
        if track.age_s == 0.0 or track.hull is not None or track.named is not None:
            return False
        margin_m = self.settings.ships.margin_m
        return any(in_outline(track.x[:2], other, margin_m) for other in long)

    def _is_alive(self, track: Track) -> bool:
        if track.scans and lives(track, self.settings.life):
            return True
        if is_believed(track, self._last_ns or 0):
            return True
        if only_named(track, self._identifying):
            return False
        if not self.settings.sources or track.sources <= {LIDAR} - self.settings.sources.keys():
            return False
        existence = self.settings.existence
        least = existence.drop if track.confirmed else existence.drop_tentative
        return track.existence >= least and sigma_m(track.P) <= 3.0 * existence.known_m

    def _is_doubted(self, track: Track) -> bool:
        """Tell whether only AIS has told of a track, and the LiDAR sees water in its place."""
        least = self.settings.existence.report
        return track.existence < least and only_named(track, self._identifying)

    @property
    def outline(self) -> OutlineView | None:
        """The outline of the latest scan, and the free water within it; None without one."""
        return self._long.latest

    @property
    def pieces(self) -> list[int]:
        """Identities of the tracks that are pieces of long objects that stand, as last seen."""
        return [track.id for track in self._tracks if track.confirmed and track.at_rest]

    @property
    def stands(self) -> Mapping[int, bool]:
        """Of that outline's long objects, by number, whether they stand, as far as is known."""
        return self._long.stands

    @property
    def doubted(self) -> tuple[str, ...]:
        """Names of vessels that report themselves where the LiDAR should see them, and does not."""
        return tuple(
            track.named.name
            for track in self._tracks
            if track.named is not None and self._is_doubted(track)
        )

    def _report(self, stamp_ns: int) -> Tracks:
        tracks = self._shown()
        return self._message(stamp_ns, tracks, *states(tracks))

    def _shown(self) -> list[Track]:
        return [
            track
            for track in self._tracks
            if track.confirmed
            and track.part_of is None
            and not (self._identifying and self._is_doubted(track))
        ]

    def _message(self, stamp_ns: int, tracks: Sequence[Track], x: Float64, P: Float64) -> Tracks:
        return Tracks(
            stamp_ns=stamp_ns,
            id=np.array([track.id for track in tracks], dtype=np.int64),
            p_N=x[:, :2].copy(),
            v_N=x[:, 2:4].copy(),
            radius=_floats([track.radius for track in tracks]),
            covariance=P[:, :4, :4].copy(),
            age_s=_floats([track.age_s for track in tracks]),
            **(_outlines(tracks) if any(track.hull or track.named for track in tracks) else {}),
        )


def _segmented(view: SensorView) -> SourceSettings:
    """Give the boat's LiDAR, for the existence of tracks that other sources see too."""
    return SourceSettings(
        range_m=(0.0, view.sure_m, view.reach_m),
        detection=(0.97, 0.97, 0.0),
        max_range_m=view.reach_m,
        visible=0.99,
    )


def _shows_whole(track: Track, named: Named) -> bool:
    """Tell whether a track is all of its vessel: the LiDAR may see a long ship in pieces."""
    return not track.scans or WHOLE * named.radius_m <= track.radius


def _surely_within(track: Track, own_N: Float64, source: SourceSettings) -> bool:
    """Tell whether all of a vessel lies where a source sees nearly everything."""
    distance = math.hypot(*(track.x[:2] - own_N).tolist())
    reach = distance + 2.0 * sigma_m(track.P) + track.radius
    return float(source.detection_probability(np.array([reach]))[0]) > 0.9


def _outlines(tracks: Sequence[Track]) -> dict[str, Any]:
    """Give the columns of outlines, and of names if there are any."""
    half_length, half_beam, heading = np.array([_outline(track) for track in tracks]).T
    columns: dict[str, Any] = {
        "half_length": half_length,
        "half_beam": half_beam,
        "heading": heading,
    }
    if any(track.named for track in tracks):
        names = ("" if track.named is None else track.named.name for track in tracks)
        columns["name"] = tuple(names)
    return columns


def _outline(track: Track) -> tuple[float, float, float]:
    """Give half length, half beam [m] and heading [rad]; NaN where only the radius is known."""
    named, hull = track.named, track.hull
    if named is not None and _shows_whole(track, named):
        return named.half_length_m, named.half_beam_m, named.heading
    if hull is not None:
        return hull.half_length, hull.half_beam, hull.heading
    return math.nan, math.nan, math.nan


def _floats(values: Sequence[float]) -> Float64:
    return np.array(values, dtype=np.float64)
