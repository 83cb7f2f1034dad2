"""Tells ground stations what the boat sees and does, at a rate they can use."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import EARTH_RADIUS_M, Datum, to_degrees
from twinscrew.runtime.ground.orders import OrderSettings
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Decision, Float64, HealthEvent, Severity, Tracks
from twinscrew.runtime.safety.events import AUTOPILOT_SAYS, KINDS, STATE, STATE_NOW
from twinscrew.runtime.settings import NonNegative, Positive, Settings

FORGOTTEN_S = 0.5
"""[s] A decision older than this is not told: ArduPilot forgets obstacles as soon."""


class GroundSettings(Settings, frozen=True):
    """What is told to ground stations, through the autopilot, and what they may order."""

    orders: OrderSettings = OrderSettings()
    texts: bool = True
    """Whether health events are told in plain words (STATUSTEXT)."""
    obstacles_hz: NonNegative = 0.0
    """[Hz] OBSTACLE_DISTANCE, every object of the newest scan; 0: none. ArduPilot forgets after
    half a second: 5 is enough."""
    obstacle_range_m: Positive = 100.0
    """[m] Farther away nothing is told, nor farther than perception looks."""
    vessels_hz: NonNegative = 0.0
    """[Hz] AIS_VESSEL, each vessel that is tracked; 0: none. Needs autopilot.datum; 1 is enough."""
    vessel_speed_mps: Positive = 0.5
    """[m/s] Slower objects are not told as vessels (paper, sec. IV: slower is not a vehicle)."""
    latency_hz: NonNegative = 0.0
    """[Hz] NAMED_VALUE_FLOAT "latency_ms": from a scan's arrival to its command; 0: none."""


class GroundReport:
    """Knows when to tell what."""

    def __init__(
        self,
        settings: GroundSettings | None = None,
        datum: Datum | None = None,
        system_id: int = 1,
        *,
        sees_m: float = math.inf,
    ) -> None:
        """Prepare.

        Parameters
        ----------
        datum, system_id
            Where vessels lie on the earth, and whose they are told as.
        sees_m
            [m] How far perception looks: nobody may be told that it is free beyond.
        """
        self._settings = settings or GroundSettings()
        self._range_m = min(self._settings.obstacle_range_m, sees_m)
        self._datum = datum
        self._system_id = system_id
        self._announcements = Announcements()
        self._obstacles_s = self._latency_s = self._vessels_s = -math.inf
        self._decision: Decision | None = None
        self._decided_s = -math.inf
        self._latency_ms: float | None = None

    def decided(self, decision: Decision, latency_ms: float, now_s: float) -> None:
        """Take a decision, and how long it took."""
        self._decision, self._decided_s, self._latency_ms = decision, now_s, latency_ms

    def happened(self, events: Iterable[HealthEvent], now_s: float) -> None:
        """Take health events, to be told in plain words."""
        if self._settings.texts:
            self._announcements.happened(events, now_s)

    def complain(self, words: Iterable[str]) -> None:
        """Tell whoever gave an order that it was refused, and why."""
        for text in words:
            self._announcements.say(text, Severity.WARNING)

    def texts(self) -> list[tuple[str, Severity]]:
        """Give what is to be said now."""
        return self._announcements.take()

    def due(self, now_s: float) -> list[Message]:
        """Give the messages to send now; none once the decisions have stopped."""
        decision, settings = self._decision, self._settings
        if decision is None or now_s - self._decided_s > FORGOTTEN_S:
            return []
        messages = []
        if _is_due(self._obstacles_s, settings.obstacles_hz, now_s):
            self._obstacles_s = now_s
            objects, range_m = decision.objects, self._range_m
            distances = sector_distances_cm(objects.p_L, objects.radius, range_m)
            messages.append(obstacle_distance(distances, range_m, now_s))
        if self._datum is not None and _is_due(self._vessels_s, settings.vessels_hz, now_s):
            self._vessels_s = now_s
            tracks, least = decision.tracks, settings.vessel_speed_mps
            messages += ais_vessels(tracks, self._datum, self._system_id, least)
        if self._latency_ms is not None and _is_due(self._latency_s, settings.latency_hz, now_s):
            self._latency_s = now_s
            messages.append(named_value("latency_ms", self._latency_ms, now_s))
        return messages


def _is_due(last_s: float, rate_hz: float, now_s: float) -> bool:
    return rate_hz > 0.0 and now_s - last_s >= 1.0 / rate_hz - 1e-6


