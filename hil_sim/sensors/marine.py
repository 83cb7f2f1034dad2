"""A simulated AIS receiver and radar on each vessel: real sentences, and scans with sea clutter.

AIS: every scripted ship that has a transponder, and every vessel of ours (class B), sends what its
own receiver measures, at the rates of ITU-R M.1371-5; each vessel hears all others a moment later.
pyais writes the sentences, as it would those of a real transponder.

Radar: each turn gives returns by range cell and beam. A hull returns from the cells that its sides
lie in; whether a cell is seen follows from its signal-to-noise ratio (Swerling 1: the probability
of detection is the false-alarm probability to the power of 1 / (1 + SNR)). The sea returns, too:
the nearer and the rougher, the more (Skolnik (2008), Radar Handbook, ch. 15, for the trend).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from pyais import encode_dict

from twinscrew.hil_sim.sensors.navigation import Sensed
from twinscrew.hil_sim.world import World
from twinscrew.runtime.datum import Datum, to_degrees
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.marine import RadarScan, Sentence
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings

Field = str | int | float | bytes | bool
KNOT_MPS = 1852.0 / 3600.0
STATIC_S = 360.0
"""[s] Between two reports of name and dimensions; the first comes with the first position."""
OWN_MMSI, TRAFFIC_MMSI = 257_100_001, 257_000_001
"""[-] The first number of our vessels, and of scripted ships that have none of their own."""


class AisTransponders(Settings, frozen=True, kw_only=True):
    """How good the others' transponders are."""

    sigma_m: NonNegative = 3.0
    """[m] Standard deviation of a position, on each axis: an error that wanders"""
    wander_time_s: Positive = 60.0
    """[s] with this time constant."""
    speed_sigma_mps: NonNegative = 0.1
    """[m/s] White noise of the speed."""
    delay_s: tuple[NonNegative, NonNegative] = (0.1, 2.0)
    """[s] From measuring to hearing, evenly between these."""
    loss: NonNegative = 0.05
    """[-] Share of the reports that nobody hears: another used the slot."""
    own_vessels: bool = True
    """Whether our own vessels have transponders of class B."""


class RadarUnit(Settings, frozen=True, kw_only=True):
    """How a radar sees."""

    turn_s: Positive = 2.5
    """[s] A turn: 24 a minute."""
    cell_m: Positive = 6.0
    """[m] A range cell."""
    beam_rad: Positive = math.radians(4.5)
    """[rad] Width of the beam;"""
    step_rad: Positive = math.radians(1.5)
    """[rad] it is told in steps of this."""
    max_range_m: Positive = 1500.0
    least_range_m: NonNegative = 8.0
    snr_db: float = 20.0
    """[dB] Signal-to-noise ratio of 10 m2 at 1000 m."""
    false_alarm: Positive = 1e-6
    """[-] Probability of a return from noise alone, a cell."""
    clutter: NonNegative = 12.0
    """[-] Returns from the sea a turn, in the paper's waves; most from nearer than"""
    clutter_range_m: Positive = 60.0
    """[m] this."""


class MarineSettings(Settings, frozen=True, kw_only=True):
    """What is simulated; one that is missing is not."""

    ais: AisTransponders | None = None
    radar: RadarUnit | None = None

    @property
    def any(self) -> bool:
        """Whether there is something to simulate."""
        return self.ais is not None or self.radar is not None


@dataclass(slots=True)
class _Transponder:
    """One ship that reports itself."""

    mmsi: int
    name: str
    kind: str
    size_m: tuple[float, float]
    own: int
    """[-] Which of our vessels it is on; -1: none."""
    row: int
    """[-] Which of the vessels, or of the scripted ships."""
    next_s: float
    error_N: Float64 = field(default_factory=lambda: np.zeros(2))
    static_s: float = -math.inf


