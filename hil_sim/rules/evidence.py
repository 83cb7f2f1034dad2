"""What judges are given, and what they say: an episode's tracks, and findings.

Tracks are the simulator's truth, or what a boat knew by its recording. They are kept as one JSON
object, positions in whole centimetres: those of an experiment's episodes in one file
(`tracks.jsonl`), a line each, those of a run in `tracks.json`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.supervisor import Outcome, Result
from twinscrew.hil_sim.trajectory import TrajectoryLog
from twinscrew.runtime.errors import NOT_THE_FORMAT, RecordingError
from twinscrew.runtime.files import replace_file
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Decision, Float64, Odometry
from twinscrew.runtime.recording.recording import Recording
from twinscrew.runtime.settings import Settings
from twinscrew.runtime.vessel_description import load_vessel

TRACKS_FILE = "tracks.json"
STEP_S = 0.2
"""[s] Between two samples."""
UNITS = np.array([100.0, 100.0, 1000.0])
"""[1/m, 1/m, 1/rad] Positions are kept in centimetres, headings in milliradians."""
TRACK_GAP_S = 2.0
"""[s] A track that the boat lost for longer is not there in between."""
LEAST_TRACK_S = 2.0
"""[s] A track that lived shorter is nobody."""

Cause = Literal["goal", "collision", "timeout", "other"]


class Body(Settings, frozen=True, kw_only=True):
    """A vessel."""

    name: str
    length_m: Annotated[float, Meta(gt=0.0)]
    beam_m: Annotated[float, Meta(gt=0.0)]
    circle: bool = False
    """Whether contact was judged with the circle around it, and not with its rectangle."""
    ours: bool = False
    """Whether it is judged: it was sailed by the runtime."""
    ended_s: float | None = None
    """[s] When its voyage ended; none: it is not known to have."""
    outcome: Cause | None = None
    """How."""

    @property
    def radius_m(self) -> float:
        """[m] Of the circle around it."""
        return math.hypot(self.length_m, self.beam_m) / 2


Role = Literal["overtaking", "head_on", "give_way", "stand_on"]
RULES: dict[Role, int] = {"overtaking": 13, "head_on": 14, "give_way": 15, "stand_on": 17}
"""What each role is asked by, besides rules 8 and 16."""


class Finding(Settings, frozen=True, kw_only=True):
    """What a judge says of one vessel's part in a meeting of two."""

    ego: int
    """[-] Number of the vessel that is judged,"""
    other: int
    """[-] and of the one that it met."""
    role: Role
    begin_s: float
    """[s] When there was a risk of collision,"""
    nearest_s: float
    """[s] when the two were nearest, and"""
    end_s: float
    """[s] when they were past and clear, or one of them had ended."""
    kept: bool
    """Whether the vessel did what the rule of its role asks."""
    why: str = ""
    """What it did instead."""
    contact: bool
    closest_m: float
    """[m] Least distance between the two outlines, as the judge measures it."""
    altered_deg: float = 0.0
    """[deg] The first alteration of course of at least 10 degrees, to starboard; 0: none."""
    altered_before_s: float | None = None
    """[s] How long before the two were nearest it began; none without one."""
    readable: bool | None = None
    """Rule 8: whether it was large and early. None for who stands on."""
    possible: bool | None = None
    """Whether the rule could be kept without contact; none: this judge does not say."""

    @property
    def rule(self) -> int:
        """The rule of its role."""
        return RULES[self.role]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """T samples of K vessels and M things that do not move."""

    times: Float64
    """[s] (T,) Every `STEP_S`."""
    pose_N: Float64
    """[m, m, rad] [N] (T, K, 3) North, east, heading; NaN where a vessel is not there."""
    bodies: tuple[Body, ...]
    """(K,)"""
    fixed: Float64
    """[m] [N] (M, 3) North, east, radius: buoys."""


