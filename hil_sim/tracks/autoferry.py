"""Recordings of the Autoferry sensor fusion benchmark as looks of the tracker's sources.

Format: Helgesen et al. (2022), Heterogeneous multi-sensor tracking for an autonomous surface
vehicle in a littoral environment, Ocean Engineering 252. Positions are north, east [m] of a local
frame; detections of LiDAR and radar are offsets from the own ship in the same axes, those of the
cameras bearings [rad] clockwise from north.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64
from twinscrew.runtime.settings import Settings, convert, read_toml, shipped
from twinscrew.runtime.tracking.detections import Look, bearings, positions
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

SENSORS = {1: "lidar", 2: "radar", 3: "ir", 4: "eo"}
"""Names of the benchmark's sensor numbers."""
POSITIONS = ("lidar", "radar")
"""Those that measure positions; scores are taken at their records."""


class NoiseSettings(Settings, frozen=True, kw_only=True):
    """The white noise of a sensor's detections."""

    sigma_m: float
    """[m] Of ranges and, for cameras, of where a boat's middle is."""
    sigma_rad: float
    """[rad] Of bearings."""


class RecordingSettings(Settings, frozen=True, kw_only=True):
    """A tracker's settings, and the noise of each sensor."""

    tracker: TrackerSettings
    """The tracker and its sources."""
    noise: dict[str, NoiseSettings]
    """By source."""


@dataclass(frozen=True, slots=True)
class Record:
    """One entry of a recording."""

    time_s: float
    """[s] As recorded."""
    sensor: str
    """One of `SENSORS`."""
    own_N: Float64
    """[m] [N] (2,) The own ship."""
    detections: Float64
    """(M, 2) [m] offsets from the own ship, or (M,) [rad] bearings."""

    @property
    def stamp_ns(self) -> int:
        """[ns] The time as a stamp."""
        return round(self.time_s * NANOSECONDS_PER_SECOND)


@dataclass(frozen=True, slots=True)
class Reported:
    """A track as reported."""

    id: int
    x: Float64
    P: Float64
    existence: float


@dataclass(frozen=True, slots=True)
class Frame:
    """The tracks right after a record."""

    time_s: float
    sensor: str
    tracks: list[Reported]


def read_records(path: Path) -> list[Record]:
    """Read a file of detections, in its order."""
    return [_record(entry, number, path) for number, entry in enumerate(_entries(path))]


def read_truth(path: Path) -> list[dict[int, Float64]]:
    """Read a file of true positions: for each record, by target, (2,) [m] [N]."""
    truth = []
    for number, entry in enumerate(_entries(path)):
        try:
            targets = entry if isinstance(entry, list) else [entry] if entry else []
            truth.append(
                {int(t["targetID"]): np.array(t["position"][:2], np.float64) for t in targets}
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError(
                f"entry {number} is no list of targets: {error!r}", file=path
            ) from error
    return truth


def autoferry_settings(
    name: str | Path = "autoferry", changes: Mapping[str, Any] | None = None
) -> RecordingSettings:
    """Load the settings for the benchmark's ferry, with other values for some keys (a.b.c)."""
    file = shipped("tracking", name)
    values = read_toml(file)
    for key, value in (changes or {}).items():
        *tables, last = key.split(".")
        table = values
        for step in tables:
            table = table.setdefault(step, {})
            if not isinstance(table, dict):
                raise ConfigError(f"{step} is no table", key=key, file=file)
        table[last] = value
    return convert(values, RecordingSettings, file=file)


def track(
    records: Sequence[Record], sensors: Sequence[str], settings: RecordingSettings
) -> Iterator[Frame]:
    """Give what the tracker reports after each record of the sensors."""
    for name in sensors:
        if name not in SENSORS.values():
            raise ConfigError(one_of(name, list(SENSORS.values())), key="--sensors")
    tracker = Tracker(settings.tracker)
    for record in records:
        if record.sensor not in sensors:
            continue
        tracker.take(look_of(record, settings))
        reported = [
            Reported(track.id, track.x, track.P, track.existence)
            for track in tracker.tracks_at(record.stamp_ns, record.own_N)
        ]
        yield Frame(record.time_s, record.sensor, reported)


def look_of(record: Record, settings: RecordingSettings) -> Look:
    """Turn a record into a look."""
    noise = settings.noise[record.sensor]
    common: dict[str, Any] = {
        "sigma_m": noise.sigma_m,
        "sigma_rad": noise.sigma_rad,
        "stamp_ns": record.stamp_ns,
        "source": record.sensor,
    }
    if record.sensor not in POSITIONS:
        return bearings(record.detections, record.own_N, **common)
    shape = any(settings.tracker.sources[record.sensor].shape_m)
    return positions(record.detections + record.own_N, record.own_N, shape_bias=shape, **common)


def within_range(record: Record, settings: RecordingSettings) -> Record:
    """Give a record of positions without what lies beyond the range of its source."""
    distance = np.hypot(record.detections[:, 0], record.detections[:, 1])
    near = distance < settings.tracker.sources[record.sensor].max_range_m
    return replace(record, detections=record.detections[near])


def _entries(path: Path) -> list[Any]:
    try:
        entries = json.loads(path.read_bytes())
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    except ValueError as error:
        raise ConfigError(f"no JSON: {error}", file=path) from error
    if not isinstance(entries, list):
        raise ConfigError("expected a list of records", file=path)
    return entries


def _record(entry: Any, number: int, path: Path) -> Record:
    try:
        sensor = SENSORS[entry["sensorID"]]
        own_N = np.array(entry["ownshipPosition"], np.float64).reshape(2)
        found = np.array(entry["measurement"], np.float64)
        detections = found.reshape(-1) if sensor not in POSITIONS else found.reshape(2, -1).T
        record = Record(float(entry["time"]), sensor, own_N, np.ascontiguousarray(detections))
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(
            f"record {number} is none of time, sensorID, ownshipPosition, measurement: {error!r}",
            file=path,
        ) from error
    if not (
        np.isfinite(own_N).all() and np.isfinite(detections).all() and np.isfinite(record.time_s)
    ):
        raise ConfigError(f"record {number} holds a number that is not finite", file=path)
    return record
