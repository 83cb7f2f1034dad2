"""The tracker: objects of each scan in, tracks with velocities out.

One constant-velocity Kalman filter a track in frame N, so that the ego vessel's motion is removed
by odometry; measurements assigned by Mahalanobis distance; birth after m of n scans, coasting,
death. No clock and no randomness: time comes with the objects' stamps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta

from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    Objects,
    Odometry,
    Tracks,
)
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.tracking.association import Association, associate
from twinscrew.runtime.tracking.bank import FilterBank
from twinscrew.runtime.tracking.correction import corrected
from twinscrew.runtime.tracking.displacement import (
    Displacement,
    DisplacementSettings,
    MeasuredVelocity,
    Sight,
)
from twinscrew.runtime.tracking.fragments import join_fragments
from twinscrew.runtime.tracking.life import LifeSettings, is_absorbed, is_born, lives
from twinscrew.runtime.tracking.measurement import (
    Centroids,
    Measurements,
    MeasurementSettings,
    Stand,
)
from twinscrew.runtime.tracking.motion import (
    STATES,
    bias_noise,
    motion_noise,
    slide_noise,
    transition,
)
from twinscrew.runtime.tracking.radius import RadiusSettings, smoothed_radius
from twinscrew.runtime.tracking.standing import Standing, StandingSettings
from twinscrew.runtime.tracking.track import Track
from twinscrew.runtime.tracking.view import View


class TrackerSettings(Settings, frozen=True, kw_only=True):
    """How measurements become tracks."""

    measurement: MeasurementSettings = MeasurementSettings()
    """How the visible centroid relates to the centre."""
    displacement: DisplacementSettings = DisplacementSettings()
    """How velocities are measured from scan to scan."""
    standing: StandingSettings = StandingSettings()
    """When long objects are taken to stand."""
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
    """When a track is born and dropped."""
    max_gap_s: Annotated[float, Meta(gt=0.0)] = 5.0
    """[s] After a longer gap between scans everything is forgotten."""


class Tracker:
    """Follows every object around the vessel."""

    def __init__(self, settings: TrackerSettings | None = None, view: View | None = None) -> None:
        """Begin with nothing known; `view` is how the sensor looks at what is around."""
        self.settings = settings or TrackerSettings()
        self._displacement = Displacement(self.settings.displacement)
        self._bank = FilterBank()
        self._centroids = Centroids(self.settings.measurement, view or View())
        self._standing = Standing(self.settings.standing)
        variance = self.settings.standing.sigma_mps**2
        self._still = MeasuredVelocity(np.zeros(2), variance * np.eye(2))
        self._next_id = 0
        self.reset()

    def reset(self) -> None:
        """Forget everything but the identities already given: none is ever used twice."""
        self._tracks: list[Track] = []
        self._standing.reset()
        self._stamp_ns: int | None = None
        self._reported: Tracks | None = None
        self.note = ""
        """Why tracks were forgotten in the last step, in plain words; empty if they were not."""

    def step(self, objects: Objects, odometry: Odometry) -> Tracks:
        """Take in one scan.

        Parameters
        ----------
        objects
            What perception found.
        odometry
            The vessel's state at the scan's stamp.

        Returns
        -------
        Tracks
            Every confirmed track, oldest first. A scan with the stamp of the last one changes
            nothing; one before it, or long after it, starts afresh and says so in `note`.
        """
        dt = self._elapsed(objects.stamp_ns)
        if dt == 0.0 and self._reported is not None:
            return self._reported
        own = Stand.of(odometry)
        x, P = self._predicted(dt, own)
        whole, stands = self._joined(objects, self._standing.pieces(objects, own), x, own)
        self._update(x, P, self._centroids.measure(whole, own, stands), own)
        self._drop()
        self._reported = self._report(objects.stamp_ns)
        return self._reported

    def _elapsed(self, stamp_ns: int) -> float:
        """Give the time [s] since the last scan; forget everything if it jumped."""
        last = stamp_ns if self._stamp_ns is None else self._stamp_ns
        dt = (stamp_ns - last) / NANOSECONDS_PER_SECOND
        jumped = not 0.0 <= dt <= self.settings.max_gap_s
        if jumped:
            self.reset()
        self.note = f"time went on by {dt:.3f} s: tracks forgotten" if jumped else ""
        self._stamp_ns = stamp_ns
        return 0.0 if jumped else dt

    def _predicted(self, dt: float, own: Stand) -> tuple[Float64, Float64]:
        """Move every track on; give all states and covariances, (K, 6) and (K, 6, 6)."""
        x, P = _states(self._tracks)
        if not self._tracks:
            return x, P
        time_s = self.settings.measurement.bias_time_s
        radius = _floats([track.radius for track in self._tracks])
        Q = self._acceleration_psd(x)[:, None, None] * motion_noise(dt, 1.0)
        Q += bias_noise(dt, time_s, self._centroids.bias_variance(x, radius, own))
        slides = self.settings.standing.slide_mps * _floats([t.stands for t in self._tracks])
        Q += slide_noise(dt, slides)
        x, P = self._bank.predict(x, P, transition(dt, time_s), Q)
        for k, track in enumerate(self._tracks):
            track.moved_on(dt, x[k], P[k])
        return x, P

    def _acceleration_psd(self, x: Float64) -> Float64:
        """Give the density of each track's acceleration [m2/s3]: it rises with its speed."""
        settings = self.settings
        speed2 = x[:, 2] ** 2 + x[:, 3] ** 2
        share = speed2 / (speed2 + settings.under_way_mps**2)
        psd: Float64 = settings.rest_psd + share * (settings.acceleration_psd - settings.rest_psd)
        return psd

    def _joined(
        self, objects: Objects, stands: Sequence[bool | None], x: Float64, own: Stand
    ) -> tuple[Objects, Sequence[bool | None]]:
        """Put together what lies within the circle of one known track."""
        known = [k for k, t in enumerate(self._tracks) if t.confirmed and not t.stands]
        if not known or len(objects.p_L) < 2:
            return objects, stands
        p_L = own.in_L(x[known, :2])
        radius = _floats([self._tracks[k].radius for k in known])
        return join_fragments(objects, stands, p_L, self.settings.life.join_share * radius)

    def _update(self, x: Float64, P: Float64, measured: Measurements, own: Stand) -> None:
        found = associate(x, P, measured, self.settings.gate_sigma)
        if found.pairs:
            self._correct(x, P, measured, found)
        if found.new:
            z_N, radius = measured.z_N[found.new], measured.radius[found.new]
            for j, bias in zip(
                found.new, self._centroids.bias_variance(z_N, radius, own), strict=True
            ):
                self._tracks.append(self._born(measured, j, bias))

    def _correct(self, x: Float64, P: Float64, measured: Measurements, found: Association) -> None:
        """Let each track that was seen take in what was measured of it."""
        rows = [i for i, _, _ in found.pairs]
        seen = [j for _, j, _ in found.pairs]
        tracks = [self._tracks[i] for i in rows]
        sights = [measured.sights[j] for j in seen]
        limit2 = self.settings.measurement.jump_sigma**2
        x, P = corrected(
            self._bank,
            x[rows],
            self._reopened(P[rows], tracks, sights),
            (measured.z_N[seen], measured.H[seen], measured.R[seen]),
            _floats([distance2 for _, _, distance2 in found.pairs]) / limit2 - 1.0,
            [self._velocity(*pair) for pair in zip(tracks, sights, strict=True)],
            self.settings.displacement.limit_sigma,
        )
        radii = measured.radius[seen].tolist()
        for n, track in enumerate(tracks):
            radius = smoothed_radius(track.radius, radii[n], self.settings.radius)
            track.seen(x[n], P[n], radius, sights[n])
            self._confirm(track)

    def _reopened(self, P: Float64, tracks: list[Track], sights: list[Sight]) -> Float64:
        """Let tracks forget their velocities if they stand, or move, otherwise than it seemed."""
        pairs = enumerate(zip(tracks, sights, strict=True))
        turned = [n for n, (t, s) in pairs if s.stands is not None and s.stands != t.stands]
        P[turned, 2:4, 2:4] += self.settings.first_speed_mps**2 * np.eye(2)
        return P

    def _velocity(self, track: Track, sight: Sight) -> MeasuredVelocity | None:
        """Let a track's strips say how fast it went since it was last seen."""
        if sight.stands:
            return self._still
        north, east, v_north, v_east, along, across = track.x.tolist()
        if math.hypot(along, across) > self.settings.displacement.astray * track.radius:
            return None
        return self._displacement.measure(track.sight, sight, (v_north, v_east), (north, east))

    def _born(self, measured: Measurements, j: int, bias: Float64) -> Track:
        speed = self.settings.first_speed_mps**2
        prior = np.array([0.0, 0.0, speed, speed, *bias])
        z_N, H, R, sight = measured.z_N[j], measured.H[j], measured.R[j], measured.sights[j]
        track = Track(z_N, H, R, float(measured.radius[j]), prior, sight)
        self._confirm(track)
        return track

    def _confirm(self, track: Track) -> None:
        if is_born(track, self.settings.life):
            track.confirmed = True
            track.id = self._next_id
            self._next_id += 1

    def _drop(self) -> None:
        life = self.settings.life
        alive = [track for track in self._tracks if lives(track, life)]
        self._tracks = [track for track in alive if not is_absorbed(track, alive, life)]

    def _report(self, stamp_ns: int) -> Tracks:
        tracks = [track for track in self._tracks if track.confirmed]
        x, P = _states(tracks)
        return Tracks(
            stamp_ns=stamp_ns,
            id=np.array([track.id for track in tracks], dtype=np.int64),
            p_N=x[:, :2].copy(),
            v_N=x[:, 2:4].copy(),
            radius=_floats([track.radius for track in tracks]),
            covariance=P[:, :4, :4].copy(),
            age_s=_floats([track.age_s for track in tracks]),
        )


def _states(tracks: list[Track]) -> tuple[Float64, Float64]:
    """Give states and covariances, (K, 6) and (K, 6, 6)."""
    x = np.array([track.x for track in tracks]).reshape(-1, STATES)
    P = np.array([track.P for track in tracks]).reshape(-1, STATES, STATES)
    return x, P


def _floats(values: list[float]) -> Float64:
    return np.array(values, dtype=np.float64)