class MarineSensors:
    """AIS receivers and radars of all vessels of a world; keeps messages until they are taken."""

    def __init__(self, world: World, settings: MarineSettings, datum: Datum) -> None:
        """Fit them; `datum` is where the scenario's frame lies on the earth."""
        self._datum = datum
        self._world = world
        self._settings = settings
        self._rng: Generator = world.random(0)
        self._heard: list[tuple[float, int, int, str]] = []
        self._number = 0
        self._transponders = self._make_transponders()
        self._turn_s = [0.0] * world.scenario.vessels
        if settings.radar is not None:
            phase = self._rng.random(world.scenario.vessels)
            self._turn_s = (phase * settings.radar.turn_s).tolist()

    def take(self) -> Iterator[Sensed]:
        """Give what came since the last call: sentences of AIS, then radar scans."""
        if self._settings.ais is not None:
            self._report(self._settings.ais)
            while self._heard and self._heard[0][0] <= self._world.time_s:
                _, _, own, text = heapq.heappop(self._heard)
                yield from self._received(own, text)
        if self._settings.radar is not None:
            for i in range(self._world.scenario.vessels):
                if self._world.time_s >= self._turn_s[i]:
                    self._turn_s[i] += self._settings.radar.turn_s
                    scan = self._radar(i, self._settings.radar)
                    yield Sensed(i, "radar", cdr.encode_radar_scan(scan))

    # -- AIS.

    def _make_transponders(self) -> list[_Transponder]:
        world, ais = self._world, self._settings.ais
        if ais is None:
            return []
        made = []
        for row, entry in enumerate(world.scenario.traffic):
            if entry.ais != "none":
                mmsi, name = entry.mmsi or TRAFFIC_MMSI + row, entry.name or f"TRAFFIC {row + 1}"
                size = entry.length_m, entry.beam_m
                made.append(_Transponder(mmsi, name, entry.ais, size, -1, row, 0.0))
        if ais.own_vessels:
            for i, vessel in enumerate(world.vessels):
                name, size = world.scenario.names[i].upper(), (vessel.length_m, vessel.beam_m)
                made.append(_Transponder(OWN_MMSI + i, name, "B", size, i, i, 0.0))
        for each in made:
            each.next_s = float(self._rng.uniform(0.0, 4.0))
            each.error_N = ais.sigma_m * self._rng.standard_normal(2)
        return made

    def _report(self, ais: AisTransponders) -> None:
        """Let every transponder send whose turn it is."""
        now_s = self._world.time_s
        for each in self._transponders:
            if now_s < each.next_s or (each.own >= 0 and not self._world.present[each.own]):
                continue
            p_N, v_N, heading = self._truth(each)
            speed = float(np.hypot(*v_N))
            interval_s = _interval_s(each.kind, speed)
            keep = math.exp(-interval_s / ais.wander_time_s)
            kick = ais.sigma_m * math.sqrt(1.0 - keep * keep)
            each.error_N = keep * each.error_N + kick * self._rng.standard_normal(2)
            each.next_s = now_s + interval_s * float(self._rng.uniform(0.9, 1.1))
            delay_s = float(self._rng.uniform(*ais.delay_s))
            noise = ais.speed_sigma_mps * self._rng.standard_normal(2)
            lost = self._rng.random() < ais.loss
            if not lost:
                fields = self._position(each, p_N + each.error_N, v_N + noise, heading)
                self._send(each, fields, delay_s)
            if now_s - each.static_s >= STATIC_S:
                each.static_s = now_s
                for part in _static(each):
                    self._send(each, part, delay_s)

    def _truth(self, each: _Transponder) -> tuple[Float64, Float64, float]:
        world = self._world
        if each.own >= 0:
            bodies = world.bodies()
            assert bodies.velocity_N is not None  # noqa: S101  (a world's always have one)
            v_N: Float64 = bodies.velocity_N[each.own, :2]
            return world.state.position_N[each.own, :2], v_N, float(world.state.heading[each.own])
        assert world.traffic is not None  # noqa: S101  (it has this transponder)
        traffic, row = world.traffic, each.row
        return traffic.position_N[row], traffic.velocity_N[row], float(traffic.heading[row])

    def _position(
        self, each: _Transponder, p_N: Float64, v_N: Float64, heading: float
    ) -> dict[str, Field]:
        latitude_deg, longitude_deg = to_degrees(self._datum, p_N)
        speed = float(np.hypot(*v_N))
        return {
            "type": 1 if each.kind == "A" else 18,
            "mmsi": each.mmsi,
            "lat": latitude_deg,
            "lon": longitude_deg,
            "speed": min(speed / KNOT_MPS, 102.2),
            "course": min(math.degrees(math.atan2(v_N[1], v_N[0])) % 360.0, 359.9),
            "heading": round(math.degrees(heading)) % 360 if each.kind == "A" else 511,
            "second": int(self._world.stamp_ns / NANOSECONDS_PER_SECOND) % 60,
            "accuracy": 1,
        }

    def _send(self, each: _Transponder, fields: dict[str, Field], delay_s: float) -> None:
        """Put a message on its way to all of our vessels; to its own one as VDO."""
        at_s = self._world.time_s + delay_s
        for own in range(self._world.scenario.vessels):
            kind = "VDO" if own == each.own else "VDM"
            for text in encode_dict(
                fields, talker_id="AI", sentence_type=kind, seq_id=self._number % 10
            ):
                heapq.heappush(self._heard, (at_s, self._number, own, text))
                self._number += 1

    def _received(self, own: int, text: str) -> Iterator[Sensed]:
        """Hand a sentence to a vessel, if it is there."""
        if self._world.present[own]:
            sentence = Sentence(stamp_ns=self._world.stamp_ns, text=text)
            yield Sensed(own, "nmea", cdr.encode_sentence(sentence))

    # -- Radar.

    def _radar(self, own: int, unit: RadarUnit) -> RadarScan:
        """Give what a vessel's radar saw in the turn that ends now."""
        rng = self._rng
        p_N, area_m2 = self._reflectors(own)
        offset = p_N - self._world.state.position_N[own, :2]
        distance = np.hypot(offset[:, 0], offset[:, 1])
        near = (distance < unit.max_range_m) & (distance > unit.least_range_m)
        distance, area_m2 = distance[near], area_m2[near]
        towards = np.arctan2(offset[near, 1], offset[near, 0]) - self._world.state.heading[own]
        towards = towards + 0.2 * unit.beam_rad * rng.standard_normal(len(towards))
        snr = 10.0 ** (unit.snr_db / 10.0) * (area_m2 / 10.0) * (1000.0 / distance) ** 4
        seen = rng.random(len(distance)) < unit.false_alarm ** (1.0 / (1.0 + snr))
        strength_db = 10.0 * np.log10(1.0 + snr[seen] * rng.exponential(1.0, int(seen.sum())))
        sea = int(rng.poisson(unit.clutter * self._roughness))
        sea_m = unit.least_range_m + rng.exponential(unit.clutter_range_m, sea)
        cells = 2.0 * math.pi / unit.step_rad * unit.max_range_m / unit.cell_m
        noise = int(rng.poisson(unit.false_alarm * cells))
        noise_m = rng.uniform(unit.least_range_m, unit.max_range_m, noise)
        all_m = np.concatenate([distance[seen], sea_m, noise_m])
        bearing = np.concatenate([towards[seen], rng.uniform(-np.pi, np.pi, sea + noise)])
        weak_db = 10.0 + rng.exponential(3.0, sea + noise)
        row = np.floor(all_m / unit.cell_m).astype(np.int64)
        column = np.round(bearing / unit.step_rad).astype(np.int64)
        _, first = np.unique(np.column_stack([row, column]), axis=0, return_index=True)
        first = np.sort(first)
        turned = column[first] * unit.step_rad
        return RadarScan(
            stamp_ns=self._world.stamp_ns,
            range_m=np.asarray((row[first] + 0.5) * unit.cell_m, np.float64),
            bearing_rad=np.asarray((turned + np.pi) % (2.0 * np.pi) - np.pi, np.float64),
            elevation_rad=np.zeros(len(first)),
            doppler_mps=np.full(len(first), np.nan),
            amplitude=np.concatenate([strength_db, weak_db])[first],
        )

    @property
    def _roughness(self) -> float:
        """[-] How rough the sea is, by its waves: 1 in the paper's."""
        p = np.column_stack([np.linspace(0.0, 60.0, 30), np.linspace(0.0, 37.0, 30)])
        rms_m = float(np.std(self._world.sea.elevation(p, self._world.time_s)))
        return min(rms_m / 0.1, 5.0)

    def _reflectors(self, own: int) -> tuple[Float64, Float64]:
        """Give points that reflect, (P, 2) [m] [N], and their cross sections, (P,) [m2]."""
        world = self._world
        places, areas = [world.scenario.buoys[:, :2]], [np.full(len(world.scenario.buoys), 5.0)]
        others = [i for i in np.flatnonzero(world.present).tolist() if i != own]
        places.append(world.state.position_N[others, :2])
        areas.append(np.array([0.5 * world.vessels[i].length_m ** 2 for i in others]))
        boxes = world.scenario.quays
        if world.traffic is not None:
            boxes = np.concatenate([boxes, world.traffic.boxes])
        for box in boxes:
            sides = _sides(box, world.state.position_N[own, :2])
            places.append(sides)
            areas.append(np.full(len(sides), 0.5 * float(box[2]) ** 2 / max(len(sides), 1)))
        return np.concatenate(places).reshape(-1, 2), np.concatenate(areas)


