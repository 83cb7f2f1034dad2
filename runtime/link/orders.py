"""What a ground station may order, and from whom orders are taken."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from twinscrew.runtime.settings import Count, Positive, Settings

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


@dataclass(frozen=True, slots=True)
class Waypoint:
    """One place of a mission."""

    seq: int
    north_m: float
    east_m: float


@dataclass(frozen=True, slots=True)
class Sail:
    """Sail these, one after another."""

    station: int
    way: tuple[Waypoint, ...]


@dataclass(frozen=True, slots=True)
class Halt:
    """Sail the mission no further; a goal from elsewhere is not meant."""

    station: int


Order: TypeAlias = GoTo | Sail | Halt
