"""An experiment's folder: experiment.json, results.jsonl, tracks.jsonl, beginnings.json.

The folder carries its experiment and takes no other experiment's episodes. A line counts once its
newline is on the disk, so that neither a crash nor a full disk loses an episode.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import msgspec
import numpy as np

from twinscrew.hil_sim.experiments.plan import Experiment, Key, SetSettings, episode_seed
from twinscrew.hil_sim.rules.evidence import Tracks, as_plain, from_plain
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.world import Touched
from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError, RecordingError
from twinscrew.runtime.files import processor, replace_file
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.recording.recorder import software
from twinscrew.runtime.settings import CONFIG_DIR, Settings, convert

Cause = Literal["vessel", "buoy", "quay", "fence", "time"]
CAUSES: tuple[Cause, ...] = ("vessel", "buoy", "quay", "fence", "time")
"""Why an episode fails: what was hit (a pile is a buoy; land, rocks and the ground are a quay), a
fence or keep-out area entered, or time run out. Results of before version 0.6 call quays buoys."""


class VesselRecord(Settings, frozen=True, kw_only=True):
    """How one vessel fared."""

    outcome: Literal["goal", "collision", "fence", "timeout"]
    touched: Touched | None = None
    """What it hit, if it did."""
    travel_time_s: float
    """[s] Simulated time to the outcome."""
    closest_approach_m: float | None
    """[m] Least distance to another's surface while under way; None if nobody else is there."""
    greatest_current_mps: float = 0.0
    """[m/s] The fastest water it was in."""
    energy_ns: float
    """[N s] Integral of |T| dt over both propellers."""
    decisions: int
    interventions: int = 0
    """[-] How often the assurance took the propellers from the policy."""


class EncounterRecord(Settings, frozen=True, kw_only=True):
    """One vessel's part in an encounter; see `encounters.Encounter`."""

    kind: Literal["head_on", "give_way"]
    ego: int
    other: int
    begin_s: float
    end_s: float
    acted: bool
    touched: bool
    gap_m: float
    rule_gap_m: float


class Timing(Settings, frozen=True, kw_only=True):
    """What depends on the machine and its load, and on nothing else."""

    decision_p50_ms: float
    """[ms] From a scan's bytes to the thrust command's, the slowest vessel's."""
    decision_p99_ms: float
    decision_max_ms: float
    wall_s: float
    simulated_s: float


class EpisodeRecord(Settings, frozen=True, kw_only=True):
    """One episode."""

    method: str
    set: str
    variant: str
    episode: int
    seed: int
    """What `twinscrew sitl --lockstep --seed` takes to sail it again."""
    success: bool
    cause: Cause | None
    """Why it failed, by its first failure."""
    vessels: tuple[VesselRecord, ...]
    kind: str = ""
    """What was drawn, where the set draws several kinds."""
    encounters: tuple[EncounterRecord, ...]
    decisions_sha256: str
    """Over all vessels' decisions: equal if and only if all were equal bit for bit."""
    timing: Timing

    @property
    def key(self) -> Key:
        """Which episode it is."""
        return Key(self.method, self.set, self.variant, self.episode)


# -- A results' folder: it carries its experiment, and takes no other one's episodes.

EXPERIMENT_FILE = "experiment.json"


class Origin(Settings, frozen=True, kw_only=True):
    """By what the results were made."""

    commit: str
    """Of the checkout; "-dirty" if it was not clean, "unknown" outside of one."""
    software: dict[str, str]
    machine: str


class Folder(Settings, frozen=True, kw_only=True):
    """What experiment.json holds."""

    experiment: Experiment
    origins: tuple[Origin, ...]
    """The first, and every different one that went on with it."""


def read_folder(path: Path) -> Folder:
    """Read what a folder's results are of.

    Raises
    ------
    ConfigError
        It is no results' folder.
    """
    file = path / EXPERIMENT_FILE
    try:
        values = msgspec.json.decode(file.read_bytes())
    except OSError as error:
        what = "not a folder of results" if path.is_dir() else "no such folder"
        raise ConfigError(f"{what} ({error.strerror})", file=path) from error
    except NOT_THE_FORMAT as error:
        raise ConfigError(f"damaged: {error}", file=file) from error
    return convert(values, Folder, file=file)


