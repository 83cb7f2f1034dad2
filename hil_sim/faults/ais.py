"""A station that says on AIS what is not so: ships that jump, share a number, or are none."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.random import Generator
from pyais import encode_dict

from twinscrew.hil_sim.faults.effects import Immediate
from twinscrew.hil_sim.faults.kinds import FalseAis
from twinscrew.hil_sim.sensors.marine import OWN_MMSI
from twinscrew.hil_sim.sitl_runtimes import DATUM
from twinscrew.runtime.datum import to_degrees
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.marine import Sentence

EVERY_S = 0.5
"""[s] Between two reports of the station."""
SHIP_MMSI = 257_900_001
FLOOD = 500
"""[-] Sentences that a flood sends each time: ten times what the channel carries."""
SPEED_KN, FALSE_SPEED_KN = 8.0, 95.0
METRES_EACH = SPEED_KN * 1852.0 / 3600.0 * EVERY_S


class LyingStation(Immediate):
    """Sends false reports beside what is really heard."""

    def __init__(self, given: FalseAis, rng: Generator) -> None:
        self._given, self._rng = given, rng
        self._next_s = -math.inf
        self._sent = 0

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`: what is really heard goes through."""
        return [payload]

    def due(self, now_s: float) -> list[bytes]:
        """See `Effect`."""
        if now_s < self._next_s:
            return []
        self._next_s = now_s + EVERY_S
        self._sent += 1
        return [cdr.encode_sentence(Sentence(stamp_ns=0, text=text)) for text in self._texts()]

    def _texts(self) -> Iterator[str]:
        way_m, does = METRES_EACH * self._sent, self._given.does
        if does == "garbage":
            size = int(self._rng.integers(1, 60))
            text = bytes(self._rng.integers(33, 127, size, np.uint8)).decode("ascii")
            yield f"!AIVDM,1,1,,A,{text.replace('*', '+')},0*00"
        elif does == "flood":
            for k in range(FLOOD):
                yield from _report(SHIP_MMSI + k, (500.0, way_m), SPEED_KN)
        elif does == "own":
            yield from _report(OWN_MMSI, (way_m, 0.0), SPEED_KN)
        elif does == "spoof":
            yield from _report(SHIP_MMSI, (500.0, way_m), FALSE_SPEED_KN)
        else:
            yield from _report(SHIP_MMSI, (500.0, way_m), SPEED_KN)
            if does == "duplicate" or self._sent % 6 == 0:  # a jump is one report in six
                yield from _report(SHIP_MMSI, (4000.0, way_m), SPEED_KN)


def _report(mmsi: int, p_N: tuple[float, float], speed_kn: float) -> list[str]:
    latitude_deg, longitude_deg = to_degrees(DATUM, np.array(p_N))
    fields: dict[str, str | int | float | bytes | bool] = {
        "type": 1,
        "mmsi": mmsi,
        "lat": latitude_deg,
        "lon": longitude_deg,
        "speed": speed_kn,
        "course": 90.0,
        "heading": 90,
        "second": 60,
        "accuracy": 1,
    }
    return encode_dict(fields, talker_id="AI", sentence_type="VDM")
