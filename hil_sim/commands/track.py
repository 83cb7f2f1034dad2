"""`twinscrew track`: recorded detections of several sensors through the tracker."""

from __future__ import annotations

import itertools
import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from twinscrew.hil_sim.tracks.autoferry import (
    POSITIONS,
    SENSORS,
    Frame,
    Record,
    RecordingSettings,
    autoferry_settings,
    read_records,
    read_truth,
    track,
)
from twinscrew.hil_sim.tracks.compare_stonesoup import track_stonesoup
from twinscrew.hil_sim.tracks.nearest import track_nearest
from twinscrew.hil_sim.tracks.score import TrackScore
from twinscrew.runtime.errors import ConfigError, one_of

Tracker = Callable[[Sequence[Record], Sequence[str], RecordingSettings], Iterator[Frame]]
TRACKERS: dict[str, Tracker] = {
    "twinscrew": track,
    "nearest": track_nearest,
    "stonesoup": track_stonesoup,
}
FORMATS = ("autoferry",)


def track_command(
    files: Annotated[list[Path], typer.Argument(help="Files of detections.")],
    format_: Annotated[str, typer.Option("--format", help="The files' format.")] = "autoferry",
    sensors: Annotated[
        str, typer.Option(help=f"Which are used, of {','.join(SENSORS.values())}.")
    ] = "lidar,radar,ir,eo",
    truth: Annotated[
        list[Path] | None,
        typer.Option(help="True positions to score against, one for each file."),
    ] = None,
    settings: Annotated[
        str, typer.Option(help="Settings: a file, or a name in config/tracking.")
    ] = "autoferry",
    compare: Annotated[
        list[str] | None,
        typer.Option(help="Other trackers to score in the same run: nearest, stonesoup."),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="KEY=VALUE,VALUE,... of the settings: score each recording with those values (of "
            "all combinations) that are best on the others.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Track recorded detections, and score the tracks where the truth is known."""
    if format_ not in FORMATS:
        raise ConfigError(one_of(format_, list(FORMATS)), key="--format")
    if truth and len(truth) != len(files):
        raise ConfigError(f"{len(truth)} files for {len(files)} recordings", key="--truth")
    if as_json and len(files) > 1:
        raise ConfigError("prints the frames of one file; give one", key="--json")
    for name in compare or ():
        if name not in TRACKERS:
            raise ConfigError(one_of(name, list(TRACKERS)), key="--compare")
    chosen = [name.strip() for name in sensors.split(",") if name.strip()]
    loaded = autoferry_settings(settings)
    if vary:
        if not truth or len(files) < 2:
            raise ConfigError("needs two recordings or more, and --truth of each", key="--vary")
        _leave_one_out(files, truth, chosen, settings, [_varied(text) for text in vary])
        return
    names = ["twinscrew", *(compare or ())]
    rows: dict[str, dict[str, dict[str, Any]]] = {}
    for number, file in enumerate(files):
        records = read_records(file)
        true = read_truth(truth[number]) if truth else None
        if true is not None and len(true) != len(records):
            raise ConfigError(f"{len(true)} entries for {len(records)} records", key="--truth")
        for name in names:
            used = [s for s in chosen if name == "twinscrew" or s in POSITIONS]
            frames, seconds = timed(TRACKERS[name](records, used, loaded))
            scores = scored(records, used, frames, true)
            rows.setdefault(_title(file), {})[name] = {**scores, "seconds": seconds}
            if as_json and name == "twinscrew":
                answer = {"frames": [as_plain(frame) for frame in frames]}
    if as_json:
        print(
            json.dumps(answer | ({"scores": rows[_title(files[0])]["twinscrew"]} if truth else {}))
        )
        return
    _print(rows)


def _varied(text: str) -> list[tuple[str, Any]]:
    """Give the key with each of its values."""
    key, equals, values = text.partition("=")
    if not equals or not values:
        raise ConfigError(f"{text!r} is not KEY=VALUE,VALUE,...", key="--vary")
    try:
        return [(key.strip(), value) for value in json.loads(f"[{values}]")]
    except ValueError as error:
        raise ConfigError(f"{values!r} are no values: {error}", key="--vary") from error


def _leave_one_out(
    files: Sequence[Path],
    truth: Sequence[Path],
    sensors: Sequence[str],
    settings: str,
    varied: Sequence[Sequence[tuple[str, Any]]],
) -> None:
    """Print each recording's scores with the values that are best on all others."""
    ways = [dict(way) for way in itertools.product(*varied)]
    loaded = [autoferry_settings(settings, way) for way in ways]
    scores: list[list[dict[str, Any]]] = []
    for file, truth_file in zip(files, truth, strict=True):
        records, true = read_records(file), read_truth(truth_file)
        scores.append(
            [scored(records, sensors, list(track(records, sensors, s)), true) for s in loaded]
        )
    squared = np.array([[way["gospa_rms_m"] ** 2 for way in row] for row in scores])
    table = Table("recording", "GOSPA [m]", "switches", "best of all [m]", "best on the others")
    left_out = []
    for k, file in enumerate(files):
        best = int(np.delete(squared, k, axis=0).mean(axis=0).argmin())
        left_out.append(squared[k, best])
        words = ", ".join(f"{key} = {json.dumps(value)}" for key, value in ways[best].items())
        figures = scores[k][best]
        least = math.sqrt(squared[k].min())
        switches = str(figures["identity_switches"])
        table.add_row(
            _title(file), f"{figures['gospa_rms_m']:.2f}", switches, f"{least:.2f}", words
        )
    table.add_row("all", f"{math.sqrt(np.mean(left_out)):.2f}")
    Console().print(table)


def timed(frames: Iterator[Frame]) -> tuple[list[Frame], float]:
    """Give all frames, and how long they took [s]."""
    begin = time.perf_counter()
    done = list(frames)
    return done, time.perf_counter() - begin


def scored(
    records: Sequence[Record],
    sensors: Sequence[str],
    frames: Sequence[Frame],
    truth: Sequence[dict[int, Any]] | None,
) -> dict[str, Any]:
    """Score the frames of LiDAR and radar; without a truth, nothing."""
    if truth is None:
        return {}
    score = TrackScore()
    used = [t for record, t in zip(records, truth, strict=True) if record.sensor in sensors]
    for frame, targets in zip(frames, used, strict=True):
        if frame.sensor in POSITIONS:
            score.add(frame.time_s, targets, {t.id: t.x[:2] for t in frame.tracks})
        stated = [(t.x[:2], t.P[:2, :2]) for t in frame.tracks]
        score.add_nees(frame.sensor, list(targets.values()), stated)
    return score.figures()


def as_plain(frame: Frame) -> dict[str, Any]:
    """Give a frame as it is printed."""
    return {
        "time_s": frame.time_s,
        "tracks": [
            {
                "id": t.id,
                "north_m": float(t.x[0]),
                "east_m": float(t.x[1]),
                "v_north_mps": float(t.x[2]),
                "v_east_mps": float(t.x[3]),
                "existence": t.existence,
            }
            for t in frame.tracks
        ],
    }


def _title(file: Path) -> str:
    return file.stem.removesuffix("_detections")


def _print(rows: dict[str, dict[str, dict[str, Any]]]) -> None:
    table = Table()
    columns = (
        ("recording", None),
        ("tracker", None),
        ("GOSPA [m]", "gospa_rms_m"),
        ("switches", "identity_switches"),
        ("false/min", "false_tracks_per_minute"),
        ("first [s]", "time_to_first_track_s"),
        ("run [s]", "seconds"),
    )
    for title, _ in columns:
        table.add_column(title, no_wrap=True)
    for recording, trackers in rows.items():
        for name, figures in trackers.items():
            cells = [_cell(figures.get(key)) for _, key in columns[2:]]
            table.add_row(recording, name, *cells)
    for name in next(iter(rows.values())):
        errors = [t[name]["gospa_rms_m"] for t in rows.values() if t[name].get("gospa_rms_m")]
        if len(errors) > 1:
            rms = math.sqrt(sum(e * e for e in errors) / len(errors))
            table.add_row("all", name, f"{rms:.2f}")
    Console().print(table)
    for recording, trackers in rows.items():
        for name, figures in trackers.items():
            if figures.get("nees"):
                words = ", ".join(_within(*item) for item in figures["nees"].items())
                print(f"NEES below its 95 % point, {recording}, {name}: {words}")


def _within(sensor: str, nees: dict[str, float]) -> str:
    return f"{sensor} {100.0 * nees['in_95_band']:.0f} % (mean {nees['mean']:.1f} of 2)"


def _cell(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join("-" if v is None else f"{v:.0f}" for v in value.values())
    return "" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)