# -- Health events as a ground station shows them: plain words, not too many of them.

AGAIN_S = 10.0
"""[s] The same event is said once in this time, unless it says something else."""
AT_ONCE = 8
"""[-] Texts that may wait; more at a time nobody reads, and a slow radio would fill up."""
SILENT = frozenset(kind.name for kind in (AUTOPILOT_SAYS, STATE, STATE_NOW))
"""Events that stations know already: the autopilot's own words, and what follows from others."""


class Announcements:
    """Chooses what is said, and when."""

    def __init__(self) -> None:
        self._waiting: list[tuple[str, Severity]] = []
        self._said_s: dict[tuple[str, str], float] = {}

    def happened(self, events: Iterable[HealthEvent], now_s: float) -> None:
        """Take events as they happen."""
        for event in events:
            told = (event.name, words_of(event))
            silent = event.name in SILENT
            if silent or now_s - self._said_s.get(told, -math.inf) < AGAIN_S:
                continue
            self._said_s = {key: at for key, at in self._said_s.items() if now_s - at < AGAIN_S}
            self._said_s[told] = now_s
            self.say(told[1], event.severity)

    def say(self, text: str, severity: Severity) -> None:
        """Say something else."""
        if len(self._waiting) < AT_ONCE:
            self._waiting.append((text, severity))

    def take(self) -> list[tuple[str, Severity]]:
        """Give what is to be said now: one text a call."""
        now, self._waiting = self._waiting[:1], self._waiting[1:]
        return now


def words_of(event: HealthEvent) -> str:
    """Give an event in plain words: what it means, and what there is to say about it."""
    meaning = KINDS[event.name].meaning if event.name in KINDS else event.name
    return f"{meaning} ({event.detail})" if event.detail else meaning


# -- What a ground station is shown beside the boat: obstacles around it, and how quick we are.
#
# OBSTACLE_DISTANCE is seen by Mission Planner and QGroundControl, and by ArduPilot's own avoidance;
# NAMED_VALUE_FLOAT by every station that draws values.


SECTORS = 72
"""[-] What the message holds: a whole turn in sectors of 5 degrees, the first one ahead."""
SECTOR_RAD = 2.0 * math.pi / SECTORS
GREATEST_M = 655.0
"""[m] What 16 bits of centimetres can say."""
_NAME_LENGTH = 10


def sector_distances_cm(p_L: Float64, radius: Float64, range_m: float) -> NDArray[np.uint16]:
    """Give the distance to the nearest surface in each sector.

    Parameters
    ----------
    p_L : (K, 2) float64
        Circles' centres [m]: forward, starboard.
    radius : (K,) float64
        Their radii [m].
    range_m
        [m] How far we see.

    Returns
    -------
    distances : (72,) uint16
        [cm] Clockwise from ahead; at least 1 (0 is ignored by ArduPilot), and `range_m` + 1 cm
        where nothing is.
    """
    free_cm = round(100.0 * min(range_m, GREATEST_M)) + 1
    if not len(radius):
        return np.full(SECTORS, free_cm, dtype=np.uint16)
    distance = np.hypot(p_L[:, 0], p_L[:, 1])[:, None]
    bearing = np.arctan2(p_L[:, 1], p_L[:, 0])[:, None]
    middle = SECTOR_RAD * np.arange(SECTORS)
    off = np.abs((bearing - middle + math.pi) % (2.0 * math.pi) - math.pi)
    off = np.maximum(0.0, off - SECTOR_RAD / 2.0)  # from the sector's nearer edge
    # a ray at an angle to the centre meets the circle at d cos - sqrt(r^2 - (d sin)^2)
    chord = radius[:, None] ** 2 - (distance * np.sin(off)) ** 2
    reach = distance * np.cos(off) - np.sqrt(np.maximum(0.0, chord))
    seen = (chord >= 0.0) & (off < math.pi / 2.0)
    inside = distance <= radius[:, None]
    surface_m = np.where(inside, 0.0, np.where(seen, reach, np.inf)).min(axis=0)
    surface_cm = np.minimum(100.0 * surface_m, free_cm)
    distances: NDArray[np.uint16] = np.clip(np.floor(surface_cm), 1, free_cm).astype(np.uint16)
    return distances


