"""The messages: frozen, slotted, SI units, NED and FRD.

Under each field stands ``[unit] [frame] [shape] meaning``. Arrays are never written to after a
message has been made.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.geometry import euler_from_quaternion

Float32: TypeAlias = NDArray[np.float32]
Float64: TypeAlias = NDArray[np.float64]

NANOSECONDS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class PointCloud:
    """One LiDAR scan, as the sensor gave it but with axes turned to forward-starboard-down."""

    stamp_ns: int
    """[ns] When the scan was taken (the message's stamp)."""
    frame_id: str
    """The sensor's frame, as the message names it."""
    points_S: Float32
    """[m] [S, FRD] (N, 3), C-contiguous. May hold NaN and infinities: rays without an echo."""
    intensity: Float32 | None = None
    """[sensor's own] (N,) Strength of the echo; None if the sensor does not tell."""
    ring: NDArray[np.uint16] | None = None
    """[-] (N,) Beam number, lowest elevation first; None if the sensor does not tell."""
    time_offset_s: Float32 | None = None
    """[s] (N,) Time of each echo after `stamp_ns`; None if the sensor does not tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Odometry:
    """Where the vessel is and how it moves."""

    stamp_ns: int
    """[ns] When it was measured."""
    position_N: Float64
    """[m] [N] (3,) Position of the vessel's origin: north, east, down."""
    q_NB: Float64
    """[-] (4,) Attitude of B in N as a unit quaternion, w first."""
    velocity_B: Float64
    """[m/s] [B] (3,) Velocity over ground: surge, sway, heave."""
    rates_B: Float64
    """[rad/s] [B] (3,) Roll, pitch and yaw rate."""
    frame_id: str = ""
    """What the message calls N (as ENU); empty if it does not tell."""
    child_frame_id: str = ""
    """What the message calls B (as FLU); empty if it does not tell."""

    @property
    def heading(self) -> float:
        """[rad] [N] Heading, clockwise from north, in [-pi, pi]."""
        return euler_from_quaternion(self.q_NB)[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """Where a satellite receiver's antenna is on the earth."""

    stamp_ns: int
    """[ns] When it was measured."""
    valid: bool
    """False if the receiver says that it has no fix; the numbers mean nothing then."""
    latitude_deg: float
    """[deg] [WGS 84] North of the equator."""
    longitude_deg: float
    """[deg] [WGS 84] East of Greenwich."""
    altitude_m: float
    """[m] [WGS 84] Above the ellipsoid; NaN if the receiver does not tell."""
    covariance_N: Float64 | None = None
    """[m2] [N] (3, 3) Of the position; None if the receiver does not tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imu:
    """What an inertial measurement unit feels, in its own axes I: forward, starboard, down."""

    stamp_ns: int
    """[ns] When it was measured."""
    rates_I: Float64
    """[rad/s] [I] (3,) Roll, pitch and yaw rate."""
    force_I: Float64
    """[m/s2] [I] (3,) Specific force: acceleration less gravity, (0, 0, -g) at rest."""
    q_NI: Float64 | None = None
    """[-] (4,) Attitude of I in N as a unit quaternion, w first; None if it has none."""
    attitude_variance: Float64 | None = None
    """[rad2] (3,) Of roll, pitch, yaw; None if it does not tell."""
    rates_variance: Float64 | None = None
    """[rad2/s2] [I] (3,) Of the white noise of one sample; None if it does not tell."""
    force_variance: Float64 | None = None
    """[m2/s4] [I] (3,) Of the white noise of one sample; None if it does not tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """Where the vessel has to go."""

    stamp_ns: int
    """[ns] When it was set."""
    position_N: Float64
    """[m] [N] (2,) North, east; of an order that names another frame, that frame's y and x."""
    frame_id: str = ""
    """The frame that the order names; empty: that of the odometry."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Station:
    """A place at which the vessel has to stay."""

    stamp_ns: int
    """[ns] When it was set."""
    position_N: Float64
    """[m] [N] (2,) North, east; of an order that names another frame, that frame's y and x."""
    heading: float | None = None
    """[rad] [N] Where the bow is to point, clockwise from north (from y in another frame); None:
    into wind and current."""
    frame_id: str = ""
    """The frame that the order names; empty: that of the odometry."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Berth:
    """A face of a quay or a pontoon at which the vessel has to lie alongside."""

    stamp_ns: int
    """[ns] When it was set."""
    face_N: Float64
    """[m] [N] (2, 2) The face's ends, on the water's edge; the bow is to point to the second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Engagement:
    """Whether thrust commands may act: armed, in the right mode, nothing stale."""

    stamp_ns: int
    """[ns] When it changed."""
    engaged: bool
    """True while the autopilot lets the runtime drive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fallback:
    """What the boat does because it is outside its operational envelope, or that it is inside."""

    stamp_ns: int
    """[ns] When it changed."""
    response: str
    """"none", "slow", "hold", "stop" or "hand_over"."""
    reason: str = ""
    """Plain words: which quantities, which limits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChartFeature:
    """Something fixed: an area, or a circle."""

    kind: str
    """"land", "keep_out", "depth", "hazard" or "fence"."""
    keep_in: bool
    """True for an inclusion fence: it is forbidden outside."""
    depth_m: float
    """[m] The least depth of water, for "depth"; negative where it dries, -inf: not known."""
    radius_m: float
    """[m] Of a circle; 0 for an area."""
    name: str
    """What people call it."""
    outline_N: Float64
    """[m] [N] (M, 2) Vertices, or the circle's centre alone."""
    holes_N: tuple[Float64, ...] = ()
    """[m] [N] each (M, 2)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """What is fixed around the boat, all of it."""

    stamp_ns: int
    """[ns] When it changed."""
    safety_depth_m: float
    """[m] Water of less depth is forbidden."""
    features: tuple[ChartFeature, ...]
    """In the order in which they came."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Strips:
    """What single rows of beams see of the objects without a break, from end to end.

    An object's centroid jumps when a part of it comes into sight; a strip that is seen again has
    moved as the object has.
    """

    begin: NDArray[np.int64]
    """[-] (K + 1,) Object k has the rows from begin[k] up to begin[k + 1]."""
    rows_L: Float64
    """[m, -] [L] (S, 4) Mean of the echoes, forward and starboard of the vessel's origin;
    length from the first to the last; number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """Where the nearest echoes are, all around: up to there the water is free.

    Objects too long for a circle are cut into pieces. Where the pieces are tells nothing of how the
    object moves; where the outline goes into what was free does. What is low may lie under all
    beams, so that the beams belong to it.
    """

    boundary_L: Float64
    """[m] [L] (A, 2) A point for each sector, clockwise: its nearest echo, or a point at
    the greatest range."""
    height_m: Float64
    """[m] (A,) Height of those echoes over the vessel's origin, up; NaN where there is none."""
    seen: NDArray[np.int64]
    """[-] (A,) The number of the long object that it ends at; -1 for all else."""
    cut_from: NDArray[np.int64]
    """[-] (K,) Of each of the scan's objects, the number of the long one that it is a piece of; -1
    if it is all of itself."""
    sector_rad: float
    """[rad] Width of a sector."""
    is_closed: bool
    """True if the sectors are a full turn."""
    sensor_L: Float64
    """[m] [L] (3,) The sensor."""
    down_L: Float64
    """[-] [L] (3,) The sensor's z axis."""
    elevation_rad: Float64
    """[rad] (M,) Of the beams from the sensor's own level, rising, upwards."""
    least_m: float
    """[m] Echoes lower than this over the vessel's origin are left out: the water's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Objects:
    """What perception found in one scan."""

    stamp_ns: int
    """[ns] The scan's stamp."""
    p_L: Float64
    """[m] [L] (K, 2) Centres: forward, starboard of the vessel's origin."""
    radius: Float64
    """[m] (K,) Largest horizontal distance of the object's points from its centre."""
    points: NDArray[np.int64]
    """[-] (K,) Number of points of each object."""
    strips: Strips | None = None
    """What is followed from scan to scan to measure velocities; None if not told. Not on the bus:
    those who listen have the tracks."""
    outline: Outline | None = None
    """What tells whether long objects move; None if not told. Not on the bus."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """What the tracker believes is around the vessel."""

    stamp_ns: int
    """[ns] The scan's stamp."""
    id: NDArray[np.int64]
    """[-] (K,) Never used twice in a run."""
    p_N: Float64
    """[m] [N] (K, 2) Centres: north, east."""
    v_N: Float64
    """[m/s] [N] (K, 2) Velocity over ground: north, east."""
    radius: Float64
    """[m] (K,)"""
    covariance: Float64
    """[m, m/s] [N] (K, 4, 4) Covariance of (north, east, v_north, v_east)."""
    age_s: Float64
    """[s] (K,) Time since the last scan in which it was seen; 0 if seen in this one."""
    half_length: Float64 | None = None
    """[m] (K,) Half the length of a track's outline, a rectangle about its centre; NaN where only
    the radius is known. None: no track has an outline. Outline and name are not in a decision's
    message: other topics carry them."""
    half_beam: Float64 | None = None
    """[m] (K,) Half its beam; NaN and None likewise."""
    heading: Float64 | None = None
    """[rad] [N] (K,) Where its bow points, maybe not where it goes; NaN and None likewise."""
    name: tuple[str, ...] | None = None
    """(K,) What the vessel calls itself, as "257123450 NORDLYS"; "" where it has not said so. None:
    no track has a name."""

    def only(self, rows: NDArray[np.bool_]) -> Tracks:
        """Give those of the tracks of which a row (K,) is true."""
        optional = {
            key: None if values is None else values[rows]
            for key, values in (
                ("half_length", self.half_length),
                ("half_beam", self.half_beam),
                ("heading", self.heading),
            )
        }
        names = None
        if self.name is not None:
            names = tuple(name for name, kept in zip(self.name, rows, strict=True) if kept)
        return Tracks(
            stamp_ns=self.stamp_ns,
            id=self.id[rows],
            p_N=self.p_N[rows],
            v_N=self.v_N[rows],
            radius=self.radius[rows],
            covariance=self.covariance[rows],
            age_s=self.age_s[rows],
            name=names,
            **optional,
        )


OBSERVED_OBJECTS = 5
"""How many objects a policy sees (paper, sec. IV; parameters.md: at most 5, nearest first)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """What a policy sees: raw SI units, frame B; K objects at most, 5 in the paper."""

    ego: Float32
    """(7,) Goal x, y [m]; surge, sway [m/s]; yaw rate [rad/s]; left, right thrust [N]; eq. (2)."""
    objects: Float32
    """(K, 5) x, y [m]; vx, vy over ground in B's axes [m/s]; radius [m]; nearest first. Eq. (3)."""
    mask: Float32
    """(K,) 1 where `objects` holds an object, 0 where it is padding (all zeros)."""
    outlines: Float32 | None = None
    """(K, 3) Half length, half beam [m], heading [rad] of the rectangle that an object is; zeros
    where it is a circle. None: the policy takes none."""
    hull: Float32 | None = None
    """(10,) The own hull, as `policy.hull_units.HULL_COLUMNS` says. None: the policy is told
    nothing of it, or it is not known here."""
    contour: Float32 | None = None
    """(32,) [m] How far off the nearest edge of what is fixed is in each sector, clockwise from
    straight ahead (`charts.contour`). None: the policy takes none."""


class Severity(Enum):
    """How bad a health event is."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthEvent:
    """Something an operator should know, by a name that scripts can rely on."""

    stamp_ns: int
    """[ns] When."""
    name: str
    """A name of `twinscrew.runtime.safety.events`, as "lidar_stale"."""
    severity: Severity
    detail: str = ""
    """Plain words: which value, which limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What the core decided on one scan, with everything it saw."""

    stamp_ns: int
    """[ns] The scan's stamp."""
    sequence: int
    """[-] Counts the decisions of a run from 0."""
    acted: bool
    """True if the policy was asked (once a decision period); False if the thrust was held."""
    thrust_rate: Float64
    """[N/s] (2,) Left, right: what the policy asked for last."""
    thrust: Float64
    """[N] (2,) Left, right: the command from now on, within the vessel's limits."""
    observation: Observation | None
    """What the policy saw; None if it was not asked."""
    objects: Objects
    tracks: Tracks
    events: tuple[HealthEvent, ...] = field(default=())
    arrived: bool = False
    """True once the (last) goal is reached."""

    @property
    def observed(self) -> bool:
        """Whether `observation` holds something."""
        return self.observation is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """What the vessel is doing and why: made with each decision, and recorded beside it."""

    stamp_ns: int
    """[ns] The decision's stamp."""
    sequence: int
    """[-] The decision's number."""
    sentence: str
    """For people."""
    track: int = -1
    """[-] The track that it is about; -1 if none."""
    rule: int = 0
    """[-] The COLREGs rule that applies to the two: 14, 15, 17 (stand on); 0 if none."""
    cpa_m: float = math.nan
    """[m] Least distance to that track's surface on present courses; NaN if there is none."""
    tcpa_s: float = math.nan
    """[s] When that is; NaN if there is none."""
