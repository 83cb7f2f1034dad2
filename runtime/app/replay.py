"""Replay: what a recording's core took in, taken in again, gives the same decisions."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from twinscrew.runtime.app.recording import DecisionHash, Recorded, Recording
from twinscrew.runtime.errors import MessageError, RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import CORE_INPUTS
from twinscrew.runtime.messages.types import Engagement, HealthEvent, Severity
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import RuntimeConfig, load_config
from twinscrew.runtime.vessel.own_odometry import SENSED, GpsImuOdometry, OdometrySource
from twinscrew.runtime.vessel.vessel import Core, make_core


@dataclass(slots=True)
class Refused:
    """Inputs that one kind of health event was about."""

    count: int
    first: str
    """What the first of them said."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """What a replay gave."""

    vessel: str
    decisions: int
    sha256: str
    recorded_decisions: int
    recorded_sha256: str
    """Of the decisions in the recording."""
    beginning_sha256: str
    """Of as many replayed decisions as were recorded."""
    whole: bool
    """False if the recording's end is missing: the recorder was killed."""
    missing: tuple[str, ...]
    """What is not there of the recording's files: see `Recording`. Decisions then differ, because
    they follow from everything that came before."""
    refused: Mapping[str, Refused]
    """By the event's name: what of the inputs could not be used."""

    @property
    def same(self) -> bool:
        """True if every recorded decision came out again, bit for bit, and no other.

        Where the recording's end is missing, the decisions on its last inputs may be, too.
        """
        again = self.sha256 if self.whole else self.beginning_sha256
        return again == self.recorded_sha256


def replay(
    recording: Recording, *, config: Path | None = None, policy: str | None = None
) -> Replay:
    """Feed a recording to the core again. It is read once.

    Where GPS and IMU are the configured source of odometry and the recording holds none, it is
    made of them.

    Parameters
    ----------
    recording
        One vessel's.
    config
        A runtime's TOML file to use instead of the recorded configuration; needed for recordings
        made elsewhere that are not to be decided on by the defaults.
    policy
        A policy to use instead of the recorded one.

    Raises
    ------
    RecordingError
        The recording is damaged, or was made with another policy file of that name.
    TwinscrewError
        The configuration or the policy cannot be used.
    """
    settings = _settings_of(recording, config, policy)
    core = _core_of(recording, settings, checked=policy is None)
    makes_odometry = settings.odometry_source == "gps_imu" and not recording.has("odometry")
    source = GpsImuOdometry(settings.estimation) if makes_odometry else None
    recorded, again = DecisionHash(), DecisionHash()
    recorded_count = 0
    refused: dict[str, Refused] = {}
    hashes = [again.hexdigest()]
    if recording.is_foreign and not recording.has("engagement"):  # decide as if the boat were ours
        core.feed("engagement", cdr.encode_engagement(Engagement(stamp_ns=0, engaged=True)))
    for message in recording.messages((*CORE_INPUTS, *SENSED, "decision")):
        if message.topic == "decision":
            recorded.add(message.payload)
            recorded_count += 1
            continue
        for topic, payload in _fed(message, source):
            outcome = core.feed(topic, payload)
            _count(refused, outcome.events)
            if outcome.decision is not None:
                again.add(cdr.encode_decision(outcome.decision))
                hashes.append(again.hexdigest())
    return Replay(
        vessel=recording.vessel,
        decisions=len(hashes) - 1,
        sha256=again.hexdigest(),
        recorded_decisions=recorded_count,
        recorded_sha256=recorded.hexdigest(),
        beginning_sha256=hashes[min(recorded_count, len(hashes) - 1)],
        whole=recording.whole,
        missing=recording.missing,
        refused=refused,
    )


def combined_sha256(digests: Iterable[str]) -> str:
    """Give one SHA-256 for several vessels' digests, in their order; a single one is itself."""
    several = tuple(digests)
    if len(several) == 1:
        return several[0]
    return hashlib.sha256("".join(several).encode("ascii")).hexdigest()


def _count(refused: dict[str, Refused], events: Iterable[HealthEvent]) -> None:
    for event in events:
        if event.severity is not Severity.INFO:
            refused.setdefault(event.name, Refused(0, event.detail)).count += 1


def _fed(message: Recorded, source: OdometrySource | None) -> Iterator[tuple[str, bytes]]:
    """Give what the core takes in of a message; `source` makes odometry of GPS and IMU, if any."""
    if message.topic not in SENSED:
        if message.topic == "points" and source is not None:
            yield from (("odometry", payload) for payload in source.payloads())
        yield message.topic, message.payload
    elif source is not None:
        with suppress(MessageError):  # on the boat, a health event
            source.sense(message.topic, message.payload)


def _settings_of(recording: Recording, config: Path | None, policy: str | None) -> RuntimeConfig:
    if config is not None:
        settings = load_config(config)
    else:
        values = recording.metadata.get("config", {})
        settings = convert(values, RuntimeConfig, file=recording.path)
    if policy is None:
        return settings
    values = {**msgspec.to_builtins(settings), "policy": policy}
    return convert(values, RuntimeConfig, file=recording.path)


def _core_of(recording: Recording, settings: RuntimeConfig, *, checked: bool) -> Core:
    """Make the core; if `checked`, only with the very policy of the recording."""
    core = make_core(settings)
    expected = recording.metadata.get("policy_sha256", "")
    found = getattr(core.pipeline.policy, "sha256", "")
    if checked and expected and found != expected:
        raise RecordingError(
            f"{recording.path}: made with a policy of SHA-256 {expected[:12]}..., but "
            f"{settings.policy} is now {found[:12]}...; name the file with --policy"
        )
    return core