class _Kept(Settings, frozen=True, kw_only=True):
    """How tracks are written."""

    step_s: Annotated[float, Meta(gt=0.0, le=10.0)]
    bodies: tuple[Body, ...]
    tracks: tuple[tuple[int | None, ...], ...]
    """[cm, cm, mrad] A row a vessel: north, east, heading, north, ...; null where it is not."""
    fixed: tuple[tuple[float, float, float], ...] = ()


def as_plain(tracks: Tracks) -> dict[str, Any]:
    """Give what is written of tracks."""
    rows = []
    for k in range(len(tracks.bodies)):
        scaled = (tracks.pose_N[:, k] * UNITS).ravel()
        rows.append([None if math.isnan(value) else round(value) for value in scaled.tolist()])
    return {
        "step_s": STEP_S,
        "bodies": msgspec.to_builtins(tracks.bodies),
        "tracks": rows,
        "fixed": np.round(tracks.fixed, 3).tolist(),
    }


def from_plain(values: object, file: Path) -> Tracks:
    """Give the tracks that `as_plain` wrote.

    Raises
    ------
    RecordingError
        They are none.
    """
    try:
        kept = msgspec.convert(values, _Kept)
        lengths = {len(row) for row in kept.tracks}
        if len(kept.tracks) != len(kept.bodies) or len(lengths) > 1 or any(n % 3 for n in lengths):
            raise ValueError("each vessel needs a row of north, east, heading, all equally long")
    except NOT_THE_FORMAT as error:
        raise RecordingError(f"{file}: no tracks of an episode: {error}") from error
    rows = np.array(kept.tracks, np.float64).reshape(len(kept.bodies), -1, 3)
    return Tracks(
        times=kept.step_s * np.arange(rows.shape[1]),
        pose_N=rows.transpose(1, 0, 2) / UNITS,
        bodies=kept.bodies,
        fixed=np.array(kept.fixed, np.float64).reshape(-1, 3),
    )


def write_tracks(folder: Path, tracks: Tracks) -> None:
    """Leave a run's tracks in its folder; a `RecordingError` if they cannot be written."""
    data = msgspec.json.encode(as_plain(tracks)) + b"\n"
    try:
        replace_file(folder / TRACKS_FILE, lambda file: file.write(data))
    except OSError as error:
        raise RecordingError(f"{folder / TRACKS_FILE}: {error.strerror or error}") from error


def read_tracks(file: Path) -> Tracks:
    """Read a run's tracks; a `RecordingError` if there are none."""
    try:
        return from_plain(msgspec.json.decode(file.read_bytes()), file)
    except OSError as error:
        raise RecordingError(f"{file}: {error.strerror or error}") from error
    except NOT_THE_FORMAT as error:
        raise RecordingError(f"{file}: no tracks of an episode: {error}") from error


def true_tracks(
    scenario: Scenario, log: TrajectoryLog, results: Sequence[Result], *, vanish: bool = False
) -> Tracks:
    """Give where everybody truly was in the simulator.

    Parameters
    ----------
    scenario, log, results
        The episode, its log, and what became of its vessels.
    vanish
        Whether vessels leave the map at their goals, as they do when they have touched something.
    """
    times = STEP_S * np.arange(int(log.times[-1] / STEP_S) + 1)
    bodies, columns = [], []
    for k, (name, kind, result) in enumerate(
        zip(scenario.names, scenario.types, results, strict=True)
    ):
        hull, outcome = load_vessel(kind), result.outcome
        gone = outcome is Outcome.COLLISION or (vanish and outcome is Outcome.GOAL)
        until_s = result.travel_time_s if gone else math.inf
        bodies.append(
            Body(
                name=name,
                length_m=hull.length_m,
                beam_m=hull.beam_m,
                circle=len(hull.circles_m) == 1,
                ours=True,
                ended_s=None if outcome is None else round(result.travel_time_s, 3),
                outcome=_CAUSES.get(outcome, "other"),
            )
        )
        columns.append(_sampled(times, log.times, log.rows[:, k, :3], until_s))
    for k, ship in enumerate(scenario.traffic):
        bodies.append(
            Body(name=ship.name or f"TRAFFIC {k + 1}", length_m=ship.length_m, beam_m=ship.beam_m)
        )
        columns.append(_sampled(times, log.times, log.traffic[:, k], math.inf))
    return Tracks(
        times=times, pose_N=np.stack(columns, axis=1), bodies=tuple(bodies), fixed=scenario.buoys
    )


