"""TTM sentences: the targets that a ship's radar follows itself, once a turn.

A radar with a tracking aid (ARPA, MARPA) says of each target where it is: `$RATTM,number,distance,
bearing,T|R,speed,course,T|R,CPA,TCPA,K|N|S,name,status,R,time,A|M*checksum`. They are taken as
plots, whose errors last as long as its filter remembers; its own velocities are not used.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Final

import numpy as np
from msgspec import Meta

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.marine import decode_sentence
from twinscrew.runtime.messages.types import Tracks
from twinscrew.runtime.senses.sense import NOTHING, Heard, OwnAt, Rarely, Sense, SenseSettings
from twinscrew.runtime.settings import NonNegative, Positive
from twinscrew.runtime.tracking.detections import Look, SourceSettings, positions

UNITS_M: Final = {"N": 1852.0, "K": 1000.0, "S": 1609.344}
FIELDS: Final = 16
"""[-] Of a sentence with all of its fields; older radars leave out the last one or two."""


SOURCE = SourceSettings(
    range_m=(0.0, 50.0, 100.0, 3000.0),
    detection=(0.0, 0.1, 0.7, 0.7),
    max_range_m=6000.0,
    clutter=1e-8,
    delay_s=1.0,
    correlation_s=2.0,
    visible=0.7,
    visible_s=60.0,
    radius_m=8.0,
)
"""What a ship's radar follows: seldom anything small, hardly ever anything that is not there."""


class TtmSettings(SenseSettings, frozen=True, kw_only=True):
    """How well a radar's own tracker measures."""

    topic: ClassVar[str] = "nmea"
    source: ClassVar[SourceSettings] = SOURCE

    range_sigma_m: Positive = 10.0
    """[m] Standard deviation of a range."""
    bearing_sigma_rad: Positive = 0.02
    """[rad] Standard deviation of a bearing."""
    gather_s: NonNegative = 0.3
    """[s] Targets that come within so long are one look: a radar sends them in a row."""
    largest_number: Annotated[int, Meta(ge=1, le=999)] = 99
    """[-] Of a target; a sentence with a greater one is not used."""

    def make(self, name: str) -> Sense:
        """See `SenseSettings`."""
        return Ttm(self, name)


class Ttm:
    """Targets of a radar's own tracker; a `Sense`."""

    def __init__(self, settings: TtmSettings, name: str = "ttm") -> None:
        self._settings = settings
        self._name = name
        self._waiting: dict[int, tuple[float, float]] = {}
        self._since_ns = 0
        self._rarely = Rarely(10.0)

    def take(self, payload: bytes, latest_ns: int, own_at: OwnAt) -> Heard:
        """See `Sense`: a nmea_msgs/Sentence; other sentences than TTM are left alone."""
        sentence = decode_sentence(payload)
        text = sentence.text.strip()
        start = text.find("$")
        if start < 0 or text[start + 3 : start + 6] != "TTM":
            return NOTHING
        stamp_ns = sentence.stamp_ns or latest_ns
        heard = self._look(own_at) if self._is_due(stamp_ns) else NOTHING
        own = own_at(stamp_ns)
        try:
            target = read_ttm(text[start:], 0.0 if own is None else own.heading)
        except MessageError:
            if self._rarely.allows("malformed", stamp_ns):
                raise
            return heard
        if target is None or own is None or target[0] > self._settings.largest_number:
            return heard
        if not self._waiting:
            self._since_ns = stamp_ns
        self._waiting[target[0]] = target[1:]
        return heard

    def step(self, stamp_ns: int, *, forgotten: bool) -> Heard:  # noqa: ARG002
        """See `Sense`; a look waits for the next sentence, which says where the vessel was."""
        return NOTHING

    def targets(self, stamp_ns: int) -> Tracks | None:  # noqa: ARG002
        """See `Sense`."""
        return None

    def _is_due(self, stamp_ns: int) -> bool:
        gather_ns = self._settings.gather_s * 1e9
        return bool(self._waiting) and abs(stamp_ns - self._since_ns) > gather_ns

    def _look(self, own_at: OwnAt) -> Heard:
        waiting, self._waiting = self._waiting, {}
        own = own_at(self._since_ns)
        if own is None:
            return NOTHING
        distance, towards = np.array(list(waiting.values())).T
        own_N = own.position_N[:2]
        p_N = own_N + distance[:, None] * np.column_stack([np.cos(towards), np.sin(towards)])
        look: Look = positions(
            p_N,
            own_N,
            sigma_m=self._settings.range_sigma_m,
            sigma_rad=self._settings.bearing_sigma_rad,
            stamp_ns=self._since_ns,
            source=self._name,
        )
        return Heard((look,))


def checksum(text: str) -> int:
    """Give the checksum of a sentence's text between "$" or "!" and "*"."""
    total = 0
    for character in text:
        total ^= ord(character)
    return total


def read_ttm(text: str, heading: float) -> tuple[int, float, float] | None:
    """Read a TTM sentence.

    Parameters
    ----------
    text
        "$RATTM,...*hh".
    heading
        [rad] The own vessel's, for bearings relative to it.

    Returns
    -------
    target : (number, distance, bearing) or None
        Number [-], distance [m], bearing clockwise from north [rad]; None if the target is lost.

    Raises
    ------
    MessageError
        The checksum or a field is wrong.
    """
    body, _, given = text[1:].partition("*")
    try:
        if int(given[:2], 16) != checksum(body):
            raise MessageError(f"TTM: the checksum is {checksum(body):02X}, not {given[:2]}")
        fields = body.split(",")
        if len(fields) < FIELDS - 3:
            raise MessageError(f"TTM: {len(fields)} fields are too few")
        if fields[12] == "L":
            return None
        number, distance, bearing = int(fields[1]), float(fields[2]), float(fields[3])
        unit = UNITS_M[fields[10]] if fields[10] else UNITS_M["N"]
    except (ValueError, KeyError, IndexError) as error:
        raise MessageError(f"TTM: {error}") from error
    if not (0.0 <= distance * unit < 1e6 and 0.0 <= bearing <= 360.0 and fields[4] in ("T", "R")):
        raise MessageError("TTM: a distance or bearing is no measurement")
    turned = heading if fields[4] == "R" else 0.0
    return number, distance * unit, math.radians(bearing) + turned