def begin(path: Path, experiment: Experiment) -> Folder:
    """Make a new results' folder; an empty one will do.

    Raises
    ------
    ConfigError
        The folder holds something already, or cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        if any(path.iterdir()):
            raise ConfigError("the folder is not empty", file=path)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    return _write(path, Folder(experiment=experiment, origins=(origin(),)))


def go_on(path: Path, asked: Mapping[str, Any]) -> Folder:
    """Open a results' folder to go on with its experiment, or to add episodes, methods or variants.

    Parameters
    ----------
    asked
        What the user said, by names of `Experiment`; what was not said stays as it is.

    Raises
    ------
    ConfigError
        It is of another experiment: which setting differs, and how.
    """
    there = read_folder(path)
    differences = list(_differences(there.experiment, asked))
    if differences:
        raise ConfigError(
            f"these are results of another experiment: {'; '.join(differences)}", file=path
        )
    now, grown = origin(), _grown(there.experiment, asked)
    origins = there.origins if now in there.origins else (*there.origins, now)
    folder = Folder(experiment=grown, origins=origins)
    return folder if folder == there else _write(path, folder)


def origin() -> Origin:
    """Tell by what results would be made now."""
    machine = f"{processor()}, {len(os.sched_getaffinity(0))} cores"
    return Origin(commit=_commit(), software=software(), machine=machine)


def _differences(there: Experiment, asked: Mapping[str, Any]) -> Iterator[str]:
    """Tell what was asked for that the results are not of; they may grow."""
    for key in ("sets", "seed", "sensor", "suite"):
        before = getattr(there, key)
        if key in asked and asked[key] != before:
            yield f"{key} {_plain(before)}, not {_plain(asked[key])}"
    if asked.get("episodes", there.episodes) < there.episodes:
        yield f"episodes {there.episodes}, not {asked['episodes']}"
    known = {method.name: method for method in there.methods}
    for method in asked.get("methods", ()):
        if known.get(method.name, method) != method:
            yield f"{method.name} is another policy: {_plain(known[method.name])}"


def _grown(there: Experiment, asked: Mapping[str, Any]) -> Experiment:
    new = [method for method in asked.get("methods", ()) if method not in there.methods]
    return msgspec.structs.replace(
        there,
        methods=(*there.methods, *new),
        variants=tuple(dict.fromkeys((*there.variants, *asked.get("variants", ())))),
        episodes=asked.get("episodes", there.episodes),
    )


def _plain(value: object) -> str:
    return msgspec.json.encode(value).decode()


def _write(path: Path, folder: Folder) -> Folder:
    """Write experiment.json whole or not at all."""
    data = msgspec.json.format(msgspec.json.encode(folder), indent=2) + b"\n"
    try:
        replace_file(path / EXPERIMENT_FILE, lambda file: file.write(data))
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path / EXPERIMENT_FILE) from error
    return folder


def _commit() -> str:
    git = shutil.which("git")
    if git is None:
        return "unknown"
    words = [git, "-C", str(CONFIG_DIR), "describe", "--always", "--dirty", "--abbrev=12"]
    answer = subprocess.run(words, capture_output=True, text=True, check=False)
    return answer.stdout.strip() or "unknown"


# -- results.jsonl: one line an episode, appended so that neither a crash nor a full disk loses one.
#
# A line counts once its newline is on the disk. Only the parent writes; it holds a lock: two
# experiments cannot write into one file.

RESULTS_FILE = "results.jsonl"
_ENCODER = msgspec.json.Encoder()
_DECODER = msgspec.json.Decoder(EpisodeRecord)


def read_results(path: Path) -> list[EpisodeRecord]:
    """Give the episodes in a file; a half-written last line is not one.

    Raises
    ------
    RecordingError
        The file cannot be read, a whole line is no episode, or an episode is there twice.
    """
    return _parse(path, _read(path))[0]


def results_sha256(records: Iterable[EpisodeRecord]) -> str:
    """Give one hash of all that the episodes gave, in any order, without what clocks measured."""
    plain = sorted((record.key, _ENCODER.encode(_timeless(record))) for record in records)
    digest = hashlib.sha256()
    for _, line in plain:
        digest.update(line + b"\n")
    return digest.hexdigest()


class ResultsFile:
    """A context that holds the file open, locked, and ready to be appended to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: list[EpisodeRecord] = []
        self._descriptor = -1
        self._size = 0
        self._tracks_whole = False

    def __enter__(self) -> Self:
        """Open, lock, read, and cut off a half-written last line.

        Raises
        ------
        RecordingError
            The file cannot be used, or another experiment writes into it.
        """
        try:
            self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.records, self._size = _parse(self.path, _read(self.path))
            os.ftruncate(self._descriptor, self._size)
            os.lseek(self._descriptor, 0, os.SEEK_END)
        except BlockingIOError as error:
            self._close()
            raise RecordingError(f"{self.path}: another experiment writes into it") from error
        except OSError as error:
            self._close()
            raise RecordingError(f"{self.path}: {error.strerror or error}") from error
        except RecordingError:
            self._close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._close()

    def append(self, record: EpisodeRecord, tracks: bytes = b"") -> None:
        """Add an episode; it is on the disk when this returns.

        Its tracks, a line of `tracks_line`, go into their own file before it: whoever has an
        episode's line has its tracks, unless it was sailed before tracks were kept.

        Raises
        ------
        RecordingError
            The disk is full, or failed: the file is as it was before.
        """
        if tracks:
            self._add_tracks(tracks)
        line = _ENCODER.encode(record) + b"\n"
        try:
            _write_all(self._descriptor, line)
            os.fsync(self._descriptor)
        except OSError as error:
            self._take_back()
            raise RecordingError(
                f"{self.path}: {error.strerror or error}; {len(self.records)} episodes are kept: "
                "make room, then go on with --resume"
            ) from error
        self._size += len(line)
        self.records.append(record)

    def _add_tracks(self, line: bytes) -> None:
        """Add a line of tracks; half a line from before is cut off first."""
        path = self.path.with_name(TRACKS_FILE)
        try:
            with path.open("a+b") as file:
                if not self._tracks_whole:
                    file.truncate(_whole_bytes(path.read_bytes()))
                    self._tracks_whole = True
                size = file.seek(0, os.SEEK_END)
                try:
                    file.write(line)
                    file.flush()
                except OSError:
                    with suppress(OSError):
                        file.truncate(size)
                    self._tracks_whole = False
                    raise
        except OSError as error:
            raise RecordingError(
                f"{path}: {error.strerror or error}; {len(self.records)} episodes are kept: "
                "make room, then go on with --resume"
            ) from error

    def _take_back(self) -> None:
        """Remove what was written of a line; what cannot be removed is ignored when read."""
        try:
            os.ftruncate(self._descriptor, self._size)
            os.lseek(self._descriptor, 0, os.SEEK_END)
        except OSError:
            return

    def _close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error