_CAUSES: dict[Outcome | None, Cause] = {
    Outcome.GOAL: "goal",
    Outcome.COLLISION: "collision",
    Outcome.TIMEOUT: "timeout",
}


def _sampled(times: Float64, at: Float64, pose: Float64, until_s: float) -> Float64:
    """Give poses (T, 3) at `times` from those (n, 3) at `at`; NaN outside and after `until_s`."""
    if len(at) == 0:
        return np.full((len(times), 3), np.nan)
    columns = (pose[:, 0], pose[:, 1], np.unwrap(pose[:, 2]))
    rows = np.column_stack([np.interp(times, at, column) for column in columns])
    rows[(times < at[0] - STEP_S) | (times > min(at[-1] + STEP_S, until_s))] = np.nan
    return rows


def boat_tracks(recording: Recording) -> Tracks:
    """Give what a boat itself knew: its odometry, and what its tracker followed.

    Raises
    ------
    RecordingError
        The recording is damaged, or holds no odometry or no decisions.
    """
    own: list[tuple[int, float, float, float]] = []
    seen: dict[int, list[tuple[int, float, float, float, float]]] = {}
    for message in recording.messages(("odometry", "decision")):
        if message.topic == "odometry":
            odometry: Odometry = cdr.decode_odometry(message.payload)
            place = odometry.position_N
            own.append((odometry.stamp_ns, float(place[0]), float(place[1]), odometry.heading))
        else:
            decision: Decision = cdr.decode_decision(message.payload)
            _take(seen, decision)
    if len(own) < 2:
        raise RecordingError(f"{recording.path}: holds no odometry: nothing to judge")
    begin_ns = own[0][0]
    rows = np.array(own, np.float64)
    at = (rows[:, 0] - begin_ns) / 1e9
    times = STEP_S * np.arange(int(at[-1] / STEP_S) + 1)
    hull = _hull(recording)
    bodies = [Body(name=recording.vessel, length_m=hull[0], beam_m=hull[1], ours=True)]
    columns = [_sampled(times, at, rows[:, 1:], math.inf)]
    for number, looks in seen.items():
        there = np.array(looks, np.float64)
        at = (there[:, 0] - begin_ns) / 1e9
        if at[-1] - at[0] < LEAST_TRACK_S:
            continue
        pose = _sampled(times, at, there[:, 1:4], math.inf)
        after = np.clip(np.searchsorted(at, times), 1, len(at) - 1)
        pose[at[after] - at[after - 1] > TRACK_GAP_S] = np.nan
        size = math.sqrt(2.0) * max(float(np.median(there[:, 4])), 0.1)
        bodies.append(Body(name=f"track {number}", length_m=size, beam_m=size, circle=True))
        columns.append(pose)
    return Tracks(
        times=times,
        pose_N=np.stack(columns, axis=1),
        bodies=tuple(bodies),
        fixed=np.empty((0, 3)),
    )


def _take(
    seen: dict[int, list[tuple[int, float, float, float, float]]], decision: Decision
) -> None:
    """Note what a decision's tracks say: its stamp, where each is, where it goes, its radius."""
    tracks = decision.tracks
    for k, number in enumerate(tracks.id.tolist()):
        north, east = tracks.p_N[k].tolist()
        course = math.atan2(tracks.v_N[k, 1], tracks.v_N[k, 0])
        looks = seen.setdefault(number, [])
        looks.append((decision.stamp_ns, north, east, course, float(tracks.radius[k])))


def _hull(recording: Recording) -> tuple[float, float]:
    """[m] Give length and beam of who made a recording; the default vessel's if it says nothing."""
    configuration = recording.metadata.get("config", {})
    name = configuration.get("vessel") if isinstance(configuration, dict) else None
    hull = load_vessel(name) if isinstance(name, str) and name else load_vessel()
    return hull.length_m, hull.beam_m
