"""Replay: what a recording's vessel took in, taken in again, gives the same decisions."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import CORE_INPUTS
from twinscrew.runtime.messages.types import HealthEvent, Severity
from twinscrew.runtime.recording.recording import DecisionHash, Recording
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import SENSED, RuntimeConfig, load_config
from twinscrew.runtime.vessel.vessel import Vessel, vessel_for_replay


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
    """Feed a recording to the vessel again. It is read once.

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
    vessel = _vessel_of(recording, settings, checked=policy is None)
    recorded, again = DecisionHash(), DecisionHash()
    recorded_count = 0
    refused: dict[str, Refused] = {}
    hashes = [again.hexdigest()]
    if recording.is_foreign and not recording.has("engagement"):  # decide as if the boat were ours
        vessel.engaged = True
    for message in recording.messages((*CORE_INPUTS, *SENSED, "decision")):
        if message.topic == "decision":
            recorded.add(message.payload)
            recorded_count += 1
            continue
        out = vessel.handle(Received(message.topic, message.payload, 0), 0.0)
        made = () if out.decision is None else out.decision.events
        _count(refused, (event for event in out.events if event not in made))
        if out.decision is not None:
            again.add(cdr.encode_decision(out.decision))
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


def _vessel_of(recording: Recording, settings: RuntimeConfig, *, checked: bool) -> Vessel:
    """Make the vessel; if `checked`, only with the very policy of the recording."""
    vessel = vessel_for_replay(
        settings, has_odometry=recording.has("odometry"), has_chart=recording.has("chart")
    )
    expected = recording.metadata.get("policy_sha256", "")
    found = getattr(vessel.pipeline.policy, "sha256", "")
    if checked and expected and found != expected:
        raise RecordingError(
            f"{recording.path}: made with a policy of SHA-256 {expected[:12]}..., but "
            f"{settings.policy} is now {found[:12]}...; name the file with --policy"
        )
    return vessel