def _parse(path: Path, data: bytes) -> tuple[list[EpisodeRecord], int]:
    """Give the episodes, and how many bytes hold whole lines."""
    whole = _whole_bytes(data)
    records: list[EpisodeRecord] = []
    lines: dict[Key, int] = {}
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        try:
            record = _DECODER.decode(line)
        except NOT_THE_FORMAT as error:
            raise RecordingError(f"{path}:{number}: not an episode: {error}") from error
        if record.key in lines:
            raise RecordingError(f"{path}:{number}: line {lines[record.key]} again: {record.key}")
        lines[record.key] = number
        records.append(record)
    return records, whole


def _whole_bytes(data: bytes) -> int:
    """Give how many bytes hold whole lines."""
    return data.rfind(b"\n") + 1


def _timeless(record: EpisodeRecord) -> dict[str, object]:
    plain: dict[str, object] = msgspec.to_builtins(record)
    del plain["timing"]
    return plain


# -- tracks.jsonl: who was where in every episode, a line each, for judges of the rules of the road.

TRACKS_FILE = "tracks.jsonl"


class _TracksLine(Settings, frozen=True, kw_only=True):
    method: str
    set: str
    variant: str
    episode: int
    tracks: msgspec.Raw


def tracks_line(key: Key, tracks: Tracks) -> bytes:
    """Give the line that keeps an episode's tracks."""
    raw = msgspec.Raw(msgspec.json.encode(as_plain(tracks)))
    return _ENCODER.encode(_TracksLine(**key._asdict(), tracks=raw)) + b"\n"


