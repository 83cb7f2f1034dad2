"""What the page is sent: a greeting in JSON, then binary frames; and what it may ask for.

A frame is the length of its head (uint32, little endian), the head in JSON, padding to a multiple
of four bytes, and the points of all vessels in the head's order: pairs of int16, centimetres north
and east of their vessel. The page's `model.js` reads it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from twinscrew.runtime.errors import NOT_THE_FORMAT

VERSION = 2
"""[-] Of what goes over the wire; a page of another version reloads itself."""
POINT_BYTES = 4
"""[B] Two int16."""
SERIES = ("time_s", "speed", "to_goal", "nearest", "cpa", "left", "right", "latency")
"""The columns of a vessel's time series: [s], [m/s], [m], [m], [m], [N], [N], [ms]."""


class TrackView(msgspec.Struct, frozen=True, array_like=True):
    """A track, in frame N."""

    id: int
    north: float
    east: float
    v_north: float
    v_east: float
    radius: float
    unseen_s: float
    """[s] Since the last scan in which it was seen."""
    situation: int
    """What COLREGs ask of the vessel (`policy.colregs.Situation`)."""
    gap: float
    """[m] Between the two surfaces now."""
    cpa: float
    """[m] Between the two surfaces when they are nearest on present courses; negative: contact."""
    tcpa: float
    """[s] When that is; 0: they draw apart already."""


class EventView(msgspec.Struct, frozen=True, array_like=True):
    """A health event."""

    time_s: float
    """[s] On the view's clock."""
    name: str
    severity: str
    detail: str


class OutcomeView(msgspec.Struct, frozen=True):
    """How a vessel's run has ended."""

    outcome: str
    """goal, collision or timeout."""
    travel_time_s: float | None = None
    closest_approach_m: float | None = None


class VesselView(msgspec.Struct, frozen=True, kw_only=True):
    """One vessel as the page draws it. Frame N; empty where nothing recent is known."""

    name: str
    pose: tuple[float, float, float] | None = None
    """[m, m, rad] North, east, heading."""
    velocity: tuple[float, float] | None = None
    """[m/s] North, east."""
    silent_s: float | None = None
    """[s] Since the last odometry; None if none ever came."""
    thrust: tuple[float, float] | None = None
    """[N] Left, right."""
    goal: tuple[float, float] | None = None
    """[m] North, east."""
    route: tuple[tuple[float, float], ...] = ()
    """[m] North, east of the places on its way to the goal, around what is fixed."""
    arrived: bool = False
    ended: OutcomeView | None = None
    """Its run is over: its sensors are switched off, and that is no alarm."""
    state: str = "unknown"
    autopilot: str = ""
    """Mode, arming, battery, as far as the boat said."""
    envelope: str = ""
    """Its fallback response, and the quantities of its operational envelope, as far as it said."""
    engaged: bool | None = None
    """Whether the thrust acts; None if the boat has not said."""
    why: str = ""
    """What it is doing and why, in one sentence."""
    about: int = -1
    """[-] The track that the sentence is about; -1: none."""
    rule: int = 0
    """The COLREGs rule that the sentence names."""
    latency_ms: float | None = None
    """[ms] From the last scan's sending to its decision's."""
    decisions: int = 0
    """[-] Decisions so far."""
    tracks: tuple[TrackView, ...] = ()
    objects: tuple[tuple[float, float, float], ...] = ()
    """[m] North, east, radius."""
    events: tuple[EventView, ...] = ()
    """The last few, newest last."""
    event_count: int = 0
    """[-] How many there have been, so that a page knows which of the last few are new."""
    points: int = 0
    """[-] How many points of this vessel follow the head."""


@dataclass(frozen=True, slots=True)
class Part:
    """One vessel's share of a frame, encoded."""

    head: bytes
    points: bytes


class Order(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What an operator wants a vessel to do: go to a place, or without a place, stop."""

    vessel: str
    goal: tuple[float, float] | None = None
    """[m] North, east."""


class Request(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the page may ask for; fields that are left out stay as they are."""

    playing: bool | None = None
    seek_s: float | None = None
    """[s] Where to go on in a recording."""
    speed: float | None = None
    """[-] How fast to play a recording."""
    order: Order | None = None
    """Obeyed only if the view was started with orders switched on."""


def encode_part(view: VesselView, points: bytes) -> Part:
    """Encode one vessel's share of a frame."""
    return Part(msgspec.json.encode(view), points)


def encode_frame(time_s: float, parts: Sequence[Part], *, playing: bool) -> bytes:
    """Put a frame together.

    Parameters
    ----------
    time_s
        [s] On the view's clock: since the recording's beginning, or since the view's.
    parts
        The vessels that have anything to show.
    playing
        Whether time goes on after this frame.
    """
    head = msgspec.json.encode(
        {
            "time_s": round(time_s, 3),
            "playing": playing,
            "vessels": [msgspec.Raw(part.head) for part in parts],
        }
    )
    head += b" " * (-len(head) % POINT_BYTES)
    return b"".join((struct.pack("<I", len(head)), head, *(part.points for part in parts)))


def decode_request(text: str) -> Request | None:
    """Read what the page asks for; None if it is not a request."""
    try:
        return msgspec.json.decode(text, type=Request)
    except NOT_THE_FORMAT:
        return None


def encode_words(what: dict[str, Any]) -> str:
    """Encode what is not a frame: the greeting, and answers to orders."""
    return msgspec.json.encode(what).decode()
