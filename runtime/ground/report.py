"""Tells ground stations what the boat sees and does, at a rate they can use."""

from __future__ import annotations

import math
from collections.abc import Iterable

from twinscrew.runtime.datum import Datum
from twinscrew.runtime.ground.orders import OrderSettings
from twinscrew.runtime.ground.shown import (
    ais_vessels,
    named_value,
    obstacle_distance,
    sector_distances_cm,
)
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Decision, HealthEvent, Severity
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
