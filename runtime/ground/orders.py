"""What ground stations order, with places given as they send them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Literal, NamedTuple, TypeAlias

import numpy as np
from msgspec import Meta
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.datum import Datum, from_datum_N
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Count, Positive, Settings

# -- Where a ground station wants the boat to go: its frames, in the frame N of the goals.
#
# MAV_FRAME_LOCAL_NED is N itself, the frame of odometry and of goals on the bus. Places on the
# earth need a datum, which says where N's origin lies. Heights mean nothing to a boat.


ON_EARTH = frozenset(
    {
        mavlink.MAV_FRAME_GLOBAL,
        mavlink.MAV_FRAME_GLOBAL_INT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
"""Frames of latitude and longitude; they differ in what a height is counted from."""
LOCAL = int(mavlink.MAV_FRAME_LOCAL_NED)
DEGREES_PER_UNIT = 1e-7
"""[deg] Of the integers that carry latitude and longitude."""
METRES_PER_UNIT = 1e-4
"""[m] Of the integers that carry local positions (MISSION_ITEM_INT, COMMAND_INT)."""


class Fault(NamedTuple):
    """Why a place cannot be a goal: what a mission's station is answered, and plain words."""

    result: int
    """MAV_MISSION_RESULT."""
    words: str


BAD_FRAME = Fault(mavlink.MAV_MISSION_UNSUPPORTED_FRAME, "its frame is not one that a boat can use")
NO_DATUM = Fault(
    mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
    "latitude and longitude need autopilot.datum in the boat's configuration",
)
NOT_SAILED = Fault(
    mavlink.MAV_MISSION_UNSUPPORTED,
    "only MAV_CMD_NAV_WAYPOINT and MAV_CMD_NAV_LOITER_UNLIM can be sailed",
)
NO_WAITING = Fault(
    mavlink.MAV_MISSION_INVALID_PARAM1,
    "a boat does not wait at a waypoint (param 1): MAV_CMD_NAV_LOITER_UNLIM holds a place",
)
BAD_X = Fault(mavlink.MAV_MISSION_INVALID_PARAM5_X, "its latitude or north is not a place")
BAD_Y = Fault(mavlink.MAV_MISSION_INVALID_PARAM6_Y, "its longitude or east is not a place")
TOO_FAR = Fault(mavlink.MAV_MISSION_INVALID_PARAM5_X, "it is farther away than goals may be")


@dataclass(slots=True)
class GoalFrames:
    """What turns a station's places into goals."""

    datum: Datum | None
    reach_m: float
    """[m] No goal may be farther from the origin of N."""
    chart: StaticMap = field(default_factory=StaticMap.empty)
    """What is fixed around the boat: no goal may be where it forbids to be."""

    def place(self, frame: int, x: float, y: float) -> Float64 | Fault:
        """Give north and east, (2,) [m] [N], of a goal; as `position`, and nothing forbids it."""
        position = self.position(frame, x, y)
        if isinstance(position, Fault):
            return position
        why = self.chart.why(position)
        return Fault(mavlink.MAV_MISSION_DENIED, f"it is {why}") if why else position

    def position(self, frame: int, x: float, y: float) -> Float64 | Fault:
        """Give north and east, (2,) [m] [N].

        Parameters
        ----------
        frame
            MAV_FRAME.
        x, y
            [deg] Latitude and longitude, or [m] north and east, as the frame has them.
        """
        if frame == LOCAL:
            return self._within(np.array([x, y]))
        if frame not in ON_EARTH:
            return BAD_FRAME
        if self.datum is None:
            return NO_DATUM
        if not abs(x) <= 90.0:
            return BAD_X
        if not abs(y) <= 180.0:
            return BAD_Y
        return self._within(from_datum_N(self.datum, x, y)[:2])

    def place_of_integers(self, frame: int, x: int, y: int) -> Float64 | Fault:
        """Give north and east of a goal that came in integers."""
        unit = METRES_PER_UNIT if frame == LOCAL else DEGREES_PER_UNIT
        return self.place(frame, x * unit, y * unit)

    def position_of_integers(self, frame: int, x: int, y: int) -> Float64 | Fault:
        """Give north and east of any place that came in integers."""
        unit = METRES_PER_UNIT if frame == LOCAL else DEGREES_PER_UNIT
        return self.position(frame, x * unit, y * unit)

    def _within(self, p_N: Float64) -> Float64 | Fault:
        north, east = p_N.tolist()
        if not math.isfinite(north):
            return BAD_X
        if not math.isfinite(east):
            return BAD_Y
        return p_N if math.hypot(north, east) <= self.reach_m else TOO_FAR


# -- What a ground station may order, and from whom orders are taken.

StationId = Annotated[int, Meta(ge=1, le=255)]


class OrderSettings(Settings, frozen=True):
    """Whose orders count, and which."""

    permitted: tuple[StationId, ...] = (255,)
    """[-] System ids whose goals and missions are taken; ground stations are 255 unless set
    otherwise. Empty: nobody's."""
    start: Literal["upload", "command"] = "upload"
    """When a mission is sailed: as soon as it is there, or when MAV_CMD_MISSION_START comes."""
    home: Literal["auto", "none", "first"] = "auto"
    """Whether item 0 is home, not to be sailed to: if it is in an absolute frame and all others
    count heights from home (auto), never, always."""
    most_items: Count = 250
    """[-] A longer mission is refused."""
    reach_m: Positive = 5000.0
    """[m] A goal farther from the origin of the local frame is refused: within 5 km the flat earth
    is right to a centimetre, and 0, 0 in latitude and longitude is a mistake."""


class Relative(Enum):
    """What a place is counted from."""

    ORIGIN = "origin"
    """North and east of the origin of N."""
    VESSEL = "vessel"
    """North and east of the vessel."""
    BOW = "bow"
    """Ahead and to starboard of the vessel."""


@dataclass(frozen=True, slots=True)
class GoTo:
    """Go to one place."""

    station: int
    x_m: float
    y_m: float
    relative: Relative = Relative.ORIGIN
    holds: bool = False
    """Whether the vessel is to stay there."""
    heading: float | None = None
    """[rad] [N] Where its bow is to point while it stays; None: into wind and current."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """One place of a mission."""

    seq: int
    north_m: float
    east_m: float
    holds: bool = False
    """Whether the vessel is to stay there; what comes after it is not sailed."""
    heading: float | None = None
    """[rad] [N] Where its bow is to point while it stays; None: into wind and current."""


@dataclass(frozen=True, slots=True)
class FollowRoute:
    """Sail these, one after another."""

    station: int
    way: tuple[Waypoint, ...]


@dataclass(frozen=True, slots=True)
class Pause:
    """Sail the mission no further; a goal from elsewhere is not meant."""

    station: int


Order: TypeAlias = GoTo | FollowRoute | Pause