def _interval_s(kind: str, speed: float) -> float:
    """[s] ITU-R M.1371-5, tables 1 and 2; a ship of class A that lies is at anchor."""
    if kind == "B":
        return 180.0 if speed < 2.0 * KNOT_MPS else 30.0
    if speed < 0.2:
        return 10.0  # it has not said that it is at anchor
    return 10.0 if speed < 14.0 * KNOT_MPS else 6.0


def _static(each: _Transponder) -> list[dict[str, Field]]:
    """Give the messages with name and dimensions; the antenna stands in the middle."""
    length, beam = each.size_m
    size = {
        "to_bow": round(length / 2),
        "to_stern": round(length / 2),
        "to_port": max(round(beam / 2), 1),
        "to_starboard": max(round(beam / 2), 1),
    }
    if each.kind == "A":
        return [{"type": 5, "mmsi": each.mmsi, "shipname": each.name, "ship_type": 70, **size}]
    return [
        {"type": 24, "mmsi": each.mmsi, "partno": 0, "shipname": each.name},
        {"type": 24, "mmsi": each.mmsi, "partno": 1, "ship_type": 36, **size},
    ]


def _sides(box: Float64, from_N: Float64) -> Float64:
    """Give points, 3 m apart, on the sides of a box that face a place, (P, 2) [m] [N]."""
    north, east, length, width, _, heading = (float(v) for v in box)
    c, s = math.cos(heading), math.sin(heading)
    d = np.array(from_N) - (north, east)
    ahead, abeam = c * d[0] + s * d[1], -s * d[0] + c * d[1]
    along = np.linspace(-length / 2, length / 2, max(int(length / 3.0), 2))
    across = np.linspace(-width / 2, width / 2, max(int(width / 3.0), 2))
    points = []
    if abs(abeam) > width / 2:
        points.append(
            np.column_stack([along, np.full(len(along), math.copysign(width / 2, abeam))])
        )
    if abs(ahead) > length / 2:
        points.append(
            np.column_stack([np.full(len(across), math.copysign(length / 2, ahead)), across])
        )
    if not points:
        return np.empty((0, 2))
    x, y = np.concatenate(points).T
    return np.column_stack([north + c * x - s * y, east + s * x + c * y])
