"""The kinds of faults: what each is done to, and what can be said about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from msgspec import Meta

from twinscrew.runtime.settings import Count, Fraction, NonNegative, Positive, Settings

SENSORS: Final = ("points", "odometry", "gps", "imu", "sensors")
TOPICS: Final = (*SENSORS, "nmea", "radar", "goal", "enable")
"""`sensors` is all of them: a clock that they share, or a cable."""
MAVLINK: Final = ("to_autopilot", "from_autopilot", "mavlink")
"""Directions of the line to the autopilot; `mavlink` is both."""
Id = Annotated[int, Meta(ge=1, le=255)]


class Nothing(Settings, frozen=True):
    """A fault that needs no more words."""


class Some(Settings, frozen=True):
    """A fault that may spare some messages."""

    share: Fraction = 1.0
    """[-] Of the messages, drawn by lot, to which it happens."""


class Delay(Settings, frozen=True):
    """Messages come late, in order."""

    delay_s: Positive = 1.0
    """[s] By how much."""


class Duplicate(Settings, frozen=True):
    """Messages come more than once."""

    copies: Count = 1
    """[-] How often more."""


class Corrupt(Some, frozen=True):
    """Messages are damaged."""

    bits: Annotated[int, Meta(ge=0)] = 0
    """[-] That are turned, anywhere."""
    keep: Fraction = 1.0
    """[-] Of the bytes, from the beginning; the rest is cut off."""


class Freeze(Settings, frozen=True):
    """The last message is repeated in the place of every new one."""

    stamps: Literal["still", "moving"] = "still"
    """Whether the repeated message bears its old stamp, or the new one's."""


class Noise(Settings, frozen=True):
    """Measurements are worse."""

    sigma_m: NonNegative = 0.0
    """[m] Added to every echo's distance, or to the position."""
    phantoms: Annotated[int, Meta(ge=0)] = 0
    """[-] Echoes of nothing within 30 m, a scan (spray, rain)."""
    visibility_m: NonNegative = 0.0
    """[m] How far beams come on the average before a drop ends them (fog); 0: for ever."""
    ghosts: Annotated[int, Meta(ge=0)] = 0
    """[-] Vessels that are not there, and go round the boat."""
    heave_m: NonNegative = 0.0
    """[m] Amplitude of a swell that odometry tells of, on top of the sea's."""
    roll_deg: NonNegative = 0.0
    """[deg] Amplitude of a roll that it tells of."""


class ClockJump(Settings, frozen=True):
    """The stamps' clock is set wrong."""

    jump_s: float
    """[s] By how much; negative is back."""
    every: Count = 1
    """[-] Every so-manieth message of a line bears the wrong time; 1: all."""


class WrongIds(Settings, frozen=True):
    """MAVLink frames bear another sender."""

    system_id: Id | None = None
    """[-] In place of the real one; none leaves it."""
    component_id: Id | None = None
    """[-] In place of the real one; none leaves it."""


class Cut(Settings, frozen=True):
    """The connection between sensors and runtime breaks, and cannot be made anew."""

    silently: bool = False
    """As if a cable was pulled: nothing arrives, and nobody is told. Else it is closed."""


class FalseAis(Settings, frozen=True):
    """A station says on AIS what is not so."""

    does: Literal["jump", "spoof", "duplicate", "own", "flood", "garbage"]
    """A ship is elsewhere now and then; has a speed no ship has; is in two places; is the own
    vessel; is one of hundreds; is no sentence at all."""


class Hog(Settings, frozen=True):
    """Others want the processor."""

    processes: Count = 4
    """[-] How many, each always busy."""


class Frozen(Settings, frozen=True):
    """Programs that look on are stopped, as by Ctrl-Z, and read no more."""

    processes: Count = 4
    """[-] How many, each with a connection of its own over the network."""


class Pilot(Settings, frozen=True):
    """A pilot does something by radio or ground station."""

    does: Literal["hold", "manual", "arm", "disarm"]
    """Which."""


class Parameter(Settings, frozen=True):
    """A parameter of the autopilot is set to a wrong value, and put back in the end."""

    name: str
    value: float


class Push(Settings, frozen=True):
    """Wind or current presses on the vessel, beyond the sea's own."""

    north_n: float = 0.0
    """[N] To the north."""
    east_n: float = 0.0
    """[N] To the east."""


class Streams(Settings, frozen=True):
    """Somebody asks the autopilot for all of its streams at one rate (REQUEST_DATA_STREAM)."""

    rate_hz: Positive = 1.0
    """[Hz] ArduRover's default."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a kind of fault may be done to, and with which parameters."""

    targets: tuple[str, ...]
    parameters: type[Settings]


KINDS: Final[Mapping[str, Kind]] = {
    "drop": Kind((*TOPICS, *MAVLINK), Some),
    "delay": Kind((*TOPICS, *MAVLINK), Delay),
    "duplicate": Kind((*TOPICS, *MAVLINK), Duplicate),
    "reorder": Kind((*TOPICS, *MAVLINK), Some),
    "corrupt": Kind((*TOPICS, *MAVLINK), Corrupt),
    "freeze": Kind(SENSORS, Freeze),
    "noise": Kind(("points", "odometry"), Noise),
    "clock_jump": Kind(SENSORS, ClockJump),
    "ais": Kind(("nmea",), FalseAis),
    "wrong_ids": Kind(MAVLINK, WrongIds),
    "kill": Kind(("runtime", "autopilot"), Nothing),
    "hang": Kind(("runtime", "autopilot"), Nothing),
    "cut": Kind(("zenoh",), Cut),
    "cpu_hog": Kind(("machine",), Hog),
    "frozen_subscriber": Kind(("zenoh",), Frozen),
    "pilot": Kind(("autopilot",), Pilot),
    "parameter": Kind(("autopilot",), Parameter),
    "streams": Kind(("autopilot",), Streams),
    "goal": Kind(("runtime",), Nothing),
    "push": Kind(("vessel",), Push),
    "silence": Kind(("station",), Nothing),
    "disable": Kind(("enable",), Nothing),
}
"""Every kind. `kill` and `hang` end with a restart; `goal` is an operator who sends it again,
`disable` one who takes the enable back; `silence` is a ground station that is heard no more."""

AT_ONCE: Final = ("pilot", "streams", "goal", "disable")
"""Kinds that happen and are over."""