def read_tracks_of(folder: Path) -> dict[Key, Tracks]:
    """Give the tracks of a folder's episodes: of those that have any.

    An episode that was sailed twice, as its worker died, has its last tracks.

    Raises
    ------
    RecordingError
        The file cannot be read, or a whole line holds no tracks.
    """
    path = folder / TRACKS_FILE
    if not path.is_file():
        return {}
    data = _read(path)
    found = {}
    for number, line in enumerate(data[: _whole_bytes(data)].splitlines(), start=1):
        where = Path(f"{path}:{number}")
        try:
            one = msgspec.json.decode(line, type=_TracksLine)
            values = msgspec.json.decode(one.tracks)
        except NOT_THE_FORMAT as error:
            raise RecordingError(f"{where}: no tracks of an episode: {error}") from error
        key = Key(one.method, one.set, one.variant, one.episode)
        found[key] = from_plain(values, where)
    return found


# -- How every episode begins, as a file, for other simulators to run the same ones.
#
# `twinscrew evaluate POLICY --on DIR` reads it, in the training environment.

BEGINNINGS_FILE = "beginnings.json"
Row = tuple[float, ...]


class Beginning(Settings, frozen=True, kw_only=True):
    """How one episode begins; everything at rest."""

    starts: tuple[Row, ...]
    """[m, m, rad] North, east, heading of each vessel."""
    goals: tuple[Row, ...]
    """[m] North, east."""
    buoys: tuple[Row, ...]
    """[m] North, east, radius."""


class SetBeginnings(Settings, frozen=True, kw_only=True):
    """A set's episodes, in their order."""

    name: str
    episodes: tuple[Beginning, ...]


def beginnings(experiment: Experiment) -> tuple[SetBeginnings, ...]:
    """Give how the episodes of all sets begin: the same for every method and variant."""
    return tuple(
        SetBeginnings(
            name=one.name,
            episodes=tuple(_beginning(experiment, one, k) for k in range(experiment.episodes)),
        )
        for one in experiment.sets
    )


def write_beginnings(folder: Path, experiment: Experiment) -> None:
    """Leave `beginnings.json` in a results' folder, if it does not hold as many already.

    Raises
    ------
    RecordingError
        The disk is full, or failed.
    """
    path = folder / BEGINNINGS_FILE
    try:
        if path.is_file() and _count(path) >= experiment.episodes:
            return
        drawn = msgspec.json.encode({"sets": beginnings(experiment)})
        replace_file(path, lambda file: file.write(drawn))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error


def _beginning(experiment: Experiment, one: SetSettings, episode: int) -> Beginning:
    scenario: Scenario = one.draw(episode_seed(experiment.seed, one.name, episode), episode)
    return Beginning(
        starts=_rows(scenario.starts), goals=_rows(scenario.goals), buoys=_rows(scenario.buoys)
    )


def _rows(array: Float64) -> tuple[Row, ...]:
    return tuple(tuple(row) for row in np.asarray(array).tolist())


def _count(path: Path) -> int:
    """Give how many episodes a set of the file has; 0 if it is damaged."""
    try:
        sets = msgspec.json.decode(path.read_bytes())["sets"]
        return min(len(one["episodes"]) for one in sets)
    except (ValueError, KeyError, TypeError, RecursionError):
        return 0