def obstacle_distance(distances_cm: Iterable[int], range_m: float, time_s: float) -> Message:
    """Make OBSTACLE_DISTANCE of `sector_distances_cm`."""
    return mavlink.MAVLink_obstacle_distance_message(
        round(time_s * 1e6),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        [int(distance) for distance in distances_cm],
        round(360.0 / SECTORS),  # [deg]; the exact one below replaces it
        1,
        round(100.0 * min(range_m, GREATEST_M)),
        360.0 / SECTORS,
        0.0,
        mavlink.MAV_FRAME_BODY_FRD,
    )


def named_value(name: str, value: float, time_s: float) -> Message:
    """Make NAMED_VALUE_FLOAT; names have up to 10 letters."""
    boot_ms = round(time_s * 1000.0) & 0xFFFFFFFF
    return mavlink.MAVLink_named_value_float_message(
        boot_ms, name.encode("ascii")[:_NAME_LENGTH], value
    )


# -- Vessels that are seen but have no AIS, shown to ground stations as if they had: AIS_VESSEL.
#
# Mission Planner and MAVProxy draw them on the map; ArduPilot hands the messages on.

MMSI_BASE = 100_000_000
"""[-] Nine digits that begin with 100, which are nobody's: ships have 2 to 7 there, coast stations
00, groups 0, aircraft 111, handhelds 8, beacons and buoys 9 (ITU-R M.585)."""
MMSI_SYSTEM, MMSI_TRACKS = 1000, 1000
"""[-] Then come three digits of our system id, and three of the track's id."""
STALE_S = 2.0
"""[s] A track that was not seen for so long is told no more."""
_KNOWN = (
    mavlink.AIS_FLAGS_VALID_COG
    | mavlink.AIS_FLAGS_VALID_VELOCITY
    | mavlink.AIS_FLAGS_VALID_DIMENSIONS
    | mavlink.AIS_FLAGS_VALID_NAME
    | mavlink.AIS_FLAGS_POSITION_ACCURACY  # better than 10 m
)
_LARGEST_M = 255
_FASTEST_CMPS = 65_535


def mmsi(system_id: int, track_id: int) -> int:
    """Give a track's number: 100, our system id, the track's id, three digits each.

    A thousand tracks later a number comes back; ids are never used twice in a run.
    """
    return MMSI_BASE + system_id * MMSI_SYSTEM + track_id % MMSI_TRACKS


def ais_vessels(
    tracks: Tracks, datum: Datum, system_id: int, least_speed_mps: float
) -> Iterator[Message]:
    """Give AIS_VESSEL for each track that moves as a vessel does.

    Parameters
    ----------
    tracks
        What is believed to be around.
    datum
        Where the origin of N lies on the earth.
    least_speed_mps
        [m/s] Slower tracks are buoys, quays, or vessels that cannot be told from them.

    Yields
    ------
    Message
        One a vessel; a track whose place is none on earth, or whose numbers are not finite, is left
        out: the message cannot say it.
    """
    speed = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1])
    for k in np.flatnonzero((speed >= least_speed_mps) & (tracks.age_s <= STALE_S)).tolist():
        north, east = tracks.v_N[k].tolist()
        if not _can_be_said(tracks, k):
            continue
        course_cdeg = round(100.0 * math.degrees(math.atan2(east, north))) % 36_000
        latitude_deg, longitude_deg = to_degrees(datum, tracks.p_N[k])
        if abs(latitude_deg) > 90.0:
            continue
        radius_m = math.ceil(min(_LARGEST_M, tracks.radius[k]))
        yield mavlink.MAVLink_ais_vessel_message(
            mmsi(system_id, int(tracks.id[k])),
            round(latitude_deg * 1e7),
            round(longitude_deg * 1e7),
            course_cdeg,
            course_cdeg,  # its heading is not seen; it is drawn along its course
            min(_FASTEST_CMPS, round(100.0 * float(speed[k]))),
            0,
            mavlink.AIS_NAV_STATUS_UNKNOWN,
            mavlink.AIS_TYPE_UNKNOWN,
            radius_m,
            radius_m,
            radius_m,
            radius_m,
            b"",
            f"track {int(tracks.id[k])}".encode("ascii"),
            round(float(tracks.age_s[k])),
            _KNOWN,
        )


def _can_be_said(tracks: Tracks, k: int) -> bool:
    numbers = (*tracks.v_N[k], tracks.radius[k])
    on_earth = math.hypot(*tracks.p_N[k]) <= math.pi * EARTH_RADIUS_M  # half-way round it
    return on_earth and all(math.isfinite(number) for number in numbers)
